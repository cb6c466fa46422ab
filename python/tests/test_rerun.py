"""Files of rerun, read back; and the calls that write them, without rerun."""

import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import drystone as ds


class Stream:
    """Keeps what is logged."""

    made: "list[Stream]" = []

    def __init__(self, name: str) -> None:
        self.logged: list[tuple[str, Any]] = []
        self.times: list[int] = []
        Stream.made.append(self)

    def save(self, path: str) -> None:
        self.path = path

    def set_time(self, name: str, sequence: int | None = None, duration: float | None = None) -> None:
        self.times += [] if sequence is None else [sequence]

    def log(self, path: str, value: Any, static: bool = False) -> None:
        self.logged.append((path, value))

    def flush(self) -> None: ...
    def disconnect(self) -> None: ...


@pytest.fixture
def calls(monkeypatch: pytest.MonkeyPatch) -> type[Stream]:
    """A stand-in for rerun that keeps the calls."""
    names = "Boxes3D Ellipsoids3D Capsules3D Cylinders3D Mesh3D Points3D Transform3D Quaternion Scalars Arrows3D"
    kinds = {name: (lambda *words, name=name, **keys: (name, words, keys)) for name in names.split()}
    axes = SimpleNamespace(RIGHT_HAND_Y_UP="y up")
    monkeypatch.setitem(sys.modules, "rerun", SimpleNamespace(RecordingStream=Stream, ViewCoordinates=axes, **kinds))
    Stream.made = []
    return Stream


def shapes() -> ds.Scene:
    """A scene with every shape that is drawn."""
    world = ds.World()
    world.add(ds.Body.fixed().half_space())
    world.add(ds.Body.fixed().mesh([[0, -3, 0], [1, -3, 0], [0, -3, 1]], [[0, 2, 1]]))
    world.add(ds.Body.dynamic().cuboid(0.5, 0.5, 0.5).ball(0.5, position=(0, 1, 0)).at(0, 1, 0))
    world.add(ds.Body.dynamic().capsule(0.5, 0.2).at(3, 1, 0))
    world.add(ds.Body.dynamic().cylinder(0.5, 0.2).at(6, 1, 0))
    world.add(ds.Body.dynamic().cone(0.5, 0.2).at(9, 1, 0))
    world.add(ds.Body.dynamic().convex_hull(np.eye(4, 3)).at(12, 1, 0))
    return ds.Scene.from_world(world)


def test_a_run_is_written_with_poses_contacts_and_errors(tmp_path: Path) -> None:
    scene = ds.Scene.find("tower", n=3)
    batch = ds.Batch(scene, 2, listen=["impulses"])
    path = tmp_path / "run.rrd"
    with ds.rerun.log(batch, scene.to_dict(), world=1, to=path, every=5) as run:
        run.step(60)
    alone = ds.Batch(scene)
    alone.step(60)
    assert batch.hash()[1] == alone.hash()[0], "to be watched changes nothing"
    data = path.read_bytes()
    assert len(data) > 5000
    for name in (b"world/bodies/3", b"world/contacts", b"errors/overlap_max"):
        assert name in data, name
    with ds.rerun.log(ds.Batch(shapes()), to=tmp_path / "shapes.rrd") as run:
        run.step()
    data = (tmp_path / "shapes.rrd").read_bytes()
    for name in (b"Boxes3D", b"Ellipsoids3D", b"Capsules3D", b"Cylinders3D", b"Mesh3D", b"Points3D"):
        assert name in data, name


def test_every_shape_is_drawn_and_every_frame_is_written(calls: type[Stream], tmp_path: Path) -> None:
    scene = shapes()
    batch = ds.Batch([ds.Scene.find("tower", n=2), scene], listen=["impulses"])
    with ds.rerun.log(batch, world=1, to=tmp_path / "run.rrd", every=5, measures="overlap_max") as run:
        run.step(12)
    [stream] = calls.made
    assert stream.path == str(tmp_path / "run.rrd") and stream.times == [0, 5, 10, 12]
    drawn = [(path, value[0]) for path, value in stream.logged if path.count("/") == 3 and value[0] != "Transform3D"]
    assert drawn == [
        ("world/bodies/1/0", "Mesh3D"),
        ("world/bodies/2/0", "Boxes3D"),
        ("world/bodies/2/1", "Ellipsoids3D"),
        ("world/bodies/3/0", "Capsules3D"),
        ("world/bodies/4/0", "Cylinders3D"),
        ("world/bodies/5/0", "Mesh3D"),
        ("world/bodies/6/0", "Points3D"),
    ]
    poses = [value for path, value in stream.logged if path == "world/bodies/2"]
    assert len(poses) == 4 and np.array_equal(poses[-1][2]["translation"], batch.position[1, 2])
    assert sum(path == "world/contacts" for path, _ in stream.logged) == 4
    assert sum(path == "errors/overlap_max" for path, _ in stream.logged) == 4
    [cone] = [value[2] for path, value in stream.logged if path == "world/bodies/5/0" and value[0] == "Mesh3D"]
    corners, triangles = cone["vertex_positions"], cone["triangle_indices"]
    a, b, c = (corners[triangles[:, k]] for k in range(3))
    # The triangles look outwards, and enclose nearly the volume of the cone.
    volume = np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6
    assert volume == pytest.approx(np.pi * 0.2**2 * 1.0 / 3, rel=0.02)


def test_wrong_arguments_are_named(calls: type[Stream], tmp_path: Path) -> None:
    batch = ds.Batch(ds.Scene.find("tower", n=2), 2)
    for options, line in [
        ({"measures": ["overlap"]}, "measures = 'overlap': did you mean 'overlap_95'?"),
        ({"world": 2}, "world has 2: must be 0 to 1"),
        ({"every": 0}, "every = 0: must be 1 or more"),
        ({"to": 3}, "to is int: must be a path"),
        ({"batch": 3}, "batch is int: must be Batch"),
        ({"scene": 3}, "scene is int: must be a Scene, or a dict as of Scene.to_dict"),
        ({"batch": ds.Batch.load(batch.save())}, "scene is None: must be a Scene, because the batch was loaded from states"),
    ]:
        with pytest.raises(ValueError) as caught:
            ds.rerun.log(**{"batch": batch, "to": tmp_path / "a.rrd", **options})
        assert str(caught.value) == line


def test_without_rerun_the_error_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "rerun", None)
    with pytest.raises(ValueError, match=r"^rerun is not installed: pip install 'drystone\[rerun\]'$"):
        ds.rerun.log(ds.Batch(ds.Scene.find("tower", n=2)), to="a.rrd")
