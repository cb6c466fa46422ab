//! `drystone run`.

use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};

use clap::Args;

use super::output::{plain_table, print, print_json, replacing, say};
use super::progress::Progress;
use super::scene::{BackendArgs, MACHINE, OUTPUT, SceneArgs, SleepArgs, WorldsArgs, check_touching};
use crate::files::{self, Draft};
use crate::report::{RunReport, Trajectory};
use drystone::backend::choose;
use drystone::{Error, Result, Simulation};
use drystone_scenes::{Recorder, RecordingIntervals, Scene, SceneFile, Spawners};

#[derive(Args)]
pub struct RunArgs {
    #[command(flatten)]
    scene: SceneArgs,
    #[command(flatten)]
    backend: BackendArgs,
    /// Measure the time of each kernel with the clock of the GPU.
    ///
    /// A software adapter is slower with this clock.
    #[arg(long, help_heading = MACHINE)]
    kernel_times: bool,
    #[command(flatten)]
    sleep: SleepArgs,
    #[command(flatten)]
    worlds: WorldsArgs,
    /// Write the motion of all bodies except fixed ones as CSV.
    #[arg(long, value_name = "FILE", help_heading = OUTPUT)]
    out: Option<PathBuf>,
    /// Write the world at the end as a scene file.
    ///
    /// The file has poses, velocities, and the remaining spawners, but not the impulses of contacts.
    #[arg(long, value_name = "FILE", help_heading = OUTPUT)]
    out_scene: Option<PathBuf>,
    /// Write every K-th step.
    #[arg(long, help_heading = OUTPUT, value_name = "K", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..))]
    every: u32,
    /// Write the contact problem of a step, for `drystone solve`.
    ///
    /// Step 1 is the first.
    #[arg(long, value_name = "STEP:FILE", help_heading = OUTPUT, value_parser = step_and_file)]
    save_problem: Option<(u32, PathBuf)>,
    /// Record the run, for `drystone replay`, `view` and `render`.
    #[arg(long, value_name = "FILE", help_heading = OUTPUT, conflicts_with = "save_problem")]
    record: Option<PathBuf>,
    /// Steps from one hash of all bodies to the next in the recording.
    #[arg(long, value_name = "K", help_heading = OUTPUT, default_value_t = 10, requires = "record", hide_short_help = true)]
    #[arg(value_parser = clap::value_parser!(u32).range(1..))]
    hash_every: u32,
    /// Steps from one whole state to the next in the recording.
    #[arg(long, value_name = "K", help_heading = OUTPUT, default_value_t = 600, requires = "record", hide_short_help = true)]
    #[arg(value_parser = clap::value_parser!(u32).range(1..))]
    state_every: u32,
}

fn step_and_file(text: &str) -> std::result::Result<(u32, PathBuf), &'static str> {
    let (step, file) = text.split_once(':').ok_or("write it as STEP:FILE")?;
    let step = step.parse().map_err(|_| "STEP must be a whole number")?;
    if file.is_empty() { Err("FILE is missing") } else { Ok((step, file.into())) }
}

/// Refuses a step that cannot be saved, before the run.
fn check_save((step, file): &(u32, PathBuf), scene: &Scene) -> Result<()> {
    let (file, steps, name, joints) = (file.display(), scene.steps, &scene.name, scene.world.joints.len());
    let refuse = |why: String| Err(Error::input(format!("--save-problem {step}:{file}: {why}")));
    match joints {
        _ if !(1..=steps).contains(step) => refuse(format!("the run has steps 1 to {steps}")),
        0 => Ok(()),
        _ => refuse(format!("{name} has {joints} joints: a contact problem cannot have joints")),
    }
}

/// Adds the name of the file to an error of the recorder.
fn of_recording(path: &Path, error: Error) -> Error {
    match error {
        Error::File { source, .. } => Error::file(path)(source),
        other => other,
    }
}

impl RunArgs {
    fn recorder(&self, title: &str, draft: &Draft, simulation: &mut Simulation) -> Result<Recorder<BufWriter<File>>> {
        let intervals = RecordingIntervals { hash: self.hash_every, state: self.state_every };
        Recorder::new(BufWriter::new(draft.create()?), title, simulation, intervals)
    }

    pub fn run(&self) -> Result<()> {
        let (mut scene, mut config) = self.scene.load(&self.worlds)?;
        self.save_problem.iter().try_for_each(|save| check_save(save, &scene))?;
        if self.out_scene.is_some() {
            SceneFile::of(&scene).map_err(|e| e.within("--out-scene"))?;
        }
        self.sleep.apply(&mut config);
        self.scene.set_threads(self.backend.choice);
        let (mut backend, why) = choose(self.backend.choice, scene.world.dynamic_count(), self.backend.exact)?;
        let mut trajectory = self.out.as_deref().map(Trajectory::create).transpose()?;
        say(why);
        let copy_bandwidth = if self.kernel_times { backend.time_kernels()? } else { None };
        let mut report = RunReport::new(&scene, &config, &*backend);
        report.copy_bandwidth = copy_bandwidth;
        let mut spawners = Spawners::new(&scene);
        let mut simulation = Simulation::with(std::mem::take(&mut scene.world), config, backend)?;
        let draft = self.record.as_deref().map(Draft::of).transpose()?;
        let recorder = draft.as_ref().map(|draft| self.recorder(&scene.name, draft, &mut simulation)).transpose();
        let named = |error: Error| match &self.record {
            Some(path) => of_recording(path, error),
            None => error,
        };
        let mut recorder = recorder.map_err(named)?;
        let bar = Progress::steps(scene.steps, self.scene.json);
        for step in 0..=scene.steps {
            if step > 0 {
                spawners.before_step(&mut simulation.world, scene.dt);
                let stats = match self.save_problem.as_ref().filter(|save| save.0 == step) {
                    Some((_, file)) => {
                        let name = format!("{}, step {step}", scene.name);
                        let (problem, stats) = drystone_problems::step_with_contacts(&mut simulation, &name, scene.dt)?;
                        check_touching(&problem)?;
                        replacing(file, || files::write(file, problem.to_text().as_bytes()))?;
                        stats
                    }
                    None => match &mut recorder {
                        Some(recorder) => recorder.step(&mut simulation, scene.dt).map_err(named)?,
                        None => simulation.step(scene.dt)?,
                    },
                };
                report.count(&simulation, &spawners);
                report.add(&stats);
                if stats.fault.is_some() {
                    report.faults.last().iter().for_each(say);
                }
                bar.inc();
            }
            if let Some(trajectory) = trajectory.as_mut().filter(|_| step % self.every == 0) {
                trajectory.write(step, scene.dt, &simulation.world)?;
            }
        }
        bar.finish();
        if let (Some(trajectory), Some(path)) = (trajectory, &self.out) {
            replacing(path, || trajectory.finish())?;
        }
        if let (Some(recorder), Some(draft), Some(path)) = (recorder, draft, &self.record) {
            recorder.finish().map_err(named)?;
            replacing(path, || draft.keep())?;
        }
        if let Some(path) = &self.out_scene {
            (scene.spawners, scene.leaving) = spawners.remaining(scene.dt);
            scene.world = simulation.world.clone();
            let file = SceneFile::of(&scene).map_err(|e| e.within("--out-scene"))?;
            replacing(path, || files::write(path, file.to_text().as_bytes()))?;
        }
        report.measure(&scene, simulation);
        if self.scene.json {
            print_json(&report)?;
        } else {
            print_table(&report)?;
        }
        match &report.first_non_finite {
            Some(body) => {
                let kept = match &self.record {
                    Some(file) => format!("`drystone replay {}` repeats the run", file.display()),
                    None => "the same command with --record FILE keeps the run, for a report".into(),
                };
                Err(Error::input(format!("body {body} left the finite range: do not use its results; {kept}")))
            }
            None => Ok(()),
        }
    }
}

fn print_table(report: &RunReport) -> Result<()> {
    let mut table = plain_table();
    table.add_rows(report.rows().into_iter().map(|(what, value)| [what, value]));
    print(table)
}
