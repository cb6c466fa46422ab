//! Masses, materials and numbers of bodies that change, and changes that are refused.

use crate::common::state::handle;
use drystone::glam::{Quat, Vec3};
use drystone::{Body, Joint, Shape, Simulation, SolvedManifold, SolverConfig, World};
use drystone_conform::compare::Difference;

use super::{BOTH, DT, cpu, cube, ground, run, simulation, standing};

#[test]
fn masses_and_materials_may_change() {
    let mut simulation =
        simulation(&standing(), &SolverConfig::default().without_sleep().with(|c| c.sleep_after = 0.3), cpu);
    run(&mut simulation, 240);
    let [slope, block] = [16, 17].map(|i| simulation.world.bodies.handle(i).expect("a body"));
    assert!(simulation.is_asleep(block));
    // The slope becomes ice, though what lies on it sleeps.
    simulation.world.bodies[slope].material.friction = 0.0;
    run(&mut simulation, 30);
    let slid = simulation.world.bodies[block].linear_velocity.length();
    assert!((slid - 9.81 * 0.2_f32.sin() * 30.0 * DT).abs() < 0.02, "{slid} m/s");
    // A cube becomes a hundred times as heavy under its own weight, and what it lies on bears that.
    let force = |s: &mut Simulation| -> f32 {
        let is_top = |m: &SolvedManifold| [[4, 5], [5, 4]].contains(&[m.a, m.b].map(|side| side.body.index()));
        s.manifolds().filter(is_top).map(|m| m.normal_impulse() * m.substeps as f32 / DT).sum()
    };
    let light = force(&mut simulation);
    assert!((light / 9810.0 - 1.0).abs() < 0.02, "{light} N");
    let mass = &mut simulation.world.bodies[5].mass;
    (mass.mass, mass.principal_inertia) = (1e5, mass.principal_inertia * 100.0);
    run(&mut simulation, 200);
    let heavy = force(&mut simulation);
    assert!((heavy / 981_000.0 - 1.0).abs() < 0.05, "{heavy} N");
}

type Change = fn(&mut World);

/// The step says so and does nothing.
#[test]
fn a_wrong_body_that_came_or_changed_is_refused_in_one_line() {
    let cases: [(&str, Change); 4] = [
        ("body 24 \"light\": mass", |w| {
            w.insert(cube(0.0, 20.0, 0.0).total_mass(1e-30).named("light"));
        }),
        ("body 3 \"\": shapes[0]: cuboid of half extent -1", |w| {
            w.bodies[3].colliders[0].shape = Shape::cuboid(0.5, -1.0, 0.5);
        }),
        ("body 0 \"\": mass", |w| w.bodies[0].kind = drystone::BodyKind::Dynamic),
        ("joint 5: names body 5, which was removed", |w| {
            let [below, top] = [4, 5].map(|i| w.bodies.handle(i).expect("a cube"));
            w.joints[0].body_a = top;
            w.remove(top);
            w.insert_joint(Joint::to_world(below, Vec3::ZERO, Vec3::ZERO));
            w.joints[5].body_a = top;
        }),
    ];
    for (start, change) in cases {
        let mut simulation = simulation(&standing(), &SolverConfig::default().without_sleep(), cpu);
        run(&mut simulation, 10);
        let good = simulation.world.clone();
        change(&mut simulation.world);
        let changed = simulation.world.clone();
        let line = simulation.step(DT).expect_err(start).to_string();
        assert!(line.starts_with(start) && !line.contains('\n'), "{line}");
        assert_eq!(Difference::between(&changed, &simulation.world), Difference::default());
        // Put right, it goes on.
        simulation.world = good;
        run(&mut simulation, 10);
    }
}

#[test]
fn a_step_of_no_length_is_refused_and_leaves_the_world_as_it_was() {
    for backend in BOTH {
        let mut simulation = simulation(&standing(), &SolverConfig::default().without_sleep(), backend);
        run(&mut simulation, 5);
        let before = simulation.world.clone();
        for dt in [0.0, -DT, f32::NAN, f32::INFINITY, 1e9, 1.1, 1e-30, f32::MIN_POSITIVE] {
            let line = simulation.step(dt).expect_err("no length").to_string();
            assert!(line.starts_with("dt = "), "{line}");
            assert!(simulation.next_problem(dt).is_err());
            assert_eq!(Difference::between(&before, &simulation.world), Difference::default(), "{dt}");
        }
        for dt in [drystone::config::SHORTEST_STEP, 1e-6, DT, drystone::config::LONGEST_STEP] {
            let stats = simulation.step(dt).expect("a length");
            assert_eq!(stats.first_non_finite, None, "{dt} s");
        }
    }
}

#[test]
fn a_wrong_joint_or_mass_between_steps_is_refused_by_name() {
    let cases: [(&str, Change); 6] = [
        ("gravity", |w| w.gravity.y = f32::NAN),
        ("joint 0: names body 99, beyond the last of ", |w| w.joints[0].body_b = Some(handle(99))),
        ("joint 0: connects body 1 to itself", |w| {
            w.joints[0] = Joint::new(handle(1), Vec3::ZERO, handle(1), Vec3::ZERO)
        }),
        ("joint 0: its anchors", |w| w.joints[0].anchor_b.x = f32::NAN),
        ("body 2 \"\": mass", |w| w.bodies[2].mass.mass = -1.0),
        ("body 2 \"\": friction", |w| w.bodies[2].material.friction = f32::NAN),
    ];
    for (start, change) in cases {
        let mut simulation = simulation(&standing(), &SolverConfig::default().without_sleep(), cpu);
        run(&mut simulation, 3);
        change(&mut simulation.world);
        let line = simulation.step(DT).expect_err(start).to_string();
        assert!(line.starts_with(start), "{line}");
    }
}

/// A caller's number out of range never reaches a neighbor: the step names body and field, moves nothing, and says so until it is mended.
#[test]
fn a_number_out_of_range_is_refused_by_body_and_field_until_it_is_mended() {
    type Change = fn(&mut Body, f32);
    let changes: [(&str, Change); 12] = [
        ("position", |b, x| b.position.y = x),
        ("rotation", |b, x| b.rotation.x = x),
        ("linear velocity", |b, x| b.linear_velocity.x = x),
        ("linear velocity", |b, x| b.apply_impulse(Vec3::X * x * b.mass.mass)),
        ("linear velocity", |b, x| b.move_to(b.position + Vec3::X * x * 1e-6, b.rotation, 1e-6)),
        ("angular velocity", |b, x| b.angular_velocity.z = x),
        ("force", |b, x| b.force.y = x * b.mass.mass),
        ("force", |b, x| b.apply_force(Vec3::splat(x) * b.mass.mass)),
        ("torque", |b, x| b.apply_torque(Vec3::splat(x) * b.mass.principal_inertia)),
        ("gravity_scale", |b, x| b.gravity_scale = x),
        ("linear_damping", |b, x| b.linear_damping = x),
        ("angular_damping", |b, x| b.angular_damping = x),
    ];
    for (field, change) in changes {
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 3e38, -1e25, 2e9] {
            for (backend, early) in [(BOTH[0], true), (BOTH[1], false)] {
                let mut simulation = simulation(&standing(), &SolverConfig::default(), backend);
                run(&mut simulation, if early { 0 } else { 3 });
                let good = simulation.world.bodies[4].clone();
                change(&mut simulation.world.bodies[4], bad);
                let hash = simulation.hash();
                for _ in 0..3 {
                    let line = simulation.step(DT).expect_err(field).to_string();
                    assert!(line.starts_with(&format!("body 4 \"\": {field} = ")), "{bad}: {line}");
                    assert!(simulation.next_problem(DT).is_err_and(|e| e.to_string() == line));
                    assert_eq!(simulation.hash(), hash, "it moved");
                }
                simulation.penetration();
                simulation.world.bodies[4] = good;
                run(&mut simulation, 3);
                assert_eq!(simulation.world.first_non_finite(), None);
            }
        }
    }
    // Numbers next to zero are numbers.
    let mut simulation = simulation(&standing(), &SolverConfig::default(), cpu);
    simulation.world.bodies[4].position.x += 1e-40;
    simulation.world.bodies[4].linear_velocity.x = 1e-40;
    run(&mut simulation, 3);
}

/// A step itself may take a body out of range: that is data, which does not stop the run, nor one that was saved.
#[test]
fn a_body_that_a_step_took_out_of_range_touches_nothing() {
    for backend in BOTH {
        let mut world = standing();
        let ball = world.insert(Body::dynamic().shape(Shape::ball(0.3)).position(-20.0, 1.5, 0.0));
        let mut simulation = simulation(&world, &SolverConfig::default().without_sleep(), backend);
        run(&mut simulation, 3);
        simulation.world.bodies[4].linear_velocity.y = 0.99e9;
        simulation.world.bodies[4].position.y = 0.99e9;
        run(&mut simulation, 2);
        assert!(simulation.world.bodies[4].position.y > 1e9 && simulation.world.check().is_err());
        assert!(simulation.manifolds().all(|m| ![m.a, m.b].iter().any(|side| side.body.index() == 4)));
        let mut loaded = Simulation::load(&simulation.save(), backend()).expect("what was saved");
        for simulation in [&mut simulation, &mut loaded] {
            run(simulation, 90);
            assert_eq!(simulation.world.first_non_finite(), None);
            let y = simulation.world.bodies[ball].position.y;
            assert!((y - 0.3).abs() < 0.01, "{y}");
            // Another body, or the caller again, is refused.
            simulation.world.bodies[5].position.y = 2e9;
            assert!(simulation.step(DT).is_err_and(|e| e.to_string().starts_with("body 5 \"\": position")));
        }
    }
}

/// A cube lies as high as its present shape says.
#[test]
fn a_shape_that_changes_or_moves_within_its_body_carries_it_from_the_next_step_on() {
    let mut world = World::new();
    world.insert(ground());
    world.insert(cube(0.0, 0.5, 0.0));
    let mut simulation = simulation(&world, &SolverConfig::default().without_sleep(), cpu);
    let mut height = |change: fn(&mut Body)| {
        change(&mut simulation.world.bodies[1]);
        run(&mut simulation, 90);
        simulation.world.bodies[1].position.y
    };
    let heights = [
        height(|_| {}),
        height(|body| body.colliders[0].shape = Shape::cuboid(0.5, 0.4, 0.5)),
        height(|body| body.colliders[0].position.y = 0.1),
        height(|body| body.colliders[0].rotation = Quat::from_rotation_z(std::f32::consts::FRAC_PI_2)),
    ];
    for (height, expected) in heights.iter().zip([0.5, 0.4, 0.3, 0.4]) {
        assert!((height - expected).abs() < 1e-3, "{heights:?} m");
    }
}

/// A handle names no other body because of what was written to a vacancy.
#[test]
fn a_body_that_is_written_to_a_vacancy_is_refused_until_it_is_gone() {
    let mut simulation = simulation(&standing(), &SolverConfig::default(), cpu);
    run(&mut simulation, 3);
    simulation.world.remove(simulation.world.bodies.handle(5).expect("a body"));
    for early in [true, false] {
        if !early {
            run(&mut simulation, 3);
        }
        simulation.world.bodies[5] = cube(0.0, 30.0, 0.0).named("zombie");
        for _ in 0..2 {
            let line = simulation.step(DT).expect_err("a zombie").to_string();
            assert_eq!(line, "body 5 \"zombie\": written to a vacant index: use World::insert to add a body");
            assert_eq!(simulation.world.check().expect_err("a zombie").to_string(), line);
        }
        simulation.world.bodies[5] = Body::fixed();
    }
    let handle = simulation.world.insert(cube(0.0, 30.0, 0.0));
    assert_eq!(handle.index(), 5);
    run(&mut simulation, 3);
}
