//! Colors of bodies.

use std::fmt;
use std::str::FromStr;

use drystone::{BodyHandle, BodyKind, Error, Result, Simulation, SolvedManifold, World};

/// The quantity that the color of a body shows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ColorBy {
    /// Density, friction and restitution: equal materials have equal colors.
    #[default]
    Material,
    /// The color in the constraint graph of the contact with the largest impulse on the body.
    Batch,
    /// Speed of the center of mass, dark to light.
    Speed,
    /// Sum of the normal impulses on the body in the last substep, dark to light.
    Impulse,
    /// Sleeping bodies are dark, awake bodies light.
    Sleeping,
    /// Substeps of the body's island, dark to light: each shade doubles them.
    Effort,
}

impl ColorBy {
    /// All, in their order.
    pub const ALL: [Self; 6] = [Self::Material, Self::Batch, Self::Speed, Self::Impulse, Self::Sleeping, Self::Effort];

    /// Its name in command lines, links and messages.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Material => "material",
            Self::Batch => "batch",
            Self::Speed => "speed",
            Self::Impulse => "impulse",
            Self::Sleeping => "sleeping",
            Self::Effort => "effort",
        }
    }

    /// The next one; the first one after the last.
    pub fn next(self) -> Self {
        Self::ALL[(self as usize + 1) % Self::ALL.len()]
    }
}

impl fmt::Display for ColorBy {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.name().fmt(f)
    }
}

impl FromStr for ColorBy {
    type Err = Error;

    fn from_str(name: &str) -> Result<Self> {
        let unknown = || Error::input(format!("{name:?}: must be one of {}", Self::ALL.map(Self::name).join(", ")));
        Self::ALL.into_iter().find(|color| color.name() == name).ok_or_else(unknown)
    }
}

/// A color as sRGB with an unused fourth byte.
pub type Rgba = [u8; 4];

pub(crate) const FIXED: Rgba = [176, 178, 182, 255];
const KINEMATIC: Rgba = [150, 160, 178, 255];
const NOTHING: Rgba = [222, 222, 218, 255];
const ASLEEP: Rgba = [74, 92, 128, 255];
const AWAKE: Rgba = [240, 178, 84, 255];

const MATERIALS: [Rgba; 8] = [
    [196, 162, 118, 255],
    [168, 90, 66, 255],
    [106, 122, 140, 255],
    [128, 146, 96, 255],
    [214, 196, 160, 255],
    [140, 104, 132, 255],
    [90, 140, 138, 255],
    [206, 134, 70, 255],
];

/// A scale from dark to light that is also suitable for the color-blind.
const SCALE: [[f32; 3]; 5] =
    [[68.0, 1.0, 84.0], [59.0, 82.0, 139.0], [33.0, 145.0, 140.0], [94.0, 201.0, 98.0], [253.0, 231.0, 37.0]];

/// The number of doublings of substeps with the lightest shade.
const MAX_DOUBLED: f32 = 6.0;

impl ColorBy {
    /// A value for each body: number of the material, number of the batch, speed (m/s), impulse (N s), 1 for sleep, or
    /// the number of times that the substeps are doubled; NaN without a contact.
    pub fn values(self, simulation: &mut Simulation) -> Vec<f32> {
        if self == Self::Effort {
            let doubled = |body| (simulation.substeps_of(body) / simulation.config().substeps).ilog2() as f32;
            return handles(&simulation.world).map(|body| body.map_or(0.0, doubled)).collect();
        }
        let asleep = |body: Option<BodyHandle>| body.is_some_and(|body| simulation.is_asleep(body));
        let asleep: Vec<bool> = handles(&simulation.world).map(asleep).collect();
        let manifolds: Vec<SolvedManifold> = simulation.manifolds().collect();
        self.values_of(&simulation.world, &manifolds, &asleep)
    }

    pub(crate) fn values_of(self, world: &World, manifolds: &[SolvedManifold], asleep: &[bool]) -> Vec<f32> {
        match self {
            Self::Sleeping => (0..world.bodies.len()).map(|i| f32::from(asleep.get(i) == Some(&true))).collect(),
            Self::Material => materials(world),
            Self::Effort => vec![f32::NAN; world.bodies.len()],
            Self::Speed => world.bodies.iter().map(|b| b.linear_velocity.length()).collect(),
            Self::Batch => {
                // Impulse and color of the contact with the largest impulse.
                let mut most = vec![(-1.0, f32::NAN); world.bodies.len()];
                for manifold in manifolds {
                    let impulse = manifold.normal_impulse();
                    let Some(color) = manifold.color else { continue };
                    for side in [manifold.a, manifold.b] {
                        let best = &mut most[side.body.index()];
                        *best = if impulse > best.0 { (impulse, f32::from(color)) } else { *best };
                    }
                }
                most.into_iter().map(|(_, color)| color).collect()
            }
            Self::Impulse => {
                let mut sums = vec![0.0; world.bodies.len()];
                for manifold in manifolds {
                    for side in [manifold.a, manifold.b] {
                        sums[side.body.index()] += manifold.normal_impulse();
                    }
                }
                sums
            }
        }
    }

    /// The value at the light end of the scale. One in fifty dynamic bodies exceeds it.
    pub fn scale(self, world: &World, values: &[f32]) -> f32 {
        let dynamic = world.bodies.iter().zip(values).filter(|(b, v)| b.kind == BodyKind::Dynamic && v.is_finite());
        let mut sorted: Vec<f32> = dynamic.map(|(_, v)| *v).collect();
        sorted.sort_by(f32::total_cmp);
        sorted.get(sorted.len().saturating_sub(1 + sorted.len() / 50)).copied().unwrap_or(0.0)
    }

    pub fn paint(self, world: &World, values: &[f32], scale: f32) -> Vec<Rgba> {
        let color = |(i, (body, &value)): (usize, (&drystone::world::Body, &f32))| match (body.kind, self) {
            (BodyKind::Fixed, _) => FIXED,
            (BodyKind::Kinematic, _) => KINEMATIC,
            _ if value.is_nan() => NOTHING,
            (_, Self::Material) => shaded(MATERIALS[value as usize % MATERIALS.len()], i),
            (_, Self::Batch) => batch_color(value as u32),
            (_, Self::Sleeping) => shaded(if value > 0.0 { ASLEEP } else { AWAKE }, i),
            (_, Self::Effort) => on_scale((value / MAX_DOUBLED).min(1.0).powi(2)),
            (_, Self::Speed | Self::Impulse) => on_scale(value / scale.max(f32::MIN_POSITIVE)),
        };
        world.bodies.iter().zip(values).enumerate().map(color).collect()
    }
}

/// The handle of each body; `None` for a vacancy.
fn handles(world: &World) -> impl Iterator<Item = Option<BodyHandle>> {
    (0..world.bodies.len()).map(|index| world.bodies.handle(index))
}

/// The number of each dynamic body's material, in the order of first occurrence.
fn materials(world: &World) -> Vec<f32> {
    let mut known = Vec::new();
    let mut number = |body: &drystone::world::Body| {
        let volume: f32 = body.colliders.iter().map(|c| c.shape.volume()).sum();
        // Two digits, so that rounding makes no difference.
        let density = (body.mass.mass / volume).log10() * 50.0;
        let kind = (density.round() as i32, body.material.friction.to_bits(), body.material.restitution.to_bits());
        known.iter().position(|k| *k == kind).unwrap_or_else(|| {
            known.push(kind);
            known.len() - 1
        })
    };
    world.bodies.iter().map(|b| if b.kind == BodyKind::Dynamic { number(b) as f32 } else { 0.0 }).collect()
}

/// A shade that varies from body to body, so that neighbors differ.
fn shaded([r, g, b, a]: Rgba, body: usize) -> Rgba {
    // A hash by two products, the same on all machines.
    let mixed = (body as u32).wrapping_add(1).wrapping_mul(0x9E37_79B9);
    let scattered = (mixed ^ mixed >> 15).wrapping_mul(0x85EB_CA6B) >> 24;
    let factor = 0.90 + 0.20 * scattered as f32 / 255.0;
    let scale = |c: u8| (f32::from(c) * factor).min(255.0) as u8;
    [scale(r), scale(g), scale(b), a]
}

/// The color of a batch: hues differ by the golden angle, and every other one is darker.
pub fn batch_color(batch: u32) -> Rgba {
    let hue = (batch as f32 * 0.618_034 + 0.58).fract() * 6.0;
    let (light, strength) = if batch.is_multiple_of(2) { (0.92, 0.62) } else { (0.74, 0.72) };
    let channel = |offset: f32| {
        let k = (offset + hue) % 6.0;
        let down = k.min(4.0 - k).clamp(0.0, 1.0);
        (255.0 * light * (1.0 - strength * down)) as u8
    };
    [channel(5.0), channel(3.0), channel(1.0), 255]
}

fn on_scale(x: f32) -> Rgba {
    // The square root separates small values.
    let x = x.clamp(0.0, 1.0).sqrt() * (SCALE.len() - 1) as f32;
    let lower = (x as usize).min(SCALE.len() - 2);
    let mix = |k: usize| (SCALE[lower][k] + (x - lower as f32) * (SCALE[lower + 1][k] - SCALE[lower][k])) as u8;
    [mix(0), mix(1), mix(2), 255]
}

#[cfg(test)]
mod tests {
    use super::*;
    use drystone::{Reference, Simulation, SolverConfig};
    use drystone_scenes::Scene;

    fn settled(name: &str, parameters: &[String]) -> Simulation {
        let scene = Scene::find(name, parameters).expect("a scene");
        let reference = Box::new(Reference::<f32>::new());
        let config = SolverConfig::default().with(|c| c.sleep_after = 0.1);
        let mut simulation = Simulation::with(scene.world, config, reference).expect("a simulation");
        for _ in 0..20 {
            simulation.step(scene.dt).expect("a step");
        }
        simulation
    }

    #[test]
    fn a_quantity_is_found_by_its_name_and_all_follow_each_other() {
        assert!(ColorBy::ALL.into_iter().all(|color| color.name().parse::<ColorBy>().ok() == Some(color)));
        let message = "mass".parse::<ColorBy>().expect_err("no color").to_string();
        assert_eq!(message, "\"mass\": must be one of material, batch, speed, impulse, sleeping, effort");
        let next = ColorBy::ALL.map(ColorBy::next);
        assert!(next[..5] == ColorBy::ALL[1..] && next[5] == ColorBy::ALL[0]);
    }

    #[test]
    fn batches_that_share_a_body_have_different_colors() {
        let mut tower = settled("tower", &[]);
        let values = ColorBy::Batch.values(&mut tower);
        assert!(values[1..].iter().all(|v| v.is_finite()), "every box touches something");
        let distinct: std::collections::HashSet<Rgba> = (0..24).map(batch_color).collect();
        assert_eq!(distinct.len(), 24);
    }

    #[test]
    fn the_lowest_box_of_a_tower_bears_most() {
        let mut tower = settled("tower", &[]);
        let values = ColorBy::Impulse.values(&mut tower);
        assert!(values[1] > 1.5 * values[6] && values[10] > 0.0, "{values:?}");
        let scale = ColorBy::Impulse.scale(&tower.world, &values);
        let colors = ColorBy::Impulse.paint(&tower.world, &values, scale);
        assert_eq!(colors[0], FIXED);
        assert_ne!(colors[1], colors[10]);
    }

    #[test]
    fn a_sleeping_body_is_darker_than_an_awake_body() {
        let mut stack = settled("stack", &["n=2".into()]);
        let before = ColorBy::Sleeping.values(&mut stack);
        assert_eq!(before, [0.0, 1.0, 1.0]);
        stack.wake(stack.world.bodies.handle(2).expect("a cube"));
        let after = ColorBy::Sleeping.values(&mut stack);
        assert_eq!(after, [0.0; 3]);
        let light = |values: &[f32]| ColorBy::Sleeping.paint(&stack.world, values, 1.0)[1][0];
        assert!(light(&before) < light(&after));
    }

    #[test]
    fn a_heavy_top_is_another_material() {
        let world = Scene::find("tower", &["top_ratio=100".into()]).expect("a scene").world;
        let values = ColorBy::Material.values_of(&world, &[], &[]);
        assert_eq!(values[1..], [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]);
    }
}
