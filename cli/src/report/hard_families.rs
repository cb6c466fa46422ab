//! The page of families: passing shares and times for each preset.

use std::fmt::Write;

use super::prose::wrapped;
use crate::hard::families::FamilyShare;
use drystone::Result;
use drystone::preset::Preset;
use drystone_scenes::Family;

const PRESETS: [Preset; 3] = [Preset::Fast, Preset::Balanced, Preset::Accurate];

/// The page as Markdown. `judge` returns the shares of the families at a preset.
///
/// # Errors
/// A world cannot be run.
pub fn page(seeds: &[u64], mut judge: impl FnMut(Preset) -> Result<Vec<FamilyShare>>) -> Result<String> {
    let all = PRESETS.iter().map(|&preset| judge(preset)).collect::<Result<Vec<_>>>()?;
    let families = || all[0].iter().map(|share| share.family);
    let (first, last, count) = (seeds[0], seeds[seeds.len() - 1], seeds.len());
    let mut page = format!(
        "# Families of hard cases\n\n{}\n",
        include_str!("hard_families_head.md")
            .replace("SEEDS", &format!("{first} to {last}"))
            .replace("COUNT", &count.to_string())
    );
    let heads: Vec<_> = PRESETS.iter().map(|preset| format!("{preset} ({})", preset.config().substeps)).collect();
    writeln!(page, "| family | {} |\n|---|{}", heads.join(" | "), "---|".repeat(PRESETS.len()))
        .expect("text takes all");
    for (k, family) in families().enumerate() {
        let cells: Vec<_> = all.iter().map(|shares| cell(&shares[k])).collect();
        writeln!(page, "| `{family}` | {} |", cells.join(" | ")).expect("text takes all");
    }
    page += "\n## The families\n";
    for family in families() {
        page += &wrapped(&format!("\n**`{family}`**: {}.", family.summary()));
        write!(page, "\n{}", text(family)).expect("text takes all");
    }
    Ok(page + "\n" + include_str!("hard_families_tail.md"))
}

/// `97 % (91.5 to 99.0), 2.41 us`.
fn cell(share: &FamilyShare) -> String {
    let [least, most] = share.interval().map(|x| 100.0 * x);
    format!("{:.0} % ({least:.1} to {most:.1}), {:.2} µs", 100.0 * share.share(), 1e3 * share.ms())
}

/// The text on the statics or closed form of a family, and on the criterion.
const fn text(family: Family) -> &'static str {
    match family {
        Family::Stacks => include_str!("hard_families/stacks.md"),
        Family::LeanedTowers => include_str!("hard_families/leaned-towers.md"),
        Family::Arches => include_str!("hard_families/arches.md"),
        Family::CardHouses => include_str!("hard_families/card-houses.md"),
        Family::PlankTowers => include_str!("hard_families/plank-towers.md"),
        Family::Dominoes => include_str!("hard_families/dominoes.md"),
        Family::Chains => include_str!("hard_families/chains.md"),
        Family::Slopes => include_str!("hard_families/slopes.md"),
        Family::PushedBlocks => include_str!("hard_families/pushed-blocks.md"),
        Family::Piles => include_str!("hard_families/piles.md"),
        // The library can have families for which the page has no text yet.
        _ => "",
    }
}

#[cfg(test)]
mod tests {
    use super::super::prose::WIDTH;
    use super::*;
    use crate::hard::families::Judged;
    use crate::hard::{Check, Limit};

    fn share(family: Family, seeds: &[u64]) -> FamilyShare {
        let check = |seed: u64| Check {
            what: "a check".into(),
            value: 1.0,
            limit: Limit::AtMost(0.5),
            passed: !seed.is_multiple_of(3),
        };
        FamilyShare {
            family,
            worlds: seeds
                .iter()
                .map(|&seed| Judged { seed, checks: vec![check(seed)], ms: 1e-3, seconds: 1.0 })
                .collect(),
        }
    }

    #[test]
    fn the_page_has_the_seeds_and_every_family_with_its_text_in_lines_that_fit() {
        let seeds: Vec<u64> = (1..=200).collect();
        let shares = || Family::ALL.map(|family| share(family, &seeds)).to_vec();
        let page = page(&seeds, |_| Ok(shares())).expect("a page");
        let long: Vec<_> = page.lines().filter(|line| line.chars().count() > WIDTH).collect();
        assert!(long.is_empty(), "{long:#?}");
        assert!(page.contains("--families 200 --page") && page.contains("(seeds 1 to 200)"), "{page}");
        for family in Family::ALL {
            assert!(text(family).contains("pass") || family.summary().ends_with("they stand"), "{family}");
            assert!(page.contains(&format!("| `{family}` | 67 % (60.")), "{family}");
        }
    }
}
