//! `drystone play`.

use std::path::{Path, PathBuf};

use clap::{Args, Subcommand};

use super::{print, print_json};
use crate::backend::{BackendChoice, choose};
use crate::config::SolverConfig;
use crate::error::{Error, Result};
use crate::maze::{Game, Map, Outcome, Script, pilot, play};

/// Arguments of `drystone play`.
#[derive(Args)]
pub struct PlayArgs {
    #[command(subcommand)]
    game: GameArgs,
}

#[derive(Subcommand)]
enum GameArgs {
    /// Roll the ball to the goal and not into a hole: arrow keys or the mouse tilt the board.
    Maze(MazeArgs),
}

#[derive(Args)]
struct MazeArgs {
    /// easy, medium, hard, or the path of a map.
    #[arg(default_value = "easy")]
    board: String,
    /// Play this script of tilts without a window and print how it went.
    #[arg(long, value_name = "FILE")]
    script: Option<PathBuf>,
    /// Find the way, follow it, and write the tilts as a script.
    #[arg(long, value_name = "FILE", conflicts_with = "script")]
    pilot: Option<PathBuf>,
    /// Print one JSON object, with the ball's track.
    #[arg(long, requires = "script")]
    json: bool,
    /// What runs the sweeps.
    #[arg(long, value_enum, default_value_t)]
    backend: BackendChoice,
    /// Ask the GPU for the reference's results to the last bit.
    #[arg(long)]
    exact: bool,
    /// Any setting of the solver, as key=value; may be given several times.
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
}

impl PlayArgs {
    /// Plays.
    pub fn run(&self) -> Result<()> {
        let GameArgs::Maze(maze) = &self.game;
        maze.run()
    }
}

impl MazeArgs {
    fn run(&self) -> Result<()> {
        let map = Map::find(&self.board)?;
        let mut config = SolverConfig::default();
        self.set.iter().try_for_each(|assignment| config.set(assignment))?;
        let (backend, _) = choose(self.backend, 1, self.exact)?;
        if let Some(path) = &self.script {
            let text = std::fs::read_to_string(path).map_err(Error::file(path))?;
            let script = Script::parse(&path.display().to_string(), &text)?;
            return self.print(&play(Game::new(map, config, backend)?, &script)?);
        }
        if let Some(path) = &self.pilot {
            let script = pilot(Game::new(map, config, backend)?)?;
            write(path, &script.text())?;
            return print(path.display());
        }
        window(Game::new(map, config, backend)?)
    }

    fn print(&self, played: &crate::maze::Played) -> Result<()> {
        if self.json {
            return print_json(played);
        }
        let how = match played.outcome {
            Outcome::Goal => "won",
            Outcome::Hole => "lost: the ball fell into a hole",
            Outcome::Time => "not decided when the script ended",
        };
        let slip = played.slip;
        print(format_args!("{} on {}: {how} after {:.2} s", played.board, played.backend, played.time))?;
        print(format_args!("  slip while rolling {:.3} mm/s rms, {:.3} mm/s at most", slip.rms * 1e3, slip.max * 1e3))?;
        print(format_args!("  penetration {:.4} mm deepest", f64::from(played.penetration) * 1e3))
    }
}

/// Writes a text at once or not at all.
fn write(path: &Path, text: &str) -> Result<()> {
    let hidden = path.with_extension(format!("{}.part", std::process::id()));
    let written = std::fs::write(&hidden, text).and_then(|()| std::fs::rename(&hidden, path));
    if written.is_err() {
        let _ = std::fs::remove_file(&hidden);
    }
    written.map_err(Error::file(path))
}

fn window(_game: Game) -> Result<()> {
    Err(Error::input("play maze: give --script FILE; a window needs a build with `--features view`"))
}
