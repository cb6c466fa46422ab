//! The report of a run as a table.

use super::{RunReport, SensorCount};
use drystone::stats::median;

/// Up to this number of sensors, each one has a row.
const MAX_SENSORS: usize = 20;

impl RunReport {
    pub fn rows(&self) -> Vec<(String, String)> {
        let mut rows = Vec::new();
        let mut row = |what: &str, value: String| rows.push((what.to_owned(), value));
        let (substeps, iterations, relax) = (self.config.substeps, self.config.iterations, self.config.relax);
        let at_first = if self.came.is_some() { " at first" } else { "" };
        row("scene", format!("{}, {} dynamic bodies{at_first}", self.scene, self.bodies));
        if self.worlds > 1 {
            let steps = self.worlds as f64 / (1e-3 * median(&self.awake_times));
            row("worlds", format!("{}, {steps:.3e} steps of one world a second", self.worlds));
        }
        row("backend", format!("{}: {}", self.backend, self.adapter));
        let (steps, dt) = (self.steps, self.dt * 1e3);
        row("steps", format!("{steps} of {dt:.3} ms; {substeps} substeps of {iterations} + {relax} sweeps"));
        let (manifolds, points) = (self.manifolds, self.points);
        if self.asleep == 0 {
            let (colors, reused) = (self.colors, 100.0 * self.reused);
            row("contacts", format!("{manifolds} manifolds, {points} points, {colors} colors, {reused:.0} % reused"));
        } else {
            row("contacts", format!("{manifolds} manifolds, {points} points, including those of sleeping bodies"));
            let after = |step: u32| format!("after {:.2} s", f64::from(step) * f64::from(self.dt));
            let first = self.first_asleep_step.filter(|_| self.first_asleep_step != self.all_asleep_step);
            let first = first.map_or_else(String::new, |first| format!(", the first {}", after(first)));
            let all = self.all_asleep_step.map(|all| format!("all bodies {}", after(all)));
            row("asleep", all.unwrap_or_else(|| format!("{} of {} bodies", self.asleep, self.bodies_now)) + &first);
        }
        if let (Some(came), Some(left)) = (self.came, self.left) {
            row("bodies", format!("{came} came, {left} left, {} dynamic bodies at the end", self.bodies_now));
        }
        if !self.sensors.is_empty() {
            let sum = |of: fn(&SensorCount) -> u64| self.sensors.iter().map(of).sum::<u64>();
            let (entered, left) = (sum(|sensor| sensor.entered), sum(|sensor| sensor.left));
            row("sensors", format!("{}: {entered} times entered, {left} times left", self.sensors.len()));
            for SensorCount { sensor, entered, left, inside, .. } in self.sensors.iter().take(MAX_SENSORS) {
                row(&format!("  {sensor}"), format!("{entered} entered, {left} left, {inside} inside"));
            }
            if self.sensors.len() > MAX_SENSORS {
                row("  ...", format!("and {} more, in --json", self.sensors.len() - MAX_SENSORS));
            }
        }
        if self.most_substeps > substeps {
            let each: Vec<_> =
                self.efforts.iter().map(|row| format!("{} bodies with {}", row.bodies, row.substeps)).collect();
            let why = self.hardest_contact.filter(|hardest| hardest.need > 1.0).map_or_else(String::new, |hardest| {
                let bodies: Vec<_> =
                    hardest.bodies.iter().flatten().map(|body| format!("body {}", body.index())).collect();
                format!(
                    "; {} would sag {:.3} times as deep as promised with {substeps}",
                    bodies.join(" on "),
                    hardest.need
                )
            });
            row("substeps", format!("{}, at most {}{why}", each.join(", "), self.most_substeps));
        }
        if let Some(gap) = self.joint_gap {
            row("joints", format!("{}, {:.3} mm apart at most", self.joints, gap * 1e3));
        }
        if let (Some(sweeps), Some(planned)) = (self.sweeps, self.planned_sweeps) {
            row("sweeps", format!("{sweeps} of {planned}"));
        }
        if self.overflow > 0 {
            row("overflow", format!("up to {} manifolds found no color and were swept alone", self.overflow));
        }
        if let Some(times) = self.awake_ms {
            let (all, awake) = (self.steps, self.awake_steps);
            let which = if awake == all { String::new() } else { format!(", of {awake} steps with a body awake") };
            row("ms a step", format!("{times}{which}"));
        }
        for stage in &self.stage_ms {
            row(&format!("  {}", stage.stage), stage.ms.to_string());
        }
        for kernel in &self.kernel_ms {
            let share = kernel.share_of_copying.map(|s| format!(", {:.1} % of copying", 100.0 * s)).unwrap_or_default();
            row(&format!("    {}", kernel.kernel), format!("{}{share}", kernel.ms));
        }
        if self.bytes_up > 0 {
            let kb = |bytes: u64| bytes as f64 / 1e3;
            let (up, down) = (kb(self.bytes_up), kb(self.bytes_down));
            row("last step", format!("{up:.1} kB to the device, {down:.1} kB back, {} dispatches", self.dispatches));
        }
        let [max, p95, mean] = [self.penetration_max, self.penetration_p95, self.penetration_mean].map(|x| x * 1e3);
        row("penetration", format!("{max:.3} mm deepest, 95 % within {p95:.3}, mean {mean:.3}"));
        let (rms, most) = (self.speed_rms * 1e3, self.speed_max * 1e3);
        let speed = |body| format!("{rms:.3} mm/s rms with rotation; fastest center {most:.3} mm/s (body {body})");
        row("speed", self.fastest.as_ref().map_or("0 mm/s: nothing moves".into(), speed));
        row("energy", format!("{:.3e} J kinetic, {:.3e} J gained in all", self.kinetic_energy, self.energy_gained));
        if let Some(escaped) = self.escaped {
            row("container", format!("{escaped} bodies outside"));
        }
        if self.stands {
            row("in place", format!("{} of {}", self.in_place, self.bodies));
        }
        if !self.standing.is_empty() {
            let up = || self.standing.iter().filter(|s| s.in_place == s.bodies);
            let largest = up().max_by_key(|s| s.bodies).map_or("none", |s| &s.group);
            row("standing", format!("{} of {} groups; the largest is {largest}", up().count(), self.standing.len()));
        }
        row("hash", self.hash.clone());
        if let Some(body) = &self.first_non_finite {
            row("non-finite", format!("{} bodies, first {body}", self.non_finite));
        }
        rows
    }
}
