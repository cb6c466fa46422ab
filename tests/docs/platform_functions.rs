//! No step, and nothing that a step begins from, asks the platform for a sine: libraries and processors round such functions differently.

use std::path::{Path, PathBuf};

/// Methods whose last bits are the platform's, or that glam computes in an order of the instruction set. The crate libm and
/// `math::rotation` have those that are the same everywhere.
const METHODS: &[&str] = &[
    "sin",
    "cos",
    "tan",
    "sin_cos",
    "asin",
    "acos",
    "atan",
    "atan2",
    "sinh",
    "cosh",
    "tanh",
    "exp",
    "exp2",
    "exp_m1",
    "ln",
    "ln_1p",
    "log",
    "log2",
    "log10",
    "powf",
    "powi",
    "cbrt",
    "hypot",
    "mul_add",
    "to_scaled_axis",
    "to_axis_angle",
    "angle_between",
    "slerp",
    "inv_mul",
];
/// Functions of glam's rotations, likewise.
const FUNCTIONS: &[&str] = &[
    "from_rotation_x",
    "from_rotation_y",
    "from_rotation_z",
    "from_axis_angle",
    "from_scaled_axis",
    "from_euler",
    "from_rotation_arc",
];

/// Allowed uses: a file or folder, the name, and why no step depends on it.
const ALLOWED: &[(&str, &str, &str)] = &[
    ("problems/src/solver/", "hypot", "solves one contact problem in double precision"),
    ("problems/src/solver/", "ln", "the time that Newton's method takes"),
    ("problems/src/solver/", "powi", "Newton's method"),
    ("src/metrics.rs", "hypot", "a measurement"),
    ("conform/src/", "sin_cos", "random problems, whose rows kernels and shaders read alike"),
    ("src/load.rs", "from_rotation_arc", "suggests settings, in double precision"),
];

/// Files that are compiled for tests only.
const TESTS: &[&str] = &["/tests.rs", "src/collide/testing.rs", "src/collide/distances.rs"];

fn source_files(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).expect("a folder").map(|e| e.expect("an entry").path());
    entries.flat_map(|path| if path.is_dir() { source_files(&path) } else { vec![path] }).collect()
}

/// The code of a file, without comments and without the tests that stand at its end.
fn code(text: &str) -> String {
    let tests = ["#[cfg(test)]\nmod tests {", "#[cfg(test)]\npub(super) mod tests {"];
    let end = tests.iter().filter_map(|begin| text.find(begin)).min().unwrap_or(text.len());
    text[..end].lines().map(|line| line.split("//").next().unwrap_or(line)).collect::<Vec<_>>().join("\n")
}

/// The names that the code asks the platform for. A square is no matter: `powi(2)` is one product.
fn asked(code: &str) -> Vec<&'static str> {
    let is_name = |c: char| c.is_alphanumeric() || c == '_';
    let calls = |before: &str, name: &str| {
        code.match_indices(&format!("{before}{name}")).any(|(at, text)| {
            let rest = &code[at + text.len()..];
            !(rest.starts_with(is_name) || name == "powi" && rest.starts_with("(2)"))
        })
    };
    let methods = METHODS.iter().filter(|name| [".", "f32::", "f64::"].iter().any(|before| calls(before, name)));
    methods.chain(FUNCTIONS.iter().filter(|name| calls("Quat::", name))).copied().collect()
}

#[test]
fn no_step_asks_the_platform_for_a_sine() {
    let root = Path::new(crate::ROOT);
    let (mut wrong, mut used) = (Vec::new(), vec![false; ALLOWED.len()]);
    let folders = ["src", "scenes/src", "problems/src", "conform/src"].map(|folder| source_files(&root.join(folder)));
    for path in folders.concat() {
        let name = path.strip_prefix(root).expect("found there").to_string_lossy().replace('\\', "/");
        if TESTS.iter().any(|tests| name.ends_with(tests)) {
            continue;
        }
        for asked in asked(&code(&std::fs::read_to_string(&path).expect("a text"))) {
            match ALLOWED.iter().position(|(place, allowed, _)| name.starts_with(place) && asked == *allowed) {
                Some(allowed) => used[allowed] = true,
                None => wrong.push(format!("{name} calls {asked}")),
            }
        }
    }
    assert_eq!(wrong, [""; 0]);
    let unused: Vec<_> = ALLOWED.iter().zip(used).filter(|(_, used)| !used).map(|(allowed, _)| allowed).collect();
    assert!(unused.is_empty(), "allowed, and not called: {unused:?}");
}

#[test]
fn the_check_sees_calls_and_neither_comments_nor_squares() {
    assert_eq!(asked(&code("let y = x.sin();")), ["sin"]);
    assert_eq!(asked(&code("xs.map(f32::cos)")), ["cos"]);
    assert_eq!(asked(&code("let q = Quat::from_rotation_z(x.powi(3));")), ["powi", "from_rotation_z"]);
    assert_eq!(asked(&code("let y = libm::sin(x).powi(2); // not x.sin()")), [""; 0]);
    assert_eq!(asked(&code("let y = x;\n#[cfg(test)]\nmod tests {\n    x.sin()\n}")), [""; 0]);
}
