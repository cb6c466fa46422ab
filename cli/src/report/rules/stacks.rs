//! Clamping and stabilization: time until a stack falls, overlap and energy.

use std::fmt::Write as _;

use super::{DT, RulesReport, Standing, simulate, stand};
use crate::hard::energy;
use crate::report::plot::Scale;
use drystone::metrics::rms_speed;
use drystone::{Body, Result, Shape, World};
use drystone_scenes::Scene;
use glam::Vec3;

/// The settings of the course sheet: one substep, 20 sweeps, no soft contacts.
const SHEET: &str = "substeps=1 iterations=20 relax=0 stabilization=baumgarte";

pub(super) fn clamping(report: &mut RulesReport, after_run: &mut dyn FnMut()) -> Result<()> {
    let page = &mut report.page;
    let _ = writeln!(
        page,
        "\n## Clamping\n\n`misaligned` runs for 20 s with {SHEET}. A stack\n\
         falls when a box has moved by half a box.\n\n\
         | boxes | clamping | stands [s] | drift [mm] |\n|---|---|---|---|"
    );
    for n in [5, 10, 20] {
        for (rule, settings) in [
            ("per-correction", format!("{SHEET} rules.clamping=per-correction")),
            ("accumulated", format!("{SHEET} rules.clamping=accumulated")),
            ("default settings", String::new()),
        ] {
            let Standing { fell, drift, .. } = stand(&format!("misaligned:n={n}"), &settings)?;
            let stands = fell.map_or("20".into(), |time| format!("{time:.2}"));
            let _ = writeln!(page, "| {n} | {rule} | {stands} | {:.1} |", drift * 1e3);
            after_run();
        }
    }
    Ok(())
}

/// The stabilizations with their settings, each with 16 sweeps per step.
const STABILIZATIONS: [(&str, &str); 3] = [
    ("none", "substeps=1 iterations=16 relax=0 stabilization=none"),
    ("baumgarte", "substeps=1 iterations=16 relax=0 stabilization=baumgarte"),
    ("soft", "substeps=8 iterations=1 relax=1 stabilization=soft"),
];

pub(super) fn stabilization(report: &mut RulesReport, after_run: &mut dyn FnMut()) -> Result<()> {
    let scene = Scene::find_spec("tower:n=10")?;
    let mut lines = Vec::new();
    let _ = writeln!(
        report.page,
        "\n## Stabilization\n\n\
         A `tower` of 10 boxes runs for 20 s with 16 sweeps a step: one substep, or for `soft` 8 substeps of 1 + 1 \
         sweeps.\n*Energy added* is the largest rise above an earlier minimum. *Exit speed* is that of a box that \
         starts 5 cm deep in the\nfloor.\n\n\
         | stabilization | deepest after 1 s [mm] | after 20 s [mm] | energy added [J] | rms speed at rest [mm/s] \
         | exit speed [m/s] |\n|---|---|---|---|---|---|"
    );
    for (rule, text) in STABILIZATIONS {
        let mut simulation = simulate(scene.world.clone(), text)?;
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
            "| {rule} | {:.3} | {:.3} | {added:.3} | {:.3} | {exit:.3} |",
            points[59].1,
            points[1199].1,
            rms * 1e3
        );
        lines.push((rule.to_owned(), points));
        after_run();
    }
    report.page.push_str(
        "\nThe preload of soft contacts (`preload_rate`) lifts the tower to rest, which adds their energy.\n",
    );
    let title = "Deepest overlap in a tower of 10 boxes";
    report.picture("stabilization.svg", title, ("overlap mm", Scale::Decades), lines);
    Ok(())
}

/// Largest upward speed of a box that starts 5 cm deep in the floor (m/s).
fn exit_speed(text: &str) -> Result<f64> {
    let mut world = World::new();
    world.insert(Body::fixed().shape(Shape::half_space(Vec3::Y)));
    let cube = world.insert(Body::dynamic().shape(Shape::cuboid(0.5, 0.5, 0.5)).position(0.0, 0.45, 0.0));
    let mut simulation = simulate(world, text)?;
    let mut fastest = 0.0_f64;
    for _ in 0..60 {
        simulation.step(DT)?;
        fastest = fastest.max(f64::from(simulation.world.bodies[cube].linear_velocity.y));
    }
    Ok(fastest)
}
