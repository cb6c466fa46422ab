//! The tables of the first pages for a reader, from the rows of a report and of the page on performance.
//!
//! A page has each table between two lines, `<!-- rows: NAME -->` and `<!-- end of rows -->`. All figures come from the
//! rows, and the best ones are bold. Printed figures are compared, so that equal ones are all bold.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use super::duels::{OWN, ahead};
use super::page::{faults, of_side};
use super::pareto::{Duel, FLOOR, Fault, front};
use super::row::{Row, WindowRow};
use super::survey::Report;
use crate::files;
use crate::report::number::number;
use drystone::{Error, Result};

/// The pages with tables, relative to the root of the repository.
const PAGES: [&str; 2] = ["README.md", "docs/speed-vs-error.md"];

const BEGIN: &str = "<!-- rows: ";
const END: &str = "<!-- end of rows -->";

/// The engines in the order of their columns, each with its column title and its name in text.
const ENGINES: [(&str, &str, &str); 5] = [
    (OWN, "drystone", "drystone"),
    ("rapier", "Rapier", "[Rapier](https://rapier.rs) 0.36"),
    ("box3d", "Box3D", "Box3D 0.1"),
    ("physx", "PhysX", "PhysX 5.1 with TGS"),
    ("bullet", "Bullet", "Bullet 3.24"),
];

/// Scenes of the table of engines at their defaults; `{}` is the number of bodies. A scene without rows is left out.
const DROPPED: [(&str, &str); 8] = [
    ("tower of {} boxes", "tower:n=20,gap=0.005"),
    ("tower of {} boxes whose top is 1000 times heavier", "tower:n=10,top_ratio=1000,gap=0.005"),
    ("wall of {} bricks", "wall:gap=0.005"),
    ("plane pyramid of {} boxes", "pyramid:base=40,gap=0.005"),
    ("pile of {} boxes", "pile:n=5120"),
    ("pile of {} boxes", "pile:n=20000"),
    ("pile of {} boxes of random sizes and densities", "pile-mixed"),
    ("pile of {} bodies of six shapes, random sizes and densities", "pile-mixed:n=600,kinds=6"),
];
const BUILT: [(&str, &str); 3] = [
    ("plane pyramid of {} boxes", "pyramid:base=100"),
    ("wall of {} bricks", "wall"),
    ("tower of {} boxes whose top is 1000 times heavier", "tower:n=10,top_ratio=1000"),
];

/// Scenes of the table of least errors: mean overlaps, or gaps of joints.
const LEAST: [(&str, &str); 5] = [
    ("stack of {} boxes with masses 1 and 100 in turn, dropped", "mass-ratio:gap=0.005"),
    ("tower of {} boxes whose top is 1000 times heavier, dropped", "tower:n=10,top_ratio=1000,gap=0.005"),
    ("tower of {} boxes whose top is 1000 times heavier, built in place", "tower:n=10,top_ratio=1000"),
    ("pile of {} bodies of six shapes, random sizes and densities", "pile-mixed:n=600,kinds=6"),
    ("chain of {} bodies with a heavy end: gap of a joint", "chain"),
];

/// Largest number of table rows for errors in which another engine is better.
const MAX_LOST: usize = 6;

/// Rewrites the tables of the pages below `root` from the rows in `docs/report` and `docs/performance`, and returns the
/// pages. With `check`, it writes nothing.
///
/// # Errors
/// There are no rows; a table has an unknown name or no end; with `check`, a page differs from the rows (the message
/// has the first different line).
pub fn tables(root: &Path, check: bool) -> Result<Vec<PathBuf>> {
    let rows = Rows::read(&root.join("docs"))?;
    let write = |page: &str| {
        let path = root.join(page);
        let text = std::fs::read_to_string(&path).map_err(Error::file(&path))?;
        let new = rows.rewritten(&text).map_err(|e| Error::input(format!("{}: {e}", path.display())))?;
        match first_difference(&text, &new) {
            Some((line, was, is)) if check => {
                let page = path.display();
                Err(Error::input(format!("{page}: line {line} is {was:?}, but the rows give {is:?}")))
            }
            Some(_) => files::write(&path, new.as_bytes()).map(|()| path),
            None => Ok(path),
        }
    };
    PAGES.into_iter().map(write).collect()
}

fn first_difference<'a>(old: &'a str, new: &'a str) -> Option<(usize, &'a str, &'a str)> {
    let lines = |text: &'a str| text.lines().map(Some).chain(std::iter::repeat(None));
    let count = old.lines().count().max(new.lines().count());
    let pairs = (1..).zip(lines(old).zip(lines(new))).take(count);
    pairs.filter(|(_, (old, new))| old != new).map(|(k, (old, new))| (k, old.unwrap_or(""), new.unwrap_or(""))).next()
}

/// All rows that the tables use.
struct Rows {
    results: Vec<Vec<Row>>,
    thirds: Vec<WindowRow>,
}

impl Rows {
    fn read(docs: &Path) -> Result<Self> {
        let Report { results, .. } = Report::read(&docs.join("report"))?;
        let thirds = files::rows(&docs.join("performance/engines-1.csv"))?;
        Ok(Self { results, thirds })
    }

    /// A page with all its tables rewritten.
    fn rewritten(&self, page: &str) -> Result<String> {
        let mut parts = page.split(BEGIN);
        let mut text = parts.next().unwrap_or_default().to_owned();
        for part in parts {
            let (name, rest) = part.split_once(" -->").unwrap_or((part, ""));
            let after = rest.split_once(END).map(|(_, after)| after);
            let after = after.ok_or_else(|| Error::input(format!("no end of the rows {name:?}")))?;
            let _ = write!(text, "{BEGIN}{name} -->\n{}{END}{after}", self.table(name)?);
        }
        Ok(text)
    }

    fn table(&self, name: &str) -> Result<String> {
        match name {
            "engines" => self.engines(),
            "equal error" => self.equal_error(),
            "kinds" => self.kinds(),
            _ => Err(Error::input(format!("unknown rows {name:?}: must be engines, equal error or kinds"))),
        }
    }

    /// The table of the first page: engines at their defaults, least errors, and the errors in which another engine is
    /// better.
    fn engines(&self) -> Result<String> {
        let known = |engine: &str| {
            self.results.iter().flatten().any(|row| row.engine == engine)
                || self.thirds.iter().any(|row| row.engine == engine)
        };
        let engines: Vec<_> = ENGINES.into_iter().filter(|(engine, ..)| known(engine)).collect();
        let names = engines.iter().map(|(.., name)| *name).collect::<Vec<_>>();
        let names =
            names.split_last().map_or(String::new(), |(last, others)| format!("{} and {last}", others.join(", ")));
        let mut text = format!(
            "{names} step the same scenes on one\nthread, each at its defaults. The best figures are in bold. \
             Errors below {0} mm count as {0} mm.\nDropped structures start with gaps of 0.5 % of a body's height. They \
             treat all engines alike: drystone alone starts\nstructures that are built in place with the impulses of \
             their rest state.\n\n| |{1}\n|---|{2}\n",
            FLOOR * 1e3,
            engines.iter().map(|(_, column, _)| format!(" {column} |")).collect::<String>(),
            "--:|".repeat(engines.len())
        );
        let blank = "  |".repeat(engines.len());
        for (title, scenes) in [
            ("Dropped: time of a step, mean overlap", &DROPPED[..]),
            ("Built in place: time of a step, mean overlap", &BUILT),
        ] {
            let _ = writeln!(text, "| **{title}** |{blank}");
            for (what, scene) in scenes {
                let cells = engines.iter().map(|(engine, ..)| self.at_defaults(scene, engine)).collect::<Vec<_>>();
                self.row(&mut text, what, scene, cells);
            }
        }
        let _ = writeln!(text, "| **Least mean overlap at any setting tried** |{blank}");
        for (what, scene) in LEAST {
            let Some(rows) = self.scene(scene) else { continue };
            let cells = engines.iter().map(|(engine, ..)| least(rows, engine, faults(rows)[0])).collect();
            self.row(&mut text, what, scene, cells);
        }
        let mut lost = Vec::new();
        for rows in &self.results {
            for &fault in faults(rows) {
                let cells: Vec<_> = engines.iter().map(|(engine, ..)| least(rows, engine, fault)).collect();
                let printed = |cell: &Cell| cell.figures.first().map_or(f64::INFINITY, Figure::printed);
                let best = cells.iter().map(printed).fold(f64::INFINITY, f64::min);
                let own = printed(&cells[0]);
                if best < own {
                    lost.push((own / best, format!("least {}, `{}`", fault.name(), rows[0].scene), cells));
                }
            }
        }
        lost.sort_by(|a, b| b.0.total_cmp(&a.0));
        if !lost.is_empty() {
            let _ = writeln!(text, "| **Where drystone loses** |{blank}");
        }
        let count = lost.len();
        for (_, what, cells) in lost.into_iter().take(MAX_LOST) {
            let _ = writeln!(text, "| {what} |{}", bold(cells));
        }
        let (_, behind, pairs) = ahead(&self.results)?;
        let _ = writeln!(
            text,
            "\nThe report compares {pairs} pairs of a scene and an error measure. In {count} pairs another engine reaches a \
             smaller error. In {behind}\npairs some setting of another engine is faster than every setting of drystone with \
             an error no larger, or drystone does\nnot reach its error."
        );
        Ok(text)
    }

    fn scene(&self, name: &str) -> Option<&[Row]> {
        self.results.iter().find(|rows| rows[0].scene == name).map(Vec::as_slice)
    }

    /// Adds a row if the scene has rows.
    fn row(&self, text: &mut String, what: &str, scene: &str, cells: Vec<Cell>) {
        let bodies = self.scene(scene).map(|rows| rows[0].bodies);
        let bodies = bodies.or_else(|| self.thirds.iter().find(|row| row.scene == scene).map(|row| row.bodies));
        if let Some(bodies) = bodies {
            let _ = writeln!(text, "| {} |{}", what.replace("{}", &thousands(bodies)), bold(cells));
        }
    }

    /// Time of a step and mean overlap for an engine's first setting, its defaults.
    fn at_defaults(&self, scene: &str, engine: &str) -> Cell {
        let figures = |ms: f64, mean: f64| Cell::of([Figure::of(ms, "ms"), Figure::of(1e3 * mean.max(FLOOR), "mm")]);
        if let Some(rows) = self.scene(scene) {
            return match rows.iter().find(|row| row.engine == engine && row.backend != "gpu") {
                Some(row) if row.holds() => figures(row.ms, Fault::Mean.of(row)),
                Some(_) => Cell { word: "falls", ..Cell::default() },
                None => Cell::default(),
            };
        }
        let mut thirds = self.thirds.iter().filter(|row| row.scene == scene && row.engine == engine);
        let Some(first) = thirds.next() else { return Cell::default() };
        let end = thirds.rfind(|row| row.setting == first.setting).unwrap_or(first);
        figures(end.ms, end.penetration_mean)
    }

    /// Least errors, and times at equal error, scene by scene.
    fn equal_error(&self) -> Result<String> {
        let mut text = "| scene | error | least, drystone | least, others | relative time, smallest | largest |\n|---|---|--:|--:|--:|--:|\n"
            .to_owned();
        for rows in &self.results {
            for &fault in faults(rows) {
                let duel = self.duel(rows, fault)?;
                let error = |error: f64| Cell::of(error.is_finite().then(|| Figure::of(error * 1e3, fault.unit())));
                let ratio = |ratio: f64| match ratio.is_finite() {
                    true if format!("{ratio:.2}").parse().is_ok_and(|printed: f64| printed <= 1.0) => {
                        format!("**{ratio:.2}**")
                    }
                    true => format!("{ratio:.2}"),
                    false => "not reached".into(),
                };
                let [best, worst] = [duel.best, duel.worst]
                    .map(|time| if duel.others.is_finite() { ratio(time) } else { String::new() });
                let errors = bold(vec![error(duel.own), error(duel.others)]);
                let _ = writeln!(text, "| {} | {} |{errors} {best} | {worst} |", rows[0].scene, fault.name());
            }
        }
        Ok(text)
    }

    fn duel(&self, rows: &[Row], fault: Fault) -> Result<Duel> {
        let others: Vec<_> = rows.iter().filter(|row| !row.engine.starts_with(OWN)).collect();
        Duel::new(&of_side(rows, OWN), &others, fault)
    }

    /// The ranges of times at equal error for each kind of scene.
    fn kinds(&self) -> Result<String> {
        let kind = |row: &Row| match (row.joint_gap, row.in_place) {
            (Some(_), _) => "joints",
            (None, Some(_)) if row.scene.contains("gap=") => "structures that are dropped",
            (None, Some(_)) => "structures that are built in place",
            (None, None) => "piles",
        };
        let mut text = "| scenes | number | relative time, smallest | largest | pairs with an error that drystone does not reach |\n\
                        |---|--:|--:|--:|--:|\n"
            .to_owned();
        for name in ["structures that are dropped", "structures that are built in place", "joints", "piles"] {
            let of: Vec<_> = self.results.iter().filter(|rows| kind(&rows[0]) == name).collect();
            let (mut low, mut high, mut missed, mut pairs) = (f64::INFINITY, 0.0_f64, 0, 0);
            for rows in &of {
                for &fault in faults(rows) {
                    let duel = self.duel(rows, fault)?;
                    pairs += 1;
                    missed += usize::from(duel.worst.is_infinite());
                    low = low.min(duel.best);
                    high = if duel.worst.is_finite() { high.max(duel.worst) } else { high };
                }
            }
            if !of.is_empty() {
                let _ = writeln!(text, "| {name} | {} | {low:.2} | {high:.2} | {missed} of {pairs} |", of.len());
            }
        }
        Ok(text)
    }
}

/// The least error of an engine at any setting.
fn least(rows: &[Row], engine: &str, fault: Fault) -> Cell {
    let own: Vec<_> = rows.iter().filter(|row| row.engine == engine && row.backend != "gpu").collect();
    Cell::of(front(&own, fault).last().map(|row| Figure::of(fault.of(row) * 1e3, fault.unit())))
}

/// The figures of a cell. Without figures, `word` can give the reason.
#[derive(Clone, Debug, Default)]
struct Cell {
    figures: Vec<Figure>,
    word: &'static str,
}

impl Cell {
    fn of(figures: impl IntoIterator<Item = Figure>) -> Self {
        Self { figures: figures.into_iter().collect(), word: "" }
    }
}

/// A number in its printed form, and its unit.
#[derive(Clone, Debug)]
struct Figure {
    number: String,
    unit: &'static str,
}

impl Figure {
    fn of(value: f64, unit: &'static str) -> Self {
        Self { number: number(value), unit }
    }

    fn printed(&self) -> f64 {
        self.number.parse().unwrap_or(f64::INFINITY)
    }

    fn text(&self) -> String {
        format!("{} {}", self.number, self.unit)
    }
}

/// The cells of a table row. The least of all first figures is bold, the least of all second figures, and so on.
fn bold(cells: Vec<Cell>) -> String {
    let count = cells.iter().map(|cell| cell.figures.len()).max().unwrap_or(0);
    let column = |k: usize| cells.iter().filter_map(move |cell| cell.figures.get(k));
    let best: Vec<_> = (0..count).map(|k| column(k).map(Figure::printed).fold(f64::INFINITY, f64::min)).collect();
    let cell = |Cell { figures, word }: &Cell| {
        if figures.is_empty() {
            return format!(" {} |", if word.is_empty() { "-" } else { word });
        }
        let is_best: Vec<_> = figures.iter().zip(&best).map(|(figure, best)| figure.printed() <= *best).collect();
        if is_best.iter().all(|&best| best) {
            return format!(" **{}** |", figures.iter().map(Figure::text).collect::<Vec<_>>().join(", "));
        }
        let marked = figures.iter().zip(is_best).map(|(figure, best)| {
            let mark = if best { "**" } else { "" };
            format!("{mark}{}{mark}", figure.text())
        });
        format!(" {} |", marked.collect::<Vec<_>>().join(", "))
    };
    cells.iter().map(cell).collect()
}

fn thousands(n: usize) -> String {
    let digits = n.to_string();
    let groups = digits.as_bytes().rchunks(3).rev().map(|group| String::from_utf8_lossy(group).into_owned());
    groups.collect::<Vec<_>>().join(",")
}

#[cfg(test)]
mod tests {
    use super::super::tests::row;
    use super::super::{Extent, scenes};
    use super::*;

    /// Without this test, a typing error in the name of a scene would silently remove its row.
    #[test]
    fn the_scenes_of_the_table_are_those_that_are_measured() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("a workspace");
        let script = std::fs::read_to_string(root.join("benches/performance")).expect("a script");
        let surveyed: Vec<_> = scenes(Extent::Brief).expect("scenes").into_iter().map(|scene| scene.name).collect();
        for (_, scene) in DROPPED.iter().chain(&BUILT) {
            let timed = script.split([' ', '"']).any(|word| word == *scene);
            assert!(timed || surveyed.iter().any(|known| known == scene), "{scene} is not measured");
        }
        assert!(LEAST.iter().all(|(_, scene)| surveyed.iter().any(|known| known == scene)));
    }

    #[test]
    fn the_best_figures_as_printed_are_bold() {
        let cell = |ms, mm| Cell::of([Figure::of(ms, "ms"), Figure::of(mm, "mm")]);
        let falls = Cell { word: "falls", ..Cell::default() };
        let text = bold(vec![cell(1.2341, 3.0), cell(1.2339, 2.0), Cell::default(), falls, cell(9.0, 2.0)]);
        assert_eq!(text, " **1.23 ms**, 3.00 mm | **1.23 ms, 2.00 mm** | - | falls | 9.00 ms, **2.00 mm** |");
        assert_eq!([7, 1000, 20_000, 1_234_567].map(thousands), ["7", "1,000", "20,000", "1,234,567"]);
    }

    #[test]
    fn a_page_gets_its_tables_and_keeps_the_rest() {
        let own = vec![row(OWN, 1.0, 2e-3), row(OWN, 9.0, 1e-5), row("rapier", 0.5, 1e-3)];
        let named = own.into_iter().map(|row| Row { scene: "wall".into(), bodies: 410, in_place: Some(410), ..row });
        let rows = Rows { results: vec![named.collect()], thirds: Vec::new() };
        let page = "before\n<!-- rows: engines -->\nold\n<!-- end of rows -->\nafter\n";
        let text = rows.rewritten(page).expect("a page");
        assert!(text.starts_with("before\n<!-- rows: engines -->\ndrystone and [Rapier]"), "{text}");
        assert!(text.ends_with("its error.\n<!-- end of rows -->\nafter\n"), "{text}");
        assert!(text.contains("| wall of 410 bricks | 1.00 ms, 2.00 mm | **0.500 ms, 1.00 mm** |\n"), "{text}");
        assert_eq!(rows.rewritten(&text).expect("a page"), text);
        for (page, message) in
            [("<!-- rows: engine -->\n<!-- end of rows -->", "unknown rows"), ("<!-- rows: engines -->", "no end")]
        {
            assert!(rows.rewritten(page).expect_err(page).to_string().contains(message));
        }
    }
}
