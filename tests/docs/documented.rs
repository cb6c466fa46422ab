//! Every public type and function has an example that compiles.
//!
//! The rule: a struct, enum, trait, function or method that a user of the engine, of scenes, problems, conform or the plugin for Bevy can name stands in an example, as a word. That is an example in
//! the documentation of its own source file, or of a method or the declaration of its type in any file; documentation tests compile and run all of
//! them, and compile those that need a device (`no_run`). Constants and type aliases need none. The stages one by one (`drystone::stages`) are for tests and measurements and need none.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// Public functions whose arguments are rows and passes of `drystone::stages`.
const OF_STAGES: [&str; 13] = [
    "Backend::run_checked",
    "Cpu::bytes_of_contacts",
    "Cpu::bytes_of_sweep",
    "Reference::advance",
    "Reference::holding",
    "Reference::rows_mut",
    "StepPlan::bytes_moved",
    "StepPlan::of_sweeps",
    "StepPlan::with_summary",
    "StepProblem::in_one_block",
    "StepProblem::sweep_in_order_of_rows",
    "StepProblem::total_impulse",
    "open_for_surface",
];

/// A declaration with `pub`, or in a trait with `pub`.
struct Item {
    file: PathBuf,
    /// The type of a method.
    of: Option<String>,
    name: String,
    /// The code of its examples.
    examples: String,
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

/// The code between fences of Rust in lines of documentation.
fn code<'a>(lines: impl Iterator<Item = &'a str>) -> String {
    let (mut code, mut inside, mut is_rust) = (String::new(), false, false);
    for line in lines.map(str::trim) {
        if let Some(language) = line.strip_prefix("```") {
            (inside, is_rust) = (!inside, ["", "no_run"].contains(&language));
        } else if inside && is_rust {
            code += line;
            code += "\n";
        }
    }
    code
}

/// The text without its unit tests.
fn sources(text: &str) -> &str {
    text.split("\n#[cfg(test)]\nmod ").next().unwrap_or_default()
}

/// The name that a line declares for users, if it does; `in_trait` for the functions of a public trait.
fn declared(line: &str, in_trait: bool) -> Option<&str> {
    let line = line.trim_start();
    let rest = line.strip_prefix("pub ").or_else(|| line.strip_prefix("fn ").filter(|_| in_trait).map(|_| line))?;
    let mut words = words(rest).skip_while(|word| ["const", "unsafe", "async"].contains(word));
    let kind = words.next()?;
    words.next().filter(|_| ["struct", "enum", "trait", "fn"].contains(&kind))
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

/// All items of a file.
fn items(file: &Path, text: &str) -> Vec<Item> {
    let (mut found, mut docs, mut hidden, mut open) = (Vec::new(), Vec::new(), false, None);
    for line in sources(text).lines() {
        let trimmed = line.trim_start();
        if let Some(doc) = trimmed.strip_prefix("///") {
            docs.push(doc);
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
            let (of, name) = (of.map(|(of, _)| of), name.to_owned());
            found.push(Item { file: file.into(), of, name, examples: code(docs.iter().copied()) });
        }
        if is_outside && (line.starts_with("impl") || line.starts_with("pub trait ")) {
            open = block(line);
        }
        // Attributes stand between the documentation of an item and the item.
        let is_attribute = trimmed.starts_with("#[")
            || [")]", "derive(", "serde(", "feature ="].iter().any(|a| trimmed.starts_with(a));
        if !is_attribute {
            (docs, hidden) = (Vec::new(), false);
        }
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

/// The public items that no example names.
fn unshown(root: &Path, texts: &BTreeMap<PathBuf, String>) -> (usize, Vec<String>) {
    let mut names = BTreeSet::new();
    reach(&root.join("lib.rs"), texts, &mut names);
    let items: Vec<Item> = texts.iter().flat_map(|(file, text)| items(file, text)).collect();
    let public: Vec<&Item> =
        items.iter().filter(|item| names.contains(item.of.as_ref().unwrap_or(&item.name))).collect();
    let (mut of_file, mut of_type) = (BTreeMap::<&Path, String>::new(), BTreeMap::<&str, String>::new());
    for (file, text) in texts {
        *of_file.entry(file).or_default() += &code(sources(text).lines().filter_map(|line| line.strip_prefix("//!")));
    }
    for item in &items {
        *of_file.entry(&item.file).or_default() += &item.examples;
        *of_type.entry(item.of.as_ref().unwrap_or(&item.name)).or_default() += &item.examples;
    }
    let is_shown = |item: &&&Item| {
        let own = &of_type[item.of.as_ref().unwrap_or(&item.name).as_str()];
        [own, &of_file[item.file.as_path()]].iter().any(|text| words(text).any(|word| word == item.name))
    };
    (public.len(), public.iter().filter(|item| !is_shown(item)).map(|item| item.path()).collect())
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
fn every_public_type_and_function_stands_in_an_example() {
    let (mut count, mut unshown) = (0, Vec::new());
    for folder in ["src", "scenes/src", "problems/src", "conform/src", "bevy/src"] {
        let root = Path::new(crate::ROOT).join(folder);
        let mut texts = BTreeMap::new();
        texts_of(&root, &mut texts);
        let (own, without) = self::unshown(&root, &texts);
        count += own;
        unshown.extend(without);
    }
    println!("{count} public types and functions, {} of stages without an example", unshown.len());
    assert!(count > 350, "{count} public types and functions: the search misses some");
    let without: Vec<_> = unshown.iter().filter(|path| !OF_STAGES.contains(&path.as_str())).collect();
    assert!(without.is_empty(), "no example names {without:#?}");
    let shown: Vec<_> = OF_STAGES.iter().filter(|path| !unshown.iter().any(|item| item == *path)).collect();
    assert!(shown.is_empty(), "these need no exception: {shown:#?}");
}

#[test]
fn an_item_without_an_example_is_found_wherever_it_stands() {
    let file = |name: &str, text: &str| (Path::new("src").join(name), text.to_owned());
    let texts = BTreeMap::from([
        file("lib.rs", "pub mod open;\nmod closed;\npub use closed::{Kind, sub::Other};\npub mod stages;\n"),
        file(
            "open.rs",
            "/// ```\n/// shown(Seen);\n/// ```\npub fn shown() {}\npub fn bare() {}\npub(crate) fn inner() {}\n",
        ),
        file(
            "closed.rs",
            "/// ```\n/// Kind::new().named();\n/// ```\npub struct Kind;\nimpl<A: B<C>> Kind<A> {\n    pub fn new() {}\n    pub fn named() {}\n    \
             pub fn missing() {}\n    fn inner() {}\n}\nimpl From<Kind> for u8 {\n    fn from() {}\n}\npub struct Hidden;\n\
             /// ```text\n/// Other\n/// ```\npub trait Other {\n    fn asked();\n}\n#[cfg(test)]\nmod tests {\n    pub struct Kind;\n}\n",
        ),
        file("stages.rs", "pub fn free() {}\n"),
    ]);
    let (count, unshown) = unshown(Path::new("src"), &texts);
    assert_eq!((count, unshown), (8, ["Kind::missing", "Other", "Other::asked", "bare"].map(str::to_owned).into()));
}
