//! `drystone replay`.

use std::path::PathBuf;

use clap::Args;

use super::output::{plain_table, print, print_json};
use super::progress::Progress;
use super::scene::{BackendArgs, set_threads};
use drystone::backend::choose;
use drystone::{Error, Reference, Result};
use drystone_scenes::Replay;

#[derive(Args)]
pub struct ReplayArgs {
    /// A file of `drystone run --record`.
    file: PathBuf,
    #[command(flatten)]
    backend: BackendArgs,
    /// Start at this step, from the nearest earlier state in the file.
    #[arg(long, value_name = "STEP", default_value_t = 0)]
    from: u32,
    /// Stop after this step, instead of after the last.
    #[arg(long, value_name = "STEP")]
    to: Option<u32>,
    /// Threads on the CPU; 0 means one for each core.
    #[arg(long, value_name = "N", default_value_t = 0)]
    #[arg(value_parser = clap::value_parser!(u16).range(0..=1024))]
    threads: u16,
    /// Print one JSON object instead of a table.
    #[arg(long)]
    json: bool,
}

impl ReplayArgs {
    pub fn run(&self) -> Result<()> {
        set_threads(self.threads, self.backend.choice);
        let bytes = std::fs::read(&self.file).map_err(Error::file(&self.file))?;
        let place = |e: Error| e.within(self.file.display());
        let mut replay = Replay::read(&bytes).map_err(place)?;
        let mut simulation = replay.begin(Box::new(Reference::<f32>::new())).map_err(place)?;
        let (backend, _) = choose(self.backend.choice, simulation.world.dynamic_count(), self.backend.exact)?;
        simulation.set_backend(backend);
        let last = self.to.unwrap_or(replay.len()).min(replay.len());
        if self.from > last {
            return Err(Error::input(format!("--from {}: the replay ends after step {last}", self.from)));
        }
        replay.seek(&mut simulation, self.from).map_err(place)?;
        let bar = Progress::steps(last - self.from, self.json);
        while replay.step_number() < last {
            replay.step(&mut simulation).map_err(place)?;
            bar.inc();
        }
        bar.finish();
        let difference = replay.first_difference();
        let time = replay.time();
        let (name, adapter) = (simulation.backend().name(), simulation.backend().adapter());
        let hash = format!("{:016x}", simulation.hash());
        if self.json {
            return print_json(&serde_json::json!({
                "title": replay.title(), "backend": name, "adapter": adapter, "steps": replay.len(), "from": self.from,
                "to": last, "time": time, "bodies": simulation.world.bodies.count(), "hash": hash, "first": difference,
            }));
        }
        let mut table = plain_table();
        table.add_row(["recording", replay.title()]);
        table.add_row(["backend", &format!("{name}, {adapter}")]);
        table.add_row(["steps", &format!("{} to {last} of {}, {time:.2} s", self.from, replay.len())]);
        table.add_row(["bodies", &simulation.world.bodies.count().to_string()]);
        table.add_row(["hash", &hash]);
        print(table)?;
        match difference {
            None => print("no difference from the recording: all hashes agree"),
            Some(d) => {
                let body = d.body.map_or("a body".into(), |body| format!("body {}", body.index()));
                print(format_args!(
                    "first difference: {body} after step {}, of {} that differ; all agree after step {}",
                    d.step, d.bodies, d.agreed
                ))
            }
        }
    }
}
