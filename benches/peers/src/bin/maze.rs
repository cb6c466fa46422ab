//! `maze [FOLDER]`: the boards of the maze game with drystone, Rapier and Bullet, as a page with pictures in FOLDER
//! (docs).
//!
//! Three times: by the pilot, which looks where the ball is; by one script for all, which the pilot wrote on drystone;
//! and by another, which it wrote on Rapier.

use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;

use drystone::backend::{BackendChoice, choose};
use drystone::stats::median;
use drystone::{Error, Result, SolverConfig};
use drystone_cli::files;
use drystone_cli::report::engine_color;
use drystone_cli::report::rounds::interleave;
use drystone_maze::{BOARDS, CELL, Cell, Game, Map, Outcome, Played, Script, pilot, play};
use drystone_peers::{Engine, bullet_game, rapier_game};
use plotters::prelude::*;

/// An engine as it is set.
struct Player {
    name: &'static str,
    begin: fn(Map) -> Result<Game>,
    /// Its track in the pictures, if it has one there.
    track: Option<Track>,
}

/// A track in the color of an engine.
#[derive(Clone, Copy)]
enum Track {
    Full(&'static str),
    /// Half as dark.
    Faint(&'static str),
}

impl Track {
    fn color(self) -> RGBColor {
        let (Self::Full(engine) | Self::Faint(engine)) = self;
        let (r, g, b) = engine_color(engine);
        match self {
            Self::Full(_) => RGBColor(r, g, b),
            Self::Faint(_) => {
                let [r, g, b] = [r, g, b].map(|channel| 128 + channel / 2);
                RGBColor(r, g, b)
            }
        }
    }
}

const PLAYERS: [Player; 11] = [
    Player { name: "drystone, 8 substeps (default)", begin: |m| drystone(m, 8), track: Some(Track::Full("drystone")) },
    Player { name: "drystone, 4 substeps", begin: |m| drystone(m, 4), track: None },
    Player { name: "drystone, 32 substeps", begin: |m| drystone(m, 32), track: Some(Track::Faint("drystone")) },
    Player { name: "drystone, 8 substeps, software GPU", begin: drystone_gpu, track: None },
    Player {
        name: "rapier, 4 iterations, 30 Hz (default)",
        begin: |m| rapier_game(m, 4, None, 1.0),
        track: Some(Track::Faint("rapier")),
    },
    Player {
        name: "rapier, length unit 3 cm",
        begin: |m| rapier_game(m, 4, None, 0.03),
        track: Some(Track::Full("rapier")),
    },
    Player {
        name: "rapier, length unit 3 cm, 8 iterations, 120 Hz",
        begin: |m| rapier_game(m, 8, Some(0.125), 0.03),
        track: None,
    },
    Player {
        name: "rapier, length unit 3 cm, 32 iterations, 480 Hz",
        begin: |m| rapier_game(m, 32, Some(0.125), 0.03),
        track: None,
    },
    Player { name: "bullet, 1 substep (default)", begin: |m| bullet_game(m, 1, 1.0), track: None },
    Player { name: "bullet, length unit 3 cm", begin: |m| bullet_game(m, 1, 0.03), track: Some(Track::Full("bullet")) },
    Player { name: "bullet, length unit 3 cm, 4 substeps", begin: |m| bullet_game(m, 4, 0.03), track: None },
];

/// The players of this build.
fn players() -> Vec<&'static Player> {
    let has_bullet = Engine::built().contains(&Engine::Bullet);
    PLAYERS.iter().filter(|player| has_bullet || !player.name.starts_with("bullet")).collect()
}

/// Who has written the scripts for all: the default of one, and the other with what suits it best.
const DRYSTONE: usize = 0;
const RAPIER: usize = 5;

fn drystone(map: Map, substeps: u32) -> Result<Game> {
    let config = SolverConfig::default().without_sleep().with(|c| c.substeps = substeps);
    Game::new(map, config, choose(BackendChoice::Cpu, 1, false)?.0)
}

fn drystone_gpu(map: Map) -> Result<Game> {
    Game::new(map, SolverConfig::default().without_sleep(), choose(BackendChoice::Gpu, 1, false)?.0)
}

/// How often the pilot's game is played for its time, all players in turn; the GPU, which is slow here, plays once.
const ROUNDS: usize = 9;
const GPU: usize = 3;

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
    // The rounds must not wait for threads that a ball has no use for.
    let _ = rayon::ThreadPoolBuilder::new().num_threads(1).use_current_thread().build_global();
    let mut text = include_str!("maze_head.md").to_owned();
    let pictures = folder.join("maze");
    std::fs::create_dir_all(&pictures).map_err(Error::file(&pictures))?;
    for (board, _) in BOARDS {
        let map = Map::find(board)?;
        // A script that the pilot wrote is what it did with the engine.
        let players = players();
        let own: Vec<_> = players.iter().map(|player| pilot((player.begin)(map.clone())?)).collect();
        let by = |writer: usize| by_script(&players, &map, own[writer].as_ref().ok());
        let (by_drystone, by_rapier) = (by(DRYSTONE)?, by(RAPIER)?);
        let _ = write!(text, "\n## {board}\n");
        table(&mut text, &map, &own, &by_drystone, &by_rapier)?;
        let tracks = by_drystone.iter().zip(players).filter_map(|(played, player)| Some((played.as_ref()?, player)));
        let path = pictures.join(format!("{board}.svg"));
        files::write(&path, picture(&map, tracks).as_bytes())?;
        let _ = write!(text, "\n![tracks on the {board} board](maze/{board}.svg)\n");
    }
    let path = folder.join("maze.md");
    files::write(&path, text.as_bytes())?;
    println!("{}", path.display());
    Ok(())
}

/// What all players make of one script, if there is one.
fn by_script(players: &[&Player], map: &Map, script: Option<&Script>) -> Result<Vec<Option<Played>>> {
    let game = |player: &&Player| script.map(|script| play((player.begin)(map.clone())?, script, |_| ())).transpose();
    players.iter().map(game).collect()
}

/// Adds a table of all players: the game with the pilot, or why it does not win, and the games by the two scripts.
fn table(
    text: &mut String,
    map: &Map,
    scripts: &[Result<Script>],
    by_drystone: &[Option<Played>],
    by_rapier: &[Option<Played>],
) -> Result<()> {
    let player = |(k, (player, script))| (k, player, script, Vec::new(), None);
    let mut games: Vec<_> = players().into_iter().zip(scripts).enumerate().map(player).collect();
    let mut first = f64::NAN;
    interleave(ROUNDS, &mut games, |round, (k, player, script, ratios, game)| {
        let Some(script) = script.as_ref().ok().filter(|_| *k != GPU || round == 0) else { return Ok(()) };
        let begun = (player.begin)(map.clone())?;
        let start = Instant::now();
        let played = play(begun, script, |_| ())?;
        let step = start.elapsed().as_secs_f64() / f64::from(played.steps.max(1));
        first = if *k == 0 { step } else { first };
        ratios.push(step / first);
        *game = Some(played);
        Ok(())
    })?;
    text.push_str(
        "\n| engine | pilot: end, s | slip rms mm/s | slip max mm/s | rolling | deepest mm | time a step \
         | drystone's script: end, s | Rapier's script: end, s |\n|---|---|--:|--:|--:|--:|--:|---|---|\n",
    );
    for (k, Player { name, .. }, script, ratios, game) in &games {
        let piloted = match (game, script) {
            (Some(played), _) => format!("{} | {} | {:.2}", end(played), errors(played), median(ratios)),
            (None, Err(e)) => without_game(&short(e, map)),
            (None, Ok(_)) => without_game("not played"),
        };
        let [drystone, rapier] = [by_drystone, by_rapier].map(|games| games[*k].as_ref().map_or("-".into(), end));
        let _ = writeln!(text, "| {name} | {piloted} | {drystone} | {rapier} |");
    }
    Ok(())
}

/// The cells of the pilot's game if there is none: why, and nothing in the columns of figures.
fn without_game(why: &str) -> String {
    why.to_owned() + &" | ".repeat(5)
}

/// Why the pilot did not win, without the board and the ball, which are the same in the whole table.
fn short(e: &Error, map: &Map) -> String {
    let message = e.to_string();
    message.strip_prefix(&format!("{}: the ball ", map.name)).unwrap_or(&message).to_owned()
}

/// `goal 11.80`.
fn end(played: &Played) -> String {
    let ended = match played.outcome {
        Outcome::Goal => "goal",
        Outcome::Hole => "hole",
        Outcome::Time => "on the way",
    };
    format!("{ended} {:.2}", played.time)
}

/// Slip, share of rolling steps and deepest overlap.
fn errors(played: &Played) -> String {
    let rolling = 100.0 * f64::from(played.slip.steps) / f64::from(played.steps.max(1));
    let (rms, max, deepest) = (played.slip.rms * 1e3, played.slip.max * 1e3, played.penetration * 1e3);
    format!("{rms:.3} | {max:.2} | {rolling:.0} % | {deepest:.4}")
}

/// Pixels of a side of a cell, of the space around the board, and of a line of the legend.
const SIDE: usize = 48;
const MARGIN: usize = 56;
const LINE: i32 = 20;

type Drawn = std::result::Result<(), Box<dyn std::error::Error>>;

/// The board from above with the tracks on it, as SVG text.
fn picture<'a>(map: &Map, tracks: impl Iterator<Item = (&'a Played, &'a Player)>) -> String {
    let tracks: Vec<_> =
        tracks.filter_map(|(played, player)| Some((played, player.name, player.track?.color()))).collect();
    let height = map.rows * SIDE + MARGIN;
    let legend = 12 + LINE * tracks.len() as i32;
    let size = ((map.columns * SIDE + MARGIN + 12) as u32, height as u32 + 12 + legend as u32);
    let mut text = String::new();
    let root = SVGBackend::with_string(&mut text, size).into_drawing_area();
    let drawn = (|| -> Drawn {
        root.fill(&WHITE)?;
        let (upper, lower) = root.split_vertically(height as i32 + 12);
        board(&upper, map, &tracks)?;
        for (k, (_, name, color)) in (0..).zip(&tracks) {
            let y = 6 + LINE * k;
            lower.draw(&PathElement::new(
                [(MARGIN as i32, y + 7), (MARGIN as i32 + 24, y + 7)],
                color.stroke_width(3),
            ))?;
            lower.draw(&Text::new(*name, (MARGIN as i32 + 32, y), ("sans-serif", 15)))?;
        }
        root.present()?;
        Ok(())
    })();
    // Writing to memory does not fail.
    debug_assert!(drawn.is_ok(), "{drawn:?}");
    drop(root);
    text
}

/// Draws the map and the tracks; axes in centimeters from the far left corner of the board.
fn board(
    area: &DrawingArea<SVGBackend, plotters::coord::Shift>,
    map: &Map,
    tracks: &[(&Played, &str, RGBColor)],
) -> Drawn {
    let cell = f64::from(CELL) * 100.0;
    let (width, depth) = (map.columns as f64 * cell, map.rows as f64 * cell);
    let mut chart = ChartBuilder::on(area)
        .margin(12)
        .x_label_area_size(MARGIN as u32 - 12)
        .y_label_area_size(MARGIN as u32 - 12)
        .build_cartesian_2d(0.0..width, depth..0.0)?;
    let (wall, floor) = (RGBColor(150, 98, 58), RGBColor(242, 230, 207));
    let square = |row: usize, column: usize, color: RGBColor| {
        let low = (column as f64 * cell, row as f64 * cell);
        Rectangle::new([low, (low.0 + cell, low.1 + cell)], color.filled())
    };
    let places = (0..map.rows).flat_map(|row| (0..map.columns).map(move |column| (row, column)));
    let color = |place: (usize, usize)| match map.at(place.0 as isize, place.1 as isize) {
        Cell::Wall => wall,
        _ if place == map.goal => RGBColor(140, 200, 143),
        _ => floor,
    };
    chart.draw_series(places.clone().map(|(row, column)| square(row, column, color((row, column)))))?;
    let holes = places.filter(|&(row, column)| map.at(row as isize, column as isize) == Cell::Hole);
    let middle = |(row, column): (usize, usize)| ((column as f64 + 0.5) * cell, (row as f64 + 0.5) * cell);
    chart
        .draw_series(holes.map(|place| Circle::new(middle(place), 0.4 * SIDE as f64, RGBColor(85, 85, 85).filled())))?;
    chart.configure_mesh().disable_mesh().x_desc("to the right, cm").y_desc("to the front, cm").draw()?;
    for (played, _, color) in tracks {
        let place =
            |ball: [f32; 3]| (f64::from(ball[0]) * 100.0 + 0.5 * width, f64::from(ball[2]) * 100.0 + 0.5 * depth);
        let points: Vec<_> = played.track.iter().map(|sample| place(sample.ball)).collect();
        let end = points.last().copied();
        chart.draw_series(LineSeries::new(points, color.stroke_width(2)))?;
        // Where it ended.
        chart.draw_series(end.map(|end| Circle::new(end, 5, color.filled())))?;
    }
    Ok(())
}
