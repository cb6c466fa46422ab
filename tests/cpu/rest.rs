//! A structure that is built in place begins with the impulses and preloads that it rests with, and what is about to fall falls.

use drystone::config::{FrictionAt, Stabilization};
use drystone::glam::{Quat, Vec3};
use drystone::metrics::rms_speed;
use drystone::{Body, BodyHandle, BodyKind, Cpu, Reference, Shape, Simulation, SolverConfig, World};
use drystone_conform::compare::Difference;
use drystone_scenes::Scene;

const DT: f32 = 1.0 / 60.0;

fn started(world: &World, config: SolverConfig) -> Simulation {
    Simulation::with(world.clone(), config, Box::new(Cpu::new())).expect("a good world")
}

fn awake() -> SolverConfig {
    SolverConfig::default().without_sleep()
}

fn run(simulation: &mut Simulation, steps: u32) {
    (0..steps).for_each(|_| drop(simulation.step(DT).expect("a step")));
}

fn floor() -> World {
    let mut world = World::new();
    world.insert(Body::fixed().shape(Shape::half_space(Vec3::Y)).friction(0.5));
    world
}

fn cube() -> Body {
    Body::dynamic().shape(Shape::cuboid(0.5, 0.5, 0.5)).friction(0.5)
}

/// Upward force on what can move, over its weight, by the contacts of the last substep of a step (N/N).
fn share_borne_by_the_floor(simulation: &mut Simulation) -> f32 {
    let world = simulation.world.clone();
    let weight: f32 = world.bodies.iter().filter(|b| b.kind == BodyKind::Dynamic).map(|b| b.mass.mass * 9.81).sum();
    let upward = |m: drystone::SolvedManifold| {
        let [a, b] = [m.a, m.b].map(|side| world.bodies[side.body].kind == BodyKind::Dynamic);
        let points = m.points().iter().map(|p| p.friction_impulse.y).sum::<f32>() + m.friction_impulse.y;
        let impulse = m.normal.y * m.normal_impulse() + points;
        let sign = f32::from(i8::from(b) - i8::from(a));
        sign * impulse * m.substeps as f32 / DT
    };
    simulation.manifolds().map(upward).sum::<f32>() / weight
}

/// The largest normal impulse with which a body begins (N s).
fn begins_with(simulation: &mut Simulation, body: BodyHandle) -> f32 {
    let (problem, _) = simulation.next_problem(DT).expect("a problem");
    let own = problem.swept_contacts().filter(|c| [c.body_a, c.body_b].contains(&(body.index() as u32)));
    own.flat_map(|c| &problem.impulses[c.first_point as usize..][..c.point_count as usize])
        .fold(0.0, |most, i| most.max(i.normal))
}

fn fastest(world: &World) -> f32 {
    world.bodies.iter().map(|b| b.linear_velocity.length()).fold(0.0, f32::max)
}

/// Without impulses at the start a pyramid of 50 rows sinks in by 2.6 mm in these steps, a wall by 2.2 mm and a tower under 1000 times by
/// 3.5 mm, at up to 0.35 m/s.
#[test]
fn structures_that_are_built_in_place_do_not_sink_and_come_up_again() {
    for (name, parameters, overlap, speed) in [
        ("pyramid", "base=60", 1e-5, 1e-4),
        ("tower", "n=10", 1e-5, 1e-4),
        ("tower", "top_ratio=1000", 1e-5, 1e-4),
        ("mass-ratio", "n=20", 1e-5, 1e-4),
        ("wall", "rows=10", 3e-5, 1e-4),
        ("many-pyramids", "n=4", 1e-5, 1e-4),
        ("kapla", "storeys=6", 2e-4, 3e-3),
    ] {
        let scene = Scene::find(name, &[parameters.to_owned()]).expect("a scene of the catalogue");
        let mut simulation = started(&scene.world, awake());
        for step in 0..60 {
            simulation.step(DT).expect("a step");
            let (deepest, rms) = (simulation.solved_penetration().max, rms_speed(&simulation.world));
            assert!(deepest < overlap && rms < speed, "{name} {parameters}, step {step}: {deepest} m, {rms} m/s");
            let borne = share_borne_by_the_floor(&mut simulation);
            assert!((borne - 1.0).abs() < 0.025, "{name} {parameters}, step {step}: {borne} of its weight");
        }
    }
}

/// The difficulty of these cases: friction with a row of its own, no preload, rigid contacts.
#[test]
fn all_rules_begin_at_rest() {
    let tower = |n: &str| Scene::find("tower", &[n.to_owned()]).expect("a scene of the catalogue").world;
    // Without springs and relax sweeps rounding alone makes towers of 25 to 30 cubes sway at up to 8 mm/s, and taller ones fall.
    let (tall, low) = (tower("n=30"), tower("n=20"));
    // Two cubes on a slope of 0.3 rad.
    let mut slope = World::new();
    let turn = Quat::from_rotation_z(0.3);
    let along = |x: f32, y: f32| turn * Vec3::new(x, y, 0.0);
    slope.insert(Body::fixed().shape(Shape::cuboid(5.0, 0.5, 5.0)).friction(0.5).rotation(turn));
    for y in [1.0, 2.0] {
        let at = along(0.0, y);
        slope.insert(cube().position(at.x, at.y, at.z).rotation(turn));
    }
    for (what, world) in [("tower", &tall), ("slope", &slope)] {
        for (rule, config) in [
            ("default", awake()),
            ("friction per manifold", awake().with(|c| c.friction_at = FrictionAt::Manifold)),
            ("rigid", awake().with(|c| (c.stabilization, c.relax) = (Stabilization::Baumgarte, 0))),
        ] {
            let world = if (what, rule) == ("tower", "rigid") { &low } else { world };
            let mut simulation = started(world, config);
            for step in 0..60 {
                simulation.step(DT).expect("a step");
                let speed = fastest(&simulation.world);
                assert!(speed < 3e-3, "{what}, {rule}, step {step}: {speed} m/s");
            }
            let borne = share_borne_by_the_floor(&mut simulation);
            assert!((borne - 1.0).abs() < 0.01, "{what}, {rule}: {borne} of its weight");
        }
    }
    // Without a preload the springs have to yield, but the tower comes up at no time.
    let mut simulation = started(&tall, awake().with(|c| c.preload_rate = 0.0));
    for step in 0..120 {
        simulation.step(DT).expect("a step");
        let up = simulation.world.bodies.iter().map(|b| b.linear_velocity.y).fold(0.0, f32::max);
        assert!(up < 2e-3, "step {step}: {up} m/s");
    }
}

#[test]
fn a_box_above_its_support_falls() {
    let mut world = floor();
    let above = world.insert(cube().position(0.0, 0.501, 0.0));
    let mut simulation = started(&world, awake());
    assert_eq!(begins_with(&mut simulation, above), 0.0);
    run(&mut simulation, 10);
    let height = simulation.world.bodies[above].position.y;
    assert!((height - 0.5).abs() < 1.5e-4, "{height} m");
}

/// A box that slides down a slope gains g (sin - mu cos) in every second, as if it had begun without impulses.
#[test]
fn a_box_on_a_slope_slides() {
    let (angle, friction) = (0.5_f32, 0.3_f32);
    let turn = Quat::from_rotation_z(angle);
    let mut world = World::new();
    world.insert(Body::fixed().shape(Shape::cuboid(20.0, 0.5, 5.0)).friction(friction).rotation(turn));
    let at = turn * Vec3::Y;
    let body = world.insert(cube().friction(friction).position(at.x, at.y, at.z).rotation(turn));
    let mut simulation = started(&world, awake());
    assert_eq!(begins_with(&mut simulation, body), 0.0);
    run(&mut simulation, 30);
    let speed = simulation.world.bodies[body].linear_velocity.length();
    let expected = 9.81 * (angle.sin() - friction * angle.cos()) * 0.5;
    assert!((speed / expected - 1.0).abs() < 0.02, "{speed} m/s, not {expected}");
}

/// A beam whose center lies beyond the edge that it rests on tips at once; with a weight on its other end it stays.
#[test]
fn an_overhang_tips_unless_a_weight_holds_it() {
    for (weight, stays) in [(0.0, false), (400.0, false), (4000.0, true)] {
        let mut world = floor();
        world.insert(Body::fixed().shape(Shape::cuboid(0.5, 0.5, 0.5)).position(0.0, 0.5, 0.0));
        let beam = world
            .insert(Body::dynamic().shape(Shape::cuboid(2.0, 0.1, 0.5)).total_mass(1000.0).position(1.0, 1.1, 0.0));
        if weight > 0.0 {
            world.insert(cube().total_mass(weight).position(-0.5, 1.7, 0.0));
        }
        let mut simulation = started(&world, awake());
        assert_eq!(begins_with(&mut simulation, beam) > 0.0, stays, "{weight} kg");
        for step in 0..60 {
            simulation.step(DT).expect("a step");
            let speed = fastest(&simulation.world);
            assert!(!stays || speed < 5e-3, "{weight} kg, step {step}: {speed} m/s");
        }
        let turned = 2.0 * simulation.world.bodies[beam].rotation.z.abs().asin();
        assert_eq!(turned > 0.2, !stays, "{weight} kg: {turned} rad");
    }
}

/// A table that has lost a leg, with a tower on it, and a whole table beside it.
#[test]
fn a_table_without_one_of_its_legs_falls_and_a_whole_one_stands() {
    let mut world = floor();
    let mut tables = Vec::new();
    for (x, legs) in [(0.0, 4), (10.0, 3)] {
        for (dx, dz) in [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)].into_iter().take(legs) {
            world.insert(Body::dynamic().shape(Shape::cuboid(0.1, 0.5, 0.1)).position(x + dx, 0.5, dz));
        }
        let top = world.insert(Body::dynamic().shape(Shape::cuboid(1.2, 0.1, 1.2)).position(x, 1.1, 0.0));
        // Over the leg that may be missing.
        let load = world.insert(cube().position(x - 0.5, 1.7, -0.5));
        tables.push([top, load]);
    }
    let mut simulation = started(&world, awake());
    let begin = tables.iter().flatten().map(|&body| begins_with(&mut simulation, body) > 0.0).collect::<Vec<_>>();
    assert_eq!(begin, [true, true, false, false]);
    run(&mut simulation, 60);
    let [whole, broken] = [&tables[0], &tables[1]].map(|t| simulation.world.bodies[t[0]].rotation.to_axis_angle().1);
    assert!(whole < 1e-4 && broken > 0.1, "{whole} and {broken} rad");
}

/// Blocks that each stick out by 0.3 of their length: three are held, and of six the upper three tip.
#[test]
fn a_leaning_tower_is_held_as_far_as_its_weight_lies_over_its_foot() {
    for (blocks, held) in [(3, 3), (6, 3)] {
        let mut world = floor();
        let tower: Vec<BodyHandle> =
            (0..blocks).map(|k| world.insert(cube().position(0.3 * k as f32, 0.5 + k as f32, 0.0))).collect();
        let mut simulation = started(&world, awake());
        for (k, &block) in tower.iter().enumerate() {
            assert_eq!(begins_with(&mut simulation, block) > 0.0, k < held, "block {k} of {blocks}");
        }
        run(&mut simulation, 90);
        let turned = simulation.world.bodies[tower[blocks - 1]].rotation.to_axis_angle().1;
        assert_eq!(turned > 0.05, held < blocks, "{blocks} blocks: {turned} rad");
    }
}

#[test]
fn what_moves_begins_without_impulses_and_so_does_all_on_it() {
    let mut world = floor();
    let moving = world.insert(cube().position(0.0, 0.5, 0.0).velocity(Vec3::X, Vec3::ZERO));
    let on_it = world.insert(cube().position(0.0, 1.5, 0.0));
    let belt = world.insert(
        Body::kinematic().shape(Shape::cuboid(2.0, 0.5, 2.0)).position(10.0, 0.5, 0.0).velocity(Vec3::X, Vec3::ZERO),
    );
    let on_belt = world.insert(cube().position(10.0, 1.5, 0.0));
    let still = world.insert(cube().position(20.0, 0.5, 0.0));
    let mut simulation = started(&world, awake());
    let begin = [moving, on_it, belt, on_belt, still].map(|body| begins_with(&mut simulation, body) > 0.0);
    assert_eq!(begin, [false, false, false, false, true]);
}

/// A cube is put on a tower while the tower stands there, asleep or not.
#[test]
fn a_body_that_is_placed_later_is_borne_at_once() {
    for config in [awake(), SolverConfig::default()] {
        let mut world = floor();
        for k in 0..8 {
            world.insert(cube().position(0.0, 0.5 + k as f32, 0.0));
        }
        let late = world.insert(cube().position(10.0, 0.5, 0.0));
        let mut both = [
            started(&world, config.clone()),
            Simulation::with(world, config, Box::new(Reference::<f32>::new())).expect("a good world"),
        ];
        for simulation in &mut both {
            run(simulation, 100);
            simulation.world.bodies[late].position = Vec3::new(0.1, 8.5, 0.0);
            (simulation.world.bodies[late].linear_velocity, simulation.world.bodies[late].angular_velocity) =
                (Vec3::ZERO, Vec3::ZERO);
            assert!(begins_with(simulation, late) > 0.0);
            simulation.step(DT).expect("a step");
            assert!((share_borne_by_the_floor(simulation) - 1.0).abs() < 0.01);
            for step in 0..60 {
                simulation.step(DT).expect("a step");
                let speed = fastest(&simulation.world);
                // It lies 0.1 m beside the middle, so that the springs tilt. Without impulses it begins with 0.16 m/s.
                assert!(speed < 1e-2, "step {step}: {speed} m/s");
            }
        }
        assert_eq!(Difference::between(&both[0].world, &both[1].world).bodies, 0);
    }
}

/// Contacts that arise while bodies move begin without impulses: the step before the first touch and those after it are what they were.
#[test]
fn what_lands_begins_without_impulses() {
    let mut world = floor();
    let falling = world.insert(cube().position(0.0, 0.6, 0.0));
    let mut simulation = started(&world, awake());
    let mut had_contact = false;
    for _ in 0..20 {
        let before = simulation.manifolds().count();
        if before == 0 {
            assert_eq!(begins_with(&mut simulation, falling), 0.0);
        }
        simulation.step(DT).expect("a step");
        had_contact |= simulation.manifolds().count() > 0;
    }
    assert!(had_contact);
}
