//! `drystone scenes` and `drystone settings`.

use clap::Args;
use serde_json::{Value, json};

use super::output::{print, print_json};
use super::words;
use drystone::preset::Preset;
use drystone::{Result, SolverConfig};
use drystone_scenes::{CATALOGUE, Entry, Parameter, schema};

#[derive(Args)]
pub struct ScenesArgs {
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
    /// Print the JSON Schema of scene files instead.
    #[arg(long)]
    schema: bool,
}

impl ScenesArgs {
    pub fn run(&self) -> Result<()> {
        if self.schema {
            return print(serde_json::to_string_pretty(&schema()).expect("a schema serializes"));
        }
        if self.json {
            let parameter = |p: &Parameter| json!({"name": p.name, "default": p.default, "range": [p.range.0, p.range.1], "words": p.words, "summary": p.summary});
            let scene = |e: &Entry| json!({"name": e.name, "summary": e.summary, "parameters": e.parameters.iter().map(parameter).collect::<Vec<_>>()});
            return print_json(&json!({"scenes": CATALOGUE.iter().map(scene).collect::<Vec<_>>()}));
        }
        for entry in CATALOGUE {
            print(format_args!("{}\n    {}", entry.name, entry.summary))?;
            for p in entry.parameters {
                let words = if p.words.is_empty() { String::new() } else { format!(": {}", p.words.join(", ")) };
                print(format_args!("    -p {}={}  {}{words}", p.name, p.text(p.default), p.summary))?;
            }
        }
        Ok(())
    }
}

#[derive(Args)]
pub struct SettingsArgs {
    /// Print the values of this preset.
    #[arg(long, value_parser = words::of::<Preset>(), default_value_t)]
    preset: Preset,
    /// Print the JSON Schema of settings instead.
    #[arg(long)]
    schema: bool,
}

impl SettingsArgs {
    pub fn run(&self) -> Result<()> {
        let schema = schemars::schema_for!(SolverConfig).to_value();
        if self.schema {
            return print(serde_json::to_string_pretty(&schema).expect("a schema serializes"));
        }
        let config = toml::Table::try_from(self.preset.config()).expect("a config is a table");
        print_settings(&config, &schema, &schema)
    }
}

/// Prints each setting of a table below the first sentence of its description. Nested tables come last.
fn print_settings(config: &toml::Table, schema: &Value, described: &Value) -> Result<()> {
    let properties = described["properties"].as_object().expect("a struct has properties");
    let (tables, settings): (Vec<_>, Vec<_>) = properties.iter().partition(|(name, _)| config[*name].is_table());
    for (name, property) in settings {
        let value = match &config[name] {
            // The shortest text of the f32; the f64 would show digits of rounding.
            toml::Value::Float(x) => format!("{:?}", *x as f32),
            value => value.to_string(),
        };
        print(format_args!("# {}.{}\n{name} = {value}\n", first_sentence(property), words(schema, property)))?;
    }
    for (name, property) in tables {
        print(format_args!("# {}.\n[{name}]\n", first_sentence(property)))?;
        let inner = config[name].as_table().expect("a table");
        print_settings(inner, schema, definition(schema, property).expect("a struct has a definition"))?;
    }
    Ok(())
}

/// The first sentence of a description. The other sentences give reasons.
fn first_sentence(property: &Value) -> String {
    let text = property["description"].as_str().unwrap_or_default().replace('\n', " ");
    text.split_once(". ").map_or(text.trim_end_matches('.'), |(first, _)| first).to_owned()
}

fn definition<'a>(schema: &'a Value, property: &Value) -> Option<&'a Value> {
    property["$ref"].as_str().and_then(|r| r.strip_prefix("#/$defs/")).map(|name| &schema["$defs"][name])
}

/// The words that a setting accepts: ` One of a, b.`, or nothing.
fn words(schema: &Value, property: &Value) -> String {
    let values = definition(schema, property).and_then(|n| n["oneOf"].as_array().or_else(|| n["enum"].as_array()));
    let words: Vec<_> = values.into_iter().flatten().filter_map(|w| w["const"].as_str().or(w.as_str())).collect();
    if words.is_empty() { String::new() } else { format!(" One of {}.", words.join(", ")) }
}
