//! `drystone render`.

use std::path::{Path, PathBuf};

use clap::Args;

use super::output::{print, replacing, say};
use super::progress::Progress;
use super::scene::{MACHINE, SceneArgs, SleepArgs, WorldsArgs};
use super::words;
use crate::files;
use crate::view::{Output, recorded};
use drystone::backend::{BackendChoice, choose};
use drystone::stages::memory;
use drystone::{Error, Reference, Result, Simulation, SolverConfig};
use drystone_scenes::{CATALOGUE, Replay, Scene, Spawners};
use drystone_view::{Canvas, ColorBy, Film, Look, evenly, scene_of};

/// Memory of a body in a frame: pose and color (bytes).
const FRAME: f64 = 32.0;

const PICTURES: &str = "Pictures";

#[derive(Args)]
pub struct RenderArgs {
    #[command(flatten)]
    scene: Option<SceneArgs>,
    /// Backend that runs the sweeps.
    #[arg(long, value_parser = words::of::<BackendChoice>(), default_value_t, help_heading = MACHINE)]
    backend: BackendChoice,
    #[command(flatten)]
    sleep: SleepArgs,
    /// FILE.png, FILE.gif, FILE.mp4, or FOLDER/ for numbered PNGs.
    #[arg(long, help_heading = PICTURES, value_name = "PATH", required_unless_present = "gallery")]
    out: Option<PathBuf>,
    /// Number of pictures, evenly spaced over the run.
    ///
    /// A single picture shows the end of the run. The default is 1 for PNG and 60 for the other formats.
    #[arg(long, help_heading = PICTURES, value_name = "K", value_parser = clap::value_parser!(u32).range(1..))]
    frames: Option<u32>,
    /// Width and height in pixels.
    #[arg(long, help_heading = PICTURES, value_name = "WxH", default_value = "960x640", value_parser = parse_size)]
    size: (u32, u32),
    /// Quantity that determines the colors of bodies.
    #[arg(long, help_heading = PICTURES, value_parser = words::of::<ColorBy>(), default_value_t)]
    color: ColorBy,
    /// Angle of the camera around the scene, in degrees.
    #[arg(long, help_heading = PICTURES, value_name = "DEGREES", allow_hyphen_values = true, default_value_t = 30.0)]
    yaw: f32,
    /// Elevation of the camera above the horizon, in degrees.
    #[arg(long, help_heading = PICTURES, value_name = "DEGREES", allow_hyphen_values = true, default_value_t = 25.0)]
    pitch: f32,
    /// Draw the motion in a CSV file that `drystone run --out` wrote for the same scene, without solving it again.
    #[arg(long, help_heading = PICTURES, value_name = "FILE")]
    from: Option<PathBuf>,
    /// Draw every scene of the catalogue into this folder, with a page.
    #[arg(long, help_heading = PICTURES, value_name = "FOLDER", conflicts_with_all = ["out", "from", "frames", "SceneArgs"])]
    gallery: Option<PathBuf>,
}

impl RenderArgs {
    pub fn run(&self) -> Result<()> {
        match (&self.gallery, &self.scene, &self.out) {
            (Some(folder), ..) => self.gallery(folder),
            (None, Some(scene), Some(out)) => self.film(scene, out),
            _ => Err(Error::input("render: name a scene and --out, or --gallery FOLDER")),
        }
    }

    fn film(&self, args: &SceneArgs, out: &Path) -> Result<()> {
        Output::check(out)?;
        let mut replay = args.recording()?;
        let (scene, mut config) = match &mut replay {
            Some(replay) => {
                let simulation = replay.begin(Box::new(Reference::<f32>::new()))?;
                (scene_of(replay, &simulation), simulation.config().clone())
            }
            None => args.load(&WorldsArgs::ONE)?,
        };
        self.sleep.apply(&mut config);
        args.set_threads(self.backend);
        let png = out.extension().is_some_and(|e| e == "png");
        let frames = self.frames.unwrap_or(if png { 1 } else { 60 });
        if png && frames > 1 {
            return Err(Error::input(format!(
                "--frames {frames}: a PNG is one picture; write FILE.gif, FILE.mp4 or FOLDER/"
            )));
        }
        // Report errors of the canvas and the file before the run.
        let mut canvas = Canvas::new(&scene.world, self.size)?;
        let seconds = f64::from(scene.steps) * f64::from(scene.dt);
        let mut output = Output::open(out, self.size, f64::from(frames) / seconds.max(1e-3))?;
        let film = match &self.from {
            Some(path) => recorded(scene, self.color, path)?.thinned(frames as usize),
            None => self.shoot(scene, config, replay, frames, args.json)?,
        };
        film.draw(&mut canvas, &self.look(), |picture| output.add(picture))?;
        replacing(out, || output.finish())?;
        print(out.display())
    }

    /// Solves the scene, or replays its recording, and keeps `frames` evenly spaced states.
    fn shoot(
        &self,
        scene: Scene,
        config: SolverConfig,
        mut replay: Option<Replay>,
        frames: u32,
        quiet: bool,
    ) -> Result<Film> {
        let (backend, why) = choose(self.backend, scene.world.dynamic_count(), false)?;
        if !quiet {
            say(why);
        }
        let kept: Vec<usize> = evenly(scene.steps as usize + 1, frames as usize).collect();
        memory::check(FRAME * (scene.world.bodies.len() * kept.len()) as f64, format_args!("{} pictures", kept.len()))?;
        let mut spawners = Spawners::new(&scene);
        let mut simulation = match &mut replay {
            Some(replay) => replay.begin(backend)?,
            None => Simulation::with(scene.world.clone(), config, backend)?,
        };
        let bar = Progress::steps(scene.steps, quiet);
        let (steps, dt) = (scene.steps, scene.dt);
        let mut film = Film::new(scene, self.color);
        for step in 0..=steps {
            if step > 0 {
                match &mut replay {
                    Some(replay) => drop(replay.step(&mut simulation)?),
                    None => {
                        spawners.before_step(&mut simulation.world, dt);
                        simulation.step(dt)?;
                    }
                }
                bar.inc();
            }
            if kept.binary_search(&(step as usize)).is_ok() {
                film.add(f64::from(step) * f64::from(dt), &mut simulation);
            }
        }
        bar.finish();
        Ok(film)
    }

    fn look(&self) -> Look {
        let (yaw, pitch) = (self.yaw.to_radians(), self.pitch.clamp(-89.0, 89.0).to_radians());
        Look { yaw, pitch }
    }

    /// Draws every scene of the catalogue after a third of its steps, and writes a page.
    fn gallery(&self, folder: &Path) -> Result<()> {
        std::fs::create_dir_all(folder).map_err(Error::file(folder))?;
        let (width, height) = self.size;
        let mut page = format!(
            "# The scenes of the catalogue\n\n`drystone render --gallery {} --size {width}x{height}` makes this page: \
             each scene after a third of its\nsteps. `drystone render NAME --steps N --out FILE.png` draws one.\n",
            folder.display()
        );
        for entry in CATALOGUE {
            let mut scene = entry.build(&[])?;
            scene.steps = (scene.steps / 3).max(1);
            let path = folder.join(format!("{}.png", entry.name));
            let mut output = Output::open(&path, self.size, 1.0)?;
            let (name, steps) = (entry.name, scene.steps);
            let mut canvas = Canvas::new(&scene.world, self.size)?;
            let mut config = SolverConfig::default();
            self.sleep.apply(&mut config);
            let film = self.shoot(scene, config, None, 1, true)?;
            film.draw(&mut canvas, &self.look(), |picture| output.add(picture))?;
            output.finish()?;
            let picture = folder.file_name().map(Path::new).unwrap_or(folder).join(format!("{name}.png"));
            page += &format!("\n## {name}\n\n{}\n\n![{name}, {steps} steps]({})\n", entry.summary, picture.display());
        }
        let page_path = folder.with_extension("md");
        files::write(&page_path, page.as_bytes())?;
        print(page_path.display())
    }
}

pub(super) fn parse_size(text: &str) -> std::result::Result<(u32, u32), String> {
    let parsed = text.split_once('x').and_then(|(w, h)| Some((w.parse().ok()?, h.parse().ok()?)));
    parsed
        .filter(|&(w, h): &(u32, u32)| (1..=16_384).contains(&w) && (1..=16_384).contains(&h))
        .ok_or_else(|| "write it as WIDTHxHEIGHT, each 1 to 16384 pixels".into())
}
