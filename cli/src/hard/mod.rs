//! Hard cases for solvers. Each case measures quantities and compares them with limits.

mod contacts;
pub mod families;
mod inputs;
mod motions;
mod stacks;

use drystone::stages::suggest::hint;
use drystone::stats::largest;
use drystone::{Backend, Body, Error, Result, Shape, Simulation, SolverConfig, World, metrics};
use drystone_scenes::Scene;
use glam::Vec3;

pub use motions::{Tumble, flip_time, rolling_error};

pub struct Case {
    pub name: &'static str,
    pub summary: &'static str,
    /// Whether the case takes minutes.
    pub long: bool,
    run: fn(&Setup, &mut Checks) -> Result<()>,
}

#[derive(Clone, Debug, serde::Serialize)]
pub struct Check {
    /// The quantity, with its unit.
    pub what: String,
    pub value: f64,
    pub limit: Limit,
    pub passed: bool,
}

#[derive(Clone, Copy, Debug, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Limit {
    AtMost(f64),
    AtLeast(f64),
}

impl Limit {
    /// Whether a value satisfies the limit; NaN never does.
    pub fn holds(self, value: f64) -> bool {
        match self {
            Self::AtMost(limit) => value <= limit,
            Self::AtLeast(limit) => value >= limit,
        }
    }
}

/// Whether all checks of a case passed.
pub fn passes(checks: &[Check]) -> bool {
    checks.iter().all(|check| check.passed)
}

#[derive(Default)]
struct Checks(Vec<Check>);

impl Checks {
    fn add(&mut self, what: String, value: f64, limit: Limit) {
        self.0.push(Check { what, value, limit, passed: limit.holds(value) });
    }

    fn at_most(&mut self, what: impl Into<String>, value: f64, limit: f64) {
        self.add(what.into(), value, Limit::AtMost(limit));
    }

    /// Passes if every number of a world is finite.
    fn finite(&mut self, what: &str, world: &World) {
        let broken = u8::from(world.first_non_finite().is_some());
        self.at_most(format!("{what}non-finite bodies"), broken.into(), 0.0);
    }

    /// Passes if every body is in place.
    fn stands(&mut self, outcome: &Outcome, what: impl std::fmt::Display) {
        self.at_most(format!("{what}: bodies out of place"), outcome.fallen, 0.0);
    }
}

pub struct Setup<'a> {
    pub config: SolverConfig,
    /// Opens the backend that runs the sweeps.
    pub open: &'a (dyn Fn() -> Result<Box<dyn Backend>> + Sync),
}

impl Setup<'_> {
    fn simulation(&self, world: World) -> Result<Simulation> {
        Simulation::with(world, self.config.clone(), (self.open)()?)
    }

    /// A simulation whose bodies can fall asleep, like the default.
    fn sleeping(&self, world: World) -> Result<Simulation> {
        let config = self.config.clone().with(|c| c.sleep_after = SolverConfig::default().sleep_after);
        Simulation::with(world, config, (self.open)()?)
    }

    fn run(&self, spec: &str, steps: u32) -> Result<Outcome> {
        self.outcome(Scene::find_spec(spec)?.world, steps)
    }

    /// Runs a world at 60 steps a second and measures its end.
    fn outcome(&self, world: World, steps: u32) -> Result<Outcome> {
        let mut simulation = self.simulation(world.clone())?;
        let mut deepest = 0.0;
        for step in 1..=steps {
            simulation.step(DT)?;
            if step % 30 == 0 && step < steps {
                deepest = largest(deepest, [simulation.penetration().max]);
            }
        }
        let (now, at_rest) = (&simulation.world, simulation.penetration().max);
        Ok(Outcome {
            fallen: (world.dynamic_count() - metrics::in_place_count(&world, now)) as f64,
            drift: metrics::drift(&world, now),
            rms: metrics::rms_speed(now),
            deepest: largest(deepest, [at_rest]),
            at_rest,
        })
    }
}

/// Length of a step (s).
const DT: f32 = 1.0 / 60.0;

#[derive(Clone, Copy, Debug)]
struct Outcome {
    /// Number of dynamic bodies that are out of place.
    fallen: f64,
    /// Largest horizontal distance of a body from its first position (m).
    drift: f64,
    /// Root mean square speed (m/s).
    rms: f64,
    /// Deepest overlap at any time, measured twice a second (m).
    deepest: f64,
    /// Deepest overlap at the end (m).
    at_rest: f64,
}

const LEAST: f64 = f64::NEG_INFINITY;

fn floor(friction: f32) -> World {
    let mut world = World::new();
    world.insert(Body::fixed().shape(Shape::half_space(Vec3::Y)).friction(friction));
    world
}

fn cube(x: f32, y: f32) -> Body {
    Body::dynamic().shape(Shape::cuboid(0.5, 0.5, 0.5)).position(x, y, 0.0)
}

fn weightless() -> World {
    World { gravity: Vec3::ZERO, ..World::new() }
}

/// Kinetic and potential energy (J).
pub(crate) fn energy(world: &World) -> f64 {
    world.kinetic_energy() + world.potential_energy()
}

/// Relative error of a value.
fn off(value: f64, exact: f64) -> f64 {
    (value / exact - 1.0).abs()
}

/// Values of `measure` after each of `steps` steps.
fn watch(simulation: &mut Simulation, steps: u32, measure: impl Fn(&World) -> f64) -> Result<Vec<f64>> {
    (0..steps).map(|_| simulation.step(DT).map(|_| measure(&simulation.world))).collect()
}

/// Speed of the fastest dynamic body (m/s); 0 without one.
fn largest_speed(world: &World) -> f64 {
    metrics::fastest(world).map_or(0.0, |(speed, _)| speed)
}

const CASES: &[Case] = &[
    case("H1", "a cube under a cube of 10 to 1e6 times its mass", stacks::light_under_heavy),
    case("H2", "towers of 20 and 40 cubes, shifted by 1 cm to either side in turn, 10 s", stacks::towers),
    case(
        "H3",
        "towers with a top 100 and 1000 times heavier, or with masses 1 and 1000 in turn, 10 s",
        stacks::heavy_tops,
    ),
    case("H4", "redundant contacts: a cube on 4, 16, 64 points; 135 planks", stacks::redundancy),
    case("H5", "a card house of five storeys, cards 200 times as long as thick, 10 s", stacks::cards),
    case("H6", "a level chain of 100 links falls, with 1000 times the mass of a link at its end", motions::heavy_chain),
    case("H7", "a rod of inertia 1:1000:1000 at 1000 rad/s, free and on a floor", motions::spinning_rod),
    case("H8", "cubes that start 25, 50 and 100 % inside each other", contacts::overlaps),
    case(
        "H9",
        "balls on an edge, on a corner, in the same place: contacts without a defined normal",
        contacts::no_direction,
    ),
    case("H10", "edges that are 1e-7 to 1e-3 rad from parallel; a cube that rocks", contacts::nearly_parallel),
    case("H11", "tiny inertia, hair-thin rods, pairs of immovable bodies", contacts::no_inertia),
    case("H12", "10 and 100 km from the origin; input that is not finite", inputs::far_and_bad),
    case("kapla", "105 planks, 60 s", stacks::kapla),
    case("arch", "arches at 0.12 of their radius stand, at 0.095 fall", stacks::arches),
    case("aqueduct", "eight arches on piers of loose blocks, 10 s", stacks::aqueduct),
    Case { long: true, ..case("pyramid100", "5,050 boxes for 10,000 steps", stacks::large_pyramid) },
    case("painleve", "a rod pushed on its tip where rigid Coulomb friction has no solution", contacts::painleve),
    case("flip", "a free spin about the middle axis flips on time and keeps its energy, 20 s", motions::flip),
    case("rolling", "25 balls on a plate that is pushed at 60 and 90 degrees", motions::rolling),
    case(
        "release",
        "a load of 100 times the mass of a ball is removed from two balls: they stay in place",
        motions::release,
    ),
    case("H21", "presses stand 5 and 10 cm deep in a crate: it lies still and sleeps", contacts::held),
    case(
        "H22",
        "a car whose wheels reach 5, 10 and 20 cm into it: no energy but that of its motors",
        contacts::jammed_car,
    ),
    case("H23", "twenty ragdolls fall on the floor: all sleep within 5 s", motions::ragdolls),
    case("H24", "thin slabs, coins and balls fall from 5 and 50 m onto a mesh: none falls through", motions::terrain),
    case("H25", "balls of 2 cm fly at 10 to 1000 m/s in a room of sheets of 1 mm: none leaves", motions::bullets),
];

const fn case(name: &'static str, summary: &'static str, run: fn(&Setup, &mut Checks) -> Result<()>) -> Case {
    Case { name, summary, long: false, run }
}

impl Case {
    pub const ALL: &'static [Self] = CASES;

    pub fn find(name: &str) -> Result<&'static Self> {
        Self::ALL.iter().find(|c| c.name.eq_ignore_ascii_case(name)).ok_or_else(|| {
            let known: Vec<_> = Self::ALL.iter().map(|c| c.name).collect();
            let hint = hint(name, known.iter().copied(), "`drystone hard --list` lists the cases");
            Error::input(format!("--case {name}: unknown{hint}"))
        })
    }

    pub fn run(&self, setup: &Setup) -> Result<Vec<Check>> {
        let mut checks = Checks::default();
        (self.run)(setup, &mut checks).map_err(|e| e.within(self.name))?;
        Ok(checks.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two cubes overlap by 0.2 m and separate at 0.1 m/s at most: the overlap is 0.17 m after half a second and 0
    /// after five seconds.
    #[test]
    fn overlap_is_looked_at_on_the_way() {
        let mut world = weightless();
        world.insert(cube(0.0, 0.0));
        world.insert(cube(0.8, 0.0));
        let open = || Ok(Box::new(drystone::Cpu::new()) as Box<dyn Backend>);
        let setup = Setup { config: SolverConfig::default().with(|c| c.push_limit = 0.1), open: &open };
        let outcome = setup.outcome(world, 300).expect("a run");
        assert!(outcome.at_rest < 1e-3 && (0.15..0.2).contains(&outcome.deepest), "{outcome:?}");
    }

    #[test]
    fn one_body_out_of_place_fails() {
        for (fallen, passed) in [(0.0, true), (1.0, false)] {
            let mut checks = Checks::default();
            checks.stands(&Outcome { fallen, drift: 0.0, rms: 0.0, deepest: 0.0, at_rest: 0.0 }, "a tower");
            assert_eq!(passes(&checks.0), passed);
        }
    }
}
