//! A scene or a recording that runs in the page.

use drystone::backend::BackendChoice;
use drystone::metrics::rms_speed;
use drystone::{Cpu, Error, Result};
use drystone_conform::compare::BodyDifference;
use drystone_scenes::{Recorder, RecordingIntervals, Replay, SceneFile};
use drystone_view::{Camera, ColorBy, Live, Overlay, Pointer, Show as _};
use glam::{Vec2, Vec3};
use serde_json::{Map, Value, json};
use wasm_bindgen::prelude::*;

use crate::choice;
use crate::{next_number, thrown};

/// Steps from one whole state of a recording to the next, and size at which a recording ends (bytes).
const STATE_EVERY: u32 = 1200;
const LONGEST: usize = 128 << 20;

/// A scene or a recording that runs.
#[wasm_bindgen]
pub struct Show {
    pub(crate) live: Live,
    pub(crate) camera: Camera,
    #[cfg_attr(not(target_family = "wasm"), expect(dead_code, reason = "only browsers draw"))]
    pub(crate) number: u32,
    /// The recorder of the run, or `None` for a replay and for a run that became too long.
    recorder: Option<Recorder<Vec<u8>>>,
    /// The message of the switch to another backend, if a device was lost.
    fault: Option<String>,
}

impl Show {
    fn new(mut live: Live) -> Result<Self> {
        let camera = live.camera(1.0);
        let recorder = match live.is_recording() {
            true => None,
            false => {
                let intervals = RecordingIntervals { state: STATE_EVERY, ..RecordingIntervals::default() };
                Some(Recorder::new(Vec::new(), &live.title(), &mut live.simulation, intervals)?)
            }
        };
        Ok(Self { live, camera, number: next_number(), recorder, fault: None })
    }

    fn of_scene(name: &str, parameters: &[String], settings: &str) -> Result<Self> {
        let (config, scene) = (choice::config(settings)?, choice::scene(name, parameters)?);
        Self::new(Live::with(scene, config, Box::new(Cpu::new()), ColorBy::default())?)
    }

    fn of_file(name: &str, bytes: &[u8], settings: &str) -> Result<Self> {
        if Replay::is_recording(bytes) {
            let replay = Replay::read(bytes).map_err(|e| e.within(name))?;
            return Self::new(Live::of_recording(replay, BackendChoice::Cpu, false, ColorBy::default())?);
        }
        let unfit = |_| Error::input(format!("{name}: neither a scene file nor a recording"));
        let text = std::str::from_utf8(bytes).map_err(unfit)?;
        let stem = name.rsplit_once('.').map_or(name, |(stem, _)| stem);
        let scene = SceneFile::parse(text).and_then(|file| file.into_scene(stem)).map_err(|e| e.within(name))?;
        choice::check_size(name, scene.world.dynamic_count() as u64)?;
        Self::new(Live::with(scene, choice::config(settings)?, Box::new(Cpu::new()), ColorBy::default())?)
    }

    async fn make_step(&mut self) -> Result<()> {
        let before = self.live.followed();
        match &mut self.recorder {
            Some(recorder) => {
                let dt = self.live.scene().dt;
                self.live.before_step()?;
                let stats = recorder.step_async(&mut self.live.simulation, dt).await?;
                self.live.after_step(stats);
            }
            None => self.live.step_async().await?,
        }
        // A view that the user turned goes along with the driven body too.
        if let (Some(before), Some(after)) = (before, self.live.followed()) {
            self.camera.target += after - before;
        }
        self.recorder.take_if(|recorder| recorder.so_far().len() > LONGEST);
        if let Some(fault) = &self.live.stats.fault {
            self.fault = Some(fault.clone());
        }
        Ok(())
    }

    fn pointer(&self, x: f32, y: f32, aspect: f32) -> Pointer {
        Pointer::through(&self.camera, Vec2::new(x, y), aspect)
    }

    fn count(&mut self) -> Value {
        let depth = self.live.simulation.solved_penetration();
        // The statistics of the step do not contain the manifolds of sleeping bodies.
        let (manifolds, points) =
            self.live.simulation.manifolds().fold((0, 0), |(all, points), m| (all + 1, points + m.points().len()));
        let Live { simulation, stats, stage_ms, steps, .. } = &self.live;
        let Camera { target, distance, yaw, pitch, .. } = self.camera;
        let driven = self.live.driven().map(|body| {
            let ahead = body.rotation * Vec3::X;
            json!({"at": body.position.to_array(), "ahead": ahead.to_array()})
        });
        let stages: Map<String, Value> = stats
            .times
            .stages()
            .iter()
            .zip(stage_ms)
            .map(|((stage, _), ms)| ((*stage).to_owned(), json!(ms)))
            .collect();
        json!({
            "backend": simulation.backend().name(),
            "adapter": simulation.backend().adapter(),
            "steps": steps,
            "time": self.live.time(),
            "bodies": simulation.world.dynamic_count(),
            "asleep": stats.asleep,
            "manifolds": manifolds,
            "points": points,
            "colors": stats.colors,
            "overlap_mean_mm": depth.mean * 1e3,
            "overlap_max_mm": depth.max * 1e3,
            "speed_mm_s": rms_speed(&simulation.world) * 1e3,
            "kinetic_energy": simulation.world.kinetic_energy(),
            "stage_ms": stages,
            "fault": self.fault,
            "driven": driven,
            "camera": {"target": target.to_array(), "distance": distance, "yaw": yaw, "pitch": pitch},
        })
    }
}

#[wasm_bindgen]
impl Show {
    /// A scene of the catalogue. `parameters` are `name=value`, and `settings` is a JSON object.
    pub fn scene(name: &str, parameters: Vec<String>, settings: &str) -> std::result::Result<Show, JsError> {
        thrown(Self::of_scene(name, &parameters, settings))
    }

    /// The scene or the recording of a file.
    pub fn file(name: &str, bytes: &[u8], settings: &str) -> std::result::Result<Show, JsError> {
        thrown(Self::of_file(name, bytes, settings))
    }

    /// The ways to color bodies.
    pub fn colors() -> Vec<String> {
        ColorBy::ALL.iter().map(|color| color.name().to_owned()).collect()
    }

    /// Chooses the backend of the sweeps: `cpu`, `webgpu` or `webgpu-exact`.
    pub async fn use_backend(&mut self, name: String) -> std::result::Result<(), JsError> {
        self.live.simulation.set_backend(thrown(choice::backend(&name).await)?);
        Ok(())
    }

    /// The body that a person drives: `character`, `vehicle`, or nothing.
    pub fn drives(&self) -> Option<String> {
        self.live.driver.map(|driver| if driver.can_jump() { "character" } else { "vehicle" }.into())
    }

    /// Steers from the next step on: forward and to the right, each -1 to 1. A jump counts once.
    pub fn steer(&mut self, forward: f32, right: f32, jump: bool) {
        if let Some(driver) = &mut self.live.driver {
            driver.steer(forward, right, jump);
        }
    }

    /// Makes one step.
    pub async fn step(&mut self) -> std::result::Result<(), JsError> {
        thrown(self.make_step().await)
    }

    /// Length of a step (s).
    pub fn dt(&self) -> f32 {
        self.live.scene().dt
    }

    /// Whether this is the replay of a recording.
    pub fn is_recording(&self) -> bool {
        self.live.is_recording()
    }

    /// Whether a recording has ended.
    pub fn is_at_end(&self) -> bool {
        self.live.is_recording() && self.live.paused
    }

    /// Changes the settings to those of a JSON object. The run continues.
    pub fn set_settings(&mut self, settings: &str) -> std::result::Result<(), JsError> {
        thrown(choice::config(settings).and_then(|config| self.live.simulation.set_config(config)))
    }

    /// Numbers of the run as JSON.
    pub fn numbers(&mut self) -> String {
        self.count().to_string()
    }

    /// Turns the camera after a drag, in heights of the picture.
    pub fn orbit(&mut self, x: f32, y: f32) {
        self.camera.orbit(Vec2::new(x, y));
    }

    /// Moves the camera after a drag, in heights of the picture.
    pub fn pan(&mut self, x: f32, y: f32) {
        self.camera.pan(Vec2::new(x, y));
    }

    /// Moves the camera nearer by notches of the wheel.
    pub fn zoom(&mut self, notches: f32) {
        self.camera.zoom(notches);
    }

    /// Shows the whole scene in a picture of width `aspect` times its height.
    pub fn whole(&mut self, aspect: f32) {
        self.live.look_anew();
        self.follow(aspect);
    }

    /// Moves the camera with the bodies.
    pub fn follow(&mut self, aspect: f32) {
        self.camera = self.live.camera(aspect);
    }

    /// Copies the view of another show.
    pub fn look_as(&mut self, other: &Show) {
        self.camera = other.camera;
    }

    /// Grabs the dynamic body at a place of the picture, -1 to 1 from left to right and from bottom to top. Returns
    /// whether there is one.
    pub fn grab(&mut self, x: f32, y: f32, aspect: f32) -> bool {
        let pointer = self.pointer(x, y, aspect);
        self.live.grab(&pointer)
    }

    /// Pulls the grabbed body to a place of the picture.
    pub fn drag(&mut self, x: f32, y: f32, aspect: f32) {
        let pointer = self.pointer(x, y, aspect);
        self.live.drag(&pointer);
    }

    /// Releases the body.
    pub fn release(&mut self) {
        self.live.release();
    }

    /// Throws a cube towards a place of the picture.
    pub fn throw_cube(&mut self, x: f32, y: f32, aspect: f32) {
        self.live.point(&self.pointer(x, y, aspect));
        self.live.throw();
    }

    /// Removes the dynamic body at a place of the picture.
    pub fn delete_body(&mut self, x: f32, y: f32, aspect: f32) {
        self.live.point(&self.pointer(x, y, aspect));
        self.live.delete();
    }

    /// Colors the bodies by one of [`Show::colors`].
    pub fn color(&mut self, name: &str) {
        if let Some(color) = ColorBy::ALL.into_iter().find(|color| color.name() == name) {
            self.live.color = color;
        }
    }

    /// Chooses the lines over the picture.
    pub fn overlay(&mut self, contacts: bool, joints: bool, boxes: bool) {
        self.live.overlay = Overlay { contacts, joints, boxes };
    }

    /// The present world as a scene file.
    pub fn scene_file(&self) -> std::result::Result<String, JsError> {
        thrown(SceneFile::of(&self.live.scene_now()).map(|file| file.to_text()))
    }

    /// The recording of the run up to now.
    pub fn recording(&self) -> std::result::Result<Vec<u8>, JsError> {
        let none = || {
            Error::input(match self.live.is_recording() {
                true => "this is a replay: its file is the recording",
                false => "the run is too long for a recording: restart it",
            })
        };
        thrown(self.recorder.as_ref().ok_or_else(none).and_then(|recorder| recorder.ended()))
    }
}

/// The first number that differs between two shows, as JSON; `None` if all bits are equal.
#[wasm_bindgen]
pub fn first_difference(a: &Show, b: &Show) -> Option<String> {
    let found = BodyDifference::first(&a.live.simulation.world, &b.live.simulation.world)?;
    let (body, quantity) = (found.index(), found.quantity);
    let values = found.values.map(|value| format!("{value:?}"));
    Some(json!({"step": a.live.steps, "body": body, "quantity": quantity, "values": values}).to_string())
}
