//! Scene files: JSON, version 1.

mod check;
mod joint;
mod numbers;
mod schema;
mod write;

pub use schema::{
    AdditionalMassFile, AxisFile, BodyFile, BodyRef, DriverFile, Geometry, JointFile, JointKind, LeavesFile, MassFile,
    MaterialFile, MotorFile, SceneFile, ShapeFile, SpawnerFile, SpringFile,
};

use std::path::Path;

use serde_json::Value;
use serde_path_to_error::Segment;

use super::scene::Scene;
use drystone::stages::suggest::shorten;
use drystone::{Error, Result};

impl SceneFile {
    /// Reads the text of a scene file.
    ///
    /// # Errors
    /// The text is not JSON, has another version, has an unknown or missing key, or a value has the wrong type. One
    /// line names the place.
    pub fn parse(text: &str) -> Result<Self> {
        let mut json = serde_json::Deserializer::from_str(text);
        let parsed = serde_path_to_error::deserialize(&mut json).map_err(|e| explain(text, &e));
        parsed.and_then(|file| json.end().map(|()| file).map_err(Error::input))
    }

    /// Checks every value and builds the scene. Its name is `name` if the file has none.
    ///
    /// # Errors
    /// No scene can be built from a value. One line names the body, the value and the valid range.
    pub fn into_scene(self, name: &str) -> Result<Scene> {
        check::scene(self, name)
    }

    /// Converts a scene to a file, with every number to the last bit, for bodies at rest or in motion. The file does
    /// not contain [`Scene::stands`], [`Scene::groups`], the forces of the next step alone, or the impulses of
    /// contacts.
    ///
    /// ```
    /// use drystone_scenes::{Scene, SceneFile};
    /// let scene = Scene::find("tower", &[])?;
    /// let text = SceneFile::of(&scene)?.to_text();
    /// let again = SceneFile::parse(&text)?.into_scene("tower")?;
    /// assert_eq!(again.world.bodies[3].position, scene.world.bodies[3].position);
    /// # Ok::<(), drystone::Error>(())
    /// ```
    ///
    /// # Errors
    /// There are several worlds, or a body has numbers that are not finite or that a scene file cannot represent. One
    /// line names the body.
    pub fn of(scene: &Scene) -> Result<Self> {
        let file = write::file(scene)?;
        file.clone().into_scene(&scene.name).map(|_| file)
    }

    /// The text of the file, as JSON.
    pub fn to_text(&self) -> String {
        let mut text = serde_json::to_string(self).unwrap_or_default();
        // One body on each line.
        for list in ["\"bodies\":[", "\"joints\":[", "\"spawners\":["] {
            text = text.replacen(list, &format!("\n{list}\n"), 1);
        }
        text.replace("},{\"name\":", "},\n{\"name\":") + "\n"
    }
}

/// Reads the scene file `path`.
///
/// ```
/// let path = std::env::temp_dir().join(format!("drystone-{}.json", std::process::id()));
/// let text = r#"{"version": 1, "bodies": [{"shapes": [{"type": "ball", "radius": 0.5}]}]}"#;
/// std::fs::write(&path, text).map_err(drystone::Error::file(&path))?;
/// assert_eq!(drystone_scenes::load(&path)?.world.dynamic_count(), 1);
/// # std::fs::remove_file(&path).map_err(drystone::Error::file(&path))?;
/// # Ok::<(), drystone::Error>(())
/// ```
///
/// # Errors
/// The file cannot be read, or no scene can be built from it. One line names the file and the place.
pub fn load(path: &Path) -> Result<Scene> {
    let text = std::fs::read_to_string(path).map_err(Error::file(path))?;
    let name = path.file_stem().unwrap_or_default().to_string_lossy();
    SceneFile::parse(&text).and_then(|file| file.into_scene(&name)).map_err(|e| e.within(path.display()))
}

/// The JSON Schema of scene files.
///
/// ```
/// assert_eq!(drystone_scenes::schema()["title"], "Scene");
/// ```
pub fn schema() -> Value {
    schemars::schema_for!(SceneFile).to_value()
}

/// Formats an error of serde as one line: the place, the name of the body, and the message.
fn explain(text: &str, error: &serde_path_to_error::Error<serde_json::Error>) -> Error {
    // Parse the text again only after an error. Malformed text gives no more information.
    let value: Value = serde_json::from_str(text).unwrap_or_default();
    if let Some(version) = value.get("version").filter(|&v| *v != 1) {
        return check::unknown_version(version);
    }
    let message = error.inner().to_string();
    let message = shorten(&message, "`drystone scenes --schema` lists all");
    let mut segments = error.path().iter();
    let place = match (segments.next(), segments.next()) {
        (Some(Segment::Map { key }), Some(&Segment::Seq { index })) if key == "bodies" => {
            let body = check::body_label(index, value["bodies"][index]["name"].as_str());
            let path = error.path().to_string();
            match path.split_once("].") {
                Some((_, rest)) => format!("{body}: {rest}"),
                None => body,
            }
        }
        (None | Some(Segment::Unknown), _) => return Error::input(message),
        _ => error.path().to_string(),
    };
    Error::input(message).within(place)
}
