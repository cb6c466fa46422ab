//! The engine gains no public item without losing another one.
//!
//! An item is a struct, enum, trait, function, method, constant or type alias that a user of the engine can name. The
//! stages one by one (`drystone::stages`) are for backends, tests and measurements, and do not count. The lint
//! `missing_docs` asks for the documentation of every item.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// Largest number of public items of the engine. The goal is 400.
const MAX_ITEMS: usize = 433;

/// A declaration with `pub`, or in a trait with `pub`.
struct Item {
    /// The type of a method.
    of: Option<String>,
    name: String,
}

impl Item {
    fn path(&self) -> String {
        self.of.iter().chain([&self.name]).map(String::as_str).collect::<Vec<_>>().join("::")
    }
}

/// The words of a text that are names.
fn words(text: &str) -> impl DoubleEndedIterator<Item = &str> {
    text.split(|c: char| !c.is_alphanumeric() && c != '_').filter(|word| !word.is_empty())
}

/// The text without the module of its unit tests.
fn sources(text: &str) -> &str {
    let tests = text
        .match_indices("\n#[cfg(test)]\nmod ")
        .find(|(at, head)| text[at + head.len()..].lines().next().is_some_and(|rest| rest.ends_with('{')));
    tests.map_or(text, |(at, _)| &text[..at])
}

/// The name that a line declares for users, if it does; `in_trait` for the functions of a public trait.
fn declared(line: &str, in_trait: bool) -> Option<&str> {
    let line = line.trim_start();
    let rest = line.strip_prefix("pub ").or_else(|| line.strip_prefix("fn ").filter(|_| in_trait).map(|_| line))?;
    let mut words = words(rest).skip_while(|word| ["unsafe", "async"].contains(word));
    let (kind, name) = (words.next()?, words.next()?);
    match kind {
        "const" if name == "fn" => words.next(),
        "struct" | "enum" | "trait" | "fn" | "const" | "type" => Some(name),
        _ => None,
    }
}

/// The type of the inherent methods, or the public trait, that a line begins, and whether it is a trait.
fn block(line: &str) -> Option<(String, bool)> {
    if let Some(name) = line.strip_prefix("pub trait ") {
        return words(name).next().map(|name| (name.to_owned(), true));
    }
    let rest = line.strip_prefix("impl").filter(|rest| rest.starts_with([' ', '<']) && !rest.contains(" for "))?;
    // Behind the parameters of the block, which may have brackets of their own.
    let mut depth = 0;
    let name = rest.find(|c: char| {
        depth += i32::from(c == '<') - i32::from(c == '>');
        depth == 0 && c == ' '
    })?;
    words(&rest[name..]).next().map(|name| (name.to_owned(), false))
}

/// All items of a text.
fn items(text: &str) -> Vec<Item> {
    let (mut found, mut hidden, mut open) = (Vec::new(), false, None);
    for line in sources(text).lines() {
        let trimmed = line.trim_start();
        if trimmed.starts_with("//") {
            continue;
        }
        hidden |= trimmed.starts_with("#[doc(hidden)]") || trimmed.starts_with("#[cfg(doctest)]");
        let is_outside = !line.starts_with(' ');
        if is_outside && line == "}" {
            open = None;
        }
        let of = open.clone().filter(|_| line.starts_with("    ") && !line.starts_with("     "));
        let name = declared(line, of.as_ref().is_some_and(|(_, is_trait)| *is_trait));
        if let Some(name) = name.filter(|_| !hidden && (is_outside || of.is_some())) {
            found.push(Item { of: of.map(|(of, _)| of), name: name.to_owned() });
        }
        if is_outside && (line.starts_with("impl") || line.starts_with("pub trait ")) {
            open = block(line);
        }
        // Attributes stand between the documentation of an item and the item.
        let is_attribute = trimmed.starts_with("#[")
            || [")]", "derive(", "serde(", "feature ="].iter().any(|a| trimmed.starts_with(a));
        hidden &= is_attribute;
    }
    found
}

/// The names that users can reach: those that public modules declare or re-export.
fn reach(file: &Path, texts: &BTreeMap<PathBuf, String>, names: &mut BTreeSet<String>) {
    let text = sources(&texts[file]);
    let folder = if file.ends_with("lib.rs") || file.ends_with("mod.rs") { file.parent() } else { None };
    let folder = folder.map_or_else(|| file.with_extension(""), Path::to_path_buf);
    for statement in text.split("\npub use ").skip(1) {
        let statement = statement.split(';').next().unwrap_or_default();
        let listed = statement.split_once('{').map_or(statement, |(_, list)| list);
        names.extend(listed.split(',').filter_map(|path| words(path).next_back()).map(str::to_owned));
    }
    for line in text.lines() {
        match line.strip_prefix("pub mod ").and_then(|rest| rest.strip_suffix(';')) {
            Some("stages") => {}
            Some(module) => {
                let [a, b] = [folder.join(format!("{module}.rs")), folder.join(module).join("mod.rs")];
                reach(if texts.contains_key(&a) { &a } else { &b }, texts, names);
            }
            None if !line.starts_with(' ') => names.extend(declared(line, false).map(str::to_owned)),
            None => {}
        }
    }
}

/// The public items below a root, sorted.
fn public(root: &Path, texts: &BTreeMap<PathBuf, String>) -> Vec<String> {
    let mut names = BTreeSet::new();
    reach(&root.join("lib.rs"), texts, &mut names);
    let items = texts.values().flat_map(|text| items(text));
    let mut all: Vec<String> =
        items.filter(|item| names.contains(item.of.as_ref().unwrap_or(&item.name))).map(|item| item.path()).collect();
    all.sort();
    all.dedup();
    all
}

fn texts_of(folder: &Path, texts: &mut BTreeMap<PathBuf, String>) {
    for entry in std::fs::read_dir(folder).expect("a folder") {
        let path = entry.expect("an entry").path();
        if path.is_dir() {
            texts_of(&path, texts);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            texts.insert(path.clone(), std::fs::read_to_string(&path).expect("a source"));
        }
    }
}

#[test]
fn the_engine_gains_no_public_item_without_losing_one() {
    let (root, mut texts) = (Path::new(crate::ROOT).join("src"), BTreeMap::new());
    texts_of(&root, &mut texts);
    let all = public(&root, &texts);
    println!("{} public items: {all:#?}", all.len());
    let known = ["World", "Body::position", "Simulation::step", "Cpu::new", "Joint::hinge", "Backend::name"];
    let missing: Vec<_> = known.iter().filter(|path| !all.iter().any(|item| item == *path)).collect();
    assert!(missing.is_empty(), "the search misses {missing:?}");
    assert!(all.len() <= MAX_ITEMS, "{} public items, more than {MAX_ITEMS}", all.len());
}

#[test]
fn public_items_are_found_wherever_they_stand() {
    let file = |name: &str, text: &str| (Path::new("src").join(name), text.to_owned());
    let texts = BTreeMap::from([
        file("lib.rs", "pub mod open;\nmod closed;\npub use closed::{Kind, sub::Other};\npub mod stages;\n"),
        file(
            "open.rs",
            "pub fn shown() {}\n#[cfg(test)]\nmod tests;\npub const fn bare() {}\npub(crate) fn inner() {}\n",
        ),
        file(
            "closed.rs",
            "pub struct Kind;\nimpl<A: B<C>> Kind<A> {\n    pub const MAX: u8 = 1;\n    pub fn named() {}\n    fn inner() {}\n}\n\
             impl From<Kind> for u8 {\n    fn from() {}\n}\npub struct Hidden;\npub trait Other {\n    fn asked();\n}\n\
             #[cfg(test)]\nmod tests {\n    pub struct Kind;\n}\n",
        ),
        file("stages.rs", "pub fn free() {}\n"),
    ]);
    let expected = ["Kind", "Kind::MAX", "Kind::named", "Other", "Other::asked", "bare", "shown"];
    assert_eq!(public(Path::new("src"), &texts), expected);
}
