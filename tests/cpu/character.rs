//! Characters against closed forms: speeds, slopes, steps, what moves under them, what they push, and that they enter
//! nothing.

use crate::common::random::Random;
use drystone::character::Movement;
use drystone::glam::{Quat, Vec3};
use drystone::queries::{Filter, Queries};
use drystone::{Body, BodyHandle, Character, Reference, Shape, Simulation, SolverConfig, World};
use rayon::prelude::*;

const DT: f32 = 1.0 / 60.0;
/// A capsule of 1.8 m, its margin, and the height of its middle above the ground.
const RADIUS: f32 = 0.3;
const HEIGHT: f32 = 1.8;
const MARGIN: f32 = 0.02 * RADIUS;
const MIDDLE: f32 = 0.5 * HEIGHT + MARGIN;
/// The highest step of a character at its default settings.
const STEP: f32 = 0.2 * HEIGHT;

struct Walk {
    simulation: Simulation,
    character: Character,
}

impl Walk {
    /// A character with this body, which is not in the world yet.
    fn with(mut world: World, body: Body) -> Self {
        let character = Character::new(world.insert(body));
        let simulation = Simulation::with(world, SolverConfig::default(), Box::new(Reference::<f32>::new()));
        Self { simulation: simulation.expect("a world"), character }
    }

    /// A capsule at a place.
    fn at(world: World, place: Vec3) -> Self {
        let Vec3 { x, y, z } = place;
        Self::with(world, Body::kinematic().shape(Shape::capsule(0.5 * HEIGHT - RADIUS, RADIUS)).position(x, y, z))
    }

    fn position(&self) -> Vec3 {
        self.simulation.world.body(self.character.body).expect("it is there").position
    }

    /// One step at a velocity.
    fn step(&mut self, velocity: Vec3) -> Movement {
        let movement = self.character.walk(&mut self.simulation, velocity, DT).expect("a walk");
        self.simulation.step(DT).expect("a step");
        movement
    }

    fn steps(&mut self, count: u32, velocity: Vec3) -> Movement {
        (1..count).for_each(|_| drop(self.step(velocity)));
        self.step(velocity)
    }
}

fn floor() -> World {
    let mut world = World::new();
    world.insert(Body::fixed().shape(Shape::half_space(Vec3::Y)));
    world
}

fn block(half: Vec3, at: Vec3) -> Body {
    Body::fixed().shape(Shape::cuboid(half.x, half.y, half.z)).position(at.x, at.y, at.z)
}

/// Ground of each kind, level at height 0 within 10 m.
fn grounds() -> Vec<(&'static str, Body)> {
    let corners = [(-10.0, -10.0), (-10.0, 10.0), (10.0, -10.0), (10.0, 10.0)];
    let corners = corners.map(|(x, z)| Vec3::new(x, 0.0, z)).to_vec();
    let mesh = Shape::mesh(corners, vec![[0, 1, 2], [2, 1, 3]]).expect("a mesh");
    let field = Shape::height_field(&vec![vec![0.0; 21]; 21], Vec3::new(20.0, 1.0, 20.0)).expect("a field");
    let tiles = (0..20).fold(Body::fixed(), |body, k| {
        body.shape_at(Shape::cuboid(0.5, 0.5, 10.0), Vec3::new(k as f32 - 9.5, -0.5, 0.0), Quat::IDENTITY)
    });
    vec![
        ("half-space", Body::fixed().shape(Shape::half_space(Vec3::Y))),
        ("cuboid", block(Vec3::new(10.0, 0.5, 10.0), -0.5 * Vec3::Y)),
        ("tiles", tiles),
        ("mesh", Body::fixed().shape(mesh)),
        ("height field", Body::fixed().shape(field)),
    ]
}

#[test]
fn on_level_ground_of_any_kind_it_walks_at_its_speed_and_height() {
    for (name, ground) in grounds() {
        let mut world = World::new();
        world.insert(ground);
        let mut walk = Walk::at(world, Vec3::new(-5.0, MIDDLE, 0.3));
        for _ in 0..120 {
            let before = walk.position();
            let movement = walk.step(Vec3::new(3.0, 0.0, 0.5));
            let ground = movement.ground.unwrap_or_else(|| panic!("{name}: in the air at {before}"));
            assert!((ground.normal - Vec3::Y).length() < 1e-4, "{name}: {ground:?}");
            let moved = walk.position() - before;
            assert!((moved - DT * Vec3::new(3.0, 0.0, 0.5)).length() < 1e-5, "{name}: {moved} at {before}");
        }
        assert!((walk.position() - Vec3::new(1.0, MIDDLE, 1.3)).length() < 2e-3, "{name}: {}", walk.position());
    }
}

/// A ramp along x that begins at x = 0, by its angle in degrees.
fn ramp(degrees: f32) -> World {
    let mut world = floor();
    let turn = Quat::from_rotation_z(degrees.to_radians());
    let middle = turn * Vec3::new(10.0, -0.5, 0.0);
    world.insert(block(Vec3::new(10.0, 0.5, 5.0), middle).rotation(turn));
    world
}

#[test]
fn a_slope_within_the_limit_is_climbed_at_the_speed_of_the_walk_and_a_steeper_one_is_a_wall() {
    for degrees in [10.0, 30.0, 44.0] {
        let mut walk = Walk::at(ramp(degrees), Vec3::new(-1.0, MIDDLE, 0.0));
        walk.steps(60, 2.0 * Vec3::X);
        let before = walk.position();
        let movement = walk.steps(60, 2.0 * Vec3::X);
        let (sine, cosine) = degrees.to_radians().sin_cos();
        assert!((walk.position() - before - 2.0 * Vec3::new(cosine, sine, 0.0)).length() < 1e-3, "{degrees} degrees");
        let normal = movement.ground.expect("the slope").normal;
        assert!((normal - Vec3::new(-sine, cosine, 0.0)).length() < 1e-3, "{degrees} degrees: {normal}");
        // It stands there, and goes down without a hop.
        let before = walk.position();
        walk.steps(60, Vec3::ZERO);
        assert!(walk.position().distance(before) < 1e-4, "{degrees} degrees: {}", walk.position() - before);
        for _ in 0..60 {
            assert!(walk.step(-2.0 * Vec3::X).ground.is_some(), "{degrees} degrees");
        }
        assert!((walk.position() - before + 2.0 * Vec3::new(cosine, sine, 0.0)).length() < 1e-3, "{degrees} degrees");
    }
    for degrees in [46.0, 60.0, 80.0] {
        let mut walk = Walk::at(ramp(degrees), Vec3::new(-1.0, MIDDLE, 0.0));
        for _ in 0..180 {
            walk.step(2.0 * Vec3::X);
            assert!(walk.position().y < MIDDLE + MARGIN, "{degrees} degrees: {}", walk.position());
        }
        // It touches the slope: its middle is as far above the plane as its lower ball says.
        let (sine, cosine) = degrees.to_radians().sin_cos();
        let low = walk.position() - (0.5 * HEIGHT - RADIUS) * Vec3::Y;
        let gap = low.dot(Vec3::new(-sine, cosine, 0.0)) - RADIUS;
        assert!(gap > 0.9 * MARGIN && gap < 1.2 * MARGIN, "{degrees} degrees: {gap} m");
    }
}

#[test]
fn a_slope_that_is_too_steep_lets_it_slide_with_the_acceleration_of_gravity() {
    let degrees = 60_f32;
    let (sine, cosine) = degrees.to_radians().sin_cos();
    let start = 6.0 * Vec3::new(cosine, sine, 0.0) + (RADIUS + MARGIN) * Vec3::new(-sine, cosine, 0.0);
    let mut walk = Walk::at(ramp(degrees), start + (0.5 * HEIGHT - RADIUS) * Vec3::Y);
    let before = walk.position();
    walk.steps(30, Vec3::ZERO);
    let moved = walk.position() - before;
    let expected = 0.5 * 9.81 * sine * 0.25;
    assert!((moved + expected * Vec3::new(cosine, sine, 0.0)).length() < 0.01 * expected, "{moved}, not {expected} m");
}

#[test]
fn it_leaves_a_steep_slope_with_the_velocity_of_its_slide() {
    let degrees = 60_f32;
    let (sine, cosine) = degrees.to_radians().sin_cos();
    let mut world = ramp(degrees);
    world.bodies[1].position.y += 20.0;
    // One meter above the lower edge.
    let start = Vec3::new(cosine, sine, 0.0) + (RADIUS + MARGIN) * Vec3::new(-sine, cosine, 0.0) + 20.0 * Vec3::Y;
    let mut walk = Walk::at(world, start + (0.5 * HEIGHT - RADIUS) * Vec3::Y);
    walk.steps(45, Vec3::ZERO);
    let before = walk.position();
    walk.steps(10, Vec3::ZERO);
    let (moved, expected) = (walk.position().x - before.x, -10.0 * DT * cosine * (2.0 * 9.81 * sine).sqrt());
    assert!((moved / expected - 1.0).abs() < 0.05, "{moved}, not {expected} m");
}

#[test]
fn a_jump_against_a_steep_slope_is_no_higher_than_elsewhere() {
    for degrees in [46.0, 60.0] {
        let mut walk = Walk::at(ramp(degrees), Vec3::new(-0.5, MIDDLE, 0.0));
        walk.steps(5, Vec3::ZERO);
        walk.character.launch(4.0 * Vec3::Y);
        let mut highest = 0.0_f32;
        for _ in 0..60 {
            walk.step(3.0 * Vec3::X);
            highest = highest.max(walk.position().y - MIDDLE);
        }
        assert!(highest < 16.0 / (2.0 * 9.81) + 0.01, "{degrees} degrees: {highest} m");
    }
}

#[test]
fn steps_up_to_the_limit_are_climbed_and_higher_ones_are_walls() {
    for share in [0.3, 0.6, 0.9, 0.98] {
        let height = share * STEP;
        let mut world = floor();
        world.insert(block(Vec3::new(2.0, 0.5 * height, 5.0), Vec3::new(3.0, 0.5 * height, 0.0)));
        let mut walk = Walk::at(world, MIDDLE * Vec3::Y);
        for k in 0..120 {
            assert!(walk.step(1.5 * Vec3::X).ground.is_some(), "{share} of a step: in the air in step {k}");
        }
        let aim = Vec3::new(3.0, MIDDLE + height, 0.0);
        assert!(walk.position().distance(aim) < 0.02, "{share} of a step: {}", walk.position());
    }
    for share in [1.02, 1.2, 2.0] {
        let height = share * STEP;
        let mut world = floor();
        world.insert(block(Vec3::new(2.0, 0.5 * height, 5.0), Vec3::new(3.0, 0.5 * height, 0.0)));
        let mut walk = Walk::at(world, MIDDLE * Vec3::Y);
        walk.steps(120, 1.5 * Vec3::X);
        assert!(walk.position().distance(Vec3::new(1.0 - RADIUS, MIDDLE, 0.0)) < 0.02, "{share}: {}", walk.position());
    }
}

fn stairs(rise: f32, count: usize) -> World {
    let mut world = floor();
    for k in 0..count {
        let half = 0.5 * rise * (k + 1) as f32;
        world.insert(block(Vec3::new(0.15, half, 2.0), Vec3::new(0.5 + 0.3 * k as f32, half, 0.0)));
    }
    world
}

#[test]
fn stairs_are_walked_up_and_down_on_the_ground() {
    let (rise, count) = (0.18, 12);
    let mut walk = Walk::at(stairs(rise, count), MIDDLE * Vec3::Y);
    for k in 0..100 {
        assert!(walk.step(2.0 * Vec3::X).ground.is_some(), "up: in the air in step {k}, {}", walk.position());
    }
    assert!(walk.position().x > 3.0 && walk.position().y > 9.0 * rise + MIDDLE, "{}", walk.position());
    for k in 0..100 {
        assert!(walk.step(-2.0 * Vec3::X).ground.is_some(), "down: in the air in step {k}, {}", walk.position());
    }
    assert!((walk.position() - MIDDLE * Vec3::Y).length() < 0.1, "{}", walk.position());
}

/// Surfaces along z, through a line of points (x, y), as a mesh: each of them is cut into strips and triangles at
/// random. The strips share their corners, or each has its own.
fn profile(random: &mut Random, line: &[(f32, f32)], turn: Quat) -> Shape {
    let (mut points, mut triangles): (Vec<Vec3>, Vec<[u32; 3]>) = Default::default();
    let (cuts, is_shared) = (1 + random.below(4) as usize, random.happens(0.5));
    let places: Vec<f32> = (0..=cuts).map(|k| 4.0 * (k as f32 / cuts as f32 - 0.5)).collect();
    let mut number = |at: Vec3| {
        let old = points.iter().position(|&old| old == at).filter(|_| is_shared);
        old.unwrap_or_else(|| {
            points.push(at);
            points.len() - 1
        }) as u32
    };
    for ends in line.windows(2) {
        for z in places.windows(2) {
            let corner = |(x, y): (f32, f32), z: f32| turn * Vec3::new(x, y, z);
            let [a, b] = [ends[0], ends[1]].map(|end| [z[0], z[1]].map(|z| number(corner(end, z))));
            let [(a, d), (b, c)] = [(a[0], a[1]), (b[0], b[1])];
            triangles.extend(if random.happens(0.5) { [[a, d, c], [a, c, b]] } else { [[a, d, b], [d, c, b]] });
        }
    }
    Shape::mesh(points, triangles).expect("a mesh")
}

#[test]
fn stairs_of_any_triangles_are_climbed_without_a_stop() {
    (0..100_u64).into_par_iter().for_each(|seed| {
        let mut random = Random::new(seed);
        let (rise, run) = (random.within(0.1, 0.98) * STEP, random.within(0.25, 0.6));
        let mut line = vec![(-2.0, 0.0)];
        for k in 0..8 {
            line.extend([0.0, 1.0].map(|up| (1.0 + run * k as f32, rise * (k as f32 + up))));
        }
        line.push((1.0 + 8.0 * run + 3.0, 8.0 * rise));
        let turn = Quat::from_rotation_y(random.within(0.0, 6.0));
        let mut world = World::new();
        // One body, or a body for each surface.
        let lines = if random.happens(0.5) { vec![&line[..]] } else { line.windows(2).collect() };
        for line in lines {
            world.insert(Body::fixed().shape(profile(&mut random, line, turn)));
        }
        let mut walk = Walk::at(world, MIDDLE * Vec3::Y);
        let (ahead, aside) = (turn * Vec3::X, turn * Vec3::Z);
        let velocity = random.within(0.5, 6.0) * (ahead + random.within(-0.1, 0.1) * aside).normalize();
        walk.step(Vec3::ZERO);
        let mut far = 0.0;
        while far < 1.0 + 8.0 * run {
            let at = walk.position();
            let ground = walk.step(velocity).ground;
            far = ahead.dot(walk.position());
            assert!(ground.is_some(), "seed {seed}: in the air after {at}");
            assert!(far > ahead.dot(at) + 0.01 * DT, "seed {seed}: it stops at {at}");
        }
        let end = walk.position().y - MIDDLE - 8.0 * rise;
        assert!(end.abs() < MARGIN, "seed {seed}: {end} m");
    });
}

#[test]
fn a_slope_of_any_triangles_above_the_limit_is_a_wall() {
    for seed in 0..200 {
        let mut random = Random::new(seed);
        let (sine, cosine) = random.within(46.0, 85.0_f32).to_radians().sin_cos();
        let high = random.within(1.2, 3.0) * STEP;
        let line = [(-4.0, 0.0), (1.0, 0.0), (1.0 + high * cosine / sine, high), (4.0, high)];
        let turn = Quat::from_rotation_y(random.within(0.0, 6.0));
        let mut world = World::new();
        world.insert(Body::fixed().shape(profile(&mut random, &line, turn)));
        let mut walk = Walk::at(world, MIDDLE * Vec3::Y);
        walk.step(Vec3::ZERO);
        let velocity = random.within(0.5, 6.0) * (turn * Vec3::X);
        for _ in 0..120 {
            walk.step(velocity + random.within(-0.5, 0.5) * (turn * Vec3::Z));
            assert!((walk.position().y - MIDDLE).abs() < MARGIN, "seed {seed}: {}", walk.position());
        }
    }
}

#[test]
fn it_rises_out_of_steep_slopes_though_a_wall_pushes_it_aside() {
    for seed in 0..200 {
        let mut random = Random::new(seed);
        let mut world = floor();
        // Two slopes that cross in the character, and a wall on one side that is lower than they are.
        let degrees = random.within(60.0, 80.0_f32);
        for side in [1.0, -1.0] {
            let turn = Quat::from_rotation_z(side * degrees.to_radians());
            world.insert(block(Vec3::new(1.0, 0.1, 1.0), Vec3::ZERO).rotation(turn));
        }
        let low = 0.5 * random.within(0.1, 0.8);
        world.insert(block(Vec3::new(0.5, low, 1.0), Vec3::new(-0.5 - random.within(-0.1, 0.2), low, 0.0)));
        let mut walk = Walk::at(world, MIDDLE * Vec3::Y);
        let mut highest = walk.position().y;
        for _ in 0..30 {
            walk.step(Vec3::ZERO);
            let at = walk.position();
            assert!(at.y > highest - 1e-5, "seed {seed}: it falls from {highest} to {}", at.y);
            highest = highest.max(at.y);
        }
        let (filter, queries) = (Filter::default().except(walk.character.body), walk.simulation.queries());
        let capsule = Shape::capsule(0.5 * HEIGHT - RADIUS, RADIUS);
        let near = queries.contacts(&capsule, walk.position(), Quat::IDENTITY, MARGIN, &filter);
        assert!(near.iter().all(|hit| hit.distance > 0.5 * MARGIN), "seed {seed}: {near:?} at {}", walk.position());
        assert!(walk.character.ground().is_some(), "seed {seed}: in the air at {}", walk.position());
    }
}

#[test]
fn it_falls_jumps_and_lands_like_a_stone() {
    let mut walk = Walk::at(floor(), (MIDDLE + 2.0) * Vec3::Y);
    for k in 1..=30 {
        assert!(walk.step(Vec3::ZERO).ground.is_none());
        let expected = MIDDLE + 2.0 - 0.5 * 9.81 * (k as f32 * DT) * (k as f32 * DT);
        assert!((walk.position().y - expected).abs() < 1e-4, "{k} steps: {} m, not {expected}", walk.position().y);
    }
    assert!(walk.steps(30, Vec3::ZERO).ground.is_some());
    assert!((walk.position().y - MIDDLE).abs() < 0.3 * MARGIN, "{}", walk.position());
    walk.character.launch(4.0 * Vec3::Y);
    let mut highest = 0.0_f32;
    for _ in 0..40 {
        walk.step(Vec3::X);
        highest = highest.max(walk.position().y - MIDDLE);
    }
    assert!((highest - 16.0 / (2.0 * 9.81)).abs() < 0.01, "{highest} m");
    walk.steps(30, Vec3::X);
    assert!(walk.character.ground().is_some() && (walk.position().x - 70.0 * DT).abs() < 1e-3, "{}", walk.position());
}

#[test]
fn a_ceiling_ends_a_jump_and_a_low_one_stops_the_walk() {
    let mut world = floor();
    world.insert(block(Vec3::new(5.0, 0.5, 5.0), Vec3::new(0.0, HEIGHT + 0.5 + 0.3, 0.0)));
    world.insert(block(Vec3::new(1.0, 0.5, 5.0), Vec3::new(3.0, HEIGHT + 0.4, 0.0)));
    let mut walk = Walk::at(world, MIDDLE * Vec3::Y);
    walk.step(Vec3::ZERO);
    walk.character.launch(6.0 * Vec3::Y);
    let (mut highest, mut steps) = (0.0_f32, 0);
    while walk.character.ground().is_none() {
        walk.step(Vec3::ZERO);
        highest = highest.max(walk.position().y);
        steps += 1;
    }
    // It is at the ceiling after 0.05 s, and falls by 0.3 m from rest.
    assert!((highest - (0.5 * HEIGHT + 0.3 - MARGIN)).abs() < 1e-3, "{highest} m");
    assert!((14..=20).contains(&steps), "{steps} steps");
    walk.steps(120, 2.0 * Vec3::X);
    let head = walk.position() + (0.5 * HEIGHT - RADIUS) * Vec3::Y;
    let gap = head.distance(Vec3::new(2.0, HEIGHT - 0.1, 0.0)) - RADIUS;
    assert!(gap > 0.5 * MARGIN && gap < 2.0 * MARGIN && walk.position().y < MIDDLE + MARGIN, "{gap} m, {head}");
}

#[test]
fn it_slides_along_a_wall_by_the_part_of_its_walk_along_it() {
    let mut world = floor();
    let turn = Quat::from_rotation_y(0.5);
    world.insert(block(Vec3::new(0.5, 2.0, 20.0), 2.0 * Vec3::Y + 3.0 * Vec3::X).rotation(turn));
    let mut walk = Walk::at(world, MIDDLE * Vec3::Y);
    walk.steps(120, 2.0 * Vec3::X);
    let before = walk.position();
    walk.steps(60, 2.0 * Vec3::X);
    let (normal, along) = (turn * Vec3::X, turn * Vec3::Z);
    let moved = walk.position() - before;
    assert!(moved.dot(normal).abs() < 1e-4 && moved.y.abs() < 1e-4, "{moved}");
    assert!((moved.dot(along) - 2.0 * along.x).abs() < 1e-3, "{moved}");
}

#[test]
fn it_stays_where_it_stands_on_what_moves_and_turns() {
    let spin = 0.8;
    for (name, velocity, angular) in [
        ("a turntable", Vec3::ZERO, spin * Vec3::Y),
        ("a lift", 2.0 * Vec3::Y, Vec3::ZERO),
        ("a fast ferry", Vec3::new(20.0, 0.0, 3.0), Vec3::ZERO),
        ("a ferry that turns and rises", Vec3::new(1.0, 0.5, 0.0), spin * Vec3::Y),
        ("a lift down", -3.0 * Vec3::Y, Vec3::ZERO),
    ] {
        let mut world = World::new();
        let deck = Body::kinematic().shape(Shape::cuboid(3.0, 0.2, 3.0)).velocity(velocity, angular);
        let deck = world.insert(deck);
        let mut walk = Walk::at(world, Vec3::new(2.0, 0.2 + MIDDLE, 0.5));
        walk.character.launch(velocity);
        walk.step(Vec3::ZERO);
        let on_deck = |walk: &Walk| {
            let deck = walk.simulation.world.body(deck).expect("the deck");
            deck.rotation.inverse() * (walk.position() - deck.position)
        };
        let before = on_deck(&walk);
        for k in 0..180 {
            let ground = walk.step(Vec3::ZERO).ground.unwrap_or_else(|| panic!("{name}: in the air in step {k}"));
            assert!(ground.body == deck, "{name}: {ground:?}");
            let slip = on_deck(&walk).distance(before);
            assert!(slip < 2e-3, "{name}: {slip} m after {k} steps");
        }
        // A walk is relative to the deck.
        let before = on_deck(&walk);
        let way = walk.simulation.world.body(deck).expect("the deck").rotation * Vec3::NEG_X;
        walk.step(way);
        assert!((on_deck(&walk).distance(before) - DT).abs() < 1e-3 * DT + 1e-5, "{name}");
    }
}

#[test]
fn a_jump_keeps_the_velocity_of_the_deck() {
    let mut world = World::new();
    world.insert(Body::kinematic().shape(Shape::cuboid(3.0, 0.2, 3.0)).velocity(5.0 * Vec3::X, Vec3::ZERO));
    let mut walk = Walk::at(world, (0.2 + MIDDLE) * Vec3::Y);
    walk.step(Vec3::ZERO);
    walk.step(Vec3::ZERO);
    let before = walk.position();
    walk.character.launch(3.0 * Vec3::Y);
    walk.steps(20, Vec3::ZERO);
    assert!((walk.position().x - before.x - 20.0 * DT * 5.0).abs() < 1e-3, "{}", walk.position() - before);
}

#[test]
fn it_goes_out_of_the_way_of_what_is_driven_at_it() {
    let mut world = floor();
    let wall = Body::kinematic().shape(Shape::cuboid(0.2, 2.0, 2.0)).position(-1.0, 2.0, 0.0);
    world.insert(wall.velocity(2.0 * Vec3::X, Vec3::ZERO));
    let mut walk = Walk::at(world, MIDDLE * Vec3::Y);
    walk.steps(120, Vec3::ZERO);
    let gap = walk.position().x - RADIUS - (-1.0 + 0.2 + 4.0);
    assert!((gap - MARGIN).abs() < 0.2 * MARGIN, "{gap} m at {}", walk.position());
}

fn crates(mass: f32, friction: f32) -> (Walk, BodyHandle) {
    let mut world = floor();
    world.bodies[0].material.friction = friction;
    let crate_ = Body::dynamic().shape(Shape::cuboid(0.5, 0.5, 0.5)).total_mass(mass).friction(friction);
    let crate_ = world.insert(crate_.position(1.0, 0.5, 0.0).locked_rotations([true; 3]));
    (Walk::at(world, MIDDLE * Vec3::Y), crate_)
}

#[test]
fn it_pushes_with_its_force_and_no_more() {
    // Without friction: the acceleration is force / mass until the crate has the speed of the walk.
    let (mut walk, crate_) = crates(100.0, 0.0);
    let speed = |walk: &Walk| walk.simulation.world.body(crate_).expect("the crate").linear_velocity.x;
    while speed(&walk) == 0.0 {
        walk.step(3.0 * Vec3::X);
    }
    let before = speed(&walk);
    walk.steps(15, 3.0 * Vec3::X);
    assert!((speed(&walk) - before - 15.0 * DT * 4.0).abs() < 0.02, "{} m/s after {before}", speed(&walk));
    let mut fastest = 0.0_f32;
    for _ in 0..120 {
        walk.step(3.0 * Vec3::X);
        fastest = fastest.max(speed(&walk));
    }
    assert!(fastest < 3.01 && fastest > 2.9, "{fastest} m/s");
    // Friction holds the first crate with 490 N, and the second with 245 N.
    let (mut walk, crate_) = crates(100.0, 0.5);
    walk.steps(120, 3.0 * Vec3::X);
    let crate_ = walk.simulation.world.body(crate_).expect("the crate");
    assert!((crate_.position.x - 1.0).abs() < 1e-3, "{}", crate_.position);
    assert!((walk.position().x - (0.5 - RADIUS - MARGIN)).abs() < 1e-3, "{}", walk.position());
    let (mut walk, crate_) = crates(50.0, 0.5);
    walk.steps(120, 3.0 * Vec3::X);
    let crate_ = walk.simulation.world.body(crate_).expect("the crate");
    let gap = crate_.position.x - 0.5 - RADIUS - walk.position().x;
    assert!(crate_.position.x > 3.0 && gap > 0.0, "{}, {gap} m", crate_.position);
}

#[test]
fn its_weight_rests_on_what_it_stands_on() {
    let mut world = floor();
    let plank = Body::dynamic().shape(Shape::cuboid(1.0, 0.05, 0.5)).total_mass(20.0).gravity_scale(0.0);
    let plank = world.insert(plank.position(0.0, 3.0, 0.0).locked_rotations([true; 3]));
    let mut walk = Walk::at(world, (3.05 + MIDDLE) * Vec3::Y);
    walk.step(Vec3::ZERO);
    let speed = |walk: &Walk| walk.simulation.world.body(plank).expect("the plank").linear_velocity.y;
    let before = speed(&walk);
    walk.steps(10, Vec3::ZERO);
    // 80 kg weigh on 20 kg that do not weigh anything.
    let fell = speed(&walk) - before;
    assert!((fell + 10.0 * DT * 4.0 * 9.81).abs() < 0.02 * 6.54, "{fell} m/s");
    assert!(walk.character.ground().is_some_and(|ground| ground.body == plank));
}

/// A room full of turned boxes, and a free place in it.
fn room(random: &mut Random) -> (World, Vec3) {
    let mut world = floor();
    for side in [Vec3::X, Vec3::NEG_X, Vec3::Z, Vec3::NEG_Z, Vec3::Y] {
        let half = 0.02 * side.abs() + 4.0 * (Vec3::ONE - side.abs());
        world.insert(block(half, 4.0 * side + 2.0 * Vec3::Y));
    }
    for _ in 0..14 {
        let half = Vec3::from_array([0; 3].map(|_| random.within(0.02, 1.0)));
        let place = random.vector(3.5) + 1.5 * Vec3::Y;
        let turn = if random.happens(0.4) { random.rotation() } else { Quat::from_rotation_y(random.within(0.0, 3.0)) };
        world.insert(block(half, place).rotation(turn));
    }
    let capsule = Shape::capsule(0.5 * HEIGHT - RADIUS + MARGIN, RADIUS + MARGIN);
    let mut draw = || Vec3::new(random.within(-3.6, 3.6), random.within(1.0, 3.0), random.within(-3.6, 3.6));
    let queries = Queries::of(&world);
    let is_free = |at: &Vec3| queries.intersecting(&capsule, *at, Quat::IDENTITY, &Filter::default()).is_empty();
    let place = std::iter::repeat_with(&mut draw).find(is_free).expect("a free place");
    (world, place)
}

/// Walks through a room to and fro at up to 300 m/s; returns the smallest gap and a hash of the way.
fn wander(seed: u64, steps: u32) -> (f32, u64) {
    let mut random = Random::new(seed);
    let (world, place) = room(&mut random);
    let mut walk = Walk::at(world, place);
    let (mut velocity, mut least, mut hash) = (Vec3::ZERO, f32::INFINITY, 0_u64);
    let capsule = Shape::capsule(0.5 * HEIGHT - RADIUS, RADIUS);
    for k in 0..steps {
        if k % 8 == 0 {
            let speed = [1.0, 5.0, 30.0, 300.0][random.below(4) as usize];
            velocity = speed * random.vector(1.0);
            if random.happens(0.2) {
                walk.character.launch(random.within(1.0, 20.0) * Vec3::Y);
            }
        }
        walk.step(velocity);
        let at = walk.position();
        let inside = at.x.abs() < 4.0 - RADIUS && at.z.abs() < 4.0 - RADIUS && at.y > 0.0 && at.y < 6.0;
        assert!(inside, "seed {seed}, step {k}: outside at {at}");
        let (filter, queries) = (Filter::default().except(walk.character.body), walk.simulation.queries());
        assert_eq!(
            queries.intersecting(&capsule, at, Quat::IDENTITY, &filter),
            [],
            "seed {seed}, step {k}: in at {at}"
        );
        let near = queries.contacts(&capsule, at, Quat::IDENTITY, MARGIN, &filter);
        let gap = near.iter().map(|hit| hit.distance).fold(MARGIN, f32::min);
        assert!(gap > 0.5 * MARGIN, "seed {seed}, step {k}: {gap} m at {at}, {near:?}");
        least = least.min(gap);
        let bits = at.to_array().map(f32::to_bits);
        hash = bits.iter().fold(hash, |hash, &bits| (hash ^ u64::from(bits)).wrapping_mul(0x100_0000_01b3));
    }
    (least, hash)
}

#[test]
fn in_random_rooms_it_keeps_its_margin_at_any_speed() {
    let least = (0..1000_u64).into_par_iter().map(|seed| wander(seed, 48).0).reduce(|| f32::INFINITY, f32::min);
    println!("the smallest gap is {least} m, of a margin of {MARGIN} m");
    assert!(least > 0.5 * MARGIN);
}

#[test]
fn the_number_of_threads_changes_no_bit_of_a_walk() {
    let ways = [1, 2, 5].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
        pool.install(|| [3, 8, 21].map(|seed| wander(seed, 64).1))
    });
    assert!(ways[0] == ways[1] && ways[0] == ways[2], "{ways:?}");
}

#[test]
fn a_copy_goes_on_to_the_same_bits() {
    let mut walk = Walk::at(stairs(0.18, 12), MIDDLE * Vec3::Y);
    walk.steps(20, 2.0 * Vec3::X);
    let (snapshot, character) = (walk.simulation.snapshot(), walk.character);
    walk.steps(20, 2.0 * Vec3::X);
    let end = walk.position();
    walk.simulation.restore(&snapshot);
    walk.character = character;
    walk.steps(20, 2.0 * Vec3::X);
    assert_eq!(walk.position(), end);
}

/// Up and down stairs, in a jump and after it, with every step through bytes.
#[test]
fn a_character_that_goes_through_bytes_walks_on_to_the_same_bits() {
    let mut walk = Walk::at(stairs(0.18, 12), MIDDLE * Vec3::Y);
    let mut loaded = Walk::at(stairs(0.18, 12), MIDDLE * Vec3::Y);
    for step in 0..90 {
        for walk in [&mut walk, &mut loaded] {
            if step == 40 {
                walk.character.launch(3.0 * Vec3::Y);
            }
        }
        let (bytes, character) = (loaded.simulation.save(), loaded.character.save());
        loaded.simulation = Simulation::load(&bytes, Box::new(Reference::<f32>::new())).expect("a saved run");
        loaded.character = Character::load(&character).expect("a saved character");
        assert_eq!(loaded.step(2.0 * Vec3::X), walk.step(2.0 * Vec3::X), "step {step}");
    }
    let bytes = walk.character.save();
    for at in 0..bytes.len() {
        let mut damaged = bytes.clone();
        damaged[at] ^= 1 << (at % 8);
        for bytes in [&damaged[..], &bytes[..at]] {
            let line = Character::load(bytes).expect_err("a refusal").to_string();
            assert!(line.starts_with("a saved character cannot be loaded: ") && !line.contains('\n'), "{line}");
        }
    }
    let line = Character::load(&walk.simulation.save()).expect_err("a refusal").to_string();
    assert!(line.ends_with("these bytes are not a saved character"), "{line}");
}

/// A wall that does not count lets it through, a deck that does not count lets it fall, and another wall still stops it.
#[test]
fn only_bodies_that_count_stop_and_carry_a_character() {
    let mut world = floor();
    let ghost = world.insert(block(Vec3::new(0.2, 2.0, 2.0), Vec3::new(2.0, 2.0, 0.0)));
    world.insert(block(Vec3::new(0.2, 2.0, 2.0), Vec3::new(4.0, 2.0, 0.0)));
    let mut walk = Walk::at(world, MIDDLE * Vec3::Y);
    for _ in 0..180 {
        let counts = |other: BodyHandle, _: &Body| other != ghost;
        walk.character.walk_among(&mut walk.simulation, 2.0 * Vec3::X, DT, &counts).expect("a walk");
        walk.simulation.step(DT).expect("a step");
    }
    assert!((walk.position().x - (3.8 - RADIUS - MARGIN)).abs() < 1e-3, "{}", walk.position());
    for _ in 0..60 {
        walk.character.walk_among(&mut walk.simulation, Vec3::ZERO, DT, &|_, _| false).expect("a walk");
        walk.simulation.step(DT).expect("a step");
    }
    // It leaves the ground in the first step, and falls for the others.
    let fallen = 0.5 * 9.81 * (59.0 / 60.0_f32).powi(2);
    assert!((walk.position().y - MIDDLE + fallen).abs() < 1e-3, "{}", walk.position());
}

#[test]
fn a_character_of_any_size_walks_alike() {
    let path = |size: f32| {
        let mut world = floor();
        world.gravity *= size;
        world.insert(block(size * Vec3::new(2.0, 0.1, 5.0), size * Vec3::new(3.0, 0.1, 0.0)));
        let capsule = Shape::capsule(size * (0.5 * HEIGHT - RADIUS), size * RADIUS);
        let mut walk = Walk::with(world, Body::kinematic().shape(capsule).position(0.0, size * MIDDLE, 0.0));
        walk.steps(90, 1.5 * size * Vec3::X);
        walk.position() / size
    };
    for size in [0.125, 16.0] {
        assert!(path(size).distance(path(1.0)) < 1e-4, "{size}: {}, not {}", path(size), path(1.0));
    }
}

#[test]
fn other_shapes_walk_too() {
    for (name, shape, half) in [
        ("ball", Shape::ball(0.5), 0.5),
        ("cuboid", Shape::cuboid(0.3, 0.9, 0.2), 0.9),
        ("cylinder", Shape::cylinder(0.9, 0.3), 0.9),
    ] {
        let mut world = floor();
        world.insert(block(Vec3::new(2.0, 0.05, 5.0), Vec3::new(3.0, 0.05, 0.0)));
        world.insert(block(Vec3::new(0.5, 2.0, 5.0), Vec3::new(4.5, 2.0, 0.0)));
        let margin = 0.02 * shape.smallest_half_extent();
        let mut walk = Walk::with(world, Body::kinematic().shape(shape).position(0.0, half + margin, 0.0));
        let movement = walk.steps(240, Vec3::new(2.0, 0.0, 0.5));
        let at = walk.position();
        assert!((at.y - half - 0.1 - margin).abs() < 0.5 * margin && (at.z - 2.0).abs() < 0.05, "{name}: {at}");
        assert!(movement.ground.is_some() && movement.contacts.len() == 2, "{name}: {movement:?}");
    }
}

#[test]
fn between_two_steep_slopes_it_stands() {
    let mut world = World::new();
    for side in [1.0, -1.0] {
        let turn = Quat::from_rotation_z(side * 1.0);
        world.insert(block(Vec3::new(3.0, 0.5, 5.0), turn * Vec3::new(side * 2.9, -0.5, 0.0)).rotation(turn));
    }
    let mut walk = Walk::at(world, 3.0 * Vec3::Y);
    let movement = walk.steps(120, Vec3::ZERO);
    assert!(movement.ground.is_some_and(|ground| ground.normal == Vec3::Y), "{movement:?}");
    // It walks along the valley, and the slopes stop it across.
    let before = walk.position();
    walk.steps(60, Vec3::Z);
    assert!((walk.position() - before - Vec3::Z).length() < 1e-2, "{}", walk.position() - before);
}

#[test]
fn a_character_without_a_good_body_is_refused_in_one_line() {
    let refused = |body: Body, change: fn(&mut Character), velocity: Vec3| {
        let mut walk = Walk::with(floor(), body.named("walker").position(0.0, 2.0, 0.0));
        change(&mut walk.character);
        let error = walk.character.walk(&mut walk.simulation, velocity, DT).expect_err("refused");
        assert_eq!(walk.position(), 2.0 * Vec3::Y);
        error.to_string()
    };
    let ball = || Body::kinematic().shape(Shape::ball(0.5));
    let refused_body = |body: Body| refused(body, |_| {}, Vec3::X);
    assert!(refused_body(Body::dynamic().shape(Shape::ball(0.5))).contains("must be kinematic"));
    assert!(refused_body(Body::kinematic()).contains("must have shapes"));
    assert!(refused_body(Body::kinematic().sensor(Shape::ball(0.5))).contains("must have shapes"));
    assert!(refused(ball(), |_| {}, f32::NAN * Vec3::X).contains("velocity = "));
    assert!(refused(ball(), |character| character.up = Vec3::ZERO, Vec3::X).contains("up = "));
    assert!(refused(ball(), |character| character.steepest = 2.0, Vec3::X).contains("steepest = 2"));
    assert!(refused(ball(), |character| character.step_height = -1.0, Vec3::X).contains("step_height = -1"));
    assert!(refused(ball(), |character| character.margin = 0.0, Vec3::X).contains("margin = 0"));
    assert!(refused(ball(), |character| character.push_force = f32::NAN, Vec3::X).contains("push_force = NaN"));
    let mut walk = Walk::with(floor(), ball());
    walk.simulation.world.remove(walk.character.body);
    let error = walk.character.walk(&mut walk.simulation, Vec3::X, DT).expect_err("refused");
    assert!(error.to_string().contains("was removed"), "{error}");
}

#[test]
fn a_belt_takes_a_character_along_and_its_walk_adds_to_that() {
    let mut world = World::new();
    let belt = Body::fixed().shape(Shape::cuboid(20.0, 0.5, 2.0)).position(0.0, -0.5, 0.0);
    let mut belt = belt.rotation(Quat::from_rotation_y(0.4));
    belt.material.surface_velocity = Vec3::X * 1.5;
    world.insert(belt);
    let along = Quat::from_rotation_y(0.4) * Vec3::X;
    let mut walk = Walk::at(world, Vec3::Y * (MIDDLE + 0.01));
    walk.steps(30, Vec3::ZERO);
    let from = walk.position();
    let ground = walk.steps(60, Vec3::ZERO).ground.expect("the belt");
    assert!((ground.velocity - along * 1.5).length() < 1e-3, "{}", ground.velocity);
    let stood = walk.position();
    assert!((stood - from - along * 1.5).length() < 1e-2, "{}", stood - from);
    walk.steps(60, along * -2.0);
    let walked = walk.position() - stood;
    assert!((walked + along * 0.5).length() < 1e-2, "{walked}");
    // A jump keeps the velocity of the belt.
    let before = walk.position();
    walk.character.launch(Vec3::Y * 3.0);
    walk.steps(12, Vec3::ZERO);
    let flown = walk.position() - before;
    assert!((flown - flown.y * Vec3::Y - along * 0.3).length() < 1e-2, "{flown}");
}
