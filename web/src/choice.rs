//! Scenes and settings by their names in the page.

use drystone::backend::gpu::GpuOptions;
use drystone::preset::Preset;
use drystone::stages::suggest::{hint, shorten};
use drystone::{Backend, Cpu, Error, Gpu, Result, SolverConfig};
use drystone_scenes::{CATALOGUE, Scene};
use serde_json::{Map, Value};

/// Largest number of bodies of a scene in the page: about 4 kB each, and WebAssembly has at most 4 GiB.
pub const MAX_BODIES: u64 = 200_000;

/// A scene of the catalogue. `parameters` are `name=value`.
pub fn scene(name: &str, parameters: &[String]) -> Result<Scene> {
    let entry = CATALOGUE.iter().find(|entry| entry.name == name).ok_or_else(|| {
        let known = CATALOGUE.iter().map(|entry| entry.name);
        Error::input(format!("{name:?} is not a scene of the catalogue{}", hint(name, known, "the gallery shows all")))
    })?;
    check_size(name, entry.body_count(parameters)?)?;
    entry.build(parameters)
}

/// Refuses a number of bodies that exceeds the memory of a page.
pub fn check_size(name: &str, bodies: u64) -> Result<()> {
    if bodies <= MAX_BODIES {
        return Ok(());
    }
    Err(Error::TooLarge(format!("{name}: {bodies} bodies: must be at most {MAX_BODIES} in a browser")))
}

/// Opens a backend for the sweeps: `cpu`, `webgpu`, or `webgpu-exact`, which has the bits of the CPU.
pub async fn backend(name: &str) -> Result<Box<dyn Backend>> {
    Ok(match name {
        "cpu" => Box::new(Cpu::new()),
        _ => {
            let options = GpuOptions { exact: name == "webgpu-exact", ..GpuOptions::default() };
            Box::new(Gpu::open_async(options).await?)
        }
    })
}

/// The settings of a JSON object, by name. They override those of its `preset`.
pub fn config(text: &str) -> Result<SolverConfig> {
    let parsed = serde_json::from_str::<Map<String, Value>>(text);
    let mut changes = parsed.map_err(|e| Error::input(format!("settings: {e}")))?;
    let preset = match changes.remove("preset") {
        Some(Value::String(name)) => name.parse::<Preset>().map_err(|e| Error::input(format!("preset: {e}")))?,
        Some(other) => return Err(Error::input(format!("preset: {other} is not a name"))),
        None => Preset::default(),
    };
    let mut all = serde_json::to_value(preset.config()).map_err(Error::input)?;
    for (name, value) in changes {
        let (table, key) = match name.split_once('.') {
            Some((table, key)) => (all.get_mut(table), key),
            None => (Some(&mut all), name.as_str()),
        };
        let table = table.and_then(Value::as_object_mut);
        table.ok_or_else(|| Error::input(format!("{name}: there is no such setting")))?.insert(key.to_owned(), value);
    }
    let config: SolverConfig =
        serde_json::from_value(all).map_err(|e| Error::input(shorten(&e.to_string(), "the page lists all")))?;
    config.check()?;
    Ok(config)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refusal(text: &str) -> String {
        let message = config(text).expect_err("bad settings").to_string();
        assert!(!message.contains('\n'), "{message}");
        message
    }

    #[test]
    fn settings_change_those_of_their_preset() {
        let changed = config(r#"{"preset": "accurate", "relax": 2, "preload_rate": 2, "rules.manifold_passes": 3}"#);
        let changed = changed.expect("settings");
        assert_eq!((changed.substeps, changed.relax, changed.preload_rate), (32, 2, 2.0));
        assert_eq!(changed.rules.manifold_passes, 3);
        assert_eq!(config("{}").expect("none"), SolverConfig::default());
    }

    #[test]
    fn bad_settings_are_refused_in_one_line() {
        assert_eq!(refusal(r#"{"substeps": 0}"#), "substeps = 0: must be 1 to 4096");
        for (text, named) in [
            (r#"{"substep": 1}"#, "substep"),
            (r#"{"preset": "best"}"#, "best"),
            (r#"{"friction": "glue"}"#, "glue"),
            (r#"{"rules.nothing": 1}"#, "nothing"),
            (r#"{"substeps": "many"}"#, "many"),
            (r#"{"substeps.x": 1}"#, "substeps"),
            ("[]", "settings"),
        ] {
            assert!(refusal(text).contains(named), "{text}: {}", refusal(text));
        }
    }

    #[test]
    fn more_bodies_than_a_browser_holds_are_refused() {
        assert!(scene("tower", &["n=3".into()]).is_ok());
        let message = scene("towr", &[]).expect_err("a slip").to_string();
        assert_eq!(message, "\"towr\" is not a scene of the catalogue; did you mean \"tower\"? the gallery shows all");
        let message = scene("pile", &["n=4000000".into()]).expect_err("too many").to_string();
        assert_eq!(message, "pile: 4000000 bodies: must be at most 200000 in a browser");
    }
}
