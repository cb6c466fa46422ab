//! Hard cases: what breaks solvers, each with a number and the limit that it should keep.

mod bodies;
mod inputs;
mod stacks;

use drystone::Simulation;
use drystone::backend::Backend;
use drystone::config::SolverConfig;
use drystone::metrics;
use drystone::scenes::Scene;
use drystone::stages::suggest::hint;
use drystone::stats::largest;
use drystone::world::World;
use drystone::{Error, Result};

pub use bodies::{Tumble, flip_time, rolling_error};

/// A case.
pub struct Case {
    /// Short name, as the command line takes it.
    pub name: &'static str,
    /// What is hard about it, and what is asked.
    pub summary: &'static str,
    /// Whether it takes minutes.
    pub long: bool,
    run: fn(&Setup) -> Result<Vec<Check>>,
}

/// One number of a case.
#[derive(Clone, Debug, serde::Serialize)]
pub struct Check {
    /// What was measured, with its unit.
    pub what: String,
    /// What it came to.
    pub value: f64,
    /// What it should be.
    pub limit: Limit,
    /// Whether it is.
    pub passed: bool,
}

/// What a number should be.
#[derive(Clone, Copy, Debug, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Limit {
    /// This or less.
    AtMost(f64),
    /// This or more.
    AtLeast(f64),
}

impl Check {
    /// Passes if `value` is at most `limit`; NaN never passes.
    pub fn at_most(what: impl Into<String>, value: f64, limit: f64) -> Self {
        Self { what: what.into(), value, limit: Limit::AtMost(limit), passed: value <= limit }
    }

    /// Passes if `value` is at least `limit`; NaN never passes.
    pub fn at_least(what: impl Into<String>, value: f64, limit: f64) -> Self {
        Self { what: what.into(), value, limit: Limit::AtLeast(limit), passed: value >= limit }
    }
}

/// What a case is run with.
pub struct Setup<'a> {
    /// Settings; the substeps of a case that needs its own are its own.
    pub config: SolverConfig,
    /// Opens what runs the sweeps.
    pub open: &'a (dyn Fn() -> Result<Box<dyn Backend>> + Sync),
}

impl Setup<'_> {
    fn simulation(&self, world: World) -> Result<Simulation> {
        Simulation::new(world, self.config.clone(), (self.open)()?)
    }

    /// Runs a scene of the catalogue and says what became of it.
    fn run(&self, name: &str, parameters: &[&str], steps: u32) -> Result<Outcome> {
        let parameters: Vec<String> = parameters.iter().map(|&p| p.to_owned()).collect();
        self.outcome(Scene::find(name, &parameters)?.world, steps)
    }

    /// Runs a world at 60 steps a second and says what became of it.
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

/// What became of a world.
#[derive(Clone, Copy, Debug)]
struct Outcome {
    /// Dynamic bodies that are not in place.
    fallen: f64,
    /// Largest horizontal way of a body (m).
    drift: f64,
    /// Speed at the end, root mean square (m/s).
    rms: f64,
    /// Deepest overlap, looked at twice a second (m).
    deepest: f64,
    /// The same at the end (m).
    at_rest: f64,
}

impl Outcome {
    /// That every body is in place.
    fn stands(&self, what: impl std::fmt::Display) -> Check {
        Check::at_most(format!("{what}: bodies out of place"), self.fallen, 0.0)
    }
}

/// 0 for a world whose numbers are finite, else 1.
fn is_broken(world: &World) -> f64 {
    f64::from(u8::from(world.first_non_finite().is_some()))
}

impl Case {
    /// All of them.
    pub const ALL: &'static [Self] = &[
        Self {
            name: "H1",
            summary: "a cube under a cube of 10 to 1e6 times its mass",
            long: false,
            run: stacks::light_under_heavy,
        },
        Self {
            name: "H2",
            summary: "towers of 20 and 40 cubes, shifted by 1 cm to either side in turn, 10 s",
            long: false,
            run: stacks::towers,
        },
        Self {
            name: "H3",
            summary: "towers with a top 100 and 1000 times heavier, and with masses 1 and 1000 in turn, 10 s",
            long: false,
            run: stacks::heavy_tops,
        },
        Self {
            name: "H4",
            summary: "more contacts than statics need: a cube on 4, 16, 64 points; 135 planks",
            long: false,
            run: stacks::redundancy,
        },
        Self {
            name: "H5",
            summary: "a card house of five storeys, cards 200 times as long as thick, 10 s",
            long: false,
            run: stacks::cards,
        },
        Self {
            name: "H6",
            summary: "a level chain of 100 links falls, with 1000 times the mass of a link at its end",
            long: false,
            run: bodies::heavy_chain,
        },
        Self {
            name: "H7",
            summary: "a rod of inertia 1:1000:1000 at 1000 rad/s, free and on a floor",
            long: false,
            run: bodies::spinning_rod,
        },
        Self {
            name: "H8",
            summary: "cubes that start 25, 50 and 100 % inside of each other",
            long: false,
            run: bodies::overlaps,
        },
        Self {
            name: "H9",
            summary: "balls on an edge, on a corner, in the same place: contacts without a defined normal",
            long: false,
            run: bodies::no_direction,
        },
        Self {
            name: "H10",
            summary: "edges that are 1e-7 to 1e-3 rad from parallel; a cube that rocks",
            long: false,
            run: bodies::nearly_parallel,
        },
        Self {
            name: "H11",
            summary: "tiny inertia, hair-thin rods, pairs of immovable bodies",
            long: false,
            run: bodies::no_inertia,
        },
        Self {
            name: "H12",
            summary: "10 and 100 km from the origin; input that is not finite",
            long: false,
            run: inputs::far_and_bad,
        },
        Self { name: "kapla", summary: "105 planks, 60 s", long: false, run: stacks::kapla },
        Self {
            name: "arch",
            summary: "arches at 0.12 of their radius stand, at 0.095 fall",
            long: false,
            run: stacks::arches,
        },
        Self {
            name: "aqueduct",
            summary: "eight arches on piers of loose blocks, 10 s",
            long: false,
            run: stacks::aqueduct,
        },
        Self { name: "pyramid100", summary: "5,050 boxes for 10,000 steps", long: true, run: stacks::large_pyramid },
        Self {
            name: "painleve",
            summary: "a rod pushed on its tip where rigid Coulomb friction has no answer",
            long: false,
            run: bodies::painleve,
        },
        Self {
            name: "flip",
            summary: "a free body about its middle axis turns over on time, energy stays, 20 s",
            long: false,
            run: bodies::flip,
        },
        Self {
            name: "rolling",
            summary: "25 balls on a plate that is pushed at 60 and 90 degrees",
            long: false,
            run: bodies::rolling,
        },
        Self {
            name: "release",
            summary: "a load of 100 times the mass of a ball is removed from two balls: they stay in place",
            long: false,
            run: bodies::release,
        },
    ];

    /// The case of that name.
    ///
    /// # Errors
    /// There is none; the message lists all.
    pub fn find(name: &str) -> Result<&'static Self> {
        Self::ALL.iter().find(|c| c.name.eq_ignore_ascii_case(name)).ok_or_else(|| {
            let known: Vec<_> = Self::ALL.iter().map(|c| c.name).collect();
            let hint = hint(name, known.iter().copied(), "`drystone hard --list` lists the cases");
            Error::input(format!("--case {name}: unknown{hint}"))
        })
    }

    /// Runs it.
    ///
    /// # Errors
    /// Settings that contradict each other, or the machine.
    pub fn run(&self, setup: &Setup) -> Result<Vec<Check>> {
        (self.run)(setup).map_err(|e| e.within(self.name))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two cubes 0.2 m in each other, which are pushed apart by 0.1 m/s at the most: 0.17 m deep after half a second, not at all after five.
    #[test]
    fn overlap_is_looked_at_on_the_way() {
        let mut world = World::new();
        world.gravity = glam::Vec3::ZERO;
        for x in [0.0, 0.8] {
            world.add(drystone::Body::dynamic().shape(drystone::Shape::cuboid(0.5, 0.5, 0.5)).position(x, 0.0, 0.0));
        }
        let open = || Ok(Box::new(drystone::Cpu::new()) as Box<dyn Backend>);
        let setup = Setup { config: SolverConfig::default().with(|c| c.push_limit = 0.1), open: &open };
        let outcome = setup.outcome(world, 300).expect("a run");
        assert!(outcome.at_rest < 1e-3 && (0.15..0.2).contains(&outcome.deepest), "{outcome:?}");
    }
}
