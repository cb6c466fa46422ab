//! Errors of a run: penetration, speed and fallen bodies, in f64.

use std::borrow::Cow;

use crate::collide::Detector;
use crate::config::SolverConfig;
use crate::stats::largest;
use crate::world::{Body, BodyHandle, BodyKind, World};

/// Overlap of all touching pairs.
///
/// ```
/// use drystone::{Body, Shape, SolverConfig, World, glam::Vec3, metrics::Penetration};
///
/// let mut world = World::new();
/// world.insert(Body::fixed().shape(Shape::half_space(Vec3::Y)));
/// world.insert(Body::dynamic().shape(Shape::ball(0.5)).position(0.0, 0.49, 0.0));
/// let Penetration { max, mean, .. } = Penetration::of_world(&world, &SolverConfig::default());
/// assert!((max - 0.01).abs() < 1e-6 && max == mean);
/// // Two manifolds with the separations of two points each (m).
/// let both = Penetration::of([[-0.5_f32, 0.1].into_iter(), [0.0, 0.2].into_iter()]);
/// assert_eq!((both.max, both.mean), (0.5, 0.25));
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Penetration {
    /// Deepest (m).
    pub max: f64,
    /// 95th percentile of the depth over the same manifolds (m).
    pub p95: f64,
    /// Mean depth of the deepest point, over the manifolds whose surfaces are within their margin of each other (m).
    pub mean: f64,
}

impl Penetration {
    /// The overlap of a world at its present poses, from contacts that are computed anew. `config` sets the distance up
    /// to which surfaces count as touching. A body that [`World::check`] refuses touches nothing.
    pub fn of_world(world: &World, config: &SolverConfig) -> Self {
        let world = fit(world);
        let mut detector = Detector::new(&world);
        detector.detect(&world, config, 0.0, &[], None);
        let manifolds = detector.pairs().flat_map(|pair| &pair.manifolds);
        Self::of(manifolds.map(|manifold| manifold.points().iter().map(|point| point.separation)))
    }

    /// The overlap from the separations (m) of the points of each manifold. A separated manifold counts as zero.
    pub fn of<Points: Iterator<Item = f32>>(manifolds: impl IntoIterator<Item = Points>) -> Self {
        let deepest = |points: Points| largest(0.0, points.map(|separation| f64::from(-separation)));
        let mut depths: Vec<f64> = manifolds.into_iter().map(deepest).collect();
        // NaN sorts last, so the maximum is NaN.
        depths.sort_by(f64::total_cmp);
        let max = depths.last().copied().unwrap_or(0.0);
        let p95 = depths.get((depths.len() * 95).div_ceil(100).saturating_sub(1)).copied().unwrap_or(0.0);
        // A sum of an empty list would be -0.
        let mean = depths.iter().fold(0.0, |total, depth| total + depth) / depths.len().max(1) as f64;
        Self { max, p95, mean }
    }
}

/// The world without the colliders of bodies that cannot be simulated.
fn fit(world: &World) -> Cow<'_, World> {
    let mut fit = Cow::Borrowed(world);
    for i in (0..world.bodies.len()).filter(|&i| world.check_body(i).is_err()) {
        fit.to_mut().bodies[i] = Body::fixed();
    }
    if world.check_gravity().is_err() {
        let fit = fit.to_mut();
        (fit.gravity, fit.own_gravity) = (glam::Vec3::ZERO, Vec::new());
    }
    fit
}

/// Speed of the fastest dynamic body (m/s), and that body; NaN counts as fastest. `None` without dynamic bodies.
///
/// ```
/// # use drystone::{Body, Shape, World, glam::Vec3, metrics};
/// # let mut world = World::new();
/// # let ball = || Body::dynamic().shape(Shape::ball(0.5)).total_mass(1.0);
/// # let [_, fast] = [3.0, 4.0].map(|speed| world.insert(ball().velocity(Vec3::X * speed, Vec3::ZERO)));
/// assert_eq!(metrics::fastest(&world), Some((4.0, fast)));
/// ```
pub fn fastest(world: &World) -> Option<(f64, BodyHandle)> {
    let of = |body: BodyHandle| (world.bodies[body].linear_velocity.as_dvec3().length(), body);
    let dynamic = world.bodies.handles().filter(|&body| world.bodies[body].kind == BodyKind::Dynamic);
    dynamic.map(of).reduce(|best, now| if now.0 > best.0 || now.0.is_nan() { now } else { best })
}

/// Root of the mean square speed, weighted by mass: sqrt(2 E / m) (m/s). 0 for a world without dynamic bodies.
///
/// ```
/// # use drystone::{Body, Shape, World, glam::Vec3, metrics};
/// # let mut world = World::new();
/// # for speed in [3.0, 4.0] {
/// #     world.insert(Body::dynamic().shape(Shape::ball(0.5)).total_mass(1.0).velocity(Vec3::X * speed, Vec3::ZERO));
/// # }
/// // Balls of one mass at 3 and 4 m/s.
/// assert!((metrics::rms_speed(&world) - 12.5_f64.sqrt()).abs() < 1e-6);
/// ```
pub fn rms_speed(world: &World) -> f64 {
    let mass: f64 = world.bodies.iter().map(|b| f64::from(b.mass.mass)).sum();
    if mass > 0.0 { (2.0 * world.kinetic_energy() / mass).sqrt() } else { 0.0 }
}

/// Half of the height of a body's axis-aligned box at its present pose (m); 0 without shapes.
///
/// ```
/// use drystone::{Body, Shape, metrics::half_height};
///
/// assert_eq!(half_height(&Body::dynamic().shape(Shape::cuboid(2.0, 0.5, 1.0))), 0.5);
/// ```
pub fn half_height(body: &Body) -> f64 {
    let bounds = |c: &crate::world::Collider| {
        let (low, high) = c.bounds(body.position, body.rotation);
        (f64::from(low.y), f64::from(high.y))
    };
    let both = |a: (f64, f64), b: (f64, f64)| (a.0.min(b.0), a.1.max(b.1));
    body.solids().map(bounds).reduce(both).map_or(0.0, |(low, high)| 0.5 * (high - low))
}

/// Whether the center of mass of a body moved by less than half of the height that the body had before.
///
/// ```
/// use drystone::{Body, Shape, metrics::in_place};
///
/// let before = Body::dynamic().shape(Shape::cuboid(0.5, 0.5, 0.5));
/// assert!(in_place(&before, &before.clone().position(0.4, 0.0, 0.0)));
/// assert!(!in_place(&before, &before.clone().position(0.0, -0.6, 0.0)));
/// ```
pub fn in_place(before: &Body, after: &Body) -> bool {
    let moved = before.center_of_mass().as_dvec3().distance(after.center_of_mass().as_dvec3());
    moved < half_height(before)
}

/// Largest horizontal displacement of a dynamic body's center of mass since `before` (m).
///
/// ```
/// # use drystone::{Body, Shape, World, glam::Vec3, metrics};
/// # let mut world = World::new();
/// # for speed in [3.0, 4.0] {
/// #     world.insert(Body::dynamic().shape(Shape::ball(0.5)).total_mass(1.0).velocity(Vec3::X * speed, Vec3::ZERO));
/// # }
/// let mut after = world.clone();
/// after.bodies[1].position += Vec3::new(3.0, -9.0, 4.0);
/// assert_eq!(metrics::drift(&world, &after), 5.0);
/// ```
pub fn drift(before: &World, after: &World) -> f64 {
    let moved = |(was, is): (&Body, &Body)| (is.center_of_mass() - was.center_of_mass()).as_dvec3();
    let dynamic = before.bodies.iter().zip(&after.bodies).filter(|(was, _)| was.kind == BodyKind::Dynamic);
    largest(0.0, dynamic.map(moved).map(|d| d.x.hypot(d.z)))
}

/// Number of dynamic bodies of `after` that are in place, see [`in_place`].
///
/// ```
/// # use drystone::{Body, Shape, World, glam::Vec3, metrics};
/// # let mut world = World::new();
/// # for speed in [3.0, 4.0] {
/// #     world.insert(Body::dynamic().shape(Shape::ball(0.5)).total_mass(1.0).velocity(Vec3::X * speed, Vec3::ZERO));
/// # }
/// let mut after = world.clone();
/// after.bodies[1].position.y += 1.0;
/// assert_eq!(metrics::in_place_count(&world, &after), 1);
/// ```
pub fn in_place_count(before: &World, after: &World) -> usize {
    let dynamic = before.bodies.iter().zip(&after.bodies).filter(|(was, _)| was.kind == BodyKind::Dynamic);
    dynamic.filter(|(was, is)| in_place(was, is)).count()
}

#[cfg(test)]
mod tests {
    use glam::{Quat, Vec3};

    use super::*;
    use crate::world::Shape;

    #[test]
    fn height_is_that_of_all_shapes_as_they_are_turned() {
        let lying = Quat::from_rotation_z(std::f32::consts::FRAC_PI_2);
        let plank = Body::dynamic().shape(Shape::cuboid(2.0, 0.5, 1.0));
        assert!((half_height(&plank) - 0.5).abs() < 1e-6);
        assert!((half_height(&plank.clone().rotation(lying)) - 2.0).abs() < 1e-6);
        let compound = plank.shape_at(Shape::ball(0.5), Vec3::new(0.0, 2.0, 0.0), Quat::IDENTITY);
        assert!((half_height(&compound) - 1.5).abs() < 1e-6);
        assert_eq!(half_height(&Body::fixed()), 0.0);
    }

    #[test]
    fn a_body_is_in_place_until_it_moved_by_half_its_height() {
        let start = Body::dynamic().shape(Shape::cuboid(2.0, 0.5, 1.0));
        assert!(in_place(&start, &start.clone().position(0.3, 0.3, 0.2)));
        assert!(!in_place(&start, &start.clone().position(0.0, 0.0, 0.5)));
        assert!(!in_place(&start, &start.clone().position(f32::NAN, 0.0, 0.0)));
    }

    /// Twenty cubes side by side, the k-th k mm deep in the floor, and one above the floor.
    #[test]
    fn penetration_is_the_deepest_the_mean_and_what_19_of_20_do_not_exceed() {
        let mut world = World::new();
        world.insert(Body::fixed().shape(Shape::half_space(Vec3::Y)));
        let cube =
            |k: usize, y: f32| Body::dynamic().shape(Shape::cuboid(0.5, 0.5, 0.5)).position(2.0 * k as f32, y, 0.0);
        for k in 1..=20 {
            world.insert(cube(k, 0.5 - 1e-3 * k as f32));
        }
        let near = |x: f64, y: f64| (x - y).abs() < 1e-6;
        let config = SolverConfig::default();
        let of = Penetration::of_world(&world, &config);
        assert!(near(of.max, 0.020) && near(of.p95, 0.019) && near(of.mean, 0.0105), "{of:?}");
        // A manifold within its margin counts as touching, with a depth of zero.
        world.insert(cube(21, 0.505));
        let of = Penetration::of_world(&world, &config);
        assert!(near(of.max, 0.020) && near(of.p95, 0.019) && near(of.mean, 0.010), "{of:?}");
        // Bodies that cannot be simulated touch nothing.
        world.insert(Body::dynamic().shape(Shape::cuboid(1.0, -1.0, 1.0)));
        world.insert(cube(22, f32::NAN));
        assert_eq!(Penetration::of_world(&world, &config), of);
        assert_eq!(Penetration::of_world(&World::new(), &config), Penetration::default());
    }

    /// 1 kg at 3 m/s, 3 kg at 1 m/s, and a fixed body that does not count.
    fn two_that_move() -> World {
        let mut world = World::new();
        world.insert(Body::fixed().shape(Shape::half_space(Vec3::Y)));
        for (mass, speed) in [(1.0, 3.0), (3.0, 1.0)] {
            let ball = Body::dynamic().shape(Shape::ball(0.5)).total_mass(mass);
            world.insert(ball.velocity(Vec3::new(0.0, 0.6, -0.8) * speed, Vec3::ZERO));
        }
        world
    }

    #[test]
    fn rms_speed_is_weighted_by_mass() {
        assert!((rms_speed(&two_that_move()) - (12.0_f64 / 4.0).sqrt()).abs() < 1e-6);
        assert_eq!(rms_speed(&World::new()), 0.0);
    }

    #[test]
    fn the_fastest_is_named_and_what_is_no_number_is_faster_than_all() {
        let mut world = two_that_move();
        let (speed, body) = fastest(&world).expect("a dynamic body");
        assert!((speed - 3.0).abs() < 1e-6 && body.index() == 1, "{speed} m/s of {body:?}");
        world.bodies[2].linear_velocity.x = f32::NAN;
        let (speed, body) = fastest(&world).expect("a dynamic body");
        assert!(speed.is_nan() && body.index() == 2, "{speed} m/s of {body:?}");
        world.bodies[0].linear_velocity = Vec3::splat(100.0);
        world.bodies[2].linear_velocity = Vec3::ZERO;
        assert_eq!(fastest(&world).map(|(_, body)| body.index()), Some(1), "a fixed body is not fast");
        assert_eq!(fastest(&World::new()), None);
    }

    #[test]
    fn drift_is_horizontal_whichever_way_it_goes() {
        let before = two_that_move();
        let mut after = before.clone();
        after.bodies[1].position += Vec3::new(3.0, -70.0, 4.0);
        after.bodies[0].position.x += 100.0;
        assert!((drift(&before, &after) - 5.0).abs() < 1e-6);
        assert_eq!(in_place_count(&before, &after), 1);
        // Downward and sideways displacements count alike.
        assert!(!in_place(&before.bodies[1], &before.bodies[1].clone().position(0.0, -0.6, 0.0)));
        assert_eq!(drift(&before, &before), 0.0);
    }
}
