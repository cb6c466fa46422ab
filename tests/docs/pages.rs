//! The names that README.md, the pages of docs and the READMEs of the packages print as code are those of the sources.
//!
//! A span of code between grave accents may hold paths, `Type::member`, `module::item`, options of commands and words. A path names
//! a file or a folder, by its last parts at least. A block of the type declares the member, a file of the module has the item. Options,
//! and words of three letters and more, stand in code and not only in comments; words in capital letters are places to fill in. Of the
//! tables of docs/from-other-engines.md only the last column has names of drystone.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// Kinds of files whose words are names; files without a kind are scripts.
const KINDS: [&str; 10] = ["rs", "wgsl", "toml", "js", "mjs", "html", "py", "yml", "sh", ""];
/// Folders that a build or a test fills, and those of other programs.
const LEFT_OUT: [&str; 8] =
    [".git", "target", "node_modules", "dist", "findings", ".venv", ".pytest_cache", ".mypy_cache"];
/// Names of compilers, drivers, batch systems, browsers and other crates, names to fill in, and what a build makes.
const OF_OTHERS: [&str; 16] = [
    "cmake",
    "clang",
    "libclang",
    "NoContraction",
    "LP_NATIVE_VECTOR_WIDTH",
    "GLIBC_TUNABLES",
    "glibc",
    "malloc",
    "hugetlb",
    "--requeue",
    "requeue",
    "/usr/lib/chromium/vk_swiftshader_icd.json",
    "application/wasm",
    "Quat::from_rotation_z",
    "web/dist",
    "binary::filter",
];

/// The files of the repository by their paths.
struct Sources {
    files: BTreeMap<String, String>,
    /// Words of the code.
    words: BTreeSet<String>,
    /// The declarations in the blocks of each type.
    members: BTreeMap<String, BTreeSet<String>>,
}

fn is_word(c: char) -> bool {
    c.is_ascii_alphanumeric() || c == '_'
}

fn words(text: &str) -> impl Iterator<Item = &str> {
    text.split(|c| !is_word(c)).filter(|word| !word.is_empty())
}

/// Whether a word is one to fill in.
fn is_place(word: &str) -> bool {
    word.chars().all(|c| c.is_ascii_uppercase())
}

/// The text without its comments.
fn code(path: &str, text: &str) -> String {
    let mark = if path.ends_with("rs") || path.ends_with("wgsl") || path.ends_with("js") { "//" } else { "#" };
    let lines = text.lines().map(|line| if line.trim_start().starts_with(mark) { "" } else { line });
    let cut = |line: &'_ str| line.split(&format!(" {mark} ")).next().unwrap_or_default().to_owned() + "\n";
    lines.map(cut).collect()
}

/// The type whose block a line of Rust begins.
fn block(line: &str) -> Option<&str> {
    let line = line
        .strip_prefix("pub")
        .map_or(line, |rest| rest.trim_start_matches("(crate)").trim_start_matches("(super)").trim_start());
    let rest = match line.strip_prefix("impl") {
        Some(rest) => rest.rsplit_once(" for ").map_or(rest, |(_, name)| name),
        None => ["struct ", "enum ", "trait "].iter().find_map(|kind| line.strip_prefix(kind))?,
    };
    // Behind the parameters of the block, which may have brackets of their own.
    let mut depth = 0;
    let open = |c: char| {
        depth += i32::from(c == '<') - i32::from(c == '>');
        depth == 0 && c != '>' && c != ' '
    };
    words(&rest[rest.find(open)?..]).next()
}

/// The name that a line inside of a block declares.
fn member(line: &str) -> Option<&str> {
    let line = line.strip_prefix("    ").filter(|line| line.starts_with(is_word))?;
    let line = line.trim_start_matches("pub(crate) ").trim_start_matches("pub(super) ");
    words(line).find(|word| !["pub", "const", "unsafe", "async", "fn", "type"].contains(word))
}

impl Sources {
    fn new(files: BTreeMap<String, String>) -> Self {
        let (mut names, mut members) = (BTreeSet::new(), BTreeMap::<String, BTreeSet<String>>::new());
        for (path, text) in files.iter().filter(|(path, _)| !path.ends_with(".md")) {
            names.extend(words(path).map(str::to_owned));
            let code = code(path, text);
            names.extend(words(&code).map(str::to_owned));
            let mut open = None;
            for line in code.lines().filter(|_| path.ends_with(".rs")) {
                match member(line).zip(open) {
                    Some((name, of)) => drop(members.entry(String::from(of)).or_default().insert(name.to_owned())),
                    None if !line.starts_with(' ') && line.ends_with('{') => open = block(line),
                    None if line == "}" => open = None,
                    None => {}
                }
            }
        }
        Self { files, words: names, members }
    }

    /// Whether a file or a folder has this path, or a path that ends so, up to the first place to fill in.
    fn has_path(&self, path: &str) -> bool {
        let parts = path.split('/').filter(|part| *part != ".").take_while(|part| !is_place(part));
        let wanted = parts.fold(String::from("/"), |path, part| path + part + "/");
        wanted == "/" || self.files.keys().any(|file| format!("/{file}/").contains(&wanted))
    }

    /// Whether a block of type `of` declares `name`, or a file of module `of` has it or its name.
    fn has_item(&self, of: &str, name: &str) -> bool {
        if of == "drystone" || of.starts_with("drystone_") {
            return true;
        }
        if of.starts_with(|c: char| c.is_ascii_uppercase()) {
            return self.members.get(of).is_some_and(|members| members.contains(name));
        }
        let mut files =
            self.files.iter().filter(|(path, _)| path.ends_with(".rs") && words(path).any(|part| part == of));
        files.any(|(path, text)| words(path).chain(words(text)).any(|word| word == name))
    }

    /// Whether a command takes an option.
    fn has_option(&self, option: &str) -> bool {
        let mut scripts = self.files.iter().filter(|(path, _)| !path.ends_with(".md"));
        self.words.contains(&option[2..].replace('-', "_")) || scripts.any(|(_, text)| text.contains(option))
    }

    /// The names in a span that the sources do not have.
    fn unknown(&self, span: &str) -> Vec<String> {
        let mut unknown = BTreeSet::new();
        for part in span.split_whitespace().map(|part| part.trim_end_matches([',', '.'])) {
            let is_path = part.contains('/') && part.chars().all(|c| is_word(c) || "/.-".contains(c));
            if is_path && part.contains(char::is_alphabetic) {
                unknown.extend((!self.has_path(part)).then(|| part.to_owned()));
                continue;
            }
            let option = part.split('=').next().unwrap_or_default();
            if option.len() > 2 && option.starts_with("--") {
                unknown.extend((!self.has_option(option)).then(|| option.to_owned()));
            }
            let part = part.strip_prefix(option).filter(|_| option.starts_with("--")).unwrap_or(part);
            let path = part.split('(').next().unwrap_or_default();
            let items: Vec<_> = path.split("::").collect();
            for pair in items.windows(2).filter(|pair| pair.iter().all(|item| item.chars().all(is_word))) {
                unknown.extend((!self.has_item(pair[0], pair[1])).then(|| pair.join("::")));
            }
            let is_hash = |word: &str| word.chars().all(|c| c.is_ascii_hexdigit());
            let is_number = |word: &str| word.starts_with(|c: char| c.is_ascii_digit()) || is_hash(word);
            let names = words(part).filter(|word| word.len() > 2 && !is_number(word) && !is_place(word));
            unknown.extend(names.filter(|word| !self.words.contains(*word)).map(str::to_owned));
        }
        unknown.into_iter().filter(|name| !OF_OTHERS.contains(&name.as_str())).collect()
    }
}

/// The spans of code of a page; of tables only those of the last column if `last_column`.
fn spans(page: &str, last_column: bool) -> Vec<String> {
    let (mut text, mut is_fenced) = (String::new(), false);
    for line in page.lines() {
        if line.trim_start().starts_with("```") {
            is_fenced = !is_fenced;
        } else if !is_fenced && !line.starts_with("    ") {
            let line = match line.strip_prefix('|') {
                Some(row) if last_column => row.trim_end_matches('|').rsplit(" | ").next().unwrap_or_default(),
                _ => line,
            };
            text += line;
            text += "\n";
        }
    }
    text.split('`').skip(1).step_by(2).map(str::to_owned).collect()
}

fn read(folder: &Path, below: &str, files: &mut BTreeMap<String, String>) {
    for entry in std::fs::read_dir(folder).expect("a folder") {
        let entry = entry.expect("an entry");
        let name = entry.file_name().to_string_lossy().into_owned();
        let (path, file) = (format!("{below}{name}"), entry.path());
        if file.is_dir() {
            if LEFT_OUT.contains(&name.as_str()) {
                files.insert(path, String::new());
            } else {
                read(&file, &format!("{path}/"), files);
            }
        } else if path != "tests/docs/pages.rs" {
            let kind = file.extension().map_or("", |kind| kind.to_str().unwrap_or_default());
            let is_read = kind == "md" || KINDS.contains(&kind);
            let text = if is_read { std::fs::read_to_string(&file).unwrap_or_default() } else { String::new() };
            files.insert(path, text);
        }
    }
}

/// Pages of the repository: README.md, those of docs, and the READMEs of packages and tests.
fn is_page(path: &str) -> bool {
    path.ends_with("README.md") || (path.starts_with("docs/") && path.ends_with(".md"))
}

#[test]
fn every_name_that_a_page_prints_as_code_stands_in_the_sources() {
    let mut files = BTreeMap::new();
    read(Path::new(crate::ROOT), "", &mut files);
    let sources = Sources::new(files);
    let (mut count, mut unknown) = (0, Vec::new());
    for (path, page) in sources.files.iter().filter(|(path, _)| is_page(path)) {
        let spans = spans(page, path.ends_with("from-other-engines.md"));
        count += spans.len();
        for span in spans {
            unknown.extend(sources.unknown(&span).into_iter().map(|name| format!("{path}: {name} in `{span}`")));
        }
    }
    println!("{count} spans of code");
    assert!(count > 1000, "{count} spans of code: the search misses some");
    assert!(unknown.is_empty(), "the sources do not have {unknown:#?}");
}

#[test]
fn a_name_that_the_sources_do_not_have_is_found_wherever_it_stands() {
    let file = |path: &str, text: &str| (path.to_owned(), text.to_owned());
    let sources = Sources::new(BTreeMap::from([
        file(
            "src/math/mod.rs",
            "pub struct Pair<'a, T: Of<T>> {\n    pub(crate) mass: T,\n}\nimpl<T: Of<T>> Pair<'_, T> {\n    fn turned() {}\n}\n\
             fn free() {} // gone\n",
        ),
        file(
            "src/kind.rs",
            "pub enum Kind {\n    First,\n}\nimpl Show for Kind {\n    fn show() {}\n}\nstruct Args {\n    max_depth: f32,\n}\n",
        ),
        file("Cargo.toml", "name = \"drystone\"\n"),
        file("tests/run", "# old\ncase $1 in --brief) ;; esac\n"),
    ]));
    for span in [
        "Pair::mass",
        "Pair::turned(x, 2.0)",
        "math::free",
        "drystone::math",
        "Kind::First",
        "Kind::show",
        "./tests/run --brief",
    ] {
        assert_eq!(sources.unknown(span), [""; 0], "{span}");
    }
    for span in ["math/mod.rs", "run --max-depth 3", "mass[k]", "FILE", "src/FILE", "0.5 x", "1/4"] {
        assert_eq!(sources.unknown(span), [""; 0], "{span}");
    }
    let unknown = [
        "Pair::free",
        "Kind::turned",
        "math::First",
        "gone",
        "old",
        "run --depth",
        "src/mod.rs",
        "tests/walk",
        "Pair::turned().gone",
    ];
    for span in unknown {
        assert_eq!(sources.unknown(span).len(), 1, "{span}: {:?}", sources.unknown(span));
    }
    let page = "`a` and `b\nc`\n```sh\n`d`\n```\n| `e` | `f | g` |\n";
    assert_eq!(spans(page, false), ["a", "b\nc", "e", "f | g"]);
}
