//! `drystone report rules`: what each rule of the course sheet does, from runs.

use std::fmt::Write as _;
use std::path::Path;

use crate::files;
use crate::settings;
use drystone::Simulation;
use drystone::backend::cpu::Reference;
use drystone::config::SolverConfig;
use drystone::metrics::{drift, in_place, in_place_count, rms_speed};
use drystone::scenes::Scene;
use drystone::world::{Body, Shape, World};
use drystone::{Error, Result};

use super::plot::{Frame, Scale, Series, svg};
use glam::{Quat, Vec3};

/// The page and its pictures.
pub struct RulesReport {
    /// Markdown.
    pub page: String,
    /// Name and SVG text of each picture.
    pub pictures: Vec<(&'static str, String)>,
}

impl RulesReport {
    /// Writes `rules.md` and the pictures into a directory, which is made if need be.
    pub fn write(&self, directory: &Path) -> Result<()> {
        let pictures = directory.join("rules");
        std::fs::create_dir_all(&pictures).map_err(Error::file(&pictures))?;
        for (name, text) in &self.pictures {
            let path = pictures.join(name);
            files::write(&path, text.as_bytes())?;
        }
        files::write(&directory.join("rules.md"), self.page.as_bytes())
    }
}

/// Length of every step here (s).
const DT: f32 = 1.0 / 60.0;

/// Runs everything and makes the page; `after_run` is called as often as [`RUNS`] says.
pub fn rules(mut after_run: impl FnMut()) -> Result<RulesReport> {
    let mut report = RulesReport { page: include_str!("rules_head.md").to_owned(), pictures: Vec::new() };
    clamping(&mut report, &mut after_run)?;
    stabilization(&mut report, &mut after_run)?;
    friction(&mut report, &mut after_run)?;
    heights(&mut report, &mut after_run)?;
    ratios(&mut report, &mut after_run)?;
    report.page.push_str(include_str!("rules_tail.md"));
    Ok(report)
}

/// The settings of the course sheet: no substeps, `iterations` sweeps, no soft contacts.
const SHEET: &str = "substeps=1 iterations=20 relax=0 stabilization=baumgarte";

fn settings(text: &str) -> Result<SolverConfig> {
    let mut config = SolverConfig::default().without_sleep();
    text.split_whitespace().try_for_each(|assignment| settings::set(&mut config, assignment))?;
    config.check()?;
    Ok(config)
}

fn simulate(world: World, settings_text: &str) -> Result<Simulation> {
    Simulation::new(world, settings(settings_text)?, Box::new(Reference::<f32>::new()))
}

/// How a standing scene fared.
struct Standing {
    /// Until some body was out of its place, or the run was over (s).
    seconds: f64,
    /// Largest horizontal distance of a body from where it began (m).
    drift: f64,
    /// Speed at the end (m/s).
    rms_speed: f64,
    /// Deepest overlap at the end (m).
    penetration: f64,
}

/// Runs until a body left its place, or for `seconds`.
fn stand(world: &World, settings_text: &str, seconds: f64) -> Result<Standing> {
    let mut simulation = simulate(world.clone(), settings_text)?;
    let steps = (seconds / f64::from(DT)).round() as u32;
    let mut time = 0.0;
    for step in 1..=steps {
        simulation.step(DT)?;
        time = f64::from(step) * f64::from(DT);
        if in_place_count(world, &simulation.world) < world.dynamic_count() {
            break;
        }
    }
    Ok(Standing {
        seconds: time,
        drift: drift(world, &simulation.world),
        rms_speed: rms_speed(&simulation.world),
        penetration: simulation.penetration().max,
    })
}

fn clamping(report: &mut RulesReport, after_run: &mut dyn FnMut()) -> Result<()> {
    let page = &mut report.page;
    let _ = writeln!(
        page,
        "\n## Clamping\n\nThe scene `misaligned` runs for at most 20 s with the settings {SHEET}. A stack stands until a box is half a box away from its first position.\n\n\
         | boxes | clamping | stands | drift | rms speed |\n|---|---|---|---|---|"
    );
    for n in [5, 10, 20] {
        let scene = Scene::find("misaligned", &[format!("n={n}")])?;
        for rule in ["per-correction", "accumulated"] {
            let s = stand(&scene.world, &format!("{SHEET} clamping={rule}"), 20.0)?;
            let stands = if s.seconds > 19.99 { "20 s, to the end".into() } else { format!("{:.2} s", s.seconds) };
            let _ =
                writeln!(page, "| {n} | {rule} | {stands} | {:.1} mm | {:.2} mm/s |", s.drift * 1e3, s.rms_speed * 1e3);
            after_run();
        }
        let s = stand(&scene.world, "", 20.0)?;
        let stands = if s.seconds > 19.99 { "20 s, to the end".into() } else { format!("{:.2} s", s.seconds) };
        let _ = writeln!(
            page,
            "| {n} | accumulated, default settings | {stands} | {:.1} mm | {:.2} mm/s |",
            s.drift * 1e3,
            s.rms_speed * 1e3
        );
        after_run();
    }
    Ok(())
}

/// The three ways to treat overlap, with the settings that each needs; 16 sweeps a step each.
const STABILIZATIONS: [(&str, &str); 3] = [
    ("none", "substeps=1 iterations=16 relax=0 stabilization=none"),
    ("baumgarte", "substeps=1 iterations=16 relax=0 stabilization=baumgarte"),
    ("soft", "substeps=8 iterations=1 relax=1 stabilization=soft"),
];

fn stabilization(report: &mut RulesReport, after_run: &mut dyn FnMut()) -> Result<()> {
    let scene = Scene::find("tower", &["n=10".into()])?;
    let mut lines = Vec::new();
    let _ = writeln!(
        report.page,
        "\n## Stabilization\n\nThe scene `tower` with 10 boxes runs for 20 s with 16 sweeps a step: `none` and `baumgarte` in one substep, `soft` in 8 substeps of 1 + 1 sweeps. *Energy added* is the largest rise of \
         kinetic and potential energy above an earlier minimum. *Exit speed* is the speed of a box that starts 5 cm deep in the floor.\n\n\
         | stabilization | deepest after 1 s | after 20 s | energy added | rms speed at rest | exit speed |\n|---|---|---|---|---|---|"
    );
    for (rule, text) in STABILIZATIONS {
        let mut simulation = simulate(scene.world.clone(), text)?;
        let energy = |w: &World| w.kinetic_energy() + w.potential_energy();
        let (mut lowest, mut added) = (energy(&simulation.world), 0.0_f64);
        let mut points = Vec::new();
        for step in 1..=1200_u32 {
            simulation.step(DT)?;
            let now = energy(&simulation.world);
            lowest = lowest.min(now);
            added = added.max(now - lowest);
            let deepest = simulation.solved_penetration().max;
            points.push((f64::from(step) * f64::from(DT), deepest * 1e3));
        }
        let exit = exit_speed(text)?;
        let rms = rms_speed(&simulation.world);
        let _ = writeln!(
            report.page,
            "| {rule} | {:.3} mm | {:.3} mm | {added:.3} J | {:.3} mm/s | {exit:.3} m/s |",
            points[59].1,
            points[1199].1,
            rms * 1e3
        );
        lines.push((rule.to_owned(), points));
        after_run();
    }
    report.page.push_str(
        "\nWithout stabilization the overlap that the first sweeps leave stays forever. Baumgarte stabilization removes the overlap, and the energy that \
         it adds shakes the tower. The soft contact first overlaps by the amount that its stiffness gives. The preload (`preload_rate`) then removes \
         the overlap, and the tower comes to rest; the energy added is the energy that lifts the tower by the overlap.\n",
    );
    report.picture(
        "stabilization.svg",
        "Deepest overlap in a tower of 10 boxes",
        ("overlap mm", Scale::Decades),
        lines,
    );
    Ok(())
}

/// Fastest that a box which begins 5 cm deep in the floor ever rises (m/s).
fn exit_speed(text: &str) -> Result<f64> {
    let mut world = World::new();
    world.add(Body::fixed().shape(Shape::half_space(Vec3::Y)));
    let cube = world.add(Body::dynamic().shape(Shape::cuboid(0.5, 0.5, 0.5)).position(0.0, 0.45, 0.0));
    let mut simulation = simulate(world, text)?;
    let mut fastest = 0.0_f64;
    for _ in 0..60 {
        simulation.step(DT)?;
        fastest = fastest.max(f64::from(simulation.world.bodies[cube].linear_velocity.y));
    }
    Ok(fastest)
}

/// Settings of a rule, with enough substeps that the rule and not the step decides.
fn friction_settings(rule: &str) -> String {
    format!("substeps=8 friction={rule}")
}

/// A block of 1 x 0.4 x 1 m on a floor, with the direction of its edges along the axes.
fn block_on_floor(velocity: Vec3, spin: f32, mu: f32) -> World {
    let mut world = World::new();
    world.add(Body::fixed().shape(Shape::half_space(Vec3::Y)).friction(mu));
    let block = Body::dynamic().shape(Shape::cuboid(0.5, 0.2, 0.5)).friction(mu).position(0.0, 0.2, 0.0);
    world.add(block.velocity(velocity, Vec3::new(0.0, spin, 0.0)));
    world
}

fn friction(report: &mut RulesReport, after_run: &mut dyn FnMut()) -> Result<()> {
    let _ = writeln!(
        report.page,
        "\n## Friction\n\nA block with mu 0.4 starts at 4 m/s at an angle to its edges. The table has its distance until it rests; Coulomb's law gives v²/(2 mu g) = {:.3} m. The axes \
         of the box rule are the tangents of the contact. *Creep* is the distance that a block at rest on a slope of 20° with mu 0.5 moves in 10 s.\n\n\
         | friction | 0° | 15° | 30° | 45° | largest spread | creep |\n|---|---|---|---|---|---|---|",
        16.0 / (2.0 * 0.4 * 9.81)
    );
    for rule in ["none", "slip", "box", "disc"] {
        let mut distances = Vec::new();
        for degrees in [0.0_f32, 15.0, 30.0, 45.0] {
            distances.push(sliding_distance(rule, degrees)?);
            after_run();
        }
        let creep = creep(rule)?;
        let (low, high) = distances.iter().fold((f64::INFINITY, 0.0_f64), |(l, h), &d| (l.min(d), h.max(d)));
        let cells: Vec<_> =
            distances.iter().map(|d| if *d > 10.0 { "slides on".into() } else { format!("{d:.3} m") }).collect();
        let spread = if high > 10.0 { "-".into() } else { format!("{:.2} %", 100.0 * (high / low - 1.0)) };
        let creep = if creep > 1.0 { "slides off".into() } else { format!("{:.2} mm", creep * 1e3) };
        let _ = writeln!(report.page, "| {rule} | {} | {spread} | {creep} |", cells.join(" | "));
    }
    spinning_plate(report, after_run)?;
    thrown_ball(report, after_run)
}

fn sliding_distance(rule: &str, degrees: f32) -> Result<f64> {
    let direction = Quat::from_rotation_y(degrees.to_radians()) * Vec3::X;
    let mut simulation = simulate(block_on_floor(direction * 4.0, 0.0, 0.4), &friction_settings(rule))?;
    for _ in 0..240 {
        simulation.step(DT)?;
    }
    let p = simulation.world.bodies[1].position;
    Ok(f64::from(p.x.hypot(p.z)))
}

/// How far a block on a slope of 20 degrees moves in 10 s (m); the slope is gravity's.
fn creep(rule: &str) -> Result<f64> {
    let mut world = block_on_floor(Vec3::ZERO, 0.0, 0.5);
    world.gravity = Quat::from_rotation_y(0.5) * Quat::from_rotation_z(20_f32.to_radians()) * world.gravity;
    let mut simulation = simulate(world, &friction_settings(rule))?;
    for _ in 0..600 {
        simulation.step(DT)?;
    }
    let p = simulation.world.bodies[1].position;
    Ok(f64::from(p.x.hypot(p.z)))
}

fn spinning_plate(report: &mut RulesReport, after_run: &mut dyn FnMut()) -> Result<()> {
    let _ = writeln!(
        report.page,
        "\nThe same block starts at 2 m/s and spins at 5 rad/s. Under Coulomb's law sliding and spinning end at the same time. Friction acts below the center of mass and shifts the load forward, so the path is not quite straight. Friction per manifold has neither this effect nor the effect that sliding weakens friction against the spin.\n\n\
         | friction | slides for | spins for | distance from its line |\n|---|---|---|---|"
    );
    let mut lines = Vec::new();
    let cases = [("slip", ""), ("box", ""), ("disc", ""), ("disc", "friction_at=manifold")];
    for (rule, more) in cases {
        let text = format!("{} {more}", friction_settings(rule));
        let mut simulation = simulate(block_on_floor(Vec3::X * 2.0, 5.0, 0.4), &text)?;
        let (mut slides, mut spins, mut aside) = (0.0, 0.0, 0.0_f64);
        let mut points = Vec::new();
        for step in 1..=60_u32 {
            simulation.step(DT)?;
            let time = f64::from(step) * f64::from(DT);
            let body = &simulation.world.bodies[1];
            let (v, w) = (f64::from(body.linear_velocity.length()), f64::from(body.angular_velocity.length()));
            slides = if v > 0.02 { time } else { slides };
            spins = if w > 0.05 { time } else { spins };
            aside = aside.max(f64::from(body.position.z.abs()));
            points.push((time, v));
        }
        let name = if more.is_empty() { rule.to_owned() } else { format!("{rule}, per manifold") };
        let end = |t: f64| if t > 0.99 { "1 s and more".into() } else { format!("{t:.3} s") };
        let _ = writeln!(report.page, "| {name} | {} | {} | {:.1} mm |", end(slides), end(spins), aside * 1e3);
        lines.push((name, points));
        after_run();
    }
    report.picture("spinning-block.svg", "Speed of a block that slides and spins", ("speed m/s", Scale::Linear), lines);
    Ok(())
}

fn thrown_ball(report: &mut RulesReport, after_run: &mut dyn FnMut()) -> Result<()> {
    let _ = writeln!(
        report.page,
        "\nIn the scene `throw` a ball hits a standing stack. The table has the number of boxes in place just before the hit and at the end.\n\n\
         | friction | before | at the end |\n|---|---|---|"
    );
    let scene = Scene::find("throw", &[])?;
    for rule in ["none", "slip", "box", "disc"] {
        let mut simulation = simulate(scene.world.clone(), &friction_settings(rule))?;
        let thrown = thrown_body(&scene.world);
        let boxes = scene.world.dynamic_count() - 1;
        let speed = scene.world.bodies[thrown].linear_velocity.x;
        // The ball has hit when it lost a tenth of its speed along its way.
        let (mut before, mut hit) = (boxes, false);
        for _ in 0..scene.steps {
            simulation.step(scene.dt)?;
            hit |= simulation.world.bodies[thrown].linear_velocity.x / speed < 0.9;
            if !hit {
                before = standing_boxes(&scene.world, &simulation.world, thrown);
            }
        }
        let end = standing_boxes(&scene.world, &simulation.world, thrown);
        let _ = writeln!(report.page, "| {rule} | {before} of {boxes} | {end} of {boxes} |");
        after_run();
    }
    Ok(())
}

/// The fastest body of a scene that has not begun.
fn thrown_body(world: &World) -> usize {
    drystone::metrics::fastest(world).1
}

/// Dynamic bodies that are still in place.
fn standing_boxes(was: &World, is: &World, thrown: usize) -> usize {
    in_place_count(was, is) - usize::from(in_place(&was.bodies[thrown], &is.bodies[thrown]))
}

/// Whether a tower of `n` boxes, with offsets of 1 cm, stands for 20 s.
fn tower_stands(n: u32, text: &str) -> Result<bool> {
    let scene = Scene::find("tower", &[format!("n={n}"), "offset=0.01".into()])?;
    Ok(stand(&scene.world, text, 20.0)?.seconds > 19.99)
}

/// The largest n up to `most` for which `stands`, by doubling and bisection; it is taken to be monotone.
fn largest(most: u32, mut stands: impl FnMut(u32) -> Result<bool>) -> Result<u32> {
    let (mut good, mut bad) = (0, 1);
    while bad <= most && stands(bad)? {
        (good, bad) = (bad, bad * 2);
    }
    bad = bad.min(most + 1);
    while bad - good > 1 {
        let middle = (good + bad) / 2;
        if stands(middle)? { good = middle } else { bad = middle }
    }
    Ok(good)
}

/// Tallest tower that is tried.
const MOST_BOXES: u32 = 128;

fn heights(report: &mut RulesReport, after_run: &mut dyn FnMut()) -> Result<()> {
    let _ = writeln!(
        report.page,
        "\n## Substeps\n\nThe table has the number of boxes of the tallest tower that stands for 20 s, up to {MOST_BOXES}. Boxes are shifted by 1 cm to one side and to the other in turn.\n\n\
         | substeps | soft, default | Baumgarte, as many sweeps |\n|---|---|---|"
    );
    for substeps in [1_u32, 4, 8, 16] {
        let soft = largest(MOST_BOXES, |n| tower_stands(n, &format!("substeps={substeps}")))?;
        after_run();
        let hard = format!("substeps={substeps} iterations=2 relax=0 stabilization=baumgarte");
        let hard = largest(MOST_BOXES, |n| tower_stands(n, &hard))?;
        after_run();
        let _ = writeln!(report.page, "| {substeps} | {soft} | {hard} |");
    }
    Ok(())
}

fn ratios(report: &mut RulesReport, after_run: &mut dyn FnMut()) -> Result<()> {
    let _ = writeln!(
        report.page,
        "\nThe next table has the heaviest top, as a multiple of the other boxes, under which a tower of 10 stands for 20 s (of 1, 2, 5, 10, ... 10,000), and \
         the overlap in two cases with a mass ratio of 1000.\n\n| substeps | heaviest top | overlap, 1 under 1000 | overlap, tower of 10 with 1000 times on top |\n|---|---|---|---|"
    );
    let tried = [1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000, 10_000];
    for substeps in [4_u32, 16, 32, 64] {
        let text = format!("substeps={substeps}");
        let tower = |n: u32, ratio: u32| -> Result<Standing> {
            let scene = Scene::find("tower", &[format!("n={n}"), format!("top_ratio={ratio}"), "offset=0.01".into()])?;
            stand(&scene.world, &text, 20.0)
        };
        let mut heaviest = 0;
        for ratio in tried {
            if tower(10, ratio)?.seconds < 19.99 {
                break;
            }
            heaviest = ratio;
        }
        after_run();
        let overlap = |s: Standing| {
            if s.seconds > 19.99 {
                format!("{:.2} mm", s.penetration * 1e3)
            } else {
                format!("fell at {:.1} s", s.seconds)
            }
        };
        let _ = writeln!(
            report.page,
            "| {substeps} | {heaviest} | {} | {} |",
            overlap(tower(2, 1000)?),
            overlap(tower(10, 1000)?)
        );
        after_run();
    }
    Ok(())
}

/// How often `after_run` is called.
pub const RUNS: u64 = 9 + 3 + 16 + 4 + 4 + 8 + 8;

impl RulesReport {
    /// Adds a picture of lines over time, each with its name. A scale over decades leaves out what is not above 0.
    fn picture(
        &mut self,
        file: &'static str,
        title: &str,
        (y, scale): (&str, Scale),
        lines: Vec<(String, Vec<(f64, f64)>)>,
    ) {
        let _ = writeln!(self.page, "\n![{file}](rules/{file})");
        let series = lines.into_iter().enumerate().map(|(look, (name, mut line))| {
            line.retain(|p| scale != Scale::Decades || p.1 > 0.0);
            Series { name, look, points: Vec::new(), line }
        });
        let frame = Frame { title, x: "time s", y, scales: (Scale::Linear, scale), size: (760, 420) };
        self.pictures.push((file, svg(&frame, &series.collect::<Vec<_>>())));
    }
}
