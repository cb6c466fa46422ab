//! Scenes and settings.

use std::path::PathBuf;
use std::sync::Arc;

use drystone::SolverConfig;
use drystone::batch::drives;
use drystone::preset::Preset;
use drystone_scenes::{CATALOGUE, SceneFile};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::raised;

/// An immutable scene.
#[pyclass(frozen, module = "drystone._drystone")]
pub struct Scene(pub Arc<drystone_scenes::Scene>);

#[pymethods]
impl Scene {
    #[staticmethod]
    fn find(name: &str, parameters: Vec<String>) -> PyResult<Self> {
        if !CATALOGUE.iter().any(|entry| entry.name == name) && name.ends_with(".json") {
            return Err(PyValueError::new_err(format!("name = {name:?}: a file is read by Scene.load")));
        }
        drystone_scenes::Scene::find(name, &parameters).map(|scene| Self(scene.into())).map_err(raised)
    }

    #[staticmethod]
    fn load(path: PathBuf) -> PyResult<Self> {
        drystone_scenes::load(&path).map(|scene| Self(scene.into())).map_err(raised)
    }

    #[staticmethod]
    fn from_text(text: &str, name: &str) -> PyResult<Self> {
        let scene = SceneFile::parse(text).and_then(|file| file.into_scene(name));
        scene.map(|scene| Self(scene.into())).map_err(raised)
    }

    fn to_text(&self) -> PyResult<String> {
        SceneFile::of(&self.0).map(|file| file.to_text()).map_err(raised)
    }

    #[getter]
    fn name(&self) -> &str {
        &self.0.name
    }

    #[getter]
    fn dt(&self) -> f32 {
        self.0.dt
    }

    #[getter]
    fn bodies(&self) -> Vec<String> {
        self.0.world.bodies.iter().map(|body| body.name.clone()).collect()
    }

    #[getter]
    fn joints(&self) -> Vec<String> {
        let name = |body: usize| self.0.world.bodies[body].name.clone();
        let joint = |joint: &drystone::Joint| {
            let b = joint.body_b.map_or_else(|| "world".to_owned(), |b| name(b.index()));
            format!("{} - {b}", name(joint.body_a.index()))
        };
        self.0.world.joints.iter().map(joint).collect()
    }

    #[getter]
    fn actuators(&self) -> Vec<String> {
        drives(&self.0.world).map(|drive| drive.name).collect()
    }
}

/// Immutable settings of the solver.
#[pyclass(frozen, module = "drystone._drystone")]
pub struct Config(pub SolverConfig);

#[pymethods]
impl Config {
    #[staticmethod]
    fn preset(name: &str) -> PyResult<Self> {
        let preset: Preset = name.parse().map_err(|error: drystone::Error| raised(error.within("preset")))?;
        Ok(Self(preset.config()))
    }

    #[staticmethod]
    fn from_text(text: &str) -> PyResult<Self> {
        let config: SolverConfig = serde_json::from_str(text).map_err(|e| {
            let line = e.to_string();
            // Remove the place in the text: the caller never saw the text.
            PyValueError::new_err(line.split(" at line ").next().unwrap_or_default().to_owned())
        })?;
        config.check().map_err(raised)?;
        Ok(Self(config))
    }

    fn to_text(&self) -> PyResult<String> {
        serde_json::to_string(&self.0).map_err(|e| PyValueError::new_err(e.to_string()))
    }
}

/// Name, default, smallest and largest value, whether whole, summary.
type ParameterRow = (&'static str, f64, f64, f64, bool, &'static str);

/// Name, summary and parameters of every scene.
#[pyfunction]
pub fn catalogue() -> Vec<(&'static str, &'static str, Vec<ParameterRow>)> {
    let entry = |entry: &'static drystone_scenes::Entry| {
        let parameters =
            entry.parameters.iter().map(|p| (p.name, p.default, p.range.0, p.range.1, p.whole, p.summary)).collect();
        (entry.name, entry.summary, parameters)
    };
    CATALOGUE.iter().map(entry).collect()
}

/// The JSON Schema of scene files.
#[pyfunction]
pub fn schema() -> String {
    drystone_scenes::schema().to_string()
}
