//! Valid worlds: falling bodies come to rest on the bodies below, and no energy is gained.

use arbitrary::{Arbitrary, Unstructured};
use drystone::glam::{Quat, Vec3};
use drystone::{Body, Shape, SolverConfig, World};

use crate::run::Runs;
use crate::show;

/// Sizes (m) and speeds (m/s) that an engineer would choose.
#[derive(Arbitrary, Debug)]
struct Drop {
    floor: Floor,
    friction: u8,
    restitution: u8,
    density: u8,
    substeps: u8,
    things: Vec<Thing>,
    steps: u8,
}

#[derive(Arbitrary, Clone, Copy, Debug)]
enum Floor {
    HalfSpace,
    Cuboid,
    Mesh,
    Field,
}

#[derive(Arbitrary, Clone, Copy, Debug)]
struct Thing {
    shape: u8,
    size: [u8; 3],
    turn: [i8; 4],
    velocity: [i8; 3],
    spin: [i8; 3],
    at: [i8; 2],
}

const FLOOR: f32 = 12.0;
const MAX_THINGS: usize = 8;
/// The thickness of floors (m). No body moves further in a step.
const THICKNESS: f32 = 1.0;

impl Floor {
    fn body(self) -> Body {
        let flat = [[0.0; 2]; 2].map(Vec::from);
        let corners = [(-1.0, -1.0), (-1.0, 1.0), (1.0, 1.0), (1.0, -1.0)].map(|(x, z)| FLOOR * Vec3::new(x, 0.0, z));
        match self {
            Self::HalfSpace => Body::fixed().shape(Shape::half_space(Vec3::Y)),
            Self::Cuboid => {
                Body::fixed().shape(Shape::cuboid(FLOOR, 0.5 * THICKNESS, FLOOR)).position(0.0, -0.5 * THICKNESS, 0.0)
            }
            Self::Mesh => {
                Body::fixed().shape(Shape::mesh(corners.to_vec(), vec![[0, 1, 2], [0, 2, 3]]).expect("a square"))
            }
            Self::Field => Body::fixed()
                .shape(Shape::height_field(&flat, Vec3::new(2.0 * FLOOR, 1.0, 2.0 * FLOOR)).expect("a square")),
        }
    }
}

impl Thing {
    /// Placed above all bodies so far, so that nothing overlaps.
    fn body(&self, lowest: &mut f32) -> Body {
        let [a, b, c] = self.size.map(|size| 0.1 + f32::from(size) / 400.0);
        let shape = match self.shape % 5 {
            0 => Shape::ball(a),
            1 => Shape::capsule(a, b),
            2 => Shape::cylinder(a, b),
            3 => Shape::cone(a, b),
            _ => Shape::cuboid(a, b, c),
        };
        let reach = 1.01 * shape.bounding_radius() + 0.01;
        let turn = Quat::from_array(self.turn.map(f32::from));
        let turn = if turn.length_squared() > 0.0 { turn.normalize() } else { Quat::IDENTITY };
        let [velocity, spin] = [self.velocity, self.spin].map(|v| Vec3::from_array(v.map(|x| f32::from(x) / 16.0)));
        let [x, z] = self.at.map(|x| f32::from(x) / 64.0);
        let body = Body::dynamic().shape(shape).position(x, *lowest + reach, z).rotation(turn).velocity(velocity, spin);
        *lowest += 2.0 * reach;
        body
    }
}

pub fn check(data: &[u8]) {
    let Ok(drop) = Drop::arbitrary_take_rest(Unstructured::new(data)) else { return };
    show(&drop);
    let [friction, restitution, density] =
        [drop.friction, drop.restitution, drop.density].map(|x| f32::from(x) / 255.0);
    let mut world = World::new();
    world.insert(drop.floor.body().friction(friction));
    let mut lowest = 0.0;
    for thing in drop.things.iter().take(MAX_THINGS) {
        let body = thing.body(&mut lowest).density(100.0 + 1e4 * density).friction(friction);
        world.insert(body.restitution(restitution));
    }
    let config = SolverConfig::default().with(|c| c.substeps = 2 + u32::from(drop.substeps % 7));
    let mut runs = Runs::new(&world, &config).expect("a good world");
    fall(&mut runs, 30 + u32::from(drop.steps), |_, _| ());
}

/// Makes the steps, with a call of `between` between them.
fn fall(runs: &mut Runs, steps: u32, mut between: impl FnMut(u32, &mut Runs)) {
    let whole = |world: &World| world.kinetic_energy() + world.potential_energy();
    let begin = whole(&runs.first().world);
    // The solver can add this much: the work of the weight over a centimeter.
    let mass: f64 = runs.first().world.dynamic().map(|body| f64::from(body.mass.mass)).sum();
    let most = begin + 1e-3 * begin.abs() + 0.1 * mass;
    for step in 0..steps {
        between(step, runs);
        assert!(runs.step(1.0 / 60.0), "step {step} of a good world is refused");
        let world = &runs.first().world;
        let energy = whole(world);
        assert!(energy <= most, "step {step}: energy grew from {begin} to {energy} J of {mass} kg");
        for (k, body) in world.dynamic().enumerate() {
            let p = body.position;
            let is_over = p.x.abs() < FLOOR - 2.0 && p.z.abs() < FLOOR - 2.0;
            assert!(!is_over || p.y > 0.0, "step {step}: thing {k} is below the floor, at {p}");
        }
    }
}

pub fn seeds() -> Vec<Vec<u8>> {
    (0_u8..16).map(|k| (0_u8..120).map(|i| i.wrapping_mul(k.wrapping_mul(2) + 1)).collect()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A falling ball, and a change to it after ten steps.
    fn fall_and(after: impl Fn(&mut Runs)) {
        let mut world = World::new();
        world.insert(Floor::HalfSpace.body());
        world.insert(Body::dynamic().shape(Shape::ball(0.5)).position(0.0, 0.6, 0.0));
        let mut runs = Runs::new(&world, &SolverConfig::default()).expect("a good world");
        fall(&mut runs, 60, |step, runs| {
            if step == 10 {
                after(runs)
            }
        });
    }

    #[test]
    fn a_ball_that_falls_breaks_nothing() {
        fall_and(|_| ());
    }

    #[test]
    #[should_panic(expected = "energy grew")]
    fn a_ball_that_is_pushed_gained_energy() {
        fall_and(|runs| runs.each(|simulation| simulation.world.bodies[1].linear_velocity.x = 3.0));
    }

    #[test]
    #[should_panic(expected = "below the floor")]
    fn a_ball_that_is_put_below_the_floor_is_found() {
        fall_and(|runs| runs.each(|simulation| simulation.world.bodies[1].position.y = -0.1));
    }

    #[test]
    #[should_panic(expected = "whose bits are others")]
    fn one_bit_of_one_run_is_found() {
        let other = |x: f32| f32::from_bits(x.to_bits() ^ 1);
        fall_and(|runs| {
            let x = &mut runs.first().world.bodies[1].position.x;
            *x = other(*x + 0.25);
            runs.each(|simulation| simulation.world.bodies[1].position.z = 0.0);
        });
    }

    #[test]
    #[should_panic(expected = "refused in one way")]
    fn one_run_that_is_refused_is_found() {
        fall_and(|runs| runs.first().world.bodies[1].material.friction = f32::NAN);
    }
}
