//! The settings of another engine, as a row of a table has them.

use drystone_cli::report::comparison::Setting;

/// The settings of an engine whose substeps have one biased sweep each, and friction inside a disc.
pub(crate) fn setting(engine: &str, substeps: u32, hertz: f32) -> Setting {
    Setting {
        engine: engine.into(),
        backend: "cpu".into(),
        substeps,
        sweeps: 1,
        method: "plain".into(),
        friction: "disc".into(),
        more: format!("{hertz:.0} Hz"),
    }
}
