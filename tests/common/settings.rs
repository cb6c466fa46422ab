//! Settings by their names, for tables of tests.

use drystone::SolverConfig;
use serde_json::Value;

/// Changes one setting, written `key=value`.
pub fn set(config: &mut SolverConfig, assignment: &str) {
    let (key, value) = assignment.split_once('=').expect("key=value");
    let mut all = serde_json::to_value(&*config).expect("settings serialize");
    *all.pointer_mut(&format!("/{}", key.replace('.', "/"))).expect(assignment) =
        serde_json::from_str(value).unwrap_or_else(|_| Value::from(value));
    *config = serde_json::from_value(all).unwrap_or_else(|e| panic!("{assignment}: {e}"));
    config.check_ranges().unwrap_or_else(|e| panic!("{assignment}: {e}"));
}
