//! Steps worlds together: small ones, so that they fill the lanes of a processor, or all worlds on one device.

use std::sync::atomic::Ordering;

use rayon::prelude::*;

use super::member::{Member, RunLength};
use crate::backend::cpu::Cpu;
use crate::backend::{Backend, CheckedStep};
use crate::config::SolverConfig;
use crate::error::{Error, Result};
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
pub(super) struct Group {
    backend: Box<dyn Backend>,
    /// Whether the caller chose the backend: steps of any size run on it, and the worlds of the group are assembled and
    /// stored on all threads.
    is_chosen: bool,
    /// One line if the chosen backend failed in the last run.
    pub last_fault: Option<String>,
    problem: StepProblem,
    plan: StepPlan,
    key: Option<MadeFor>,
}

/// The key, rules and settings of a plan.
type MadeFor = (PlanKey, Option<Alike>, SolverConfig);

/// A world with the caller's value for it.
pub(super) struct Job<'a, T> {
    own: &'a mut T,
    member: &'a mut Member,
    stage: Stage,
    alike: Option<Alike>,
}

impl<'a, T> Job<'a, T> {
    pub fn new(own: &'a mut T, member: &'a mut Member) -> Self {
        Self { own, member, stage: Stage::Still, alike: None }
    }
}

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

impl Group {
    /// A group of small worlds in the lanes of a processor.
    pub fn in_lanes() -> Self {
        Self { is_chosen: false, ..Self::on(Box::new(Cpu::new())) }
    }

    /// A group that runs all its steps on one backend.
    pub fn on(backend: Box<dyn Backend>) -> Self {
        Self {
            backend,
            is_chosen: true,
            last_fault: None,
            problem: StepProblem::default(),
            plan: StepPlan::default(),
            key: None,
        }
    }

    /// The backend of the group.
    pub fn backend(&self) -> &dyn Backend {
        &*self.backend
    }

    /// Runs the steps of a run; see [`Batch::run`](super::Batch::run).
    pub fn run<T: Send>(
        &mut self,
        jobs: &mut [Job<T>],
        way: RunLength,
        before: &(impl Fn(&T, u64, &mut World) -> Result<()> + Sync),
        after: &(impl Fn(&mut T, u64, &Member) + Sync),
    ) {
        let on_threads = self.is_chosen;
        each(jobs, on_threads, |job| job.member.begin_run());
        for step in 0..way.steps {
            if way.is_over.load(Ordering::Relaxed) || jobs.iter().all(|job| job.stage == Stage::Out) {
                break;
            }
            each(jobs, on_threads, |Job { own, member, stage, alike }| {
                *alike = None;
                if *stage == Stage::Out {
                    return;
                }
                *stage = match member.begin_step(way.dt, |world| before(own, step, world)) {
                    Ok(true) => Stage::Assembled,
                    Ok(false) => Stage::Still,
                    Err(error) => {
                        member.fail(error, step, way.dt, |step, world| before(own, step, world));
                        Stage::Out
                    }
                };
                let simulation = member.simulation();
                if *stage == Stage::Assembled && (on_threads || simulation.problem().bodies.len() <= MAX_BODIES) {
                    *alike = Alike::of(simulation.config(), simulation.problem());
                }
            });
            let fault = self.run_alike(jobs);
            if fault.is_some() {
                self.last_fault.clone_from(&fault);
            }
            each(jobs, on_threads, |Job { own, member, stage, .. }| {
                let repeats = *stage == Stage::Assembled;
                let ended = match stage {
                    Stage::Out => return,
                    Stage::Assembled => member.end_step(way.dt, false),
                    Stage::Ran => member.end_step(way.dt, true),
                    Stage::Still => member.note_step(way.dt),
                };
                if let Err(error) = ended {
                    member.fail(error, step, way.dt, |step, world| before(own, step, world));
                    *stage = Stage::Out;
                } else {
                    member.note_fault(fault.as_ref().filter(|_| repeats));
                    after(own, step, member);
                }
            });
        }
    }

    /// Runs equal kinds of steps together. Without a chosen backend, a step without a match remains, to be run alone.
    /// Returns one line if the chosen backend failed: the steps that are left run alone, too.
    fn run_alike<T>(&mut self, jobs: &mut [Job<T>]) -> Option<String> {
        for first in 0..jobs.len() {
            if jobs[first].stage != Stage::Assembled || (jobs[first].alike.is_none() && !self.is_chosen) {
                continue;
            }
            let (kind, config) = (jobs[first].alike, jobs[first].member.simulation().config().clone());
            let is_of = |k: usize| {
                let Job { member, stage, alike, .. } = &jobs[k];
                let is_alike = *stage == Stage::Assembled && alike.is_some() && *alike == kind;
                k == first || is_alike && *member.simulation().config() == config
            };
            let own: Vec<usize> = (first..jobs.len()).filter(|&k| is_of(k)).collect();
            if own.len() < 2 && !self.is_chosen {
                continue;
            }
            let chosen = jobs.iter_mut().enumerate().filter(|(k, _)| own.binary_search(k).is_ok());
            let mut problems: Vec<&mut StepProblem> =
                chosen.map(|(_, job)| job.member.simulation_mut().problem_mut()).collect();
            let ran = panics::caught(|| self.run_as_one(&mut problems, &config, kind));
            // If that failed, each world runs its own step, which is unchanged.
            match ran {
                Ok(Ok(())) => own.into_iter().for_each(|k| jobs[k].stage = Stage::Ran),
                Ok(Err(error)) if self.is_chosen => return Some(self.replace_backend(&error)),
                Err(panic) if self.is_chosen => return Some(self.replace_backend(&Error::Panicked(panic.text))),
                _ => {
                    debug_assert!(false, "steps of one kind do not run as one");
                    *self = Self::in_lanes();
                }
            }
        }
        None
    }

    /// Continues on another backend after the chosen one failed, and returns one line about it.
    fn replace_backend(&mut self, error: &Error) -> String {
        let successor = if error.is_lost() { self.backend.successor() } else { None };
        *self = Self::on(successor.unwrap_or_else(|| Box::new(Cpu::new())));
        format!("{error}; the worlds repeated the step, and continue on {}", self.backend.name())
    }

    fn run_as_one(
        &mut self,
        problems: &mut [&mut StepProblem],
        config: &SolverConfig,
        kind: Option<Alike>,
    ) -> Result<()> {
        let Self { backend, problem, plan, key, .. } = self;
        join(problems, problem);
        let is_of =
            |(of_plan, of_kind, of_config): &MadeFor| *of_kind == kind && of_config == config && of_plan.is_of(problem);
        // Without known facts about its rules, a plan serves one step.
        if kind.is_none() || !key.as_ref().is_some_and(is_of) {
            *plan = StepPlan::with_summary(config, problem, &ContactSummary::of(problem));
            *key = Some((PlanKey::of(problem), kind, config.clone()));
        }
        debug_assert!(CheckedStep::new(problem, &plan.passes).is_ok());
        backend.step(CheckedStep::built(problem, &plan.passes), &Carry::default())?;
        part(problem, problems);
        Ok(())
    }
}

/// Calls a function on all jobs, on all threads of the pool or on this one.
fn each<T: Send>(jobs: &mut [Job<T>], on_threads: bool, work: impl Fn(&mut Job<T>) + Sync) {
    if on_threads { jobs.par_iter_mut().for_each(&work) } else { jobs.iter_mut().for_each(work) }
}
