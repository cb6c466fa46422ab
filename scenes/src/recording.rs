//! Recordings of runs and their replay.
//!
//! A recording begins with the state of a simulation. Each step adds its length and the caller's changes since the step
//! before. The recorder finds the changes by comparison, so it records every change, however the caller made it. At
//! intervals the recording adds a hash of all bodies, and a whole state to which a replay can jump.

use std::io::Write;

use drystone::stages::error::{ensure, input};
use drystone::stages::input::{InputReader, InputWriter, StepInput, hash_of, hashes};
use drystone::{Backend, BodyHandle, Error, Reference, Result, Simulation, StepStats, World};

/// How often a recording adds a hash of all bodies and a whole state (steps).
///
/// ```
/// use drystone_scenes::RecordingIntervals;
///
/// // A replay names the step and the body of the first difference.
/// let every_step = RecordingIntervals { hash: 1, ..RecordingIntervals::default() };
/// assert_eq!(every_step.state, 600);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RecordingIntervals {
    /// Steps from one hash to the next, 1 or more. With 1, a replay names the step and the body of the first
    /// difference.
    pub hash: u32,
    /// Steps from one state to the next, 1 or more.
    pub state: u32,
}

impl Default for RecordingIntervals {
    fn default() -> Self {
        Self { hash: 10, state: 600 }
    }
}

/// Records a simulation, step by step.
///
/// ```
/// use drystone::{Body, Cpu, Shape, Simulation, World};
/// use drystone_scenes::{Recorder, RecordingIntervals, Replay};
///
/// let mut world = World::new();
/// world.insert(Body::fixed().shape(Shape::half_space(glam::Vec3::Y)));
/// let ball = world.insert(Body::dynamic().shape(Shape::ball(0.5)).position(0.0, 2.0, 0.0));
/// let mut simulation = Simulation::new(world)?;
/// let mut recorder = Recorder::new(Vec::new(), "a ball", &mut simulation, RecordingIntervals::default())?;
/// for step in 0..40 {
///     if step == 20 {
///         simulation.world.body_mut(ball).expect("the ball").linear_velocity.x = 3.0;
///     }
///     recorder.step(&mut simulation, 1.0 / 60.0)?;
/// }
/// let bytes = recorder.finish()?;
/// let mut replay = Replay::read(&bytes)?;
/// let mut again = replay.begin(Box::new(Cpu::new()))?;
/// replay.seek(&mut again, 40)?;
/// assert_eq!(again.hash(), simulation.hash());
/// assert!(replay.first_difference().is_none());
/// # Ok::<(), drystone::Error>(())
/// ```
pub struct Recorder<W: Write> {
    out: W,
    intervals: RecordingIntervals,
    /// The state after the last step.
    inputs: InputWriter,
    steps: u32,
}

/// The first bytes of a recording.
const MAGIC: [u8; 8] = *b"drystrec";
/// The format version. It grows with every change of the format.
const VERSION: u32 = 4;
/// Size of the header of a part (bytes): its kind, its length and its hash.
const PART: usize = 1 + 8 + 8;

/// The kinds of parts.
const TITLE: u8 = 0;
const STATE: u8 = 1;
const STEP: u8 = 2;
const END: u8 = 3;
/// A state that the caller restored or loaded before the next step.
const JUMP: u8 = 4;

impl<W: Write> Recorder<W> {
    /// Starts a recording with a title, from the state of a simulation.
    ///
    /// # Errors
    /// The writer fails.
    pub fn new(out: W, title: &str, simulation: &mut Simulation, intervals: RecordingIntervals) -> Result<Self> {
        let mut recorder = Self { out, intervals, inputs: InputWriter::new(simulation), steps: 0 };
        recorder.write(&MAGIC)?;
        recorder.write(&VERSION.to_le_bytes())?;
        recorder.part(TITLE, title.as_bytes())?;
        recorder.part(STATE, &simulation.save())?;
        Ok(recorder)
    }

    /// Steps the simulation, and records the caller's changes since the last step. If the caller stepped, restored,
    /// loaded or replaced the simulation since, it records the whole state.
    ///
    /// # Errors
    /// Those of [`Simulation::step`], after which the recording has no trace of the step; or the writer fails.
    pub fn step(&mut self, simulation: &mut Simulation, dt: f32) -> Result<StepStats> {
        let record = self.begin_step(simulation, dt)?;
        let stats = simulation.step(dt)?;
        self.end_step(record, simulation)?;
        Ok(stats)
    }

    /// Like [`Self::step`], for a web page ([`Simulation::step_async`]).
    ///
    /// ```
    /// # use drystone::{Body, Cpu, Shape, Simulation, World};
    /// # use drystone_scenes::{Recorder, RecordingIntervals, Replay};
    /// # let mut world = World::new();
    /// # world.insert(Body::dynamic().shape(Shape::ball(0.5)));
    /// # let mut simulation = Simulation::new(world)?;
    /// # pollster::block_on(async {
    /// let mut recorder = Recorder::new(Vec::new(), "a fall", &mut simulation, RecordingIntervals::default())?;
    /// for _ in 0..10 {
    ///     recorder.step_async(&mut simulation, 0.01).await?;
    /// }
    /// let mut replay = Replay::read(&recorder.finish()?)?;
    /// let mut again = replay.begin(Box::new(Cpu::new()))?;
    /// while replay.step_async(&mut again).await?.is_some() {}
    /// assert!(again.hash() == simulation.hash() && replay.first_difference().is_none());
    /// # Ok::<(), drystone::Error>(())
    /// # })?;
    /// # Ok::<(), drystone::Error>(())
    /// ```
    ///
    /// # Errors
    /// Those of [`Simulation::step_async`], after which the recording has no trace of the step; or the writer fails.
    pub async fn step_async(&mut self, simulation: &mut Simulation, dt: f32) -> Result<StepStats> {
        let record = self.begin_step(simulation, dt)?;
        let stats = simulation.step_async(dt).await?;
        self.end_step(record, simulation)?;
        Ok(stats)
    }

    /// The caller's changes since the last step.
    fn begin_step(&mut self, simulation: &mut Simulation, dt: f32) -> Result<StepInput> {
        if self.inputs.is_behind(simulation) {
            self.part(JUMP, &simulation.save())?;
            self.inputs.follow(simulation);
        }
        Ok(self.inputs.changes(simulation, dt))
    }

    /// Writes a completed step.
    fn end_step(&mut self, mut input: StepInput, simulation: &mut Simulation) -> Result<()> {
        self.steps += 1;
        input.hash = (self.steps.is_multiple_of(self.intervals.hash)).then(|| hashes(&simulation.world.bodies));
        let bytes = self.inputs.write(&mut input)?;
        self.part(STEP, &bytes)?;
        if self.steps.is_multiple_of(self.intervals.state) {
            self.part(STATE, &simulation.save())?;
        }
        self.inputs.follow(simulation);
        Ok(())
    }

    /// Ends the recording with the hash of the last state.
    ///
    /// # Errors
    /// The writer fails.
    pub fn finish(mut self) -> Result<W> {
        write_end(&mut self.out, self.inputs.world())?;
        self.out.flush().map_err(Error::file("recording"))?;
        Ok(self.out)
    }

    fn part(&mut self, kind: u8, bytes: &[u8]) -> Result<()> {
        write_part(&mut self.out, kind, bytes)
    }

    fn write(&mut self, bytes: &[u8]) -> Result<()> {
        self.out.write_all(bytes).map_err(Error::file("recording"))
    }
}

impl Recorder<Vec<u8>> {
    /// The bytes that are written so far, without the end.
    pub fn so_far(&self) -> &[u8] {
        &self.out
    }

    /// A complete copy of the recording up to now. The recorder can go on.
    ///
    /// ```
    /// # use drystone::{Body, Cpu, Shape, Simulation, World};
    /// # use drystone_scenes::{Recorder, RecordingIntervals, Replay};
    /// # let mut world = World::new();
    /// # world.insert(Body::dynamic().shape(Shape::ball(0.5)));
    /// # let mut simulation = Simulation::new(world)?;
    /// let mut recorder = Recorder::new(Vec::new(), "a fall", &mut simulation, RecordingIntervals::default())?;
    /// (0..5).try_for_each(|_| recorder.step(&mut simulation, 0.01).map(drop))?;
    /// let (half, hash) = (recorder.ended()?, simulation.hash());
    /// (0..5).try_for_each(|_| recorder.step(&mut simulation, 0.01).map(drop))?;
    /// assert!(recorder.so_far().len() > half.len());
    /// let mut replay = Replay::read(&half)?;
    /// let mut again = replay.begin(Box::new(Cpu::new()))?;
    /// replay.seek(&mut again, 9)?;
    /// assert_eq!((replay.len(), again.hash(), replay.first_difference()), (5, hash, None));
    /// assert_eq!(Replay::read(&recorder.finish()?)?.len(), 10);
    /// # Ok::<(), drystone::Error>(())
    /// ```
    ///
    /// # Errors
    /// Those of [`Recorder::finish`]; writing to memory never fails.
    pub fn ended(&self) -> Result<Vec<u8>> {
        let mut all = self.out.clone();
        write_end(&mut all, self.inputs.world())?;
        Ok(all)
    }
}

fn write_part(out: &mut impl Write, kind: u8, bytes: &[u8]) -> Result<()> {
    let (length, hash) = ((bytes.len() as u64).to_le_bytes(), hash_of(bytes).to_le_bytes());
    let mut write = |bytes: &[u8]| out.write_all(bytes).map_err(Error::file("recording"));
    write(&[kind])?;
    write(&length)?;
    write(&hash)?;
    write(bytes)
}

/// Ends a recording with the hash of the last state.
fn write_end(out: &mut impl Write, world: &World) -> Result<()> {
    let (hash, bodies) = hashes(&world.bodies);
    write_part(out, END, &[&hash.to_le_bytes()[..], &bodies].concat())
}

/// The first difference between a replay and its recording.
///
/// ```
/// # use drystone::{Body, Cpu, Shape, Simulation, World};
/// # use drystone_scenes::{Recorder, RecordingIntervals, Replay};
/// # let mut world = World::new();
/// # world.insert(Body::dynamic().shape(Shape::ball(0.5)));
/// # let mut simulation = Simulation::new(world)?;
/// # let intervals = RecordingIntervals { hash: 1, state: 4 };
/// # let mut recorder = Recorder::new(Vec::new(), "a fall", &mut simulation, intervals)?;
/// # let mut hashes = Vec::new();
/// # for _ in 0..10 {
/// #     recorder.step(&mut simulation, 0.01)?;
/// #     hashes.push(simulation.hash());
/// # }
/// # let bytes = recorder.finish()?;
/// let mut replay = Replay::read(&bytes)?;
/// let mut again = replay.begin(Box::new(Cpu::new()))?;
/// replay.seek(&mut again, 6)?;
/// // Disturb the replay.
/// again.world.bodies[0].linear_velocity.x = 1.0;
/// replay.step(&mut again)?;
/// let difference: drystone_scenes::ReplayDifference = replay.first_difference().expect("the bodies differ");
/// let first = again.world.bodies.handle(0);
/// assert_eq!((difference.step, difference.agreed, difference.body, difference.bodies), (7, 6, first, 1));
/// # let _ = hashes;
/// # Ok::<(), drystone::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct ReplayDifference {
    /// The step after which the hashes differ, counted from 1.
    pub step: u32,
    /// The last earlier step after which the hashes agreed; 0 for the beginning.
    pub agreed: u32,
    /// The first body that differs, or `None` if the short hashes of the bodies all agree. Written as its index.
    pub body: Option<BodyHandle>,
    /// Lower bound on the number of bodies that differ.
    pub bodies: usize,
}

/// A whole state of a recording.
struct KeptState {
    /// The number of steps before it.
    step: u32,
    /// Whether the caller jumped to this state, so that the step before did not lead to it.
    is_jump: bool,
    bytes: Vec<u8>,
}

/// Replays a recording in a simulation of the caller.
///
/// ```
/// # use drystone::{Body, Cpu, Shape, Simulation, World};
/// # use drystone_scenes::{Recorder, RecordingIntervals, Replay};
/// # let mut world = World::new();
/// # world.insert(Body::dynamic().shape(Shape::ball(0.5)));
/// # let mut simulation = Simulation::new(world)?;
/// # let intervals = RecordingIntervals { hash: 1, state: 4 };
/// # let mut recorder = Recorder::new(Vec::new(), "a fall", &mut simulation, intervals)?;
/// # let mut hashes = Vec::new();
/// # for _ in 0..10 {
/// #     recorder.step(&mut simulation, 0.01)?;
/// #     hashes.push(simulation.hash());
/// # }
/// # let bytes = recorder.finish()?;
/// assert!(Replay::is_recording(&bytes));
/// let mut replay = Replay::read(&bytes)?;
/// assert_eq!((replay.title(), replay.len(), replay.is_empty(), replay.dt()), ("a fall", 10, false, Some(0.01)));
/// let mut again = replay.begin(Box::new(Cpu::new()))?;
/// while replay.step(&mut again)?.is_some() {}
/// assert!(again.hash() == hashes[9] && replay.first_difference().is_none());
/// // Go back to the fifth step, from the nearest earlier state.
/// replay.seek(&mut again, 5)?;
/// assert_eq!((again.hash(), replay.step_number()), (hashes[4], 5));
/// assert!((replay.time() - 0.05).abs() < 1e-6);
/// # Ok::<(), drystone::Error>(())
/// ```
pub struct Replay {
    title: String,
    /// Sorted by step.
    states: Vec<KeptState>,
    steps: Vec<StepInput>,
    step: u32,
    agreed: u32,
    difference: Option<ReplayDifference>,
}

impl Replay {
    /// Whether the bytes begin like a recording.
    pub fn is_recording(bytes: &[u8]) -> bool {
        bytes.starts_with(&MAGIC)
    }

    /// A replay of a recording, before its first step.
    ///
    /// # Errors
    /// The bytes are not a recording, have another version, or are damaged or cut short.
    pub fn read(bytes: &[u8]) -> Result<Self> {
        Self::read_parts(bytes).map_err(|error| error.within("the recording cannot be replayed"))
    }

    fn read_parts(bytes: &[u8]) -> Result<Self> {
        let cut_short = || input!("cut short");
        let rest = bytes.strip_prefix(&MAGIC).ok_or_else(|| input!("these bytes are not a recording"))?;
        let (version, mut rest) = rest.split_first_chunk::<4>().ok_or_else(cut_short)?;
        let version = u32::from_le_bytes(*version);
        ensure(version == VERSION, || format!("it has version {version}, but this program reads version {VERSION}"))?;
        let (mut title, mut states, mut steps) = (String::new(), Vec::<KeptState>::new(), Vec::<StepInput>::new());
        let mut reader = InputReader::default();
        loop {
            let (header, after) = rest.split_first_chunk::<PART>().ok_or_else(cut_short)?;
            let number = |from: usize| u64::from_le_bytes(std::array::from_fn(|k| header[from + k]));
            let length = usize::try_from(number(1)).unwrap_or(usize::MAX);
            let (part, after) = after.split_at_checked(length).ok_or_else(cut_short)?;
            let place = || format!("step {}: damaged", steps.len());
            ensure(number(9) == hash_of(part), place)?;
            rest = after;
            match header[0] {
                TITLE => title = String::from_utf8_lossy(part).into_owned(),
                kind @ (STATE | JUMP) => {
                    states.push(KeptState { step: steps.len() as u32, is_jump: kind == JUMP, bytes: part.to_vec() });
                }
                STEP => {
                    steps.push(reader.read(part)?);
                }
                END => {
                    let (hash, bodies) = part.split_first_chunk::<8>().ok_or_else(cut_short)?;
                    if let Some(last) = steps.last_mut() {
                        last.hash = Some((u64::from_le_bytes(*hash), bodies.to_vec()));
                    }
                    break;
                }
                kind => return Err(input!("unknown kind of part: {kind}")),
            }
        }
        ensure(rest.is_empty(), || "it has bytes after its end".into())?;
        let begins = states.first().is_some_and(|state| state.step == 0 && !state.is_jump);
        ensure(begins, || "it has no state at step 0".into())?;
        Ok(Self { title, states, steps, step: 0, agreed: 0, difference: None })
    }

    /// Goes to the beginning, in a new simulation.
    ///
    /// # Errors
    /// The first state is damaged.
    pub fn begin(&mut self, backend: Box<dyn Backend>) -> Result<Simulation> {
        (self.step, self.agreed, self.difference) = (0, 0, None);
        Simulation::load(&self.states[0].bytes, backend)
    }

    /// The title of the recording.
    pub fn title(&self) -> &str {
        &self.title
    }

    /// The number of steps.
    pub fn len(&self) -> u32 {
        self.steps.len() as u32
    }

    /// Whether the recording has no steps.
    pub fn is_empty(&self) -> bool {
        self.steps.is_empty()
    }

    /// The number of steps that are replayed so far.
    pub fn step_number(&self) -> u32 {
        self.step
    }

    /// Simulated time so far (s).
    pub fn time(&self) -> f64 {
        self.steps[..self.step as usize].iter().map(|step| f64::from(step.dt)).sum()
    }

    /// Length of the next step, or of the last one at the end (s); `None` without steps.
    pub fn dt(&self) -> Option<f32> {
        self.steps.get(self.step as usize).or(self.steps.last()).map(|step| step.dt)
    }

    /// The first difference from the recording, within the steps that are replayed so far.
    pub fn first_difference(&self) -> Option<ReplayDifference> {
        self.difference
    }

    /// Replays the next step in the simulation that the replay began. The caller must not change that simulation.
    /// Returns `None` at the end.
    ///
    /// # Errors
    /// Those of [`Simulation::step`].
    pub fn step(&mut self, simulation: &mut Simulation) -> Result<Option<StepStats>> {
        let Some(dt) = self.begin_step(simulation)? else { return Ok(None) };
        let stats = simulation.step(dt)?;
        self.end_step(simulation);
        Ok(Some(stats))
    }

    /// Like [`Self::step`], for a web page ([`Simulation::step_async`]). [`Recorder::step_async`] has an example.
    ///
    /// # Errors
    /// Those of [`Simulation::step_async`].
    pub async fn step_async(&mut self, simulation: &mut Simulation) -> Result<Option<StepStats>> {
        let Some(dt) = self.begin_step(simulation)? else { return Ok(None) };
        let stats = simulation.step_async(dt).await?;
        self.end_step(simulation);
        Ok(Some(stats))
    }

    /// Makes the caller's changes before the next step. Returns the length of that step (s), or `None` at the end.
    fn begin_step(&mut self, simulation: &mut Simulation) -> Result<Option<f32>> {
        if self.step == self.len() {
            return Ok(None);
        }
        if let Some(state) = self.states.iter().position(|state| state.step == self.step && state.is_jump) {
            self.load(simulation, state)?;
        }
        let input = &self.steps[self.step as usize];
        input.make(simulation)?;
        Ok(Some(input.dt))
    }

    /// Compares the bodies after a completed step.
    fn end_step(&mut self, simulation: &Simulation) {
        let input = &self.steps[self.step as usize];
        self.step += 1;
        if let Some((hash, bodies)) = &input.hash {
            let own = hashes(&simulation.world.bodies);
            if *hash == own.0 {
                self.agreed = self.agreed.max(self.step);
            } else if self.difference.is_none_or(|known| known.step > self.step) {
                let own = simulation.world.bodies.handles().zip(own.1.iter().zip(bodies));
                let differ: Vec<BodyHandle> = own.filter(|(_, (a, b))| a != b).map(|(body, _)| body).collect();
                let (step, agreed) = (self.step, self.agreed);
                self.difference =
                    Some(ReplayDifference { step, agreed, body: differ.first().copied(), bodies: differ.len().max(1) });
            }
        }
    }

    /// Goes to the state after `step` steps, or to the end. It starts from the nearest earlier state in the recording.
    ///
    /// # Errors
    /// Those of [`Simulation::step`].
    pub fn seek(&mut self, simulation: &mut Simulation, step: u32) -> Result<()> {
        let step = self.near(simulation, step)?;
        while self.step < step {
            self.step(simulation)?;
        }
        Ok(())
    }

    /// Like [`Self::seek`], for a web page.
    ///
    /// ```
    /// use drystone::{Body, Cpu, Shape, Simulation, World};
    /// use drystone_scenes::{Recorder, RecordingIntervals, Replay};
    ///
    /// let mut world = World::new();
    /// world.insert(Body::dynamic().shape(Shape::ball(0.5)));
    /// let mut simulation = Simulation::new(world)?;
    /// let mut recorder = Recorder::new(Vec::new(), "a ball", &mut simulation, RecordingIntervals::default())?;
    /// recorder.step(&mut simulation, 0.01)?;
    /// let after_one = simulation.hash();
    /// recorder.step(&mut simulation, 0.01)?;
    /// let mut replay = Replay::read(&recorder.finish()?)?;
    /// let mut again = replay.begin(Box::new(Cpu::new()))?;
    /// pollster::block_on(replay.seek_async(&mut again, 1))?;
    /// assert_eq!((again.hash(), replay.step_number()), (after_one, 1));
    /// # Ok::<(), drystone::Error>(())
    /// ```
    ///
    /// # Errors
    /// Those of [`Simulation::step_async`].
    pub async fn seek_async(&mut self, simulation: &mut Simulation, step: u32) -> Result<()> {
        let step = self.near(simulation, step)?;
        while self.step < step {
            self.step_async(simulation).await?;
        }
        Ok(())
    }

    /// Loads the last recorded state before a step, unless the present state is nearer. Returns the step, at most the
    /// last one.
    fn near(&mut self, simulation: &mut Simulation, step: u32) -> Result<u32> {
        let step = step.min(self.len());
        let nearest = self.states.iter().rposition(|state| state.step <= step && !state.is_jump);
        let nearest = nearest.expect("a recording begins with a state");
        if step < self.step || self.states[nearest].step > self.step {
            self.load(simulation, nearest)?;
        }
        Ok(step)
    }

    /// Loads a recorded state.
    fn load(&mut self, simulation: &mut Simulation, state: usize) -> Result<()> {
        let backend = simulation.set_backend(Box::new(Reference::<f32>::new()));
        *simulation = Simulation::load(&self.states[state].bytes, backend)?;
        self.step = self.states[state].step;
        Ok(())
    }
}
