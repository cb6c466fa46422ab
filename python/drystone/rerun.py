"""Runs as rerun files, with contacts and errors beside the picture (drystone[rerun]). Writing them needs no viewer."""

from __future__ import annotations

import importlib
import os
from collections.abc import Collection
from types import TracebackType
from typing import Any, Self

import numpy as np

from . import _check
from ._batch import MEASURES, Batch

# Length of an arrow per impulse (m/(N s)): 1 m for the weight of a ton over a step of 1/60 s.
ARROW = 1 / 163.5


class log:
    """Write steps of one world of a batch to a `.rrd` file: poses, arrows of contact impulses, and measures as curves.

    Use it as a context, `with drystone.rerun.log(batch, to="run.rrd") as run:`, and call `run.step(n)` instead of
    `batch.step(n)`. It writes a frame after every `every` steps. Contacts have impulses if the batch listens to
    "impulses". The shapes are those of `Scene.to_dict`, in the order of the bodies.

    ValueError: an argument is invalid, or rerun is not installed.
    """

    def __init__(
        self,
        batch: Batch,
        scene: dict[str, Any] | None = None,
        *,
        world: int = 0,
        to: str | os.PathLike[str],
        every: int = 1,
        contacts: bool = True,
        measures: Collection[str] = ("overlap_max", "joint_gap", "kinetic_energy"),
    ) -> None:
        try:
            self._rerun: Any = importlib.import_module("rerun")
        except ImportError:
            raise ValueError("rerun is not installed: pip install 'drystone[rerun]'") from None
        self._batch, self._to = batch, os.fspath(to)
        self._world = int(_check.worlds([world], batch.num_worlds, "world")[0])
        self._every = _check.whole("every", every, 1)
        self._contacts = contacts
        self._measures = [_check.one_of("measures", name, MEASURES) for name in measures]
        self._bodies = (scene or {"bodies": []})["bodies"]

    def __enter__(self) -> Self:
        self._recording = self._rerun.RecordingStream("drystone")
        self._recording.save(self._to)
        self._recording.log("world", self._rerun.ViewCoordinates.RIGHT_HAND_Y_UP, static=True)
        for body, data in enumerate(self._bodies):
            for k, shape in enumerate(data.get("shapes", [])):
                self._log_shape(f"world/bodies/{body}/{k}", shape)
        self.frame()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._recording.flush()
        self._recording.disconnect()

    def step(self, n: int = 1) -> None:
        """Advance all worlds of the batch by n steps, and write a frame after every `every` steps."""
        left = _check.whole("n", n)
        while left > 0:
            count = min(left, self._every)
            self._batch.step(count)
            self.frame()
            left -= count

    def frame(self) -> None:
        """Write the present state of the world."""
        k, rerun, recording = self._world, self._rerun, self._recording
        recording.set_time("step", sequence=int(self._batch.steps[k]))
        recording.set_time("time", duration=float(self._batch.time[k]))
        poses = zip(self._batch.position[k], self._batch.rotation[k], self._batch.exists[k], strict=True)
        for body, (position, rotation, exists) in enumerate(poses):
            if exists:
                pose = rerun.Transform3D(translation=position, rotation=rerun.Quaternion(xyzw=rotation))
                recording.log(f"world/bodies/{body}", pose)
        for name, value in self._batch.measure(*self._measures, worlds=[k]).items():
            recording.log(f"errors/{name}", rerun.Scalars(float(value[0])))
        if self._contacts:
            self._log_contacts()

    def _log_contacts(self) -> None:
        contacts = self._batch.contacts([self._world])
        first = contacts.point_start[:-1]
        middles = [contacts.point[a:b].mean(axis=0) for a, b in zip(first, contacts.point_start[1:], strict=True)]
        origins = np.array(middles, np.float32).reshape(-1, 3)
        arrows = self._rerun.Arrows3D(origins=origins, vectors=ARROW * contacts.impulse)
        self._recording.log("world/contacts", arrows)

    def _log_shape(self, path: str, shape: dict[str, Any]) -> None:
        rerun, kind = self._rerun, shape["type"]
        if kind == "cuboid":
            mesh = rerun.Boxes3D(half_sizes=[shape["half_extents"]])
        elif kind == "ball":
            mesh = rerun.Ellipsoids3D(radii=[shape["radius"]])
        elif kind in ("capsule", "cylinder", "cone"):
            height, radius = shape["half_height"], shape["radius"]
            mesh = rerun.Boxes3D(half_sizes=[[radius, height + (radius if kind == "capsule" else 0), radius]])
        elif kind in ("convex_hull", "mesh"):
            mesh = rerun.Points3D(shape.get("points", shape.get("vertices")))
        else:
            # A half-space or a height field has no extent to draw.
            return
        pose = {"position": [0, 0, 0], "rotation": [0, 0, 0, 1], **shape}
        rotation = rerun.Quaternion(xyzw=pose["rotation"])
        self._recording.log(path, rerun.Transform3D(translation=pose["position"], rotation=rotation), static=True)
        self._recording.log(path, mesh, static=True)
