//! Random worlds with random calls.

use arbitrary::{Arbitrary, Unstructured};
use drystone::queries::Filter;
use drystone::{BodyHandle, JointHandle, Listen, Material, SolverConfig, World};
use drystone_cli::settings;

use crate::any::{AnyBody, AnyJoint, AnyMass, AnyShape, Kind, Number, Turn, Vector};
use crate::run::Runs;
use crate::{good, is_one_line, show};

/// Largest numbers of bodies and calls: more of them find nothing new.
const MAX_BODIES: usize = 16;
const MAX_CALLS: usize = 32;

#[derive(Arbitrary, Debug)]
struct Program {
    worlds: bool,
    gravity: Option<Vector>,
    settings: Vec<Setting>,
    bodies: Vec<AnyBody>,
    joints: Vec<AnyJoint>,
    calls: Vec<Call>,
}

#[derive(Arbitrary, Debug)]
enum Setting {
    Real(u8, Number),
    Whole(u8, u8),
    Word(u8, u8),
}

#[derive(Arbitrary, Debug)]
enum Call {
    Step,
    Steps(u8),
    StepOf(Number),
    Insert(AnyBody, bool),
    Remove(u8),
    Put(u8, Vector, Turn),
    Push(u8, Vector, Vector),
    Kick(u8, Vector, Vector),
    Kind(u8, Kind),
    Shape(u8, AnyShape),
    Mass(u8, AnyMass),
    Surface(u8, Number, Number),
    Groups(u8, u8, u8),
    GravityScale(u8, Number),
    Join(AnyJoint),
    Part(u8),
    Set(Setting),
    Reload,
    AndBack,
    Listen(Option<Number>, bool, bool),
    Wake(u8),
    Ray(Vector, Vector, Number),
    Cast(AnyShape, Vector, Turn, Vector, Number),
    Closest(Vector, Number),
    Look,
}

/// Settings with few substeps; otherwise an input would take seconds.
fn set(config: &SolverConfig, setting: &Setting) -> Option<SolverConfig> {
    let all = serde_json::to_value(config).expect("settings serialize");
    let mut keys: Vec<String> =
        all.as_object().expect("a table").keys().filter(|&key| key != "rules").cloned().collect();
    keys.extend(all["rules"].as_object().expect("rules").keys().map(|key| format!("rules.{key}")));
    let words = [
        "true",
        "false",
        "none",
        "box",
        "disc",
        "points",
        "manifold",
        "normals-first",
        "friction-first",
        "per-correction",
        "accumulated",
        "baumgarte",
        "soft",
        "auto",
        "sweeps",
        "direct",
        "all",
        "relax",
        "plain",
        "accelerated",
    ];
    let assignment = match setting {
        Setting::Real(key, value) => format!("{}={:?}", keys[usize::from(*key) % keys.len()], value.0),
        Setting::Whole(key, value) => format!("{}={value}", keys[usize::from(*key) % keys.len()]),
        Setting::Word(key, word) => {
            format!("{}={}", keys[usize::from(*key) % keys.len()], words[usize::from(*word) % words.len()])
        }
    };
    let mut changed = config.clone();
    good(settings::set(&mut changed, &assignment))?;
    changed.substeps = changed.substeps.min(8);
    changed.max_substeps = changed.max_substeps.min(16);
    changed.iterations = changed.iterations.min(8);
    changed.relax = changed.relax.min(4);
    Some(changed)
}

struct Game {
    runs: Runs,
    bodies: Vec<BodyHandle>,
    joints: Vec<JointHandle>,
    /// The world after the last accepted step.
    good: World,
    /// The numbers of bodies and joints that had a handle then.
    named: [usize; 2],
}

impl Game {
    fn body(&self, k: u8) -> Option<BodyHandle> {
        (!self.bodies.is_empty()).then(|| self.bodies[usize::from(k) % self.bodies.len()])
    }

    /// Makes a step. If the step is refused, its changes are undone, so that the run continues.
    fn step(&mut self, dt: f32) {
        if self.runs.step(dt) {
            self.good.clone_from(&self.runs.first().world);
            self.named = [self.bodies.len(), self.joints.len()];
        } else {
            let good = &self.good;
            self.runs.each(|simulation| simulation.world.clone_from(good));
            // Newer handles name nothing, and can occur again.
            self.bodies.truncate(self.named[0]);
            self.joints.truncate(self.named[1]);
        }
    }

    /// Changes a body of each simulation. The handle of a removed body names no body.
    fn change(&mut self, k: u8, mut change: impl FnMut(&mut drystone::Body)) {
        let Some(handle) = self.body(k) else { return };
        self.runs.each(|simulation| {
            if let Some(body) = simulation.world.body_mut(handle) {
                change(body);
            }
        });
    }

    fn call(&mut self, call: &Call) {
        match call {
            Call::Step => self.step(1.0 / 60.0),
            Call::Steps(count) => (0..count % 32).for_each(|_| self.step(1.0 / 60.0)),
            Call::StepOf(dt) => self.step(dt.0),
            Call::Insert(body, in_first) => {
                if self.bodies.len() < 2 * MAX_BODIES {
                    let (body, mut handles) = (body.body(), Vec::new());
                    self.runs.each(|simulation| {
                        let world = if *in_first { 0 } else { simulation.world.world_count() - 1 };
                        handles.push(simulation.world.insert_in(world, body.clone()).expect("a world"));
                    });
                    assert!(!self.bodies.contains(&handles[0]), "{:?} was another body before", handles[0]);
                    assert!(handles.windows(2).all(|pair| pair[0] == pair[1]), "handles differ: {handles:?}");
                    self.bodies.push(handles[0]);
                }
            }
            Call::Remove(k) => {
                let Some(handle) = self.body(*k) else { return };
                self.runs.each(|simulation| {
                    let was_there = simulation.world.body(handle).is_some();
                    assert_eq!(simulation.world.remove(handle).is_some(), was_there);
                    assert!(simulation.world.body(handle).is_none());
                });
            }
            Call::Put(k, at, turn) => {
                self.change(*k, |body| (body.position, body.rotation) = (at.vec(), turn.quat()));
            }
            Call::Push(k, force, torque) => self.change(*k, |body| {
                body.apply_force(force.vec());
                body.apply_torque(torque.vec());
            }),
            Call::Kick(k, v, w) => {
                self.change(*k, |body| (body.linear_velocity, body.angular_velocity) = (v.vec(), w.vec()));
            }
            Call::Kind(k, kind) => self.change(*k, |body| body.kind = kind.kind()),
            Call::Shape(k, shape) => {
                let Some(shape) = shape.shape() else { return };
                self.change(*k, |body| {
                    let whole = drystone::Body::dynamic().shape(shape.clone());
                    (body.colliders, body.mass) = (whole.colliders, whole.mass);
                });
            }
            Call::Mass(k, mass) => self.change(*k, |body| *body = mass.onto(body.clone())),
            Call::Surface(k, friction, restitution) => {
                let material = Material { friction: friction.0, restitution: restitution.0, ..Material::default() };
                self.change(*k, |body| body.material = material);
            }
            Call::Groups(k, membership, filter) => self.change(*k, |body| {
                body.groups = drystone::Groups { membership: (*membership).into(), filter: (*filter).into() };
            }),
            Call::GravityScale(k, scale) => self.change(*k, |body| body.gravity_scale = scale.0),
            Call::Join(joint) => {
                let [a, b] = joint.bodies.map(|k| self.body(k));
                let world = &self.runs.first().world;
                let is_there = |handle: &BodyHandle| world.body(*handle).is_some();
                let (Some(a), b) = (a.filter(is_there), b.filter(is_there)) else { return };
                let (joint, mut handles) = (joint.joint(a, b), Vec::new());
                self.runs.each(|simulation| handles.push(simulation.world.insert_joint(joint)));
                assert!(!self.joints.contains(&handles[0]), "{:?} was another joint before", handles[0]);
                self.joints.push(handles[0]);
            }
            Call::Part(k) => {
                let Some(&handle) = self.joints.get(usize::from(*k) % self.joints.len().max(1)) else { return };
                self.runs.each(|simulation| {
                    let was_there = simulation.world.joint(handle).is_some();
                    assert_eq!(simulation.world.remove_joint(handle).is_some(), was_there);
                });
            }
            Call::Set(setting) => {
                let Some(config) = set(self.runs.first().config(), setting) else { return };
                self.runs.all(|simulation| simulation.set_config(config.clone()));
            }
            Call::Reload => self.runs.reload(),
            Call::AndBack => self.runs.each(|simulation| {
                let then = simulation.snapshot();
                if let Err(error) = simulation.step(1.0 / 60.0) {
                    is_one_line(&error);
                }
                simulation.restore(&then);
            }),
            Call::Listen(speed, contacts, sums) => {
                let listen = Listen { contacts: *contacts, hits_above: speed.map(|speed| speed.0), impulses: *sums };
                self.runs.all(|simulation| simulation.listen(listen));
            }
            Call::Wake(k) => {
                let Some(handle) = self.body(*k) else { return };
                self.runs.each(|simulation| simulation.wake(handle));
            }
            Call::Ray(from, along, most) => {
                let queries = self.runs.first().queries();
                if let Some(hit) = queries.ray(from.vec(), along.vec(), most.0, &Filter::default()) {
                    assert!(hit.distance >= 0.0 && hit.distance <= most.0, "{hit:?} within {}", most.0);
                    assert!((hit.normal.length() - 1.0).abs() < 1e-3 && hit.point.is_finite(), "{hit:?}");
                }
            }
            Call::Cast(shape, from, turn, along, most) => {
                let Some(shape) = shape.shape() else { return };
                let queries = self.runs.first().queries();
                let (from, turn) = (from.vec(), turn.quat());
                if let Some(hit) = queries.cast(&shape, from, turn, along.vec(), most.0, &Filter::default()) {
                    assert!(hit.distance >= 0.0 && hit.distance <= most.0, "{hit:?} within {}", most.0);
                }
                drop(queries.intersecting(&shape, from, turn, &Filter::default()));
            }
            Call::Closest(point, most) => {
                let queries = self.runs.first().queries();
                if let Some(hit) = queries.closest(point.vec(), most.0, &Filter::default()) {
                    assert!(hit.distance <= most.0, "{hit:?} within {}", most.0);
                }
            }
            Call::Look => self.look(),
        }
    }

    /// Reads everything readable.
    fn look(&mut self) {
        let simulation = self.runs.first();
        for contact in simulation.contacts() {
            let [a, b] = [contact.a, contact.b].map(|side| simulation.world.body(side.body).is_some());
            assert!(a && b, "a contact of a body that is gone: {contact:?}");
        }
        for &joint in simulation.world.joints.handles() {
            let _ = (simulation.joint_impulse(joint), simulation.joint_force(joint));
        }
        let _ = (simulation.penetration(), simulation.solved_penetration());
        let _ = (simulation.world.kinetic_energy(), simulation.world.joint_gap(), simulation.manifolds().count());
    }
}

pub fn check(data: &[u8]) {
    let Ok(program) = Program::arbitrary_take_rest(Unstructured::new(data)) else { return };
    show(&program);
    play(&program);
}

fn play(program: &Program) {
    let mut world = World::new();
    let ordinary = world.gravity;
    world.gravity = program.gravity.map_or(ordinary, Vector::vec);
    if good(world.check()).is_none() {
        world.gravity = ordinary;
    }
    let mut bodies = Vec::new();
    for body in program.bodies.iter().take(MAX_BODIES) {
        let handle = world.insert(body.body());
        match good(world.check()) {
            Some(()) => bodies.push(handle),
            None => _ = world.remove(handle),
        }
    }
    for joint in program.joints.iter().take(MAX_BODIES).filter(|_| !bodies.is_empty()) {
        let [a, b] = joint.bodies.map(|k| bodies.get(usize::from(k) % (bodies.len() + 1)).copied());
        let handle = world.insert_joint(joint.joint(a.unwrap_or(bodies[0]), b));
        if good(world.check()).is_none() {
            world.remove_joint(handle);
        }
    }
    if program.worlds {
        let other = world.clone();
        world.beside(&other);
        bodies = world.bodies.handles().collect();
    }
    let config = SolverConfig::default().with(|c| c.max_substeps = 16);
    let config = program.settings.iter().take(4).fold(config, |config, s| set(&config, s).unwrap_or(config));
    let joints = world.joints.handles().to_vec();
    let Some(runs) = Runs::new(&world, &config) else { return };
    let named = [bodies.len(), joints.len()];
    let mut game = Game { runs, bodies, joints, good: world, named };
    program.calls.iter().take(MAX_CALLS).for_each(|call| game.call(call));
    game.step(1.0 / 60.0);
}

/// Random bytes are good seeds.
pub fn seeds() -> Vec<Vec<u8>> {
    let bytes = |seed: u32| {
        let mut state = seed;
        std::iter::repeat_with(move || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 24) as u8
        })
    };
    (1..=40).map(|seed| bytes(seed).take(64 * seed as usize % 1000 + 24).collect()).collect()
}
