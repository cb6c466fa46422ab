//! An entry of the catalogue: a name, a summary of the expected outcome, and parameters.

use crate::scene::Scene;
use drystone::Result;
use drystone::stages::error::input;
use drystone::stages::memory;
use drystone::stages::suggest::hint;

/// Largest number of dynamic bodies in a scene of the catalogue.
pub const MAX_BODIES: f64 = 4e6;

/// A number that shapes a scene of the catalogue.
///
/// ```
/// use drystone_scenes::{CATALOGUE, Parameter};
///
/// let parameters: Vec<&Parameter> = CATALOGUE.iter().flat_map(|entry| entry.parameters).collect();
/// assert!(parameters.iter().all(|p| (p.range.0..=p.range.1).contains(&p.default)));
/// ```
#[derive(Clone, Debug)]
pub struct Parameter {
    /// Name, as in `name=value`.
    pub name: &'static str,
    /// Default value.
    pub default: f64,
    /// Smallest and largest value.
    pub range: (f64, f64),
    /// Whether it must be a whole number.
    pub whole: bool,
    /// Words that stand for the whole numbers from 0; empty for a plain number.
    pub words: &'static [&'static str],
    /// One line: meaning and unit.
    pub summary: &'static str,
}

impl Parameter {
    pub(super) const fn whole(name: &'static str, default: u32, range: (f64, f64), summary: &'static str) -> Self {
        Self { name, default: default as f64, range, whole: true, words: &[], summary }
    }

    /// One of several words, the first by default.
    pub(super) const fn word(name: &'static str, words: &'static [&'static str], summary: &'static str) -> Self {
        Self { name, default: 0.0, range: (0.0, (words.len() - 1) as f64), whole: true, words, summary }
    }

    pub(super) const fn real(name: &'static str, default: f64, range: (f64, f64), summary: &'static str) -> Self {
        Self { name, default, range, whole: false, words: &[], summary }
    }

    /// The value as text: its word, if it has one, else the number.
    ///
    /// ```
    /// let family = drystone_scenes::CATALOGUE.iter().find(|entry| entry.name == "family").expect("it is there");
    /// let [kind, seed] = &family.parameters else { panic!("two parameters") };
    /// assert_eq!((kind.text(kind.default), seed.text(7.0)), ("stacks".to_owned(), "7".to_owned()));
    /// ```
    pub fn text(&self, value: f64) -> String {
        self.words.get(value as usize).map_or_else(|| value.to_string(), |&word| word.to_owned())
    }

    fn parse(&self, text: &str) -> Result<f64> {
        if let Some(index) = self.words.iter().position(|&word| word == text) {
            return Ok(index as f64);
        }
        let (least, most) = self.range;
        let fits = |x: &f64| (least..=most).contains(x) && (!self.whole || x.fract() == 0.0);
        text.parse().ok().filter(fits).ok_or_else(|| {
            if !self.words.is_empty() {
                let hint = hint(text, self.words.iter().copied(), format_args!("known: {}", self.words.join(", ")));
                return input!("{} = {text:?}: unknown{hint}", self.name);
            }
            let kind = if self.whole { "whole number" } else { "number" };
            input!("{} = {text:?}: must be a {kind} from {least} to {most}", self.name)
        })
    }
}

/// A scene of the catalogue.
///
/// ```
/// use drystone_scenes::{CATALOGUE, Entry, Parameter};
///
/// let tower: &Entry = CATALOGUE.iter().find(|entry| entry.name == "tower").expect("it is there");
/// let Parameter { name, default, whole, .. } = &tower.parameters[0];
/// assert_eq!((*name, *default, *whole), ("n", 10.0, true));
/// assert_eq!(tower.body_count(&["n=7".into()])?, 7);
/// # Ok::<(), drystone::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct Entry {
    /// Name, for [`Scene::find`].
    pub name: &'static str,
    /// One line: a description and the expected outcome.
    pub summary: &'static str,
    /// Its parameters.
    pub parameters: &'static [Parameter],
    /// Number of dynamic bodies, as a function of the parameter values.
    pub(super) bodies: fn(&[f64]) -> f64,
    /// Builds the scene from the parameter values.
    pub(super) build: fn(&[f64]) -> Result<Scene>,
}

impl Entry {
    /// Builds the scene. `assignments` are `key=value`. If a key occurs twice, the last value wins.
    ///
    /// ```
    /// # let pile = drystone_scenes::CATALOGUE.iter().find(|e| e.name == "pile").unwrap();
    /// let scene = pile.build(&["n=64".into()])?;
    /// assert_eq!(scene.world.dynamic_count(), 64);
    /// # Ok::<(), drystone::Error>(())
    /// ```
    ///
    /// # Errors
    /// An assignment has no `=`, an unknown key, or a value out of range.
    pub fn build(&self, assignments: &[String]) -> Result<Scene> {
        let build = |values: Vec<f64>| {
            let bodies = (self.bodies)(&values);
            memory::check(bodies * memory::BODY, format_args!("{}: {bodies} bodies", self.name))?;
            (self.build)(&values)
        };
        self.values(assignments).and_then(build).map_err(|e| e.within(self.name))
    }

    /// Number of dynamic bodies in the scene that [`Entry::build`] makes.
    ///
    /// # Errors
    /// Those of [`Entry::build`], except for values that contradict each other.
    pub fn body_count(&self, assignments: &[String]) -> Result<u64> {
        let values = self.values(assignments).map_err(|e| e.within(self.name))?;
        Ok((self.bodies)(&values) as u64)
    }

    /// One value for each parameter, in order.
    pub(crate) fn values(&self, assignments: &[String]) -> Result<Vec<f64>> {
        let mut values: Vec<f64> = self.parameters.iter().map(|p| p.default).collect();
        for assignment in assignments {
            let (key, value) =
                assignment.split_once('=').ok_or_else(|| input!("{assignment:?}: write it as key=value"))?;
            let index = self.parameters.iter().position(|p| p.name == key.trim()).ok_or_else(|| {
                let known: Vec<_> = self.parameters.iter().map(|p| p.name).collect();
                let hint = hint(key, known.iter().copied(), format_args!("known: {}", known.join(", ")));
                input!("unknown parameter {key:?}{hint}")
            })?;
            values[index] = self.parameters[index].parse(value.trim())?;
        }
        Ok(values)
    }
}

#[cfg(test)]
mod tests {
    use super::super::CATALOGUE;
    use super::*;
    use drystone::BodyKind;

    /// Whether a scene has, or spawns, a body that can move.
    fn moves(scene: &Scene) -> bool {
        scene.world.dynamic_count() > 0 || !scene.spawners.is_empty()
    }

    fn build(name: &str, assignments: &[&str]) -> Result<Scene> {
        let assignments: Vec<String> = assignments.iter().map(|&a| a.to_owned()).collect();
        CATALOGUE.iter().find(|e| e.name == name).expect("a scene of that name").build(&assignments)
    }

    fn refusal(name: &str, assignment: &str) -> String {
        let message = build(name, &[assignment]).expect_err(assignment).to_string();
        assert!(!message.contains('\n'), "{message}");
        message
    }

    #[test]
    fn every_scene_builds_with_its_defaults_and_every_mass_is_positive() {
        for entry in CATALOGUE {
            let scene = entry.build(&[]).expect(entry.name);
            assert_eq!(scene.name, entry.name);
            assert!(moves(&scene) && scene.world.first_non_finite().is_none());
            assert_eq!(scene.escaped(&scene.world), 0);
            for body in &scene.world.bodies {
                let usable = body.mass.mass > 0.0 && body.mass.principal_inertia.min_element() > 0.0;
                assert_eq!(usable, body.kind == BodyKind::Dynamic, "{}: {body:?}", entry.name);
            }
        }
    }

    #[test]
    fn at_the_ends_of_its_ranges_a_scene_builds_or_is_refused() {
        for entry in CATALOGUE {
            for p in entry.parameters {
                // The largest number of bodies would take a while.
                let ends = if p.whole { vec![p.range.0] } else { vec![p.range.0, p.range.1] };
                for end in ends {
                    match entry.build(&[format!("{}={end}", p.name)]) {
                        Ok(scene) => {
                            assert!(moves(&scene) && scene.world.first_non_finite().is_none())
                        }
                        Err(e) => assert!(e.to_string().contains("must be at most"), "{e}"),
                    }
                }
            }
        }
    }

    #[test]
    fn summaries_are_one_line_and_defaults_fit_their_ranges() {
        for entry in CATALOGUE {
            assert!(!entry.summary.contains('\n') && entry.summary.len() < 120);
            for p in entry.parameters {
                assert_eq!(p.parse(&p.default.to_string()).expect(p.name), p.default);
            }
        }
    }

    #[test]
    fn an_unknown_parameter_lists_the_known_ones() {
        assert_eq!(refusal("pile", "count=3"), "pile: unknown parameter \"count\"; known: n, jitter, seed, ratio");
        assert_eq!(refusal("drop", "n=3"), "drop: unknown parameter \"n\"; known: height");
        let meant = "pile: unknown parameter \"sede\"; did you mean \"seed\"? known: n, jitter, seed, ratio";
        assert_eq!(refusal("pile", "sede=3"), meant);
    }

    #[test]
    fn an_impossible_value_is_refused_by_name_and_range() {
        assert_eq!(refusal("pile", "n=4000001"), "pile: n = \"4000001\": must be a whole number from 1 to 4000000");
        assert_eq!(refusal("tower", "n=2.5"), "tower: n = \"2.5\": must be a whole number from 1 to 10000");
        for bad in ["offset=nan", "offset=inf", "offset=-0.1", "offset=", "offset=1e400", "n=0", "top_ratio=0", "n"] {
            refusal("tower", bad);
        }
        assert_eq!(refusal("wall", "rows"), "wall: \"rows\": write it as key=value");
        let unknown = refusal("family", "kind=stcks");
        assert!(
            unknown.starts_with("family: kind = \"stcks\": unknown; did you mean \"stacks\"? known: stacks, "),
            "{unknown}"
        );
        refusal("family", "kind=10");
        refusal("pyramid", "base=2801");
        refusal("wall", "columns=1901");
    }

    #[test]
    fn no_range_allows_more_than_four_million_bodies() {
        for entry in CATALOGUE {
            // The smallest step gives the largest number of towers.
            let most = |p: &Parameter| if p.name == "step" { p.range.0 } else { p.range.1 };
            let most: Vec<f64> = entry.parameters.iter().map(most).collect();
            // A scene can start without moving bodies, and spawn them later.
            let least = if entry.name == "galton" { 0.0 } else { 1.0 };
            assert!((least..=MAX_BODIES).contains(&(entry.bodies)(&most)), "{}", entry.name);
        }
    }

    #[test]
    fn the_number_of_bodies_is_known_before_they_are_built() {
        for entry in CATALOGUE {
            let other = |p: &Parameter| match (p.whole, p.name) {
                (true, "step") => "step=7".to_owned(),
                (true, name) => format!("{name}={}", (p.default * 1.5).floor()),
                (false, name) => format!("{name}={}", p.default),
            };
            for assignments in [Vec::new(), entry.parameters.iter().map(other).collect()] {
                let scene = entry.build(&assignments).expect(entry.name);
                let bodies = entry.body_count(&assignments).expect(entry.name);
                assert_eq!(bodies, scene.world.dynamic_count() as u64, "{} {assignments:?}", entry.name);
            }
        }
    }

    #[test]
    fn parameters_that_contradict_each_other_are_refused() {
        assert_eq!(refusal("tallest", "step=31"), "tallest: step = 31: must be at most n = 30");
        assert_eq!(refusal("bridge", "boxes=21"), "bridge: boxes = 21: must be at most planks = 20");
    }

    #[test]
    fn a_word_and_the_number_that_it_stands_for_give_the_same_scene() {
        let mu = |kind: &str| build("family", &[kind]).expect("a scene").world.bodies[0].material.friction;
        assert_eq!(mu("kind=slopes"), mu("kind=7"));
        assert_ne!(mu("kind=slopes"), mu("kind=arches"));
    }

    #[test]
    fn parameters_reach_the_scene() {
        assert_eq!(build("pyramid", &["base=4"]).expect("a pyramid").world.dynamic_count(), 10);
        assert_eq!(build("wall", &["rows=2", "columns=3"]).expect("a wall").world.dynamic_count(), 7);
        let tower = build("tower", &["n=3", "offset = 0.25", "top_ratio=10"]).expect("a tower").world.bodies;
        assert_eq!(tower.iter().map(|b| b.position.x).collect::<Vec<_>>(), [0.0, 0.25, -0.25, 0.25]);
        assert_eq!(tower.iter().map(|b| b.mass.mass).collect::<Vec<_>>(), [0.0, 1000.0, 1000.0, 10_000.0]);
    }
}
