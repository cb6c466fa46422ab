//! Every input that once broke a promise, and good inputs of every kind.

use std::panic::catch_unwind;
use std::path::Path;

use drystone_fuzz::{TARGETS, Target, target};

/// What the check of an input says where a promise is broken.
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
