//! Runs the same simulation on several backends and numbers of threads, in lockstep.

use std::sync::OnceLock;

use drystone::{Backend, Body, Cpu, Reference, Result, Simulation, SolverConfig, World};
use rayon::{ThreadPool, ThreadPoolBuilder};

use crate::{good, is_one_line};

fn three_threads() -> &'static ThreadPool {
    static POOL: OnceLock<ThreadPool> = OnceLock::new();
    POOL.get_or_init(|| ThreadPoolBuilder::new().num_threads(3).build().expect("a pool"))
}

fn one_thread() -> &'static ThreadPool {
    static POOL: OnceLock<ThreadPool> = OnceLock::new();
    POOL.get_or_init(|| ThreadPoolBuilder::new().num_threads(1).build().expect("a pool"))
}

/// A backend with its number of threads.
struct Variant {
    name: &'static str,
    pool: fn() -> &'static ThreadPool,
    backend: fn() -> Box<dyn Backend>,
}

const VARIANTS: [Variant; 3] = [
    Variant { name: "reference", pool: one_thread, backend: || Box::new(Reference::<f32>::new()) },
    Variant { name: "lanes", pool: one_thread, backend: || Box::new(Cpu::new()) },
    Variant { name: "three threads", pool: three_threads, backend: || Box::new(Cpu::new()) },
];

/// A simulation in three variants.
pub struct Runs {
    simulations: Vec<Simulation>,
}

impl Runs {
    /// Returns `None` if the world or the settings are refused. All variants must refuse them with the same line.
    pub fn new(world: &World, config: &SolverConfig) -> Option<Self> {
        let begun = |variant: &Variant| {
            (variant.pool)().install(|| Simulation::with(world.clone(), config.clone(), (variant.backend)()))
        };
        let simulations: Vec<_> = agreed(VARIANTS.iter().map(begun).collect())?;
        Some(Self { simulations })
    }

    /// The variant that the others are compared with.
    pub fn first(&mut self) -> &mut Simulation {
        &mut self.simulations[0]
    }

    /// Makes the same call on each variant.
    pub fn each(&mut self, mut call: impl FnMut(&mut Simulation)) {
        self.simulations.iter_mut().for_each(&mut call);
    }

    /// Makes the same call on each variant. Either all refuse it or none.
    pub fn all(&mut self, mut call: impl FnMut(&mut Simulation) -> Result<()>) -> bool {
        agreed(self.simulations.iter_mut().map(&mut call).collect()).is_some()
    }

    /// Saves and loads each variant except the first.
    pub fn reload(&mut self) {
        for (simulation, variant) in self.simulations.iter_mut().zip(&VARIANTS).skip(1) {
            let saved = simulation.save();
            *simulation = Simulation::load(&saved, (variant.backend)()).expect("what was saved");
        }
    }

    /// Makes a step of each variant. Either all refuse it or none. Every NaN must be reported, and all variants must
    /// have the same bits.
    pub fn step(&mut self, dt: f32) -> bool {
        let step =
            |(simulation, variant): (&mut Simulation, &Variant)| (variant.pool)().install(|| simulation.step(dt));
        let before = self.simulations[0].hash();
        let stats = self.simulations.iter_mut().zip(&VARIANTS).map(step).collect();
        let Some(stats) = agreed(stats) else {
            assert_eq!(self.simulations[0].hash(), before, "a refused step moved something");
            return false;
        };
        let first = &self.simulations[0];
        for ((simulation, variant), stats) in self.simulations.iter().zip(&VARIANTS).zip(&stats) {
            let unreported = simulation.world.first_non_finite();
            assert_eq!(stats.first_non_finite, unreported, "{}: the first body with a NaN", variant.name);
            let differs =
                first.world.bodies.iter().zip(&*simulation.world.bodies).position(|(a, b)| bits(a) != bits(b));
            assert_eq!(differs, None, "{}: the first body whose bits are others", variant.name);
            assert!(
                first.events().iter().map(debug).eq(simulation.events().iter().map(debug)),
                "{}: events",
                variant.name
            );
        }
        true
    }
}

/// The motion of a body. All NaN count as equal: no rule of arithmetic fixes their bits.
fn bits(body: &Body) -> [u32; 13] {
    let Body { position: p, rotation: q, linear_velocity: v, angular_velocity: w, .. } = body;
    let numbers = [p.x, p.y, p.z, q.x, q.y, q.z, q.w, v.x, v.y, v.z, w.x, w.y, w.z];
    numbers.map(|x| if x.is_nan() { f32::NAN } else { x }.to_bits())
}

fn debug(event: &drystone::Event) -> String {
    format!("{event:?}")
}

/// The values if all results are good, or `None` if all are refused with the same line.
fn agreed<T>(results: Vec<Result<T>>) -> Option<Vec<T>> {
    let lines: Vec<Option<String>> = results.iter().map(|r| r.as_ref().err().map(ToString::to_string)).collect();
    assert!(lines.windows(2).all(|pair| pair[0] == pair[1]), "refused in one way and not in another: {lines:?}");
    results.iter().filter_map(|r| r.as_ref().err()).for_each(is_one_line);
    results.into_iter().map(good).collect()
}
