//! Checks of the WebGPU of this browser.

use drystone_conform::{ConformOptions, Verdict, conform_async};
use js_sys::Function;
use wasm_bindgen::prelude::*;

use crate::thrown;

/// Checks WebGPU in exact and in plain mode, like `drystone conform`. With `short` it checks fewer variants. If `names`
/// is not empty, it runs only checks whose names contain one of them. It calls `each` with a line after each check, and
/// returns a line with the counts.
#[wasm_bindgen]
pub async fn conform(short: bool, names: Vec<String>, each: Function) -> std::result::Result<String, JsError> {
    let options = ConformOptions { short, names, ..ConformOptions::default() };
    let mut tell = |check: &drystone_conform::Check| {
        let drystone_conform::Check { verdict, mode, group, name, figure, .. } = check;
        let line = format!("{verdict}: {mode}, {group}, {name}: {figure}");
        // Continue even if a listener fails.
        let _ = each.call1(&JsValue::NULL, &line.into());
    };
    let found = thrown(conform_async(&options, &mut tell).await)?;
    let [passed, failed] = Verdict::ALL.map(|verdict| found.count(verdict));
    Ok(format!("{}: {passed} passed, {failed} failed", found.adapter.name))
}
