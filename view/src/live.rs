//! A scene or a recording that runs interactively.

use std::time::Duration;

use glam::{Quat, Vec3};
use web_time::Instant;

use crate::bounds::{Bounds, FAR};
use crate::camera::Camera;
use crate::colors::ColorBy;
use crate::overlay::Overlay;
use crate::poses::poses;
use crate::show::Pointer;
use drystone::backend::{BackendChoice, choose};
use drystone::queries::Filter;
use drystone::{
    Backend, Body, BodyHandle, BodyKind, Cpu, JointHandle, Result, Shape, Simulation, Snapshot, SolverConfig, StepStats,
};
use drystone_scenes::{Driver, Replay, Scene, Spawners};

/// Rate at which a pulled body approaches the pointer (1/s). It is soft for joints of any stiffness.
const PULL: f32 = 10.0;
/// Longest time for the steps before a picture, unless drawing takes longer.
const PATIENCE: Duration = Duration::from_millis(30);
/// Speed of a thrown cube, in radii of the scene per second (1/s).
const THROW: f32 = 2.0;
/// Distance of the camera from a driven body, in radii of the body, and the share by which it comes nearer to its place
/// behind the body in each step.
const BEHIND: f32 = 8.0;
const EASE: f32 = 0.15;

/// A scene or a recording that runs interactively. The user can pull bodies, throw cubes, keep a state and go back to
/// it.
pub struct Live {
    pub(crate) scene: Scene,
    exact: bool,
    /// The requested backend.
    pub choice: BackendChoice,
    pub simulation: Simulation,
    spawners: Spawners,
    pub color: ColorBy,
    pub overlay: Overlay,
    pub paused: bool,
    /// Requested simulated seconds per second.
    pub speed: f32,
    /// Reached simulated seconds per second, averaged over the last pictures.
    pub reached: f32,
    /// Pictures per second, averaged over the last pictures.
    pub pictures: f32,
    /// Steps since the start.
    pub steps: u32,
    /// Statistics of the last step.
    pub stats: StepStats,
    /// Times of the stages, averaged over the last steps (ms).
    pub stage_ms: [f64; 5],
    /// The error that refused the last change of settings or backend, in one line.
    pub refused: Option<String>,
    /// Orders for the next advance.
    pub(crate) orders: Vec<Order>,
    pub(crate) owed: f32,
    /// Duration of the steps before the last picture.
    pub(crate) stepping: Duration,
    pub(crate) grabbed: Option<Grabbed>,
    pub(crate) kept: Option<Kept>,
    /// The recording that is replayed instead of the scene.
    pub(crate) replay: Option<Replay>,
    /// The place of the pointer.
    pub(crate) pointer: Option<Pointer>,
    /// The driver, if the scene has one.
    pub driver: Option<Driver>,
    /// The camera behind the driven body, from the first input on.
    pub(crate) chase: Option<Camera>,
    /// Whether each arrow key is down: up, down, left, right.
    pub(crate) held: [bool; 4],
    /// Bounds of the scene at its start.
    pub(crate) built: Bounds,
    /// Bounds of the bodies and of the last part of their paths.
    pub(crate) way: Bounds,
    pub(crate) light_end: f32,
}

/// A body that the pointer pulls through a joint to the world.
pub(crate) struct Grabbed {
    pub(crate) body: BodyHandle,
    /// The pulled point in the body's frame (m).
    pub(crate) anchor: Vec3,
    /// Distance of the target from the eye (m).
    pub(crate) distance: f32,
    pub(crate) target: Vec3,
    pub(crate) joint: JointHandle,
}

/// A request of a key or a button, for the next advance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Order {
    /// One step while paused.
    Step,
    /// The state at the start.
    Restart,
    /// Go forward or back in a recording by this time (s).
    Seek(f64),
}

/// The scene of a recording; `simulation` is its replay.
pub fn scene_of(replay: &Replay, simulation: &Simulation) -> Scene {
    let mut scene = Scene::new(replay.title(), simulation.world.clone(), replay.len());
    scene.dt = replay.dt().unwrap_or(scene.dt);
    // A recording has no container, but near walls hide its bodies too.
    let Bounds { low, high } = Bounds::tight(&scene.world);
    scene.container = low.is_finite().then_some((low, high));
    scene
}

/// A state to go back to: of the simulation, the spawners and the driver, with its step.
pub(crate) type Kept = (Snapshot, Spawners, Option<Driver>, u32);

impl Live {
    /// A scene on the requested backend; `exact` requests a GPU with the bits of the reference.
    ///
    /// # Errors
    /// Those of [`choose`]; or settings are invalid, or the scene does not fit into memory.
    pub fn new(scene: Scene, config: SolverConfig, choice: BackendChoice, exact: bool, color: ColorBy) -> Result<Self> {
        let (backend, _) = choose(choice, scene.world.dynamic_count(), exact)?;
        let simulation = Simulation::with(scene.world.clone(), config, backend)?;
        Ok(Self { choice, exact, ..Self::of(scene, simulation, color) })
    }

    /// A scene on an open backend. A web page opens it itself.
    ///
    /// # Errors
    /// Settings are invalid, or the scene does not fit into memory.
    pub fn with(scene: Scene, config: SolverConfig, backend: Box<dyn Backend>, color: ColorBy) -> Result<Self> {
        let simulation = Simulation::with(scene.world.clone(), config, backend)?;
        Ok(Self::of(scene, simulation, color))
    }

    /// A recording to replay.
    ///
    /// # Errors
    /// Those of [`choose`]; or the recording is damaged.
    pub fn of_recording(mut replay: Replay, choice: BackendChoice, exact: bool, color: ColorBy) -> Result<Self> {
        let mut simulation = replay.begin(Box::new(Cpu::new()))?;
        let scene = scene_of(&replay, &simulation);
        simulation.set_backend(choose(choice, scene.world.dynamic_count(), exact)?.0);
        Ok(Self { choice, exact, replay: Some(replay), ..Self::of(scene, simulation, color) })
    }

    fn of(scene: Scene, simulation: Simulation, color: ColorBy) -> Self {
        let bounds = Bounds::of(&scene.world);
        Self {
            built: bounds,
            way: bounds,
            exact: false,
            choice: BackendChoice::default(),
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
            orders: Vec::new(),
            owed: 0.0,
            stepping: Duration::ZERO,
            grabbed: None,
            kept: None,
            replay: None,
            pointer: None,
            driver: scene.driver,
            chase: None,
            held: [false; 4],
            light_end: 0.0,
            scene,
        }
    }

    /// The scene at its start.
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// The scene at present: the world, and the remaining spawners.
    pub fn scene_now(&self) -> Scene {
        let (spawners, leaving) = self.spawners.remaining(self.scene.dt);
        let mut world = self.simulation.world.clone();
        if let Some(grabbed) = &self.grabbed {
            world.remove_joint(grabbed.joint);
        }
        Scene { world, spawners, leaving, ..self.scene.clone() }
    }

    /// Whether this is the replay of a recording.
    pub fn is_recording(&self) -> bool {
        self.replay.is_some()
    }

    /// Simulated time (s).
    pub fn time(&self) -> f32 {
        self.steps as f32 * self.scene.dt
    }

    /// Adds an order for the next advance.
    pub fn order(&mut self, order: Order) {
        self.paused |= order == Order::Step;
        self.orders.push(order);
    }

    /// Carries out the orders.
    async fn obey(&mut self) -> Result<()> {
        for order in std::mem::take(&mut self.orders) {
            match order {
                Order::Step => self.step_async().await?,
                Order::Restart if self.replay.is_none() => self.restart()?,
                Order::Restart => self.seek(f64::NEG_INFINITY).await?,
                Order::Seek(seconds) => self.seek(seconds).await?,
            }
        }
        Ok(())
    }

    fn restart(&mut self) -> Result<()> {
        let config = self.simulation.config().clone();
        let backend = self.simulation.set_backend(Box::new(Cpu::new()));
        self.simulation = Simulation::with(self.scene.world.clone(), config, backend)?;
        self.spawners = Spawners::new(&self.scene);
        self.driver = self.scene.driver;
        (self.steps, self.owed, self.grabbed, self.stats) = (0, 0.0, None, StepStats::default());
        self.look_anew();
        Ok(())
    }

    /// Keeps the present state, to go back to it.
    pub fn keep(&mut self) {
        self.kept = Some((self.simulation.snapshot(), self.spawners.clone(), self.driver, self.steps));
    }

    /// Goes back to the kept state.
    pub fn go_back(&mut self) {
        if let Some((snapshot, spawners, driver, steps)) = self.kept.as_ref().filter(|_| self.replay.is_none()) {
            self.simulation.restore(snapshot);
            self.spawners.clone_from(spawners);
            (self.driver, self.steps, self.owed, self.grabbed) = (*driver, *steps, 0.0, None);
            self.steer_by_keys(false);
            self.look_anew();
        }
    }

    /// Goes forward or back in a recording by `seconds`.
    async fn seek(&mut self, seconds: f64) -> Result<()> {
        if let Some(replay) = &mut self.replay {
            let step = (f64::from(self.steps) + seconds / f64::from(self.scene.dt)).round().max(0.0);
            replay.seek_async(&mut self.simulation, step as u32).await?;
            (self.steps, self.owed) = (replay.step_number(), 0.0);
            self.look_anew();
        }
        Ok(())
    }

    /// Discards the paths of the bodies. The camera then frames them at their present places.
    pub fn look_anew(&mut self) {
        (self.way, self.chase) = (Bounds::EMPTY, None);
        self.look();
    }

    /// Records the places of the bodies.
    fn look(&mut self) {
        let (world, radius) = (&self.simulation.world, self.built.radius());
        let now = Bounds::at(world, &poses(world), radius);
        self.way = self.way.near(now, FAR * radius);
        self.chase = self.driven().filter(|_| self.driver.is_some_and(|driver| driver.is_driving())).map(|body| {
            let bounds = body.colliders.iter().map(|collider| collider.bounds(Vec3::ZERO, Quat::IDENTITY));
            let whole = bounds.fold(Bounds::EMPTY, |all, (low, high)| all.join(Bounds { low, high }));
            let ahead = body.rotation * Vec3::X;
            let behind = Camera::behind(body.position, ahead, self.up(), BEHIND * whole.radius());
            self.chase.map_or(behind, |camera| camera.towards(&behind, EASE))
        });
    }

    /// Steers by the arrow keys that are down.
    pub(crate) fn steer_by_keys(&mut self, jump: bool) {
        let [up, down, left, right] = self.held.map(f32::from);
        if let Some(driver) = &mut self.driver {
            driver.steer(up - down, right - left, jump);
        }
    }

    /// The driven body.
    pub fn driven(&self) -> Option<&Body> {
        self.driver.and_then(|driver| self.simulation.world.body(driver.body()))
    }

    /// The point that the camera follows while a person drives (m).
    pub fn followed(&self) -> Option<Vec3> {
        self.chase.map(|camera| camera.target)
    }

    /// The direction against gravity.
    pub(crate) fn up(&self) -> Vec3 {
        -self.scene.world.gravity.try_normalize().unwrap_or(Vec3::NEG_Y)
    }

    /// Throws a cube from the eye towards the pointer.
    pub fn throw(&mut self) {
        let Some(Pointer { origin, direction, .. }) = self.pointer.filter(|_| self.replay.is_none()) else { return };
        let size = 0.02 * self.built.radius();
        let cube = Body::dynamic().named("thrown").shape(Shape::cuboid(size, size, size));
        let [x, y, z] = (origin + 4.0 * size * direction).to_array();
        self.simulation
            .world
            .insert(cube.position(x, y, z).velocity(THROW * self.built.radius() * direction, Vec3::ZERO));
    }

    /// The dynamic body under the pointer, even behind other bodies, and its distance from the eye (m).
    pub fn body_at(&self, Pointer { origin, direction, .. }: Pointer) -> Option<(f32, BodyHandle)> {
        // A recording cannot be changed.
        if self.replay.is_some() {
            return None;
        }
        let is_dynamic = |_, body: &Body| body.kind == BodyKind::Dynamic;
        let filter = Filter::default().only(&is_dynamic);
        let hit = self.simulation.queries().ray(origin, direction, f32::INFINITY, &filter)?;
        Some((hit.distance, hit.body))
    }

    /// Removes the dynamic body under the pointer.
    pub fn delete(&mut self) {
        let under = self.pointer.and_then(|pointer| self.body_at(pointer));
        if let Some((_, body)) = under {
            self.simulation.world.remove(body);
        }
    }

    /// Continues on another backend, which lacks the rows of the last step.
    ///
    /// # Errors
    /// Those of [`choose`].
    pub fn set_backend(&mut self, choice: BackendChoice) -> Result<()> {
        let (backend, _) = choose(choice, self.scene.world.dynamic_count(), self.exact)?;
        self.simulation.set_backend(backend);
        self.choice = choice;
        Ok(())
    }

    /// Advances the time at the requested speed, with as many steps as the time between two pictures allows.
    ///
    /// # Errors
    /// Those of [`Simulation::step`].
    pub async fn advance_async(&mut self, seconds: f32) -> Result<()> {
        let began = Instant::now();
        self.obey().await?;
        let before = self.time();
        let drawing = Duration::from_secs_f32(seconds).saturating_sub(self.stepping);
        if !self.paused {
            self.owed += seconds * self.speed;
            while self.owed >= self.scene.dt && began.elapsed() < PATIENCE.max(drawing) {
                self.step_async().await?;
                self.owed -= self.scene.dt;
            }
            // A simulation that is too slow for real time does not accumulate steps.
            self.owed = self.owed.min(2.0 * self.scene.dt);
        }
        self.stepping = began.elapsed();
        self.pictures += (2.0 * seconds).min(1.0) * (1.0 / seconds.max(1e-4) - self.pictures);
        let reached = (self.time() - before) / seconds.max(1e-4);
        self.reached += (2.0 * seconds).min(1.0) * (reached - self.reached);
        Ok(())
    }

    /// Makes one step. A web page awaits it; elsewhere it completes before the first await.
    ///
    /// # Errors
    /// Those of [`Simulation::step`].
    pub async fn step_async(&mut self) -> Result<()> {
        let stats = match &mut self.replay {
            Some(replay) => replay.step_async(&mut self.simulation).await?,
            None => {
                self.before_step()?;
                Some(self.simulation.step_async(self.scene.dt).await?)
            }
        };
        self.note(stats);
        Ok(())
    }

    /// Records a completed step. A recording stops after its last step.
    fn note(&mut self, stats: Option<StepStats>) {
        match stats {
            Some(stats) => self.after_step(stats),
            None => self.paused = true,
        }
    }

    /// Runs the spawners, pulls the grabbed body and moves the driven one, before a step that the caller makes.
    ///
    /// # Errors
    /// Those of [`Driver::before_step`].
    pub fn before_step(&mut self) -> Result<()> {
        let dt = self.scene.dt;
        self.spawners.before_step(&mut self.simulation.world, dt);
        let world = &mut self.simulation.world;
        // When a body is removed, its joint is gone too.
        self.grabbed = self.grabbed.take().filter(|grabbed| world.joint(grabbed.joint).is_some());
        if let Some(grabbed) = &self.grabbed {
            let body = &world.bodies[grabbed.body.index()];
            let at = body.position + body.rotation * grabbed.anchor;
            if let Some(joint) = world.joint_mut(grabbed.joint) {
                joint.anchor_b = at + (grabbed.target - at) * (PULL * dt).min(1.0);
            }
            self.simulation.wake(grabbed.body);
        }
        self.driver.as_mut().map_or(Ok(()), |driver| driver.before_step(&mut self.simulation, dt))
    }

    /// Records a completed step.
    pub fn after_step(&mut self, stats: StepStats) {
        self.stats = stats;
        self.steps += 1;
        self.look();
        for (mean, (_, time)) in self.stage_ms.iter_mut().zip(self.stats.times.stages()) {
            *mean += 0.1 * (time.as_secs_f64() * 1e3 - *mean);
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec2;

    use super::*;
    use crate::show::{Key, Pointer, Show};
    use drystone::Reference;
    use drystone_scenes::{Recorder, RecordingIntervals};

    fn live(name: &str) -> Live {
        let scene = Scene::find(name, &[]).expect("a scene");
        Live::new(scene, SolverConfig::default(), BackendChoice::Reference, false, ColorBy::Batch).expect("a scene")
    }

    fn advance(live: &mut Live, seconds: f32) {
        pollster::block_on(live.advance(seconds)).expect("time");
    }

    fn step(live: &mut Live) {
        pollster::block_on(live.step_async()).expect("a step");
    }

    /// Presses a key, and lets time pass until the key takes effect.
    fn press(live: &mut Live, key: &str) {
        live.key(Key::named(key).expect("a key"), true);
        advance(live, 0.0);
    }

    #[test]
    fn time_passes_at_the_requested_speed_and_stops_in_a_pause() {
        let mut live = live("tower");
        (0..6).for_each(|_| advance(&mut live, 1.0 / 60.0 + 1e-6));
        assert_eq!(live.steps, 6);
        press(&mut live, "-");
        (0..6).for_each(|_| advance(&mut live, 1.0 / 60.0 + 1e-6));
        assert_eq!(live.steps, 9);
        press(&mut live, " ");
        advance(&mut live, 0.1);
        press(&mut live, "n");
        assert_eq!(live.steps, 10);
        press(&mut live, "r");
        assert_eq!((live.steps, live.world().bodies[1].position.y), (0, 0.5));
    }

    #[test]
    fn a_key_makes_no_step_before_time_passes() {
        let mut live = live("tower");
        live.key(Key::Character('n'), true);
        live.key(Key::Character('n'), true);
        assert_eq!((live.steps, live.paused), (0, true));
        advance(&mut live, 0.1);
        assert_eq!(live.steps, 2);
        advance(&mut live, 0.1);
        assert_eq!(live.steps, 2);
        live.order(Order::Restart);
        advance(&mut live, 0.0);
        assert_eq!((live.steps, live.simulation.backend().name()), (0, "reference"));
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
        (0..40).for_each(|_| step(&mut live));
        assert!(live.world().bodies[top].position.y > before.y + 0.5, "it is lifted");
        assert!(live.world().joints.len() == 1 && !live.lines().is_empty());
        live.release();
        (0..60).for_each(|_| step(&mut live));
        assert!(live.world().joints.is_empty() && live.world().bodies[top].position.y < before.y + 0.5, "it falls");
    }

    /// The number of joints stays the same when another joint takes the place of the first.
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
        step(&mut live);
        press(&mut live, " ");
        live.release();
        assert!(live.grab(&above(&live, top - 3)));
        let grabbed = live.grabbed.as_ref().expect("a body").body;
        assert_eq!(grabbed.index(), top - 3);
        for _ in 0..30 {
            step(&mut live);
            let world = live.world();
            assert!(world.joint_gap() < 0.05, "{} m", world.joint_gap());
            assert!((world.bodies[top].position.x.abs()).max(world.bodies[top].position.z.abs()) < 0.05);
        }
    }

    #[test]
    fn settings_and_backend_change_during_a_run_and_bad_settings_are_refused() {
        let mut live = live("tower");
        step(&mut live);
        live.simulation.set_config(SolverConfig::default().with(|c| c.substeps = 3)).expect("settings");
        live.set_backend(BackendChoice::Cpu).expect("a backend");
        step(&mut live);
        assert_eq!((live.simulation.config().substeps, live.simulation.backend().name()), (3, "cpu"));
        let refused = live.simulation.set_config(SolverConfig::default().with(|c| c.substeps = 0)).expect_err("bad");
        assert!(refused.to_string().contains("substeps"));
        assert_eq!(live.simulation.config().substeps, 3);
    }

    #[test]
    fn a_kept_state_comes_back_with_its_bodies() {
        let mut live = live("tower");
        (0..5).for_each(|_| step(&mut live));
        let (hash, bodies) = (live.simulation.hash(), live.world().bodies.count());
        press(&mut live, "s");
        let top = live.world().bodies.handle(bodies - 1).expect("a cube");
        live.simulation.world.remove(top);
        (0..5).for_each(|_| step(&mut live));
        press(&mut live, "l");
        assert_eq!((live.steps, live.simulation.hash(), live.world().bodies.count()), (5, hash, bodies));
    }

    #[test]
    fn a_recording_runs_forth_and_back_and_stops_at_its_end() {
        let scene = Scene::find("drum", &[]).expect("a scene");
        let config = SolverConfig::default();
        let mut simulation = Simulation::with(scene.world, config, Box::new(Reference::<f32>::new())).expect("a scene");
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
        // Anything in front of the bodies is not drawn.
        let Bounds { low, high } = live.container().expect("bodies");
        let is_inside = |at: Vec3| at.cmpgt(low).all() && at.cmplt(high).all();
        assert!(live.world().dynamic().all(|body| is_inside(body.position)));
        (0..70).for_each(|_| step(&mut live));
        press(&mut live, "ArrowLeft");
        assert_eq!((live.steps, live.simulation.hash()), (10, hashes[9]));
        press(&mut live, "ArrowRight");
        assert_eq!((live.steps, live.simulation.hash()), (70, hashes[69]));
        (0..30).for_each(|_| step(&mut live));
        assert_eq!((live.steps, live.paused, live.simulation.hash()), (90, true, hashes[89]));
    }
}
