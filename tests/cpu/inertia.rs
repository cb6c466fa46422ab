//! Bodies whose mass lies close to their center, beside the size of their shapes.

use std::f32::consts::FRAC_PI_2;

use drystone::glam::{Mat3, Quat, Vec3};
use drystone::metrics::fastest;
use drystone::{Body, Cpu, MassProperties, Shape, Simulation, SolverConfig, World};
use drystone_scenes::{CATALOGUE, Scene};

const DT: f32 = 1.0 / 60.0;
/// m r² over the inertia of a cube, r from its center to the middle of an edge.
const RATIOS: [f32; 5] = [31.0, 64.0, 1e3, 1e5, 2e7];

/// A cube of 0.2 m and 1 kg.
fn cube(ratio: f32) -> Body {
    let inertia = Vec3::splat(0.02 / ratio);
    let mass = MassProperties { mass: 1.0, principal_inertia: inertia, ..MassProperties::IMMOVABLE };
    Body::dynamic().shape(Shape::cuboid(0.1, 0.1, 0.1)).mass_properties(mass)
}

/// On a floor with friction 0.5, with this many substeps.
fn on_a_floor(body: Body, substeps: u32) -> Simulation {
    let mut world = World::new();
    world.insert(Body::fixed().shape(Shape::half_space(Vec3::Y)));
    world.insert(body);
    let config = SolverConfig::default().with(|c| c.substeps = substeps).without_sleep();
    Simulation::with(world, config, Box::new(Cpu::new())).expect("a good world")
}

/// The moments of inertia with which a body is simulated.
fn simulated(body: &Body) -> Vec3 {
    let mut world = World::new();
    world.insert(body.clone());
    let simulation = Simulation::new(world).expect("a good body");
    simulation.world.bodies[0].mass.principal_inertia
}

#[test]
fn a_moment_of_inertia_is_at_least_a_32nd_of_mass_times_lever_squared() {
    assert!((simulated(&cube(2e7)) * 32.0 / 0.02 - 1.0).abs().max_element() < 1e-6);
    assert_eq!(simulated(&cube(31.0)), Vec3::splat(0.02 / 31.0));
    // About its own axis, y, a rod has next to no inertia, and a lever that is as short.
    let rod = Body::dynamic().shape(Shape::cylinder(0.5, 1e-3)).total_mass(1.0);
    assert_eq!(simulated(&rod), rod.mass.principal_inertia);
    let inertia = rod.mass.principal_inertia * Vec3::new(1e-3, 1.0, 1.0);
    let bent = rod.clone().mass_properties(MassProperties { principal_inertia: inertia, ..rod.mass });
    let raised = simulated(&bent);
    assert_eq!((raised.y, raised.z), (inertia.y, inertia.z));
    assert!((raised.x * 32.0 / 0.25 - 1.0).abs() < 1e-4, "{raised}");
    // The lever is that from the center of mass to the far side of the shape that is furthest out.
    let beside = cube(2e7).shape_at(Shape::ball(0.1), 0.9 * Vec3::X, Quat::IDENTITY);
    let raised = simulated(&beside.mass_properties(cube(2e7).mass));
    assert!((raised * 32.0 / Vec3::new(0.02, 1.0, 1.0) - 1.0).abs().max_element() < 0.02, "{raised}");
}

#[test]
fn no_solid_of_even_density_is_raised() {
    let sliver = [Vec3::ZERO, Vec3::new(10.0, 0.1, 0.0), Vec3::new(10.0, -0.1, 0.1), Vec3::new(10.0, 0.0, -0.1)];
    let shapes = [
        Shape::cone(1.0, 0.01),
        Shape::cone(0.01, 1.0),
        Shape::cuboid(1.0, 1e-3, 0.5),
        Shape::convex_hull(&sliver).expect("a tetrahedron"),
        Shape::capsule(1.0, 0.01),
    ];
    for shape in shapes {
        let body = Body::dynamic().shape(shape);
        assert_eq!(simulated(&body), body.mass.principal_inertia, "{body:?}");
    }
    let mut bodies = 0;
    for entry in CATALOGUE {
        let world = Scene::find(entry.name, &[]).expect(entry.name).world;
        let before: Vec<_> = world.bodies.iter().map(|body| body.mass).collect();
        let simulation = Simulation::new(world).expect(entry.name);
        let after: Vec<_> = simulation.world.bodies.iter().map(|body| body.mass).collect();
        assert_eq!(before, after, "{}", entry.name);
        bodies += after.len();
    }
    assert!(bodies > 1000);
}

/// Without a least inertia a cube of ratio 300 rocks for ever and one of 1e5 falls through the floor.
#[test]
fn a_cube_of_next_to_no_inertia_lies_still() {
    for (substeps, ratio) in [4, 8, 32, 128].into_iter().flat_map(|n| RATIOS.map(|ratio| (n, ratio))) {
        let mut simulation = on_a_floor(cube(ratio).position(0.0, 0.1, 0.0), substeps);
        for _ in 0..300 {
            simulation.step(DT).expect("a step");
            let (speed, _) = fastest(&simulation.world).expect("a cube");
            assert!(speed < 0.03, "{ratio}, {substeps} substeps: {speed} m/s");
        }
        let way = simulation.world.bodies[1].position.distance(0.1 * Vec3::Y);
        let (speed, _) = fastest(&simulation.world).expect("a cube");
        assert!(way < 2e-5 && speed < 1e-4, "{ratio}, {substeps} substeps: {way} m, {speed} m/s");
    }
}

/// v²/(2 mu g), as every body of 1 kg.
#[test]
fn a_cube_of_next_to_no_inertia_slides_as_far_as_any_other() {
    for ratio in RATIOS {
        let sliding = cube(ratio).position(0.0, 0.1, 0.0).velocity(2.0 * Vec3::X, Vec3::ZERO);
        let mut simulation = on_a_floor(sliding, 8);
        (0..120).for_each(|_| drop(simulation.step(DT).expect("a step")));
        let slid = f64::from(simulation.world.bodies[1].position.x);
        assert!((slid * 2.0 * 0.5 * 9.81 / 4.0 - 1.0).abs() < 0.02, "{ratio}: {slid} m");
    }
}

/// Without a least inertia, a cube of ratio 300 gains 0.98 J of 5 in one step.
#[test]
fn a_cube_of_next_to_no_inertia_that_tumbles_gains_no_energy() {
    for (substeps, ratio) in [8, 32, 128].into_iter().flat_map(|n| RATIOS.map(|ratio| (n, ratio))) {
        let tumbling = cube(ratio).position(0.0, 0.4, 0.0).velocity(Vec3::X, Vec3::new(1.0, 0.5, 2.0));
        let mut simulation = on_a_floor(tumbling, substeps);
        let energy = |world: &World| world.kinetic_energy() + world.potential_energy();
        let first = energy(&simulation.world);
        let (mut before, mut lowest) = (first, f32::INFINITY);
        for step in 0..300 {
            simulation.step(DT).expect("a step");
            let now = energy(&simulation.world);
            assert!(now - before < 1e-3 * first, "{ratio}, {substeps} substeps, step {step}: {} J", now - before);
            before = now;
            lowest = lowest.min(simulation.world.bodies[1].position.y);
        }
        assert!(
            before < 0.25 * first && lowest > 0.098,
            "{ratio}, {substeps} substeps: {before} J of {first}, {lowest} m"
        );
    }
}

#[test]
fn a_moment_of_inertia_that_the_caller_lowers_is_raised_in_the_next_step() {
    let mut simulation = on_a_floor(cube(3.0).position(0.0, 0.1, 0.0), 8);
    simulation.step(DT).expect("a step");
    let whole = simulation.world.bodies[1].mass;
    simulation.world.bodies[1].mass.principal_inertia = Vec3::splat(1e-9);
    let preview = simulation.next_problem(DT).expect("a step").0;
    (0..300).for_each(|_| drop(simulation.step(DT).expect("a step")));
    let body = &simulation.world.bodies[1];
    assert!((body.mass.principal_inertia * 32.0 / 0.02 - 1.0).abs().max_element() < 1e-6, "{:?}", body.mass);
    assert!(body.position.distance(0.1 * Vec3::Y) < 1e-3, "{}", body.position);
    let inverse = preview.masses[1].inv_inertia_x[0];
    assert!((inverse * body.mass.principal_inertia.x - 1.0).abs() < 1e-5, "{inverse}");
    assert_eq!(whole.mass, body.mass.mass);
}

/// The inertia of a box is m/3 (b² + c²) about its axis a, and so on, whatever its size and whichever way it is turned.
#[test]
fn a_box_has_its_inertia_along_every_axis_and_at_every_size() {
    let turns = [
        Quat::IDENTITY,
        Quat::from_rotation_z(FRAC_PI_2),
        Quat::from_rotation_y(FRAC_PI_2),
        Quat::from_rotation_y(0.3) * Quat::from_rotation_x(1.1),
    ];
    let half_extents =
        [[0.95, 1.0, 1.0], [1.0, 0.95, 1.0], [1.0, 1.0, 1.0], [3.0, 1.0, 2.0], [1.0, 0.01, 1.0], [1.0, 300.0, 1.0_f32]];
    for (half, size, turn) in half_extents
        .into_iter()
        .flat_map(|half| [1e-4_f32, 0.01, 1.0, 100.0].map(|size| (Vec3::from_array(half) * size, size)))
        .flat_map(|(half, size)| turns.map(|turn| (half, size, turn)))
    {
        let shape = || Shape::cuboid(half.x, half.y, half.z);
        let whole = Body::dynamic().shape_at(shape(), Vec3::ZERO, turn).total_mass(3.0);
        // Two halves side by side are the same solid.
        let side = Shape::cuboid(0.5 * half.x, half.y, half.z);
        let offset = turn * (0.5 * half.x * Vec3::X);
        let halves = Body::dynamic().shape_at(side.clone(), offset, turn).shape_at(side, -offset, turn).total_mass(3.0);
        let squares = half * half;
        let exact = Mat3::from_diagonal(Vec3::splat(squares.element_sum()) - squares);
        let axes = Mat3::from_quat(turn);
        let exact = axes * exact * axes.transpose();
        for body in [whole, halves] {
            let off = body.mass.world_inertia(Quat::IDENTITY) - exact;
            let off = off.to_cols_array().into_iter().fold(0.0_f32, |worst, x| worst.max(x.abs()));
            assert!(off < 1e-4 * squares.element_sum(), "{half} at {size}, {turn}: {off} off {exact}");
        }
    }
}

/// A mass that is added as numbers is the same as one that is added as a shape, wherever it is and however it is turned.
#[test]
fn additional_mass_is_that_of_a_shape_there() {
    let (at, turned) = (Vec3::new(0.3, -0.8, 0.5), Quat::from_scaled_axis(Vec3::new(0.4, 1.1, -0.2)));
    let (cube, board) = (Shape::cuboid(0.5, 0.4, 0.3), Shape::cuboid(0.6, 0.1, 0.2));
    let both = Body::dynamic().shape(cube.clone()).shape_at(board.clone(), at, turned).mass;
    let alone = Body::dynamic().shape(board).mass;
    let frame = turned * alone.principal_frame;
    let added = MassProperties { center: at, principal_frame: frame, ..alone };
    let sum = Body::dynamic().additional_mass(added).shape(cube).mass;
    assert!((sum.mass - both.mass).abs() < 1e-6 * both.mass && (sum.center - both.center).length() < 1e-6);
    let difference = sum.world_inertia(Quat::IDENTITY) - both.world_inertia(Quat::IDENTITY);
    let largest = difference.to_cols_array().into_iter().fold(0.0, |most: f32, x| most.max(x.abs()));
    assert!(largest < 1e-5 * both.principal_inertia.max_element(), "{difference}");
}

/// A second mass takes the place of the first, nothing changes what is given as a whole, and what no mass can be is refused by its name.
#[test]
fn additional_mass_is_added_once() {
    let cube = || Body::dynamic().shape(Shape::cuboid(0.5, 0.5, 0.5)).total_mass(6.0);
    let point = |mass: f32| MassProperties::point(mass, Vec3::Y);
    let body = cube().additional_mass(point(4.0)).additional_mass(point(2.0));
    assert_eq!((body.mass.mass, body.mass.center), (8.0, Vec3::Y * 0.25));
    let mut again = body.clone();
    again.update_mass();
    assert_eq!(again.mass, body.mass);
    assert_eq!(cube().additional_mass(point(0.0)).mass, cube().mass);
    let given = cube().mass;
    assert_eq!(cube().mass_properties(given).additional_mass(point(3.0)).mass, given);
    for (mass, line) in [(-1.0, "additional_mass: mass = -1e0 kg"), (f32::NAN, "additional_mass: mass = NaN kg")] {
        let mut world = World::new();
        world.insert(cube().additional_mass(point(mass)));
        let error = world.check().expect_err("no mass").to_string();
        assert!(error.contains(line) && !error.contains('\n'), "{error}");
    }
}
