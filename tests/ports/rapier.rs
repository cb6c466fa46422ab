//! The examples of Rapier in three dimensions (examples3d). Sizes, masses and places are those of the examples; a scene
//! of thousands of bodies has fewer here.

use std::f32::consts::{FRAC_PI_2, FRAC_PI_4, PI, TAU};

use drystone::glam::{IVec3, Quat, Vec3, vec3};
use drystone::world::Collider;
use drystone::{
    Axis, Body, BodyHandle, Character, CombineRule, ContactHooks, Cpu, Event, Groups, Joint, JointHandle,
    MassProperties, Material, PendingContact, Rollback, Shape, Simulation, World,
};

use crate::scene::{
    DT, at, body, body_mut, corners, cube, energy, fastest, floor, ground, light, lowest, place, run, run_with, sheet,
    started, twist, upright, weightless,
};

const G: f32 = 9.81;

/// Planks of 0.2 x 1 x 4 m in levels of rows, as high as `rows` says, around a square of as many planks a side.
fn keva(levels: &[(usize, usize)]) -> World {
    let half = vec3(0.1, 0.5, 2.0);
    let lying = [half, vec3(half.z, half.y, half.x)];
    let lid = vec3(half.z, half.x, half.y);
    let mut world = World::new();
    world.insert(ground(50.0, 0.1));
    let mut base = 0.0;
    for &(side, rows) in levels {
        let width = 2.0 * half.z * side as f32;
        let corner = vec3(-0.5 * width, base, -0.5 * width);
        let mut add = |half: Vec3, low: Vec3| {
            world.insert(at(light().shape(Shape::cuboid(half.x, half.y, half.z)), corner + low + half));
        };
        let (few, many) = (side, 3 * side + 1);
        let apart = 2.0 * (half.z * side as f32 - half.x) / (many as f32 - 1.0);
        for row in 0..rows {
            let is_even = row % 2 == 0;
            let half = lying[row % 2];
            let (columns, depth) = if is_even { (many, few) } else { (few, many) };
            let (dx, dz) = if is_even { (apart, 2.0 * half.z) } else { (2.0 * half.x, apart) };
            for (i, k) in grid(columns, depth) {
                add(half, vec3(dx * i, 2.0 * half.y * row as f32, dz * k));
            }
        }
        let top = 2.0 * half.y * rows as f32;
        let tiles = |size: f32| (width / (2.0 * size)) as usize;
        for (i, k) in grid(tiles(lid.x), tiles(lid.z)) {
            add(lid, vec3(2.0 * lid.x * i, top, 2.0 * lid.z * k));
        }
        base += top + 2.0 * lid.y;
    }
    world
}

/// All pairs of numbers below two counts.
fn grid(a: usize, b: usize) -> impl Iterator<Item = (f32, f32)> {
    (0..a).flat_map(move |i| (0..b).map(move |k| (i as f32, k as f32)))
}

/// Rapier, keva3, with two levels in place of five.
#[test]
fn a_tower_of_planks_stands() {
    let world = keva(&[(4, 21), (3, 17)]);
    let before: Vec<Vec3> = world.bodies.iter().map(|body| body.position).collect();
    let mut simulation = started(world);
    run(&mut simulation, 300);
    let moved = simulation.world.bodies.iter().zip(&before).map(|(body, from)| body.position.distance(*from));
    let most = moved.fold(0.0, f32::max);
    assert!(most < 0.1, "a plank moved by {most} m");
    let deepest = simulation.penetration().max;
    assert!(deepest < 5e-3, "{deepest} m");
}

/// The dominoes of a spiral. The first domino of each turn leans forward, and so does the last one of all.
fn dominoes(count: usize) -> (World, Vec<BodyHandle>) {
    let mut world = World::new();
    world.insert(ground(200.1, 0.1));
    let (width, thickness) = (1.0, 0.1);
    let (mut angle, mut radius, mut skip) = (0.0_f32, 10.0, 0);
    let mut dominoes = Vec::new();
    for i in 0..count {
        let round = TAU * radius;
        let before = angle;
        angle += TAU * 4.0 * thickness / round;
        let is_turn = angle % TAU < before % TAU;
        if skip == 0 {
            let facing = Quat::from_rotation_y(angle);
            let lean = if is_turn || i == count - 1 { 0.2 } else { 0.0 };
            let rotation = Quat::from_axis_angle(facing * Vec3::Z, lean) * facing;
            let domino = light().shape(Shape::cuboid(thickness, 2.0 * width, width)).rotation(rotation);
            let (x, z) = angle.sin_cos();
            dominoes.push(world.insert(at(domino, vec3(x * radius, 2.0 * width + 0.1, z * radius))));
        } else {
            skip -= 1;
        }
        if is_turn {
            skip = 5;
        }
        radius += 1.5 / round;
    }
    (world, dominoes)
}

/// Rapier, domino3, with 300 in place of 4,000.
#[test]
fn every_domino_of_a_spiral_falls() {
    let (world, dominoes) = dominoes(300);
    let mut simulation = started(world);
    let mut fallen = Vec::new();
    run_with(&mut simulation, 900, |simulation, step| {
        if step % 150 == 149 {
            fallen.push(dominoes.iter().filter(|&&domino| upright(body(simulation, domino)) < 0.9).count());
        }
    });
    assert!(fallen.is_sorted() && fallen[0] < 10, "fallen after each 2.5 s: {fallen:?}");
    assert_eq!(fallen[5], dominoes.len(), "fallen after each 2.5 s: {fallen:?}");
    assert!(lowest(&simulation.world) > 0.0);
}

/// Four boxes behind each other on sliders whose directions alternate.
fn sliders(joint: impl Fn(usize, Joint) -> Joint) -> (Simulation, Vec<JointHandle>) {
    let mut world = World::new();
    let start = vec3(20.0, 5.0, 0.0);
    let mut parent = world.insert(at(Body::fixed().shape(cube(0.4)), start));
    let mut joints = Vec::new();
    for i in 0..4 {
        let child = world.insert(at(light().shape(cube(0.4)), start + Vec3::Z * 2.0 * (i + 1) as f32));
        let along = vec3(if i % 2 == 0 { 1.0 } else { -1.0 }, 1.0, 0.0);
        let slider = Joint::new(child, Vec3::ZERO, parent, Vec3::Z * 2.0).slider(along);
        joints.push(world.insert_joint(joint(i, slider)));
        parent = child;
    }
    (started(world), joints)
}

/// Positions and speeds of joints along (m, m/s) or about (rad, rad/s) one of their axes.
fn motions(simulation: &Simulation, joints: &[JointHandle], axis: usize) -> Vec<(f32, f32)> {
    let motion = |&joint: &JointHandle| {
        let motion = simulation.world.joint_motion(simulation.world.joint(joint).expect("it is there"));
        (motion.position[axis], motion.speed[axis])
    };
    joints.iter().map(motion).collect()
}

/// Rapier, joints3, prismatic joints.
#[test]
fn boxes_on_sliders_hang_at_their_limits() {
    let (mut simulation, joints) = sliders(|_, joint| joint.limited(-2.0, 2.0));
    run(&mut simulation, 600);
    let motions = motions(&simulation, &joints, 0);
    assert!(motions.iter().all(|(at, _)| (at + 2.0).abs() < 2e-3), "{motions:?}");
    let gap = simulation.world.joint_gap();
    assert!(gap < 2e-3, "{gap} m");
}

/// Rapier, joints3, actuated prismatic joints: two motors, one of which has a limit on one side, and two springs.
#[test]
fn motors_drive_sliders_to_their_limits_and_springs_hold_them() {
    let (mut simulation, joints) = sliders(|i, joint| match i {
        0 => joint.limited(-2.0, 5.0).motor(2.0, 100.0),
        1 => joint.limited(f32::NEG_INFINITY, 5.0).motor(6.0, 100.0),
        _ => joint
            .generic([Axis::FREE.spring_damper(2.0, 1e3, 1e2, 60.0), Axis::LOCKED, Axis::LOCKED], [Axis::LOCKED; 3]),
    });
    run(&mut simulation, 900);
    // A spring yields to the weight of the boxes behind it.
    let sag = |boxes: f32| boxes * 0.512 * G * FRAC_PI_4.sin() / 1e3;
    for ((at, _), wanted) in
        motions(&simulation, &joints, 0).into_iter().zip([5.0, 5.0, 2.0 - sag(2.0), 2.0 - sag(1.0)])
    {
        assert!((at - wanted).abs() < 2e-3, "{at} m in place of {wanted} m");
    }
    let gap = simulation.world.joint_gap();
    assert!(gap < 2e-3, "{gap} m");
}

/// Rapier, joints3, revolute joints.
#[test]
fn a_chain_of_twelve_hinges_stays_together_and_gains_no_energy() {
    let mut world = World::new();
    let side = 2.0;
    let mut parent = world.insert(Body::fixed().shape(cube(0.4)));
    for i in 0..3 {
        let z = (2 * i + 1) as f32 * side;
        let places = [vec3(0.0, 0.0, z), vec3(side, 0.0, z), vec3(side, 0.0, z + side), vec3(0.0, 0.0, z + side)];
        let ties = [(vec3(0.0, 0.0, -side), Vec3::Z), (vec3(-side, 0.0, 0.0), Vec3::X)];
        let ties = ties.into_iter().chain([(vec3(0.0, 0.0, -side), Vec3::Z), (vec3(side, 0.0, 0.0), Vec3::X)]);
        for (place, (anchor, axis)) in places.into_iter().zip(ties) {
            let link = world.insert(at(light().shape(cube(0.4)), place));
            world.insert_joint(Joint::new(link, anchor, parent, Vec3::ZERO).hinge(axis));
            parent = link;
        }
    }
    let start = energy(&world);
    let mut simulation = started(world);
    let (mut gap, mut most, mut motion) = (0.0_f32, f64::MIN, 0.0_f64);
    run_with(&mut simulation, 900, |simulation, _| {
        gap = gap.max(simulation.world.joint_gap());
        most = most.max(energy(&simulation.world));
        motion = motion.max(simulation.world.kinetic_energy());
    });
    assert!(gap < 0.01, "{gap} m");
    // The places of jointed bodies are half a substep ahead of their velocities.
    assert!(most < start + 1e-3 * motion, "{} J gained, of {motion} J in motion", most - start);
}

/// Rapier, joints3, revolute joints with limits, and cubes that fall on them.
#[test]
fn planks_on_limited_hinges_hold_cubes_within_the_limits() {
    let mut world = World::new();
    let post = world.insert(Body::fixed());
    let plank = |z: f32| light().shape(Shape::cuboid(4.0, 0.2, 2.0)).position(0.0, 0.0, z);
    let [near, far] = [0.0, 6.0].map(|z| world.insert(plank(z)));
    let limited = |joint: Joint| joint.hinge(Vec3::Z).limited(-0.2, 0.2);
    let joints = [
        world.insert_joint(limited(Joint::new(near, Vec3::ZERO, post, Vec3::ZERO))),
        world.insert_joint(limited(Joint::new(far, Vec3::Z * -6.0, near, Vec3::ZERO))),
    ];
    for place in [vec3(-2.0, 4.0, 0.0), vec3(2.0, 16.0, 6.0)] {
        world.insert(at(light().friction(1.0).shape(cube(0.6)), place));
    }
    let mut simulation = started(world);
    let mut beyond = 0.0_f32;
    run_with(&mut simulation, 900, |simulation, _| {
        for (angle, _) in motions(simulation, &joints, 3) {
            beyond = beyond.max(angle.abs() - 0.2);
        }
    });
    assert!(beyond < 2e-3, "{beyond} rad beyond a limit");
}

/// Rapier, joints3, fixed joints. A lattice of 10 x 10 balls sags by 1.56 m in Rapier, a cantilever of ten by 4.2 m.
#[test]
fn welded_balls_sag_less_than_in_rapier() {
    let weld =
        |child: BodyHandle, anchor: Vec3, parent: BodyHandle| Joint::new(child, anchor, parent, Vec3::ZERO).fixed();
    let side = 10;
    let mut lattice = World::new();
    let mut balls: Vec<BodyHandle> = Vec::new();
    for (row, column) in grid(side, side) {
        let k = column as usize;
        let is_fixed = row == 0.0 && (k.is_multiple_of(4) && k != side - 2 || k == side - 1);
        let ball = if is_fixed { Body::fixed() } else { light() };
        let ball = lattice.insert(ball.shape(Shape::ball(0.4)).position(column, 10.0, row));
        if row > 0.0 {
            lattice.insert_joint(weld(ball, Vec3::NEG_Z, balls[balls.len() - side]));
        }
        if k > 0 {
            lattice.insert_joint(weld(ball, Vec3::NEG_X, balls[balls.len() - 1]));
        }
        balls.push(ball);
    }
    let mut beam = World::new();
    let mut parent = beam.insert(Body::fixed().position(0.0, 10.0, 0.0));
    for i in 1..=10 {
        let ball = beam.insert(light().shape(Shape::ball(0.4)).position(0.0, 10.0, i as f32));
        beam.insert_joint(weld(ball, Vec3::NEG_Z, parent));
        parent = ball;
    }
    for (name, world, steps, most) in [("lattice", lattice, 300, 1.56), ("beam", beam, 600, 4.2)] {
        let mut simulation = started(world);
        run(&mut simulation, steps);
        let sag = 10.0 - lowest(&simulation.world);
        assert!(sag < most, "the {name} sags by {sag} m");
    }
}

/// Rapier, joints3, actuated revolute joints.
#[test]
fn motors_turn_a_chain_of_hinges_at_their_speeds() {
    let mut world = World::new();
    let count = 6;
    let mut joints = Vec::new();
    let mut parent = None;
    for i in 0..count {
        let base = if i == 0 { Body::fixed() } else { light() };
        let shape = Shape::cuboid(0.8, 2.4 / (i as f32 + 1.0), 0.4);
        let link = world.insert(base.shape(shape).position(20.0, if i > 0 { 8.0 } else { 10.0 }, 2.0 * i as f32));
        if let Some(parent) = parent {
            let anchor = vec3(0.0, if i == 1 { 2.0 } else { 0.0 }, -2.0);
            let hinge = Joint::new(link, anchor, parent, Vec3::ZERO).hinge(Vec3::Z);
            joints.push(world.insert_joint(match i {
                1 => hinge.motor(-2.0, 1e6),
                4 => hinge.motor(-20.0, 1e6),
                5 => hinge.spring(FRAC_PI_2, 200_f32.sqrt() / TAU, 50.0 / 200_f32.sqrt()),
                _ => hinge,
            }));
        }
        parent = Some(link);
    }
    let mut simulation = started(world);
    run(&mut simulation, 600);
    let motions = motions(&simulation, &joints, 3);
    assert!((motions[0].1 + 2.0).abs() < 0.02 && (motions[3].1 + 20.0).abs() < 0.02, "{motions:?}");
    let gap = simulation.world.joint_gap();
    assert!(gap < 2e-3, "{gap} m");
}

/// Rapier, joints3, actuated spherical joints.
#[test]
fn drives_of_three_angles_hold_capsules_together() {
    let mut world = World::new();
    let mut parent = None;
    for i in 0..3 {
        let base = if i == 0 { Body::fixed() } else { light() };
        let shape = Shape::capsule(0.8 / (i as f32 + 1.0), 0.4);
        let capsule = world.insert(base.shape(shape).position(13.0, 10.0, 2.0 * i as f32));
        if let Some(parent) = parent {
            let drives = match i {
                1 => [0.0, 0.5, -2.0].map(|speed| Axis::FREE.motor(speed, 0.1)),
                _ => [0.0, 1.0, FRAC_PI_2].map(|target| Axis::FREE.spring(target, 0.3, 1.0, 1e9)),
            };
            let ball = Joint::new(capsule, Vec3::ZERO, parent, Vec3::Z * 2.0);
            world.insert_joint(ball.generic([Axis::LOCKED; 3], drives));
        }
        parent = Some(capsule);
    }
    let mut simulation = started(world);
    let mut gap = 0.0_f32;
    run_with(&mut simulation, 600, |simulation, _| gap = gap.max(simulation.world.joint_gap()));
    assert!(gap < 1e-3, "{gap} m");
    assert!(fastest(&simulation.world) < 10.0);
}

/// Rapier, joints3, spherical joints, with 8 x 8 capsules in place of 15 x 15.
#[test]
fn a_net_of_capsules_stays_together_while_it_falls() {
    let side = 8;
    let mut world = World::new();
    let mut net: Vec<BodyHandle> = Vec::new();
    for (column, row) in grid(side, side) {
        let k = column as usize;
        let is_fixed = row == 0.0 && (k.is_multiple_of(4) || k == side - 1);
        let base = if is_fixed { Body::fixed() } else { light() };
        let capsule = base.shape_at(Shape::capsule(0.5, 0.4), Vec3::ZERO, Quat::from_rotation_x(FRAC_PI_2));
        let capsule = world.insert(capsule.position(column, 0.0, 2.0 * row));
        if row > 0.0 {
            world.insert_joint(Joint::new(capsule, Vec3::Z * -2.0, net[net.len() - 1], Vec3::ZERO));
        }
        if k > 0 {
            world.insert_joint(Joint::new(capsule, Vec3::NEG_X, net[net.len() - side], Vec3::ZERO));
        }
        net.push(capsule);
    }
    let mut simulation = started(world);
    let mut gap = 0.0_f32;
    run_with(&mut simulation, 400, |simulation, _| gap = gap.max(simulation.world.joint_gap()));
    assert!(gap < 0.038, "{gap} m");
    let end = simulation.world.joint_gap();
    assert!(end < 5e-3, "{end} m at the end");
}

/// Rapier, debug_friction3. The way is v²/(2 mu g).
#[test]
fn a_box_slides_straight_as_far_as_friction_says() {
    let mut world = World::new();
    world.insert(Body::fixed().shape(Shape::cuboid(100.0, 0.1, 100.0)).friction(1.5));
    let turned = Quat::from_rotation_y(0.3);
    let way = turned * Vec3::Z;
    let slider = light().friction(1.5).shape(Shape::cuboid(2.0, 1.0, 3.0)).rotation(turned);
    let slider = world.insert(slider.position(0.0, 1.1, 0.0).velocity(way * 50.0, Vec3::ZERO));
    let mut simulation = started(world);
    run(&mut simulation, 400);
    let slid = place(&simulation, slider).with_y(0.0);
    let wanted = 50.0 * 50.0 / (2.0 * 1.5 * G);
    assert!((slid.length() - wanted).abs() < 0.1, "{} m in place of {wanted} m", slid.length());
    assert!(slid.angle_between(way) < 1e-3 && body(&simulation, slider).linear_velocity.length() < 1e-3);
}

/// A level square of `points` x `points` heights, 60 m a side: a height field, or its triangles as a mesh.
fn level(points: usize, is_mesh: bool) -> Shape {
    let field = Shape::height_field(&vec![vec![0.0; points]; points], vec3(60.0, 1.0, 60.0)).expect("a field");
    if is_mesh { meshed(&field) } else { field }
}

/// The triangles of a shape as a mesh.
fn meshed(shape: &Shape) -> Shape {
    let (vertices, triangles) = shape.triangles();
    Shape::mesh(vertices, triangles).expect("a mesh")
}

/// Rapier, debug_internal_edges3: a ball and a cylinder at 20 m/s over 10,000 triangles. The box of the example is left
/// out: it tumbles aside on a slab as well. Of 60 cylinders none gets further aside than 5 cm in 25 m, 16 than 2 cm.
#[test]
fn inner_edges_of_fields_and_meshes_push_nothing_aside() {
    for is_mesh in [false, true] {
        let mut world = World::new();
        world.insert(Body::fixed().shape(level(100, is_mesh)));
        let roller = light().shape_at(Shape::cylinder(0.5, 0.2), Vec3::ZERO, Quat::from_rotation_z(FRAC_PI_2));
        let movers =
            [(light().shape(Shape::ball(0.5)), vec3(4.0, 0.5, 0.0), -40.0), (roller, vec3(8.0, 0.2, 0.0), -4.0)];
        let movers = movers
            .map(|(body, from, down)| (world.insert(at(body, from).velocity(vec3(0.0, down, 20.0), Vec3::ZERO)), from));
        let mut simulation = started(world);
        run_with(&mut simulation, 75, |simulation, step| {
            for (mover, from) in movers {
                let body = body(simulation, mover);
                let aside = (body.position.x - from.x).abs();
                assert!(aside < 0.05, "mesh: {is_mesh}, from {from}: {aside} m aside");
                let up = body.linear_velocity.y.abs();
                assert!(step < 6 || up < 0.05, "mesh: {is_mesh}, from {from}, step {step}: {up} m/s up");
            }
        });
        assert!(movers.iter().all(|&(mover, _)| place(&simulation, mover).z > 15.0));
    }
}

/// Rapier, debug_thin_cube_on_mesh3: a plate of 3 cm at 100 m/s.
#[test]
fn a_thin_plate_that_is_shot_at_a_height_field_lies_on_it() {
    let mut world = World::new();
    let field = Shape::height_field(&[vec![0.0; 2], vec![0.0; 2]], vec3(50.0, 1.0, 50.0)).expect("a field");
    world.insert(Body::fixed().shape(field));
    let plate = light().shape(Shape::cuboid(5.0, 0.015, 5.0)).rotation(Quat::from_scaled_axis(vec3(0.5, 0.0, 0.5)));
    let plate = world.insert(plate.position(0.0, 5.0, 0.0).velocity(Vec3::Y * -100.0, Vec3::ZERO));
    let mut simulation = started(world);
    run(&mut simulation, 600);
    let Body { position, rotation, .. } = body(&simulation, plate);
    assert!((position.y - 0.015).abs() < 2e-3, "at {position}, turned by {rotation}");
}

/// Rapier, debug_big_colliders3: plates from 20 km to 13 cm wide, each on the next larger one.
#[test]
fn plates_of_kilometers_lie_on_each_other() {
    let mut world = World::new();
    world.insert(floor());
    let plates: Vec<BodyHandle> = (0..8)
        .map(|i| {
            let half = 10_000.0 / 5_f32.powi(i);
            world.insert(light().shape(Shape::cuboid(half, 0.1, half)).position(0.0, 0.4 * (i + 1) as f32, 0.0))
        })
        .collect();
    let mut simulation = started(world);
    run(&mut simulation, 600);
    for (i, &plate) in plates.iter().enumerate() {
        let (height, wanted) = (place(&simulation, plate).y, 0.1 + 0.2 * i as f32);
        assert!((height - wanted).abs() < 0.01, "plate {i} at {height} m in place of {wanted} m");
        assert!(upright(body(&simulation, plate)) > 0.9999, "plate {i} tilts");
    }
}

/// A body of one of the shapes of the examples, about 2 m in size.
fn primitive(kind: usize) -> Shape {
    match kind % 5 {
        0 => cube(1.0),
        1 => Shape::ball(1.0),
        2 => Shape::cylinder(1.0, 1.0),
        3 => Shape::cone(1.0, 1.0),
        _ => Shape::capsule(1.0, 1.0),
    }
}

/// Layers of bodies, with the shape of each layer. The middles of the bodies are `apart` (m).
fn add_layers(world: &mut World, layers: usize, side: usize, (from, apart): (Vec3, f32), of: impl Fn(usize) -> Body) {
    let middle = 0.5 * (side as f32 - 1.0);
    for layer in 0..layers {
        let shift = 0.05 * layer as f32;
        for (i, k) in grid(side, side) {
            let place = vec3(i - middle, layer as f32, k - middle) * apart;
            world.insert(at(of(layer), from + place - vec3(shift, 0.0, shift)));
        }
    }
}

/// Rapier, debug_shape_modification3: a ball that grows to 20 m and goes back, a solid of another shape every 50 steps,
/// and 160 bodies around them in place of 640.
#[test]
fn shapes_that_change_in_every_step_push_nothing_through_the_ground() {
    let mut world = World::new();
    world.insert(ground(20.0, 0.1).friction(0.15));
    let grown = |step: usize| Shape::ball(if step == 0 { 0.1 } else { 0.2 * step as f32 });
    let ball = Body::dynamic().density(100.0).shape(grown(0)).position(0.0, 0.2, 0.0);
    let ball = world.insert(ball.velocity(Vec3::X * 10.0, Vec3::ZERO));
    let shapes = [Shape::ball(3.0), cube(3.0), Shape::cone(3.0, 3.0), Shape::cylinder(3.0, 3.0)];
    let solid = world.insert(Body::fixed().shape(shapes[0].clone()).position(-15.0, 3.0, 9.0));
    add_layers(&mut world, 10, 4, (vec3(-8.0, 4.5, -8.0), 3.0), |layer| light().shape(primitive(layer)));
    let mut simulation = started(world);
    let mut kept = None;
    let mut age = 0;
    run_with(&mut simulation, 300, |simulation, step| {
        age += 1;
        if age == 51 {
            kept.get_or_insert_with(|| body(simulation, ball).clone());
        }
        body_mut(simulation, solid).colliders[0].shape = shapes[step / 50 % 4].clone();
        let grows = body_mut(simulation, ball);
        if age == 100 {
            *grows = kept.clone().expect("the ball at step 51");
            age = 51;
        }
        grows.colliders[0].shape = grown(age);
        grows.update_mass();
        let wanted = 100.0 * 4.0 / 3.0 * PI * (0.2 * age as f32).powi(3);
        assert!((grows.mass.mass / wanted - 1.0).abs() < 1e-4, "{} kg in place of {wanted} kg", grows.mass.mass);
    });
    let inside = |body: &&Body| body.position.x.abs() < 19.0 && body.position.z.abs() < 19.0;
    let below = simulation.world.dynamic().filter(inside).filter(|body| body.position.y < 0.0).count();
    assert_eq!((simulation.world.first_non_finite(), below), (None, 0));
}

/// Rapier, debug_add_remove_collider3: the shape of the ground is taken away and put back in every step.
#[test]
fn ground_whose_shape_is_replaced_in_every_step_carries_a_ball() {
    let mut world = World::new();
    let slab = world.insert(Body::fixed().shape(Shape::cuboid(3.0, 0.1, 0.4)).position(0.0, -0.1, 0.0));
    let ball = world.insert(Body::dynamic().density(100.0).shape(Shape::ball(0.1)).position(0.0, 0.2, 0.0));
    let mut simulation = started(world);
    let mut low = f32::INFINITY;
    run_with(&mut simulation, 300, |simulation, _| {
        body_mut(simulation, slab).colliders[0] = Collider::new(Shape::cuboid(3.0, 0.1, 0.4));
        low = low.min(place(simulation, ball).y);
    });
    assert!(low > 0.0995, "{low} m");
}

/// Rapier, debug_dynamic_collider_add3: a rolling ball gets a larger ball in every step.
#[test]
fn a_body_gains_the_mass_of_shapes_that_it_gets_while_it_rolls() {
    let mut world = World::new();
    world.insert(Body::fixed().shape(Shape::cuboid(20.0, 0.1, 0.4)).position(0.0, -0.1, 0.0).friction(0.15));
    let ball = Body::dynamic().density(100.0).shape(Shape::ball(0.1)).position(0.0, 0.2, 0.0);
    let ball = world.insert(ball.velocity(Vec3::X * 10.0, Vec3::ZERO));
    let mut simulation = started(world);
    let radius = |i: usize| 0.1 + 0.01 * i as f32;
    run_with(&mut simulation, 40, |simulation, step| {
        let body = body_mut(simulation, ball);
        body.colliders.push(Collider::new(Shape::ball(radius(step + 1))));
        body.update_mass();
    });
    let wanted: f32 = (0..=40).map(|i| 100.0 * 4.0 / 3.0 * PI * radius(i).powi(3)).sum();
    let mass = body(&simulation, ball).mass.mass;
    assert!((mass / wanted - 1.0).abs() < 1e-4, "{mass} kg in place of {wanted} kg");
    run(&mut simulation, 40);
    let height = place(&simulation, ball).y;
    assert!((height - 0.5).abs() < 0.01, "{height} m");
}

/// Rapier, debug_deserialize3, debug_rollback3 and the test snapshot_roundtrip.
#[test]
fn saved_restored_and_rolled_back_runs_go_on_with_the_same_bits() {
    let mut world = World::new();
    world.insert(ground(20.0, 0.1));
    for layer in 0..5 {
        for (i, k) in grid(5, 5) {
            world.insert(at(light().shape(cube(0.5)), vec3(1.1 * i, 1.0 + 1.1 * layer as f32, 1.1 * k)));
        }
    }
    let mut simulation = started(world);
    run(&mut simulation, 50);
    let (bytes, snapshot) = (simulation.save(), simulation.snapshot());
    let mut rollback = Rollback::new(100);
    for _ in 0..100 {
        rollback.push(&simulation);
        run(&mut simulation, 1);
    }
    let hash = simulation.hash();
    let mut loaded = Simulation::load(&bytes, Box::new(Cpu::new())).expect("saved bytes");
    run(&mut loaded, 100);
    assert_eq!(loaded.hash(), hash);
    rollback.back(100, &mut simulation).expect("100 states are kept");
    run(&mut simulation, 100);
    assert_eq!(simulation.hash(), hash);
    simulation.restore(&snapshot);
    run(&mut simulation, 100);
    assert_eq!(simulation.hash(), hash);
}

/// Rapier, restitution3: balls of restitution 0 to 1 on ground of restitution 1, whose mean counts.
#[test]
fn balls_bounce_to_the_square_of_the_mean_restitution() {
    let of =
        |restitution| Material { restitution, restitution_rule: Some(CombineRule::Average), ..Material::default() };
    for of_ground in [1.0, 0.0] {
        let mut world = World::new();
        world.insert(
            Body::fixed().shape(Shape::cuboid(20.0, 1.0, 2.0)).position(0.0, -1.0, 0.0).material(of(of_ground)),
        );
        let balls: Vec<(f32, BodyHandle)> = (0..=10)
            .map(|i| {
                let ball = light().shape(Shape::ball(0.5)).material(of(0.1 * i as f32));
                let ball = world.insert(ball.position(2.0 * (i as f32 - 5.0), 10.0, 0.0));
                (0.5 * (0.1 * i as f32 + of_ground), ball)
            })
            .collect();
        let mut simulation = started(world);
        let mut apex = vec![0.5_f32; balls.len()];
        run_with(&mut simulation, 230, |simulation, step| {
            for (apex, (_, ball)) in apex.iter_mut().zip(&balls).filter(|_| step > 85) {
                *apex = apex.max(place(simulation, *ball).y);
            }
        });
        for ((restitution, _), apex) in balls.iter().zip(apex) {
            let (rebound, wanted) = ((apex - 0.5) / 9.5, restitution * restitution);
            assert!((rebound - wanted).abs() < 0.01, "restitution {restitution}: {rebound} in place of {wanted}");
        }
    }
}

/// Rapier, damping3: boxes with damping from 1 to 10 fly out of a circle.
#[test]
fn damped_boxes_fly_as_far_as_their_damping_says() {
    let mut world = weightless();
    let boxes: Vec<(BodyHandle, Vec3, f32)> = (0..10)
        .map(|i| {
            let (x, y) = (0.1 * TAU * i as f32).sin_cos();
            let (out, rate) = (vec3(x, y, 0.0), (i + 1) as f32);
            let flies = at(light().shape(cube(0.2)), out).velocity(out * 10.0, Vec3::Z * 100.0);
            (world.insert(flies.linear_damping(rate).angular_damping(11.0 - rate)), out, rate)
        })
        .collect();
    let mut simulation = started(world);
    run(&mut simulation, 60);
    for (flies, out, rate) in boxes {
        let body = body(&simulation, flies);
        let (far, wanted) = (body.position.distance(out), 10.0 * (1.0 - (-rate).exp()) / rate);
        assert!((far - wanted).abs() < 0.03, "damping {rate}: {far} m in place of {wanted} m");
        let slowed = [body.linear_velocity.dot(out) / 10.0, body.angular_velocity.z / 100.0];
        for (slowed, rate) in slowed.into_iter().zip([rate, 11.0 - rate]) {
            assert!((slowed / (-rate).exp() - 1.0).abs() < 1e-4, "damping {rate}: slowed to {slowed}");
        }
    }
}

/// Rapier, locked_rotations3: a box that turns about one axis in place, and capsules that do not turn.
#[test]
fn locked_axes_hold_exactly_while_bodies_collide() {
    let mut world = World::new();
    world.insert(ground(5.0, 0.1));
    let board = light().shape(Shape::cuboid(0.2, 0.6, 2.0)).position(0.0, 3.0, 0.0);
    let board = world.insert(board.locked_translations([true; 3]).locked_rotations([false, true, true]));
    let turned = Quat::from_rotation_x(1.0);
    let capsule = Shape::capsule(0.6, 0.4);
    let cross = light().shape(capsule.clone()).shape_at(capsule, Vec3::ZERO, Quat::from_rotation_z(FRAC_PI_2));
    let cross = world.insert(cross.position(0.2, 5.0, 0.4).rotation(turned).locked_rotations([true; 3]));
    let mut simulation = started(world);
    let mut turned_by = 0.0_f32;
    run_with(&mut simulation, 600, |simulation, step| {
        assert_eq!(body(simulation, cross).rotation, turned, "step {step}");
        let board = body(simulation, board);
        assert_eq!(board.position, Vec3::Y * 3.0, "step {step}");
        let tilt = (board.rotation * Vec3::X).distance(Vec3::X);
        assert!(tilt < 1e-5, "step {step}: the axis is off by {tilt}");
        turned_by = turned_by.max(twist(board.rotation, Vec3::X).abs());
    });
    assert!(turned_by > 0.1, "nothing turned the board: {turned_by} rad");
    assert!(place(&simulation, cross).y < 3.0, "it did not fall");
}

/// Rapier, ccd3: a marked ball at 1,000 m/s meets five walls of boxes.
#[test]
fn a_ball_at_a_thousand_meters_a_second_hits_every_wall_of_boxes() {
    let mut world = World::new();
    world.insert(ground(50.0, 0.1));
    let mut walls = Vec::new();
    for i in 0..5 {
        let bricks = (0..8).flat_map(|row| (row..8).map(move |k| (row as f32, k as f32)));
        let bricks = bricks.map(|(row, k)| {
            let place = vec3(6.0 * i as f32, row + 0.6, 2.0 * k - row - 8.0);
            (world.insert(at(light().shape(Shape::cuboid(0.5, 0.5, 1.0)), place)), place)
        });
        walls.push(bricks.collect::<Vec<_>>());
    }
    let ball = Body::dynamic().density(10.0).shape(Shape::ball(1.0)).position(-20.0, 2.6, 0.0).swept();
    let ball = world.insert(ball.velocity(Vec3::X * 1000.0, Vec3::ZERO));
    let mut simulation = started(world);
    run(&mut simulation, 30);
    let speed = body(&simulation, ball).linear_velocity.x;
    assert!(speed < 950.0, "{speed} m/s");
    for (i, wall) in walls.iter().enumerate() {
        let moved = wall.iter().map(|&(brick, from)| place(&simulation, brick).distance(from)).fold(0.0, f32::max);
        assert!(moved > 1.0, "wall {i}: no brick moved by more than {moved} m");
    }
}

/// Rapier, ccd3: a sensor that flies through walls.
#[test]
fn a_sensor_at_a_thousand_meters_a_second_tells_of_every_wall() {
    let mut world = weightless();
    let walls: Vec<BodyHandle> = (0..5)
        .map(|i| world.insert(light().shape(Shape::cuboid(0.5, 4.0, 4.0)).position(6.0 * i as f32, 0.0, 0.0)))
        .collect();
    let inertia = MassProperties { principal_inertia: Vec3::splat(16.0), ..MassProperties::point(40.0, Vec3::ZERO) };
    let carrier = Body::dynamic().mass_properties(inertia).sensor(Shape::ball(1.0)).position(-20.0, 0.0, 0.0);
    world.insert(carrier.velocity(Vec3::X * 1000.0, Vec3::ZERO));
    let mut simulation = started(world);
    let mut met = Vec::new();
    run_with(&mut simulation, 10, |simulation, _| {
        met.extend(simulation.events().iter().filter_map(|event| match event {
            Event::Entered { visitor, .. } | Event::Passed { visitor, .. } => Some(visitor.body),
            _ => None,
        }));
    });
    met.sort();
    assert_eq!(met, walls);
}

/// A platform that holds bodies on one side, and carries them along Z.
#[derive(Clone, Copy)]
struct OneWay {
    platform: BodyHandle,
    side: Vec3,
    belt: Vec3,
}

struct Platforms([OneWay; 2]);

impl ContactHooks for Platforms {
    fn modify(&mut self, _: &World, contact: &mut PendingContact) {
        for OneWay { platform, side, belt } in self.0 {
            let outward = match platform {
                it if it == contact.a.body => 1.0,
                it if it == contact.b.body => -1.0,
                _ => continue,
            };
            let is_outside = contact.normal.dot(side) * outward > 0.1_f32.cos();
            contact.surface_velocity = -outward * belt;
            for point in contact.points_mut() {
                point.is_dropped = !is_outside || point.separation < -0.1;
            }
        }
    }
}

/// Rapier, one_way_platforms3: blocks ride over one platform, and with their gravity turned around under the other one.
#[test]
fn blocks_ride_around_two_one_way_platforms() {
    let mut world = World::new();
    let mut platform = |y: f32, z: f32, side: Vec3, speed: f32| {
        let platform = world.insert(Body::fixed().shape(Shape::cuboid(9.0, 0.5, 25.0)).position(0.0, y, z));
        OneWay { platform, side, belt: Vec3::Z * speed }
    };
    let hooks = Platforms([platform(2.0, 30.0, Vec3::Y, -12.0), platform(-2.0, -30.0, Vec3::NEG_Y, 12.0)]);
    let block = light().shape(Shape::cuboid(1.0, 2.0, 1.5));
    let block = world.insert(block.position(0.0, -4.0, 30.0).velocity(Vec3::Y * 15.0, Vec3::ZERO));
    let mut simulation = started(world);
    simulation.set_hooks(Some(Box::new(hooks)));
    let (mut above, mut below) = (0.0_f32, 0.0_f32);
    run_with(&mut simulation, 900, |simulation, _| {
        let block = body_mut(simulation, block);
        let Vec3 { y, z, .. } = block.position;
        if y.abs() > 1.0 {
            block.gravity_scale = y.signum();
        }
        let speed = block.linear_velocity.z;
        if y > 3.0 && z > 5.0 {
            above = above.min(speed);
        } else if y < -3.0 && z < -5.0 {
            below = below.max(speed);
        }
    });
    assert!((above + 12.0).abs() < 0.01, "above, it rides at {above} m/s");
    assert!((below - 12.0).abs() < 0.01, "below, it rides at {below} m/s");
}

/// Rapier, sensor3: a cube with a sensor around it falls on a hundred others.
#[test]
fn a_sensor_counts_the_cubes_around_it() {
    let mut world = World::new();
    world.insert(ground(10.1, 0.1));
    for (i, k) in grid(10, 10) {
        world.insert(light().shape(cube(0.2)).position(0.4 * i - 2.0, 3.0, 0.4 * k - 2.0));
    }
    let watcher = world.insert(light().shape(cube(0.2)).sensor(Shape::ball(1.0)).position(0.0, 5.0, 0.0));
    let mut simulation = started(world);
    let (mut entered, mut left) = (0, 0);
    run_with(&mut simulation, 400, |simulation, _| {
        for event in simulation.events() {
            match event {
                Event::Entered { sensor, .. } if sensor.body == watcher => entered += 1,
                Event::Left { sensor, .. } if sensor.body == watcher => left += 1,
                _ => {}
            }
        }
    });
    assert_eq!(entered - left, simulation.overlaps().len());
    assert!(entered > 20, "{entered} entered, {left} left");
    let mass = body(&simulation, watcher).mass.mass;
    assert!((mass - 0.064).abs() < 1e-6, "{mass} kg");
}

/// Three bars as a U.
fn letter() -> Body {
    let (long, wide) = (2.0, 0.2);
    let side = |x: f32| (Shape::cuboid(wide, long, wide), vec3(x, long, 0.0), Quat::IDENTITY);
    let [left, right] = [-long, long].map(side);
    let base = light().shape(Shape::cuboid(long, wide, wide));
    base.shape_at(left.0, left.1, left.2).shape_at(right.0, right.1, right.2)
}

/// Rapier, primitives3, compound3 and convex_polyhedron3, with 160, 90 and 90 bodies in place of 1,280, 960 and 250.
#[test]
fn bodies_of_every_shape_pile_up_on_the_ground() {
    let mut state = 1_u32;
    let mut random = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        3.0 * (state >> 8) as f32 / 16_777_216.0
    };
    let hulls: Vec<Shape> = (0..10)
        .map(|_| Shape::convex_hull(&[(); 10].map(|()| vec3(random(), random(), random()))).expect("a hull"))
        .collect();
    type Kind<'a> = (&'a str, usize, f32, &'a dyn Fn(usize) -> Body);
    let kinds: [Kind; 3] = [
        ("primitives", 4, 3.0, &|layer| light().shape(primitive(layer))),
        ("letters", 3, 5.0, &|_| letter()),
        ("hulls", 3, 4.0, &|layer| light().shape(hulls[layer].clone())),
    ];
    for (name, side, apart, of) in kinds {
        let mut world = World::new();
        world.insert(ground(100.1, 0.1));
        add_layers(&mut world, 10, side, (Vec3::Y * 4.5, apart), of);
        let mut simulation = started(world);
        run(&mut simulation, 400);
        let low = lowest(&simulation.world);
        assert!(low > 0.0, "{name}: a center at {low} m");
        let deepest = simulation.penetration().max;
        assert!(deepest < 0.02, "{name}: {deepest} m");
    }
}

/// Rapier, trimesh3 and heightfield3, with 96 bodies in place of 640.
#[test]
fn nothing_falls_through_a_terrain() {
    let points = 21;
    let height = |i: usize, j: usize| {
        let is_edge = [i, j].iter().any(|&n| n == 0 || n == points - 1);
        if is_edge { 10.0 } else { (5.0 * i as f32).sin() + (5.0 * j as f32).cos() }
    };
    let heights: Vec<Vec<f32>> = (0..points).map(|i| (0..points).map(|j| height(i, j)).collect()).collect();
    let field = Shape::height_field(&heights, vec3(100.0, 1.0, 100.0)).expect("a field");
    for (name, terrain) in [("mesh", meshed(&field)), ("height field", field)] {
        let mut world = World::new();
        world.insert(Body::fixed().shape(terrain));
        add_layers(&mut world, 6, 4, (Vec3::Y * 5.0, 3.0), |layer| match layer % 6 {
            5 => {
                let part = |place: Vec3| (cube(1.0), place, Quat::IDENTITY);
                let [(x, at_x, turn), (y, at_y, _)] = [Vec3::X, Vec3::Y].map(part);
                light().shape(cube(1.0)).shape_at(x, at_x, turn).shape_at(y, at_y, turn)
            }
            kind => light().shape(primitive(kind)),
        });
        let mut simulation = started(world);
        run(&mut simulation, 300);
        let below = simulation.world.dynamic().filter(|body| body.position.y < -2.5).count();
        assert_eq!(below, 0, "fell through the {name}");
        let deepest = simulation.penetration().max;
        assert!(deepest < 0.02, "{name}: {deepest} m");
    }
}

/// Rapier, voxels3, the ground alone: bodies fall into a bowl of blocks.
#[test]
fn nothing_falls_through_ground_of_voxels() {
    let side = 16_i32;
    let cells: Vec<IVec3> = (0..side * side)
        .flat_map(|n| {
            let (x, z) = (n % side, n / side);
            let from_middle = (x - side / 2).abs().max((z - side / 2).abs());
            (0..=from_middle / 2).map(move |y| IVec3::new(x, y, z))
        })
        .collect();
    let mut world = World::new();
    let blocks = Shape::voxels(Vec3::ONE, &cells).expect("blocks");
    world.insert(at(Body::fixed().shape(blocks), vec3(-8.0, 0.0, -8.0)));
    add_layers(&mut world, 5, 2, (Vec3::Y * 6.0, 3.0), |layer| light().shape(primitive(layer)));
    let mut simulation = started(world);
    run(&mut simulation, 400);
    let inside = |body: &&Body| body.position.x.abs() < 7.0 && body.position.z.abs() < 7.0;
    let heights: Vec<f32> = simulation.world.dynamic().filter(inside).map(|body| body.center_of_mass().y).collect();
    assert!(heights.len() > 10 && heights.iter().all(|&height| height > 1.2), "{heights:?}");
}

/// Rapier, voxels3: bodies of blocks fall into the bowl, and a staple of blocks hangs on a bar.
#[test]
fn bodies_of_voxels_rest_on_voxels_and_hang_on_what_they_hold() {
    let staple: Vec<IVec3> =
        [[0, 0], [0, 1], [0, 2], [1, 2], [2, 2], [2, 1], [2, 0]].map(|[x, y]| IVec3::new(x, y, 0)).to_vec();
    let cross: Vec<IVec3> = (0..3).flat_map(|axis| [-1, 0, 1].map(|i| IVec3::AXES[axis] * i)).collect();
    let blocks = |cells: &[IVec3]| Body::dynamic().voxels(Vec3::splat(0.3), cells).expect("blocks");
    let mut world = World::new();
    let ground: Vec<IVec3> = (0..64).map(|n| IVec3::new(n % 8, 0, n / 8)).collect();
    let ground = Shape::voxels(Vec3::ONE, &ground).expect("blocks");
    world.insert(at(Body::fixed().shape(ground), vec3(-4.0, -1.0, -4.0)));
    for i in 0..12 {
        let place = vec3(1.5 * (i % 3) as f32 - 1.5, 1.0 + i as f32, 1.5 * (i / 3) as f32 - 2.25);
        world.insert(at(blocks(if i % 2 == 0 { &staple } else { &cross }), place));
    }
    // The middle of the staple's top is over the bar, which is 0.2 m high.
    world.insert(at(Body::fixed().shape(Shape::cuboid(0.1, 0.1, 1.0)), vec3(10.45, 5.0, 0.15)));
    let hung = world.insert(at(blocks(&staple), vec3(10.0, 4.5, 0.0)));
    let mut simulation = started(world);
    run(&mut simulation, 600);
    assert!((body(&simulation, hung).position.y - 4.5).abs() < 1e-3, "{}", body(&simulation, hung).position);
    for body in simulation.world.dynamic() {
        assert!(body.position.y > -0.1 && body.linear_velocity.length() < 0.02, "{body:?}");
    }
    let deepest = simulation.penetration().max;
    assert!(deepest < 2e-3, "{deepest} m");
}

/// Balls of 1 m in a row on threads of 5 m, the last one at 7 m/s. After each step, `watch` gets their velocities.
fn cradle(count: usize, steps: usize, mut watch: impl FnMut(&[f32])) -> f64 {
    let mut world = World::new();
    let balls: Vec<BodyHandle> = (0..count)
        .map(|i| {
            let place = Vec3::X * 1.01 * i as f32;
            let speed = if i == count - 1 { 7.0 } else { 0.0 };
            let ball = at(light().friction(0.0).restitution(1.0).shape(Shape::ball(0.5)), place);
            let ball = world.insert(ball.velocity(Vec3::X * speed, Vec3::ZERO));
            world.insert_joint(Joint::to_world(ball, Vec3::Y * 5.0, place + Vec3::Y * 5.0));
            ball
        })
        .collect();
    let start = energy(&world);
    let mut simulation = started(world);
    run_with(&mut simulation, steps, |simulation, _| {
        let speeds: Vec<f32> = balls.iter().map(|&ball| body(simulation, ball).linear_velocity.x).collect();
        watch(&speeds);
    });
    energy(&simulation.world) / start
}

/// Rapier, newton_cradle3. A ball alone keeps 94 % of its energy for 20 s in Rapier.
#[test]
fn a_ball_on_a_thread_keeps_more_energy_than_in_rapier() {
    let kept = cradle(1, 1200, |_| {});
    assert!((0.94..=1.0001).contains(&kept), "{kept} of the energy");
}

/// Rapier, newton_cradle3. Five balls keep 31 % of their energy for 20 s in Rapier.
#[test]
fn a_cradle_of_five_keeps_as_much_energy_as_in_rapier() {
    let kept = cradle(5, 1200, |_| {});
    assert!((0.31..=1.0001).contains(&kept), "{kept} of the energy");
}

/// Rapier, newton_cradle3.
#[test]
fn the_first_ball_of_a_cradle_flies_off_while_the_others_rest() {
    let mut best = (0.0, f32::INFINITY);
    cradle(5, 400, |speeds| {
        if speeds[0] < best.0 {
            best = (speeds[0], speeds[1..].iter().fold(0.0, |most, speed| speed.abs().max(most)));
        }
    });
    assert!(best.0 < -6.0 && best.1 < 1.0, "at {} m/s, the others at up to {} m/s", best.0, best.1);
}

/// The largest distance of balls on springs of 1,000 N/m, which begin at 3 m, from the closed form (m). The damping
/// ratios are fifteenths.
fn worst_spring(fifteenths: std::ops::RangeInclusive<usize>) -> f32 {
    let mut world = weightless();
    let (mass, stiffness) = (4.0 / 3.0 * PI * 0.125, 1e3_f32);
    let rate = (stiffness / mass).sqrt();
    let balls: Vec<(BodyHandle, f32)> = fifteenths
        .map(|i| {
            let (place, ratio) = (vec3(1.5 * i as f32, 4.5, 0.0), i as f32 / 15.0);
            let ball = world.insert(at(light().shape(Shape::ball(0.5)), place));
            let spring = Axis::FREE.spring_damper(0.0, stiffness, 2.0 * ratio * rate * mass, f32::MAX);
            world.insert_joint(Joint::to_world(ball, Vec3::ZERO, place - Vec3::Y * 3.0).at_distance(spring));
            (ball, ratio)
        })
        .collect();
    let exact = |ratio: f32, t: f32| {
        let decay = (-ratio * rate * t).exp();
        if ratio < 1.0 {
            let swing = rate * (1.0 - ratio * ratio).sqrt();
            3.0 * decay * ((swing * t).cos() + ratio * rate / swing * (swing * t).sin())
        } else if ratio == 1.0 {
            3.0 * decay * (1.0 + rate * t)
        } else {
            let root = (ratio * ratio - 1.0).sqrt();
            let [slow, fast] = [-1.0, 1.0].map(|sign| -rate * (ratio + sign * root));
            3.0 * (slow * (fast * t).exp() - fast * (slow * t).exp()) / (slow - fast)
        }
    };
    let mut worst = 0.0_f32;
    let mut simulation = started(world);
    run_with(&mut simulation, 60, |simulation, step| {
        for &(ball, ratio) in &balls {
            let wanted = exact(ratio, (step + 1) as f32 * DT);
            worst = worst.max((place(simulation, ball).y - 1.5 - wanted).abs());
        }
    });
    worst
}

/// Rapier, spring_joints3, for damping ratios from 0.2 to 1.
#[test]
fn springs_of_a_stiffness_swing_as_their_closed_form_says() {
    let worst = worst_spring(3..=15);
    assert!(worst < 0.1, "{worst} m");
}

/// Rapier, spring_joints3, for damping ratios from 1 to 2.
#[test]
fn springs_with_more_than_critical_damping_creep_as_their_closed_form_says() {
    let worst = worst_spring(16..=30);
    assert!(worst < 0.03, "{worst} m");
}

/// Rapier, joint_motor_position3: springs to angles from -pi to pi, and motors against limits.
#[test]
fn rods_come_to_the_angles_of_their_springs_and_of_their_limits() {
    let mut world = weightless();
    let targets = (0..17).map(|i| (i < 9, -PI + FRAC_PI_4 * (i % 9) as f32));
    let joints: Vec<(JointHandle, f32)> = targets
        .enumerate()
        .map(|(i, (is_spring, target))| {
            let anchor = vec3(1.5 * i as f32, 0.0, 0.0);
            let rod = light().shape(Shape::cuboid(0.1, 0.5, 0.1));
            let (turn, side) = if is_spring { (0.0, 1.0) } else { (PI, -1.0) };
            let rod = at(rod, anchor + Vec3::Y * 0.5 * side).rotation(Quat::from_rotation_z(turn));
            let hinge = Joint::to_world(world.insert(rod), Vec3::Y * -0.5, anchor).hinge(Vec3::Z);
            let joint =
                if is_spring { hinge.spring(target, 5.0, 1.0) } else { hinge.motor(1.5, 100.0).limited(-PI, target) };
            (world.insert_joint(joint), target)
        })
        .collect();
    let mut simulation = started(world);
    run(&mut simulation, 600);
    for (i, (joint, target)) in joints.into_iter().enumerate() {
        let angle = motions(&simulation, &[joint], 3)[0].0;
        let off = (angle - target + PI).rem_euclid(TAU) - PI;
        assert!(off.abs() < 1e-3, "rod {i}: {angle} rad in place of {target} rad");
    }
}

/// Rapier, debug_pop3: a box that begins 1 m deep in the ground.
#[test]
fn a_box_comes_out_of_the_ground_without_a_jump() {
    let mut world = World::new();
    world.insert(ground(10.0, 10.0));
    let deep = world.insert(light().shape(cube(1.0)));
    let mut simulation = started(world);
    let mut top = 0.0_f32;
    run_with(&mut simulation, 600, |simulation, _| top = top.max(place(simulation, deep).y));
    let end = place(&simulation, deep).y;
    assert!((end - 1.0).abs() < 2e-3 && top < 1.02, "highest {top} m, at the end {end} m");
}

/// Rapier, debug_eccentric_boxes3: hulls 170 m from the origins of their bodies, the second one above the first one.
#[test]
fn hulls_far_from_the_origins_of_their_bodies_lie_on_each_other() {
    let mut world = World::new();
    world.insert(ground(100.1, 0.1));
    let far: Vec<Vec3> = corners(1.0).into_iter().map(|corner| corner + Vec3::splat(100.0)).collect();
    let hull = Shape::convex_hull(&far).expect("a cube");
    let hulls = [0.0, 4.0].map(|y| world.insert(light().shape(hull.clone()).position(-100.0, y - 90.0, -100.0)));
    let mut simulation = started(world);
    run(&mut simulation, 400);
    for (hull, wanted) in hulls.into_iter().zip([1.0, 3.0]) {
        let height = body(&simulation, hull).center_of_mass().y;
        assert!((height - wanted).abs() < 0.01, "{height} m in place of {wanted} m");
    }
}

/// Rapier, debug_cube_high_mass_ratio3: 64 m³ on a frame of bars of 0.3 m³. Rapier asks for 36 iterations.
#[test]
fn bars_carry_a_cube_of_two_hundred_times_their_mass() {
    let mut world = World::new();
    let (long, thin) = (2.0, 0.2);
    world.insert(at(Body::fixed().shape(cube(long)), Vec3::NEG_Y * (long + thin)));
    for layer in 0..4 {
        let out = 0.5 * long - thin;
        for side in [-out, out] {
            let y = 4.0 * thin * layer as f32;
            world.insert(light().shape(Shape::cuboid(0.5 * long, thin, thin)).position(0.0, y, side));
            let across = light().shape(Shape::cuboid(thin, thin, 0.5 * long));
            world.insert(across.position(side, y + 2.0 * thin, 0.0));
        }
    }
    let height = long + 3.75 * 4.0 * thin;
    let heavy = world.insert(light().shape(cube(long)).position(0.0, height, 0.0));
    let mut simulation = started(world);
    run(&mut simulation, 600);
    let sunk = height - place(&simulation, heavy).y;
    assert!(sunk.abs() < 1e-3, "it sank by {sunk} m");
    assert!(upright(body(&simulation, heavy)) > 0.99999);
}

/// Rapier, debug_chain_high_mass_ratio3: a cube of 1,910 times the mass of a link swings at a chain of 99 links.
#[test]
fn a_chain_with_a_heavy_end_stays_closed() {
    let mut world = World::new();
    let link = light().shape(Shape::ball(0.2));
    let mut parent = world.insert(at(link.clone(), Vec3::Z * 0.5));
    world.insert_joint(Joint::to_world(parent, Vec3::Z * -0.5, Vec3::ZERO));
    for i in 1..99 {
        let next = world.insert(at(link.clone(), Vec3::Z * 0.5 * (i + 1) as f32));
        world.insert_joint(Joint::new(next, Vec3::Z * -0.5, parent, Vec3::ZERO));
        parent = next;
    }
    let heavy = world.insert(at(light().shape(cube(2.0)), Vec3::Z * 52.0));
    world.insert_joint(Joint::new(heavy, Vec3::Z * -2.5, parent, Vec3::ZERO));
    let mut simulation = started(world);
    let mut gap = 0.0_f32;
    run_with(&mut simulation, 600, |simulation, _| gap = gap.max(simulation.world.joint_gap()));
    assert!(gap < 1e-3, "{gap} m");
}

/// Rapier, debug_prismatic3: a box on four balls, each on a slider with a spring.
#[test]
fn a_box_on_springs_comes_to_rest_upright() {
    let mut world = World::new();
    world.insert(ground(50.0, 0.1));
    let chassis = world.insert(light().shape(Shape::cuboid(1.0, 0.25, 1.0)).position(0.0, 5.0, 0.0));
    let mut joints = Vec::new();
    for (x, z) in [(1.0, -1.0), (-1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)] {
        let out = vec3(x, -1.0, z);
        let wheel = world.insert(at(light().shape(Shape::ball(0.5)), out + Vec3::Y * 5.0));
        let slider = Joint::new(wheel, Vec3::ZERO, chassis, out).slider(Vec3::Y);
        joints.push(world.insert_joint(slider.spring_damper(0.0, 20.0, 3.0)));
    }
    world.insert(light().shape(Shape::cuboid(0.5, 0.1, 0.5)).position(1.0, 2.6, -1.0));
    let mut simulation = started(world);
    run(&mut simulation, 900);
    assert!(upright(body(&simulation, chassis)) > 0.9 && fastest(&simulation.world) < 0.01);
    // The springs carry the weight of the box.
    let borne: f32 = motions(&simulation, &joints, 0).iter().map(|(at, _)| 20.0 * at).sum();
    let weight = 2.0 * G;
    assert!((borne / weight - 1.0).abs() < 0.01, "{borne} N in place of {weight} N");
}

/// Rapier, debug_sleeping_kinematic3.
#[test]
fn a_rider_wakes_with_its_platform_and_sleeps_again() {
    let mut world = World::new();
    let plate = Body::kinematic().shape(Shape::cuboid(5.0, 0.5, 5.0));
    let lift = world.insert(plate.clone().position(0.0, 2.3, 0.0));
    let slow = world.insert(plate);
    let rider = world.insert(light().shape(cube(0.5)).position(0.0, 3.3, 0.0));
    let mut simulation = started(world);
    run(&mut simulation, 500);
    assert!(simulation.is_asleep(rider));
    body_mut(&mut simulation, slow).linear_velocity = Vec3::Y * 0.01;
    for step in 500..1000 {
        let t = step as f32 * DT;
        body_mut(&mut simulation, lift).linear_velocity = vec3(0.0, (2.0 * t).cos(), 0.5 * t.sin());
        run(&mut simulation, 1);
        assert!(!simulation.is_asleep(rider), "step {step}");
        let above = place(&simulation, rider).y - place(&simulation, lift).y - 1.0;
        // The platform falls away at 0.57 m/s at first.
        let most = if step < 530 { 0.5 * 0.58 * 0.58 / G } else { 1e-3 };
        assert!((-1e-3..most).contains(&above), "step {step}: {above} m above the platform");
    }
    let risen = place(&simulation, slow).y;
    assert!((risen - 0.01 * 500.0 * DT).abs() < 1e-4, "{risen} m");
    for plate in [slow, lift] {
        body_mut(&mut simulation, plate).linear_velocity = Vec3::ZERO;
    }
    run(&mut simulation, 500);
    assert!(simulation.is_asleep(rider));
}

/// Rapier, debug_disabled3, by groups: a shape has no switch.
#[test]
fn a_platform_that_is_switched_off_lets_its_box_fall() {
    let mut world = World::new();
    world.insert(ground(10.1, 2.1));
    let platform = world.insert(Body::fixed().shape(Shape::cuboid(5.0, 1.0, 5.0)).position(0.0, 5.0, 0.0));
    let falls = world.insert(light().shape(cube(0.5)).position(0.0, 7.0, 0.0));
    let mut simulation = started(world);
    run(&mut simulation, 250);
    let on = place(&simulation, falls).y;
    body_mut(&mut simulation, platform).groups = Groups { membership: 0, filter: 0 };
    run(&mut simulation, 250);
    let off = place(&simulation, falls).y;
    assert!((on - 6.5).abs() < 2e-3 && (off - 0.5).abs() < 2e-3, "{on} m, then {off} m");
}

/// Rapier, platform3: boxes on a kinematic platform that is sent to places.
#[test]
fn boxes_ride_on_a_platform_for_ten_seconds() {
    let mut world = World::new();
    let platform = world.insert(Body::kinematic().shape(Shape::cuboid(5.0, 0.5, 5.0)));
    let mut boxes = Vec::new();
    for layer in 0..3 {
        for (i, k) in grid(6, 6) {
            let place = vec3(i - 2.5, 1.0 + 0.85 * layer as f32, k - 2.5);
            boxes.push(world.insert(at(light().shape(cube(0.4)), place)));
        }
    }
    let mut simulation = started(world);
    run(&mut simulation, 60);
    let from: Vec<Vec3> = boxes.iter().map(|&rider| place(&simulation, rider)).collect();
    for step in 1..=600 {
        let t = step as f32 * DT;
        body_mut(&mut simulation, platform).move_to(vec3(0.0, t.sin(), 3.0 * (0.5 * t).sin()), Quat::IDENTITY, DT);
        run(&mut simulation, 1);
    }
    let carried = place(&simulation, platform);
    let shifts = boxes.iter().zip(&from).map(|(&rider, from)| (place(&simulation, rider) - carried - *from).length());
    let most = shifts.fold(0.0, f32::max);
    assert!(most < 0.1, "a box shifted by {most} m");
}

/// A capsule of 1.8 m that walks, with its middle at this place.
fn walker(world: &mut World, place: Vec3) -> Character {
    Character::new(world.insert(at(Body::kinematic().shape(Shape::capsule(0.6, 0.3)), place)))
}

/// Where a character comes to in some steps.
fn walked(world: World, mut character: Character, velocity: Vec3, steps: usize) -> Vec3 {
    let mut simulation = started(world);
    for _ in 0..steps {
        character.walk(&mut simulation, velocity, DT).expect("a walk");
        run(&mut simulation, 1);
    }
    place(&simulation, character.body)
}

/// Rapier, character_controller3: stairs, a slope, a slope that is too steep, a wall, and steps down.
#[test]
fn a_character_climbs_stairs_and_slopes_and_slides_along_walls() {
    let stairs = || {
        let mut world = World::new();
        world.insert(ground(50.0, 0.1));
        for i in 0..10 {
            let height = 0.1 * (i + 1) as f32;
            let step = Body::fixed().shape(Shape::cuboid(0.5, 0.5 * height, 2.0));
            world.insert(step.position(2.0 + i as f32, 0.5 * height, 0.0));
        }
        world
    };
    let stand = 0.9;
    let mut world = stairs();
    let up = walker(&mut world, vec3(0.0, stand, 0.0));
    let top = walked(world, up, Vec3::X * 3.0, 180);
    assert!((top.x - 9.0).abs() < 0.05 && (top.y - (stand + 0.8)).abs() < 0.02, "up the stairs to {top}");
    let mut world = stairs();
    let down = walker(&mut world, vec3(11.0, stand + 1.0, 0.0));
    let foot = walked(world, down, Vec3::X * -3.0, 220);
    assert!((foot.x).abs() < 0.05 && (foot.y - stand).abs() < 0.02, "down the stairs to {foot}");
    for (angle, climbs) in [(0.2, true), (1.0, false)] {
        let mut world = World::new();
        world.insert(ground(50.0, 0.1));
        let slope = Body::fixed().shape(Shape::half_space(Vec3::new(-f32::sin(angle), f32::cos(angle), 0.0)));
        world.insert(slope.position(2.0, 0.0, 0.0));
        let character = walker(&mut world, vec3(0.0, stand, 0.0));
        let end = walked(world, character, Vec3::X * 2.0, 240);
        let height = end.y - stand;
        assert_eq!(height > 1.0, climbs, "a slope of {angle} rad: {end}");
        assert!(climbs || height.abs() < 0.05, "a slope of {angle} rad: {end}");
    }
    let mut world = World::new();
    world.insert(ground(50.0, 0.1));
    world.insert(Body::fixed().shape(Shape::cuboid(0.5, 2.0, 20.0)).position(2.0, 2.0, 0.0));
    let character = walker(&mut world, vec3(0.0, stand, 0.0));
    let end = walked(world, character, vec3(2.0, 0.0, 1.0), 180);
    assert!((end.x - 1.2).abs() < 0.02 && (end.z - 3.0).abs() < 0.02, "along the wall to {end}");
}

/// Rapier, character_controller3: a box that the character pushes, here over a mesh.
#[test]
fn a_character_pushes_a_light_box_over_a_mesh() {
    let mut world = World::new();
    world.insert(Body::fixed().shape(sheet(20.0)));
    let pushed = world.insert(Body::dynamic().shape(cube(0.5)).total_mass(20.0).position(2.0, 0.5, 0.0));
    let mut character = walker(&mut world, vec3(0.0, 0.91, 0.0));
    let mut simulation = started(world);
    for _ in 0..180 {
        character.walk(&mut simulation, Vec3::X * 2.0, DT).expect("a walk");
        run(&mut simulation, 1);
    }
    let (own, other) = (place(&simulation, character.body), place(&simulation, pushed));
    assert!(other.x > 4.0 && own.x < other.x - 0.79 && own.y > 0.85, "{own} behind {other}");
}
