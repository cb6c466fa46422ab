//! Every input that once broke a promise, good inputs of every kind, and some that chance makes of good ones.

use std::panic::{catch_unwind, resume_unwind};
use std::path::Path;

use drystone::stages::random::SplitMix64;
use drystone_fuzz::{TARGETS, Target, target};

/// The message of the check of an input, if the input breaks a promise.
fn broken(target: &Target, data: &[u8]) -> Option<String> {
    let check = target.check;
    let said = catch_unwind(|| check(data)).err()?;
    let text = said.downcast_ref::<String>().cloned();
    Some(text.or_else(|| said.downcast_ref::<&str>().map(|&text| text.to_owned())).unwrap_or_default())
}

#[test]
fn inputs_that_broke_something_break_nothing() {
    let findings = Path::new(env!("CARGO_MANIFEST_DIR")).join("findings");
    let mut count = 0;
    let mut all = Vec::new();
    for folder in std::fs::read_dir(&findings).expect("fuzz/findings").map(|entry| entry.expect("a folder").path()) {
        let name = folder.file_name().and_then(|name| name.to_str()).expect("a name");
        let target = target(name).unwrap_or_else(|| panic!("{name} is no kind of input"));
        for file in std::fs::read_dir(&folder).expect(name).map(|entry| entry.expect("a file").path()) {
            count += 1;
            let data = std::fs::read(&file).expect("an input");
            all.extend(broken(target, &data).map(|said| format!("{}: {said}", file.display())));
        }
    }
    assert!(count > 0, "no findings are kept");
    assert!(all.is_empty(), "{} of {count} inputs:\n{}", all.len(), all.join("\n"));
}

#[test]
fn good_inputs_of_every_kind_break_nothing() {
    for target in TARGETS {
        let seeds = (target.seeds)();
        assert!(!seeds.is_empty(), "{}: nothing to begin with", target.name);
        for (k, seed) in seeds.iter().enumerate() {
            assert_eq!(broken(target, seed), None, "{}: seed {k}", target.name);
        }
    }
}

/// Inputs of each kind that chance makes; `DRYSTONE_INPUTS` takes another number.
const INPUTS: u64 = 500;
/// What numbers and texts are made of.
const SIGNS: &[u8] = b"0123456789-.eE\"\n{}[],:=";

#[test]
fn inputs_that_chance_makes_of_good_ones_break_nothing() {
    let count = std::env::var("DRYSTONE_INPUTS").map_or(INPUTS, |n| n.parse().expect("a number of inputs"));
    for target in TARGETS {
        let seeds = (target.seeds)();
        let check = |number| {
            let input = changed(&seeds, target.longest, &mut SplitMix64::new(number));
            assert_eq!(broken(target, &input), None, "{}: input {number}", target.name);
        };
        // A task of rayon that waits takes another input, on the same stack.
        std::thread::scope(|scope| {
            let odd = scope.spawn(|| (1..count).step_by(2).for_each(check));
            (0..count).step_by(2).for_each(check);
            odd.join().unwrap_or_else(|said| resume_unwind(said));
        });
    }
}

/// A good input after one to eight changes: bytes of another good input, of its own, or of chance replace, precede or delete some of its own.
fn changed(seeds: &[Vec<u8>], longest: usize, random: &mut SplitMix64) -> Vec<u8> {
    let mut below = |n: usize| (random.bits() % n.max(1) as u64) as usize;
    let mut input = seeds[below(seeds.len())].clone();
    for _ in 0..=below(8) {
        let start = below(input.len() + 1);
        let end = input.len().min(start + [0, 1, below(4), below(64)][below(4)]);
        let new = match below(4) {
            0 => Vec::new(),
            1 => (0..1 + below(4)).map(|_| below(256) as u8).collect(),
            2 => vec![SIGNS[below(SIGNS.len())]],
            _ => {
                let other = &seeds[below(seeds.len())];
                let from = below(other.len());
                other[from..other.len().min(from + below(64))].to_vec()
            }
        };
        input.splice(start..end, new);
    }
    input.truncate(longest);
    input
}

#[test]
fn a_broken_promise_is_found() {
    let target =
        Target { name: "broken", check: |data| assert!(data.len() < 2, "too long"), seeds: Vec::new, longest: 2 };
    assert_eq!(broken(&target, &[0]), None);
    assert_eq!(broken(&target, &[0, 0]).as_deref(), Some("too long"));
}
