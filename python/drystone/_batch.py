"""Batches of worlds."""

from __future__ import annotations

import os
import sys
import tempfile
import threading
import warnings
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, Literal, Self, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _check, _drystone
from ._scene import Config, Scene

Floats = NDArray[np.float32]
Doubles = NDArray[np.float64]
Result = TypeVar("Result")

# Columns by name, each with the number of values per body or joint.
VIEWS = {"position": 3, "rotation": 4, "linear_velocity": 3, "angular_velocity": 3}
INPUTS = {"force": 3, "torque": 3, "gravity": 3, "ctrl": 1}
ON_REQUEST = {
    "friction": 1,
    "restitution": 1,
    "mass_scale": 1,
    "joint_position": 6,
    "joint_speed": 6,
    "joint_force": 3,
    "joint_torque": 3,
    "joint_impulse": 3,
    "joint_torque_impulse": 3,
}
COLUMNS = {**VIEWS, **INPUTS, **ON_REQUEST}
MEASURES = (
    "overlap_max",
    "overlap_mean",
    "overlap_95",
    "joint_gap",
    "kinetic_energy",
    "potential_energy",
    "momentum_x",
    "momentum_y",
    "momentum_z",
    "angular_momentum_x",
    "angular_momentum_y",
    "angular_momentum_z",
    "fastest",
    "need",
    "energy_taken",
    "contacts",
    "asleep",
    "finite",
    "residual_velocity",
    "residual_cone",
    "residual_complementarity",
    "residual_dissipation",
)
# Largest side of a picture (pixels).
MAX_PIXELS = 8192
# More threads than any machine has processors would only exhaust the system.
MAX_THREADS = 1024
LISTEN = ("contacts", "impulses", "hits")
BACKENDS = ("cpu", "gpu")
EVENT = np.dtype([("world", "u4"), ("kind", "U8"), ("a", "i8"), ("b", "i8"), ("value", "f4")])


class WorldError(RuntimeError):
    """Some worlds failed. They are in the state before the failed step, and all other worlds completed the call.

    `worlds` has their indices, and `messages` has one line for each. After `rollout`, `records` has the recorded
    values, and NaN for records that a world did not reach.

    >>> import drystone as ds
    >>> batch = ds.Batch(ds.Scene.find("tower", n=2), 3)
    >>> batch.force[1, 2] = (float("inf"), 0, 0)
    >>> try:
    ...     batch.step(10)
    ... except ds.WorldError as error:
    ...     print(error.worlds, batch.steps)
    [1] [10  0 10]
    """

    def __init__(self, worlds: NDArray[np.int64], messages: list[str]) -> None:
        self.worlds = worlds
        self.messages = messages
        self.records: dict[str, NDArray[Any]] = {}
        more = f" (and {len(worlds) - 1} more)" if len(worlds) > 1 else ""
        super().__init__(f"world {worlds[0]}: {messages[0]}{more}")

    def __reduce__(self) -> tuple[Any, ...]:
        return WorldError, (self.worlds, self.messages), {"records": self.records}


def wxyz(rotation: ArrayLike) -> NDArray[Any]:
    """Convert rotations from the order x y z w to w x y z.

    >>> import drystone as ds
    >>> ds.wxyz([0, 0, 0, 1]).tolist()
    [1, 0, 0, 0]
    """
    return np.roll(np.asarray(rotation), 1, axis=-1)


class Snapshots:
    """States of some worlds, in memory. They are pickled as bytes.

    >>> import drystone as ds, pickle
    >>> batch = ds.Batch(ds.Scene.find("tower", n=3), 2)
    >>> states = pickle.loads(pickle.dumps(batch.snapshot()))
    >>> len(states), bool((states.hash == batch.hash()).all())
    (2, True)
    """

    __slots__ = ("_states",)

    def __init__(self, _states: list[_drystone.State]) -> None:
        self._states = _states

    @classmethod
    def from_bytes(cls, states: Sequence[bytes]) -> Self:
        """Load states from the bytes of `Batch.save` or `to_bytes`.

        ValueError: the bytes are not a saved world, have another version, or are damaged or cut short.

        >>> import drystone as ds
        >>> saved = ds.Batch(ds.Scene.find("tower", n=3), 2).save()
        >>> ds.Snapshots.from_bytes(saved)
        <Snapshots of 2 worlds>
        """
        if isinstance(states, (str, bytes, bytearray)) or not isinstance(states, Sequence):
            raise ValueError(f"states is {type(states).__name__}: must be a list of bytes, one for each world")
        for k, one in enumerate(states):
            if not isinstance(one, (bytes, bytearray)):
                raise ValueError(f"states[{k}] is {type(one).__name__}: must be bytes")
        return cls([_drystone.State.load(bytes(one)) for one in states])

    def to_bytes(self) -> list[bytes]:
        """The states as bytes, the same on every machine."""
        return [state.save() for state in self._states]

    @property
    def hash(self) -> NDArray[np.uint64]:
        """The hash of each state."""
        return np.array([state.hash for state in self._states], np.uint64)

    @property
    def steps(self) -> NDArray[np.uint64]:
        """Number of steps of each state since the start."""
        return np.array([state.steps for state in self._states], np.uint64)

    @property
    def time(self) -> Doubles:
        """Time of each state since the start (s)."""
        return np.array([state.time for state in self._states], np.float64)

    def __len__(self) -> int:
        return len(self._states)

    def __getitem__(self, index: int | slice) -> Snapshots:
        return Snapshots(self._states[index] if isinstance(index, slice) else [self._states[index]])

    def __iter__(self) -> Iterator[Snapshots]:
        return (Snapshots([state]) for state in self._states)

    def __repr__(self) -> str:
        return f"<Snapshots of {len(self)} worlds>"

    def __reduce__(self) -> tuple[Any, ...]:
        return Snapshots.from_bytes, (self.to_bytes(),)


@dataclass(frozen=True, repr=False)
class Contacts:
    """Contacts of some worlds. The contacts of one world are contiguous, sorted by pairs of bodies, and so are the
    points of one contact.

    `world_start` [w + 1], `bodies` [N, 2], `normal` [N, 3] from the first body to the second, `impulse` [N, 3] on the
    second body over the whole step (N s), `point_start` [N + 1], `point` [P, 3] (m), `separation` [P] (m),
    `point_impulse` [P] (N s). Impulses are zero unless the batch listens to "impulses".

    >>> import drystone as ds
    >>> batch = ds.Batch(ds.Scene.find("tower", n=2), listen=["impulses"])
    >>> batch.step(60)
    >>> contacts = batch.contacts()
    >>> contacts
    <Contacts of 1 worlds: 2 contacts, 8 points>
    >>> contacts.bodies.tolist(), contacts.normal[1].round(3).tolist(), contacts.point_start.tolist()
    ([[0, 1], [1, 2]], [0.0, 1.0, 0.0], [0, 4, 8])
    """

    world_start: NDArray[np.uint32]
    bodies: NDArray[np.uint32]
    normal: Floats
    impulse: Floats
    point_start: NDArray[np.uint32]
    point: Floats
    separation: Floats
    point_impulse: Floats

    def of(self, k: int) -> Contacts:
        """The contacts of the k-th requested world.

        >>> import drystone as ds
        >>> batch = ds.Batch(ds.Scene.find("tower", n=2), 2)
        >>> batch.step()
        >>> batch.contacts().of(1).bodies.tolist()
        [[0, 1], [1, 2]]
        """
        if not 0 <= _check.whole("k", k) < len(self.world_start) - 1:
            raise ValueError(f"k = {k}: must be 0 to {len(self.world_start) - 2}")
        first, end = (int(n) for n in self.world_start[k : k + 2])
        points = slice(*(int(n) for n in self.point_start[[first, end]]))
        begin = self.point_start[first]
        return Contacts(
            np.array([0, end - first], np.uint32),
            self.bodies[first:end],
            self.normal[first:end],
            self.impulse[first:end],
            self.point_start[first : end + 1] - begin,
            self.point[points],
            self.separation[points],
            self.point_impulse[points],
        )

    def __repr__(self) -> str:
        return f"<Contacts of {len(self.world_start) - 1} worlds: {len(self.bodies)} contacts, {len(self.point)} points>"


@dataclass(frozen=True, repr=False)
class Hits:
    """First hits of rays: `body` [w, R] (-1 without a hit), `distance` [w, R] (m; infinite without a hit), and
    `normal` [w, R, 3] (NaN without a hit).

    >>> import drystone as ds
    >>> hits = ds.Batch(ds.Scene.find("tower", n=2)).ray([[0, 9, 0], [9, 9, 0]], [[0, -1, 0], [0, 1, 0]])
    >>> hits.body.tolist(), hits.distance.tolist(), hits.normal[0, 0].tolist()
    ([[2, -1]], [[7.0, inf]], [0.0, 1.0, 0.0])
    """

    body: NDArray[np.int64]
    distance: Floats
    normal: Floats

    def __repr__(self) -> str:
        worlds, rays = self.body.shape
        return f"<Hits of {rays} rays in {worlds} worlds: {(self.body >= 0).sum()} hits>"


class Batch:
    """W independent worlds with up to B bodies, J joints and U actuators.

    `scene` and `config` are one value for all worlds, or one for each world. `num_threads` 0 uses all processors.
    `listen` selects the data that steps report: "contacts" and "hits" for `events`, "impulses" for `contacts` and
    `contact_impulse`. `hits_above` is the least speed of a reported hit (m/s).

    The bits of a world depend only on its scene, settings and inputs. They do not depend on W, the other worlds, the
    order of calls to others, threads or the machine. A call does not change worlds that it does not name. After a fork
    a batch raises RuntimeError, because its threads are gone.

    `backend` "gpu" runs the steps of all worlds on the best adapter, worlds with equal settings and rules as one
    problem. With `exact`, they have the bits of the CPU. If the device is lost, or has too little memory, the batch
    repeats the step on the CPU, continues on another backend, and warns; `fault` has the reason.

    `position` [W, B, 3], `rotation` [W, B, 4] (x y z w), `linear_velocity` and `angular_velocity` [W, B, 3] are
    read-only views of arrays that each call updates. Copy an array to keep its values. Rows of bodies that a world does
    not have are NaN.

    `force` and `torque` [W, B, 3], `ctrl` [W, U] and `gravity` [W, 3] are inputs: write to them. Each call that steps
    reads them at its start, and they last until they change. A reset sets them to the values of the scene.

    ValueError: an argument is invalid. AdapterError: there is no GPU, or it cannot run the exact mode.

    >>> import drystone as ds
    >>> batch = ds.Batch(ds.Scene.find("tower", n=3), 4, config=ds.Config("fast"), num_threads=1)
    >>> batch.force[2, 3] = (900, 0, 0)
    >>> batch.step(10)
    >>> [bool(h == batch.hash()[0]) for h in batch.hash()]
    [True, True, False, True]
    >>> batch.reset([2])
    >>> int(batch.steps[2]), float(batch.force[2, 3, 0])
    (0, 0.0)
    """

    def __init__(
        self,
        scene: Scene | Sequence[Scene],
        num_worlds: int | None = None,
        *,
        config: Config | Sequence[Config] | None = None,
        num_threads: int = 0,
        backend: Literal["cpu", "gpu"] = "cpu",
        exact: bool = False,
        listen: Collection[str] = (),
        hits_above: float = 0.5,
    ) -> None:
        scenes = _one_or_many("scene", scene, Scene)
        configs = _one_or_many("config", Config() if config is None else config, Config)
        counts = {len(of) for of in (scenes, configs) if len(of) > 1}
        if num_worlds is not None:
            counts.add(_check.whole("num_worlds", num_worlds, 1))
        if len(counts) > 1:
            given = f"{len(scenes)} scenes, {len(configs)} configs and num_worlds = {num_worlds}"
            raise ValueError(f"{given}: must be one, or one for each world")
        count = counts.pop() if counts else 1
        is_one = len(scenes) == len(configs) == 1
        threads, gpu = _threads(num_threads), _gpu(backend, exact)
        of_scenes, of_configs = ([one._scene for one in scenes], [one._config for one in configs])
        if not is_one:
            of_scenes = of_scenes * (count if len(of_scenes) == 1 else 1)
            of_configs = of_configs * (count if len(of_configs) == 1 else 1)
        words = _check.words("listen", listen, LISTEN)
        batch = _drystone.Batch.of_scenes(of_scenes, of_configs, count, threads, None if words else gpu)
        if _listen(batch, words, hits_above):
            # The start states must listen too, because a reset restores them.
            batch = _drystone.Batch.of_states(batch.states(np.arange(count)), threads, gpu)
        self._begin(batch, "impulses" in words, scenes * (count if len(scenes) == 1 else 1))

    @classmethod
    def load(
        cls,
        states: Sequence[bytes] | Snapshots,
        *,
        num_threads: int = 0,
        backend: Literal["cpu", "gpu"] = "cpu",
        exact: bool = False,
        listen: Collection[str] | None = None,
        hits_above: float = 0.5,
    ) -> Self:
        """Load one world for each state of `save` or `snapshot`. A reset goes back to that state. With `listen` None,
        each world keeps the `listen` of its state.

        ValueError: there is no state, or the bytes are not a saved world, have another version, or are damaged or cut
        short.

        >>> import drystone as ds
        >>> batch = ds.Batch(ds.Scene.find("tower", n=3), 2)
        >>> batch.step(5)
        >>> again = ds.Batch.load(batch.save())
        >>> batch.step(5); again.step(5)
        >>> bool((batch.hash() == again.hash()).all()), again.steps.tolist()
        (True, [10, 10])
        """
        own = cls.__new__(cls)
        snapshots = states if isinstance(states, Snapshots) else Snapshots.from_bytes(states)
        threads, gpu = _threads(num_threads), _gpu(backend, exact)
        batch = _drystone.Batch.of_states(snapshots._states, threads, None if listen is not None else gpu)
        words = ["impulses"]
        if listen is not None:
            words = _listen(batch, listen, hits_above)
            batch = _drystone.Batch.of_states(batch.states(np.arange(len(snapshots))), threads, gpu)
        own._begin(batch, "impulses" in words, [])
        return own

    def _begin(self, batch: _drystone.Batch, has_impulses: bool, scenes: list[Scene]) -> None:
        self._batch = batch
        self._process = os.getpid()
        # The scene of each world, unknown for a batch of states.
        self._scenes = scenes
        self._has_impulses = has_impulses
        self._lock = threading.RLock()
        self._worlds, self._bodies, self._joints, self._drives = batch.sizes()
        self._threads, self._backend = batch.threads, batch.backend
        self._fault: str | None = None
        self._arrays = {name: np.full(self._shape(name), np.nan, np.float32) for name in (*VIEWS, *INPUTS)}
        self._views = {name: _read_only(self._arrays[name]) for name in VIEWS}
        self._inputs = [(name, self._arrays[name]) for name in INPUTS]
        self._outputs = [(name, self._arrays[name]) for name in VIEWS]
        self._clocks = (np.zeros(self._worlds, np.uint64), np.zeros(self._worlds, np.float64))
        self._clock_views = tuple(_read_only(clock) for clock in self._clocks)
        self._take(np.arange(self._worlds), inputs=True)

    def _shape(self, name: str) -> tuple[int, ...]:
        """The shape of a column of all worlds."""
        if name == "gravity":
            return (self._worlds, 3)
        if name == "ctrl":
            return (self._worlds, self._drives)
        rows = self._joints if name.startswith("joint") else self._bodies
        width = COLUMNS[name]
        return (self._worlds, rows) if width == 1 else (self._worlds, rows, width)

    def _take(self, worlds: NDArray[np.int64], inputs: bool = False) -> None:
        """Read the state of some worlds into the arrays."""
        self._batch.read(worlds, self._outputs + (self._inputs if inputs else []))
        self._batch.clocks(*self._clocks)

    def _alone(self, work: Callable[[], Result]) -> Result:
        """Call `work` while no other thread uses the batch."""
        if os.getpid() != self._process:
            raise RuntimeError("this batch was made before a fork, and its threads are gone: make it in the child, or start it by spawn")
        with self._lock:
            return work()

    def _steps_alone(self, work: Callable[[], Result]) -> Result:
        """Call `work`, which steps worlds, and forget the fault of the call before."""

        def all_work() -> Result:
            self._fault = None
            return work()

        return self._alone(all_work)

    def _finish(self, failed: list[tuple[int, str]], records: dict[str, NDArray[Any]]) -> None:
        """Warn of a fault of the GPU, and raise the errors of worlds, at the end of a public call."""
        try:
            if self._fault is not None:
                warnings.warn(self._fault, RuntimeWarning, stacklevel=3)
        finally:
            _raise_failed(failed, records)

    @property
    def num_worlds(self) -> int:
        """Number of worlds, W."""
        return self._worlds

    @property
    def num_bodies(self) -> int:
        """Largest number of bodies of a world, B."""
        return self._bodies

    @property
    def num_joints(self) -> int:
        """Largest number of joints of a world, J."""
        return self._joints

    @property
    def num_actuators(self) -> int:
        """Largest number of driven axes of a world, U."""
        return self._drives

    @property
    def num_threads(self) -> int:
        """Number of threads that step worlds."""
        return self._threads

    @property
    def backend(self) -> str:
        """The backend that steps worlds: "cpu" or "gpu"."""
        return self._backend

    @property
    def fault(self) -> str | None:
        """One line if the GPU failed in the last call that stepped: the reason, and the backend that continues."""
        return self._fault

    @property
    def position(self) -> Floats:
        """[W, B, 3] position (m)."""
        return self._views["position"]

    @property
    def rotation(self) -> Floats:
        """[W, B, 4] rotation, x y z w."""
        return self._views["rotation"]

    @property
    def linear_velocity(self) -> Floats:
        """[W, B, 3] velocity of the center of mass (m/s)."""
        return self._views["linear_velocity"]

    @property
    def angular_velocity(self) -> Floats:
        """[W, B, 3] angular velocity (rad/s)."""
        return self._views["angular_velocity"]

    @property
    def steps(self) -> NDArray[np.uint64]:
        """[W] number of steps since the start."""
        return self._clock_views[0]

    @property
    def time(self) -> Doubles:
        """[W] time since the start (s)."""
        return self._clock_views[1]

    @property
    def force(self) -> Floats:
        """[W, B, 3] force through the center of mass (N); an input."""
        return self._arrays["force"]

    @force.setter
    def force(self, value: ArrayLike) -> None:
        self._set_input("force", value)

    @property
    def torque(self) -> Floats:
        """[W, B, 3] torque (N m); an input."""
        return self._arrays["torque"]

    @torque.setter
    def torque(self, value: ArrayLike) -> None:
        self._set_input("torque", value)

    @property
    def ctrl(self) -> Floats:
        """[W, U] speed of each motor (m/s, rad/s) and target of each spring (m, rad); an input. `Scene.actuators` has
        the names.

        >>> import drystone as ds
        >>> batch = ds.Batch(ds.Scene.find("drawbridge"), 2)
        >>> batch.ctrl[1] = 0.3
        >>> batch.ctrl.shape, batch.ctrl[1].round(2).tolist()
        ((2, 2), [0.30000001192092896, 0.30000001192092896])
        """
        return self._arrays["ctrl"]

    @ctrl.setter
    def ctrl(self, value: ArrayLike) -> None:
        self._set_input("ctrl", value)

    @property
    def gravity(self) -> Floats:
        """[W, 3] gravity (m/s²); an input."""
        return self._arrays["gravity"]

    @gravity.setter
    def gravity(self, value: ArrayLike) -> None:
        self._set_input("gravity", value)

    def _set_input(self, name: str, value: ArrayLike) -> None:
        array = self._arrays[name]
        array[...] = _check.numbers(name, value, array.shape, lambda: np.isnan(self._column(name)))

    @property
    def exists(self) -> NDArray[np.bool_]:
        """[W, B] whether a world has the body; a new array."""
        return self._body_flags()[0]

    @property
    def asleep(self) -> NDArray[np.bool_]:
        """[W, B] whether a body sleeps; a new array."""
        return self._body_flags()[1]

    @property
    def substeps(self) -> NDArray[np.uint32]:
        """[W, B] substeps that a body takes in a step, 0 without a body; a new array.

        >>> import drystone as ds
        >>> ds.Batch(ds.Scene.find("tower", n=2), config=ds.Config(substeps=5)).substeps.tolist()
        [[5, 5, 5]]
        """
        return self._body_flags()[2]

    def _body_flags(self) -> tuple[NDArray[np.bool_], NDArray[np.bool_], NDArray[np.uint32]]:
        shape = (self._worlds, self._bodies)
        arrays = (np.zeros(shape, bool), np.zeros(shape, bool), np.zeros(shape, np.uint32))
        self._alone(lambda: self._batch.bodies(*arrays))
        return arrays

    @property
    def friction(self) -> Floats:
        """[W, B] friction coefficient; a new array. `set_material` changes it."""
        return self._column("friction")

    @property
    def restitution(self) -> Floats:
        """[W, B] restitution coefficient; a new array. `set_material` changes it."""
        return self._column("restitution")

    @property
    def mass_scale(self) -> Floats:
        """[W, B] factor on the initial mass and moments of inertia; a new array. `set_material` changes it."""
        return self._column("mass_scale")

    @property
    def joint_position(self) -> Floats:
        """[W, J, 6] three lengths (m) and three angles (rad) of each joint; a new array.

        >>> import drystone as ds
        >>> world = ds.World()
        >>> bob = world.add(ds.Body.dynamic("bob").ball(0.1).at(1, 0, 0))
        >>> world.join(ds.Joint(bob).hinge((0, 0, 1)).at(0, 0, 0))
        >>> batch = ds.Batch(ds.Scene.from_world(world))
        >>> batch.step(20)
        >>> batch.joint_position.shape, int((abs(batch.joint_position) > 0.1).sum())
        ((1, 1, 6), 1)
        """
        return self._column("joint_position")

    @property
    def joint_speed(self) -> Floats:
        """[W, J, 6] rates of these lengths and angles (m/s, rad/s); a new array."""
        return self._column("joint_speed")

    @property
    def joint_force(self) -> Floats:
        """[W, J, 3] force on the second body in the last step (N); a new array. It is the mean over the step if any
        joint of the world has a break force, a motor or a spring, else the force of the last substep.
        """
        return self._column("joint_force")

    @property
    def joint_torque(self) -> Floats:
        """[W, J, 3] torque on the second body about the anchor, over the same time (N m); a new array."""
        return self._column("joint_torque")

    @property
    def joint_impulse(self) -> Floats:
        """[W, J, 3] impulse on the second body in the last substep (N s); a new array."""
        return self._column("joint_impulse")

    @property
    def joint_torque_impulse(self) -> Floats:
        """[W, J, 3] angular impulse on the second body in the last substep (N m s); a new array."""
        return self._column("joint_torque_impulse")

    @property
    def contact_impulse(self) -> Floats:
        """[W, B, 3] sum of the impulses of all contacts on each body over the last step (N s); a new array. Its shape
        is fixed, for observations of policies. `contacts` has the single contacts.

        Impulses are zero in a world whose restored state does not listen to them.

        ValueError: the batch does not listen to "impulses".

        >>> import drystone as ds
        >>> batch = ds.Batch(ds.Scene.find("tower", n=2), 1, listen=["impulses"])
        >>> batch.step(60)
        >>> [round(60 * float(force)) for force in batch.contact_impulse[0, :, 1]]
        [-19620, 9810, 9810]
        """
        if not self._has_impulses:
            raise ValueError("contact_impulse: the batch does not listen to 'impulses'")
        contacts, exists = self.contacts(), self.exists
        of_world = np.repeat(np.arange(self._worlds), np.diff(contacts.world_start))
        rows = of_world[:, None] * self._bodies + contacts.bodies
        total = np.empty((self._worlds * self._bodies, 3))
        for axis in range(3):
            # Sums in the order of the contacts, which is the same on every machine.
            on_first, on_second = (
                np.bincount(rows[:, k], contacts.impulse[:, axis], len(total)) for k in range(2)
            )
            total[:, axis] = on_second - on_first
        impulse = total.reshape(self._worlds, self._bodies, 3).astype(np.float32)
        impulse[~exists] = np.nan
        return impulse

    def _column(self, name: str) -> Floats:
        array = np.full(self._shape(name), np.nan, np.float32)
        self._alone(lambda: self._batch.read(np.arange(self._worlds), [(name, array)]))
        return array

    def step(self, n: int = 1, *, worlds: ArrayLike | None = None, dt: float | None = None) -> None:
        """Advance worlds by n steps of `dt` seconds; None is the step length of the scene. `worlds` is a mask [W] or
        ascending indices; None selects all.

        ValueError: an argument is invalid. WorldError: some worlds failed; all others completed the call.
        KeyboardInterrupt: Ctrl-C ended the call; every world is between two steps.

        >>> import drystone as ds, numpy as np
        >>> batch = ds.Batch(ds.Scene.find("tower", n=3), 3)
        >>> batch.step(3, worlds=np.array([True, False, True]))
        >>> batch.steps.tolist()
        [3, 0, 3]
        """
        n = _check.whole("n", n)
        chosen = _check.worlds(worlds, self._worlds)
        length = None if dt is None else _step_length(dt)
        self._finish(self._steps_alone(lambda: self._run_alone(n, 1, chosen, length, None, {})), {})

    def rollout(
        self,
        n: int,
        ctrl: ArrayLike | None = None,
        *,
        every: int = 1,
        record: Collection[str] = ("position",),
        worlds: ArrayLike | None = None,
        dt: float | None = None,
        out: Mapping[str, NDArray[Any]] | None = None,
        until: Callable[[Batch], ArrayLike] | None = None,
    ) -> dict[str, NDArray[Any]]:
        """Advance w worlds by n steps in one call, and record every `every`-th step: arrays [w, n // every, ...].

        `ctrl` [w or 1, n or 1, U] is set before each step. `record` names columns ("position", "joint_speed", ...) in
        single precision, measures (`measure`) in double precision, and "hash" (uint64). `out` has arrays by name. The
        call fills and returns them in place of new ones.

        `until(batch)` returns a bool for each world, [W]. The call asks it after every `every` steps, and a world stops
        when its value is True. Its later records are NaN (0 for "hash"). `steps` has the number of steps of each world.

        ValueError: an argument is invalid. WorldError: some worlds failed; the error has the records so far.
        KeyboardInterrupt: Ctrl-C ended the call; every world is between two steps.

        >>> import drystone as ds
        >>> batch = ds.Batch(ds.Scene.find("tower", n=3), 2)
        >>> out = batch.rollout(30, every=10, record=("position", "kinetic_energy", "hash"))
        >>> out["position"].shape, out["hash"].shape, bool(out["hash"][0, 2] == batch.hash()[0])
        ((2, 3, 4, 3), (2, 3), True)
        >>> batch.force[1, 3] = (9000, 0, 0)
        >>> _ = batch.rollout(600, every=10, until=lambda batch: batch.position[:, 3, 1] < 2)
        >>> bool(batch.steps[0] == 630), bool(batch.steps[1] < 630)
        (True, True)
        """
        n, every = _check.whole("n", n), _check.whole("every", every, 1)
        chosen = _check.worlds(worlds, self._worlds)
        length = None if dt is None else _step_length(dt)
        numbers = None if ctrl is None else self._controls(ctrl, len(chosen), n)
        if until is not None and not callable(until):
            raise ValueError(f"until is {type(until).__name__}: must be a function of a batch")
        names = _check.words("record", record, [*COLUMNS, *MEASURES, "hash"])
        given = self._given(names, out, len(chosen), n // every)
        records = {name: given.get(name, self._record(name, len(chosen), n // every)) for name in names}
        if until is None:
            failed = self._steps_alone(lambda: self._run_alone(n, every, chosen, length, numbers, records))
        else:
            failed = self._steps_alone(lambda: self._run_until(n, every, chosen, length, numbers, records, until))
        self._finish(failed, records)
        return records

    def _given(
        self, names: list[str], out: Mapping[str, NDArray[Any]] | None, worlds: int, rows: int
    ) -> dict[str, NDArray[Any]]:
        """The arrays of `out`, checked and without values."""
        if out is None:
            return {}
        if not isinstance(out, Mapping):
            raise ValueError(f"out is {type(out).__name__}: must be a dict of arrays")
        used = dict(self._arrays)
        for name, array in out.items():
            label = f"out[{name!r}]"
            _check.one_of("out", name, names)
            wanted = self._record(name, 0, rows)
            _check.output(label, array, (worlds, *wanted.shape[1:]), wanted.dtype)
            for other, of in used.items():
                if np.may_share_memory(array, of):
                    raise ValueError(f"{label} shares memory with {other}: must have memory of its own")
            used[label] = array
        for name, array in out.items():
            array.fill(0 if name == "hash" else np.nan)
        return dict(out)

    def _controls(self, ctrl: ArrayLike, worlds: int, steps: int) -> Floats:
        array = np.asarray(ctrl)
        fits = array.ndim == 3 and array.shape[0] in (1, worlds) and array.shape[1] in (1, steps)
        if not fits or array.shape[2] != self._drives:
            raise ValueError(f"ctrl has shape {array.shape}: must be ({worlds} or 1, {steps} or 1, {self._drives})")
        numbers = _check.numbers("ctrl", array, array.shape)
        return np.ascontiguousarray(np.broadcast_to(numbers, (worlds, *array.shape[1:])))

    def _record(self, name: str, worlds: int, rows: int) -> NDArray[Any]:
        if name == "hash":
            return np.zeros((worlds, rows), np.uint64)
        if name in MEASURES:
            return np.full((worlds, rows), np.nan)
        return np.full((worlds, rows, *self._shape(name)[1:]), np.nan, np.float32)

    def _run_alone(
        self,
        n: int,
        every: int,
        chosen: NDArray[np.int64],
        dt: float | None,
        ctrl: Floats | None,
        records: dict[str, NDArray[Any]],
    ) -> list[tuple[int, str]]:
        failed: list[tuple[int, str]] | None = None
        try:
            failed = self._batch.run(n, every, chosen, dt, self._inputs, self._outputs, ctrl, list(records.items()))
            self._fault, self._backend = self._batch.fault or self._fault, self._batch.backend
        finally:
            # Read the state of worlds that did not complete the call.
            late = chosen if failed is None else np.array([world for world, _ in failed], np.int64)
            if len(late):
                self._batch.read(late, self._outputs)
            self._batch.clocks(*self._clocks)
            if ctrl is not None:
                self._batch.read(chosen, [("ctrl", self._arrays["ctrl"])])
        return failed

    def _run_until(
        self,
        n: int,
        every: int,
        chosen: NDArray[np.int64],
        dt: float | None,
        ctrl: Floats | None,
        records: dict[str, NDArray[Any]],
        until: Callable[[Batch], ArrayLike],
    ) -> list[tuple[int, str]]:
        failed: list[tuple[int, str]] = []
        # Rows of the worlds that still run.
        rows = np.arange(len(chosen))
        for first in range(0, n, every):
            if not len(rows):
                break
            count = min(every, n - first)
            steps = slice(0, 1) if ctrl is None or ctrl.shape[1] == 1 else slice(first, first + count)
            own = None if ctrl is None else np.ascontiguousarray(ctrl[rows, steps])
            parts = {name: self._record(name, len(rows), 1) for name in records} if count == every else {}
            failed_now = self._run_alone(count, every, chosen[rows], dt, own, parts)
            for name, part in parts.items():
                records[name][rows, first // every] = part[:, 0]
            is_over = np.asarray(until(self))
            if is_over.shape != (self._worlds,) or is_over.dtype != bool:
                given = f"shape {is_over.shape} and dtype {is_over.dtype}"
                raise ValueError(f"until gives {given}: must be ({self._worlds},) bools")
            is_over = is_over | np.isin(np.arange(self._worlds), [world for world, _ in failed_now])
            rows = rows[~is_over[chosen[rows]]]
            failed += failed_now
        return sorted(failed)

    def apply_impulse(
        self,
        impulse: ArrayLike,
        *,
        bodies: ArrayLike | None = None,
        at: ArrayLike | None = None,
        worlds: ArrayLike | None = None,
    ) -> None:
        """Apply impulses [w, b, 3] (N s) at once to some bodies of some worlds, through centers of mass or at points
        `at` [w, b, 3] (m).

        ValueError: an argument is invalid.

        >>> import drystone as ds
        >>> batch = ds.Batch(ds.Scene.find("tower", n=2), 2)
        >>> batch.apply_impulse([[[1000, 0, 0]]], bodies=[2], worlds=[1])
        >>> batch.linear_velocity[:, 2, 0].tolist()
        [0.0, 1.0]
        """
        chosen = _check.worlds(worlds, self._worlds)
        columns = _check.worlds(bodies, self._bodies, "bodies")
        shape = (len(chosen), len(columns), 3)
        all_impulses = np.zeros((len(chosen), self._bodies, 3), np.float32)
        all_points = np.full_like(all_impulses, np.nan)
        given = _check.numbers("impulse", impulse, shape, lambda: ~self.exists[np.ix_(chosen, columns)][..., None])
        # Rows of absent bodies can be NaN.
        all_impulses[:, columns] = np.nan_to_num(given)
        if at is not None:
            all_points[:, columns] = _check.numbers("at", at, shape)
        self._alone(lambda: self._batch.apply_impulse(chosen, all_impulses, all_points))
        self._alone(lambda: self._take(chosen))

    def set_state(
        self,
        *,
        worlds: ArrayLike | None = None,
        bodies: ArrayLike | None = None,
        position: ArrayLike | None = None,
        rotation: ArrayLike | None = None,
        linear_velocity: ArrayLike | None = None,
        angular_velocity: ArrayLike | None = None,
    ) -> None:
        """Set poses and velocities [w, b, 3 or 4] of some bodies of some worlds.

        Contacts that still touch keep their impulses. To start anew, use `reset` or `restore`. Rows of bodies that a
        world does not have may be NaN, as in the arrays of the batch.

        ValueError: an argument is invalid, or a rotation has no unit length.

        >>> import drystone as ds
        >>> batch = ds.Batch(ds.Scene.find("tower", n=2), 2)
        >>> batch.set_state(worlds=[0], bodies=[2], position=[[[0, 3, 0]]])
        >>> batch.position[:, 2, 1].tolist()
        [3.0, 1.5]
        """
        values = {
            "position": position,
            "rotation": rotation,
            "linear_velocity": linear_velocity,
            "angular_velocity": angular_velocity,
        }
        self._write(values, worlds, bodies)

    def set_material(
        self,
        *,
        worlds: ArrayLike | None = None,
        bodies: ArrayLike | None = None,
        friction: ArrayLike | None = None,
        restitution: ArrayLike | None = None,
        mass_scale: ArrayLike | None = None,
    ) -> None:
        """Set coefficients [w, b] of some bodies of some worlds, and the factor on their initial mass and moments of
        inertia. A reset sets the values of the scene. Bodies without mass stay without mass.

        ValueError: a shape is wrong, a friction is below 0, a restitution is not 0 to 1, or a mass is not 1e-15 to 1e15
        kg.

        >>> import drystone as ds
        >>> batch = ds.Batch(ds.Scene.find("tower", n=2), 2)
        >>> batch.set_material(friction=[[0.9] * 3, [0.1] * 3])
        >>> batch.friction[:, 1].round(2).tolist()
        [0.8999999761581421, 0.10000000149011612]
        >>> batch.set_material(worlds=[1], bodies=[2], mass_scale=[[4]])
        >>> batch.mass_scale[:, 2].tolist()
        [1.0, 4.0]
        """
        self._write({"friction": friction, "restitution": restitution, "mass_scale": mass_scale}, worlds, bodies)

    def _write(self, values: dict[str, ArrayLike | None], worlds: ArrayLike | None, bodies: ArrayLike | None) -> None:
        chosen = _check.worlds(worlds, self._worlds)
        columns = _check.worlds(bodies, self._bodies, "bodies")
        checked: dict[str, Floats] = {}
        for name, value in values.items():
            if value is not None:
                whole = self._column(name)[chosen]
                shape = whole[:, columns].shape
                numbers = _check.numbers(name, value, shape, partial(np.isnan, whole[:, columns]))
                _check_range(name, numbers)
                whole[:, columns] = numbers
                checked[name] = whole.reshape(len(chosen), self._bodies, COLUMNS[name])
        for name, whole in checked.items():
            self._alone(partial(self._batch.write, chosen, name, whole))
        self._alone(lambda: self._take(chosen))

    def reset(self, worlds: ArrayLike | None = None) -> None:
        """Reset worlds to their start. They have the bits of worlds that never ran.

        >>> import drystone as ds
        >>> batch = ds.Batch(ds.Scene.find("pile", n=8), 2)
        >>> start = batch.hash()
        >>> batch.step(37)
        >>> batch.reset([1])
        >>> (batch.hash() == start).tolist()
        [False, True]
        """
        chosen = _check.worlds(worlds, self._worlds)

        def reset() -> None:
            self._batch.reset(chosen)
            self._take(chosen, inputs=True)

        self._alone(reset)

    def snapshot(self, worlds: ArrayLike | None = None) -> Snapshots:
        """The states of worlds, in memory.

        >>> import drystone as ds
        >>> batch = ds.Batch(ds.Scene.find("pile", n=8), 3)
        >>> batch.step(9, worlds=[0])
        >>> batch.restore(batch.snapshot([0]))
        >>> bool((batch.hash() == batch.hash()[0]).all())
        True
        """
        chosen = _check.worlds(worlds, self._worlds)
        return Snapshots(self._alone(lambda: self._batch.states(chosen)))

    def restore(
        self, snapshots: Snapshots, worlds: ArrayLike | None = None, *, source: ArrayLike | None = None
    ) -> None:
        """Continue worlds from states: one state for each world, one for all, or the indices of states in `source` [w].
        A state includes the `listen` of its batch.

        ValueError: the number of states is wrong, or a state has more bodies, joints or drives than the batch has rows.

        >>> import drystone as ds
        >>> batch = ds.Batch(ds.Scene.find("pile", n=8), 4)
        >>> batch.step(9, worlds=[0])
        >>> batch.restore(batch.snapshot([0, 1]), worlds=[1, 2, 3], source=[0, 1, 0])
        >>> batch.steps.tolist()
        [9, 9, 0, 9]
        """
        if not isinstance(snapshots, Snapshots):
            raise ValueError(f"snapshots is {type(snapshots).__name__}: must be Snapshots; Snapshots.from_bytes makes them of bytes")
        chosen = _check.worlds(worlds, self._worlds)
        states = [snapshots._states[k] for k in self._sources(snapshots, len(chosen), source)]
        most = [self._bodies, self._joints, self._drives]
        for k, state in enumerate(states):
            if any(has > room for has, room in zip(state.sizes, most, strict=True)):
                words = "{} bodies, {} joints, {} drives".format
                raise ValueError(f"snapshots[{k}] has {words(*state.sizes)}: must be at most {words(*most)}")

        def restore() -> None:
            self._batch.restore(chosen, states)
            # The states may listen to impulses.
            self._has_impulses = True
            self._take(chosen, inputs=True)

        self._alone(restore)

    @staticmethod
    def _sources(snapshots: Snapshots, worlds: int, source: ArrayLike | None) -> list[int]:
        if source is not None:
            array = np.asarray(source)
            if array.shape != (worlds,) or array.dtype.kind not in "iu":
                raise ValueError(f"source has shape {array.shape} and dtype {array.dtype}: must be ({worlds},) whole numbers")
            if worlds and (array.min() < 0 or array.max() >= len(snapshots)):
                raise ValueError(f"source has {array.min()} to {array.max()}: must be 0 to {len(snapshots) - 1}")
            return [int(k) for k in array]
        if len(snapshots) not in (1, worlds):
            raise ValueError(f"snapshots has {len(snapshots)} states: must be 1 or {worlds}")
        return [0] * worlds if len(snapshots) == 1 else list(range(worlds))

    def save(self, worlds: ArrayLike | None = None) -> list[bytes]:
        """The states of worlds as bytes, the same on every machine. A tower of ten boxes takes about 6 kB.

        >>> import drystone as ds
        >>> batch = ds.Batch(ds.Scene.find("tower", n=3), 2)
        >>> len({len(state) for state in batch.save()})
        1
        """
        chosen = _check.worlds(worlds, self._worlds)
        return self._alone(lambda: self._batch.save(chosen))

    def hash(self, worlds: ArrayLike | None = None) -> NDArray[np.uint64]:
        """[w] hash of poses and velocities. `drystone run` prints the same hash for the world alone.

        >>> import drystone as ds
        >>> batch = ds.Batch(ds.Scene.find("tower", n=3), 2)
        >>> f"{batch.hash()[1]:016x}" == f"{batch.hash([0])[0]:016x}"
        True
        """
        chosen = _check.worlds(worlds, self._worlds)
        return self._alone(lambda: self._batch.hash(chosen))

    def measure(self, *names: str, worlds: ArrayLike | None = None) -> dict[str, Doubles]:
        """Measures of worlds, each [w]. Without names it returns all measures.

        overlap_max, overlap_mean and overlap_95 (m, from recomputed contacts), joint_gap (m), kinetic_energy and
        potential_energy (J), momentum_x, y, z (N s), angular_momentum_x, y, z about the origin (N m s), fastest (m/s),
        need (of the hardest contact), energy_taken in the last step (J), contacts, asleep, finite.

        residual_velocity (no unit), residual_cone (N s), residual_complementarity and residual_dissipation (J) are
        errors of the impulses after the first substep of the next step. That step runs on a copy of the world and costs
        as much as a normal step. These residuals are NaN for a world with joints.

        >>> import drystone as ds
        >>> batch = ds.Batch(ds.Scene.find("tower", n=3), 2)
        >>> batch.step(10)
        >>> batch.measure("contacts", "finite")
        {'contacts': array([3., 3.]), 'finite': array([1., 1.])}
        """
        wanted = [_check.one_of("name", name, MEASURES) for name in names or MEASURES]
        chosen = _check.worlds(worlds, self._worlds)
        table = self._alone(lambda: self._batch.measure(chosen, wanted))
        return {name: np.ascontiguousarray(table[:, k]) for k, name in enumerate(wanted)}

    def contacts(self, worlds: ArrayLike | None = None) -> Contacts:
        """The contacts of the last step, including near ones: see `Contacts`.

        >>> import drystone as ds
        >>> batch = ds.Batch(ds.Scene.find("tower", n=2), 2, listen=["impulses"])
        >>> batch.step(60)
        >>> contacts = batch.contacts()
        >>> contacts.world_start.tolist(), bool(contacts.impulse[0, 1] > contacts.impulse[1, 1])
        ([0, 2, 4], True)
        """
        chosen = _check.worlds(worlds, self._worlds)
        return Contacts(*self._alone(lambda: self._batch.contacts(chosen)))

    def events(self, worlds: ArrayLike | None = None) -> NDArray[np.void]:
        """The events of the last step: world, kind (began, ended, hit, entered, left, passed, broke), bodies a and b
        (-1 for no body), and a value: speed of a hit (m/s), time of a passage (s), or force on a broken joint (N). The
        kinds began, ended and hit need `listen`.

        >>> import drystone as ds
        >>> batch = ds.Batch(ds.Scene.find("tower", n=2), 1, listen=["contacts"])
        >>> batch.step()
        >>> batch.events()["kind"].tolist()
        ['began', 'began']
        """
        chosen = _check.worlds(worlds, self._worlds)
        return np.array(self._alone(lambda: self._batch.events(chosen)), EVENT)

    def ray(
        self, origin: ArrayLike, direction: ArrayLike, max_distance: float = 1e6, *, worlds: ArrayLike | None = None
    ) -> Hits:
        """First hits of R rays in each of w worlds. `origin` and `direction` are [R, 3] or [w, R, 3] (m). A direction
        can have any length but zero, and a distance is in meters.

        ValueError: an argument is invalid.

        >>> import drystone as ds
        >>> hits = ds.Batch(ds.Scene.find("tower", n=2), 2).ray([[0, 9, 0]], [[0, -1, 0]])
        >>> hits.body.tolist(), hits.distance.tolist()
        ([[2], [2]], [[7.0], [7.0]])
        """
        chosen = _check.worlds(worlds, self._worlds)
        rays = [self._rays(name, value, len(chosen)) for name, value in (("origin", origin), ("direction", direction))]
        if rays[0].shape != rays[1].shape:
            raise ValueError(f"origin has shape {rays[0].shape} and direction {rays[1].shape}: must be the same")
        most, shape = _check.number("max_distance", max_distance), rays[0].shape
        if most < 0:
            raise ValueError(f"max_distance = {most}: must be 0 or more")
        body = np.full(shape[:2], -1, np.int64)
        distance, normal = np.full(shape[:2], np.inf, np.float32), np.full(shape, np.nan, np.float32)
        self._alone(lambda: self._batch.ray(chosen, rays[0], rays[1], most, body, distance, normal))
        return Hits(body, distance, normal)

    def picture(
        self, world: int = 0, width: int = 640, height: int = 480, *, yaw: float = 30, pitch: float = 25
    ) -> NDArray[np.uint8]:
        """A picture of the present state of a world: [height, width, 3], red, green and blue, rows from the top. `yaw`
        is the angle of the camera around the world, and `pitch` its elevation above the horizon (degrees, from -89 to
        89). All moving bodies are in view. Colors show materials.

        Drawing needs a GPU or a software driver (Mesa's lavapipe, package mesa-vulkan-drivers).

        AdapterError: there is no adapter, or a side is too long for it.

        >>> import drystone as ds
        >>> try:
        ...     print(ds.Batch(ds.Scene.find("tower", n=3)).picture(width=64, height=48).shape)
        ... except ds.AdapterError:
        ...     print((48, 64, 3))
        (48, 64, 3)
        """
        [chosen] = _check.worlds(_check.whole("world", world), self._worlds, "world")
        size = (_side("width", width), _side("height", height))
        if sys.platform == "linux":
            # Without a desktop, Mesa prints a warning if this folder is not set.
            os.environ.setdefault("XDG_RUNTIME_DIR", tempfile.gettempdir())
        angles = np.radians([_check.number("yaw", yaw), min(89.0, max(-89.0, _check.number("pitch", pitch)))])
        return self._alone(lambda: self._batch.picture(int(chosen), size, *(float(angle) for angle in angles)))

    @staticmethod
    def _rays(name: str, value: ArrayLike, worlds: int) -> Floats:
        is_flat = np.ndim(value) == 2
        rays = _check.numbers(name, value, (-1, 3) if is_flat else (worlds, -1, 3))
        if name == "direction":
            _check.rows_within(name, rays, np.asarray(rays.any(axis=-1)), "have a length")
        return np.ascontiguousarray(np.broadcast_to(rays, (worlds, *rays.shape))) if is_flat else rays

    def __len__(self) -> int:
        return self._worlds

    def __repr__(self) -> str:
        return f"<Batch of {self._worlds} worlds, up to {self._bodies} bodies each, on {self.num_threads} threads>"

    def __reduce__(self) -> tuple[Any, ...]:
        raise TypeError("a Batch is not pickled: send batch.save(), and load it by Batch.load")


def _listen(batch: _drystone.Batch, listen: Collection[str], hits_above: float) -> list[str]:
    """Select the data that steps report. Returns the words of `listen`."""
    words = _check.words("listen", listen, LISTEN)
    above = _check.number("hits_above", hits_above) if "hits" in words else None
    batch.listen("contacts" in words, "impulses" in words, above)
    return words


def _raise_failed(failed: list[tuple[int, str]], records: dict[str, NDArray[Any]]) -> None:
    if failed:
        error = WorldError(np.array([world for world, _ in failed]), [line for _, line in failed])
        error.records = records
        raise error


def _one_or_many(name: str, value: Any, kind: type[Any]) -> list[Any]:
    """One value, or a sequence of them, as a list."""
    values = [value] if isinstance(value, kind) else value
    if isinstance(values, str) or not isinstance(values, Sequence):
        raise ValueError(f"{name} is {type(value).__name__}: must be {kind.__name__} or a list of {kind.__name__}")
    for k, one in enumerate(values):
        if not isinstance(one, kind):
            raise ValueError(f"{name}[{k}] is {type(one).__name__}: must be {kind.__name__}")
    if not values:
        raise ValueError(f"{name} is empty: must have at least one {kind.__name__}")
    return list(values)


def _check_range(name: str, rows: Floats) -> None:
    """The ranges of columns that `set_state` and `set_material` write. Rows that no body has are NaN."""
    if name == "rotation":
        _check.rows_within(name, rows, ~(abs(np.linalg.norm(rows, axis=-1) - 1) > 1e-3), "have unit length")
    elif name == "friction":
        _check.rows_within(name, rows, ~(rows < 0), "be 0 or more")
    elif name == "restitution":
        _check.rows_within(name, rows, ~((rows < 0) | (rows > 1)), "be 0 to 1")


def _threads(count: Any) -> int:
    threads = _check.whole("num_threads", count)
    if threads > MAX_THREADS:
        raise ValueError(f"num_threads = {threads}: must be at most {MAX_THREADS}")
    return threads


def _gpu(backend: Any, exact: Any) -> bool | None:
    """Whether a GPU runs in exact mode; None without a GPU."""
    if not (isinstance(backend, str) and backend in BACKENDS):
        raise ValueError(f"backend = {backend!r}: must be one of {', '.join(map(repr, BACKENDS))}")
    if not isinstance(exact, bool):
        raise ValueError(f"exact = {exact!r}: must be True or False")
    # The CPU is exact.
    return exact if backend == "gpu" else None


def _side(name: str, pixels: Any) -> int:
    side = _check.whole(name, pixels, 1)
    if side > MAX_PIXELS:
        raise ValueError(f"{name} = {side}: must be at most {MAX_PIXELS}")
    return side


def _step_length(dt: Any) -> float:
    length = _check.number("dt", dt)
    if not 1e-9 <= length <= 1:
        raise ValueError(f"dt = {length}: must be 1e-9 to 1 s")
    return length


def _read_only(array: NDArray[Any]) -> NDArray[Any]:
    view = array.view()
    view.flags.writeable = False
    return view
