//! That every engine has the same scene: errors that were published for it, and motions that are known.

use drystone::glam::{Quat, Vec3};
use drystone::metrics::{Penetration, in_place_count};
use drystone::{Body, Joint, Reference, Shape, Simulation, SolverConfig, World};
use drystone_scenes::Scene;
use drystone_peers::{Engine, Entrant};

/// The world after `steps` of the scene, by an engine at its defaults.
fn run(engine: Engine, scene: &Scene, steps: u32) -> World {
    run_at(&Entrant::default_of(engine), scene, steps)
}

fn run_at(entrant: &Entrant, scene: &Scene, steps: u32) -> World {
    let mut contender = entrant.build(scene, 1).expect("an engine takes the scene");
    (0..steps).for_each(|_| contender.step().expect("a step"));
    contender.world().clone()
}

/// By drystone's own query, at the poses of a world.
fn penetration(world: &World) -> Penetration {
    let backend = Box::new(Reference::<f32>::new());
    Simulation::with(world.clone(), SolverConfig::default(), backend).expect("a world").penetration()
}

/// Deepest and mean overlap at the end of a scene of the catalogue [mm].
fn overlap(entrant: &Entrant, name: &str, parameters: &[&str]) -> [f64; 2] {
    let parameters: Vec<_> = parameters.iter().map(|&p| p.to_owned()).collect();
    let scene = Scene::find(name, &parameters).expect("a scene of the catalogue");
    let world = run_at(entrant, &scene, scene.steps);
    assert_eq!(in_place_count(&scene.world, &world), scene.world.dynamic_count(), "{entrant:?} in {name}");
    let Penetration { max, mean, .. } = penetration(&world);
    [max * 1e3, mean * 1e3]
}

/// Overlaps that other harnesses measured with rapier3d 0.36 and Box3D 0.1 at their defaults, from poses, by an exact test of
/// separating axes. A wrong mass, stiffness, size or step changes them all.
#[test]
fn published_overlaps_are_met() {
    for (name, parameters, engine, [deepest, mean]) in [
        ("tower", ["n=10"], Engine::Rapier, [4.97, 2.55]),
        ("tower", ["n=10"], Engine::Box3d, [4.97, 2.55]),
        ("tower", ["n=20"], Engine::Rapier, [10.54, 5.33]),
        ("tower", ["n=20"], Engine::Box3d, [10.51, 5.32]),
        ("pyramid", ["base=20"], Engine::Rapier, [3.3, 1.60]),
        ("pyramid", ["base=20"], Engine::Box3d, [3.3, 1.61]),
    ] {
        let measured = overlap(&Entrant::default_of(engine), name, &parameters);
        for (measured, published) in measured.into_iter().zip([deepest, mean]) {
            // Published with two or three digits.
            let off = (measured / published - 1.0).abs();
            assert!(off < 0.006, "{engine:?} in {name} {parameters:?}: {measured} mm, published {published} mm");
        }
    }
}

/// Mean overlaps that another harness measured with PhysX 5.1, TGS, on one thread. PGS has 6.3 and 2.7 mm.
#[test]
#[cfg(feature = "physx")]
fn published_overlaps_of_tgs_are_met() {
    for (substeps, published) in [(4, 1.219), (8, 0.257)] {
        let entrant = Entrant { substeps, ..Entrant::default_of(Engine::Physx) };
        let [_, measured] = overlap(&entrant, "pyramid", &["base=20"]);
        let off = (measured / published - 1.0).abs();
        assert!(off < 0.05, "{substeps} iterations: {measured} mm, published {published} mm");
    }
}

/// Off by one setting, the published overlap must not be met.
#[test]
fn another_stiffness_gives_another_overlap() {
    let scene = Scene::find("tower", &[]).expect("a scene");
    for engine in [Engine::Rapier, Engine::Box3d] {
        let stiffer = Entrant { substeps: 8, frequency: Some(0.125), ..Entrant::default_of(engine) };
        let mut contender = stiffer.build(&scene, 1).expect("an engine");
        (0..scene.steps).for_each(|_| contender.step().expect("a step"));
        let deepest = penetration(contender.world()).max * 1e3;
        // Twice the frequency, a quarter of the overlap.
        assert!((deepest / 4.97 - 0.25).abs() < 0.0025, "{engine:?}: {deepest} mm");
    }
}

#[test]
fn friction_of_two_materials_is_their_geometric_mean() {
    // mu = sqrt(0.8 0.05) = 0.2 on 20 degrees; the arithmetic mean, 0.425, would hold the block.
    let (angle, mu) = (20.0_f32.to_radians(), 0.2_f32);
    let mut world = World::new();
    let normal = Vec3::new(angle.sin(), angle.cos(), 0.0);
    world.insert(Body::fixed().shape(Shape::half_space(normal)).friction(0.8));
    let start = 0.5 * normal;
    let block = Body::dynamic().shape(Shape::cuboid(0.5, 0.5, 0.5)).friction(0.05);
    let turned = block.rotation(Quat::from_rotation_z(-angle)).position(start.x, start.y, start.z);
    let block = world.insert(turned);
    let scene = Scene::new("slope", world, 120);
    for engine in Engine::built() {
        let moved = run(engine, &scene, 120).bodies[block].position.distance(start);
        let expected = 0.5 * 9.81 * (angle.sin() - mu * angle.cos()) * 4.0;
        assert!((moved / expected - 1.0).abs() < 0.02, "{engine:?}: {moved} m, not {expected} m");
    }
}

#[test]
fn a_compound_flies_straight_about_its_center_of_mass() {
    let mut world = World::new();
    world.gravity = Vec3::ZERO;
    let (linear, angular) = (Vec3::new(1.0, 2.0, 3.0), Vec3::new(0.3, 0.5, -0.4));
    let body = Body::dynamic()
        .shape(Shape::cuboid(1.0, 0.2, 0.2))
        .shape_at(Shape::ball(0.3), Vec3::new(1.0, 0.6, 0.1), Quat::IDENTITY)
        .position(4.0, 5.0, 6.0)
        .rotation(Quat::from_rotation_x(0.7))
        .velocity(linear, angular);
    let (start, spin) = (body.center_of_mass(), body.angular_momentum());
    world.insert(body);
    let scene = Scene::new("flight", world, 30);
    for engine in Engine::built() {
        let after = &run(engine, &scene, 30).bodies[0];
        let off = after.center_of_mass().distance(start + 0.5 * linear);
        assert!(off < 1e-4, "{engine:?}: {off} m beside its line");
        // About the origin the orbital part is the larger by far; compared about the center.
        let own = |b: &Body, momentum: drystone::glam::DVec3| {
            let orbital = b.center_of_mass().as_dvec3().cross(b.linear_velocity.as_dvec3());
            momentum - f64::from(b.mass.mass) * orbital
        };
        let (before, after) = (own(&scene.world.bodies[0], spin), own(after, after.angular_momentum()));
        // Box3D's implicit Euler step loses some of it.
        let lost = (after - before).length() / before.length();
        assert!(lost < 0.02, "{engine:?}: angular momentum changed by {lost}");
    }
}

#[test]
fn restitution_of_two_materials_is_the_larger() {
    // A ball falls by 1 m and comes back by e²; the mean of both, 0.4, would bring it to 0.16 m.
    let mut world = World::new();
    world.insert(Body::fixed().shape(Shape::half_space(Vec3::Y)));
    let ball = world.insert(Body::dynamic().shape(Shape::ball(0.5)).position(0.0, 1.5, 0.0).restitution(0.8));
    let scene = Scene::new("bounce", world, 60);
    for engine in Engine::built() {
        let heights = (30..60).map(|steps| run(engine, &scene, steps).bodies[ball].position.y - 0.5);
        let peak = heights.fold(0.0, f32::max);
        // Bullet sees the ball when it overlaps, pushes a fifth of up to 0.04 m of overlap out within the step of the blow, and lets the ball
        // keep that speed: 0.48 m/s.
        let most =
            if engine == Engine::Bullet { (0.8 * (19.62_f32.sqrt() + 0.16) + 0.48).powi(2) / 19.62 } else { 0.704 };
        assert!(peak > 0.576 && peak < most, "{engine:?}: {peak} m, at most {most} m");
    }
}

#[test]
fn a_force_pushes_in_every_step_and_a_spinning_drum_turns() {
    let mut world = World::new();
    world.gravity = Vec3::ZERO;
    let pushed = world.insert(Body::dynamic().shape(Shape::ball(0.5)).total_mass(2.0));
    world.bodies[pushed].force = Vec3::new(3.0, 0.0, -1.0);
    let drum = Body::kinematic().shape_at(Shape::ball(0.1), Vec3::X, Quat::IDENTITY).position(5.0, 0.0, 0.0);
    let drum = world.insert(drum.velocity(Vec3::Y, Vec3::new(0.0, 0.0, 2.0)));
    let scene = Scene::new("push", world, 60);
    for engine in Engine::built() {
        let after = run(engine, &scene, 60);
        let off = after.bodies[pushed].linear_velocity.distance(Vec3::new(1.5, 0.0, -0.5));
        assert!(off < 1e-5, "{engine:?}: {off} m/s");
        let (turned, moved) = (after.bodies[drum].rotation, after.bodies[drum].position);
        let angle = turned.angle_between(Quat::from_rotation_z(2.0));
        assert!(angle < 0.01 && moved.distance(Vec3::new(5.0, 1.0, 0.0)) < 1e-3, "{engine:?}: {angle} rad, {moved}");
    }
}

#[test]
fn joints_hold_and_a_pendulum_swings_with_its_period() {
    // A ball on a long arm: T = 2 pi sqrt((l + 2 r²/(5 l))/g) for small angles.
    let (length, radius, lift) = (1.0_f32, 0.1_f32, 0.05_f32);
    let mut world = World::new();
    let turn = Quat::from_rotation_z(lift);
    let start = turn * Vec3::new(0.0, -length, 0.0);
    let ball = Body::dynamic().shape(Shape::ball(radius)).rotation(turn).position(start.x, start.y, start.z);
    let ball = world.insert(ball);
    world.insert_joint(Joint::to_world(ball, Vec3::new(0.0, length, 0.0), Vec3::ZERO));
    let period = std::f32::consts::TAU * ((length + 0.4 * radius * radius / length) / 9.81).sqrt();
    let steps = (period * 60.0).round() as u32;
    let scene = Scene::new("pendulum", world, steps);
    for engine in Engine::built() {
        let after = run(engine, &scene, steps);
        let (end, gap) = (after.bodies[ball].position, after.joint_gap());
        assert!(end.distance(start) < 0.005 && gap < 1e-3, "{engine:?}: {} m off, gap {gap} m", end.distance(start));
    }
}

/// One of every shape, on a half-space, a mesh and a height field.
#[test]
fn every_shape_of_the_catalogue_rests_where_it_fell() {
    let scene = Scene::find("drop", &[]).expect("a scene");
    for engine in Engine::built() {
        let world = run(engine, &scene, scene.steps);
        let deepest = penetration(&world).max;
        let lowest = world.bodies.iter().map(|b| b.position.y).fold(f32::INFINITY, f32::min);
        assert!(deepest < 0.05 && lowest > -1.0, "{engine:?}: {deepest} m deep, lowest at {lowest} m");
    }
}

/// Margins of an engine lie inside of the shapes, or are none: each shape alone lies as high as its half height.
#[test]
fn every_shape_lies_as_high_as_it_is() {
    let corners = [(0.6, 0.0, 0.4), (-0.6, 0.0, 0.4), (0.0, 0.0, -0.7), (0.3, 0.5, 0.0), (-0.3, 0.5, 0.0)];
    let plate = || {
        let corner = |x, z| Vec3::new(x, 0.0, z);
        let corners = vec![corner(-4.0, -4.0), corner(-4.0, 4.0), corner(4.0, 4.0), corner(4.0, -4.0)];
        Shape::mesh(corners, vec![[0, 1, 2], [0, 2, 3]]).expect("a mesh")
    };
    let grounds = [
        (Shape::half_space(Vec3::Y), 0.0, "half-space"),
        (Shape::cuboid(4.0, 0.5, 4.0), -0.5, "box"),
        (plate(), 0.0, "mesh"),
    ];
    let shapes = [
        (Shape::ball(0.5), 0.5),
        (Shape::cuboid(0.5, 0.4, 0.3), 0.4),
        (Shape::capsule(0.5, 0.3), 0.8),
        (Shape::cylinder(0.5, 0.4), 0.5),
        (Shape::cone(0.5, 0.4), 0.5),
        (Shape::convex_hull(&corners.map(Vec3::from)).expect("a hull"), 0.0),
    ];
    for (ground, below, name) in grounds {
        for (shape, height) in &shapes {
            let mut world = World::new();
            world.insert(Body::fixed().shape(ground.clone()).position(0.0, below, 0.0));
            let lying = world.insert(Body::dynamic().shape(shape.clone()).position(0.0, height + 0.01, 0.0));
            let scene = Scene::new("lies", world, 60);
            for engine in Engine::built() {
                let y = run(engine, &scene, 60).bodies[lying].position.y;
                assert!((y - height).abs() < 5e-3, "{engine:?}: {shape:?} on a {name} at {y} m, not {height} m");
            }
        }
    }
}

/// Boxes of all sizes and densities fall freely, land, and lie in their container.
#[test]
fn a_mixed_pile_falls_and_comes_to_lie() {
    let scene = Scene::find("pile-mixed", &["n=64".to_owned()]).expect("a scene");
    let height = |world: &World| {
        let weighted = |b: &Body| f64::from(b.mass.mass) * f64::from(b.center_of_mass().y);
        world.dynamic().map(weighted).sum::<f64>() / world.dynamic().map(|b| f64::from(b.mass.mass)).sum::<f64>()
    };
    let start = height(&scene.world);
    let (low, high) = scene.container.expect("a container");
    for engine in Engine::built() {
        // No box lands within three steps.
        let fallen = start - height(&run(engine, &scene, 3));
        let (step, free) = (f64::from(scene.dt), 9.81 * f64::from(scene.dt).powi(2) * 4.5);
        // The order of velocity and position in a step shifts the fall by half a step.
        assert!((fallen - free).abs() < 9.81 * step * step * 1.6, "{engine:?}: fell {fallen} m, not {free} m");
        let after = run(engine, &scene, 300);
        let lies = |b: &Body| b.position.cmpge(low).all() && b.position.cmple(high).all();
        let lying = after.dynamic().filter(|b| lies(b)).count();
        let Penetration { max, mean, .. } = penetration(&after);
        assert!(lying == 64 && mean < 5e-3, "{engine:?}: {lying} of 64, overlap {mean} m, deepest {max} m");
        assert!(height(&after) < start - 0.5, "{engine:?}: the pile hangs at {} m", height(&after));
    }
}

/// The largest hull that an engine lacks is refused with one line, and the next scene still works.
#[test]
fn a_hull_with_too_many_corners_is_taken_or_refused() {
    let golden = 2.399_963_2_f32;
    let corner = |i: usize| {
        let y = 1.0 - (2 * i + 1) as f32 / 600.0;
        let r = (1.0 - y * y).sqrt();
        Vec3::new(r * (golden * i as f32).cos(), y, r * (golden * i as f32).sin())
    };
    let hull = Shape::convex_hull(&(0..600).map(corner).collect::<Vec<_>>()).expect("a hull");
    let mut world = World::new();
    world.insert(Body::dynamic().shape(hull));
    let scene = Scene::new("hull", world, 1);
    for engine in Engine::built() {
        let (said, heard) = std::sync::mpsc::channel();
        let scene = scene.clone();
        std::thread::spawn(move || {
            said.send(Entrant::default_of(engine).build(&scene, 1).err().map(|e| e.to_string()))
        });
        let refused = heard.recv_timeout(std::time::Duration::from_secs(20)).expect("an engine that answers");
        assert!(refused.is_none_or(|message| message.contains("has no shape like")), "{engine:?}");
    }
}

#[test]
#[cfg(feature = "physx")]
fn more_iterations_than_physx_takes_are_refused() {
    let scene = Scene::find("tower", &[]).expect("a scene");
    let entrant = Entrant { substeps: 256, ..Entrant::default_of(Engine::Physx) };
    let refused = entrant.build(&scene, 1).err().expect("an error");
    assert_eq!(refused.to_string(), "256 substeps: PhysX takes at most 255");
}

#[test]
fn an_engine_is_refused_by_a_build_without_it() {
    let scene = Scene::find("tower", &[]).expect("a scene");
    let named = [(Engine::Physx, "PhysX", "physx", cfg!(feature = "physx")), (Engine::Bullet, "Bullet", "bullet", cfg!(feature = "bullet"))];
    for (engine, name, feature, is_built) in named {
        let refused = Entrant::default_of(engine).build(&scene, 1).err().map(|error| error.to_string());
        let line = format!("{name} is not in this build; build with --features {feature}");
        assert_eq!(refused, (!is_built).then_some(line));
        assert_eq!(Engine::built().contains(&engine), is_built);
    }
}

#[test]
#[cfg(not(feature = "parallel"))]
fn several_threads_are_refused_by_a_rapier_built_for_one() {
    let scene = Scene::find("tower", &[]).expect("a scene");
    let refused = Entrant::default_of(Engine::Rapier).build(&scene, 2).err().expect("an error");
    assert_eq!(refused.to_string(), "rapier was built for one thread; build with --features parallel");
}

#[test]
#[cfg(feature = "bullet")]
fn several_threads_are_refused_by_bullet_and_leave_it_out() {
    let scene = Scene::find("tower", &[]).expect("a scene");
    let refused = Entrant::default_of(Engine::Bullet).build(&scene, 2).err().expect("an error");
    assert_eq!(refused.to_string(), "bullet runs on one thread here, not on 2");
    assert!(Engine::on(1).contains(&Engine::Bullet) && !Engine::on(2).contains(&Engine::Bullet));
}

/// A tower of five boxes stands by each solver, and more iterations or substeps leave less overlap. One of ten falls at the defaults.
#[test]
#[cfg(feature = "bullet")]
fn the_settings_of_bullet_reach_it() {
    use drystone_peers::BulletSolver::{Dantzig, Nncg, Sequential};
    let of = |solver, substeps, iterations| {
        let entrant = Entrant { solver, substeps, iterations, ..Entrant::default_of(Engine::Bullet) };
        overlap(&entrant, "tower", &["n=5"])[1]
    };
    let (usual, more, finer) = (of(Sequential, 1, 10), of(Sequential, 1, 100), of(Sequential, 8, 10));
    let (gradient, pivots) = (of(Nncg, 1, 10), of(Dantzig, 1, 10));
    assert!(
        more < 0.1 * usual && finer < 0.1 * usual,
        "{usual} mm, {more} mm with iterations, {finer} mm with substeps"
    );
    // The solvers differ.
    assert!(gradient != usual && pivots < 0.8 * usual, "{usual} mm, {gradient} mm by NNCG, {pivots} mm by Dantzig");
}

/// The board is a mesh that moves, and the ball as small as 3 cm: the world is given to Bullet larger.
#[test]
#[cfg(feature = "bullet")]
fn bullet_plays_the_maze() {
    use drystone_maze::{Map, Outcome, pilot, play};
    let begin = || drystone_peers::bullet_game(Map::find("easy").expect("a board"), 4, 0.03).expect("a game");
    let script = pilot(begin()).expect("a script that wins");
    let played = play(begin(), &script, |_| ()).expect("a game");
    assert_eq!(played.outcome, Outcome::Goal, "after {} s", played.time);
}
