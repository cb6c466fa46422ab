//! The house has floors: a module names only modules of its own floor or of lower ones.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// The modules of the engine on each floor, the ground floor first.
const LIBRARY: &[&[&str]] = &[
    &["constants", "math", "lanes", "random", "error", "memory", "names", "panics", "saved", "suggest"],
    &["world", "config", "preset", "stats"],
    &["collide", "graph"],
    &["effort", "queries", "load"],
    &["problem"],
    &["kernels", "plan", "metrics", "rest", "sleep"],
    &["backend", "energy", "openings"],
    &["simulation"],
    &["batch", "character"],
    &["stages"],
];

/// The modules of scenes, above the engine.
const SCENES: &[&[&str]] =
    &[&["driver", "spawner"], &["scene"], &["catalogue", "spawners", "file"], &["find"], &["recording"]];

/// The modules of contact problems, above the engine.
const PROBLEMS: &[&[&str]] = &[&["contacts"], &["residuals"], &["solver", "step"], &["batch"]];

/// The modules of comparisons, above the engine and scenes.
const CONFORM: &[&[&str]] = &[&["compare"], &["conform"]];

/// The modules of the maze game, above the engine.
const MAZE: &[&[&str]] = &[&["map", "script"], &["board"], &["game"], &["pilot"]];

/// The modules of pictures, above the engine and the maze game.
const VIEW: &[&[&str]] = &[
    &["poses"],
    &["bounds", "colors"],
    &["camera"],
    &["mesh", "overlay", "pipeline"],
    &["renderer"],
    &["canvas"],
    &["show"],
    &["eye", "labyrinth", "live", "sight"],
    &["film", "live_show"],
];

/// The modules of the plugin for Bevy, above the engine.
const BEVY: &[&[&str]] = &[
    &["components", "error"],
    &["physics"],
    &["debug", "ease", "events", "joint", "query", "read", "step"],
    &["gizmos", "observe", "rollback"],
    &["prelude"],
];

/// The modules of the command, above all others.
const COMMAND: &[&[&str]] =
    &[&["adapter", "files", "settings"], &["hard"], &["report", "soak"], &["view"], &["commands"]];

const LIB: &str = include_str!("../../src/lib.rs");

/// The packages: the folder of each, the text of its root, its floors.
const PACKAGES: [(&str, &str, &[&[&str]]); 8] = [
    ("src", LIB, LIBRARY),
    ("scenes/src", include_str!("../../scenes/src/lib.rs"), SCENES),
    ("problems/src", include_str!("../../problems/src/lib.rs"), PROBLEMS),
    ("conform/src", include_str!("../../conform/src/lib.rs"), CONFORM),
    ("maze/src", include_str!("../../maze/src/lib.rs"), MAZE),
    ("view/src", include_str!("../../view/src/lib.rs"), VIEW),
    ("bevy/src", include_str!("../../bevy/src/lib.rs"), BEVY),
    ("cli/src", include_str!("../../cli/src/lib.rs"), COMMAND),
];

fn floor(floors: &[&[&str]], module: &str) -> Option<usize> {
    floors.iter().position(|modules| modules.contains(&module))
}

fn identifier(text: &str) -> &str {
    &text[..text.find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(text.len())]
}

/// The items that the crate's root exports under a shorter name, each with its module.
fn re_exports() -> BTreeMap<&'static str, &'static str> {
    let lines = LIB.split(';').filter_map(|statement| statement.trim_start().strip_prefix("pub use "));
    let names = |line: &'static str| {
        let last = line.rsplit("::").next().unwrap_or(line);
        last.split(|c: char| !c.is_alphanumeric()).filter(|name| !name.is_empty()).map(move |n| (n, identifier(line)))
    };
    lines.flat_map(names).collect()
}

/// The modules of its own package that the code of `text` names, whatever its comments say.
fn named_modules(text: &str) -> Vec<&str> {
    let code = text.lines().map(|line| line.split("//").next().unwrap_or(line));
    let names = code.flat_map(|line| line.split("crate::").skip(1).map(identifier));
    let exports = re_exports();
    names.map(|name| exports.get(name).copied().unwrap_or(name)).collect()
}

/// Each module that `text`, a file of `module`, names against the rule.
fn too_high(floors: &[&[&str]], module: &str, text: &str) -> Vec<String> {
    let own = floor(floors, module).unwrap_or_else(|| panic!("{module} is on no floor"));
    let named = named_modules(text).into_iter().filter(|name| floor(floors, name).is_none_or(|f| f > own));
    named.map(|name| format!("{module} names {name}")).collect()
}

fn source_files(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).expect("a folder").map(|e| e.expect("an entry").path());
    entries.flat_map(|path| if path.is_dir() { source_files(&path) } else { vec![path] }).collect()
}

#[test]
fn a_module_names_only_modules_of_its_own_floor_or_lower_ones() {
    let mut wrong = Vec::new();
    for (folder, _, floors) in PACKAGES {
        let root = Path::new(crate::ROOT).join(folder);
        for path in source_files(&root).into_iter().filter(|path| path.extension().is_some_and(|e| e == "rs")) {
            let inside = path.strip_prefix(&root).expect("found there");
            let module = inside.iter().next().expect("a name").to_string_lossy();
            let module = module.trim_end_matches(".rs");
            if !["lib", "main"].contains(&module) {
                wrong.extend(too_high(floors, module, &std::fs::read_to_string(&path).expect("a text")));
            }
        }
    }
    assert_eq!(wrong, [""; 0]);
}

#[test]
fn every_module_is_on_one_floor() {
    for (_, root, floors) in PACKAGES {
        let lines = root.lines().map(|line| line.strip_prefix("pub ").unwrap_or(line));
        let mut modules: Vec<_> = lines.filter_map(|line| line.strip_prefix("mod ")).map(identifier).collect();
        let mut housed = floors.concat();
        modules.sort_unstable();
        housed.sort_unstable();
        assert_eq!(housed, modules);
    }
}

#[test]
fn a_module_that_names_a_higher_one_is_found() {
    let too_high = |module, text| too_high(LIBRARY, module, text);
    assert_eq!(too_high("graph", "use crate::simulation::Simulation;"), ["graph names simulation"]);
    assert_eq!(too_high("graph", "fn f() -> crate::Simulation {}"), ["graph names simulation"]);
    assert_eq!(too_high("math", "use crate::{world::World, error::Error};").len(), 1);
    assert_eq!(too_high("graph", "/// As in [`Simulation`](crate::simulation::Simulation)."), [""; 0]);
    assert_eq!(too_high("simulation", "use crate::graph::Edge; use crate::Error;"), [""; 0]);
}
