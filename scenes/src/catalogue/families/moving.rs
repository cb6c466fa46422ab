//! Families whose motion has a closed form or a bound.

use glam::{DVec3, Vec3};

use super::Law;
use super::draw::Draw;
use crate::catalogue::{basics, boxes, jointed};
use crate::scene::Scene;
use drystone::stages::math::{about, product};
use drystone::{Body, Result, Shape, World};

/// Shares of the friction limit: friction holds a body at the first, but not at the second.
const BELOW: f64 = 0.98;
const ABOVE: f64 = 1.02;

/// A chain that is lifted from its hanging position, or a net that swings down.
pub(super) fn chain(draw: &mut Draw, g: f64) -> (Scene, Law) {
    /// Length of a link, and distance of the balls of a net (m).
    const LINK: f64 = 0.5;
    let ratio = draw.log_uniform(1.0, 1000.0) as f32;
    // How far a body can hang below the joints that hold it (m).
    let (scene, reach): (_, fn(&Body) -> f64) = if draw.is_heads() {
        let links = draw.whole(3, 60);
        (jointed::chain(links, ratio, draw.between(0.0, 90.0) as f32), |body| body.position.length().into())
    } else {
        (jointed::grid(draw.whole(4, 12), ratio), |body| body.position.z.into())
    };
    let energy = scene.world.dynamic().map(|body| f64::from(body.mass.mass) * g * reach(body)).sum();
    (scene, Law::Swings { link: LINK, energy })
}

/// A box or a cylinder on its base, so flat that friction does not topple it, and half of its height (m).
fn block(draw: &mut Draw) -> (Body, f64) {
    let half_width = draw.log_uniform(0.05, 0.5);
    let half_height = half_width * draw.between(0.1, 0.7);
    let shape = if draw.is_heads() {
        Shape::cylinder(half_height as f32, half_width as f32)
    } else {
        let half_depth = half_width * draw.between(1.0, 2.0);
        Shape::cuboid(half_width as f32, half_height as f32, half_depth as f32)
    };
    (Body::dynamic().shape(shape).density(draw.log_uniform(100.0, 10_000.0) as f32), half_height)
}

/// A block on a slope: it stays if tan(angle) < mu, else it slides with g (sin(angle) - mu cos(angle)).
pub(super) fn slope(draw: &mut Draw, g: f64) -> (Scene, Law) {
    let mu = draw.between(0.1, 1.0);
    let (body, half_height) = block(draw);
    let slides = draw.is_heads();
    let angle = libm::atan(mu) * if slides { ABOVE } else { BELOW };
    let mut scene = basics::on_slope("slopes", body, half_height as f32, angle.to_degrees() as f32, mu as f32);
    let block = &mut scene.world.bodies[1];
    block.rotation = product(block.rotation, about(Vec3::Y, draw.turn() as f32));
    let (sin, cos) = libm::sincos(angle);
    let law = if slides { Law::Slides(g * (sin - mu * cos) * DVec3::new(cos, -sin, 0.0)) } else { Law::Sticks };
    (scene, law)
}

/// A block on level ground with a constant horizontal force through its center: it stays if the force is below mu m g,
/// else the rest of the force accelerates it.
pub(super) fn pushed(draw: &mut Draw, g: f64) -> (Scene, Law) {
    let mu = draw.between(0.1, 1.0);
    let (body, half_height) = block(draw);
    let slides = draw.is_heads();
    let share = if slides { ABOVE } else { BELOW };
    let (sin, cos) = libm::sincos(draw.turn());
    let to = DVec3::new(cos, 0.0, sin);
    let mut world = World::new();
    world.insert(Body::fixed().named("ground").shape(Shape::half_space(Vec3::Y)).friction(mu as f32));
    let body = body.friction(mu as f32).position(0.0, half_height as f32, 0.0);
    let block = world.insert(body.rotation(about(Vec3::Y, draw.turn() as f32)));
    let mass = f64::from(world.bodies[block].mass.mass);
    world.bodies[block].force = (share * mu * mass * g * to).as_vec3();
    let law = if slides { Law::Slides((share - 1.0) * mu * g * to) } else { Law::Sticks };
    (Scene::new("pushed-blocks", world, 0), law)
}

/// Boxes, balls, capsules, cylinders, cones and hulls fall between walls.
pub(super) fn pile(draw: &mut Draw) -> Result<Scene> {
    /// Largest shift off the grid (m), and kinds of shapes.
    const JITTER: f64 = 0.03;
    const KINDS: usize = 6;
    boxes::pile_mixed(draw.whole(20, 120), JITTER, draw.bits(), KINDS)
}
