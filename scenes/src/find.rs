//! Finds a scene by the name of a catalogue entry or of a file, and builds many worlds of it.

use std::path::Path;

use super::catalogue::{CATALOGUE, MAX_BODIES};
#[cfg(feature = "serde")]
use super::file::load;
use super::scene::{Group, Scene};
use super::spawner::{Leaves, Spawner};
use drystone::stages::error::{ensure, input};
use drystone::stages::memory;
use drystone::stages::suggest::hint;
use drystone::{BodyHandle, Result};

impl Scene {
    /// Finds a scene by its catalogue name, else reads the file of that name, which needs the feature `serde`.
    /// `parameters` are `key=value`.
    ///
    /// ```
    /// let scene = drystone_scenes::Scene::find("tower", &["n=3".into()])?;
    /// assert_eq!(scene.world.dynamic_count(), 3);
    /// let unknown = drystone_scenes::Scene::find("towr", &[]).expect_err("a slip");
    /// assert!(unknown.to_string().contains("tower"), "{unknown}");
    /// # Ok::<(), drystone::Error>(())
    /// ```
    ///
    /// # Errors
    /// There is neither a scene nor a readable scene file of that name, or a parameter is unknown or has an impossible
    /// value.
    pub fn find(name_or_path: &str, parameters: &[String]) -> Result<Self> {
        match CATALOGUE.iter().find(|e| e.name == name_or_path) {
            Some(entry) => entry.build(parameters),
            None => load_or_suggest(name_or_path, parameters),
        }
    }

    /// `count` worlds of a scene in one world; bodies of different worlds never meet: see
    /// [`World::beside`](drystone::World::beside). All worlds are equal. With `vary`, that parameter is one larger in
    /// each world than in the one before.
    ///
    /// ```
    /// let towers = drystone_scenes::Scene::find_worlds("tower", &["n=4".into()], 3, Some("n"))?;
    /// let bodies: Vec<_> = towers.world.worlds().iter().map(Vec::len).collect();
    /// assert_eq!(bodies, [5, 6, 7]);
    /// # Ok::<(), drystone::Error>(())
    /// ```
    ///
    /// # Errors
    /// Those of [`Scene::find`]; there is no world, or more than four million worlds or dynamic bodies; or `vary` names
    /// no parameter that is a whole number.
    pub fn find_worlds(name_or_path: &str, parameters: &[String], count: usize, vary: Option<&str>) -> Result<Self> {
        let mut all = Self::find(name_or_path, parameters)?;
        let each = all.world.dynamic_count();
        // A world without dynamic bodies also takes memory and time.
        ensure(count > 0 && each.max(1).saturating_mul(count) <= MAX_BODIES as usize, || {
            format!(
                "{count} worlds of {each} dynamic bodies: must be at least one world, at most {MAX_BODIES} worlds, and at most {MAX_BODIES} such bodies in all"
            )
        })?;
        let vary = vary.map(|key| Ok((key, whole(name_or_path, parameters, key)?))).transpose()?;
        if count == 1 {
            return Ok(all);
        }
        let bodies = all.world.bodies.len();
        let what = format_args!("{name_or_path}: {count} worlds of {bodies} bodies");
        memory::check((bodies * count) as f64 * memory::BODY, what)?;
        let first = all.clone();
        let mut dynamic = each;
        for k in 1..count {
            let Some((key, begin)) = vary else {
                all.beside(&first);
                continue;
            };
            let varied = [parameters, &[format!("{key}={}", begin + k as f64)]].concat();
            let next = Self::find(name_or_path, &varied)?;
            dynamic += next.world.dynamic_count();
            ensure(dynamic <= MAX_BODIES as usize, || {
                let worlds = k + 1;
                format!("{worlds} of {count} worlds have {dynamic} dynamic bodies: must be at most {MAX_BODIES} in all")
            })?;
            all.beside(&next);
        }
        Ok(all)
    }

    /// Finds a scene by one word, `name:key=value,...`: its parameters, the number of `worlds`, and the parameter to
    /// `vary`, as in [`Scene::find_worlds`].
    ///
    /// ```
    /// let towers = drystone_scenes::Scene::find_spec("tower:n=4,worlds=3,vary=n")?;
    /// assert_eq!(towers.world.dynamic_count(), 4 + 5 + 6);
    /// # Ok::<(), drystone::Error>(())
    /// ```
    ///
    /// # Errors
    /// Those of [`Scene::find_worlds`]; or `worlds` is not a number.
    pub fn find_spec(spec: &str) -> Result<Self> {
        let (name, parameters) = spec.split_once(':').unwrap_or((spec, ""));
        let (mut count, mut vary, mut own) = (1, None, Vec::new());
        for assignment in parameters.split(',').filter(|a| !a.is_empty()) {
            match assignment.split_once('=') {
                Some(("worlds", number)) => {
                    let refusal = |_| input!("{spec}: worlds = {number:?}: must be a whole number");
                    count = number.parse().map_err(refusal)?;
                }
                Some(("vary", key)) => vary = Some(key),
                _ => own.push(assignment.to_owned()),
            }
        }
        Self::find_worlds(name, &own, count, vary)
    }

    /// Appends the world of another scene. The container, and the expectation to stand, remain only if both scenes have
    /// them.
    fn beside(&mut self, other: &Self) {
        let (first, worlds) = (self.world.bodies.len(), self.world.world_count());
        let spawner = |s: &Spawner| Spawner { world: worlds + s.world, ..s.clone() };
        self.spawners.extend(other.spawners.iter().map(spawner));
        self.world.beside(&other.world);
        let appended = |body: &BodyHandle| self.world.bodies.handle(first + body.index());
        let leaving = |(body, leaves): &(BodyHandle, Leaves)| Some((appended(body)?, *leaves));
        self.leaving.extend(other.leaving.iter().filter_map(leaving));
        let moved = |g: &Group| Group { name: g.name.clone(), bodies: g.bodies.iter().filter_map(appended).collect() };
        self.groups.extend(other.groups.iter().map(moved));
        self.container = self.container.filter(|c| other.container == Some(*c));
        self.stands &= other.stands;
    }
}

/// Reads a scene file. If the name is unknown, the error suggests a scene.
fn load_or_suggest(name_or_path: &str, parameters: &[String]) -> Result<Scene> {
    let path = Path::new(name_or_path);
    if !path.is_file() && path.extension().is_none_or(|e| e != "json") {
        let hint = hint(name_or_path, CATALOGUE.iter().map(|e| e.name), "`drystone scenes` lists the scenes");
        return Err(input!("{name_or_path:?} is neither a scene nor a scene file{hint}"));
    }
    match parameters.first() {
        Some(p) => Err(input!("{name_or_path}: a scene file takes no parameter, such as {p:?}")),
        None => load(path),
    }
}

#[cfg(not(feature = "serde"))]
fn load(path: &Path) -> Result<Scene> {
    Err(input!("{}: cannot read a scene file: drystone was built without the feature serde", path.display()))
}

/// The value of a parameter that is a whole number.
fn whole(scene: &str, parameters: &[String], key: &str) -> Result<f64> {
    let refusal = |known: &[&str], list: &str| {
        let hint = hint(key, known.iter().copied(), format_args!("it has: {list}"));
        input!("{scene} has no whole-number parameter {key:?} to vary{hint}")
    };
    let entry = CATALOGUE.iter().find(|e| e.name == scene).ok_or_else(|| refusal(&[], "none, being a file"))?;
    let known: Vec<_> = entry.parameters.iter().filter(|p| p.whole).map(|p| p.name).collect();
    let place = entry.parameters.iter().position(|p| p.whole && p.name == key);
    Ok(entry.values(parameters)?[place.ok_or_else(|| refusal(&known, &known.join(", ")))?])
}
