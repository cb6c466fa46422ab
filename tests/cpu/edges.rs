//! Edges between faces that lie flush cost nothing: what slides or rolls over a thousand of them goes as on one face.

use std::f32::consts::{FRAC_PI_2, PI};

use drystone::glam::{IVec3, Quat, Vec3};
use drystone::stages::random::SplitMix64;
use drystone::{Body, BodyHandle, Cpu, Groups, Shape, Simulation, SolverConfig, World};
use rayon::prelude::*;

use crate::common::sample::is_full;

const EDGES: usize = 1000;
/// From one edge to the next (m).
const PITCH: f32 = 0.1;
const GRAVITY: f32 = 9.81;
const DT: f32 = 1.0 / 60.0;
/// Radius, or half of a side, of what travels (m).
const SIZE: f32 = 0.2;
/// Half of the width of a floor, which an edge along the way parts (m).
const HALF_WIDTH: f32 = 2.0;

/// Floors of 100 m along x whose upper side is at 0.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Floor {
    Mesh,
    HeightField,
    /// A fixed body for each box.
    Boxes,
    /// One fixed body of all boxes.
    Parts,
    /// A body for each mesh of two triangles.
    Tiles,
    /// A mesh of the surface of blocks.
    Voxels,
    /// A body for each height field of one cell.
    Fields,
    /// Meshes of two triangles, height fields and boxes in turn.
    Mixed,
    /// One mesh without common vertices across the edge along the way: the edges of each side end within those of the
    /// other.
    Junctions,
    /// Meshes of two triangles that lie on a half-space.
    Carpet,
}

/// A square of a floor of tiles, and its position.
type Tile = (Shape, Vec3);

/// A mesh of two triangles from `at`, along x and z.
fn mesh_tile(at: Vec3) -> Tile {
    let half = 0.5 * HALF_WIDTH;
    let corners = [(0.0, -half), (0.0, half), (PITCH, half), (PITCH, -half)].map(|(x, z)| Vec3::new(x, 0.0, z));
    (Shape::mesh(corners.into(), vec![[0, 1, 2], [0, 2, 3]]).expect("a mesh"), at)
}

fn field_tile(at: Vec3) -> Tile {
    let scale = Vec3::new(PITCH, 1.0, HALF_WIDTH);
    (Shape::height_field(&vec![vec![0.0; 2]; 2], scale).expect("a field"), at + 0.5 * PITCH * Vec3::X)
}

fn box_tile(at: Vec3) -> Tile {
    (Shape::cuboid(0.5 * PITCH, 0.5, 0.5 * HALF_WIDTH), at + 0.5 * Vec3::new(PITCH, -1.0, 0.0))
}

impl Floor {
    fn build(self) -> World {
        let mut world = World::new();
        let length = EDGES as f32 * PITCH;
        let edge = |k: usize| k as f32 * PITCH - 0.5 * length;
        let lanes = [-0.5 * HALF_WIDTH, 0.5 * HALF_WIDTH];
        let brick = || Shape::cuboid(0.5 * PITCH, 0.5, 0.5 * HALF_WIDTH);
        let middle = |k: usize, z: f32| Vec3::new(edge(k) + 0.5 * PITCH, -0.5, z);
        let lay = |world: &mut World, tile: &dyn Fn(usize) -> fn(Vec3) -> Tile| {
            for (k, z) in (0..EDGES).flat_map(|k| lanes.map(|z| (k, z))) {
                let (shape, at) = tile(k)(Vec3::new(edge(k), 0.0, z));
                world.insert(Body::fixed().shape(shape).position(at.x, at.y, at.z).friction(1.0));
            }
        };
        match self {
            Self::Fields => lay(&mut world, &|_| field_tile),
            Self::Mixed => {
                lay(&mut world, &|k| [mesh_tile, box_tile, field_tile, mesh_tile, field_tile, box_tile][k % 6])
            }
            Self::Carpet => {
                world.insert(Body::fixed().shape(Shape::half_space(Vec3::Y)).friction(1.0));
                lay(&mut world, &|_| mesh_tile);
            }
            Self::Junctions => {
                let side = |from: f32, to: f32, offset: f32| {
                    let line = move |k: usize| [from, to].map(|z| Vec3::new(edge(k) + offset, 0.0, z));
                    (0..=EDGES).flat_map(line)
                };
                let vertices = side(-HALF_WIDTH, 0.0, 0.0).chain(side(0.0, HALF_WIDTH, 0.3 * PITCH)).collect();
                let cell = |first: usize, k: usize| {
                    let a = (first + 2 * k) as u32;
                    [[a, a + 1, a + 3], [a, a + 3, a + 2]]
                };
                let cells = (0..EDGES).flat_map(|k| [cell(0, k), cell(2 * (EDGES + 1), k)].concat());
                let mesh = Shape::mesh(vertices, cells.collect()).expect("a mesh");
                world.insert(Body::fixed().shape(mesh).friction(1.0));
            }
            Self::Mesh => {
                let line = |k: usize| [-HALF_WIDTH, 0.0, HALF_WIDTH].map(|z| Vec3::new(edge(k), 0.0, z));
                let vertices = (0..=EDGES).flat_map(line).collect();
                let cell = |k: usize, lane: usize| {
                    let [a, b] = [(3 * k + lane) as u32, (3 * (k + 1) + lane) as u32];
                    if k.is_multiple_of(3) {
                        [[a, a + 1, b], [b, a + 1, b + 1]]
                    } else {
                        [[a, a + 1, b + 1], [a, b + 1, b]]
                    }
                };
                let triangles = (0..EDGES).flat_map(|k| [cell(k, 0), cell(k, 1)].concat()).collect();
                let mesh = Shape::mesh(vertices, triangles).expect("a mesh");
                world.insert(Body::fixed().shape(mesh).friction(1.0));
            }
            Self::HeightField => {
                let heights = vec![vec![0.0; EDGES + 1]; 3];
                let field = Shape::height_field(&heights, Vec3::new(length, 1.0, 2.0 * HALF_WIDTH)).expect("a field");
                world.insert(Body::fixed().shape(field).friction(1.0));
            }
            Self::Boxes => {
                for (k, z) in (0..EDGES).flat_map(|k| lanes.map(|z| (k, z))) {
                    let Vec3 { x, y, z } = middle(k, z);
                    world.insert(Body::fixed().shape(brick()).position(x, y, z).friction(1.0));
                }
            }
            Self::Parts => {
                let all = (0..EDGES).flat_map(|k| lanes.map(|z| middle(k, z)));
                let body = all.fold(Body::fixed(), |body, at| body.shape_at(brick(), at, Quat::IDENTITY));
                world.insert(body.friction(1.0));
            }
            Self::Voxels => {
                let half = EDGES as i32 / 2;
                let cells: Vec<IVec3> = (-half..half).flat_map(|x| [-1, 0].map(|z| IVec3::new(x, -1, z))).collect();
                let blocks = Shape::voxels(Vec3::new(PITCH, 1.0, HALF_WIDTH), &cells).expect("a mesh");
                world.insert(Body::fixed().shape(blocks).friction(1.0));
            }
            Self::Tiles => {
                for (k, z) in (0..EDGES).flat_map(|k| lanes.map(|z| (k, z))) {
                    let [near, far] = [z - 0.5 * HALF_WIDTH, z + 0.5 * HALF_WIDTH];
                    let corner = |x: f32, z: f32| Vec3::new(x, 0.0, z);
                    let corners = vec![corner(0.0, near), corner(0.0, far), corner(PITCH, far), corner(PITCH, near)];
                    let tile = Shape::mesh(corners, vec![[0, 1, 2], [0, 2, 3]]).expect("a mesh");
                    world.insert(Body::fixed().shape(tile).position(edge(k), 0.0, 0.0).friction(1.0));
                }
            }
        }
        world
    }
}

/// A body that travels along x.
struct Traveler {
    name: &'static str,
    shape: Shape,
    rotation: Quat,
    height: f32,
    /// Rolls without slip; others slide.
    rolls: bool,
}

fn travelers() -> Vec<Traveler> {
    let across = Quat::from_rotation_x(FRAC_PI_2);
    let along = Quat::from_rotation_z(FRAC_PI_2);
    let yawed = Quat::from_rotation_y(0.3);
    let ball = Shape::ball(SIZE);
    let cylinder = Shape::cylinder(SIZE, SIZE);
    let capsule = Shape::capsule(SIZE, SIZE);
    let of =
        |name, shape: &Shape, rotation, rolls| Traveler { name, shape: shape.clone(), rotation, height: SIZE, rolls };
    let cuboid = Shape::cuboid(SIZE, SIZE, SIZE);
    vec![
        of("box", &cuboid, Quat::IDENTITY, false),
        of("box askew", &cuboid, yawed, false),
        of("ball", &ball, Quat::IDENTITY, true),
        of("cylinder", &cylinder, across, true),
        of("cylinder askew", &cylinder, Quat::IDENTITY, false),
        of("capsule", &capsule, across, true),
        of("capsule along", &capsule, along, false),
    ]
}

/// The result of a journey over all edges.
#[derive(Clone, Copy, Debug)]
struct Journey {
    /// Difference from the speed that friction leaves, over the speed at first.
    lost: f32,
    /// The highest place above the floor, after the first tenth of a second (m).
    hop: f32,
}

/// A journey of a traveler at some speed (m/s), with friction or without, and the place beside the edge along the way (m).
#[derive(Clone, Copy)]
struct Case<'a> {
    traveler: &'a Traveler,
    speed: f32,
    friction: bool,
    z: f32,
}

/// How far each journey goes (m).
const WAY: f32 = EDGES as f32 * PITCH - 4.0;

impl Case<'_> {
    /// What slides with friction loses a fifth of its speed.
    fn deceleration(&self) -> f32 {
        if self.friction && !self.traveler.rolls { 0.18 * self.speed * self.speed / WAY } else { 0.0 }
    }

    fn steps(&self) -> usize {
        let mean = if self.deceleration() > 0.0 { 0.9 * self.speed } else { self.speed };
        let all = (0.98 * WAY / mean / DT) as usize;
        // The first ten seconds: a tenth of the way at 1 m/s, half of it at 5 m/s.
        if is_full() { all } else { all.min(600) }
    }

    /// Meets the floor, and no other traveler.
    fn body(&self) -> Body {
        let Self { traveler, speed, friction, z } = *self;
        let mu = if friction && traveler.rolls { 0.5 } else { self.deceleration() / GRAVITY };
        let spin = if traveler.rolls && friction { -speed / SIZE } else { 0.0 };
        Body::dynamic()
            .density(1000.0)
            .shape(traveler.shape.clone())
            .position(-0.5 * WAY, traveler.height, z)
            .rotation(traveler.rotation)
            .velocity(speed * Vec3::X, spin * Vec3::Z)
            .friction(mu * mu)
            .groups(Groups { membership: 2, filter: 1 })
    }
}

/// Lets all travel over one floor at once.
fn travel(floor: Floor, cases: &[Case]) -> Vec<Journey> {
    let mut world = floor.build();
    let bodies: Vec<BodyHandle> = cases.iter().map(|case| world.insert(case.body())).collect();
    let config = SolverConfig::default().without_sleep();
    let mut simulation = Simulation::with(world, config, Box::new(Cpu::new())).expect("a simulation");
    let mut journeys = vec![Journey { lost: f32::NAN, hop: 0.0 }; cases.len()];
    for step in 1..=cases.iter().map(Case::steps).max().unwrap_or(0) {
        simulation.step(DT).expect("a step");
        for ((case, &body), journey) in cases.iter().zip(&bodies).zip(&mut journeys) {
            let body = &simulation.world.bodies[body];
            if step > 7 && step <= case.steps() {
                journey.hop = journey.hop.max(body.position.y - case.traveler.height);
            }
            if step == case.steps() {
                let expected = case.speed - case.deceleration() * DT * step as f32;
                journey.lost = (expected - body.linear_velocity.x) / case.speed;
            }
        }
    }
    journeys
}

/// Travelers on a floor, at speeds from 1 to 20 m/s, beside and above the edge along the way.
#[track_caller]
fn assert_edges_cost_nothing(floor: Floor) {
    let all = travelers();
    let mut broken = Vec::new();
    for speed in [1.0, 5.0, 20.0] {
        let both = all.iter().flat_map(|traveler| [false, true].map(|friction| (traveler, friction)));
        let cases = both.flat_map(|(traveler, friction)| [0.0, 0.37].map(|z| Case { traveler, speed, friction, z }));
        // A slow journey is long, and single precision rounds the small impulses of friction that go with it by some percent.
        let is_exact = |case: &Case| match (case.friction, case.traveler.rolls) {
            (false, _) => speed > 1.0 || case.z > 0.0,
            (true, true) => speed > 1.0,
            (true, false) => speed > 10.0,
        };
        let cases: Vec<Case> = cases.filter(is_exact).collect();
        for (case, journey) in cases.iter().zip(travel(floor, &cases)) {
            if !(journey.lost.abs() <= 1e-3 && journey.hop <= 5e-4 * SIZE) {
                let Case { traveler, friction, z, .. } = case;
                broken.push(format!("{} at {speed} m/s, friction {friction}, z {z}: {journey:?}\n", traveler.name));
            }
        }
    }
    assert!(broken.is_empty(), "{} on {floor:?}:\n{}", broken.len(), broken.concat());
}

#[test]
fn edges_of_a_mesh_cost_nothing() {
    assert_edges_cost_nothing(Floor::Mesh);
}

#[test]
fn edges_of_a_height_field_cost_nothing() {
    assert_edges_cost_nothing(Floor::HeightField);
}

#[test]
fn edges_of_boxes_in_a_row_cost_nothing() {
    assert_edges_cost_nothing(Floor::Boxes);
}

#[test]
fn edges_of_the_parts_of_a_body_cost_nothing() {
    assert_edges_cost_nothing(Floor::Parts);
}

#[test]
fn edges_between_meshes_cost_nothing() {
    assert_edges_cost_nothing(Floor::Tiles);
}

#[test]
fn the_edges_of_voxels_cost_nothing() {
    assert_edges_cost_nothing(Floor::Voxels);
}

#[test]
fn edges_between_height_fields_cost_nothing() {
    assert_edges_cost_nothing(Floor::Fields);
}

#[test]
fn edges_between_meshes_fields_and_boxes_cost_nothing() {
    assert_edges_cost_nothing(Floor::Mixed);
}

#[test]
fn edges_that_end_within_others_cost_nothing() {
    assert_edges_cost_nothing(Floor::Junctions);
}

#[test]
fn edges_of_meshes_on_a_half_space_cost_nothing() {
    assert_edges_cost_nothing(Floor::Carpet);
}

/// A journey over square tiles, boxes, meshes and height fields in some order, on a floor that lies anywhere in space.
/// Returns a line about a journey that lost speed, hopped or sank in.
fn crossing(seed: u64) -> Option<String> {
    let mut random = SplitMix64::new(seed);
    let mut between = |low: f32, high: f32| low + (high - low) * (0.5 * random.symmetric() as f32 + 0.5);
    let order: [usize; 4] = [0; 4].map(|_| between(0.0, 2.999) as usize);
    let half = 0.5 * between(0.1, 0.6);
    let speed = [1.0, 5.0, 20.0][between(0.0, 2.999) as usize];
    let heading = Quat::from_rotation_y(if between(0.0, 1.0) < 0.3 { 0.0 } else { between(-PI, PI) });
    let [x, y, z] = [0.0; 3].map(|_| between(-PI, PI));
    let turned = Quat::from_rotation_x(x) * Quat::from_rotation_y(y) * Quat::from_rotation_z(z);
    let floor = if between(0.0, 1.0) < 0.6 { turned } else { Quat::IDENTITY };
    let far = [0.0; 3].map(|_| between(-100.0, 100.0));
    let origin = if between(0.0, 1.0) < 0.4 { Vec3::from(far) } else { Vec3::ZERO };
    let friction = between(0.0, 1.0) < 0.5;
    let traveler = &travelers()[between(0.0, 6.999) as usize];
    let steps = 40;
    let way = speed * steps as f32 * DT;

    let mut world = World { gravity: floor * (-GRAVITY * Vec3::Y), ..World::new() };
    let along = heading * Vec3::X;
    let count = ((way + 2.0) / (2.0 * half)) as i32;
    for (i, j) in (-count..=count).flat_map(|i| (-count..=count).map(move |j| (i, j))) {
        let middle = 2.0 * half * Vec3::new(i as f32 + 0.5, 0.0, j as f32 + 0.5);
        if middle.distance(middle.dot(along).clamp(-1.0, way + 1.0) * along) > 3.0 * SIZE + 2.0 * half {
            continue;
        }
        let corners = [(-half, -half), (-half, half), (half, half), (half, -half)].map(|(x, z)| Vec3::new(x, 0.0, z));
        let (shape, at) = match order[(i + 2 * j).rem_euclid(4) as usize] {
            0 => (Shape::cuboid(half, 0.5, half), middle - 0.5 * Vec3::Y),
            1 => (Shape::mesh(corners.into(), vec![[0, 1, 2], [0, 2, 3]]).expect("a mesh"), middle),
            _ => {
                let scale = Vec3::new(2.0 * half, 1.0, 2.0 * half);
                (Shape::height_field(&vec![vec![0.0; 2]; 2], scale).expect("a field"), middle)
            }
        };
        let Vec3 { x, y, z } = origin + floor * at;
        world.insert(Body::fixed().shape(shape).position(x, y, z).rotation(floor).friction(1.0));
    }
    let rolls = traveler.rolls && friction;
    let mu = [0.0, if rolls { 0.5 } else { 0.1 }][usize::from(friction)];
    let turn = floor * heading;
    let Vec3 { x, y, z } = origin + floor * (SIZE * Vec3::Y);
    let spin = if rolls { -speed / SIZE } else { 0.0 };
    let body = Body::dynamic().density(1000.0).shape(traveler.shape.clone()).rotation(turn * traveler.rotation);
    let body = body.position(x, y, z).velocity(turn * (speed * Vec3::X), turn * (spin * Vec3::Z));
    let body = world.insert(body.friction(mu * mu));
    let mut simulation =
        Simulation::with(world, SolverConfig::default().without_sleep(), Box::new(Cpu::new())).expect("a simulation");
    let (mut hop, mut depth, mut now, mut step) = (0.0_f32, 0.0_f32, speed, 0);
    while step < steps && now > 0.3 * speed {
        simulation.step(DT).expect("a step");
        step += 1;
        let body = &simulation.world.bodies[body];
        now = body.linear_velocity.dot(turn * Vec3::X);
        if step > 7 {
            let above = (body.position - origin).dot(floor * Vec3::Y) - SIZE;
            (hop, depth) = (hop.max(above), depth.max(-above));
        }
    }
    let slowed = if friction && !rolls { mu * GRAVITY * DT * step as f32 } else { 0.0 };
    let lost = (speed - slowed - now) / speed;
    // Positions far away round by more.
    let rounding = 2e-6 * origin.length();
    let is_good = lost.abs() <= if friction { 3e-3 } else { 1e-3 }
        && hop <= 5e-4 * SIZE + rounding
        && depth <= 5e-3 * SIZE + rounding;
    let name = traveler.name;
    (!is_good).then(|| {
        format!("{seed}: {name} at {speed} m/s on {order:?} of {half} m: lost {lost}, hop {hop} m, depth {depth} m\n")
    })
}

#[test]
fn edges_of_floors_anywhere_cost_nothing() {
    let count = if is_full() { 3000 } else { 150 };
    let broken: Vec<String> = (0..count).into_par_iter().filter_map(crossing).collect();
    assert!(broken.is_empty(), "{} of {count}:\n{}", broken.len(), broken.concat());
}

/// Plates of 4 m at y = 0 that end at x = 0, where nothing goes on.
fn plates() -> [(&'static str, Vec<Tile>); 4] {
    let corner = |x: f32, z: f32| Vec3::new(x, 0.0, z);
    let plate = |from: f32, to: f32| {
        let corners = vec![corner(-4.0, from), corner(-4.0, to), corner(0.0, to), corner(0.0, from)];
        (Shape::mesh(corners, vec![[0, 1, 2], [0, 2, 3]]).expect("a mesh"), Vec3::ZERO)
    };
    let field = Shape::height_field(&vec![vec![0.0; 9]; 9], Vec3::new(4.0, 1.0, 4.0)).expect("a field");
    let fine = field.triangles();
    let fine = Shape::mesh(fine.0, fine.1).expect("a mesh");
    [
        ("mesh", vec![plate(-2.0, 2.0)]),
        ("fine mesh", vec![(fine, -2.0 * Vec3::X)]),
        ("two meshes", vec![plate(-2.0, 0.0), plate(0.0, 2.0)]),
        ("height field", vec![(field, -2.0 * Vec3::X)]),
    ]
}

/// Depth of a point in a shape, in the frame of the shape (m).
fn depth(shape: &Shape, p: Vec3) -> f32 {
    let parry = shape.parry();
    if let Some(half) = shape.as_cuboid() {
        return (half - p.abs()).min_element();
    }
    let across = (p.x * p.x + p.z * p.z).sqrt();
    if let Some(radius) = shape.as_ball() {
        radius - p.length()
    } else if let Some(capsule) = parry.as_capsule() {
        let end = capsule.half_height();
        capsule.radius - (p - p.y.clamp(-end, end) * Vec3::Y).length()
    } else if let Some(cylinder) = parry.as_cylinder() {
        (cylinder.radius - across).min(cylinder.half_height - p.y.abs())
    } else {
        panic!("{shape:?} has no depth")
    }
}

/// The deepest place of the edge at x = 0 in a body while the middle of the body is above the plates (m), and where the
/// middle is as it falls below.
fn deepest_at_rim(tiles: &[Tile], body: Body, shape: &Shape) -> (f32, Vec3) {
    let mut world = World::new();
    for (tile, at) in tiles {
        world.insert(Body::fixed().shape(tile.clone()).position(at.x, at.y, at.z).friction(0.5));
    }
    let body = world.insert(body.shape(shape.clone()).density(1000.0).friction(0.5));
    let config = SolverConfig::default().without_sleep();
    let mut simulation = Simulation::with(world, config, Box::new(Cpu::new())).expect("a simulation");
    let mut deepest = f32::NEG_INFINITY;
    for _ in 0..1200 {
        simulation.step(DT).expect("a step");
        let body = &simulation.world.bodies[body];
        if body.position.y < 0.0 {
            return (deepest, body.position);
        }
        for k in -200..=200 {
            let p = body.rotation.inverse() * (Vec3::new(0.0, 0.0, 0.01 * k as f32) - body.position);
            deepest = deepest.max(depth(shape, p));
        }
    }
    (deepest, simulation.world.bodies[body].position)
}

/// Bodies that roll or tip over the end of a plate follow it.
#[test]
fn the_rim_of_a_plate_is_as_hard_as_its_face() {
    let across = Quat::from_rotation_x(FRAC_PI_2);
    let along = Quat::from_rotation_z(FRAC_PI_2);
    let on_edge = Quat::from_rotation_z(0.25 * PI);
    let cuboid = Shape::cuboid(SIZE, SIZE, SIZE);
    let cases = [
        ("ball", Shape::ball(SIZE), Quat::IDENTITY, Vec3::new(-0.3, SIZE, 0.0), 0.5),
        ("ball beside", Shape::ball(SIZE), Quat::IDENTITY, Vec3::new(-0.3, SIZE, 0.37), 0.5),
        ("big ball", Shape::ball(1.0), Quat::IDENTITY, Vec3::new(-0.3, 1.0, 0.1), 0.5),
        ("capsule", Shape::capsule(SIZE, SIZE), across, Vec3::new(-0.3, SIZE, 0.0), 0.5),
        ("capsule along", Shape::capsule(2.0 * SIZE, SIZE), along, Vec3::new(0.2, SIZE, 0.0), 0.0),
        ("cylinder", Shape::cylinder(SIZE, SIZE), across, Vec3::new(-0.3, SIZE, 0.0), 0.5),
        ("box", cuboid.clone(), Quat::IDENTITY, Vec3::new(0.02, SIZE, 0.0), 0.0),
        ("box askew", cuboid.clone(), Quat::from_rotation_y(0.3), Vec3::new(0.02, SIZE, 0.0), 0.0),
        ("box on edge", cuboid, on_edge, Vec3::new(0.2, 0.2, 0.0), 0.0),
    ];
    let mut broken = Vec::new();
    for (plate, tiles) in plates() {
        for (name, shape, rotation, at, speed) in &cases {
            let spin = if shape.as_cuboid().is_some() { 0.0 } else { -speed / shape.smallest_half_extent() };
            let body = Body::dynamic().position(at.x, at.y, at.z).rotation(*rotation);
            let (deepest, end) = deepest_at_rim(&tiles, body.velocity(*speed * Vec3::X, spin * Vec3::Z), shape);
            let most = if shape.is_ball() { 1e-3 } else { 2e-3 };
            if !(deepest <= most && end.y < 0.0) {
                broken.push(format!("{name} on {plate}: {deepest} m deep, to {end}\n"));
            }
        }
    }
    assert!(broken.is_empty(), "{}:\n{}", broken.len(), broken.concat());
}

/// A ball whose middle is beyond the rim, or beyond a corner, is thrown aside.
#[test]
fn a_ball_does_not_fall_through_the_rim_of_a_plate() {
    let ball = Shape::ball(1.0);
    let mut broken = Vec::new();
    for (plate, tiles) in plates() {
        for at in
            [Vec3::new(0.3, 1.5, 0.0), Vec3::new(0.3, 1.5, 0.7), Vec3::new(0.2, 1.5, 2.2), Vec3::new(0.2, 1.5, -2.2)]
        {
            let (deepest, end) = deepest_at_rim(&tiles, Body::dynamic().position(at.x, at.y, at.z), &ball);
            let aside = Vec3::new(end.x.max(0.0), end.y, (end.z.abs() - 2.0).max(0.0)).length();
            if !(deepest <= 1e-2 && end.y < 0.0 && aside >= 0.99) {
                broken.push(format!("from {at} on {plate}: {deepest} m deep, to {end}\n"));
            }
        }
    }
    assert!(broken.is_empty(), "{}:\n{}", broken.len(), broken.concat());
}

/// Edges that are not flush still stop bodies: a wall on the floor, a step, and the end of a row.
#[test]
fn a_wall_a_step_and_the_end_of_a_row_are_as_they_were() {
    let end = |build: fn(&mut World), shape: &Shape, speed: f32| {
        let mut world = World::new();
        for x in [-1.5, -0.5, 0.5, 1.5] {
            world.insert(Body::fixed().shape(Shape::cuboid(0.5, 0.5, 2.0)).position(x, -0.5, 0.0).friction(0.0));
        }
        build(&mut world);
        let body = Body::dynamic().shape(shape.clone()).position(-1.0, SIZE, 0.0).velocity(speed * Vec3::X, Vec3::ZERO);
        let body = world.insert(body.friction(0.0));
        let config = SolverConfig::default().without_sleep();
        let mut simulation = Simulation::with(world, config, Box::new(Cpu::new())).expect("a simulation");
        for _ in 0..90 {
            simulation.step(1.0 / 60.0).expect("a step");
        }
        simulation.world.bodies[body].position
    };
    let wall = |world: &mut World| {
        world.insert(Body::fixed().shape(Shape::cuboid(0.5, 1.0, 2.0)).position(1.5, 1.0, 0.0));
    };
    let step = |world: &mut World| {
        world.insert(Body::fixed().shape(Shape::cuboid(0.5, 0.05, 2.0)).position(1.5, 0.05, 0.0));
    };
    for shape in [Shape::cuboid(SIZE, SIZE, SIZE), Shape::ball(SIZE), Shape::cylinder(SIZE, SIZE)] {
        for (build, most) in [(wall as fn(&mut World), 1.0 - SIZE), (step, 1.0)] {
            let at = end(build, &shape, 2.0);
            assert!(at.x < most + 2e-3 && (at.y - SIZE).abs() < 2e-3, "{shape:?} stops at {at}");
        }
        let at = end(|_| (), &shape, 4.0);
        assert!(at.x > 3.0 && at.y < -1.0, "{shape:?} falls off the end: {at}");
    }
}

/// The normals of a ridge lie between those of its two faces. A ball on the ridge between a box and a mesh that slopes
/// down from it presses along the line from the ridge to its center on both, and beside the ridge along the normal of
/// the face that it lies on.
#[test]
fn a_ridge_between_a_box_and_a_mesh_keeps_its_normals() {
    let on_ridge = |degrees: f32| (Vec3::ZERO, Quat::from_rotation_z(-degrees.to_radians()) * Vec3::Y);
    let slope = Vec3::new(1.0, 1.0, 0.0).normalize();
    let on_slope = (0.015 * Vec3::new(slope.x, -slope.y, 0.0), slope);
    for (foot, away) in [on_ridge(10.0), on_ridge(22.5), on_ridge(35.0), on_slope, (-0.015 * Vec3::X, Vec3::Y)] {
        let mut world = World { gravity: Vec3::ZERO, ..World::new() };
        world.insert(Body::fixed().shape(Shape::cuboid(1.0, 0.5, 1.0)).position(-1.0, -0.5, 0.0));
        let corners = [(0.0, -1.0), (0.0, 1.0), (2.0, 1.0), (2.0, -1.0)].map(|(x, z)| Vec3::new(x, -x, z));
        let slope = Shape::mesh(corners.into(), vec![[0, 1, 2], [0, 2, 3]]).expect("a mesh");
        world.insert(Body::fixed().shape(slope));
        let center = foot + 0.199 * away;
        world.insert(Body::dynamic().shape(Shape::ball(0.2)).position(center.x, center.y, 0.0));
        let mut simulation = Simulation::new(world).expect("a simulation");
        simulation.step(DT).expect("a step");
        let normals: Vec<Vec3> = simulation.contacts().map(|contact| contact.normal).collect();
        assert!(!normals.is_empty() && normals.iter().all(|n| n.distance(away) < 1e-3), "{away}: {normals:?}");
    }
}

/// A thin plate comes down flat onto one peak of a mesh and of a height field, and touches it there. Before: no triangle had the normal of its
/// peak, so the plate met no contact.
#[test]
fn a_plate_rests_on_the_peak_of_a_surface() {
    let around = |i: u32| Vec3::new(0.1 * (0.25 * PI * i as f32).cos(), -1.0, 0.1 * (0.25 * PI * i as f32).sin());
    let points = [Vec3::ZERO].into_iter().chain((0..8).map(around)).collect();
    let needle = Shape::mesh(points, (0..8).map(|i| [0, (i + 1) % 8 + 1, i + 1]).collect()).expect("a mesh");
    let heights: Vec<Vec<f32>> =
        (0..3).map(|i| (0..3).map(|j| if (i, j) == (1, 1) { 0.0 } else { -1.0 }).collect()).collect();
    let hill = Shape::height_field(&heights, Vec3::new(0.5, 1.0, 0.5)).expect("a field");
    for surface in [needle, hill] {
        for gap in [0.002, -0.002] {
            let mut world = World::new();
            world.insert(Body::fixed().shape(surface.clone()));
            let plate = Body::dynamic().shape(Shape::cuboid(0.3, 0.01, 0.3)).position(0.0, 0.01 + gap, 0.0);
            let plate = world.insert(plate);
            let mut simulation =
                Simulation::with(world, SolverConfig::default(), Box::new(Cpu::new())).expect("a good world");
            for _ in 0..60 {
                simulation.step(DT).expect("a step");
            }
            let y = simulation.world.bodies[plate].position.y;
            assert!((y - 0.01).abs() < 1e-3, "from a gap of {gap} m at {y} m");
        }
    }
}
