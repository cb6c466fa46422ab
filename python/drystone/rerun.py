"""Runs as rerun files, with contacts and errors beside the picture (drystone[rerun]). Writing them needs no viewer."""

from __future__ import annotations

import importlib
import os
from collections.abc import Collection, Mapping
from types import TracebackType
from typing import Any, Self

import numpy as np

from . import _check
from ._batch import MEASURES, Batch
from ._scene import Scene

# Length of an arrow per impulse (m/(N s)): 1 m for the weight of a ton over a step of 1/60 s.
ARROW = 1 / 163.5

# Rotation of the z axis to the y axis.
Z_TO_Y = (-(0.5**0.5), 0.0, 0.0, 0.5**0.5)
# Corners of the base of a cone.
CORNERS = 24


class log:
    """Write steps of one world of a batch to a `.rrd` file: poses, arrows of contact impulses, and measures as curves.

    Use it as a context, `with drystone.rerun.log(batch, to="run.rrd") as run:`, and call `run.step(n)` instead of
    `batch.step(n)`. It writes a frame after every `every` steps. Contacts have impulses if the batch listens to
    "impulses". `scene` gives the shapes; None is the scene of the world. A batch that was loaded from states needs it.
    Hulls are drawn as points, and half-spaces and height fields are not drawn.

    ValueError: an argument is invalid, or rerun is not installed.

    >>> import drystone as ds
    >>> batch = ds.Batch(ds.Scene.find("tower", n=3), listen=["impulses"])
    >>> with ds.rerun.log(batch, to="run.rrd", every=5) as run:  # doctest: +SKIP
    ...     run.step(60)
    """

    def __init__(
        self,
        batch: Batch,
        scene: Scene | Mapping[str, Any] | None = None,
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
        self._batch, self._to = _check.kind_of("batch", batch, Batch), _check.path("to", to)
        self._world = int(_check.worlds([world], batch.num_worlds, "world")[0])
        self._every = _check.whole("every", every, 1)
        self._contacts = contacts
        self._measures = _check.words("measures", measures, MEASURES)
        self._bodies = self._shapes_of(scene)

    def _shapes_of(self, scene: Any) -> list[dict[str, Any]]:
        """The bodies of a scene file."""
        if scene is None:
            if not self._batch._scenes:
                raise ValueError("scene is None: must be a Scene, because the batch was loaded from states")
            scene = self._batch._scenes[self._world]
        data = scene.to_dict() if isinstance(scene, Scene) else scene
        if not isinstance(data, Mapping) or "bodies" not in data:
            raise ValueError(f"scene is {type(scene).__name__}: must be a Scene, or a dict as of Scene.to_dict")
        bodies: list[dict[str, Any]] = data["bodies"]
        return bodies

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
        elif kind in ("capsule", "cylinder"):
            half, radius = shape["half_height"], shape["radius"]
            # Those of rerun are along z, and a capsule begins at the origin.
            upright = {"lengths": [2 * half], "radii": [radius], "quaternions": [rerun.Quaternion(xyzw=Z_TO_Y)]}
            if kind == "capsule":
                mesh = rerun.Capsules3D(translations=[[0, -half, 0]], **upright)
            else:
                mesh = rerun.Cylinders3D(**upright)
        elif kind == "cone":
            mesh = rerun.Mesh3D(**_cone(shape["half_height"], shape["radius"]))
        elif kind == "mesh":
            mesh = rerun.Mesh3D(vertex_positions=shape["vertices"], triangle_indices=shape["triangles"])
        elif kind == "convex_hull":
            mesh = rerun.Points3D(shape["points"])
        else:
            # A half-space or a height field has no extent to draw.
            return
        pose = {"position": [0, 0, 0], "rotation": [0, 0, 0, 1], **shape}
        rotation = rerun.Quaternion(xyzw=pose["rotation"])
        self._recording.log(path, rerun.Transform3D(translation=pose["position"], rotation=rotation), static=True)
        self._recording.log(path, mesh, static=True)


def _cone(half_height: float, radius: float) -> dict[str, Any]:
    """A cone along y as a mesh: its tip, the center of its base, and the circle of the base."""
    angles = np.linspace(0, 2 * np.pi, CORNERS, endpoint=False)
    circle = np.stack([radius * np.sin(angles), np.full(CORNERS, -half_height), radius * np.cos(angles)], axis=1)
    corners = np.concatenate([[[0, half_height, 0], [0, -half_height, 0]], circle]).astype(np.float32)
    first = np.arange(CORNERS) + 2
    after = np.roll(first, -1)
    side = np.stack([np.zeros_like(first), first, after], axis=1)
    base = np.stack([np.ones_like(first), after, first], axis=1)
    return {"vertex_positions": corners, "triangle_indices": np.concatenate([side, base])}
