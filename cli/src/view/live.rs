//! A scene that runs in a window.

use std::time::Duration;

use glam::Vec3;

use super::camera::Bounds;
use super::colors::ColorBy;
use super::film::{bounds, tight_bounds};
use super::overlay::Overlay;
use super::show::Pointer;
use drystone::backend::{BackendChoice, choose};
use drystone::queries::Filter;
use drystone::scenes::Spawners;
use drystone::{
    Body, BodyKind, JointHandle, Reference, Replay, Result, Scene, Shape, Simulation, Snapshot, SolverConfig, StepStats,
};

/// Rate at which a pulled body approaches the mouse (1/s): soft at any stiffness of joints.
const PULL: f32 = 10.0;
/// Speed of a thrown cube over the radius of the scene (1/s).
const THROW: f32 = 2.0;

pub struct Live {
    pub(super) scene: Scene,
    exact: bool,
    pub(super) choice: BackendChoice,
    pub(super) simulation: Simulation,
    spawners: Spawners,
    pub(super) color: ColorBy,
    pub(super) overlay: Overlay,
    pub(super) paused: bool,
    /// Requested simulated seconds per second.
    pub(super) speed: f32,
    /// Reached simulated seconds per second, a mean over the last pictures.
    pub(super) reached: f32,
    /// Pictures per second, a mean over the last pictures.
    pub(super) pictures: f32,
    pub(super) steps: u32,
    pub(super) stats: StepStats,
    /// Times of the stages, means over the last steps (ms).
    pub(super) stage_ms: [f64; 5],
    pub(super) refused: Option<String>,
    pub(super) owed: f32,
    /// Time of the steps before the last picture.
    pub(super) stepping: Duration,
    pub(super) grabbed: Option<Grabbed>,
    pub(super) kept: Option<Kept>,
    /// The recording that runs again, instead of the scene.
    pub(super) replay: Option<Replay>,
    /// Where the mouse points.
    pub(super) pointer: Option<Pointer>,
    pub(super) bounds: Bounds,
    pub(super) light_end: f32,
}

/// A body that the mouse pulls by the last joint of the world.
pub(super) struct Grabbed {
    pub(super) body: usize,
    /// The pulled point in the body's frame (m).
    pub(super) anchor: Vec3,
    /// Distance of the target from the eye (m).
    pub(super) distance: f32,
    pub(super) target: Vec3,
    pub(super) joint: JointHandle,
}

/// The scene of a recording, whose simulation has begun.
pub fn scene_of(replay: &Replay, simulation: &Simulation) -> Scene {
    let mut scene = Scene::new(replay.title(), simulation.world.clone(), replay.len());
    scene.dt = replay.dt().unwrap_or(scene.dt);
    // A recording has no container; near walls hide its bodies all the same.
    let Bounds { low, high } = tight_bounds(&scene.world);
    scene.container = low.is_finite().then_some((low, high));
    scene
}

/// A state to go back to: that of the simulation and of the spawners, and its step.
pub(super) type Kept = (Snapshot, Spawners, u32);

impl Live {
    /// A recording that runs again.
    pub fn of_recording(mut replay: Replay, choice: BackendChoice, exact: bool, color: ColorBy) -> Result<Self> {
        let simulation = replay.begin(Box::new(Reference::<f32>::new()))?;
        let scene = scene_of(&replay, &simulation);
        let mut live = Self::new(scene, simulation.config().clone(), choice, exact, color)?;
        live.simulation = simulation;
        live.set_backend(choice);
        live.replay = Some(replay);
        Ok(live)
    }

    pub fn new(scene: Scene, config: SolverConfig, choice: BackendChoice, exact: bool, color: ColorBy) -> Result<Self> {
        let (backend, _) = choose(choice, scene.world.dynamic_count(), exact)?;
        let simulation = Simulation::new(scene.world.clone(), config, backend)?;
        Ok(Self {
            bounds: bounds(&scene.world),
            exact,
            choice,
            simulation,
            spawners: Spawners::new(&scene),
            color,
            overlay: Overlay::default(),
            paused: false,
            speed: 1.0,
            reached: 0.0,
            pictures: 0.0,
            steps: 0,
            stats: StepStats::default(),
            stage_ms: [0.0; 5],
            refused: None,
            owed: 0.0,
            stepping: Duration::ZERO,
            grabbed: None,
            kept: None,
            replay: None,
            pointer: None,
            light_end: 0.0,
            scene,
        })
    }

    /// Simulated time (s).
    pub fn time(&self) -> f32 {
        self.steps as f32 * self.scene.dt
    }

    pub(super) fn restart(&mut self) -> Result<()> {
        if self.replay.is_some() {
            return self.seek(-f64::INFINITY);
        }
        let config = self.simulation.config().clone();
        let (backend, _) = choose(self.choice, self.scene.world.dynamic_count(), self.exact)?;
        self.simulation = Simulation::new(self.scene.world.clone(), config, backend)?;
        self.spawners = Spawners::new(&self.scene);
        (self.steps, self.owed, self.grabbed, self.stats) = (0, 0.0, None, StepStats::default());
        Ok(())
    }

    /// Keeps the state, to go back to it.
    pub(super) fn keep(&mut self) {
        self.kept = Some((self.simulation.snapshot(), self.spawners.clone(), self.steps));
    }

    /// Goes back to the state that was kept.
    pub(super) fn go_back(&mut self) {
        if let Some((snapshot, spawners, steps)) = self.kept.as_ref().filter(|_| self.replay.is_none()) {
            self.simulation.restore(snapshot);
            self.spawners.clone_from(spawners);
            (self.steps, self.owed, self.grabbed) = (*steps, 0.0, None);
        }
    }

    /// Goes so many seconds forth or back in a recording.
    pub(super) fn seek(&mut self, seconds: f64) -> Result<()> {
        if let Some(replay) = &mut self.replay {
            let step = (f64::from(self.steps) + seconds / f64::from(self.scene.dt)).round().max(0.0);
            replay.seek(&mut self.simulation, step as u32)?;
            (self.steps, self.owed) = (replay.step_number(), 0.0);
        }
        Ok(())
    }

    /// Throws a cube from the eye to where the mouse points.
    pub(super) fn throw(&mut self) {
        let Some(Pointer { origin, direction, .. }) = self.pointer.filter(|_| self.replay.is_none()) else { return };
        let size = 0.02 * self.bounds.radius();
        let cube = Body::dynamic().named("thrown").shape(Shape::cuboid(size, size, size));
        let [x, y, z] = (origin + 4.0 * size * direction).to_array();
        self.simulation
            .world
            .insert(cube.position(x, y, z).velocity(THROW * self.bounds.radius() * direction, Vec3::ZERO));
    }

    /// The dynamic body under the mouse, through other bodies if need be, and how far from the eye (m).
    pub(super) fn body_at(&self, Pointer { origin, direction, .. }: Pointer) -> Option<(f32, usize)> {
        // A recording goes its own way.
        if self.replay.is_some() {
            return None;
        }
        let is_dynamic = |_, body: &Body| body.kind == BodyKind::Dynamic;
        let filter = Filter::default().only(&is_dynamic);
        let hit = self.simulation.queries().ray(origin, direction, f32::INFINITY, &filter)?;
        Some((hit.distance, hit.body.index()))
    }

    /// Takes out the dynamic body under the mouse.
    pub(super) fn delete(&mut self) {
        let under = self.pointer.and_then(|pointer| self.body_at(pointer));
        let world = &mut self.simulation.world;
        if let Some(body) = under.and_then(|(_, i)| world.bodies.handle(i)) {
            world.remove(body);
        }
    }

    pub(super) fn set_config(&mut self, config: SolverConfig) {
        self.refused = self.simulation.set_config(config).err().map(|e| e.to_string());
    }

    pub(super) fn set_backend(&mut self, choice: BackendChoice) {
        match choose(choice, self.scene.world.dynamic_count(), self.exact) {
            Ok((backend, _)) => {
                self.simulation.set_backend(backend);
                (self.choice, self.refused) = (choice, None);
            }
            Err(e) => self.refused = Some(e.to_string()),
        }
    }

    pub(super) fn step(&mut self) -> Result<()> {
        if let Some(replay) = &mut self.replay {
            match replay.step(&mut self.simulation)? {
                Some(stats) => self.note(stats),
                None => self.paused = true,
            }
            return Ok(());
        }
        let dt = self.scene.dt;
        self.spawners.before_step(&mut self.simulation.world, dt);
        let world = &mut self.simulation.world;
        // A body that went took its joint along.
        self.grabbed = self.grabbed.take().filter(|grabbed| world.joint(grabbed.joint).is_some());
        if let Some(grabbed) = &self.grabbed {
            let body = &world.bodies[grabbed.body];
            let at = body.position + body.rotation * grabbed.anchor;
            if let Some(joint) = world.joint_mut(grabbed.joint) {
                joint.anchor_b = at + (grabbed.target - at) * (PULL * dt).min(1.0);
            }
            self.simulation.wake(grabbed.body);
        }
        let stats = self.simulation.step(dt)?;
        self.note(stats);
        Ok(())
    }

    /// Notes a step that was made.
    fn note(&mut self, stats: StepStats) {
        self.stats = stats;
        self.steps += 1;
        for (mean, (_, time)) in self.stage_ms.iter_mut().zip(self.stats.times.stages()) {
            *mean += 0.1 * (time.as_secs_f64() * 1e3 - *mean);
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec2;
    use winit::keyboard::{Key, NamedKey};

    use super::super::show::{Pointer, Show};
    use super::*;
    use drystone::{Recorder, RecordingIntervals};

    fn live(name: &str) -> Live {
        let scene = Scene::find(name, &[]).expect("a scene");
        Live::new(scene, SolverConfig::default(), BackendChoice::Reference, false, ColorBy::Batch).expect("a scene")
    }

    fn press(live: &mut Live, key: &str) {
        live.key(&Key::Character(key.into()), true).expect("a key");
    }

    #[test]
    fn time_passes_at_the_requested_speed_and_stops_in_a_pause() {
        let mut live = live("tower");
        (0..6).for_each(|_| live.advance(1.0 / 60.0 + 1e-6).expect("time"));
        assert_eq!(live.steps, 6);
        press(&mut live, "-");
        (0..6).for_each(|_| live.advance(1.0 / 60.0 + 1e-6).expect("time"));
        assert_eq!(live.steps, 9);
        live.key(&Key::Named(NamedKey::Space), true).expect("a key");
        live.advance(0.1).expect("time");
        press(&mut live, "n");
        assert_eq!(live.steps, 10);
        press(&mut live, "r");
        assert_eq!((live.steps, live.world().bodies[1].position.y), (0, 0.5));
    }

    #[test]
    fn the_mouse_pulls_the_body_under_it_and_releases_it() {
        let mut live = live("tower");
        let camera = live.camera(1.5);
        let top = live.world().bodies.len() - 1;
        let place = camera.projection(1.5, 10.0).project_point3(live.world().bodies[top].position);
        let pointer = |at: Vec2| {
            let (origin, direction) = camera.ray(at, 1.5);
            Pointer { at, origin, direction }
        };
        assert!(!live.grab(&pointer(Vec2::new(0.95, 0.95))), "there is nothing");
        assert!(live.grab(&pointer(place.truncate())));
        let before = live.world().bodies[top].position;
        live.drag(&pointer(place.truncate() + Vec2::new(0.0, 0.3)));
        (0..40).for_each(|_| live.step().expect("a step"));
        assert!(live.world().bodies[top].position.y > before.y + 0.5, "it is lifted");
        assert!(live.world().joints.len() == 1 && !live.lines().is_empty());
        live.release();
        (0..60).for_each(|_| live.step().expect("a step"));
        assert!(live.world().joints.is_empty() && live.world().bodies[top].position.y < before.y + 0.5, "it falls");
    }

    /// The number of joints stays the same while the joint changes.
    #[test]
    fn another_body_can_be_grabbed_right_after_one_was_released() {
        let mut live = live("tower");
        let camera = live.camera(1.5);
        let projection = camera.projection(1.5, 10.0);
        let top = live.world().bodies.len() - 1;
        let above = |live: &Live, body: usize| {
            let at = projection.project_point3(live.world().bodies[body].position).truncate();
            let (origin, direction) = camera.ray(at, 1.5);
            Pointer { at, origin, direction }
        };
        assert!(live.grab(&above(&live, top)));
        live.step().expect("a step");
        press(&mut live, " ");
        live.release();
        assert!(live.grab(&above(&live, top - 3)));
        let grabbed = live.grabbed.as_ref().expect("a body").body;
        assert_eq!(grabbed, top - 3);
        for _ in 0..30 {
            live.step().expect("a step");
            let world = live.world();
            assert!(world.joint_gap() < 0.05, "{} m", world.joint_gap());
            assert!((world.bodies[top].position.x.abs()).max(world.bodies[top].position.z.abs()) < 0.05);
        }
    }

    #[test]
    fn settings_and_backend_change_during_a_run_and_bad_settings_are_refused() {
        let mut live = live("tower");
        live.step().expect("a step");
        live.set_config(SolverConfig::default().with(|c| c.substeps = 3));
        live.set_backend(BackendChoice::Cpu);
        live.step().expect("a step");
        assert_eq!((live.simulation.config().substeps, live.simulation.backend().name()), (3, "cpu"));
        live.set_config(SolverConfig::default().with(|c| c.substeps = 0));
        assert!(live.refused.as_ref().is_some_and(|e| e.contains("substeps")));
        assert_eq!(live.simulation.config().substeps, 3);
    }

    #[test]
    fn a_kept_state_comes_back_with_its_bodies() {
        let mut live = live("tower");
        (0..5).for_each(|_| live.step().expect("a step"));
        let (hash, bodies) = (live.simulation.hash(), live.world().bodies.count());
        press(&mut live, "s");
        let top = live.world().bodies.handle(bodies - 1).expect("a cube");
        live.simulation.world.remove(top);
        (0..5).for_each(|_| live.step().expect("a step"));
        press(&mut live, "l");
        assert_eq!((live.steps, live.simulation.hash(), live.world().bodies.count()), (5, hash, bodies));
    }

    #[test]
    fn a_recording_runs_forth_and_back_and_stops_at_its_end() {
        let scene = Scene::find("drum", &[]).expect("a scene");
        let config = SolverConfig::default();
        let mut simulation = Simulation::new(scene.world, config, Box::new(Reference::<f32>::new())).expect("a scene");
        let mut recorder =
            Recorder::new(Vec::new(), "drum", &mut simulation, RecordingIntervals::default()).expect("memory");
        let hashes: Vec<u64> = (0..90)
            .map(|_| {
                recorder.step(&mut simulation, scene.dt).expect("a step");
                simulation.hash()
            })
            .collect();
        let replay = Replay::read(&recorder.finish().expect("memory")).expect("a recording");
        let mut live = Live::of_recording(replay, BackendChoice::Reference, false, ColorBy::Batch).expect("a scene");
        // Whatever stands before the bodies is not drawn.
        let Bounds { low, high } = live.container().expect("bodies");
        let is_inside = |at: Vec3| at.cmpgt(low).all() && at.cmplt(high).all();
        assert!(live.world().dynamic().all(|body| is_inside(body.position)));
        (0..70).for_each(|_| live.step().expect("a step"));
        live.key(&Key::Named(NamedKey::ArrowLeft), true).expect("a key");
        assert_eq!((live.steps, live.simulation.hash()), (10, hashes[9]));
        live.key(&Key::Named(NamedKey::ArrowRight), true).expect("a key");
        assert_eq!((live.steps, live.simulation.hash()), (70, hashes[69]));
        (0..30).for_each(|_| live.step().expect("a step"));
        assert_eq!((live.steps, live.paused, live.simulation.hash()), (90, true, hashes[89]));
    }
}
