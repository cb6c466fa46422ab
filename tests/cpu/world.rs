//! Worlds that no step can be made of are refused, by name and in one line.

use crate::common::state::handle;
use drystone::glam::{Quat, Vec3};
use drystone::queries::{Filter, Queries};
use drystone::{
    Axis, Body, BodyHandle, BodyKind, Joint, MassProperties, Reference, Shape, Simulation, SolverConfig, World,
};

fn cube() -> Body {
    Body::dynamic().shape(Shape::cuboid(0.5, 0.5, 0.5)).named("cube")
}

fn refusal(change: impl FnOnce(&mut World)) -> Option<String> {
    let mut world = World::new();
    world.insert(Body::fixed().shape(Shape::half_space(Vec3::Y)));
    world.insert(cube());
    change(&mut world);
    let made = Simulation::with(world, SolverConfig::default(), Box::new(Reference::<f32>::new()));
    made.err().map(|e| e.to_string())
}

#[test]
fn a_good_world_is_taken() {
    assert_eq!(refusal(|_| ()), None);
}

#[test]
fn bodies_at_the_ends_of_the_range_are_taken() {
    for (mass, moments) in [(1e-15, Vec3::splat(1e-30)), (1e15, Vec3::splat(1e30)), (1.0, Vec3::new(1.0, 1e-12, 1.0))] {
        let taken = refusal(|w| {
            w.bodies[1].mass.mass = mass;
            w.bodies[1].mass.principal_inertia = moments;
        });
        assert_eq!(taken, None);
    }
}

#[test]
fn what_cannot_be_simulated_is_refused_by_name() {
    type Change = fn(&mut World);
    let cases: [(&str, Change); 52] = [
        ("gravity", |w| w.gravity.y = f32::NAN),
        ("gravity", |w| w.gravity.y = -2e19),
        ("body 1 \"cube\": position", |w| w.bodies[1].position.x = f32::INFINITY),
        ("body 1 \"cube\": rotation", |w| w.bodies[1].rotation = Quat::from_xyzw(0.0, 0.0, 0.0, 2.0)),
        ("body 1 \"cube\": friction", |w| w.bodies[1].material.friction = -1.0),
        ("body 1 \"cube\": mass", |w| w.bodies[1].mass.mass = 0.0),
        ("body 1 \"cube\": mass", |w| w.bodies[1].mass.mass = 2e15),
        ("body 1 \"cube\": mass", |w| w.bodies[1].mass.mass = 5e-16),
        ("body 1 \"cube\": mass", |w| w.bodies[1].mass.principal_inertia.y = 2e30),
        ("body 1 \"cube\": mass", |w| w.bodies[1].mass.principal_inertia = Vec3::splat(5e-31)),
        ("body 1 \"cube\": mass", |w| w.bodies[1].mass.principal_inertia = Vec3::new(1.0, 1.0, 2e12)),
        ("body 1 \"cube\": center of mass", |w| w.bodies[1].mass.center.z = f32::NAN),
        ("body 2 \"\": mass", |w| {
            w.insert(Body::dynamic());
        }),
        ("body 1 \"cube\": position", |w| w.bodies[1].position.z = 2e9),
        ("body 1 \"cube\": linear velocity", |w| w.bodies[1].linear_velocity.x = -2e9),
        ("body 1 \"cube\": angular velocity", |w| w.bodies[1].angular_velocity.x = f32::NAN),
        ("body 1 \"cube\": force", |w| w.bodies[1].force.x = f32::INFINITY),
        ("body 1 \"cube\": mass", |w| w.bodies[1].mass.mass = f32::NAN),
        ("body 1 \"cube\": mass", |w| w.bodies[1].mass.mass = 1e-40),
        ("body 1 \"cube\": center of mass", |w| w.bodies[1].mass.center.x = f32::NAN),
        ("body 2 \"\": shapes[0]: ball of radius -1", |w| {
            w.insert(Body::fixed().shape(Shape::ball(-1.0)));
        }),
        ("body 2 \"\": shapes[1]: capsule of radius 0", |w| {
            w.insert(Body::fixed().shape(Shape::ball(1.0)).shape(Shape::capsule(1.0, 0.0)));
        }),
        ("body 2 \"\": shapes[0]: cuboid of half extent inf", |w| {
            w.insert(Body::fixed().shape(Shape::cuboid(1.0, f32::INFINITY, 1.0)));
        }),
        ("body 2 \"\": shapes[0]: cylinder of half height NaN", |w| {
            w.insert(Body::fixed().shape(Shape::cylinder(f32::NAN, 1.0)));
        }),
        ("body 2 \"\": shapes[0]: cylinder of radius -1", |w| {
            w.insert(Body::fixed().shape(Shape::cylinder(1.0, -1.0)));
        }),
        ("body 2 \"\": shapes[0]: cone of half height -2", |w| {
            w.insert(Body::fixed().shape(Shape::cone(-2.0, 1.0)));
        }),
        ("body 2 \"\": shapes[0]: cone of radius", |w| {
            w.insert(Body::fixed().shape(Shape::cone(1.0, 2e9)));
        }),
        ("body 2 \"\": shapes[0]: half-space: normal", |w| {
            w.insert(Body::fixed().shape(Shape::half_space(3.0 * Vec3::Y)));
        }),
        ("body 2 \"\": shapes[0]: position", |w| {
            w.insert(Body::fixed().shape_at(Shape::ball(1.0), Vec3::splat(f32::NAN), Quat::IDENTITY));
        }),
        ("body 2 \"\": shapes[0]: half-spaces", |w| {
            w.insert(Body::kinematic().shape(Shape::half_space(Vec3::Y)));
        }),
        ("joint 0: names body 7, beyond the last of 2", |w| {
            w.insert_joint(Joint::new(handle(1), Vec3::ZERO, handle(0), Vec3::ZERO));
            w.joints[0].body_b = Some(handle(7));
        }),
        ("joint 0: names body 9, beyond the last of 2", |w| {
            w.insert_joint(Joint::to_world(handle(9), Vec3::ZERO, Vec3::ZERO));
        }),
        ("body 2 \"\": mass = 0 kg: a dynamic body needs a shape", |w| {
            w.insert(Body::dynamic().sensor(Shape::ball(1.0)).total_mass(2.0));
        }),
        ("body 2 \"\": density = 0 kg/m³: must be a number above 0", |w| {
            w.insert(cube().density(0.0).named(""));
        }),
        ("body 2 \"\": density = NaN kg/m³: must be a number above 0", |w| {
            w.insert(cube().density(f32::NAN).named(""));
        }),
        ("body 2 \"\": mass = -1e0 kg: must be 1e-15 to 1e15 kg", |w| {
            w.insert(cube().total_mass(-1.0).named(""));
        }),
        ("body 0 \"\": mass = ", |w| {
            w.bodies[0] = Body::fixed().shape(Shape::ball(1.0));
            w.bodies[0].kind = BodyKind::Dynamic;
        }),
        ("joint 0: connects", |w| {
            w.insert_joint(Joint::new(handle(1), Vec3::ZERO, handle(1), Vec3::ZERO));
        }),
        ("joint 0: connects body 2 \"post\" and the world, which are both fixed", |w| {
            let post = w.insert(Body::fixed().named("post"));
            w.insert_joint(Joint::to_world(post, Vec3::ZERO, Vec3::ZERO));
        }),
        ("joint 0: connects body 2 \"post\" and body 3 \"beam\", which are both fixed", |w| {
            let [post, beam] = ["post", "beam"].map(|name| w.insert(Body::fixed().named(name)));
            w.insert_joint(Joint::new(post, Vec3::ZERO, beam, Vec3::ZERO).hinge(Vec3::Z));
        }),
        ("joint 0: its axis has no direction", |w| _ = w.insert_joint(ball().hinge(Vec3::ZERO))),
        ("joint 0: its axis has no direction", |w| _ = w.insert_joint(ball().slider(Vec3::X * f32::NAN))),
        ("joint 0: its axis has no direction", |w| {
            w.insert_joint(ball().along(Vec3::ZERO).zero_at(Quat::from_rotation_x(1.0), Quat::IDENTITY));
        }),
        ("joint 0: all of its axes are locked", |w| _ = w.insert_joint(ball().fixed().motor(1.0, 1.0))),
        ("joint 0: all of its axes are locked", |w| _ = w.insert_joint(ball().fixed().spring(0.0, 1.0, 1.0))),
        ("joint 0: all of its axes are locked", |w| _ = w.insert_joint(ball().fixed().limited(-1.0, 1.0))),
        ("joint 0: angular: a motor or a spring cannot move a locked axis", |w| {
            w.insert_joint(ball().generic([Axis::FREE; 3], [Axis::LOCKED.motor(1.0, 1.0), Axis::FREE, Axis::FREE]));
        }),
        ("joint 0: linear: limits NaN and 1: must ascend", |w| {
            _ = w.insert_joint(ball().slider(Vec3::X).limited(f32::NAN, 1.0))
        }),
        ("joint 0: linear: limits inf and inf: must ascend", |w| {
            w.insert_joint(ball().slider(Vec3::X).limited(f32::INFINITY, f32::INFINITY));
        }),
        ("joint 0: linear: limits 0 and 2000000000: must ascend", |w| {
            _ = w.insert_joint(ball().slider(Vec3::X).limited(0.0, 2e9))
        }),
        ("joint 0: angular: limits 0 and 4: must be within -pi and pi: only the first angle", |w| {
            w.insert_joint(ball().generic([Axis::LOCKED; 3], [Axis::FREE, Axis::limited(0.0, 4.0), Axis::FREE]));
        }),
        ("joint 0: angular: limits 0 and 10000: must ascend, within", |w| {
            w.insert_joint(ball().hinge(Vec3::X).limited(0.0, 1e4));
        }),
    ];
    for (start, change) in cases {
        let line = refusal(change).unwrap_or_else(|| panic!("{start}: was taken"));
        assert!(line.starts_with(start) && !line.contains('\n'), "{line}");
    }
}

/// A call that gives a joint something, by its name.
type Given = (&'static str, fn(Joint) -> Joint);

#[test]
fn limits_motors_and_springs_may_be_given_before_the_kind_of_a_joint() {
    let kinds: [Given; 7] = [
        ("hinge", |joint| joint.hinge(Vec3::Y)),
        ("slider", |joint| joint.slider(Vec3::Y)),
        ("fixed", Joint::fixed),
        ("rope", |joint| joint.rope(2.0)),
        ("rod", |joint| joint.rod(2.0)),
        ("elastic", |joint| joint.elastic(2.0, 1.0, 0.5)),
        ("generic", |joint| joint.generic([Axis::LOCKED, Axis::FREE, Axis::FREE], [Axis::LOCKED; 3])),
    ];
    let given: [Given; 4] = [
        ("limits", |joint| joint.limited(0.1, 1.5)),
        ("a motor", |joint| joint.motor(0.3, 20.0)),
        ("a spring", |joint| joint.spring(0.5, 2.0, 0.7)),
        ("limits and a motor", |joint| joint.limited(0.1, 1.5).motor(0.3, 20.0)),
    ];
    let joint = Joint::to_world(handle(0), Vec3::X, Vec3::Y);
    for (kind, of_kind) in kinds {
        for (what, give) in given {
            assert_eq!(of_kind(give(joint)), give(of_kind(joint)), "{what} before {kind}");
        }
        assert_eq!(of_kind(joint.hinge(Vec3::X).motor(0.3, 20.0)).linear, of_kind(joint).linear, "a second kind");
    }
}

/// A joint by the handle of a removed body ties nothing else, nor does one by an equal handle of a world without identity.
#[test]
fn a_joint_to_a_body_that_is_gone_is_refused_and_does_not_tie_a_stranger() {
    let line = |joint: fn(BodyHandle, BodyHandle) -> Joint| {
        refusal(|w| {
            let [a, b] = [0.0, 2.0].map(|x| w.insert(cube().position(x, 5.0, 0.0)));
            w.remove(a);
            let c = w.insert(cube().position(9.0, 5.0, 0.0).named("stranger"));
            assert_eq!(c.index(), a.index());
            let joint = w.insert_joint(joint(b, a));
            // A function that reads such a joint finds no body, and does not panic.
            let own = *w.joint(joint).expect("just put in");
            assert!(w.anchors(&own)[1].is_nan() && w.joint_motion(&own).position[0].is_nan() && w.joint_gap() == 0.0);
            assert!(own.holds(b) && own.holds(a) && !own.holds(c));
            let other = w.clone();
            w.beside(&other);
        })
    };
    let told = "joint 0: names body 2, which was removed: \"stranger\" has its index";
    for joint in [(|b, a| Joint::new(b, Vec3::ZERO, a, Vec3::ZERO)) as fn(BodyHandle, BodyHandle) -> Joint, |b, a| {
        Joint::new(b, Vec3::ZERO, handle(a.index()), Vec3::ZERO)
    }] {
        let line = line(joint).expect("it is refused");
        assert!(line.starts_with(told), "{line}");
    }
}

#[test]
fn a_handle_of_another_world_names_nothing() {
    let made = || {
        let mut world = World::new();
        let [a, b] = ["a", "b"].map(|name| world.insert(cube().named(name)));
        let joint = world.insert_joint(Joint::new(a, Vec3::ZERO, b, Vec3::ZERO));
        (world, a, joint)
    };
    let ((mut mine, own, own_joint), (theirs, other, other_joint)) = (made(), made());
    assert!(mine.body(other).is_none() && mine.body_mut(other).is_none() && mine.remove(other).is_none());
    assert!(
        !mine.bodies.contains(other) && mine.joint(other_joint).is_none() && mine.remove_joint(other_joint).is_none()
    );
    let all = Queries::of(&mine).point(Vec3::ZERO, &Filter::default().except(other)).len();
    assert_eq!((all, Queries::of(&mine).point(Vec3::ZERO, &Filter::default().except(own)).len()), (2, 1));
    mine.insert_joint(Joint::to_world(other, Vec3::ZERO, Vec3::ZERO));
    assert_eq!(mine.check().expect_err("it is refused").to_string(), "joint 1: names body 0 of another world");
    mine.joints.retain(|joint| joint.body_b.is_some());
    // Clones and forks, snapshots and saved runs are the same world.
    let copy = mine.clone();
    assert!(copy.body(own).is_some() && copy.joint(own_joint).is_some() && copy.body(other).is_none());
    let backend = || Box::new(Reference::<f32>::new());
    let mut simulation = Simulation::with(mine, SolverConfig::default(), backend()).expect("a world");
    assert_eq!(simulation.contacts_of(other).count(), 0);
    let bytes = simulation.save();
    let mut fork = simulation.fork(backend());
    fork.step(0.01).expect("a step");
    fork.restore(&simulation.snapshot());
    assert!(fork.world.body(own).is_some() && fork.world.body(other).is_none());
    // The bytes do not tell which world of the process it was.
    let saved = |world| Simulation::with(world, SolverConfig::default(), backend()).expect("a world").save();
    assert!(saved(theirs) == saved(made().0));
    let mut loaded = Simulation::load(&bytes, backend()).expect("what was saved");
    assert!(loaded.world.body(own).is_some() && loaded.world.joint(own_joint).is_some());
    let new = loaded.world.insert(cube());
    assert_eq!(loaded.world.body(new).map(|body| body.name.as_str()), Some("cube"));
}

#[test]
fn the_order_of_the_calls_that_make_a_body_does_not_matter() {
    let (cube, ball) = (Shape::cuboid(0.5, 0.5, 0.5), Shape::ball(0.25));
    let given = MassProperties { center: Vec3::Y * -0.1, ..Body::dynamic().shape(cube.clone()).mass };
    type Weigh = fn(Body, MassProperties) -> Body;
    let weights: [Weigh; 3] = [|b, _| b.total_mass(2.0), |b, _| b.density(20.0), |b, given| b.mass_properties(given)];
    for weigh in weights {
        let shapes = |body: Body| body.shape(cube.clone()).shape_at(ball.clone(), Vec3::Y, Quat::IDENTITY);
        let after = weigh(shapes(Body::dynamic()), given).mass;
        let between = weigh(Body::dynamic().shape(cube.clone()), given);
        let between = between.sensor(ball.clone()).shape_at(ball.clone(), Vec3::Y, Quat::IDENTITY).mass;
        assert_eq!(
            [weigh(Body::dynamic(), given), weigh(Body::dynamic().friction(0.1), given)].map(|b| shapes(b).mass),
            [after; 2]
        );
        assert_eq!(between, after);
    }
    assert_eq!(Body::dynamic().total_mass(2.0).shape(cube.clone()).mass.mass, 2.0);
    // Of several the last one counts, and shapes that change later count when told.
    let mut body = Body::dynamic().mass_properties(given).density(3.0).total_mass(5.0).shape(cube.clone());
    assert_eq!(body.mass.mass, 5.0);
    body = body.density(3.0);
    body.colliders[0].shape = Shape::cuboid(0.5, 1.0, 0.5);
    assert_eq!(body.mass.mass, 3.0);
    body.update_mass();
    assert_eq!(body.mass.mass, 6.0);
    body = body.mass_properties(given);
    body.update_mass();
    assert_eq!(body.mass, given);
}

#[test]
fn there_is_no_world_beyond_the_last() {
    let mut world = World::new();
    let line = world.insert_in(1, cube()).expect_err("one world").to_string();
    assert_eq!((line.as_str(), world.bodies.len()), ("world 1: the worlds beside each other are 0 to 0", 0));
    assert_eq!(world.gravity_on(handle(3)), Vec3::ZERO);
    let mut simulation =
        Simulation::with(world, SolverConfig::default(), Box::new(Reference::<f32>::new())).expect("a world");
    let beyond = handle(7);
    simulation.wake(beyond);
    assert!(!simulation.is_asleep(beyond) && simulation.substeps_of(beyond) == SolverConfig::default().substeps);
}

/// A ball joint of the dynamic body to the world.
fn ball() -> Joint {
    Joint::to_world(handle(1), Vec3::ZERO, Vec3::ZERO)
}

/// A caller may join bodies that cannot be moved now: they may be movable later, and the other way round.
#[test]
fn a_joint_of_kinematic_bodies_and_one_of_a_body_that_becomes_fixed_are_taken() {
    let mut world = World::new();
    let [hand, arm] = [0.0, 1.0].map(|x| world.insert(Body::kinematic().shape(Shape::ball(0.1)).position(x, 0.0, 0.0)));
    let bob = world.insert(Body::dynamic().shape(Shape::ball(0.1)).position(2.0, 0.0, 0.0));
    world.insert_joint(Joint::new(hand, Vec3::X, arm, Vec3::ZERO).hinge(Vec3::Z));
    world.insert_joint(Joint::to_world(bob, Vec3::ZERO, Vec3::X * 2.0));
    let mut simulation = Simulation::new(world).expect("a good world");
    simulation.step(0.01).expect("a step");
    simulation.world.bodies[bob].kind = BodyKind::Fixed;
    simulation.step(0.01).expect("a step with a body that is fixed now");
}

#[test]
fn a_simulation_of_a_world_alone_has_the_default_settings_on_the_processor() {
    let simulation = Simulation::new(World::new()).expect("a good world");
    assert_eq!((simulation.config(), simulation.backend().name()), (&SolverConfig::default(), "cpu"));
}
