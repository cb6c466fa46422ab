//! All shapes on all floors, and piles of them.

use drystone::glam::{Quat, Vec3};
use drystone::{Body, Shape, SolverConfig, World};

use super::Golden;

pub fn all() -> Vec<Golden> {
    let on = |name, floor: fn() -> Body| Golden::new(name, 120, move || (shapes_on(floor()), SolverConfig::default()));
    vec![
        on("shapes-on-half-space", || Body::fixed().shape(Shape::half_space(Vec3::Y))),
        on("shapes-on-cuboid", || Body::fixed().shape(Shape::cuboid(12.0, 0.5, 3.0)).position(0.0, -0.5, 0.0)),
        on("shapes-on-mesh", || Body::fixed().shape(mesh())),
        on("shapes-on-height-field", || Body::fixed().shape(height_field())),
        on("shapes-on-hull", || Body::fixed().shape(slab()).position(0.0, -0.5, 0.0)),
        on("shapes-on-compound", staves),
        Golden::new("shapes-on-shapes", 150, || (heap(), SolverConfig::default())),
        Golden::of_catalogue("pile", "pile:n=60", 150),
        Golden::of_catalogue("pile-mixed", "pile-mixed:n=40", 120),
        Golden::of_catalogue("drop", "drop", 120),
        Golden::of_catalogue("arch", "arch:voussoirs=11", 60),
        Golden::of_catalogue("card-house", "card-house:storeys=2", 60),
        Golden::of_catalogue("drum", "drum:n=30", 120),
        Golden::of_catalogue("belts", "belts", 120),
    ]
}

/// Rotations of unit length whose numbers are short.
const TURNS: [Quat; 4] = [
    Quat::from_xyzw(0.0, 0.0, 0.0, 1.0),
    Quat::from_xyzw(0.6, 0.0, 0.0, 0.8),
    Quat::from_xyzw(0.1, 0.5, 0.7, 0.5),
    Quat::from_xyzw(0.0, 0.28, 0.0, 0.96),
];

/// One body of every kind of shape.
fn bodies() -> Vec<Body> {
    let simple = [
        Shape::ball(0.3),
        Shape::cuboid(0.3, 0.2, 0.4),
        Shape::capsule(0.3, 0.2),
        Shape::cylinder(0.3, 0.25),
        Shape::cone(0.3, 0.3),
        hull(),
    ];
    let mut bodies: Vec<Body> = simple.into_iter().map(|shape| Body::dynamic().shape(shape)).collect();
    let handle = Shape::cylinder(0.5, 0.1);
    bodies.push(Body::dynamic().shape_at(handle, Vec3::new(0.0, -0.3, 0.0), TURNS[2]).shape_at(
        Shape::cuboid(0.3, 0.15, 0.2),
        Vec3::new(0.1, 0.3, 0.0),
        TURNS[1],
    ));
    bodies
}

/// Each shape falls on the floor twice: upright at rest, and turned with a velocity and a spin.
fn shapes_on(floor: Body) -> World {
    let mut world = World::new();
    world.insert(floor);
    for (k, body) in bodies().into_iter().enumerate() {
        let x = 2.0 * k as f32 - 6.0;
        let body = body.friction(0.3 + 0.1 * k as f32).restitution(0.1 * (k % 4) as f32);
        world.insert(body.clone().position(x, 0.9, -1.0));
        let (v, w) = (Vec3::new(0.7, -1.0, 0.3), Vec3::new(1.0, 2.0, -3.0));
        world.insert(body.position(x, 1.3, 1.0).rotation(TURNS[1 + k % 3]).velocity(v, w));
    }
    world
}

/// All shapes on each other between four walls.
fn heap() -> World {
    let mut world = World::new();
    world.insert(Body::fixed().shape(Shape::half_space(Vec3::Y)));
    for out in [Vec3::X, Vec3::NEG_X, Vec3::Z, Vec3::NEG_Z] {
        let at = -1.3 * out;
        world.insert(Body::fixed().shape(Shape::half_space(out)).position(at.x, at.y, at.z));
    }
    for layer in 0..4_u8 {
        for (k, body) in bodies().into_iter().enumerate() {
            let [i, j] = [k % 3, k / 3].map(|i| 0.85 * (i as f32 - 1.0));
            let turn = TURNS[(k + usize::from(layer)) % 4];
            let shift = 0.05 * f32::from(layer);
            world.insert(body.position(i + shift, 0.7 + 0.9 * f32::from(layer), j - shift).rotation(turn));
        }
    }
    world
}

/// Eight points, no two faces of which are parallel.
fn hull() -> Shape {
    let points = [
        (0.4, 0.0, 0.1),
        (-0.35, 0.1, 0.0),
        (0.1, 0.35, 0.0),
        (0.0, -0.3, 0.1),
        (0.0, 0.1, 0.4),
        (0.1, 0.0, -0.35),
        (0.25, 0.2, 0.2),
        (-0.2, -0.2, -0.15),
    ];
    Shape::convex_hull(&points.map(Vec3::from)).expect("points that span a volume")
}

/// A slab whose upper face is level and whose sides slant.
fn slab() -> Shape {
    let corners = [(12.0, 0.5, 3.0), (11.0, -0.5, 2.5)];
    let signs = [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)];
    let points: Vec<Vec3> =
        corners.iter().flat_map(|&(x, y, z)| signs.map(|(s, t)| Vec3::new(s * x, y, t * z))).collect();
    Shape::convex_hull(&points).expect("points that span a volume")
}

/// A fixed body of planks side by side.
fn staves() -> Body {
    let plank = Shape::cuboid(0.5, 0.25, 3.0);
    (0..24_u8).fold(Body::fixed(), |body, k| {
        let low = if k % 2 == 0 { -0.25 } else { -0.28 };
        body.shape_at(plank.clone(), Vec3::new(f32::from(k) - 11.5, low, 0.0), Quat::IDENTITY)
    })
}

/// How high rough ground is at a place of a grid (m).
fn rough(i: u32, j: u32) -> f32 {
    0.02 * ((7 * i + 3 * j * j) % 5) as f32
}

/// A rough mesh, 24 m by 6 m.
fn mesh() -> Shape {
    let (columns, rows) = (33, 9);
    let vertex = |k: u32| {
        let (i, j) = (k % columns, k / columns);
        Vec3::new(0.75 * i as f32 - 12.0, rough(i, j), 0.75 * j as f32 - 3.0)
    };
    let cells = (0..columns * rows).filter(|k| k % columns + 1 < columns && k / columns + 1 < rows);
    let triangles = cells.flat_map(|k| [[k, k + columns, k + 1], [k + 1, k + columns, k + columns + 1]]).collect();
    Shape::mesh((0..columns * rows).map(vertex).collect(), triangles).expect("a mesh")
}

/// The same ground as a height field.
fn height_field() -> Shape {
    let heights: Vec<Vec<f32>> = (0..9).map(|j| (0..33).map(|i| rough(i, j)).collect()).collect();
    Shape::height_field(&heights, Vec3::new(24.0, 1.0, 6.0)).expect("a height field")
}
