//! Edges between faces that lie flush cost nothing: what slides or rolls over a thousand of them goes as on one face.

use std::f32::consts::FRAC_PI_2;

use drystone::glam::{Quat, Vec3};
use drystone::{Body, Cpu, Shape, Simulation, SolverConfig, World};

use rayon::prelude::*;

const EDGES: usize = 1000;
/// From one edge to the next (m).
const PITCH: f32 = 0.1;
const GRAVITY: f32 = 9.81;
/// Radius, or half of a side, of what travels (m).
const SIZE: f32 = 0.2;
/// Half of the width of a floor, which an edge along the way parts (m).
const HALF_WIDTH: f32 = 2.0;

/// Floors of 100 m along x whose upper side is at 0.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Floor {
    /// One box.
    Whole,
    Mesh,
    HeightField,
    /// A fixed body for each box.
    Boxes,
    /// One fixed body of all boxes.
    Parts,
    /// A body for each mesh of two triangles.
    Tiles,
}

impl Floor {
    fn build(self) -> World {
        let mut world = World::new();
        let length = EDGES as f32 * PITCH;
        let edge = |k: usize| k as f32 * PITCH - 0.5 * length;
        let lanes = [-0.5 * HALF_WIDTH, 0.5 * HALF_WIDTH];
        let brick = || Shape::cuboid(0.5 * PITCH, 0.5, 0.5 * HALF_WIDTH);
        let middle = |k: usize, z: f32| Vec3::new(edge(k) + 0.5 * PITCH, -0.5, z);
        match self {
            Self::Whole => {
                let shape = Shape::cuboid(0.5 * length, 0.5, HALF_WIDTH);
                world.add(Body::fixed().shape(shape).position(0.0, -0.5, 0.0).friction(1.0));
            }
            Self::Mesh => {
                let line = |k: usize| [-HALF_WIDTH, 0.0, HALF_WIDTH].map(|z| Vec3::new(edge(k), 0.0, z));
                let vertices = (0..=EDGES).flat_map(line).collect();
                let cell = |k: usize, lane: usize| {
                    let [a, b] = [(3 * k + lane) as u32, (3 * (k + 1) + lane) as u32];
                    if k % 3 == 0 { [[a, a + 1, b], [b, a + 1, b + 1]] } else { [[a, a + 1, b + 1], [a, b + 1, b]] }
                };
                let triangles = (0..EDGES).flat_map(|k| [cell(k, 0), cell(k, 1)].concat()).collect();
                let mesh = Shape::mesh(vertices, triangles).expect("a mesh");
                world.add(Body::fixed().shape(mesh).friction(1.0));
            }
            Self::HeightField => {
                let heights = vec![vec![0.0; EDGES + 1]; 3];
                let field = Shape::height_field(&heights, Vec3::new(length, 1.0, 2.0 * HALF_WIDTH)).expect("a field");
                world.add(Body::fixed().shape(field).friction(1.0));
            }
            Self::Boxes => {
                for (k, z) in (0..EDGES).flat_map(|k| lanes.map(|z| (k, z))) {
                    let Vec3 { x, y, z } = middle(k, z);
                    world.add(Body::fixed().shape(brick()).position(x, y, z).friction(1.0));
                }
            }
            Self::Parts => {
                let all = (0..EDGES).flat_map(|k| lanes.map(|z| middle(k, z)));
                let body = all.fold(Body::fixed(), |body, at| body.shape_at(brick(), at, Quat::IDENTITY));
                world.add(body.friction(1.0));
            }
            Self::Tiles => {
                for (k, z) in (0..EDGES).flat_map(|k| lanes.map(|z| (k, z))) {
                    let [near, far] = [z - 0.5 * HALF_WIDTH, z + 0.5 * HALF_WIDTH];
                    let corner = |x: f32, z: f32| Vec3::new(x, 0.0, z);
                    let corners = vec![corner(0.0, near), corner(0.0, far), corner(PITCH, far), corner(PITCH, near)];
                    let tile = Shape::mesh(corners, vec![[0, 1, 2], [0, 2, 3]]).expect("a mesh");
                    world.add(Body::fixed().shape(tile).position(edge(k), 0.0, 0.0).friction(1.0));
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

/// What a journey over all edges comes to.
#[derive(Clone, Copy, Debug)]
struct Journey {
    /// Difference from the speed that friction leaves, over the speed at first.
    lost: f32,
    /// Highest place above the floor (m), and fastest way up or down (m/s), of all after the first tenth of a second.
    hop: f32,
    fastest: f32,
    aside: f32,
}

fn travel(floor: Floor, traveler: &Traveler, speed: f32, friction: bool, z: f32) -> Journey {
    let mut world = floor.build();
    let way = EDGES as f32 * PITCH - 4.0;
    // What slides loses a fifth of its speed.
    let deceleration = if friction && !traveler.rolls { 0.18 * speed * speed / way } else { 0.0 };
    let mu = if friction && traveler.rolls { 0.5 } else { deceleration / GRAVITY };
    let spin = if traveler.rolls && friction { -speed / SIZE } else { 0.0 };
    let body = Body::dynamic()
        .density(1000.0)
        .shape(traveler.shape.clone())
        .position(-0.5 * way, traveler.height, z)
        .rotation(traveler.rotation)
        .velocity(speed * Vec3::X, spin * Vec3::Z)
        .friction(mu * mu);
    let index = world.add(body);
    let config = SolverConfig::default().without_sleep();
    let mut simulation = Simulation::new(world, config, Box::new(Cpu::new())).expect("a simulation");
    let dt = 1.0 / 60.0;
    let mean = if deceleration > 0.0 { 0.9 * speed } else { speed };
    let steps = (0.98 * way / mean / dt) as usize;
    let (mut hop, mut fastest, mut worst_aside) = (0.0_f32, 0.0_f32, 0.0_f32);
    for step in 0..steps {
        simulation.step(dt).expect("a step");
        let body = &simulation.world.bodies[index];
        if step > 6 {
            hop = hop.max(body.position.y - traveler.height);
            fastest = fastest.max(body.linear_velocity.y.abs());
        }
        worst_aside = worst_aside.max((body.position.z - z).abs());
    }
    let expected = speed - deceleration * dt * steps as f32;
    let left = simulation.world.bodies[index].linear_velocity.x;
    Journey { lost: (expected - left) / speed, hop, fastest, aside: worst_aside }
}

#[test]
fn measure() {
    let floors = [Floor::Whole, Floor::Mesh, Floor::HeightField, Floor::Boxes, Floor::Parts, Floor::Tiles];
    for floor in floors {
        let cases: Vec<_> = (0..travelers().len())
            .flat_map(|i| [1.0, 2.0, 5.0, 10.0, 20.0].map(|v| (i, v)))
            .flat_map(|(i, v)| [false, true].map(|f| (i, v, f)))
            .flat_map(|(i, v, f)| [0.0, 0.37].map(|z| (i, v, f, z)))
            .collect();
        let results: Vec<_> = cases.par_iter().map(|&(i, v, f, z)| travel(floor, &travelers()[i], v, f, z)).collect();
        for (&(i, v, f, z), j) in cases.iter().zip(&results) {
            let bad = if j.lost.abs() > 1e-3 || j.hop > 1e-4 { "  <--" } else { "" };
            println!(
                "{floor:?} {} v {v} friction {f} z {z}: lost {:.5} hop {:.3} mm {:.4} m/s aside {:.3} mm{bad}",
                travelers()[i].name,
                j.lost,
                j.hop * 1e3,
                j.fastest,
                j.aside * 1e3
            );
        }
    }
}
