//! Checks of the WebGPU of this browser.

use drystone::conform::{ConformOptions, Verdict, conform_async};
use js_sys::Function;
use wasm_bindgen::prelude::*;

use crate::thrown;

/// Checks WebGPU in exact and in plain mode as `drystone conform` checks an adapter, fewer variants where it is `short`, and those checks
/// only whose names contain one of `names`, if there are some. Calls `each` with a line after each check, and gives a line that counts them.
#[wasm_bindgen]
pub async fn conform(short: bool, names: Vec<String>, each: Function) -> std::result::Result<String, JsError> {
    let options = ConformOptions { short, names, ..ConformOptions::default() };
    let mut tell = |check: &drystone::conform::Check| {
        let drystone::conform::Check { verdict, mode, group, name, figure, .. } = check;
        let line = format!("{verdict}: {mode}, {group}, {name}: {figure}");
        // A listener that fails is no reason to stop.
        let _ = each.call1(&JsValue::NULL, &line.into());
    };
    let found = thrown(conform_async(&options, &mut tell).await)?;
    let [passed, failed] = Verdict::ALL.map(|verdict| found.count(verdict));
    Ok(format!("{}: {passed} passed, {failed} failed", found.adapter.name))
}
