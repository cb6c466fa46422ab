//! The file of golden hashes: a line a scene with its name, its steps and the hash after them.

use std::fmt::Write;

/// A scene, and the hash of its bodies after some steps.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Row {
    pub scene: String,
    pub steps: u32,
    pub hash: u64,
}

const HEAD: &str = "\
# Hashes of the poses and velocities of all bodies (Simulation::hash) after so many steps, the same on every platform.
# docs/same-numbers.md says what they are. Written by: UPDATE_GOLDEN=1 cargo test --test golden reference
# scene                  steps  hash
";

/// The text of the file.
pub fn text(rows: &[Row]) -> String {
    rows.iter().fold(HEAD.to_string(), |mut text, row| {
        writeln!(text, "{:24} {:5}  {:016x}", row.scene, row.steps, row.hash).expect("a string takes it");
        text
    })
}

/// The rows of the text.
///
/// # Errors
/// The line that is no row.
pub fn rows(text: &str) -> Result<Vec<Row>, String> {
    let lines = text.lines().filter(|line| !line.is_empty() && !line.starts_with('#'));
    let row = |line: &str| {
        let [scene, steps, hash] = line.split_whitespace().collect::<Vec<_>>()[..] else { return None };
        let (steps, hash) = (steps.parse().ok()?, u64::from_str_radix(hash, 16).ok()?);
        Some(Row { scene: scene.into(), steps, hash })
    };
    lines.map(|line| row(line).ok_or_else(|| format!("{line:?} is not a scene, its steps and a hash"))).collect()
}

/// One line for each scene that has another hash, that is missing, or that has no hash yet.
pub fn differences(golden: &[Row], found: &[Row]) -> Vec<String> {
    let of = |rows: &[Row], scene: &str| rows.iter().find(|row| row.scene == scene).cloned();
    let compared = found.iter().filter_map(|row| {
        let Row { scene, steps, hash } = row;
        match of(golden, scene) {
            None => Some(format!("{scene}: {hash:016x} after {steps} steps, and no golden hash")),
            Some(other) if other == *row => None,
            Some(Row { steps: then, hash: other, .. }) => {
                Some(format!("{scene}: {hash:016x} after {steps} steps, the golden hash is {other:016x} after {then}"))
            }
        }
    });
    let missing = golden.iter().filter(|row| of(found, &row.scene).is_none());
    compared.chain(missing.map(|row| format!("{}: did not run", row.scene))).collect()
}
