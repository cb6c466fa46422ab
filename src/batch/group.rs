//! Steps small worlds together, so that they fill the lanes of a processor.

use std::sync::atomic::Ordering;

use super::member::{Member, RunLength};
use crate::backend::cpu::Cpu;
use crate::backend::{Backend, CheckedStep};
use crate::config::SolverConfig;
use crate::error::Result;
use crate::panics;
use crate::plan::{PlanKey, StepPlan};
use crate::problem::carry::Carry;
use crate::problem::join::{Alike, join, part};
use crate::problem::{ContactSummary, StepProblem};
use crate::world::World;

/// Number of worlds in a group: one for each lane.
pub(super) const WORLDS: usize = 16;
/// A world with more rows of bodies than this fills the lanes by itself. In a group it would evict others from the
/// cache.
const MAX_BODIES: usize = 160;

/// Several steps combined into one, in reusable memory.
#[derive(Default)]
pub(super) struct Group {
    backend: Cpu,
    problem: StepProblem,
    plan: StepPlan,
    key: Option<MadeFor>,
}

/// The key, rules and settings of a plan.
type MadeFor = (PlanKey, Alike, SolverConfig);

/// The progress of a world in a step.
#[derive(Clone, Copy, PartialEq)]
enum Stage {
    /// The world failed and takes no more steps.
    Out,
    /// Nothing moves in this step.
    Still,
    /// Its step is assembled.
    Assembled,
    /// Its step ran together with those of other worlds.
    Ran,
}

/// Runs the steps of a run; see [`Batch::run`](super::Batch::run).
pub(super) fn run<T>(
    jobs: &mut [(&mut T, &mut Member)],
    way: RunLength,
    before: &impl Fn(&T, u64, &mut World) -> Result<()>,
    after: &impl Fn(&mut T, u64, &Member),
    group: &mut Group,
) {
    jobs.iter_mut().for_each(|(_, member)| member.begin_run());
    let mut stages = vec![Stage::Still; jobs.len()];
    for step in 0..way.steps {
        if way.is_over.load(Ordering::Relaxed) || stages.iter().all(|stage| *stage == Stage::Out) {
            break;
        }
        for ((own, member), stage) in jobs.iter_mut().zip(&mut stages).filter(|(_, stage)| **stage != Stage::Out) {
            let change = |step, world: &mut World| before(own, step, world);
            *stage = match member.begin_step(way.dt, |world| change(step, world)) {
                Ok(true) => Stage::Assembled,
                Ok(false) => Stage::Still,
                Err(error) => {
                    member.fail(error, step, way.dt, change);
                    Stage::Out
                }
            };
        }
        group.run_alike(jobs, &mut stages);
        for ((own, member), stage) in jobs.iter_mut().zip(&mut stages).filter(|(_, stage)| **stage != Stage::Out) {
            let ended = match stage {
                Stage::Assembled => member.end_step(way.dt, false),
                Stage::Ran => member.end_step(way.dt, true),
                _ => member.note_step(way.dt),
            };
            if let Err(error) = ended {
                member.fail(error, step, way.dt, |step, world: &mut World| before(own, step, world));
                *stage = Stage::Out;
            } else {
                after(own, step, member);
            }
        }
    }
}

impl Group {
    /// Runs equal kinds of steps together. A step without a match remains, to be run alone.
    fn run_alike<T>(&mut self, jobs: &mut [(&mut T, &mut Member)], stages: &mut [Stage]) {
        let small = |(member, stage): (&Member, &Stage)| {
            let simulation = member.simulation();
            let is_small = *stage == Stage::Assembled && simulation.problem().bodies.len() <= MAX_BODIES;
            is_small.then(|| Alike::of(simulation.config(), simulation.problem())).flatten()
        };
        let alike: Vec<Option<Alike>> =
            jobs.iter().zip(stages.iter()).map(|((_, member), stage)| small((member, stage))).collect();
        for first in 0..jobs.len() {
            let Some(kind) = alike[first].filter(|_| stages[first] == Stage::Assembled) else { continue };
            let config = jobs[first].1.simulation().config().clone();
            let is_of = |k: usize, member: &Member| alike[k] == Some(kind) && *member.simulation().config() == config;
            let own: Vec<usize> = (first..jobs.len()).filter(|&k| is_of(k, jobs[k].1)).collect();
            if own.len() < 2 {
                continue;
            }
            let chosen = jobs.iter_mut().enumerate().filter(|(k, _)| own.binary_search(k).is_ok());
            let mut problems: Vec<&mut StepProblem> =
                chosen.map(|(_, job)| job.1.simulation_mut().problem_mut()).collect();
            let ran = panics::caught(|| self.run_as_one(&mut problems, &config, kind));
            debug_assert!(matches!(ran, Ok(Ok(()))), "steps of one kind do not run as one");
            // If that failed, each world runs its own step, which is unchanged.
            if let Ok(Ok(())) = ran {
                own.into_iter().for_each(|k| stages[k] = Stage::Ran);
            } else {
                *self = Self::default();
            }
        }
    }

    fn run_as_one(&mut self, problems: &mut [&mut StepProblem], config: &SolverConfig, kind: Alike) -> Result<()> {
        let Self { backend, problem, plan, key } = self;
        join(problems, problem);
        let is_of =
            |(of_plan, of_kind, of_config): &MadeFor| *of_kind == kind && of_config == config && of_plan.is_of(problem);
        if !key.as_ref().is_some_and(is_of) {
            *plan = StepPlan::with_summary(config, problem, &ContactSummary::of(problem));
            *key = Some((PlanKey::of(problem), kind, config.clone()));
        }
        debug_assert!(CheckedStep::new(problem, &plan.passes).is_ok());
        backend.step(CheckedStep::built(problem, &plan.passes), &Carry::default())?;
        part(problem, problems);
        Ok(())
    }
}
