"""Environments for training: batches as Gymnasium's `VectorEnv` (drystone[gym])."""

from __future__ import annotations

import pickle
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np

try:
    import gymnasium
except ImportError as error:
    raise ImportError("Gymnasium is not installed: pip install 'drystone[gym]'") from error
from gymnasium import spaces
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from . import _check, _drystone
from ._batch import Batch, Snapshots, WorldError
from ._build import Body, Joint, World
from ._scene import Config, Scene

Floats = NDArray[np.float32]
Observe = Callable[[Batch], NDArray[Any]]
Reward = Callable[[Batch, NDArray[Any]], NDArray[Any]]
Terminated = Callable[[Batch], NDArray[np.bool_]]
Act = Callable[[Batch, NDArray[Any]], None]
Start = Callable[[np.random.Generator, Batch, int], None]
RENDER_MODES = ["rgb_array"]


class VectorEnv(gymnasium.vector.VectorEnv[Floats, NDArray[Any], NDArray[Any]]):
    """A batch as parallel environments.

    `observe(batch)` returns [W, ...], `reward(batch, actions)` [W], and `terminated(batch)` bool [W]. `act(batch,
    actions)` writes inputs; None sets `ctrl` to the actions. `start(rng, batch, world)` changes a world after its
    reset. `memory` has the arrays that these functions keep from step to step, so that `state` saves them. An action
    lasts `frame_skip` steps, and an episode is truncated after `max_steps` actions.

    All three autoreset modes are supported. World k has the seed s + k, or the k-th seed of a list. Its n-th episode
    depends only on that seed and n, not on other worlds. A failed world is terminated, infos["error"] has the reason,
    and the next reset repairs it. The arrays that `reset` and `step` return are copies.

    With the render mode "rgb_array", `render` returns one picture for each world, [480, 640, 3] (`Batch.picture`).

    ValueError: an argument is invalid, or a function returns another shape.

    >>> from drystone.gym import cart_pole
    >>> envs = cart_pole(4)
    >>> observations, _ = envs.reset(seed=1)
    >>> observations, rewards, terminated, truncated, infos = envs.step(envs.action_space.sample())
    >>> observations.shape, rewards.tolist()
    ((4, 4), [1.0, 1.0, 1.0, 1.0])
    """

    def __init__(
        self,
        batch: Batch,
        *,
        action_space: spaces.Space[Any],
        observe: Observe,
        reward: Reward,
        act: Act | None = None,
        terminated: Terminated | None = None,
        start: Start | None = None,
        observation_space: spaces.Space[Any] | None = None,
        memory: dict[str, NDArray[Any]] | None = None,
        max_steps: int | None = None,
        frame_skip: int = 1,
        autoreset_mode: AutoresetMode = AutoresetMode.NEXT_STEP,
        render_mode: str | None = None,
    ) -> None:
        self.batch = _check.kind_of("batch", batch, Batch)
        self.num_envs = batch.num_worlds
        if not isinstance(autoreset_mode, AutoresetMode):
            names = ", ".join(f"AutoresetMode.{mode.name}" for mode in AutoresetMode)
            raise ValueError(f"autoreset_mode = {autoreset_mode!r}: must be one of {names}")
        self.metadata = {"render_modes": RENDER_MODES, "autoreset_mode": autoreset_mode}
        if render_mode is not None:
            _check.one_of("render_mode", render_mode, RENDER_MODES)
        self.render_mode = render_mode
        if act is None and action_space.shape != (batch.num_actuators,):
            raise ValueError(f"action_space has shape {action_space.shape}: must be ({batch.num_actuators},), or act be given")
        self._observe, self._reward, self._act = observe, reward, act or _set_ctrl
        self._terminated, self._start, self._memory = terminated, start, memory or {}
        self._max_steps = None if max_steps is None else _check.whole("max_steps", max_steps, 1)
        self._frame_skip = _check.whole("frame_skip", frame_skip, 1)
        if batch._scenes:
            self.metadata["render_fps"] = max(1, round(1 / (batch._scenes[0].dt * self._frame_skip)))
        shape = np.asarray(observe(batch)).shape
        if shape[:1] != (batch.num_worlds,):
            raise ValueError(f"observe gives shape {shape}: must begin with {batch.num_worlds}, the number of worlds")
        own = observation_space or spaces.Box(-np.inf, np.inf, shape[1:], np.float32)
        self.single_observation_space, self.single_action_space = own, action_space
        self.observation_space = batch_space(own, self.num_envs)
        self.action_space = batch_space(action_space, self.num_envs)
        self._seeds = [int(seed) for seed in np.random.SeedSequence().generate_state(self.num_envs)]
        self._episodes = np.full(self.num_envs, -1)
        self._elapsed = np.zeros(self.num_envs, np.int64)
        self._is_over = np.zeros(self.num_envs, bool)

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Floats, dict[str, Any]]:
        """Start new episodes in all worlds, or in those of `options["reset_mask"]`. A seed starts with episode 0.

        ValueError: the number of seeds is wrong, or the mask is not a bool array [W] with a True.
        """
        mask = self._mask(options)
        seeds: list[int | None]
        if isinstance(seed, (list, tuple, np.ndarray)):
            seeds = [None if one is None else _check.whole("seed", one) for one in seed]
        else:
            first = None if seed is None else _check.whole("seed", seed)
            seeds = [None if first is None else first + k for k in range(self.num_envs)]
        if len(seeds) != self.num_envs:
            raise ValueError(f"seed has {len(seeds)} numbers: must have {self.num_envs}")
        for world in np.flatnonzero(mask):
            own = seeds[int(world)]
            if own is not None:
                self._seeds[world], self._episodes[world] = own, -1
        self._begin(mask)
        return self._observations(), {}

    def step(
        self, actions: NDArray[Any]
    ) -> tuple[Floats, NDArray[Any], NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]]:
        """Act in all worlds. In the mode NEXT_STEP, a world whose episode is over starts a new episode instead.

        ValueError: the actions have another shape. RuntimeError: in the mode DISABLED, a world whose episode is over
        was not reset.
        """
        actions = np.asarray(actions)
        if actions.shape != self.action_space.shape:
            raise ValueError(f"actions has shape {actions.shape}: must be {self.action_space.shape}")
        mode = self.metadata["autoreset_mode"]
        begins = self._is_over.copy()
        if begins.any() and mode is not AutoresetMode.NEXT_STEP:
            raise RuntimeError(f"the episode of world {np.flatnonzero(begins)[0]} is over: reset it by its mask")
        if not begins.all():
            self._act(self.batch, actions)
        if begins.any():
            # After the action, which has no effect on these worlds.
            self._begin(begins)
        infos: dict[str, Any] = {}
        failed = self._go(~begins, infos)
        observations = self._observations()
        rewards = self._of_worlds("reward", self._reward(self.batch, actions)).astype(np.float64)
        terminated = failed
        if self._terminated is not None:
            terminated = failed | self._of_worlds("terminated", self._terminated(self.batch)).astype(bool)
        truncated = np.zeros(self.num_envs, bool)
        if self._max_steps is not None:
            truncated = (self._elapsed >= self._max_steps) & ~terminated
        rewards[begins | failed] = 0
        terminated, truncated = terminated & ~begins, truncated & ~begins
        self._is_over = terminated | truncated
        if mode is AutoresetMode.SAME_STEP and self._is_over.any():
            observations, infos = self._begin_at_once(observations, infos)
        return observations, rewards, terminated, truncated, infos

    def state(self) -> bytes:
        """The state of all environments: worlds, inputs, episodes, seeds and memory. From it they continue with the
        same bits.

        >>> from drystone.gym import cart_pole
        >>> envs, others = cart_pole(2), cart_pole(2)
        >>> _ = envs.reset(seed=1), others.reset(seed=7)
        >>> others.set_state(envs.state())
        >>> actions = envs.action_space.sample()
        >>> bool((envs.step(actions)[0] == others.step(actions)[0]).all())
        True
        """
        inputs = {name: getattr(self.batch, name).copy() for name in ("force", "torque", "ctrl", "gravity")}
        clocks = (list(self._seeds), self._episodes.copy(), self._elapsed.copy(), self._is_over.copy())
        return pickle.dumps((self.batch.save(), inputs, clocks, self._memory))

    def set_state(self, state: bytes) -> None:
        """Continue from a state of `state`, also of another process. The state is a pickle: load only trusted states.

        ValueError: the state has another number of worlds or other memory, or is not a state.
        """
        try:
            worlds, inputs, clocks, memory = pickle.loads(state)
        except Exception:
            raise ValueError("state: must be the bytes of `state`, unchanged") from None
        if len(worlds) != self.num_envs:
            raise ValueError(f"state has {len(worlds)} worlds: must have {self.num_envs}")
        if set(memory) != set(self._memory):
            raise ValueError(f"state has the memory {sorted(memory)}: must have {sorted(self._memory)}")
        self.batch.restore(Snapshots.from_bytes(worlds))
        for name, value in inputs.items():
            setattr(self.batch, name, value)
        for name, value in memory.items():
            self._memory[name][...] = value
        seeds, episodes, elapsed, is_over = clocks
        self._seeds, self._episodes = list(seeds), episodes.copy()
        self._elapsed, self._is_over = elapsed.copy(), is_over.copy()

    def _mask(self, options: dict[str, Any] | None) -> NDArray[np.bool_]:
        mask = (options or {}).get("reset_mask")
        if mask is None:
            return np.ones(self.num_envs, bool)
        if not isinstance(mask, np.ndarray) or mask.dtype != bool or mask.shape != (self.num_envs,) or not mask.any():
            raise ValueError(f"reset_mask = {mask!r}: must be an array of {self.num_envs} bools with a True")
        return mask

    def _begin(self, mask: NDArray[np.bool_]) -> None:
        self.batch.reset(mask)
        self._episodes[mask] += 1
        self._elapsed[mask] = 0
        self._is_over[mask] = False
        if self._start is not None:
            for world in np.flatnonzero(mask):
                rng = np.random.default_rng([self._seeds[world], int(self._episodes[world])])
                self._start(rng, self.batch, int(world))

    def _go(self, mask: NDArray[np.bool_], infos: dict[str, Any]) -> NDArray[np.bool_]:
        failed = np.zeros(self.num_envs, bool)
        try:
            self.batch.step(self._frame_skip, worlds=mask)
        except WorldError as error:
            failed[error.worlds] = True
            lines = np.full(self.num_envs, None, object)
            lines[error.worlds] = error.messages
            infos.update({"error": lines, "_error": failed.copy()})
        self._elapsed[mask] += 1
        return failed

    def _begin_at_once(self, observations: Floats, infos: dict[str, Any]) -> tuple[Floats, dict[str, Any]]:
        mask = self._is_over.copy()
        for world in np.flatnonzero(mask):
            own = {name: infos[name][world] for name in ("error",) if name in infos and infos[f"_{name}"][world]}
            infos = self._add_info(infos, {"final_obs": observations[world].copy(), "final_info": own}, int(world))
        self._begin(mask)
        return self._observations(), infos

    def _observations(self) -> Floats:
        return np.array(self._observe(self.batch), self.single_observation_space.dtype)

    def _of_worlds(self, name: str, value: Any) -> NDArray[Any]:
        """One number for each world, from a function of the caller."""
        array = np.array(value)
        if array.shape != (self.num_envs,):
            raise ValueError(f"{name} gives shape {array.shape}: must be ({self.num_envs},)")
        return array

    def render(self) -> tuple[NDArray[np.uint8], ...] | None:
        """One picture for each world, [480, 640, 3], or None without a render mode.

        AdapterError: there is no adapter.
        """
        if self.render_mode is None:
            return None
        return tuple(self.batch.picture(world) for world in range(self.num_envs))


def _set_ctrl(batch: Batch, actions: NDArray[Any]) -> None:
    batch.ctrl[...] = actions


class Env(gymnasium.Env[Floats, NDArray[Any]]):
    """A single environment, over a `VectorEnv` of one world. `make` is a function such as `cart_pole`, and gets the
    options.

    >>> from drystone.gym import Env, cart_pole
    >>> env = Env(cart_pole, max_steps=100)
    >>> observation, info = env.reset(seed=1)
    >>> observation, reward, terminated, truncated, info = env.step(env.action_space.sample())
    >>> observation.shape, reward, terminated
    ((4,), 1.0, False)
    """

    def __init__(self, make: Callable[..., VectorEnv], **options: Any) -> None:
        self.envs = make(1, autoreset_mode=AutoresetMode.DISABLED, **options)
        self.metadata = {name: value for name, value in self.envs.metadata.items() if name != "autoreset_mode"}
        self.render_mode = self.envs.render_mode
        self.observation_space = self.envs.single_observation_space
        self.action_space = self.envs.single_action_space

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Floats, dict[str, Any]]:
        """Start an episode."""
        super().reset(seed=seed)
        observations, infos = self.envs.reset(seed=seed)
        return observations[0], infos

    def step(self, action: NDArray[Any]) -> tuple[Floats, float, bool, bool, dict[str, Any]]:
        """Make one action."""
        observations, rewards, terminated, truncated, infos = self.envs.step(np.asarray(action)[None])
        info = {name: value[0] for name, value in infos.items() if not name.startswith("_")}
        return observations[0], float(rewards[0]), bool(terminated[0]), bool(truncated[0]), info

    def render(self) -> NDArray[np.uint8] | None:
        """A picture [480, 640, 3], or None without a render mode."""
        pictures = self.envs.render()
        return None if pictures is None else pictures[0]


HALF_POLE, MAX_ANGLE, MAX_WAY, PUSH = 0.5, 0.21, 2.4, 10.0


def _cart_and_pole() -> Scene:
    world = World()
    cart = world.add(Body.dynamic("cart").cuboid(0.25, 0.1, 0.15).mass(1).groups(1, 0).at(0, 0, 0))
    pole = world.add(Body.dynamic("pole").cuboid(0.03, HALF_POLE, 0.03).mass(0.1).groups(1, 0).at(0, HALF_POLE, 0))
    world.join(Joint(cart).slider((1, 0, 0)).at(0, 0, 0))
    world.join(Joint(pole, cart).hinge((0, 0, 1)).at(0, 0, 0))
    return Scene.from_world(world, dt=1 / 50, name="cart and pole")


def cart_pole(
    num_envs: int,
    *,
    max_steps: int = 500,
    num_threads: int = 0,
    autoreset_mode: AutoresetMode = AutoresetMode.NEXT_STEP,
    render_mode: str | None = None,
) -> VectorEnv:
    """Push a cart (1 kg, up to 10 N) so that the pole on it (0.1 kg, 1 m) stays upright. The reward is 1 for each step
    of 1/50 s.

    Observations: position and speed of the cart (m, m/s), angle and angular velocity of the pole (rad, rad/s). An
    episode ends beyond 2.4 m or 0.21 rad.

    >>> from drystone.gym import cart_pole
    >>> observations, _ = cart_pole(3).reset(seed=[5, 6, 5])
    >>> bool((observations[0] == observations[2]).all()), bool((observations[0] == observations[1]).all())
    (True, False)
    """
    batch = Batch(_cart_and_pole(), num_envs, config=Config(sleep=False), num_threads=num_threads)

    def observe(batch: Batch) -> NDArray[Any]:
        angle = 2 * np.arctan2(batch.rotation[:, 1, 2], batch.rotation[:, 1, 3])
        angle = (angle + np.pi) % (2 * np.pi) - np.pi
        speeds = batch.linear_velocity[:, 0, 0], batch.angular_velocity[:, 1, 2]
        return np.stack([batch.position[:, 0, 0], speeds[0], angle, speeds[1]], axis=1)

    def terminated(batch: Batch) -> NDArray[np.bool_]:
        way, _, angle, _ = observe(batch).T
        fell: NDArray[np.bool_] = (np.abs(way) > MAX_WAY) | (np.abs(angle) > MAX_ANGLE)
        return fell

    def act(batch: Batch, actions: NDArray[Any]) -> None:
        batch.force[:, 0, 0] = PUSH * np.clip(actions[:, 0], -1, 1)

    def start(rng: np.random.Generator, batch: Batch, world: int) -> None:
        x, speed, angle, turning = rng.uniform(-0.05, 0.05, 4)
        batch.set_state(
            worlds=[world],
            bodies=[0, 1],
            position=[[[x, 0, 0], [x - HALF_POLE * np.sin(angle), HALF_POLE * np.cos(angle), 0]]],
            rotation=[[[0, 0, 0, 1], [0, 0, np.sin(angle / 2), np.cos(angle / 2)]]],
            linear_velocity=[[[speed, 0, 0], [speed - HALF_POLE * turning, 0, 0]]],
            angular_velocity=[[[0, 0, 0], [0, 0, turning]]],
        )

    return VectorEnv(
        batch,
        action_space=spaces.Box(-1, 1, (1,), np.float32),
        observe=observe,
        reward=lambda batch, actions: np.ones(batch.num_worlds),
        act=act,
        terminated=terminated,
        start=start,
        max_steps=max_steps,
        autoreset_mode=autoreset_mode,
        render_mode=render_mode,
    )


def drawbridge(
    num_envs: int,
    *,
    max_steps: int = 300,
    num_threads: int = 0,
    autoreset_mode: AutoresetMode = AutoresetMode.NEXT_STEP,
    render_mode: str | None = None,
) -> VectorEnv:
    """Hold a deck with a crate at a target angle, by the speeds of two winches (m/s, up to 0.5). Each episode draws the
    angle.

    Observations: angle and angular velocity of the deck (rad, rad/s), target angle (rad), position and velocity of the
    crate (m, m/s). The reward is minus the distance between angle and target. An episode ends when the crate falls off
    the deck.

    >>> from drystone.gym import drawbridge
    >>> envs = drawbridge(2)
    >>> observations, _ = envs.reset(seed=1)
    >>> observations.shape, envs.single_action_space.shape
    ((2, 9), (2,))
    """
    batch = Batch(Scene.find("drawbridge"), num_envs, config=Config(sleep=False), num_threads=num_threads)
    wanted = np.zeros(num_envs, np.float32)

    def angle_of(batch: Batch) -> NDArray[Any]:
        return 2 * np.arctan2(batch.rotation[:, 1, 2], batch.rotation[:, 1, 3])

    def observe(batch: Batch) -> NDArray[Any]:
        angles = np.stack([angle_of(batch), batch.angular_velocity[:, 1, 2], wanted], axis=1)
        return np.concatenate([angles, batch.position[:, 2], batch.linear_velocity[:, 2]], axis=1)

    def act(batch: Batch, actions: NDArray[Any]) -> None:
        batch.ctrl[...] = 0.5 * np.clip(actions, -1, 1)

    def start(rng: np.random.Generator, batch: Batch, world: int) -> None:
        wanted[world] = rng.uniform(0.1, 0.5)

    return VectorEnv(
        batch,
        action_space=spaces.Box(-1, 1, (2,), np.float32),
        observe=observe,
        reward=lambda batch, actions: -np.abs(angle_of(batch) - wanted),
        act=act,
        terminated=lambda batch: batch.position[:, 2, 1] < -1,
        memory={"wanted": wanted},
        start=start,
        max_steps=max_steps,
        autoreset_mode=autoreset_mode,
        render_mode=render_mode,
    )


# Largest tilt rate of the board (degrees/s), and largest distance of an arrived ball from the center of the goal
# (cells).
TILT_RATE, ARRIVED = 60.0, 0.4
# Board, goal and lids of the walls rotate together. The ball is the next body.
BOARD, BALL = (0, 1, 2), 3
MAZE_SKIP = 6


class _Board:
    """A board of the maze game: its cells, and the distance of each cell from the goal."""

    def __init__(self, name: str) -> None:
        scene, rows, self.cell, self.radius, self.steepest = _drystone.maze(name)
        self.scene = Scene(scene, ())
        self.cells = np.array([list(row) for row in rows])
        self.size = np.array(self.cells.shape)
        self.start, self.goal = (self.middle(np.argwhere(self.cells == symbol)[0]) for symbol in "SG")
        self.left = self._left()

    def middle(self, place: NDArray[Any]) -> NDArray[Any]:
        """Center of a cell, x and z (m)."""
        middle: NDArray[Any] = (self.cell * (place + 0.5 - 0.5 * self.size))[::-1]
        return middle

    def left_at(self, ball: NDArray[Any]) -> NDArray[Any]:
        """Number of cells from balls [W, 2] (x and z) to the goal, around walls and holes."""
        places = np.floor(ball[:, ::-1] / self.cell + 0.5 * self.size).astype(int)
        row, column = np.clip(places, 0, self.size - 1).T
        left: NDArray[Any] = self.left[row, column]
        return left

    def _left(self) -> NDArray[Any]:
        left = np.full(self.cells.shape, float(self.cells.size))
        wave = [tuple(int(i) for i in np.argwhere(self.cells == "G")[0])]
        left[wave[0]] = 0
        for row, column in wave:
            for place in ((row - 1, column), (row + 1, column), (row, column - 1), (row, column + 1)):
                inside = 0 <= place[0] < self.size[0] and 0 <= place[1] < self.size[1]
                if inside and self.cells[place] not in "#O" and left[place] == self.cells.size:
                    left[place] = left[row, column] + 1
                    wave.append(place)
        return left


def _turn_back(rotation: NDArray[Any], vector: NDArray[Any]) -> NDArray[Any]:
    """Vectors [W, 3] in the frames with rotations [W, 4]."""
    axis, w = -rotation[:, :3], rotation[:, 3:]
    across = np.cross(axis, vector)
    turned: NDArray[Any] = vector + 2 * (w * across + np.cross(axis, across))
    return turned


def _tilts(rotation: NDArray[Any]) -> NDArray[Any]:
    """Tilts of boards [W, 2] to the right and to the front (rad)."""
    x, _, z, w = rotation.T
    return np.stack([2 * np.arctan2(-z, w), 2 * np.arctan2(x, w)], axis=1)


def maze(
    num_envs: int,
    *,
    board: str = "easy",
    max_steps: int = 1200,
    num_threads: int = 0,
    autoreset_mode: AutoresetMode = AutoresetMode.NEXT_STEP,
    render_mode: str | None = None,
) -> VectorEnv:
    """Tilt a board so that a ball rolls to the goal and past the holes. `board` is easy, medium, hard or a file
    (docs/pictures.md).

    Actions: the wanted tilts to the right and to the front; 1 is the steepest. The board rotates by at most 60 degrees
    a second. An action lasts 1/20 s. Observations: position of the ball on the board and its velocity (m, m/s), both
    tilts (rad), and the straight vector to the goal (m).

    Each episode starts within a centimeter of the center of the start along each axis. It ends at the goal (reward 1)
    or in a hole (reward -1). An action costs a thousandth of the number of cells left to the goal, around walls and
    holes.

    ValueError: there is no board of that name.

    >>> from drystone.gym import maze
    >>> envs = maze(2, board="easy")
    >>> observations, _ = envs.reset(seed=1)
    >>> observations, rewards, terminated, truncated, _ = envs.step(envs.action_space.sample())
    >>> observations.shape, rewards.round(3).tolist()
    ((2, 8), [-0.016, -0.016])
    """
    own = _Board(board)
    batch = Batch(own.scene, num_envs, config=Config(sleep=False), num_threads=num_threads)
    time = MAZE_SKIP * own.scene.dt
    reach, steepest = np.radians(TILT_RATE) * time, np.radians(own.steepest)

    def ball(batch: Batch) -> NDArray[Any]:
        return _turn_back(batch.rotation[:, 0], batch.position[:, BALL])

    def observe(batch: Batch) -> NDArray[Any]:
        at, speed = ball(batch)[:, ::2], _turn_back(batch.rotation[:, 0], batch.linear_velocity[:, BALL])[:, ::2]
        return np.concatenate([at, speed, _tilts(batch.rotation[:, 0]), own.goal - at], axis=1)

    def has_arrived(batch: Batch) -> NDArray[np.bool_]:
        near: NDArray[np.bool_] = np.linalg.norm(ball(batch)[:, ::2] - own.goal, axis=1) < ARRIVED * own.cell
        return near & (ball(batch)[:, 1] > 0)

    def has_fallen(batch: Batch) -> NDArray[np.bool_]:
        low: NDArray[np.bool_] = ball(batch)[:, 1] < 0
        return low

    def act(batch: Batch, actions: NDArray[Any]) -> None:
        # The tilt comes from the poses alone, so worlds that do not step need no memory of it.
        tilts = _tilts(batch.rotation[:, 0].astype(np.float64))
        wanted = tilts + np.clip(steepest * np.clip(actions, -1, 1) - tilts, -reach, reach)
        right, front = wanted.T / 2
        turn = np.stack([np.sin(front) * np.cos(right), np.sin(front) * np.sin(right), -np.cos(front) * np.sin(right)], axis=1)
        target = np.concatenate([turn, (np.cos(front) * np.cos(right))[:, None]], axis=1)
        # The rotation from the present pose to the target, about world axes.
        axis, w = -batch.rotation[:, 0, :3].astype(np.float64), batch.rotation[:, 0, 3:].astype(np.float64)
        between = target[:, 3:] * axis + w * target[:, :3] + np.cross(target[:, :3], axis)
        speeds = np.repeat((2 * between / time)[:, None], len(BOARD), axis=1)
        batch.set_state(bodies=BOARD, angular_velocity=speeds)

    def start(rng: np.random.Generator, batch: Batch, world: int) -> None:
        x, z = own.start + rng.uniform(-0.01, 0.01, 2)
        batch.set_state(worlds=[world], bodies=[BALL], position=[[[x, own.radius, z]]])

    def reward(batch: Batch, actions: NDArray[Any]) -> NDArray[Any]:
        ends = has_arrived(batch).astype(float) - has_fallen(batch)
        rewards: NDArray[Any] = ends - 1e-3 * own.left_at(ball(batch)[:, ::2])
        return rewards

    return VectorEnv(
        batch,
        action_space=spaces.Box(-1, 1, (2,), np.float32),
        observe=observe,
        reward=reward,
        act=act,
        terminated=lambda batch: has_arrived(batch) | has_fallen(batch),
        start=start,
        max_steps=max_steps,
        frame_skip=MAZE_SKIP,
        autoreset_mode=autoreset_mode,
        render_mode=render_mode,
    )


DECK, WHEEL, TRACK = 4.0, 0.2, 0.4
# Largest speed (rad/s) and torque (N m) of the winch, then of the wheels.
WINCH, DRIVE = (0.4, 1.2e4), (15.0, 60.0)


def _cart_and_drawbridge() -> Scene:
    world = World()
    world.add(Body.fixed("road").cuboid(3, 1, 1).friction(1).groups(1, 4).at(-3, -1, 0))
    world.add(Body.fixed("far road").cuboid(3, 1, 1).friction(1).groups(1, 4).at(DECK + 3, -1, 0))
    half = DECK / 2 - 0.01
    deck = world.add(Body.dynamic("deck").cuboid(half, 0.1, 1).mass(200).friction(1).groups(2, 4).at(DECK / 2, -0.1, 0))
    cart = world.add(Body.dynamic("cart").cuboid(0.5, 0.1, 0.15).mass(30).groups(4, 3).at(-2, 0.3, 0))
    world.join(Joint(deck).hinge((0, 0, 1)).at(0, -0.1, 0).limited(0, 1.2).motor(0, WINCH[1]))
    for x in (-TRACK, TRACK):
        for z in (-TRACK, TRACK):
            wheel = Body.dynamic(f"wheel {x:+g} {z:+g}").ball(WHEEL).mass(3).friction(1).groups(4, 3).at(x - 2, WHEEL, z)
            world.join(Joint(world.add(wheel), cart).hinge((0, 0, 1)).at(x - 2, WHEEL, z).motor(0, DRIVE[1]))
    return Scene.from_world(world, dt=1 / 60, name="cart and drawbridge")


def cart_on_drawbridge(
    num_envs: int,
    *,
    max_steps: int = 400,
    num_threads: int = 0,
    autoreset_mode: AutoresetMode = AutoresetMode.NEXT_STEP,
    render_mode: str | None = None,
) -> VectorEnv:
    """Lower a drawbridge of 4 m by its winch, and drive a cart with four wheels over it to the far road.

    Actions: speeds of the winch (1 is 0.4 rad/s up) and of the wheels (1 is 15 rad/s ahead). An action lasts 1/30 s.
    Observations: position and velocity of the cart along the road and up (m, m/s), the angles of cart and deck (rad),
    and their angular velocities (rad/s).

    Each episode draws the initial angle of the deck, 0.2 to 1 rad. It ends on the far road (reward 10) or below the
    roads. The reward of an action is the distance driven ahead (m).

    >>> from drystone.gym import cart_on_drawbridge
    >>> envs = cart_on_drawbridge(2)
    >>> observations, _ = envs.reset(seed=1)
    >>> observations.shape, envs.single_action_space.shape
    ((2, 8), (2,))
    """
    scene = _cart_and_drawbridge()
    batch = Batch(scene, num_envs, config=Config(sleep=False), num_threads=num_threads)
    deck, cart = scene.bodies.index("deck"), scene.bodies.index("cart")
    skip = 2

    def angle(batch: Batch, body: int) -> NDArray[Any]:
        return 2 * np.arctan2(batch.rotation[:, body, 2], batch.rotation[:, body, 3])

    def observe(batch: Batch) -> NDArray[Any]:
        turning = batch.angular_velocity[:, [cart, deck], 2]
        angles = np.stack([angle(batch, cart), angle(batch, deck)], axis=1)
        return np.concatenate([batch.position[:, cart, :2], batch.linear_velocity[:, cart, :2], angles, turning], axis=1)

    def is_over(batch: Batch) -> NDArray[np.bool_]:
        return (batch.position[:, cart, 0] > DECK + 1) & (batch.position[:, cart, 1] > 0)

    def act(batch: Batch, actions: NDArray[Any]) -> None:
        wanted = np.clip(actions, -1, 1)
        batch.ctrl[:, 0] = WINCH[0] * wanted[:, 0]
        # A wheel that rolls ahead rotates against the axis of its hinge.
        batch.ctrl[:, 1:] = -DRIVE[0] * wanted[:, 1:]

    def start(rng: np.random.Generator, batch: Batch, world: int) -> None:
        up = rng.uniform(0.2, 1.0)
        place = [DECK / 2 * np.cos(up), DECK / 2 * np.sin(up) - 0.1, 0]
        rotation = [0, 0, np.sin(up / 2), np.cos(up / 2)]
        batch.set_state(worlds=[world], bodies=[deck], position=[[place]], rotation=[[rotation]])

    def reward(batch: Batch, actions: NDArray[Any]) -> NDArray[Any]:
        rewards: NDArray[Any] = batch.linear_velocity[:, cart, 0] * (skip * scene.dt) + 10 * is_over(batch)
        return rewards

    return VectorEnv(
        batch,
        action_space=spaces.Box(-1, 1, (2,), np.float32),
        observe=observe,
        reward=reward,
        act=act,
        terminated=lambda batch: is_over(batch) | (batch.position[:, cart, 1] < -1),
        start=start,
        max_steps=max_steps,
        frame_skip=skip,
        autoreset_mode=autoreset_mode,
        render_mode=render_mode,
    )


# `gymnasium.make` and `gymnasium.make_vec` find these after `import drystone.gym`.
for _name, _make in {
    "CartPole": cart_pole,
    "Drawbridge": drawbridge,
    "Maze": maze,
    "CartOnDrawbridge": cart_on_drawbridge,
}.items():
    gymnasium.register(f"drystone/{_name}-v0", partial(Env, _make), vector_entry_point=f"{__name__}:{_make.__name__}")
