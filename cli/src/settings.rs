//! Settings as text: TOML files, `key=value`, and what is not at its default.

use std::path::Path;

use drystone::config::SolverConfig;
use drystone::stages::suggest::shorten;
use drystone::{Error, Result};

/// Reads settings from a TOML file; what it leaves out takes its default.
pub fn read(path: &Path) -> Result<SolverConfig> {
    let text = std::fs::read_to_string(path).map_err(Error::file(path))?;
    let config: SolverConfig = toml::from_str(&text).map_err(|e| {
        let line = e.span().map_or(1, |span| 1 + text[..span.start].matches('\n').count());
        Error::input(format!("{}: line {line}: {}", path.display(), first_line(&e)))
    })?;
    config.check().map_err(|e| Error::input(format!("{}: {e}", path.display())))?;
    Ok(config)
}

/// The default settings without sleep, and with each of `assignments` ([`set`]).
pub fn awake<'a>(assignments: impl IntoIterator<Item = &'a str>) -> Result<SolverConfig> {
    let mut config = SolverConfig::default().without_sleep();
    assignments.into_iter().try_for_each(|assignment| set(&mut config, assignment))?;
    config.check()?;
    Ok(config)
}

/// The settings that are not at their defaults, as `key=value`, but for those that are `said` otherwise.
pub fn unusual(config: &SolverConfig, said: &[&str]) -> Vec<String> {
    let table = |config: &SolverConfig| toml::Table::try_from(config).expect("a config is a table");
    let usual = table(&SolverConfig::default());
    let differs = |(key, value): &(String, toml::Value)| !said.contains(&key.as_str()) && usual[key] != *value;
    let text = |(key, value): (String, toml::Value)| match value {
        toml::Value::String(word) => format!("{key}={word}"),
        // As it was written, without what f64 sees of its rounding.
        toml::Value::Float(x) => format!("{key}={}", x as f32),
        value => format!("{key}={value}"),
    };
    table(config).into_iter().filter(differs).map(text).collect()
}

/// Changes one setting, written `key=value` as in TOML; bare words need no quotes.
pub fn set(config: &mut SolverConfig, assignment: &str) -> Result<()> {
    let (key, value) =
        assignment.split_once('=').ok_or_else(|| Error::input(format!("--set {assignment}: write it as key=value")))?;
    let (key, value) = (key.trim(), value.trim());
    let mut table = toml::Table::try_from(&*config).expect("a config is a table");
    let parse = |text: &str| toml::from_str::<toml::Table>(&format!("value = {text}")).ok();
    let parsed = parse(value).or_else(|| parse(&format!("{value:?}"))).and_then(|mut t| t.remove("value"));
    let mut parsed = parsed.ok_or_else(|| Error::input(format!("--set {assignment}: cannot read the value")))?;
    // A whole number is a fine value for a real setting.
    if let (Some(toml::Value::Float(_)), toml::Value::Integer(i)) = (table.get(key), &parsed) {
        parsed = toml::Value::Float(*i as f64);
    }
    table.insert(key.to_owned(), parsed);
    let changed: SolverConfig = table
        .try_into()
        .map_err(|e: toml::de::Error| Error::input(format!("--set {assignment}: {}", first_line(&e))))?;
    changed.check_ranges().map_err(|e| Error::input(format!("--set {assignment}: {e}")))?;
    *config = changed;
    Ok(())
}

/// The message of a TOML error without its drawing of the text, and without the list of all settings.
fn first_line(e: &toml::de::Error) -> String {
    let message = e.message().lines().collect::<Vec<_>>().join(" ");
    shorten(&message, "`drystone settings` lists all")
}
