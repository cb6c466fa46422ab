//! `maze [FOLDER]`: the boards of the maze game with drystone and with Rapier, as a page with pictures in FOLDER (docs).
//!
//! Twice: by one script for all, written by the pilot on drystone; and by the pilot itself, which looks where the ball is.

use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;

use drystone::maze::{BOARDS, CELL, Cell, Game, Map, Outcome, Played, Sample, Script, pilot, play};
use drystone::{Cpu, Error, Result, SolverConfig};
use drystone_peers::rapier_game;

/// An engine as it is set, its name in the tables and its color in the pictures.
type Player = (&'static str, &'static str, fn(Map) -> Result<Game>);

const PLAYERS: [Player; 4] = [
    ("drystone, 8 substeps", "#0072b2", |map| drystone(map, 8)),
    ("drystone, 4 substeps", "#56b4e9", |map| drystone(map, 4)),
    ("rapier, 4 substeps, 30 Hz (defaults)", "#d55e00", |map| rapier_game(map, 4, None)),
    ("rapier, 8 substeps, 120 Hz", "#e69f00", |map| rapier_game(map, 8, Some(0.125))),
];

fn drystone(map: Map, substeps: u32) -> Result<Game> {
    Game::new(map, SolverConfig { substeps, ..SolverConfig::default() }, Box::new(Cpu::new()))
}

/// How often a game is played for its time; the least counts.
const REPEATS: usize = 5;

fn main() -> ExitCode {
    let folder = std::env::args_os().nth(1).map_or_else(|| "docs".into(), PathBuf::from);
    match page(&folder) {
        Ok(()) => ExitCode::SUCCESS,
        Err(e) => {
            eprintln!("maze: {e}");
            e.exit_code().into()
        }
    }
}

fn page(folder: &Path) -> Result<()> {
    let mut text = String::new();
    for (board, _) in BOARDS {
        let map = Map::find(board)?;
        let script = pilot(PLAYERS[0].2(map.clone())?)?;
        let (mut by_script, mut by_pilot) = (Vec::new(), Vec::new());
        for (_, _, begin) in PLAYERS {
            by_script.push(timed(|| play(begin(map.clone())?, &script, |_| ()))?);
            // The pilot's own script is what the engine did with it.
            let own = pilot(begin(map.clone())?);
            let steered = own.and_then(|own: Script| timed(|| play(begin(map.clone())?, &own, |_| ())));
            by_pilot.push(steered);
        }
        let _ = write!(text, "\n## {board}\n\n| one script for all | ended | time s | slip rms mm/s | slip max mm/s | rolling | deepest mm | us a step |\n|---|---|---|---|---|---|---|---|\n");
        for ((name, ..), (played, us)) in PLAYERS.iter().zip(&by_script) {
            text += &row(name, played, *us);
        }
        let _ = write!(text, "\n| the pilot steers | ended | time s | slip rms mm/s | slip max mm/s | rolling | deepest mm | us a step |\n|---|---|---|---|---|---|---|---|\n");
        for ((name, ..), steered) in PLAYERS.iter().zip(&by_pilot) {
            match steered {
                Ok((played, us)) => text += &row(name, played, *us),
                Err(e) => {
                    let _ = writeln!(text, "| {name} | {e} | | | | | | |");
                }
            }
        }
        let tracks = by_script.iter().zip(PLAYERS).map(|((played, _), (_, color, _))| (&played.track[..], color));
        write_file(&folder.join(format!("maze/{board}.svg")), &picture(&map, tracks))?;
        let _ = write!(text, "\n![tracks on the {board} board](maze/{board}.svg)\n");
    }
    let legend = PLAYERS.map(|(name, color, _)| format!("{name} `{color}`")).join(", ");
    let page = format!("{}\nColors of the tracks, which follow the one script: {legend}.\n{text}", include_str!("maze_head.md"));
    write_file(&folder.join("maze.md"), &page)?;
    println!("{}", folder.join("maze.md").display());
    Ok(())
}

/// Plays a few times; the game, and its least time [us a step].
fn timed(play: impl Fn() -> Result<Played>) -> Result<(Played, f64)> {
    let mut least = f64::INFINITY;
    let mut last = None;
    for _ in 0..REPEATS {
        let start = Instant::now();
        let played = play()?;
        least = least.min(start.elapsed().as_secs_f64() * 1e6 / f64::from(played.steps.max(1)));
        last = Some(played);
    }
    last.map(|played| (played, least)).ok_or_else(|| Error::input("no game was played"))
}

fn row(name: &str, played: &Played, us: f64) -> String {
    let ended = match played.outcome {
        Outcome::Goal => "goal",
        Outcome::Hole => "hole",
        Outcome::Time => "on the way",
    };
    let rolling = 100.0 * f64::from(played.slip.steps) / f64::from(played.steps.max(1));
    format!(
        "| {name} | {ended} | {:.2} | {:.3} | {:.2} | {rolling:.0} % | {:.4} | {us:.0} |\n",
        played.time,
        played.slip.rms * 1e3,
        played.slip.max * 1e3,
        played.penetration * 1e3
    )
}

/// The board from above with the tracks on it.
fn picture<'a>(map: &Map, tracks: impl Iterator<Item = (&'a [Sample], &'static str)>) -> String {
    const SCALE: f32 = 40.0;
    let (width, height) = (map.columns as f32 * SCALE, map.rows as f32 * SCALE);
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"-4 -4 {} {}\" width=\"{width}\">\n<rect width=\"{width}\" \
         height=\"{height}\" fill=\"#f2e6cf\" stroke=\"#96623a\" stroke-width=\"8\"/>\n",
        width + 8.0,
        height + 8.0
    );
    for (row, column) in (0..map.rows).flat_map(|r| (0..map.columns).map(move |c| (r, c))) {
        let (x, y) = (column as f32 * SCALE, row as f32 * SCALE);
        let _ = match map.at(row as isize, column as isize) {
            Cell::Wall => writeln!(svg, "<rect x=\"{x}\" y=\"{y}\" width=\"{SCALE}\" height=\"{SCALE}\" fill=\"#96623a\"/>"),
            Cell::Hole => {
                let (x, y, r) = (x + 0.5 * SCALE, y + 0.5 * SCALE, 0.4 * SCALE);
                writeln!(svg, "<circle cx=\"{x}\" cy=\"{y}\" r=\"{r}\" fill=\"#555\"/>")
            }
            Cell::Floor if (row, column) == map.goal => {
                writeln!(svg, "<rect x=\"{x}\" y=\"{y}\" width=\"{SCALE}\" height=\"{SCALE}\" fill=\"#8cc88f\"/>")
            }
            Cell::Floor => Ok(()),
        };
    }
    for (track, color) in tracks {
        let place = |s: &Sample| {
            let at = |x: f32, cells: usize| (x / CELL + 0.5 * cells as f32) * SCALE;
            format!("{:.1},{:.1}", at(s.ball[0], map.columns), at(s.ball[2], map.rows))
        };
        let points: Vec<String> = track.iter().map(place).collect();
        let _ = writeln!(svg, "<polyline points=\"{}\" fill=\"none\" stroke=\"{color}\" stroke-width=\"2\"/>", points.join(" "));
    }
    svg + "</svg>\n"
}

/// Writes a text at once or not at all.
fn write_file(path: &Path, text: &str) -> Result<()> {
    let hidden = path.with_extension("part");
    let written = path.parent().map_or(Ok(()), std::fs::create_dir_all);
    written
        .and_then(|()| std::fs::write(&hidden, text))
        .and_then(|()| std::fs::rename(&hidden, path))
        .map_err(Error::file(path))
}
