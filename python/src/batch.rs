//! Many worlds.

use std::cell::RefCell;
use std::sync::{Mutex, MutexGuard, PoisonError};

use drystone::backend::{BackendChoice, choose};
use drystone::batch::{Column, Contacts, EventRow, Member, Run, write};
use drystone::glam::Vec3;
use drystone::queries::Filter;
use drystone::{Listen, Result as Outcome, SolverConfig, World};
use drystone_problems::batch::Measure;
use drystone_view::Look;
use numpy::ndarray::{Array2, Array3};
use numpy::{
    IntoPyArray, PyArray1, PyArray2, PyArray3, PyReadonlyArray1, PyReadonlyArray3, PyReadwriteArray1,
    PyReadwriteArray2, PyReadwriteArray3,
};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyBytes;

use crate::columns::{InputParts, Inputs, Named, OutputParts, Outputs, Record, RecordArray, parts};
use crate::picture::picture;
use crate::raised;
use crate::scene::{Config, Scene};

/// An immutable state of a world.
#[pyclass(frozen, module = "drystone._drystone")]
pub struct State(drystone::batch::State);

#[pymethods]
impl State {
    #[staticmethod]
    fn load(py: Python<'_>, data: &[u8]) -> PyResult<Self> {
        py.detach(|| drystone::batch::State::load(data)).map(Self).map_err(raised)
    }

    fn save<'py>(&self, py: Python<'py>) -> Bound<'py, PyBytes> {
        let bytes = py.detach(|| self.0.save());
        PyBytes::new(py, &bytes)
    }

    #[getter]
    fn steps(&self) -> u64 {
        self.0.steps()
    }

    #[getter]
    fn time(&self) -> f64 {
        self.0.time()
    }

    #[getter]
    fn hash(&self) -> u64 {
        self.0.hash()
    }

    /// Numbers of bodies, joints and drives.
    #[getter]
    fn sizes(&self) -> [usize; 3] {
        [Column::Position, Column::JointSpeed, Column::Control].map(|column| column.rows(self.0.world()))
    }
}

/// Many worlds. Python has already checked the arguments.
#[pyclass(frozen, module = "drystone._drystone")]
pub struct Batch(Mutex<drystone::batch::Batch>);

/// Data of a world during a run.
struct Task<'a> {
    inputs: InputParts<'a>,
    outputs: OutputParts<'a>,
    /// Values of all drives for each step, or for all steps.
    ctrl: Option<&'a [f32]>,
    records: Vec<Record<'a>>,
}

/// Indices of worlds, and arrays of another kind of numbers.
type Worlds<'py> = PyReadonlyArray1<'py, i64>;
/// World, kind, bodies (-1 for none) and value.
type Event = (u32, &'static str, i64, i64, f32);
/// Bodies, normals and impulses, and the starts of the contacts of each world and of the points of each contact.
type ContactArrays<'py> = (
    Bound<'py, PyArray1<u32>>,
    Bound<'py, PyArray2<u32>>,
    Bound<'py, PyArray2<f32>>,
    Bound<'py, PyArray2<f32>>,
    Bound<'py, PyArray1<u32>>,
    Bound<'py, PyArray2<f32>>,
    Bound<'py, PyArray1<f32>>,
    Bound<'py, PyArray1<f32>>,
);

#[pymethods]
impl Batch {
    /// A world for each scene, or `count` worlds of one scene with one setting.
    #[staticmethod]
    fn of_scenes(
        py: Python<'_>,
        scenes: Vec<Py<Scene>>,
        configs: Vec<Py<Config>>,
        count: usize,
        threads: usize,
        gpu: Option<bool>,
    ) -> PyResult<Self> {
        let all: Vec<_> =
            scenes.iter().zip(&configs).map(|(scene, config)| (&scene.get().0, &config.get().0)).collect();
        made(py, threads, gpu, || match all[..] {
            [(scene, config)] => drystone::batch::Batch::of(scene.constant_world()?, scene.dt, config, count),
            _ => {
                let mut worlds = Vec::new();
                for (k, (scene, config)) in all.iter().enumerate() {
                    let world = scene.constant_world().map_err(|error| error.within(format_args!("world {k}")))?;
                    worlds.push((world, scene.dt, SolverConfig::clone(config)));
                }
                drystone::batch::Batch::new(worlds)
            }
        })
    }

    #[staticmethod]
    fn of_states(py: Python<'_>, states: Vec<Py<State>>, threads: usize, gpu: Option<bool>) -> PyResult<Self> {
        made(py, threads, gpu, || drystone::batch::Batch::of_states(states.iter().map(|state| state.get().0.clone())))
    }

    /// Number of worlds, and the largest numbers of bodies, joints and drives of a world.
    fn sizes(&self) -> (usize, usize, usize, usize) {
        let batch = self.lock();
        let most = |column: Column| {
            batch.worlds().iter().map(|member| column.rows(&member.simulation().world)).max().unwrap_or(0)
        };
        (batch.len(), most(Column::Position), most(Column::JointSpeed), most(Column::Control))
    }

    #[getter]
    fn backend(&self) -> &'static str {
        self.lock().backend()
    }

    #[getter]
    fn fault(&self) -> Option<String> {
        self.lock().fault().map(str::to_owned)
    }

    #[getter]
    fn threads(&self) -> usize {
        self.lock().threads()
    }

    fn listen(&self, contacts: bool, impulses: bool, hits_above: Option<f32>) -> PyResult<()> {
        let listen = Listen { contacts, impulses, hits_above };
        let mut batch = self.lock();
        let mut worlds = batch.worlds_mut().iter_mut();
        worlds.try_for_each(|world| world.simulation_mut().listen(listen)).map_err(raised)
    }

    /// Steps worlds. Returns the failed worlds with their errors.
    #[allow(clippy::too_many_arguments)]
    fn run(
        &self,
        py: Python<'_>,
        steps: u64,
        every: u64,
        worlds: Worlds<'_>,
        dt: Option<f32>,
        inputs: Vec<Named<'_>>,
        outputs: Vec<Named<'_>>,
        ctrl: Option<PyReadonlyArray3<'_, f32>>,
        records: Vec<(String, Bound<'_, PyAny>)>,
    ) -> PyResult<Vec<(usize, String)>> {
        let chosen = indices(&worlds)?;
        let (inputs, mut outputs) = (Inputs::new(&inputs)?, Outputs::new(&outputs)?);
        let mut records = RecordArray::all(&records)?;
        let count = self.lock().len();
        let mut of_worlds: Vec<Vec<Record>> = chosen.iter().map(|_| Vec::new()).collect();
        for array in &mut records {
            array.cut(chosen.len())?.into_iter().zip(&mut of_worlds).for_each(|(record, own)| own.push(record));
        }
        let ctrl = ctrl.as_ref().map(|ctrl| ctrl.as_slice()).transpose()?;
        let of_ctrl = |k: usize| {
            ctrl.map(|all| {
                let each = all.len() / chosen.len().max(1);
                &all[k * each..(k + 1) * each]
            })
        };
        let arrays = inputs.cut(count, &chosen)?.into_iter().zip(outputs.cut(count, &chosen)?).zip(of_worlds);
        let tasks = arrays.zip(&chosen).enumerate().map(|(k, (((inputs, outputs), records), &world))| {
            (world, Task { inputs, outputs, ctrl: of_ctrl(k), records })
        });
        let tasks: Vec<_> = tasks.collect();
        let (ran, interrupt) = py.detach(|| {
            let signal = RefCell::new(None);
            let stop = || Python::attach(|py| py.check_signals()).map_err(|e| signal.replace(Some(e))).is_err();
            let run = Run { steps, dt, stop: Some(&stop) };
            let mut batch = self.lock();
            let before = |task: &Task, step, world: &mut World| task.before(step, steps, world);
            let failed = batch.run(run, tasks, before, |task, step, member| task.after(step, steps, every, member));
            let why = |k: usize| (k, batch.world(k).error().unwrap_or_default().to_owned());
            (failed.map(|failed| failed.into_iter().map(why).collect()), signal.into_inner())
        });
        match interrupt {
            Some(interrupt) => Err(interrupt),
            None => ran.map_err(raised),
        }
    }

    /// Reads columns of worlds.
    fn read(&self, py: Python<'_>, worlds: Worlds<'_>, arrays: Vec<Named<'_>>) -> PyResult<()> {
        let chosen = indices(&worlds)?;
        let mut arrays = Outputs::new(&arrays)?;
        let count = self.lock().len();
        let tasks: Vec<_> = chosen.iter().copied().zip(arrays.cut(count, &chosen)?).collect();
        self.each(py, tasks, |own, member| own.iter_mut().for_each(|(column, numbers)| member.read(*column, numbers)))
    }

    /// Writes a column of worlds, from an array with a row for each chosen world.
    fn write(&self, py: Python<'_>, worlds: Worlds<'_>, name: &str, values: PyReadonlyArray3<'_, f32>) -> PyResult<()> {
        let chosen = indices(&worlds)?;
        let column: Column = name.parse().map_err(raised)?;
        let numbers = values.as_slice()?;
        let each = numbers.len() / chosen.len().max(1);
        let rows = (0..chosen.len()).map(|k| &numbers[k * each..(k + 1) * each]);
        let mut tasks: Vec<_> = chosen.iter().copied().zip(rows.map(|row| (row, Ok(())))).collect();
        py.detach(|| {
            let borrowed = tasks.iter_mut().map(|(world, own)| (*world, own)).collect();
            self.lock().each(borrowed, |own, member| own.1 = member.write(column, own.0))
        })
        .map_err(raised)?;
        tasks.into_iter().try_for_each(|(_, (_, written))| written).map_err(raised)
    }

    /// Applies impulses to all bodies of worlds, each at a point, or at the center of mass if the point is NaN.
    fn apply_impulse(
        &self,
        py: Python<'_>,
        worlds: Worlds<'_>,
        impulse: PyReadonlyArray3<'_, f32>,
        at: PyReadonlyArray3<'_, f32>,
    ) -> PyResult<()> {
        let chosen = indices(&worlds)?;
        let (impulse, at) = (impulse.as_slice()?, at.as_slice()?);
        let each = impulse.len() / chosen.len().max(1);
        let part = |k: usize| (&impulse[k * each..(k + 1) * each], &at[k * each..(k + 1) * each]);
        let tasks = chosen.iter().enumerate().map(|(k, &world)| (world, part(k))).collect();
        self.each(py, tasks, |(impulses, points), member| {
            let bodies = member.simulation_mut().world.bodies.iter_mut();
            for ((body, impulse), at) in bodies.zip(impulses.chunks_exact(3)).zip(points.chunks_exact(3)) {
                let [impulse, at] = [impulse, at].map(Vec3::from_slice);
                if impulse != Vec3::ZERO {
                    let at = if at.is_nan() { body.center_of_mass() } else { at };
                    body.apply_impulse_at(impulse, at);
                }
            }
        })
    }

    /// Red, green and blue of the pixels of a world; angles of the camera in radians.
    fn picture<'py>(
        &self,
        py: Python<'py>,
        world: usize,
        size: (u32, u32),
        yaw: f32,
        pitch: f32,
    ) -> PyResult<Bound<'py, PyArray3<u8>>> {
        let pixels = py.detach(|| {
            let world = self.lock().world(world).simulation().world.clone();
            picture(&world, size, Look { yaw, pitch })
        });
        let pixels = Array3::from_shape_vec((size.1 as usize, size.0 as usize, 3), pixels.map_err(raised)?);
        pixels.map(|pixels| pixels.into_pyarray(py)).map_err(|error| PyValueError::new_err(error.to_string()))
    }

    fn reset(&self, py: Python<'_>, worlds: Worlds<'_>) -> PyResult<()> {
        let chosen = indices(&worlds)?;
        py.detach(|| self.lock().reset(&chosen)).map_err(raised)
    }

    fn states(&self, py: Python<'_>, worlds: Worlds<'_>) -> PyResult<Vec<State>> {
        let chosen = indices(&worlds)?;
        let mut states: Vec<Option<State>> = chosen.iter().map(|_| None).collect();
        let tasks = chosen.iter().copied().zip(&mut states).collect();
        self.each(py, tasks, |own, member| **own = Some(State(member.state())))?;
        Ok(states.into_iter().flatten().collect())
    }

    /// Restores a state for each world.
    fn restore(&self, py: Python<'_>, worlds: Worlds<'_>, states: Vec<Py<State>>) -> PyResult<()> {
        let chosen = indices(&worlds)?;
        let states: Vec<&drystone::batch::State> = states.iter().map(|state| &state.get().0).collect();
        py.detach(|| {
            let mut batch = self.lock();
            chosen.iter().zip(states).try_for_each(|(&world, state)| batch.restore(world, state))
        })
        .map_err(raised)
    }

    /// The states of worlds as bytes.
    fn save<'py>(&self, py: Python<'py>, worlds: Worlds<'_>) -> PyResult<Vec<Bound<'py, PyBytes>>> {
        let chosen = indices(&worlds)?;
        let mut all: Vec<Vec<u8>> = vec![Vec::new(); chosen.len()];
        let tasks = chosen.iter().copied().zip(&mut all).collect();
        self.each(py, tasks, |own, member| **own = member.state().save())?;
        Ok(all.iter().map(|bytes| PyBytes::new(py, bytes)).collect())
    }

    fn hash<'py>(&self, py: Python<'py>, worlds: Worlds<'_>) -> PyResult<Bound<'py, PyArray1<u64>>> {
        let chosen = indices(&worlds)?;
        let mut all = vec![0; chosen.len()];
        let tasks = chosen.iter().copied().zip(&mut all).collect();
        self.each(py, tasks, |own, member| **own = member.hash())?;
        Ok(PyArray1::from_vec(py, all))
    }

    /// Writes the step counts and times of all worlds.
    fn clocks(&self, mut steps: PyReadwriteArray1<'_, u64>, mut time: PyReadwriteArray1<'_, f64>) -> PyResult<()> {
        let batch = self.lock();
        let all = batch.worlds().iter().zip(steps.as_slice_mut()?).zip(time.as_slice_mut()?);
        all.for_each(|((member, steps), time)| (*steps, *time) = (member.steps(), member.time()));
        Ok(())
    }

    /// Which bodies exist, which sleep, and the substeps of each.
    fn bodies(
        &self,
        mut exists: PyReadwriteArray2<'_, bool>,
        mut asleep: PyReadwriteArray2<'_, bool>,
        mut substeps: PyReadwriteArray2<'_, u32>,
    ) -> PyResult<()> {
        let batch = self.lock();
        let each = exists.as_slice()?.len() / batch.len();
        let columns = exists.as_slice_mut()?.iter_mut().zip(asleep.as_slice_mut()?).zip(substeps.as_slice_mut()?);
        for (k, ((exists, asleep), substeps)) in columns.enumerate() {
            let (simulation, body) = (batch.world(k / each).simulation(), k % each);
            let body = simulation.world.bodies.handle(body);
            *exists = body.is_some();
            *asleep = body.is_some_and(|body| simulation.is_asleep(body));
            *substeps = body.map_or(0, |body| simulation.substeps_of(body));
        }
        Ok(())
    }

    fn measure<'py>(
        &self,
        py: Python<'py>,
        worlds: Worlds<'_>,
        names: Vec<String>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let chosen = indices(&worlds)?;
        let measures: Vec<Measure> = names.iter().map(|name| name.parse()).collect::<Outcome<_>>().map_err(raised)?;
        let mut all = vec![0.0; chosen.len() * measures.len()];
        let tasks = chosen.iter().copied().zip(parts(&mut all, chosen.len())).collect();
        self.each(py, tasks, |own, member| Measure::values_into(&measures, member, own))?;
        table(py, all, measures.len())
    }

    fn contacts<'py>(&self, py: Python<'py>, worlds: Worlds<'_>) -> PyResult<ContactArrays<'py>> {
        let chosen = indices(&worlds)?;
        let all = py.detach(|| self.lock().contacts(&chosen)).map_err(raised)?;
        let Contacts { world_start, bodies, normal, impulse, point_start, point, separation, point_impulse } = all;
        Ok((
            PyArray1::from_vec(py, world_start),
            table(py, bodies.into_flattened(), 2)?,
            table(py, normal.into_flattened(), 3)?,
            table(py, impulse.into_flattened(), 3)?,
            PyArray1::from_vec(py, point_start),
            table(py, point.into_flattened(), 3)?,
            PyArray1::from_vec(py, separation),
            PyArray1::from_vec(py, point_impulse),
        ))
    }

    /// World, kind, bodies (-1 for none) and value of each event of the last step.
    fn events(&self, worlds: Worlds<'_>) -> PyResult<Vec<Event>> {
        let all = self.lock().events(&indices(&worlds)?).map_err(raised)?;
        let row = |event: EventRow| {
            let [a, b] = event.bodies.map(|body| body.map_or(-1, |body| body.index() as i64));
            (event.world, event.kind, a, b, event.value)
        };
        Ok(all.into_iter().map(row).collect())
    }

    /// The first hits of rays: writes bodies (-1 for none), distances and normals.
    #[allow(clippy::too_many_arguments)]
    fn ray(
        &self,
        py: Python<'_>,
        worlds: Worlds<'_>,
        origin: PyReadonlyArray3<'_, f32>,
        direction: PyReadonlyArray3<'_, f32>,
        most: f32,
        mut body: PyReadwriteArray2<'_, i64>,
        mut distance: PyReadwriteArray2<'_, f32>,
        mut normal: PyReadwriteArray3<'_, f32>,
    ) -> PyResult<()> {
        let chosen = indices(&worlds)?;
        let (origin, direction) = (origin.as_slice()?, direction.as_slice()?);
        let each = origin.len() / chosen.len().max(1);
        let outputs = parts(body.as_slice_mut()?, chosen.len())
            .into_iter()
            .zip(parts(distance.as_slice_mut()?, chosen.len()))
            .zip(parts(normal.as_slice_mut()?, chosen.len()));
        let tasks = outputs.zip(&chosen).enumerate().map(|(k, (out, &world))| {
            let rays = (&origin[k * each..(k + 1) * each], &direction[k * each..(k + 1) * each]);
            (world, (rays, out))
        });
        self.each(py, tasks.collect(), |((origins, directions), ((bodies, distances), normals)), member| {
            let queries = member.simulation().queries();
            let rays = origins
                .chunks_exact(3)
                .zip(directions.chunks_exact(3))
                .map(|(o, d)| (Vec3::from_slice(o), Vec3::from_slice(d)));
            for (k, (origin, direction)) in rays.enumerate() {
                if let Some(hit) = queries.ray(origin, direction, most, &Filter::default()) {
                    (bodies[k], distances[k]) = (hit.body.index() as i64, hit.distance);
                    normals[3 * k..3 * k + 3].copy_from_slice(&hit.normal.to_array());
                }
            }
        })
    }
}

impl Batch {
    fn lock(&self) -> MutexGuard<'_, drystone::batch::Batch> {
        // A panic under the lock leaves valid worlds, because a panicking step is caught.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn each<T: Send>(
        &self,
        py: Python<'_>,
        tasks: Vec<(usize, T)>,
        work: impl Fn(&mut T, &mut Member) + Sync + Send,
    ) -> PyResult<()> {
        py.detach(|| self.lock().each(tasks, work)).map_err(raised)
    }
}

impl Task<'_> {
    fn before(&self, step: u64, steps: u64, world: &mut World) -> Outcome<()> {
        if step == 0 {
            self.inputs.iter().try_for_each(|(column, numbers)| write(world, *column, numbers))?;
        }
        let Some(ctrl) = self.ctrl else { return Ok(()) };
        let drives = Column::Control.rows(world);
        // The values are the same in every step, or given for each step. A world can have fewer drives than others.
        let width = self.inputs.iter().find(|input| input.0 == Column::Control).map_or(drives, |input| input.1.len());
        let is_each = ctrl.len() == width * steps as usize;
        let from = if is_each { width * step as usize } else { 0 };
        write(world, Column::Control, &ctrl[from..from + width])
    }

    fn after(&mut self, step: u64, steps: u64, every: u64, member: &Member) {
        if (step + 1).is_multiple_of(every) {
            let (row, rows) = ((step / every) as usize, (steps / every) as usize);
            for record in &mut self.records {
                match record {
                    Record::Column(column, all) => {
                        let each = all.len() / rows;
                        member.read(*column, &mut all[row * each..(row + 1) * each]);
                    }
                    Record::Measure(measure, all) => all[row] = Measure::values([*measure], member)[0],
                    Record::Hash(all) => all[row] = member.hash(),
                }
            }
        }
        // The columns of a failed or interrupted world are read afterwards.
        if step + 1 == steps {
            self.outputs.iter_mut().for_each(|(column, numbers)| member.read(*column, numbers));
        }
    }
}

/// Makes worlds on new threads: after a fork the threads of the process are gone.
/// A batch on the CPU, or on a GPU: an exact one if `gpu` is true.
fn made(
    py: Python<'_>,
    threads: usize,
    gpu: Option<bool>,
    make: impl FnOnce() -> Outcome<drystone::batch::Batch> + Send,
) -> PyResult<Batch> {
    py.detach(|| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        let pool = pool.map_err(|error| drystone::Error::input(format!("num_threads = {threads}: {error}")))?;
        pool.install(|| {
            let batch = make()?.on_threads(threads)?;
            let Some(exact) = gpu else { return Ok(batch) };
            batch.on_backend(choose(BackendChoice::Gpu, 0, exact)?.0)
        })
    })
    .map(|batch| Batch(Mutex::new(batch)))
    .map_err(raised)
}

fn indices(worlds: &Worlds<'_>) -> PyResult<Vec<usize>> {
    let index = |&world: &i64| usize::try_from(world).map_err(|_| PyValueError::new_err(format!("world {world}")));
    worlds.as_slice()?.iter().map(index).collect()
}

fn table<'py, T: numpy::Element>(py: Python<'py>, numbers: Vec<T>, width: usize) -> PyResult<Bound<'py, PyArray2<T>>> {
    let rows = numbers.len() / width.max(1);
    let table = Array2::from_shape_vec((rows, width), numbers);
    table.map(|table| table.into_pyarray(py)).map_err(|error| PyValueError::new_err(error.to_string()))
}
