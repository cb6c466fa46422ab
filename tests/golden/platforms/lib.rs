//! Runs the scenes of golden hashes and tells which differ, for platforms that `cargo test` does not reach. The scenes are those of
//! `tests/golden`.

#[path = "../scenes/mod.rs"]
pub mod scenes;
#[path = "../table.rs"]
pub mod table;

#[cfg(target_family = "wasm")]
mod exports;

use drystone::{Backend, Cpu, Reference};
use scenes::all;
use table::{Row, differences, rows};

const HASHES: &str = include_str!("../hashes.txt");

/// A backend on this platform, with its name for people.
pub fn backends() -> Vec<(String, Box<dyn Backend>)> {
    let lanes = Cpu::each().map(|cpu| (format!("cpu, {}", cpu.adapter()), Box::new(cpu) as Box<dyn Backend>));
    let reference: Box<dyn Backend> = Box::new(Reference::<f32>::new());
    std::iter::once(("reference".into(), reference)).chain(lanes).collect()
}

/// Runs all scenes on a backend, and gives a line for each that has not its golden hash.
///
/// # Errors
/// The file of hashes is none.
pub fn check(mut backend: Box<dyn Backend>) -> Result<Vec<String>, String> {
    let golden = rows(HASHES)?;
    let mut found: Vec<Row> = Vec::new();
    for scene in all() {
        let (row, back) = scene.run(backend, |_| {});
        backend = back;
        found.push(row);
    }
    Ok(differences(&golden, &found))
}

/// One line that says how many scenes have their golden hash on a backend, or the lines of those that have another; and whether all have it.
pub fn report(name: &str, backend: Box<dyn Backend>) -> (String, bool) {
    match check(backend) {
        Ok(different) if different.is_empty() => (format!("{name}: {} scenes, same hashes", all().len()), true),
        Ok(different) => {
            let lines = different.join("\n  ");
            (format!("{name}: {} of {} scenes differ\n  {lines}", different.len(), all().len()), false)
        }
        Err(why) => (format!("{name}: {why}"), false),
    }
}

/// The hash of each step of a scene on the reference, to find the first that differs; none if no scene has the name.
pub fn trace(name: &str) -> Option<Vec<u64>> {
    let scene = all().into_iter().find(|scene| scene.name == name)?;
    let mut hashes = Vec::new();
    scene.run(Box::new(Reference::<f32>::new()), |simulation| hashes.push(simulation.hash()));
    Some(hashes)
}
