//! Friction rules: sliding, creep and spinning.

use std::fmt::Write as _;

use super::{DT, Line, RulesReport, simulate};
use crate::report::plot::Scale;
use drystone::{Body, Result, Shape, World};
use glam::{Quat, Vec3};

/// Settings of a rule, with 8 substeps, so that the rule and not the length of the substep determines the motion.
fn friction_settings(rule: &str) -> String {
    let setting = if rule == "slip" { "rules.slip_friction=true".into() } else { format!("friction={rule}") };
    format!("substeps=8 {setting}")
}

/// A block of 1 x 0.4 x 1 m on a floor, with edges along the axes.
fn block_on_floor(velocity: Vec3, spin: f32, mu: f32) -> World {
    let mut world = World::new();
    world.insert(Body::fixed().shape(Shape::half_space(Vec3::Y)).friction(mu));
    let block = Body::dynamic().shape(Shape::cuboid(0.5, 0.2, 0.5)).friction(mu).position(0.0, 0.2, 0.0);
    world.insert(block.velocity(velocity, Vec3::new(0.0, spin, 0.0)));
    world
}

pub(super) fn friction(report: &mut RulesReport, after_run: &mut dyn FnMut()) -> Result<()> {
    let _ = writeln!(
        report.page,
        "\n## Friction\n\n\
         A block with mu 0.4 starts at 4 m/s at an angle to its edges. By Coulomb's law it slides for v²/(2 mu g) = \
         {:.3} m.\nThe axes of `box` are the tangents of the contact. *Creep* is the motion with mu 0.5 in 10 s on a \
         slope of 20°.\n\n\
         | friction | 0° [m] | 15° [m] | 30° [m] | 45° [m] | creep [mm] |\n|---|---|---|---|---|---|",
        16.0 / (2.0 * 0.4 * 9.81)
    );
    for rule in ["slip", "box", "disc"] {
        let mut cells = Vec::new();
        for degrees in [0.0_f32, 15.0, 30.0, 45.0] {
            cells.push(format!("{:.3}", sliding_distance(rule, degrees)?));
            after_run();
        }
        let _ = writeln!(report.page, "| {rule} | {} | {:.2} |", cells.join(" | "), creep(rule)? * 1e3);
    }
    spinning_plate(report, after_run)
}

/// Distance of the block of `world` from the origin after some steps (m).
fn distance(world: World, rule: &str, steps: u32) -> Result<f64> {
    let mut simulation = simulate(world, &friction_settings(rule))?;
    (0..steps).try_for_each(|_| simulation.step(DT).map(drop))?;
    let p = simulation.world.bodies[1].position;
    Ok(f64::from(p.x.hypot(p.z)))
}

/// Sliding distance (m) of a block with mu 0.4 that starts at 4 m/s, in a direction at `degrees` to its edges.
fn sliding_distance(rule: &str, degrees: f32) -> Result<f64> {
    let direction = Quat::from_rotation_y(degrees.to_radians()) * Vec3::X;
    distance(block_on_floor(direction * 4.0, 0.0, 0.4), rule, 240)
}

/// Distance that a block with mu 0.5 moves in 10 s on a slope of 20 degrees (m). Gravity is inclined instead of the
/// floor.
fn creep(rule: &str) -> Result<f64> {
    let mut world = block_on_floor(Vec3::ZERO, 0.0, 0.5);
    world.gravity = Quat::from_rotation_y(0.5) * Quat::from_rotation_z(20_f32.to_radians()) * world.gravity;
    distance(world, rule, 600)
}

fn spinning_plate(report: &mut RulesReport, after_run: &mut dyn FnMut()) -> Result<()> {
    let _ = writeln!(
        report.page,
        "\nThe block starts at 2 m/s and 5 rad/s. Under Coulomb's law sliding and spinning end together, and the path \
         bends,\nbecause friction shifts the load forward. Friction per manifold has neither effect.\n\n\
         | friction | slides for [s] | spins for [s] | distance from its line [mm] |\n|---|---|---|---|"
    );
    let mut lines = Vec::new();
    let cases = [("slip", ""), ("box", ""), ("disc", ""), ("disc", "friction_at=manifold")];
    for (rule, more) in cases {
        let ([slides, spins, aside], points) = sliding_spin(rule, more)?;
        let name = if more.is_empty() { rule.to_owned() } else { format!("{rule}, per manifold") };
        let end = |t: f64| if t > 0.99 { "1 and more".into() } else { format!("{t:.3}") };
        let _ = writeln!(report.page, "| {name} | {} | {} | {:.1} |", end(slides), end(spins), aside * 1e3);
        lines.push((name, points));
        after_run();
    }
    report.picture("spinning-block.svg", "Speed of a block that slides and spins", ("speed m/s", Scale::Linear), lines);
    Ok(())
}

/// For a block that starts at 2 m/s and 5 rad/s: the times for which it slides and spins (s), its largest distance from
/// the straight line (m), and its speed over time.
fn sliding_spin(rule: &str, more: &str) -> Result<([f64; 3], Line)> {
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
    Ok(([slides, spins, aside], points))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The numbers of docs/rules.md: v²/(2 mu g) = 2.039 m in every direction, under the disc only.
    #[test]
    fn a_block_slides_as_far_in_every_direction_under_the_disc_only() {
        let slid = |rule, degrees| sliding_distance(rule, degrees).expect("a run") / (16.0 / (2.0 * 0.4 * 9.81));
        for degrees in [0.0, 15.0, 30.0, 45.0] {
            let (disc, none) = (slid("disc", degrees), slid("none", degrees));
            assert!(
                (disc - 1.0).abs() < 0.01 && none > 5.0,
                "{degrees} degrees: {disc} under the disc, {none} without"
            );
        }
        assert!((slid("box", 0.0) - 1.0).abs() < 0.01 && slid("box", 45.0) < 0.75);
    }

    #[test]
    fn sliding_and_spinning_end_together_under_the_disc_at_points_only() {
        let ends = |rule, more| sliding_spin(rule, more).map(|([slides, spins, aside], _)| (slides - spins, aside));
        let (disc, boxed) = (ends("disc", "").expect("a run"), ends("box", "").expect("a run"));
        let manifold = ends("disc", "friction_at=manifold").expect("a run");
        assert!(disc.0 < 0.06 && boxed.0 > 0.15 && manifold.0 > 0.2, "{disc:?} {boxed:?} {manifold:?}");
        assert!(disc.1 > 0.02 && manifold.1 < 1e-4, "{disc:?} {manifold:?}");
    }

    #[test]
    fn a_block_at_rest_on_a_slope_creeps_under_one_slip_direction_only() {
        let creep = |rule| creep(rule).expect("a run");
        assert!(creep("disc") < 1e-3 && creep("box") < 1e-3 && creep("none") > 1.0);
        assert!(creep("slip") > 10.0 * creep("disc"), "{} under slip, {} under the disc", creep("slip"), creep("disc"));
    }
}
