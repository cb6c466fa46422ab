//! Questions about where bodies are, against all colliders one by one and against closed forms.

use crate::common::random::Random;
use drystone::glam::{Quat, Vec3};
use drystone::queries::{Filter, Found, Hit, Queries};
use drystone::world::MAX_LENGTH;
use drystone::{Body, BodyKind, Groups, Shape, Simulation, World};
use parry3d::math::Pose;
use parry3d::query::{self, Ray, ShapeCastOptions};

const DT: f32 = 1.0 / 60.0;

fn simulation(world: World) -> Simulation {
    Simulation::new(world).expect("a good world")
}

fn hull() -> Shape {
    let corner = |k: usize| {
        let turn = 2.4 * k as f32;
        Vec3::new(0.5 * turn.cos(), -0.4 + 0.07 * k as f32, 0.5 * turn.sin())
    };
    Shape::convex_hull(&(0..12).map(corner).collect::<Vec<_>>()).expect("a hull")
}

/// Any shape that a moving body can have.
fn solid(random: &mut Random) -> Shape {
    let mut size = || random.within(0.15, 0.6);
    let (a, b, c) = (size(), size(), size());
    match random.below(6) {
        0 => Shape::ball(a),
        1 => Shape::cuboid(a, b, c),
        2 => Shape::capsule(a, b),
        3 => Shape::cylinder(a, b),
        4 => Shape::cone(a, b),
        _ => hull(),
    }
}

fn body(random: &mut Random) -> Body {
    let place = random.vector(5.0);
    let mut body = Body::dynamic().position(place.x, 6.0 + place.y, place.z).rotation(random.rotation());
    body = body.shape(solid(random));
    if random.happens(0.2) {
        body = body.shape_at(solid(random), random.vector(0.5), random.rotation());
    }
    let bits = |random: &mut Random| 1 + random.below(7);
    body.groups(Groups { membership: bits(random), filter: 8 | bits(random) })
}

/// A floor, a mesh, a height field and a wall in the way of balls, stones and sticks.
fn scenery(world: &mut World) {
    let rows: Vec<Vec<f32>> = (0..9).map(|i| (0..9).map(|j| (0.9 * (i * j) as f32).sin()).collect()).collect();
    let tilted = Quat::from_rotation_z(0.4);
    let vertices = vec![Vec3::ZERO, Vec3::new(0.0, 0.3, 4.0), Vec3::new(4.0, 0.0, 0.0), Vec3::new(4.0, 1.0, 4.0)];
    let mesh = Shape::mesh(vertices, vec![[0, 1, 2], [2, 1, 3]]).expect("a mesh");
    let field = Shape::height_field(&rows, Vec3::new(8.0, 0.5, 8.0)).expect("a field");
    world.insert(Body::fixed().shape(Shape::half_space(Vec3::Y)).position(0.0, -0.5, 0.0));
    world.insert(Body::fixed().shape(field).position(-4.0, 0.5, -4.0));
    world.insert(Body::fixed().shape(mesh).position(1.0, 1.0, 1.0).rotation(tilted));
    world.insert(Body::kinematic().shape(Shape::cuboid(0.2, 3.0, 6.0)).position(6.0, 3.0, 0.0));
}

fn each_collider<'a>(world: &'a World, filter: &Filter<'a>) -> Vec<(Found, &'a Shape, Pose)> {
    let mut all = Vec::new();
    for handle in world.bodies.handles() {
        let body = world.body(handle).expect("a body");
        let is_here = world.bodies.worlds()[handle.index()] as usize == filter.world;
        let is_met = filter.groups.meets(body.groups) && filter.except != Some(handle);
        if is_here && is_met && filter.only.is_none_or(|only| only(handle, body)) {
            for (k, c) in body.colliders.iter().enumerate() {
                let own = Pose::from_parts(body.position, body.rotation) * Pose::from_parts(c.position, c.rotation);
                all.push(((handle, k), &c.shape, own));
            }
        }
    }
    all
}

fn is_surface(shape: &Shape) -> bool {
    !shape.has_volume() && !shape.is_half_space()
}

/// Distances as parry gives them for each collider.
type Distances = Vec<(Found, f32)>;

/// Compares a nearest collider with the distances to all. Nearly equal ones may change places.
fn assert_nearest(what: &str, hit: Option<Hit>, mut all: Distances) {
    all.sort_by(|a, b| a.1.total_cmp(&b.1));
    let Some(hit) = hit else { panic!("{what}: nothing, but {:?}", all.first()) };
    let Some(own) = all.iter().find(|(found, _)| *found == (hit.body, hit.collider)) else {
        panic!("{what}: {hit:?}, but {:?}", all.first());
    };
    let near = 2e-3 * hit.distance.abs().max(1.0);
    assert!((own.1 - hit.distance).abs() < near, "{what}: {hit:?}, but {own:?}");
    assert!(own.1 - all[0].1 < near, "{what}: {hit:?}, but {:?}", all[0]);
    assert!(hit.normal.is_normalized() && hit.point.is_finite(), "{what}: {hit:?}");
}

fn check(world: &World, queries: &Queries, random: &mut Random, filter: &Filter) -> [usize; 5] {
    let mut met = [0; 5];
    let all = each_collider(world, filter);
    let place = |random: &mut Random| random.vector(7.0) + 4.0 * Vec3::Y;
    for _ in 0..40 {
        // A ray.
        let (origin, direction, most) = (place(random), random.vector(1.0), random.within(1.0, 20.0));
        let unit = direction.normalize();
        let cast = |(found, shape, pose): &(Found, &Shape, Pose)| {
            Some((*found, shape.parry().cast_ray(pose, &Ray::new(origin, unit), most, true)?))
        };
        let expected: Distances = all.iter().filter_map(cast).collect();
        met[0] += usize::from(!expected.is_empty());
        let hit = queries.ray(origin, direction, most, filter);
        if hit.is_some() || !expected.is_empty() {
            assert_nearest("ray", hit, expected.clone());
        }
        let mut every: Vec<Found> = expected.iter().map(|(found, _)| *found).collect();
        let hits = queries.ray_all(origin, direction, most, filter);
        assert!(hits.is_sorted_by(|a, b| a.distance <= b.distance) && hits.first().copied() == hit);
        let mut found: Vec<Found> = hits.iter().map(|hit| (hit.body, hit.collider)).collect();
        every.sort_unstable();
        found.sort_unstable();
        assert_eq!(found, every, "ray from {origin} along {unit}");

        // A point.
        let inside = |(_, shape, pose): &&(Found, &Shape, Pose)| {
            !is_surface(shape) && shape.parry().contains_point(pose, origin)
        };
        let expected: Vec<Found> = all.iter().filter(inside).map(|(found, ..)| *found).collect();
        met[1] += usize::from(!expected.is_empty());
        assert_eq!(queries.point(origin, filter), expected, "point {origin}");

        // A box.
        let (lower, upper) = (origin - random.within(0.0, 1.0), origin + random.within(0.0, 1.0));
        let reaches = |(_, shape, pose): &&(Found, &Shape, Pose)| {
            let aabb = shape.parry().compute_aabb(pose);
            let is_below = |n: Vec3| (Vec3::select(n.cmpgt(Vec3::ZERO), lower, upper) - pose.translation).dot(n) <= 0.0;
            aabb.mins.cmple(upper).all() && aabb.maxs.cmpge(lower).all() && shape.as_half_space().is_none_or(is_below)
        };
        let expected: Vec<Found> = all.iter().filter(reaches).map(|(found, ..)| *found).collect();
        met[2] += usize::from(!expected.is_empty());
        assert_eq!(queries.overlapping(lower, upper, filter), expected, "box {lower} {upper}");

        // The nearest surface.
        let distance = |(found, shape, pose): &(Found, &Shape, Pose)| {
            let to = shape.parry().project_point(pose, origin, false);
            let away = to.point.distance(origin);
            let signed = if to.is_inside && !is_surface(shape) { -away } else { away };
            (signed <= most).then_some((*found, signed))
        };
        let expected: Distances = all.iter().filter_map(distance).collect();
        met[3] += usize::from(!expected.is_empty());
        let hit = queries.closest(origin, most, filter);
        if hit.is_some() || !expected.is_empty() {
            assert_nearest("closest", hit, expected);
            let Hit { point, normal, distance, .. } = hit.expect("a collider");
            assert!((point + distance * normal).distance(origin) < 1e-3, "{hit:?} of {origin}");
        }

        // A shape that moves.
        let (shape, turn) = (solid(random), random.rotation());
        let own = Pose::from_parts(origin, turn);
        let options = ShapeCastOptions::with_max_time_of_impact(most);
        let cast = |(found, fixed, pose): &(Found, &Shape, Pose)| {
            let (fixed, moving) = (&**fixed.parry(), &**shape.parry());
            let hit = query::cast_shapes(pose, Vec3::ZERO, fixed, &own, unit, moving, options).expect("supported")?;
            Some((*found, hit.time_of_impact))
        };
        let expected: Distances = all.iter().filter_map(cast).collect();
        met[4] += usize::from(!expected.is_empty());
        let hit = queries.cast(&shape, origin, turn, direction, most, filter);
        if hit.is_some() || !expected.is_empty() {
            assert_nearest("cast", hit, expected);
        }
    }
    met
}

#[test]
fn answers_are_those_of_all_colliders_one_by_one_in_worlds_that_change() {
    let mut random = Random::new(7);
    let mut met = [0; 5];
    for _ in 0..3 {
        let mut worlds = [World::new(), World::new()];
        for world in &mut worlds {
            scenery(world);
            for _ in 0..120 {
                world.insert(body(&mut random));
            }
        }
        let [mut world, other] = worlds;
        world.beside(&other);
        let mut simulation = simulation(world);
        for round in 0..12 {
            for _ in 0..[0, 1, 10][round % 3] {
                simulation.step(DT).expect("a step");
            }
            // The tree has not seen these changes.
            let handles: Vec<_> = simulation.world.bodies.handles().collect();
            for _ in 0..if round % 4 == 1 { 20 } else { 2 } {
                let chosen = handles[random.below(handles.len() as u32) as usize];
                let new = body(&mut random);
                match random.below(4) {
                    0 => drop(simulation.world.remove(chosen)),
                    1 => {
                        simulation.world.insert_in(random.below(2) as usize, new).expect("a world");
                    }
                    _ => {
                        let Some(old) = simulation.world.body_mut(chosen).filter(|b| b.kind == BodyKind::Dynamic)
                        else {
                            continue;
                        };
                        (old.position, old.rotation) = (new.position, new.rotation);
                        if random.happens(0.5) {
                            (old.colliders, old.mass) = (new.colliders, new.mass);
                        }
                    }
                }
            }
            let except = simulation.world.bodies.handles().nth(9).expect("a body");
            let is_even = |handle: drystone::BodyHandle, _: &Body| handle.index().is_multiple_of(2);
            let all = Filter::default();
            for filter in
                [all, all.world(1), all.groups(Groups { membership: 8, filter: 3 }).except(except), all.only(&is_even)]
            {
                let counts = check(&simulation.world, &simulation.queries(), &mut random, &filter);
                met.iter_mut().zip(counts).for_each(|(met, count)| *met += count);
            }
        }
    }
    println!("{met:?} questions of {} met something", 3 * 12 * 4 * 40);
    assert!(met.iter().all(|&met| met > 300), "{met:?}");
}

/// A floor, and a ball of radius 0.5 m at a height of 2 m.
fn ball_over_floor() -> (World, drystone::BodyHandle, drystone::BodyHandle) {
    let mut world = World::new();
    let floor = world.insert(Body::fixed().shape(Shape::half_space(Vec3::Y)));
    let ball = world.insert(Body::dynamic().shape(Shape::ball(0.5)).position(0.0, 2.0, 0.0));
    (world, floor, ball)
}

#[test]
fn a_ray_meets_a_ball_where_the_line_does() {
    let (world, floor, ball) = ball_over_floor();
    let queries = Queries::of(&world);
    let all = Filter::default();
    // 0.3 m beside the center the surface is 0.4 m away from the middle plane, from any distance.
    for away in [2.0, 1e2, 1e4] {
        let hit = queries.ray(Vec3::new(-away, 2.3, 0.0), 7.0 * Vec3::X, 1e5, &all).expect("the ball");
        assert_eq!((hit.body, hit.collider), (ball, 0));
        assert!((hit.distance - (away - 0.4)).abs() < 1e-6 * away, "{away}: {hit:?}");
        assert!(hit.point.distance(Vec3::new(-0.4, 2.3, 0.0)) < 1e-5 + 1e-7 * away, "{away}: {hit:?}");
        assert!(hit.normal.distance(Vec3::new(-0.8, 0.6, 0.0)) < 1e-4 + 1e-6 * away, "{away}: {hit:?}");
        assert!(queries.ray(Vec3::new(-away, 2.51, 0.0), Vec3::X, 1e5, &all).is_none());
    }
    let down = |most: f32| queries.ray_all(Vec3::new(0.3, 10.0, 0.0), Vec3::NEG_Y, most, &all);
    let hits = down(100.0);
    assert_eq!(hits.iter().map(|hit| hit.body).collect::<Vec<_>>(), [ball, floor]);
    assert!((hits[0].distance - 7.6).abs() < 1e-5 && (hits[1].distance - 10.0).abs() < 1e-5);
    assert_eq!([down(9.9).len(), down(7.5).len()], [1, 0]);
    // From inside.
    let hit = queries.ray(Vec3::new(0.1, 2.0, 0.0), Vec3::X, 1.0, &all).expect("the ball");
    assert_eq!((hit.distance, hit.normal, hit.point), (0.0, Vec3::NEG_X, Vec3::new(0.1, 2.0, 0.0)));
}

#[test]
fn a_shape_that_moves_meets_a_plane_where_its_lowest_point_does() {
    let (world, floor, ball) = ball_over_floor();
    let queries = Queries::of(&world);
    let except = Filter::default().except(ball);
    // Along (3, -4, 0) / 5 the center falls 0.8 m a meter.
    let along = Vec3::new(3.0, -4.0, 0.0);
    for height in [1.0, 7.0, 1000.0] {
        let start = Vec3::new(0.0, height, 0.0);
        let hit = queries.cast(&Shape::ball(0.25), start, Quat::IDENTITY, along, 1e4, &except).expect("the floor");
        let expected = (height - 0.25) / 0.8;
        assert!((hit.distance - expected).abs() < 1e-5 * height && hit.body == floor, "{height}: {hit:?}");
        assert!(hit.point.distance(Vec3::new(0.6 * expected, 0.0, 0.0)) < 1e-5 * height, "{height}: {hit:?}");
        assert!(hit.normal.distance(Vec3::Y) < 1e-6);
        assert!(queries.cast(&Shape::ball(0.25), start, Quat::IDENTITY, -along, 1e4, &except).is_none());
    }
    // Two balls meet where their centers are as far apart as their radii together.
    let ray = |shape: &Shape, y: f32| {
        queries.cast(shape, Vec3::new(-5.0, y, 0.0), Quat::IDENTITY, Vec3::X, 100.0, &Filter::default())
    };
    let hit = ray(&Shape::ball(0.5), 2.6).expect("the ball");
    assert!((hit.distance - 4.2).abs() < 1e-5 && hit.point.distance(Vec3::new(-0.4, 2.3, 0.0)) < 1e-5, "{hit:?}");
    assert!(hit.normal.distance(Vec3::new(-0.8, 0.6, 0.0)) < 1e-4, "{hit:?}");
    assert!(ray(&Shape::ball(0.5), 3.01).is_none());
    // A shape that overlaps at the beginning is hit at once, in any direction.
    for direction in [Vec3::X, Vec3::NEG_X, Vec3::Y] {
        let start = Vec3::new(0.7, 2.0, 0.0);
        let hit =
            queries.cast(&Shape::cuboid(0.3, 0.3, 0.3), start, Quat::IDENTITY, direction, 1.0, &Filter::default());
        let hit = hit.expect("the ball");
        assert!(hit.distance == 0.0 && hit.body == ball && hit.normal.distance(Vec3::X) < 1e-3, "{hit:?}");
    }
}

#[test]
fn no_ray_passes_between_the_triangles_of_a_surface() {
    let mut random = Random::new(7);
    for rough in [0.0, 0.3] {
        let rows: Vec<Vec<f32>> = (0..9).map(|_| (0..9).map(|_| rough * random.within(0.0, 1.0)).collect()).collect();
        let field = Shape::height_field(&rows, Vec3::new(3.0, 1.0, 5.0)).expect("a field");
        let (corners, triangles) = field.triangles();
        let mesh = Shape::mesh(corners.clone(), triangles.clone()).expect("a mesh");
        // Corners, and points of edges, that do not lie on the border.
        let is_inner = |p: &Vec3| p.x.abs() < 1.49 && p.z.abs() < 2.49;
        let edges = triangles.iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]);
        let places: Vec<Vec3> = edges
            .map(|edge| edge.map(|corner| corners[corner as usize]))
            .flat_map(|[a, b]| [0.0, 0.5, 0.3].map(|share| a + share * (b - a)))
            .filter(is_inner)
            .collect();
        let turn = Quat::from_scaled_axis(Vec3::new(0.3, -0.5, 0.2));
        for (position, rotation) in [(Vec3::ZERO, Quat::IDENTITY), (Vec3::new(3.0, 5.0, 7.0), turn)] {
            for shape in [&field, &mesh] {
                let mut world = World::new();
                let place = Body::fixed().position(position.x, position.y, position.z).rotation(rotation);
                world.insert(place.shape(shape.clone()));
                let queries = Queries::of(&world);
                for &place in &places {
                    let mut aside = || Vec3::new(random.within(-1.0, 1.0), 0.0, random.within(-1.0, 1.0));
                    for from in [Vec3::ZERO, Vec3::X, Vec3::NEG_Z, aside()].map(|aside| place + aside + 2.0 * Vec3::Y) {
                        let [from, at] = [from, place].map(|p| position + rotation * p);
                        let hit = queries.ray(from, at - from, 10.0, &Filter::default());
                        let hit =
                            hit.unwrap_or_else(|| panic!("{shape:?}: a ray from {from} through {at} meets nothing"));
                        let excess = hit.distance - from.distance(at);
                        assert!(excess < 1e-4 && (rough > 0.0 || excess > -1e-4), "{excess} m beyond {at}");
                        assert!(hit.normal.dot(at - from) < 0.0, "{}", hit.normal);
                    }
                }
            }
        }
    }
}

#[test]
fn the_nearest_surface_has_a_distance_with_a_sign_and_an_outward_normal() {
    let (mut world, floor, ball) = ball_over_floor();
    let field = Shape::height_field(&[vec![0.0; 3], vec![0.0; 3], vec![0.0; 3]], Vec3::splat(2.0)).expect("a field");
    let ledge = world.insert(Body::fixed().shape(field).position(5.0, 4.0, 0.0));
    let block = world.insert(Body::fixed().shape(Shape::cuboid(1.0, 1.0, 1.0)).position(-5.0, 4.0, 0.0));
    let queries = Queries::of(&world);
    let cases = [
        (Vec3::new(1.5, 2.0, 0.0), ball, 1.0, Vec3::X),
        (Vec3::new(0.3, 2.0, 0.0), ball, -0.2, Vec3::X),
        (Vec3::new(0.0, 2.0, 0.5), ball, 0.0, Vec3::Z),
        (Vec3::new(3.0, 0.5, 0.0), floor, 0.5, Vec3::Y),
        (Vec3::new(3.0, -0.5, 0.0), floor, -0.5, Vec3::Y),
        (Vec3::new(3.0, 0.0, 0.0), floor, 0.0, Vec3::Y),
        // A surface has two sides.
        (Vec3::new(5.1, 4.2, 0.3), ledge, 0.2, Vec3::Y),
        (Vec3::new(5.1, 3.8, 0.3), ledge, 0.2, Vec3::NEG_Y),
        (Vec3::new(5.1, 4.0, 0.3), ledge, 0.0, Vec3::Y),
        (Vec3::new(-5.0, 4.0, 0.9), block, -0.1, Vec3::Z),
        (Vec3::new(-5.0, 4.3, 1.0), block, 0.0, Vec3::Z),
        (Vec3::new(-7.0, 4.3, 0.5), block, 1.0, Vec3::NEG_X),
    ];
    for (point, body, distance, normal) in cases {
        let hit = queries.closest(point, 10.0, &Filter::default()).expect("a body");
        assert!(hit.body == body && (hit.distance - distance).abs() < 1e-5, "{point}: {hit:?}");
        assert!(hit.normal.distance(normal) < 1e-4, "{point}: {hit:?}");
        assert!(hit.point.distance(point - distance * normal) < 1e-5, "{point}: {hit:?}");
    }
    assert!(queries.closest(Vec3::new(0.0, 30.0, 0.0), 10.0, &Filter::default()).is_none());
}

#[test]
fn a_shape_finds_what_it_overlaps() {
    let mut random = Random::new(3);
    let mut world = World::new();
    scenery(&mut world);
    for _ in 0..200 {
        world.insert(body(&mut random));
    }
    let queries = Queries::of(&world);
    let mut counts = [0; 2];
    for k in 0..600 {
        let (place, turn) = (random.vector(6.0) + 5.0 * Vec3::Y, random.rotation());
        // Points in the shape say that it overlaps what contains them; from a shape that is nowhere near, nothing is said.
        let radius = 0.7;
        let found = queries.intersecting(&Shape::ball(radius), place, turn, &Filter::default());
        let all = each_collider(&world, &Filter::default());
        for (own, shape, pose) in &all {
            let to = shape.parry().project_point(pose, place, true);
            let distance = if to.is_inside && !is_surface(shape) { 0.0 } else { to.point.distance(place) };
            if (distance - radius).abs() > 1e-3 {
                assert_eq!(found.contains(own), distance < radius, "{k}: {own:?} {shape:?} at {distance}");
                counts[usize::from(distance < radius)] += 1;
            }
        }
        // Any shape overlaps what a shape that it contains overlaps, and nothing that a shape around it does not.
        let shape = solid(&mut random);
        let found = queries.intersecting(&shape, place, turn, &Filter::default());
        let around =
            queries.intersecting(&Shape::ball(shape.bounding_radius() + 1e-3), place, turn, &Filter::default());
        assert!(found.iter().all(|body| around.contains(body)));
        let within = queries.point(place, &Filter::default());
        assert!(!shape.parry().contains_local_point(Vec3::ZERO) || within.iter().all(|body| found.contains(body)));
    }
    assert!(counts.iter().all(|&count| count > 300), "{counts:?}");
}

/// parry alone has no test for height fields, and a point of a triangle is inside of it.
#[test]
fn shapes_overlap_surfaces_where_they_cross_them() {
    let flat = vec![
        Vec3::new(-1.0, 0.0, -1.0),
        Vec3::new(-1.0, 0.0, 1.0),
        Vec3::new(1.0, 0.0, -1.0),
        Vec3::new(0.9, 2.0, 0.9),
    ];
    let surfaces = [
        Shape::mesh(flat, vec![[0, 1, 2], [1, 3, 2]]).expect("a mesh"),
        Shape::height_field(&[vec![0.0, 0.0], vec![0.0, 1.0]], Vec3::new(2.0, 2.0, 2.0)).expect("a field"),
    ];
    for surface in surfaces {
        let mut world = World::new();
        let handle = world.insert(Body::fixed().shape(surface).position(3.0, 0.0, 0.0));
        let queries = Queries::of(&world);
        for shape in [Shape::ball(0.1), Shape::cuboid(0.1, 0.1, 0.1), Shape::cylinder(0.1, 0.1)] {
            let at = |x: f32, y: f32, z: f32| {
                queries.intersecting(&shape, Vec3::new(x, y, z), Quat::IDENTITY, &Filter::default())
            };
            assert_eq!(at(2.5, 0.05, -0.5), [(handle, 0)], "{shape:?}");
            assert_eq!(at(2.5, -0.05, -0.5), [(handle, 0)], "{shape:?}");
            assert!(at(2.5, 0.3, -0.5).is_empty(), "{shape:?}");
            // In the box of the surface, behind it.
            assert!(at(3.8, 0.3, 0.8).is_empty(), "{shape:?}");
        }
        for point in [Vec3::new(3.8, 0.3, 0.8), Vec3::new(2.0, 0.0, -1.0), Vec3::new(2.5, 0.0, -0.5)] {
            assert!(queries.point(point, &Filter::default()).is_empty());
        }
    }
}

#[test]
fn equal_answers_go_by_index() {
    let mut world = World::new();
    let cube = |x: f32| Body::fixed().shape(Shape::cuboid(0.5, 0.5, 0.5)).position(x, 0.0, 0.0);
    let bodies: Vec<_> = (0..40).map(|k| world.insert(cube(0.0).named(k.to_string()))).collect();
    let (first, second) = (bodies[0], bodies[1]);
    let all = Filter::default();
    let first_of = |world: &World, filter: &Filter| {
        let queries = Queries::of(world);
        let from = Vec3::new(-5.0, 0.2, 0.1);
        let ray = queries.ray(from, Vec3::X, 10.0, filter).expect("a cube");
        let cast = queries.cast(&Shape::ball(0.1), from, Quat::IDENTITY, Vec3::X, 10.0, filter).expect("a cube");
        let near = queries.closest(from, 10.0, filter).expect("a cube");
        assert!([cast.body, near.body].iter().all(|body| *body == ray.body));
        ray.body
    };
    assert_eq!(first_of(&world, &all), first);
    assert_eq!(first_of(&world, &all.except(first)), second);
    world.remove(first);
    assert_eq!(first_of(&world, &all), second);
    let again = world.insert(cube(0.0));
    assert_eq!((again.index(), first_of(&world, &all)), (0, again));
    let on_axis = Queries::of(&world).ray_all(Vec3::new(-5.0, 0.2, 0.1), Vec3::X, 10.0, &all);
    assert!(on_axis.len() == 40 && on_axis.is_sorted_by_key(|hit| hit.body.index()));
}

/// Cubes of different sizes whose front faces are in one plane: the tree sorts them by their middles, the last one first.
#[test]
fn equal_answers_of_different_shapes_go_by_index() {
    let mut world = World::new();
    let cube = |k: u32| {
        let half = 0.5 + 0.125 * (39 - k) as f32;
        Body::fixed().shape(Shape::cuboid(half, half, half)).position(half - 0.5, 0.0, 0.0)
    };
    let bodies: Vec<_> = (0..40).map(|k| world.insert(cube(k))).collect();
    for away in [5.0, 8.5, 10.5, 14.5, 33.0, 70.0, 4096.5] {
        let from = Vec3::new(-away, 0.25, 0.125);
        for (k, body) in bodies.iter().enumerate().step_by(7) {
            let is_left = |handle: drystone::BodyHandle, _: &Body| handle.index() >= k;
            let (queries, left) = (Queries::of(&world), Filter::default().only(&is_left));
            let ray = queries.ray(from, Vec3::X, 1e4, &left).expect("a cube");
            let near = queries.closest(from, 1e4, &left).expect("a cube");
            assert_eq!((ray.body, ray.distance), (*body, away - 0.5));
            assert_eq!((near.body, near.distance), (*body, away - 0.5));
        }
    }
}

/// The same bits from the tree of any run and from the world alone.
#[test]
fn answers_are_the_same_for_any_number_of_threads_and_any_tree() {
    let answers = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
        pool.install(|| {
            let mut random = Random::new(11);
            let mut world = World::new();
            scenery(&mut world);
            for _ in 0..300 {
                world.insert(body(&mut random));
            }
            let mut simulation = simulation(world);
            for _ in 0..30 {
                simulation.step(DT).expect("a step");
            }
            let (standing, alone) = (simulation.queries(), Queries::of(&simulation.world));
            let mut answers = Vec::new();
            for _ in 0..300 {
                let (from, along) = (random.vector(6.0) + 5.0 * Vec3::Y, random.vector(1.0));
                let ask = |queries: &Queries| {
                    let filter = Filter::default();
                    let cast = queries.cast(&Shape::ball(0.2), from, Quat::IDENTITY, along, 30.0, &filter);
                    (queries.ray_all(from, along, 30.0, &filter), cast, queries.closest(from, 3.0, &filter))
                };
                assert_eq!(ask(&standing), ask(&alone));
                answers.push(ask(&standing));
            }
            answers
        })
    };
    assert_eq!(answers(1), answers(3));
}

#[test]
fn what_is_no_number_and_what_is_not_there_meets_nothing() {
    let mut random = Random::new(5);
    let (nan, inf) = (f32::NAN, f32::INFINITY);
    let mut world = World::new();
    scenery(&mut world);
    for _ in 0..50 {
        world.insert(body(&mut random));
    }
    let turn = Quat::IDENTITY;
    let nothing = World::new();
    let none = Queries::of(&nothing);
    let down = Vec3::NEG_Y;
    let all = Filter::default();
    assert!(none.ray(Vec3::ZERO, down, inf, &all).is_none() && none.closest(Vec3::ZERO, inf, &all).is_none());
    assert!(
        none.point(Vec3::ZERO, &all).is_empty() && none.overlapping(-Vec3::INFINITY, Vec3::INFINITY, &all).is_empty()
    );
    let queries = Queries::of(&world);
    let up = 30.0 * Vec3::Y;
    assert!(queries.ray(up, down, inf, &all).is_some() && queries.closest(up, inf, &all).is_some());
    assert!(queries.cast(&Shape::ball(0.5), up, turn, down, inf, &all).is_some());
    assert!(
        queries.ray(up, 1e-30 * down, 100.0, &all).is_some() && queries.ray(up, 1e30 * down, 100.0, &all).is_some()
    );
    assert_eq!(queries.overlapping(-Vec3::INFINITY, Vec3::INFINITY, &all).len(), each_collider(&world, &all).len());
    for (origin, direction, most) in [
        (up, Vec3::ZERO, 10.0),
        (up, Vec3::splat(nan), 100.0),
        (up, Vec3::new(0.0, -inf, 0.0), 100.0),
        (Vec3::new(nan, 1.0, 0.0), down, 100.0),
        (Vec3::new(0.0, inf, 0.0), down, inf),
        (Vec3::new(0.0, 3e9, 0.0), down, inf),
        (up, down, nan),
        (up, down, -1.0),
    ] {
        let case = format!("{origin} {direction} {most}");
        assert!(queries.ray(origin, direction, most, &all).is_none(), "{case}");
        assert!(queries.ray_all(origin, direction, most, &all).is_empty(), "{case}");
        assert!(queries.cast(&Shape::ball(0.5), origin, turn, direction, most, &all).is_none(), "{case}");
        if !origin.is_finite() || most.is_nan() || most < 0.0 {
            assert!(queries.closest(origin, most, &all).is_none(), "{case}");
        }
        if !origin.is_finite() {
            assert!(
                queries.point(origin, &all).is_empty() && queries.overlapping(origin, origin, &all).is_empty(),
                "{case}"
            );
            assert!(queries.intersecting(&Shape::ball(0.5), origin, turn, &all).is_empty(), "{case}");
        }
    }
    assert!(queries.overlapping(up, -up, &all).is_empty());
    assert!(queries.ray(up, down, 100.0, &all.world(1)).is_none() && queries.point(-up, &all.world(9)).is_empty());
    let (empty, skewed) = (Shape::ball(nan), Quat::from_xyzw(0.0, 0.0, 0.0, nan));
    assert!(queries.cast(&empty, up, turn, down, 100.0, &all).is_none());
    assert!(queries.cast(&Shape::ball(1.0), up, skewed, down, 100.0, &all).is_none());
    assert!(queries.intersecting(&Shape::ball(1.0), Vec3::ZERO, skewed, &all).is_empty());
    // Bodies that are nowhere.
    let last = world.bodies.len() - 1;
    world.bodies[last].position.x = nan;
    world.bodies[last - 1].position.y = -1e20;
    world.bodies[last - 2].rotation = Quat::from_xyzw(0.0, 0.0, 0.0, 0.0);
    let queries = Queries::of(&world);
    let all_there = queries.overlapping(-Vec3::INFINITY, Vec3::INFINITY, &all);
    assert!(all_there.iter().all(|(body, _)| body.index() + 2 < last) && all_there.len() > 40);
    assert!(queries.ray(up, down, inf, &all).is_some());
}

/// The sizes that a world may have, all with all: no answer is a panic or no number.
#[test]
fn shapes_of_all_sizes_give_numbers() {
    let mut random = Random::new(9);
    for size in [1e-6, 1e-2, 1.0, 1e4, 1e9] {
        let mut world = World::new();
        let corner = |k: u32| size * Vec3::new((k & 1) as f32, (k >> 1 & 1) as f32, (k >> 2) as f32);
        let corners: Vec<Vec3> = (0..8).map(corner).collect();
        let shapes = [
            Shape::ball(size),
            Shape::cuboid(size, size, 0.1 * size),
            Shape::capsule(size, 0.2 * size),
            Shape::cylinder(size, size),
            Shape::cone(size, 0.5 * size),
            Shape::convex_hull(&corners).expect("a hull"),
            Shape::mesh(corners, vec![[0, 1, 2], [2, 3, 7]]).expect("a mesh"),
            Shape::height_field(&[vec![0.0, 0.5], vec![0.3, 1.0]], Vec3::splat(size)).expect("a field"),
            Shape::half_space(Vec3::Y),
        ];
        for shape in &shapes {
            for _ in 0..3 {
                let place = random.vector((3.0 * size).min(MAX_LENGTH));
                world.insert(
                    Body::fixed().shape(shape.clone()).position(place.x, place.y, place.z).rotation(random.rotation()),
                );
            }
        }
        let (queries, filter) = (Queries::of(&world), Filter::default());
        let mut met = 0;
        for k in 0..400 {
            let reach = [size, MAX_LENGTH, 1.0, 0.0][k % 4];
            let (from, along) = (random.vector((2.0 * reach).min(MAX_LENGTH)), random.vector(1.0));
            let mut hits = queries.ray_all(from, along, f32::INFINITY, &filter);
            hits.extend(queries.closest(from, f32::INFINITY, &filter));
            for shape in &shapes {
                hits.extend(queries.cast(shape, from, random.rotation(), along, f32::INFINITY, &filter));
                let _ = queries.intersecting(shape, from, random.rotation(), &filter);
            }
            met += hits.len();
            let is_good = |hit: &Hit| hit.distance.is_finite() && hit.point.is_finite() && hit.normal.is_normalized();
            assert!(hits.iter().all(is_good), "size {size}: {:?}", hits.iter().find(|hit| !is_good(hit)));
        }
        assert!(met > 400, "size {size}: {met}");
    }
}

/// A sensor hangs in the way of a ray; only who asks for sensors meets it, in a world that is simulated and in one that is not.
#[test]
fn a_query_looks_at_sensors_if_it_is_told() {
    let (mut world, _, ball) = ball_over_floor();
    let gate = Body::kinematic().sensor(Shape::cuboid(0.5, 0.1, 0.5)).position(0.0, 20.0, 0.0);
    let gate = world.insert(gate);
    let mut simulation = simulation(world.clone());
    simulation.step(DT).expect("a step");
    for queries in [Queries::of(&world), simulation.queries()] {
        let first = |filter: Filter| {
            let hit = queries.ray(30.0 * Vec3::Y, Vec3::NEG_Y, 100.0, &filter).expect("something");
            (hit.body, (hit.distance - 9.9).abs() < 1e-4)
        };
        assert_eq!(first(Filter::default()), (ball, false));
        assert_eq!(first(Filter::default().with_sensors()), (gate, true));
        assert!(queries.point(20.0 * Vec3::Y, &Filter::default()).is_empty());
        assert_eq!(queries.point(20.0 * Vec3::Y, &Filter::default().with_sensors()), [(gate, 0)]);
    }
}
