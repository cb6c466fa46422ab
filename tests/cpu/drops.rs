//! Every shape, dropped gently in every pose on every floor, comes to rest on it, and the overlap reported on the way is the true one.

use std::fmt::Write;

use drystone::metrics::Penetration;
use drystone::stages::random::SplitMix64;
use drystone::{Body, Cpu, Shape, Simulation, SolverConfig, World};
use glam::{DQuat, DVec2, DVec3, EulerRot, Quat, Vec3};
use parry3d::query::PointQuery;
use parry3d::shape::Triangle;
use rayon::prelude::*;

use crate::common::sample::one_in;

/// Most bodies of one world.
const BATCH: usize = 50;
const STEPS: usize = 200;
/// Steps from one comparison of the reported overlap with the true one to the next.
const CHECK: usize = 10;

/// SplitMix64, with the numbers that drops need.
struct Random(SplitMix64);

impl Random {
    fn unit(&mut self) -> f64 {
        (self.0.bits() >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    fn choose(&mut self, n: usize) -> usize {
        (self.unit() * n as f64) as usize
    }

    fn vector(&mut self, size: f64) -> DVec3 {
        DVec3::from_array([0; 3].map(|_| self.between(-size, size)))
    }

    fn rotation(&mut self) -> DQuat {
        loop {
            let q = [0; 4].map(|_| self.between(-1.0, 1.0));
            let length = q.iter().map(|x| x * x).sum::<f64>().sqrt();
            if (0.1..1.0).contains(&length) {
                return DQuat::from_array(q.map(|x| x / length));
            }
        }
    }
}

/// A convex solid whose furthest point in a direction has a closed form.
#[derive(Clone)]
enum Solid {
    Ball(f64),
    Cuboid(DVec3),
    Capsule(f64, f64),
    Cylinder(f64, f64),
    Cone(f64, f64),
    Hull(Vec<DVec3>),
}

impl Solid {
    fn shape(&self) -> Shape {
        let f = |x: f64| x as f32;
        match self {
            Self::Ball(r) => Shape::ball(f(*r)),
            Self::Cuboid(h) => Shape::cuboid(f(h.x), f(h.y), f(h.z)),
            Self::Capsule(h, r) => Shape::capsule(f(*h), f(*r)),
            Self::Cylinder(h, r) => Shape::cylinder(f(*h), f(*r)),
            Self::Cone(h, r) => Shape::cone(f(*h), f(*r)),
            Self::Hull(points) => {
                Shape::convex_hull(&points.iter().map(|p| p.as_vec3()).collect::<Vec<_>>()).expect("a hull")
            }
        }
    }

    /// The furthest point in the direction `d`.
    fn furthest(&self, d: DVec3) -> DVec3 {
        let rim = |r: f64| r * DVec3::new(d.x, 0.0, d.z).normalize_or_zero();
        let end = |h: f64| DVec3::new(0.0, h.copysign(d.y), 0.0);
        match self {
            Self::Ball(r) => *r * d.normalize(),
            Self::Cuboid(h) => *h * d.signum(),
            Self::Capsule(h, r) => end(*h) + *r * d.normalize(),
            Self::Cylinder(h, r) => end(*h) + rim(*r),
            Self::Cone(h, r) => {
                let (tip, rim) = (DVec3::Y * *h, rim(*r) - DVec3::Y * *h);
                if tip.dot(d) > rim.dot(d) { tip } else { rim }
            }
            Self::Hull(points) => *points.iter().max_by(|p, q| p.dot(d).total_cmp(&q.dot(d))).expect("points"),
        }
    }

    fn thickness(&self) -> f64 {
        match self {
            Self::Ball(r) => *r,
            Self::Cuboid(h) => h.min_element(),
            Self::Capsule(_, r) => *r,
            Self::Cylinder(h, r) | Self::Cone(h, r) => h.min(*r),
            Self::Hull(_) => f64::from(self.shape().smallest_half_extent()),
        }
    }
}

const SHAPES: [&str; 10] =
    ["ball", "cuboid", "capsule", "cylinder", "cone", "tetrahedron", "prism", "hull", "dumbbell", "cross"];

/// The parts of a body of about `size` in its own frame.
fn parts(shape: &str, size: f64, random: &mut Random) -> Vec<(Solid, DVec3, DQuat)> {
    let half = |random: &mut Random| 0.5 * size * random.between(0.2, 1.0);
    let (a, b, c) = (half(random), half(random), half(random));
    let one = |solid: Solid| vec![(solid, DVec3::ZERO, DQuat::IDENTITY)];
    match shape {
        "ball" => one(Solid::Ball(a)),
        "cuboid" => one(Solid::Cuboid(DVec3::new(a, b, c))),
        "capsule" => one(Solid::Capsule(a, b)),
        "cylinder" => one(Solid::Cylinder(a, b)),
        "cone" => one(Solid::Cone(a, b)),
        "tetrahedron" => one(Solid::Hull(vec![
            DVec3::new(a, a, a),
            DVec3::new(b, -b, -b),
            DVec3::new(-c, c, -c),
            DVec3::new(-b, -a, c),
        ])),
        "prism" => {
            let sides = 5 + random.choose(8);
            let corner = |k: usize, y: f64| {
                let (sin, cos) = (std::f64::consts::TAU * k as f64 / sides as f64).sin_cos();
                DVec3::new(a * cos, y, a * sin)
            };
            one(Solid::Hull((0..sides).flat_map(|k| [corner(k, -b), corner(k, b)]).collect()))
        }
        "hull" => {
            let count = 8 + random.choose(16);
            one(Solid::Hull((0..count).map(|_| random.vector(1.0).normalize() * DVec3::new(a, b, c)).collect()))
        }
        "dumbbell" => vec![
            (Solid::Ball(0.5 * a), DVec3::X * b, DQuat::IDENTITY),
            (Solid::Capsule(b, 0.2 * a), DVec3::ZERO, DQuat::from_rotation_z(std::f64::consts::FRAC_PI_2)),
            (Solid::Cone(0.5 * a, 0.5 * c), -DVec3::X * b, DQuat::from_rotation_x(1.0)),
        ],
        "cross" => vec![
            (Solid::Cuboid(DVec3::new(a, 0.2 * a, 0.2 * a)), DVec3::ZERO, DQuat::IDENTITY),
            (Solid::Cylinder(b, 0.15 * b), DVec3::ZERO, DQuat::IDENTITY),
            (Solid::Cuboid(DVec3::new(0.2 * c, 0.2 * c, c)), DVec3::ZERO, DQuat::from_rotation_x(0.5)),
        ],
        other => panic!("{other}"),
    }
}

/// A square of `side` around the origin in cells of two triangles each.
struct Terrain {
    side: f64,
    cells: usize,
    /// Of the corners, row by row along z.
    heights: Vec<f64>,
    /// Whether the diagonal of a cell runs from its corner (x+, z-) to (x-, z+).
    crossed: Vec<bool>,
    /// Normal of the plane through the origin, if it is one.
    plane: Option<DVec3>,
}

impl Terrain {
    fn corner(&self, i: usize, j: usize) -> DVec3 {
        let at = |i: usize| self.side * (i as f64 / self.cells as f64 - 0.5);
        DVec3::new(at(i), self.heights[j * (self.cells + 1) + i], at(j))
    }

    /// Corners of the triangles of a cell, counter-clockwise seen from above.
    fn triangles(&self, i: usize, j: usize) -> [[(usize, usize); 3]; 2] {
        let [a, b, c, d] = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)];
        if self.crossed[j * self.cells + i] { [[a, d, b], [b, d, c]] } else { [[a, c, b], [a, d, c]] }
    }

    /// Point of the surface above or below `p`, and its normal; none beyond the border.
    fn surface(&self, p: DVec3) -> Option<(f64, DVec3)> {
        let at = (DVec2::new(p.x, p.z) / self.side + 0.5) * self.cells as f64;
        if at.min_element() < 0.0 || at.max_element() >= self.cells as f64 {
            return None;
        }
        if let Some(n) = self.plane {
            return Some((-(n.x * p.x + n.z * p.z) / n.y, n));
        }
        let inside = |t: &[DVec3; 3]| {
            (0..3).all(|k| {
                let (edge, to) = (t[(k + 1) % 3] - t[k], p - t[k]);
                edge.z * to.x - edge.x * to.z >= -1e-9 * self.side
            })
        };
        let triangles = self.triangles(at.x as usize, at.y as usize).map(|t| t.map(|(i, j)| self.corner(i, j)));
        let t = triangles.iter().find(|t| inside(t)).expect("a cell is covered by its triangles");
        let normal = (t[1] - t[0]).cross(t[2] - t[0]).normalize();
        Some((t[0].y - (normal.x * (p.x - t[0].x) + normal.z * (p.z - t[0].z)) / normal.y, normal))
    }

    /// Distance of a point from the triangles of its cell and of those around.
    fn distance(&self, p: DVec3) -> f64 {
        let cell = |x: f64| ((x / self.side + 0.5) * self.cells as f64) as usize;
        let around = |i: usize| i.saturating_sub(1)..(i + 2).min(self.cells);
        let cells = around(cell(p.z)).flat_map(|j| around(cell(p.x)).map(move |i| (i, j)));
        let corners =
            cells.flat_map(|(i, j)| self.triangles(i, j)).map(|t| t.map(|(i, j)| (self.corner(i, j) - p).as_vec3()));
        let distances = corners.map(|[a, b, c]| Triangle::new(a, b, c).distance_to_local_point(Vec3::ZERO, false));
        distances.fold(f64::INFINITY, |least, d| least.min(f64::from(d)))
    }

    fn mesh(&self) -> Shape {
        let n = self.cells;
        let vertices = (0..=n).flat_map(|j| (0..=n).map(move |i| self.corner(i, j).as_vec3())).collect();
        let index = |(i, j): (usize, usize)| (j * (n + 1) + i) as u32;
        let cells = (0..n).flat_map(|j| (0..n).map(move |i| (i, j)));
        Shape::mesh(vertices, cells.flat_map(|(i, j)| self.triangles(i, j)).map(|t| t.map(index)).collect())
            .expect("a mesh")
    }

    fn height_field(&self) -> Shape {
        let rows: Vec<Vec<f32>> =
            self.heights.chunks(self.cells + 1).map(|row| row.iter().map(|&h| h as f32).collect()).collect();
        Shape::height_field(&rows, Vec3::new(self.side as f32, 1.0, self.side as f32)).expect("a height field")
    }
}

const FLOORS: [&str; 12] = [
    "half-space",
    "cuboid",
    "quad",
    "other quad",
    "large cells",
    "cells",
    "small cells",
    "slope",
    "bumps",
    "flat field",
    "hilly field",
    "moving mesh",
];

/// A floor for bodies of `size`, and the velocity with which it moves.
fn floor(kind: &str, size: f64, random: &mut Random) -> (Terrain, Body) {
    let side = 40.0 * size;
    let cells = match kind {
        "large cells" | "moving mesh" => 8,
        "cells" | "slope" | "bumps" | "hilly field" | "flat field" => 30 + random.choose(50),
        "small cells" => 120,
        _ => 1,
    };
    // Alone under what is dropped, a quad may be much larger than that.
    let side = if cells == 1 { side * random.between(1.0, 20.0) } else { side };
    let field = kind.ends_with("field");
    let crossed = (0..cells * cells).map(|_| match kind {
        "quad" => false,
        "other quad" => true,
        _ => field || random.choose(2) == 0,
    });
    let crossed = crossed.collect();
    let rough = if kind == "bumps" || kind == "hilly field" { 0.15 * side / cells as f64 } else { 0.0 };
    let normal = if kind == "slope" { DVec3::new(-0.1, 1.0, 0.15).normalize() } else { DVec3::Y };
    let mut terrain = Terrain { side, cells, heights: Vec::new(), crossed, plane: (rough == 0.0).then_some(normal) };
    for j in 0..=cells {
        for i in 0..=cells {
            terrain.heights.push(0.0);
            let p = terrain.corner(i, j);
            let height = -(normal.x * p.x + normal.z * p.z) / normal.y + random.between(-rough, rough);
            terrain.heights[j * (cells + 1) + i] = height;
        }
    }
    let half = 0.5 * side as f32;
    let body = match kind {
        "half-space" => Body::fixed().shape(Shape::half_space(Vec3::Y)),
        "cuboid" => Body::fixed().shape_at(Shape::cuboid(half, 1.0, half), Vec3::NEG_Y, Quat::IDENTITY),
        "moving mesh" => Body::kinematic().shape(terrain.mesh()).velocity(Vec3::new(0.01, 0.02, 0.0), Vec3::ZERO),
        _ if field => Body::fixed().shape(terrain.height_field()),
        _ => Body::fixed().shape(terrain.mesh()),
    };
    (terrain, body.friction(0.7))
}

/// A body that falls, and all that its true overlap takes.
struct Drop {
    parts: Vec<(Solid, DVec3, DQuat)>,
    /// Half of the smallest side of the thinnest part, and of the thickest.
    thickness: f64,
    bulk: f64,
    lost: bool,
    /// Least depth in the last second, relative to the bulk.
    sunk: f64,
    /// Largest difference of the reported overlap from the true one, relative to the thickness.
    wrong: f64,
}

impl Drop {
    /// The furthest point of a body at a pose in the direction `d`.
    fn furthest(&self, position: DVec3, rotation: DQuat, d: DVec3) -> DVec3 {
        let points = self.parts.iter().map(|(solid, at, turn)| {
            let own = (rotation * *turn).inverse() * d;
            position + rotation * (*at + *turn * solid.furthest(own))
        });
        points.max_by(|p, q| p.dot(d).total_cmp(&q.dot(d))).expect("a part")
    }

    /// How deep the body is in the terrain, which moved by `moved`.
    fn depth(&self, body: &Body, terrain: &Terrain, moved: DVec3) -> f64 {
        let (position, rotation) = (body.position.as_dvec3() - moved, body.rotation.as_dquat().normalize());
        if let Some(normal) = terrain.plane {
            return (-self.furthest(position, rotation, -normal).dot(normal)).max(0.0);
        }
        let mut depth = 0.0_f64;
        for k in 0..300 {
            let y = 1.0 - (f64::from(k) + 0.5) / 150.0;
            let (sin, cos) = (2.399_963_23 * f64::from(k)).sin_cos();
            let flat = (1.0 - y * y).sqrt();
            let p = self.furthest(position, rotation, DVec3::new(cos * flat, y, sin * flat));
            if terrain.surface(p).is_some_and(|(height, _)| p.y < height) {
                depth = depth.max(terrain.distance(p));
            }
        }
        depth
    }
}

/// A body of `shape`, in a pose that may be special, its lowest point a little above `terrain` at a place that may be too.
fn drop(shape: &str, size: f64, place: DVec2, terrain: &Terrain, dt: f64, random: &mut Random) -> (Drop, Body) {
    let parts = parts(shape, size, random);
    let thickness = parts.iter().map(|(solid, ..)| solid.thickness()).fold(f64::INFINITY, f64::min);
    let mut body = Body::dynamic().friction(0.7);
    for (solid, at, turn) in &parts {
        body = body.shape_at(solid.shape(), at.as_vec3(), turn.as_quat());
    }
    let quarter = std::f64::consts::FRAC_PI_2;
    let about_y = DQuat::from_rotation_y(random.between(0.0, 4.0 * quarter));
    let turns = DQuat::from_euler(
        EulerRot::XYZ,
        quarter * random.choose(4) as f64,
        quarter * random.choose(4) as f64,
        quarter * random.choose(4) as f64,
    );
    let rotation = match (random.choose(4), &parts[0].0) {
        (0, _) => turns,
        (1, _) => about_y * turns,
        // Exactly on its side.
        (2, Solid::Cone(h, r)) => about_y * DQuat::from_rotation_z(quarter + (r / (2.0 * h)).atan()),
        _ => random.rotation(),
    };
    // On a line of the grid, on a corner of it, and anywhere.
    let cell = terrain.side / terrain.cells as f64;
    let mut place = place;
    if terrain.cells > 1 {
        let on_line = |x: f64| ((x + 0.5 * terrain.side) / cell).round() * cell - 0.5 * terrain.side;
        match random.choose(4) {
            0 => place.x = on_line(place.x),
            1 => place = DVec2::new(on_line(place.x), on_line(place.y)),
            2 => place.y = on_line(place.y) + 1e-4 * cell,
            _ => {}
        }
    }
    let drop = Drop {
        bulk: parts.iter().map(|(solid, ..)| solid.thickness()).fold(0.0, f64::max),
        parts,
        thickness,
        lost: false,
        sunk: 0.0,
        wrong: 0.0,
    };
    // 300 directions miss the deepest point by little, and the fall is not to begin inside the floor.
    let above = if terrain.plane.is_some() { 0.0 } else { 0.3 * size };
    // Gentle: within a step nothing moves further than the body is thick.
    let speed = (thickness / dt).min(2.0);
    let gap = above + random.unit() * (0.5 * size).min(speed * speed / (4.0 * 9.81)) + 1e-3 * size;
    body = body.rotation(rotation.as_quat()).position(place.x as f32, (2.0 * size) as f32, place.y as f32);
    let (height, normal) = terrain.surface(DVec3::new(place.x, 0.0, place.y)).expect("a place on the terrain");
    let lowest = drop.furthest(body.position.as_dvec3(), body.rotation.as_dquat().normalize(), -normal);
    let height_of_lowest = (lowest - DVec3::new(place.x, height, place.y)).dot(normal);
    body.position.y += ((gap - height_of_lowest) / normal.y) as f32;
    body = body.velocity((0.5 * speed * random.vector(0.5)).as_vec3(), (speed / size * random.vector(0.5)).as_vec3());
    (drop, body)
}

/// How many bodies were dropped, lost, sunk in at rest, and reported with another overlap than the true one.
#[derive(Clone, Copy, Default)]
struct Outcome {
    dropped: usize,
    lost: usize,
    sunk: usize,
    wrong: usize,
}

impl std::iter::Sum for Outcome {
    fn sum<I: Iterator<Item = Self>>(all: I) -> Self {
        all.fold(Self::default(), |a, b| Self {
            dropped: a.dropped + b.dropped,
            lost: a.lost + b.lost,
            sunk: a.sunk + b.sunk,
            wrong: a.wrong + b.wrong,
        })
    }
}

/// Drops `count` bodies of one shape and about one size on one floor.
fn run(shape: &str, kind: &str, count: usize, seed: u64) -> Outcome {
    let mut random = Random(SplitMix64::new(seed));
    let size = 0.05 * 100_f64.powf(random.unit());
    // A body smaller than 12 cm topples further in a sixtieth of a second than its smallest thickness.
    let dt = if size < 0.12 { 1.0 / 120.0 } else { 1.0 / 60.0 };
    let (terrain, floor) = floor(kind, size, &mut random);
    let mut world = World::new();
    world.insert(floor);
    let (rows, pitch) = (8, 4.0 * size);
    // Away from the middle too, but not so far that single precision ends.
    let middle = random.between(-0.05, 0.05) * terrain.side.min(100.0 * size);
    let mut drops = Vec::new();
    for k in 0..count {
        let at = |k: usize| middle + pitch * (k as f64 - 0.5 * (rows as f64 - 1.0));
        let mut place = DVec2::new(at(k % rows), at(k / rows));
        place += DVec2::new(random.between(-0.5, 0.5), random.between(-0.5, 0.5)) * size;
        // On the diagonal of a quad.
        if kind == "quad" && k % rows == k / rows {
            place.y = place.x;
        }
        let (drop, body) = drop(shape, size, place, &terrain, dt, &mut random);
        world.insert(body);
        drops.push(drop);
    }
    let config = SolverConfig::default().without_sleep();
    let mut simulation = Simulation::with(world, config.clone(), Box::new(Cpu::new())).expect("a simulation");
    for step in 1..=STEPS {
        simulation.step(dt as f32).expect("a step");
        let floor = &simulation.world.bodies[0];
        let moved = floor.position.as_dvec3();
        for (drop, body) in drops.iter_mut().zip(&simulation.world.bodies[1..]) {
            let center = body.center_of_mass().as_dvec3() - moved;
            let Some((height, _)) = terrain.surface(center) else { continue };
            drop.lost = center.y < height || center.is_nan();
            if step % CHECK != 0 {
                continue;
            }
            let depth = drop.depth(body, &terrain, moved);
            // A body that rolls on a rim lies on points that turn out of the floor within a step.
            let rim = drop.furthest(DVec3::ZERO, DQuat::IDENTITY, DVec3::Y).length();
            let turned = f64::from(body.angular_velocity.length() * dt as f32);
            let beyond = (depth - rim * turned * turned) / drop.bulk;
            drop.sunk = if step + 60 < STEPS { f64::INFINITY } else { drop.sunk.min(beyond) };
            if terrain.plane.is_some() {
                let mut alone = World::new();
                alone.insert(floor.clone());
                // As it stands, wherever it goes.
                alone.insert(body.clone().velocity(Vec3::ZERO, Vec3::ZERO));
                let reported = Penetration::of_world(&alone, &config).max;
                drop.wrong = drop.wrong.max((reported - depth).abs() / drop.thickness);
            }
        }
    }
    let mut outcome = Outcome { dropped: count, ..Outcome::default() };
    for (k, drop) in drops.iter().enumerate() {
        // After 3 s some still rock between ridges.
        let most = if terrain.plane.is_some() { 0.05 } else { 0.1 };
        let sunk = drop.sunk.is_finite() && drop.sunk > most;
        let wrong = drop.wrong > 0.02;
        if drop.lost || sunk || wrong {
            let Drop { lost, sunk, wrong, .. } = drop;
            println!(
                "{shape} on {kind}, seed {seed}, size {size:.3}, body {}: lost {lost}, sunk {sunk:.3}, wrong {wrong:.3}",
                k + 1
            );
        }
        outcome.lost += usize::from(drop.lost);
        outcome.sunk += usize::from(!drop.lost && sunk);
        outcome.wrong += usize::from(!drop.lost && wrong);
    }
    outcome
}

/// Drops at least `count` bodies of each shape on each floor; all of them come to rest on it.
fn all_rest(count: usize) {
    let batches = count.div_ceil(BATCH);
    let count = count.min(BATCH);
    let runs: Vec<usize> = (0..SHAPES.len() * FLOORS.len() * batches).collect();
    let one = |&i: &usize| {
        let pair = i / batches;
        run(SHAPES[pair / FLOORS.len()], FLOORS[pair % FLOORS.len()], count, (1000 * (i % batches) + pair) as u64)
    };
    let outcomes: Vec<Outcome> = runs.par_iter().map(one).collect();
    let outcomes: Vec<Outcome> = outcomes.chunks(batches).map(|all| all.iter().copied().sum()).collect();
    let mut table = format!("lost, sunk and wrongly reported, of {} each\n{:12}", outcomes[0].dropped, "");
    FLOORS.iter().for_each(|floor| write!(table, "{floor:>13}").expect("a cell"));
    for (row, shape) in outcomes.chunks(FLOORS.len()).zip(SHAPES) {
        write!(table, "\n{shape:12}").expect("a cell");
        for o in row {
            write!(table, "{:>13}", format!("{} {} {}", o.lost, o.sunk, o.wrong)).expect("a cell");
        }
    }
    println!("{table}");
    assert!(outcomes.iter().all(|o| o.lost + o.sunk + o.wrong == 0), "see the table");
}

#[test]
fn every_shape_dropped_on_every_floor_rests_on_it() {
    all_rest(BATCH / one_in(2));
}

/// `DRYSTONE_DROPS=2000 cargo test --release --test cpu drops -- --ignored --nocapture`
#[test]
#[ignore = "takes minutes"]
fn thousands_of_every_shape_dropped_on_every_floor_rest_on_it() {
    let count = std::env::var("DRYSTONE_DROPS").map(|count| count.parse().expect("a number of drops"));
    all_rest(count.unwrap_or(1000));
}

/// Where a body that starts at 4 m/s on a floor is after a second, and its greatest height above where it began [m].
fn slid(floor: Shape, shape: Shape, height: f32, friction: f32) -> (f32, f32) {
    let mut world = World::new();
    world.insert(Body::fixed().shape(floor).friction(friction));
    let body = Body::dynamic().shape(shape).friction(friction).position(-3.0, height, 0.05);
    world.insert(body.velocity(Vec3::new(4.0, 0.0, 0.3), Vec3::ZERO));
    let mut simulation =
        Simulation::with(world, SolverConfig::default().without_sleep(), Box::new(Cpu::new())).expect("a simulation");
    let mut highest = 0.0_f32;
    for _ in 0..60 {
        simulation.step(1.0 / 60.0).expect("a step");
        highest = highest.max(simulation.world.bodies[1].position.y - height);
    }
    (simulation.world.bodies[1].position.x, highest)
}

#[test]
fn nothing_stumbles_over_the_edges_of_a_flat_mesh_or_height_field() {
    let (cells, side) = (37, 12.0);
    let crossed = (0..cells * cells).map(|i| i % 3 == 0).collect();
    let terrain = Terrain { side, cells, heights: vec![0.0; (cells + 1) * (cells + 1)], crossed, plane: None };
    let shapes = [
        (Shape::cuboid(0.3, 0.2, 0.25), 0.2),
        (Shape::cylinder(0.2, 0.3), 0.2),
        (Shape::cone(0.2, 0.3), 0.2),
        (Shape::ball(0.3), 0.3),
    ];
    for (shape, height) in shapes {
        let (flat, _) = slid(Shape::half_space(Vec3::Y), shape.clone(), height, 0.2);
        assert!(flat > -2.0, "{shape:?}: {flat}");
        for floor in [terrain.mesh(), terrain.height_field()] {
            let (x, highest) = slid(floor.clone(), shape.clone(), height, 0.2);
            println!("{shape:?} on {floor:?}: {x} m, {flat} m on a half-space, {highest} m up");
            assert!((x - flat).abs() < 0.01 && highest < 1e-3, "{shape:?} on {floor:?}: {x}, {flat}, {highest}");
        }
    }
}
