//! The panel beside a show. For a scene it has measurements, controls and settings.

use drystone::backend::BackendChoice;
use drystone::config::Friction;
use drystone_maze::{BOARDS, Outcome};
use drystone_view::{ColorBy, Labyrinth, Live, Order, Show};

pub trait Panel: Show {
    fn panel(&mut self, ui: &mut egui::Ui);
}

impl Panel for Live {
    fn panel(&mut self, ui: &mut egui::Ui) {
        numbers(self, ui);
        ui.separator();
        controls(self, ui);
        ui.separator();
        settings(self, ui);
        if let Some(driver) = self.driver {
            ui.label(if driver.can_jump() { "arrows walk, j jumps" } else { "arrows drive" });
        }
        keys(ui);
    }
}

impl Panel for Labyrinth {
    fn panel(&mut self, ui: &mut egui::Ui) {
        ui.heading(match self.game.outcome {
            Some(Outcome::Goal) => "won",
            Some(_) => "lost: R starts again",
            None if self.begun => "to the green square",
            None => "arrow keys, or hold the mouse",
        });
        ui.monospace(format!("time {:6.2} s", self.game.time()));
        if let Some(best) = self.best {
            ui.monospace(format!("best {best:6.2} s"));
        }
        let [right, front] = self.game.tilt;
        ui.monospace(format!("tilt {right:5.1} {front:5.1} degrees"));
        ui.label("arrows or left mouse: tilt, right mouse: turn the view");
        ui.label("r again, f whole board, h panel, esc close");
        let known = BOARDS.map(|b| b.0).join(", ");
        ui.label(format!("boards: {known}, or a file of your own"));
    }
}

fn keys(ui: &mut egui::Ui) {
    ui.collapsing("keys and mouse", |ui| {
        for line in [
            "space pause, n one step, r restart, + - speed",
            "b throw a cube, x delete the body under the mouse",
            "s keep the state, l go back to it; left, right: a second in a recording",
            "c color, 1 contacts, 2 joints, 3 boxes",
            "f whole scene, h panel, esc close",
            "left: pull a body, or turn the view",
            "right: turn, middle: move, wheel: nearer",
        ] {
            ui.label(line);
        }
    });
}

fn numbers(live: &mut Live, ui: &mut egui::Ui) {
    let asleep = live.stats.asleep;
    let depth = live.simulation.solved_penetration();
    // The statistics of the step do not contain the manifolds of sleeping bodies.
    let (manifolds, points, colors) = live.simulation.manifolds().fold((0, 0, 0), |(manifolds, points, colors), m| {
        (manifolds + 1, points + m.points().len(), colors.max(m.color.map_or(0, |c| c + 1)))
    });
    let world = &live.simulation.world;
    let total: f64 = live.stage_ms.iter().sum();
    egui::Grid::new("numbers").num_columns(2).show(ui, |ui| {
        let mut row = |what: &str, value: String| {
            ui.label(what);
            ui.monospace(value);
            ui.end_row();
        };
        row("backend", live.simulation.backend().name().into());
        row("bodies", format!("{}, {asleep} asleep", world.dynamic_count()));
        row("time", format!("{:.2} s, {} steps", live.time(), live.steps));
        row("speed", format!("{:.2} of {:.2} real time", live.reached, live.speed));
        row("pictures", format!("{:.1} a second", live.pictures));
        row("a step", format!("{total:.2} ms"));
        for ((stage, _), ms) in live.stats.times.stages().iter().zip(live.stage_ms) {
            row(&format!("  {stage}"), format!("{ms:.2} ms"));
        }
        row("contacts", format!("{manifolds} of {points} points, {colors} colors"));
        row("penetration", format!("{:.3} mm, mean {:.3}", depth.max * 1e3, depth.mean * 1e3));
        row("kinetic", format!("{:.3e} J", world.kinetic_energy()));
        row("potential", format!("{:.3e} J", world.potential_energy()));
    });
}

fn controls(live: &mut Live, ui: &mut egui::Ui) {
    ui.horizontal(|ui| {
        ui.toggle_value(&mut live.paused, "pause");
        if ui.button("step").clicked() {
            live.order(Order::Step);
        }
        if ui.button("restart").clicked() {
            live.order(Order::Restart);
        }
    });
    ui.add(egui::Slider::new(&mut live.speed, 1.0 / 64.0..=16.0).logarithmic(true).text("speed"));
    let mut color = live.color;
    choice(ui, "color", &ColorBy::ALL, &mut color);
    live.color = color;
    ui.horizontal(|ui| {
        ui.checkbox(&mut live.overlay.contacts, "contacts");
        ui.checkbox(&mut live.overlay.joints, "joints");
        ui.checkbox(&mut live.overlay.boxes, "boxes");
    });
}

fn settings(live: &mut Live, ui: &mut egui::Ui) {
    let before = live.simulation.config().clone();
    let mut config = before.clone();
    ui.add(egui::Slider::new(&mut config.substeps, 1..=64).logarithmic(true).text("substeps"));
    ui.add(egui::Slider::new(&mut config.iterations, 1..=32).text("sweeps"));
    ui.add(egui::Slider::new(&mut config.relax, 0..=8).text("relax sweeps"));
    let rules = [(Friction::None, "none"), (Friction::Box, "box"), (Friction::Disc, "disc")];
    ui.horizontal(|ui| {
        ui.label("friction");
        for (rule, name) in rules {
            ui.selectable_value(&mut config.friction, rule, name);
        }
    });
    if config != before {
        live.refused = live.simulation.set_config(config).err().map(|e| e.to_string());
    }
    let mut backend = live.choice;
    choice(ui, "backend", &BackendChoice::ALL, &mut backend);
    if backend != live.choice {
        live.refused = live.set_backend(backend).err().map(|e| e.to_string());
    }
    if let Some(refused) = &live.refused {
        ui.colored_label(egui::Color32::from_rgb(200, 40, 40), refused);
    }
}

fn choice<T: std::fmt::Display + PartialEq + Copy>(ui: &mut egui::Ui, what: &str, all: &[T], value: &mut T) {
    ui.horizontal(|ui| {
        ui.label(what);
        for option in all {
            ui.selectable_value(value, *option, option.to_string());
        }
    });
}
