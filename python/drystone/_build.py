"""Build worlds body by body, with the keys of scene files."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Self

from . import _check

Vector = Sequence[float]


class Body:
    """A body for a `World`. Each method changes the body and returns it.

    >>> import drystone as ds
    >>> ds.Body.dynamic("ball").ball(0.5).at(0, 2, 0).density(500).friction(0.3).to_dict()["density"]
    500.0
    """

    def __init__(self, kind: str, name: str | None = None) -> None:
        self._data: dict[str, Any] = {"kind": _check.one_of("kind", kind, ["dynamic", "fixed", "kinematic"])}
        if name is not None:
            self._data["name"] = str(name)
        self._data["shapes"] = []

    @classmethod
    def dynamic(cls, name: str | None = None) -> Self:
        """A body that moves by forces and contacts."""
        return cls("dynamic", name)

    @classmethod
    def fixed(cls, name: str | None = None) -> Self:
        """A body that never moves."""
        return cls("fixed", name)

    @classmethod
    def kinematic(cls, name: str | None = None) -> Self:
        """A body that moves with its given velocity."""
        return cls("kinematic", name)

    def shape(self, type: str, **keys: Any) -> Self:
        """Add a shape of any type, with the keys of scene files (docs/scene-files.md)."""
        self._data["shapes"].append({"type": type, **keys})
        return self

    def cuboid(self, x: float, y: float, z: float) -> Self:
        """Add a box with half extents (m)."""
        return self.shape("cuboid", half_extents=_vector("half extents", (x, y, z)))

    def ball(self, radius: float) -> Self:
        """Add a ball (m)."""
        return self.shape("ball", radius=_check.number("radius", radius))

    def capsule(self, half_height: float, radius: float) -> Self:
        """Add a capsule along y (m)."""
        return self._round("capsule", half_height, radius)

    def cylinder(self, half_height: float, radius: float) -> Self:
        """Add a cylinder along y (m)."""
        return self._round("cylinder", half_height, radius)

    def cone(self, half_height: float, radius: float) -> Self:
        """Add a cone along y (m)."""
        return self._round("cone", half_height, radius)

    def half_space(self, normal: Vector = (0, 1, 0)) -> Self:
        """Add a half-space: all points below a plane through the origin of a fixed body."""
        return self.shape("half_space", normal=_vector("normal", normal))

    def at(self, x: float, y: float, z: float) -> Self:
        """Set the position (m)."""
        return self._set("position", _vector("position", (x, y, z)))

    def turned(self, x: float, y: float, z: float, w: float) -> Self:
        """Set the rotation, a unit quaternion x y z w."""
        return self._set("rotation", [_check.number("rotation", n) for n in (x, y, z, w)])

    def moving(self, linear: Vector, angular: Vector = (0, 0, 0)) -> Self:
        """Set the velocities (m/s, rad/s)."""
        self._set("linear_velocity", _vector("linear", linear))
        return self._set("angular_velocity", _vector("angular", angular))

    def density(self, density: float) -> Self:
        """Set the density of the shapes (kg/m³)."""
        return self._set("density", _check.number("density", density))

    def mass(self, mass: float) -> Self:
        """Set the mass (kg)."""
        return self._set("mass", _check.number("mass", mass))

    def friction(self, friction: float) -> Self:
        """Set the Coulomb friction coefficient."""
        return self._set("friction", _check.number("friction", friction))

    def restitution(self, restitution: float) -> Self:
        """Set the ratio of separation to approach velocity, 0 to 1."""
        return self._set("restitution", _check.number("restitution", restitution))

    def groups(self, membership: int, filter: int) -> Self:
        """Set the groups that the body belongs to, and the groups that it collides with: 32 bits each."""
        return self._set("groups", {"membership": membership, "filter": filter})

    def to_dict(self) -> dict[str, Any]:
        """The body in the form of scene files."""
        return {**self._data, "shapes": list(self._data["shapes"])}

    def _round(self, type: str, half_height: float, radius: float) -> Self:
        half, of = _check.number("half_height", half_height), _check.number("radius", radius)
        return self.shape(type, half_height=half, radius=of)

    def _set(self, key: str, value: Any) -> Self:
        self._data[key] = value
        return self


class Joint:
    """A joint for a `World`, between two bodies or between a body and the world.

    >>> import drystone as ds
    >>> ds.Joint("door", "wall").hinge((0, 1, 0)).at(0, 1, 0).motor(2, 50).to_dict()["type"]
    'hinge'
    """

    def __init__(self, a: str, b: str | None = None) -> None:
        self._data: dict[str, Any] = {"type": "ball", "bodies": [a] if b is None else [a, b]}

    def at(self, x: float, y: float, z: float) -> Self:
        """Set the anchor in the world (m)."""
        return self._set(anchor=_vector("anchor", (x, y, z)))

    def anchors(self, a: Vector, b: Vector) -> Self:
        """Set the anchor in the frame of each body (m)."""
        return self._set(anchors=[_vector("a", a), _vector("b", b)])

    def hinge(self, axis: Vector) -> Self:
        """Make a hinge about an axis (world)."""
        return self._set(type="hinge", axis=_vector("axis", axis))

    def slider(self, axis: Vector) -> Self:
        """Make a slider along an axis (world)."""
        return self._set(type="slider", axis=_vector("axis", axis))

    def fixed(self) -> Self:
        """Make a fixed joint: no axis is free."""
        return self._set(type="fixed")

    def distance(self, low: float, high: float) -> Self:
        """Limit the distance of the anchors to a range (m)."""
        return self._set(type="distance", limits=[_check.number("low", low), _check.number("high", high)])

    def limited(self, low: float, high: float) -> Self:
        """Limit the free axis (m, rad)."""
        return self._set(limits=[_check.number("low", low), _check.number("high", high)])

    def motor(self, speed: float, max_load: float) -> Self:
        """Add a motor to the free axis (m/s and N, or rad/s and N m)."""
        return self._set(motor={"speed": _check.number("speed", speed), "max_load": _check.number("max_load", max_load)})

    def spring(self, target: float, frequency: float, damping_ratio: float = 1.0, max_load: float | None = None) -> Self:
        """Add a spring and damper to the free axis (m or rad, Hz)."""
        values = {"target": target, "frequency": frequency, "damping_ratio": damping_ratio, "max_load": max_load}
        return self._set(spring={key: _check.number(key, x) for key, x in values.items() if x is not None})

    def colliding(self) -> Self:
        """Let the two bodies collide with each other."""
        return self._set(collide=True)

    def breaking_at(self, force: float) -> Self:
        """Make the joint break at a force (N)."""
        return self._set(break_force=_check.number("force", force))

    def to_dict(self) -> dict[str, Any]:
        """The joint in the form of scene files."""
        return dict(self._data)

    def _set(self, **values: Any) -> Self:
        self._data.update(values)
        return self


class World:
    """Bodies and joints for `Scene.from_world`.

    >>> import drystone as ds
    >>> world = ds.World(gravity=(0, -9.81, 0))
    >>> floor = world.add(ds.Body.fixed("floor").half_space())
    >>> box = world.add(ds.Body.dynamic("box").cuboid(0.5, 0.5, 0.5).at(0, 1, 0))
    >>> world.join(ds.Joint(box).hinge((0, 0, 1)).at(0, 2, 0).motor(2, 50))
    >>> ds.Scene.from_world(world).actuators
    ('joint 0: box - world',)
    """

    def __init__(self, gravity: Vector = (0, -9.81, 0)) -> None:
        self._gravity = _vector("gravity", gravity)
        self._bodies: list[dict[str, Any]] = []
        self._joints: list[dict[str, Any]] = []

    def add(self, body: Body) -> str:
        """Add a body, and return its name."""
        data = body.to_dict()
        data.setdefault("name", f"body {len(self._bodies)}")
        self._bodies.append(data)
        return str(data["name"])

    def join(self, joint: Joint) -> None:
        """Add a joint."""
        self._joints.append(joint.to_dict())

    def to_dict(self) -> dict[str, Any]:
        """The world in the form of scene files."""
        return {"version": 1, "gravity": self._gravity, "bodies": self._bodies, "joints": self._joints}


def _vector(name: str, value: Vector) -> list[float]:
    numbers = [_check.number(name, n) for n in value]
    if len(numbers) != 3:
        raise ValueError(f"{name} has {len(numbers)} numbers: must have 3")
    return numbers
