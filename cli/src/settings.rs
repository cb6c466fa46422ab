//! Settings as text: TOML files and `key=value`.

use std::path::Path;

use drystone::stages::suggest::shorten;
use drystone::{Error, Result, SolverConfig};
use toml::{Table, Value};

/// Reads settings from a TOML file; missing settings take their defaults.
pub fn read(path: &Path) -> Result<SolverConfig> {
    let text = std::fs::read_to_string(path).map_err(Error::file(path))?;
    let config: SolverConfig = toml::from_str(&text).map_err(|e| {
        let line = e.span().map_or(1, |span| 1 + text[..span.start].matches('\n').count());
        Error::input(format!("{}: line {line}: {}", path.display(), first_line(&e)))
    })?;
    config.check().map_err(|e| Error::input(format!("{}: {e}", path.display())))?;
    Ok(config)
}

/// The default settings without sleep, changed by `assignments` ([`set`]).
pub fn awake<'a>(assignments: impl IntoIterator<Item = &'a str>) -> Result<SolverConfig> {
    let mut config = SolverConfig::default().without_sleep();
    assignments.into_iter().try_for_each(|assignment| set(&mut config, assignment))?;
    config.check()?;
    Ok(config)
}

/// The settings that differ from their defaults, as `key=value`, without those in `said`.
pub fn unusual(config: &SolverConfig, said: &[&str]) -> Vec<String> {
    let usual = list(&SolverConfig::default());
    let differs = |(key, value): &(String, Value)| {
        !said.contains(&key.as_str()) && !usual.contains(&(key.clone(), value.clone()))
    };
    let text = |(key, value): (String, Value)| match value {
        Value::String(word) => format!("{key}={word}"),
        // The shortest text of the f32; the f64 would show digits of rounding.
        Value::Float(x) => format!("{key}={}", x as f32),
        value => format!("{key}={value}"),
    };
    list(config).into_iter().filter(differs).map(text).collect()
}

/// All settings by name; a nested setting is `table.name`.
fn list(config: &SolverConfig) -> Vec<(String, Value)> {
    let settings = table(config).into_iter().flat_map(|(key, value)| match value {
        Value::Table(inner) => inner.into_iter().map(|(name, value)| (format!("{key}.{name}"), value)).collect(),
        value => vec![(key, value)],
    });
    settings.collect()
}

fn table(config: &SolverConfig) -> Table {
    Table::try_from(config).expect("a config is a table")
}

/// Changes one setting by `key=value` in TOML. A bare word needs no quotes.
pub fn set(config: &mut SolverConfig, assignment: &str) -> Result<()> {
    let (key, value) =
        assignment.split_once('=').ok_or_else(|| Error::input(format!("--set {assignment}: write it as key=value")))?;
    let (key, value) = (key.trim(), value.trim());
    let mut all = table(config);
    let parse = |text: &str| toml::from_str::<Table>(&format!("value = {text}")).ok();
    let parsed = parse(value).or_else(|| parse(&format!("{value:?}"))).and_then(|mut t| t.remove("value"));
    let mut parsed = parsed.ok_or_else(|| Error::input(format!("--set {assignment}: cannot read the value")))?;
    let (place, name) = match key.split_once('.').map(|(group, name)| (all.get_mut(group), name)) {
        Some((Some(Value::Table(group)), name)) => (group, name),
        _ => (&mut all, key),
    };
    // A setting with a real value accepts a whole number.
    if let (Some(Value::Float(_)), Value::Integer(i)) = (place.get(name), &parsed) {
        parsed = Value::Float(*i as f64);
    }
    place.insert(name.to_owned(), parsed);
    let changed: SolverConfig =
        all.try_into().map_err(|e: toml::de::Error| Error::input(format!("--set {assignment}: {}", first_line(&e))))?;
    changed.check_ranges().map_err(|e| Error::input(format!("--set {assignment}: {e}")))?;
    *config = changed;
    Ok(())
}

/// The message of a TOML error on one line, without the list of all settings.
fn first_line(e: &toml::de::Error) -> String {
    let message = e.message().lines().collect::<Vec<_>>().join(" ");
    let unknown = message.strip_prefix("unknown field `").and_then(|rest| rest.split_once('`')).map(|(name, _)| name);
    if let Some(name) = unknown.filter(|name| table(&SolverConfig::default())["rules"].get(name).is_some()) {
        return format!("{name}: this setting is now a comparison rule; set rules.{name}");
    }
    if message.starts_with("unknown variant `slip`") {
        return "slip: this setting is now a comparison rule; set rules.slip_friction=true".into();
    }
    shorten(&message, "`drystone settings` lists all")
}
