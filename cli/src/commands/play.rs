//! `drystone play`.

use std::path::PathBuf;

use clap::{Args, Subcommand};

use super::output::{print, print_json, replacing};
use super::scene::BackendArgs;
use crate::files;
use crate::settings;
use drystone::backend::choose;
use drystone::{Error, Result, SolverConfig};
use drystone_maze::{Game, Map, Outcome, Played, Script, pilot, play};

#[derive(Args)]
pub struct PlayArgs {
    #[command(subcommand)]
    game: GameArgs,
}

#[derive(Subcommand)]
enum GameArgs {
    /// Roll the ball to the goal and past the holes: arrow keys or the mouse tilt the board.
    Maze(MazeArgs),
}

#[derive(Args)]
struct MazeArgs {
    /// One of easy, medium and hard, or the path of a map.
    #[arg(default_value = "easy")]
    board: String,
    /// Play this script of tilts without a window, and print the result.
    #[arg(long, value_name = "FILE")]
    script: Option<PathBuf>,
    /// Find a path to the goal, follow it, and write the tilts as a script.
    #[arg(long, value_name = "FILE", conflicts_with = "script")]
    pilot: Option<PathBuf>,
    /// Draw the game: FILE.gif, FILE.mp4, FOLDER/, or the middle of the game as FILE.png.
    #[cfg(feature = "view")]
    #[arg(long, value_name = "PATH", requires = "script")]
    out: Option<PathBuf>,
    /// Width and height of the pictures in pixels.
    #[cfg(feature = "view")]
    #[arg(long, value_name = "WxH", default_value = "480x360", value_parser = super::render::parse_size)]
    size: (u32, u32),
    /// Print one JSON object, with the ball's track.
    #[arg(long, requires = "script")]
    json: bool,
    #[command(flatten)]
    backend: BackendArgs,
    /// Set any setting; can be repeated.
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
}

impl PlayArgs {
    pub fn run(&self) -> Result<()> {
        let GameArgs::Maze(maze) = &self.game;
        maze.run()
    }
}

impl MazeArgs {
    fn run(&self) -> Result<()> {
        let map = Map::find(&self.board)?;
        let config = settings::awake(self.set.iter().map(String::as_str))?;
        let begin = |map, config| Game::new(map, config, choose(self.backend.choice, 1, self.backend.exact)?.0);
        if let Some(path) = &self.script {
            let text = std::fs::read_to_string(path).map_err(Error::file(path))?;
            let script = Script::parse(&path.display().to_string(), &text)?;
            let game = begin(map, config)?;
            #[cfg(feature = "view")]
            if let Some(out) = &self.out {
                return self.print(&self.draw(game, &script, out)?);
            }
            return self.print(&play(game, &script, |_| ())?);
        }
        if let Some(path) = &self.pilot {
            let script = pilot(begin(map, config)?)?;
            replacing(path, || files::write(path, script.text().as_bytes()))?;
            return print(path.display());
        }
        self.window(map, config)
    }

    #[cfg(feature = "view")]
    fn draw(&self, game: Game, script: &Script, out: &std::path::Path) -> Result<Played> {
        use crate::view::Output;
        use drystone_maze::SAMPLES;
        use drystone_view::{Canvas, draw_game, poses};
        // Report errors of the canvas and the file before the game.
        let (map, world) = (game.map.clone(), game.world().clone());
        let mut canvas = Canvas::new(&world, self.size)?;
        let mut output = Output::open(out, self.size, SAMPLES)?;
        let mut frames = Vec::new();
        let played = play(game, script, |game| frames.push(poses(game.world())))?;
        if out.extension().is_some_and(|e| e == "png") {
            frames = vec![frames.swap_remove(frames.len() / 2)];
        }
        draw_game(&mut canvas, &map, &world, &frames, |picture| output.add(picture))?;
        replacing(out, || output.finish())?;
        Ok(played)
    }

    #[cfg(feature = "view")]
    fn window(&self, map: Map, config: SolverConfig) -> Result<()> {
        let labyrinth = drystone_view::Labyrinth::new(map, config, self.backend.choice)?;
        crate::view::window::run(Box::new(labyrinth))
    }

    #[cfg(not(feature = "view"))]
    fn window(&self, _: Map, _: SolverConfig) -> Result<()> {
        Err(Error::input("play maze: a window needs a build with `--features view`; --script FILE plays without one"))
    }

    fn print(&self, played: &Played) -> Result<()> {
        if self.json {
            return print_json(played);
        }
        let how = match played.outcome {
            Outcome::Goal => "won",
            Outcome::Hole => "lost: the ball fell into a hole",
            Outcome::Time => "undecided when the script ended",
        };
        let slip = played.slip;
        print(format_args!("{} on {}: {how} after {:.2} s", played.board, played.engine, played.time))?;
        print(format_args!("  slip while rolling {:.3} mm/s rms, {:.3} mm/s at most", slip.rms * 1e3, slip.max * 1e3))?;
        print(format_args!("  penetration {:.4} mm deepest", f64::from(played.penetration) * 1e3))
    }
}
