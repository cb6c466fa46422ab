//! The catalogue and the settings as JSON, with the library's own descriptions.

use drystone::SolverConfig;
use drystone::preset::Preset;
use drystone_scenes::{CATALOGUE, Entry, Parameter};
use serde_json::{Map, Value, json};

/// Every scene with its parameters.
pub fn catalogue() -> Value {
    let parameter = |p: &Parameter| json!({"name": p.name, "default": p.default, "least": p.range.0, "most": p.range.1, "whole": p.whole, "words": p.words, "summary": p.summary});
    let scene = |e: &Entry| {
        let parameters: Vec<_> = e.parameters.iter().map(parameter).collect();
        json!({"name": e.name, "summary": e.summary, "parameters": parameters})
    };
    CATALOGUE.iter().map(scene).collect()
}

/// The presets with the settings that they change, and every setting with its description, its words and its default.
pub fn settings() -> Value {
    // Written by `drystone settings --schema`.
    let schema: Value = serde_json::from_str(include_str!("settings.json")).unwrap_or_default();
    let defaults = values(&SolverConfig::default());
    let preset = |p: &Preset| {
        let changed: Map<String, Value> =
            values(&p.config()).into_iter().filter(|(name, value)| defaults[name] != *value).collect();
        json!({"name": p.to_string(), "changes": changed})
    };
    let mut all = Vec::new();
    describe(&schema, &schema, "", &defaults, &mut all);
    json!({"presets": Preset::ALL.iter().map(preset).collect::<Vec<_>>(), "preset": Preset::default().to_string(), "settings": all})
}

/// All settings by name. A nested setting is `table.name`.
pub fn values(config: &SolverConfig) -> Map<String, Value> {
    let Ok(Value::Object(all)) = serde_json::to_value(config) else { return Map::new() };
    let flat = all.into_iter().flat_map(|(name, value)| match value {
        Value::Object(inner) => inner.into_iter().map(|(key, value)| (format!("{name}.{key}"), short(value))).collect(),
        value => vec![(name, short(value))],
    });
    flat.collect()
}

/// A number with the digits of its f32; the f64 would show digits of rounding.
fn short(value: Value) -> Value {
    match value.as_f64() {
        Some(x) if value.is_f64() => (x as f32).to_string().parse::<f64>().map_or(value, Value::from),
        _ => value,
    }
}

/// Adds each setting of a table to `all`.
fn describe(schema: &Value, table: &Value, prefix: &str, defaults: &Map<String, Value>, all: &mut Vec<Value>) {
    let Some(properties) = table["properties"].as_object() else { return };
    for (name, property) in properties {
        let key = format!("{prefix}{name}");
        let definition =
            property["$ref"].as_str().and_then(|r| r.strip_prefix("#/$defs/")).map(|r| &schema["$defs"][r]);
        match (defaults.get(&key), definition) {
            (Some(default), definition) => all.push(json!({
                "name": key,
                "summary": sentence(property),
                "default": default,
                "whole": property["type"] == "integer",
                "words": definition.map(words).unwrap_or_default(),
            })),
            (None, Some(table)) => describe(schema, table, &format!("{key}."), defaults, all),
            (None, None) => {}
        }
    }
}

/// The first sentence of a description. The other sentences give reasons.
fn sentence(property: &Value) -> String {
    let text = property["description"].as_str().unwrap_or_default().replace('\n', " ");
    text.split_once(". ").map_or(text.trim_end_matches('.'), |(first, _)| first).to_owned()
}

/// The words that a setting accepts.
fn words(definition: &Value) -> Vec<Value> {
    let all = definition["oneOf"].as_array().or_else(|| definition["enum"].as_array());
    all.into_iter().flatten().map(|word| if word.is_string() { word.clone() } else { word["const"].clone() }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_setting_has_a_description_and_a_default() {
        let described = settings();
        let all = described["settings"].as_array().expect("a list");
        assert_eq!(all.len(), values(&SolverConfig::default()).len());
        for setting in all {
            assert!(setting["summary"].as_str().is_some_and(|s| s.len() > 5), "{setting}");
            assert!(!setting["default"].is_null(), "{setting}");
        }
        let friction = all.iter().find(|s| s["name"] == "friction").expect("it is there");
        assert_eq!(friction["words"], json!(["none", "box", "disc"]));
        let share = all.iter().find(|s| s["name"] == "max_penetration_share").expect("it is there");
        assert_eq!(share["default"], json!(0.015));
    }

    #[test]
    fn a_preset_names_what_it_changes() {
        let presets = &settings()["presets"];
        assert_eq!(presets[0], json!({"name": "fast", "changes": {"substeps": 4}}));
        assert_eq!(presets[1]["changes"], json!({}));
    }

    #[test]
    fn the_catalogue_has_every_scene_with_the_ranges_of_its_parameters() {
        let all = catalogue();
        assert_eq!(all.as_array().map(Vec::len), Some(CATALOGUE.len()));
        assert_eq!(all[0]["parameters"][0]["default"], json!(1000.0));
        let parameter = |scene: &str| {
            let entry = all.as_array().and_then(|all| all.iter().find(|entry| entry["name"] == scene));
            entry.map(|entry| entry["parameters"][0].clone()).expect("a scene with a parameter")
        };
        assert_eq!(parameter("pile")["words"], json!([]));
        assert_eq!(parameter("family")["words"][1], json!("leaned-towers"));
    }
}
