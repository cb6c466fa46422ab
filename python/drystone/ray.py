"""Worlds on many machines: Ray actors that own batches (drystone[ray])."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Collection
from dataclasses import dataclass, field
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _check
from ._batch import COLUMNS, MEASURES, Batch, Snapshots, WorldError
from ._scene import Config, Scene

# Number of times that one call may end its actor.
MAX_DEATHS = 10


class _Worlds:
    """The worlds of one actor."""

    def __init__(self, scene: Scene, config: Config, worlds: int, states: list[bytes] | None) -> None:
        processors = int(_ray().get_runtime_context().get_assigned_resources().get("CPU", 1)) or 1
        self.batch = Batch(scene, worlds, config=config, num_threads=processors)
        if states is not None:
            self.batch.restore(Snapshots.from_bytes(states))

    def do(self, name: str, arguments: tuple[Any, ...], options: dict[str, Any]) -> Any:
        """Call a method of the batch by name."""
        return getattr(self.batch, name)(*arguments, **options)


@dataclass
class _Share:
    """The worlds of one actor in a fleet, and the data to rebuild the actor."""

    first: int
    count: int
    actor: Any = None
    kept: list[bytes] | None = None
    # Calls since `kept` that changed worlds.
    since: list[tuple[str, tuple[Any, ...], dict[str, Any]]] = field(default_factory=list)


class Fleet:
    """Worlds 0 to num_worlds - 1 of a scene, distributed over actors with `worlds_per_actor` worlds each.

    If an actor dies, with its process or its machine, it is rebuilt from bytes that are kept here every `keep_every`
    rollouts, and from the calls since then. All hashes are the same as without the loss. Ray must be initialized. As a
    context, `with Fleet(...) as fleet:`, it ends the actors at the end.

    `rebuilt` is the number of rebuilt actors.

    ValueError: an argument is invalid, or Ray is not initialized. RuntimeError: a call ended its actor ten times.

    >>> import ray, drystone as ds  # doctest: +SKIP
    >>> _ = ray.init()  # doctest: +SKIP
    >>> with ds.ray.Fleet(ds.Scene.find("drawbridge"), 100, worlds_per_actor=25) as fleet:  # doctest: +SKIP
    ...     out = fleet.rollout(60, record=("position", "hash"), every=60)
    ...     print(out["position"].shape, bool((out["hash"][:, 0] == fleet.hash()).all()))
    (100, 1, 3, 3) True
    """

    def __init__(
        self,
        scene: Scene,
        num_worlds: int,
        *,
        worlds_per_actor: int = 1024,
        cpus_per_actor: float = 1,
        keep_every: int = 10,
        config: Config | None = None,
    ) -> None:
        self.num_worlds = _check.whole("num_worlds", num_worlds, 1)
        each = _check.whole("worlds_per_actor", worlds_per_actor, 1)
        self._keep_every = _check.whole("keep_every", keep_every, 1)
        if _check.number("cpus_per_actor", cpus_per_actor) < 0:
            raise ValueError(f"cpus_per_actor = {cpus_per_actor}: must be 0 or more")
        self._scene = _check.kind_of("scene", scene, Scene)
        self._config = Config() if config is None else _check.kind_of("config", config, Config)
        self._ray = _ray()
        if not self._ray.is_initialized():
            raise ValueError("Ray is not initialized: call ray.init first")
        self._actor = self._ray.remote(max_restarts=0, num_cpus=cpus_per_actor)(_Worlds)
        self._shares = [_Share(k, min(each, num_worlds - k)) for k in range(0, num_worlds, each)]
        self.rebuilt = 0
        for share in self._shares:
            self._begin(share)

    def rollout(
        self, n: int, ctrl: ArrayLike | None = None, *, every: int = 1, record: Collection[str] = ("position",)
    ) -> dict[str, NDArray[Any]]:
        """`Batch.rollout` of all worlds. `ctrl` is [num_worlds or 1, n or 1, U], and the first axis of arrays is
        num_worlds.

        ValueError: an argument is invalid. WorldError: some worlds failed; all others completed the call.
        """
        n, every = _check.whole("n", n), _check.whole("every", every, 1)
        record = _check.words("record", record, [*COLUMNS, *MEASURES, "hash"])
        numbers = None if ctrl is None else _check.numbers("ctrl", ctrl, (-1, -1, -1))
        if numbers is not None and numbers.shape[0] not in (1, self.num_worlds):
            raise ValueError(f"ctrl has shape {numbers.shape}: must be ({self.num_worlds} or 1, {n} or 1, U)")

        def arguments(share: _Share) -> tuple[tuple[Any, ...], dict[str, Any]]:
            own = numbers
            if numbers is not None and len(numbers) > 1:
                own = numbers[share.first : share.first + share.count]
            return (n, own), {"every": every, "record": record}

        parts = self._all("rollout", arguments, changes=True)
        self._keep()
        return _joined(parts)

    def reset(self, worlds: ArrayLike | None = None) -> None:
        """`Batch.reset` of some worlds, or of all."""
        chosen = _check.worlds(worlds, self.num_worlds)
        self._all("reset", lambda share: ((self._own(share, chosen),), {}), changes=True)

    def hash(self) -> NDArray[np.uint64]:
        """The hash of each world."""
        return np.concatenate(self._all("hash", lambda share: ((), {})))

    def save(self) -> list[bytes]:
        """The state of each world as bytes."""
        return [state for part in self._all("save", lambda share: ((), {})) for state in part]

    def measure(self, *names: str) -> dict[str, NDArray[np.float64]]:
        """`Batch.measure` of all worlds."""
        return _joined(self._all("measure", lambda share: (names, {})))

    def close(self) -> None:
        """End the actors."""
        for share in self._shares:
            self._ray.kill(share.actor)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __len__(self) -> int:
        return self.num_worlds

    def __repr__(self) -> str:
        return f"<Fleet of {self.num_worlds} worlds on {len(self._shares)} actors>"

    @staticmethod
    def _own(share: _Share, chosen: NDArray[np.int64]) -> NDArray[np.int64]:
        own = chosen[(chosen >= share.first) & (chosen < share.first + share.count)]
        return own - share.first

    def _begin(self, share: _Share) -> None:
        share.actor = self._actor.remote(self._scene, self._config, share.count, share.kept)

    def _all(
        self,
        name: str,
        arguments: Callable[[_Share], tuple[tuple[Any, ...], dict[str, Any]]],
        changes: bool = False,
    ) -> list[Any]:
        """Call all actors at the same time, and return their results. Worlds that fail have their numbers in the
        fleet."""
        calls = [(name, *arguments(share)) for share in self._shares]
        running = [share.actor.do.remote(*call) for share, call in zip(self._shares, calls, strict=True)]
        results: list[Any] = []
        failed: list[WorldError] = []
        first_error: Exception | None = None
        for share, call, result in zip(self._shares, calls, running, strict=True):
            try:
                results.append(self._get(share, call, result))
            except WorldError as error:
                failed.append(WorldError(error.worlds + share.first, error.messages))
                results.append(error.records)
            except Exception as error:
                first_error = first_error or error
        if changes:
            # A call that failed in some worlds changed others.
            for share, call in zip(self._shares, calls, strict=True):
                share.since.append(call)
        if first_error is not None:
            raise first_error
        if failed:
            lines = [line for error in failed for line in error.messages]
            together = WorldError(np.concatenate([error.worlds for error in failed]), lines)
            together.records = _joined(results)
            raise together
        return results

    def _get(self, share: _Share, call: tuple[str, tuple[Any, ...], dict[str, Any]], running: Any) -> Any:
        for _ in range(MAX_DEATHS):
            try:
                return self._ray.get(running)
            except self._ray.exceptions.RayActorError:
                self.rebuilt += 1
                self._begin(share)
                # An actor runs its calls in this order.
                for before in share.since:
                    share.actor.do.remote(*before)
                running = share.actor.do.remote(*call)
            except self._ray.exceptions.RayTaskError as error:
                # Its own line, without the traceback of the actor.
                raise (error.cause if isinstance(error.cause, Exception) else error) from None
        raise RuntimeError(f"{call[0]} ended the actor of worlds {share.first} and on {MAX_DEATHS} times")

    def _keep(self) -> None:
        """Keep bytes of all worlds after enough calls."""
        if all(len(share.since) >= self._keep_every for share in self._shares):
            for share, kept in zip(self._shares, self._all("save", lambda share: ((), {})), strict=True):
                share.kept, share.since = kept, []


def _joined(parts: list[dict[str, NDArray[Any]]]) -> dict[str, NDArray[Any]]:
    """The arrays of all actors, one after another."""
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


def _ray() -> Any:
    try:
        return importlib.import_module("ray")
    except ImportError:
        raise ValueError("Ray is not installed: pip install 'drystone[ray]'") from None
