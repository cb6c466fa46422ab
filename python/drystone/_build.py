"""Build worlds body by body, with the keys of scene files."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from . import _check

Vector = Sequence[float]


class Body:
    """A body for a `World`. Each method changes the body and returns it.

    Methods for shapes take further keys of a shape: `position` (m) and `rotation` (x y z w) in the frame of the body,
    `material` (a dict), and `sensor`.

    ValueError: an argument is not a finite number, or has the wrong length. `Scene.from_world` checks ranges and keys.

    >>> import drystone as ds
    >>> ds.Body.dynamic("hammer").cuboid(0.1, 0.1, 0.3).cylinder(0.5, 0.02, position=(0, -0.6, 0))
    <Body 'hammer', dynamic: cuboid, cylinder>
    >>> ds.Body.dynamic("ball").ball(0.5).at(0, 2, 0).density(500).friction(0.3).to_dict()["density"]
    500.0
    """

    def __init__(self, kind: str, name: str | None = None) -> None:
        self._data: dict[str, Any] = {"kind": _check.one_of("kind", kind, ["dynamic", "fixed", "kinematic"])}
        if name is not None:
            self._data["name"] = _check.kind_of("name", name, str)
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
        self._data["shapes"].append({"type": _check.kind_of("type", type, str), **_plain(keys)})
        return self

    def cuboid(self, x: float, y: float, z: float, **keys: Any) -> Self:
        """Add a box with half extents (m)."""
        return self.shape("cuboid", half_extents=_check.vector("half extents", (x, y, z)), **keys)

    def ball(self, radius: float, **keys: Any) -> Self:
        """Add a ball (m)."""
        return self.shape("ball", radius=_check.number("radius", radius), **keys)

    def capsule(self, half_height: float, radius: float, **keys: Any) -> Self:
        """Add a capsule along y (m). Half of its segment has length `half_height`."""
        return self._round("capsule", half_height, radius, keys)

    def cylinder(self, half_height: float, radius: float, **keys: Any) -> Self:
        """Add a cylinder along y (m)."""
        return self._round("cylinder", half_height, radius, keys)

    def cone(self, half_height: float, radius: float, **keys: Any) -> Self:
        """Add a cone along y (m). Its tip points up."""
        return self._round("cone", half_height, radius, keys)

    def half_space(self, normal: Vector = (0, 1, 0), **keys: Any) -> Self:
        """Add a half-space: all points below a plane through the origin of a fixed body."""
        return self.shape("half_space", normal=_check.vector("normal", normal), **keys)

    def convex_hull(self, points: ArrayLike, **keys: Any) -> Self:
        """Add the convex hull of points [P, 3] (m).

        >>> import drystone as ds, numpy as np
        >>> ds.Body.dynamic().convex_hull(np.eye(4, 3))
        <Body, dynamic: convex_hull>
        """
        return self.shape("convex_hull", points=_check.numbers("points", points, (-1, 3)), **keys)

    def mesh(self, vertices: ArrayLike, triangles: ArrayLike, **keys: Any) -> Self:
        """Add a triangle mesh of vertices [V, 3] (m) to a fixed or kinematic body. `triangles` [T, 3] has indices of
        vertices, counter-clockwise from outside.
        """
        corners = _check.numbers("vertices", vertices, (-1, 3))
        return self.shape("mesh", vertices=corners, triangles=_indices("triangles", triangles, len(corners)), **keys)

    def height_field(self, heights: ArrayLike, scale: Vector, **keys: Any) -> Self:
        """Add a height field to a fixed or kinematic body. `heights` has rows along z of heights along x. `scale` has
        the length along x (m), the unit of heights (m), and the length along z (m).
        """
        rows = _check.numbers("heights", heights, (-1, -1))
        return self.shape("height_field", heights=rows, scale=_check.vector("scale", scale), **keys)

    def voxels(self, size: Vector, cells: ArrayLike, **keys: Any) -> Self:
        """Add blocks in a grid. `size` has the sides of a cell along x, y, z (m). `cells` [C, 3] has the whole numbers of
        the cells along the three axes; cell c begins at c * size.

        >>> import drystone as ds
        >>> ds.Body.fixed("stair").voxels((1, 0.5, 1), [[0, 0, 0], [1, 0, 0], [1, 1, 0]])
        <Body 'stair', fixed: voxels>
        """
        numbers = _whole_rows("cells", cells)
        return self.shape("voxels", size=_check.vector("size", size), cells=numbers, **keys)

    def at(self, x: float, y: float, z: float) -> Self:
        """Set the position (m)."""
        return self._set("position", _check.vector("position", (x, y, z)))

    def turned(self, x: float, y: float, z: float, w: float) -> Self:
        """Set the rotation, a unit quaternion x y z w."""
        return self._set("rotation", _check.vector("rotation", (x, y, z, w), 4))

    def moving(self, linear: Vector, angular: Vector = (0, 0, 0)) -> Self:
        """Set the velocities (m/s, rad/s)."""
        self._set("linear_velocity", _check.vector("linear", linear))
        return self._set("angular_velocity", _check.vector("angular", angular))

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
        bits = {"membership": membership, "filter": filter}
        return self._set("groups", {name: _check.whole(name, value) for name, value in bits.items()})

    def gravity_scale(self, scale: float) -> Self:
        """Set the factor on gravity. A body floats with 0."""
        return self._set("gravity_scale", _check.number("scale", scale))

    def damping(self, linear: float, angular: float = 0.0) -> Self:
        """Set the decay rates of both velocities (1/s)."""
        self._set("linear_damping", _check.number("linear", linear))
        return self._set("angular_damping", _check.number("angular", angular))

    def set(self, **keys: Any) -> Self:
        """Set other keys of scene files, such as `locked_rotations`, `surface_velocity`, `rolling_friction`, `swept`
        or `mass_properties`.

        >>> import drystone as ds
        >>> ds.Body.dynamic().ball(0.5).set(locked_rotations=[True, False, True]).to_dict()["locked_rotations"]
        [True, False, True]
        """
        self._data.update(_plain(keys))
        return self

    def to_dict(self) -> dict[str, Any]:
        """The body in the form of scene files."""
        return {**self._data, "shapes": list(self._data["shapes"])}

    def __repr__(self) -> str:
        name = f" {self._data['name']!r}" if "name" in self._data else ""
        shapes = ", ".join(str(shape["type"]) for shape in self._data["shapes"])
        return f"<Body{name}, {self._data['kind']}: {shapes or 'no shapes'}>"

    def _round(self, type: str, half_height: float, radius: float, keys: dict[str, Any]) -> Self:
        half, of = _check.number("half_height", half_height), _check.number("radius", radius)
        return self.shape(type, half_height=half, radius=of, **keys)

    def _set(self, key: str, value: Any) -> Self:
        self._data[key] = value
        return self


class Joint:
    """A joint for a `World`, between two bodies or between a body and the world. `a` and `b` are names of bodies. A new
    joint is a ball joint.

    ValueError: an argument is not a finite number, or has the wrong length. `Scene.from_world` checks ranges and keys.

    >>> import drystone as ds
    >>> ds.Joint("door", "wall").hinge((0, 1, 0)).at(0, 1, 0).motor(2, 50).to_dict()["type"]
    'hinge'
    """

    def __init__(self, a: str, b: str | None = None) -> None:
        names = [_check.kind_of("a", a, str)] if b is None else [a, _check.kind_of("b", b, str)]
        self._data: dict[str, Any] = {"type": "ball", "bodies": names}

    def at(self, x: float, y: float, z: float) -> Self:
        """Set the anchor in the world (m)."""
        return self._set(anchor=_check.vector("anchor", (x, y, z)))

    def anchors(self, a: Vector, b: Vector) -> Self:
        """Set the anchor in the frame of each body (m)."""
        return self._set(anchors=[_check.vector("a", a), _check.vector("b", b)])

    def hinge(self, axis: Vector) -> Self:
        """Make a hinge about an axis (world)."""
        return self._set(type="hinge", axis=_check.vector("axis", axis))

    def slider(self, axis: Vector) -> Self:
        """Make a slider along an axis (world)."""
        return self._set(type="slider", axis=_check.vector("axis", axis))

    def cone(self, axis: Vector, angle: float) -> Self:
        """Limit the angle between an axis (world) on one body and on the other (rad), and nothing else. A shoulder is a
        ball joint and a cone with the same anchor.

        >>> import drystone as ds
        >>> ds.Joint("arm", "trunk").cone((1, 0, 0), 0.6).at(0, 1.4, 0).to_dict()["angle"]
        0.6
        """
        return self._set(type="cone", axis=_check.vector("axis", axis), angle=_check.number("angle", angle))

    def fixed(self) -> Self:
        """Make a fixed joint: no axis is free."""
        return self._set(type="fixed")

    def distance(self, low: float, high: float) -> Self:
        """Limit the distance of the anchors to a range (m)."""
        return self._set(type="distance", limits=[_check.number("low", low), _check.number("high", high)])

    def generic(self, linear: Sequence[Mapping[str, Any]], angular: Sequence[Mapping[str, Any]], **keys: Any) -> Self:
        """Make a joint with three axes of translation and three of rotation. An axis is a dict: free if empty, else
        with `locked`, `limits`, `motor` or `spring`. Further keys are `frame` and `frames` (docs/scene-files.md).

        >>> import drystone as ds
        >>> ds.Joint("cart").generic([{}, {"locked": True}, {"locked": True}], [{"locked": True}] * 3)
        <Joint generic: cart - world>
        """
        axes = {"linear": linear, "angular": angular}
        for name, three in axes.items():
            if isinstance(three, (str, Mapping)) or not isinstance(three, Sequence) or len(three) != 3:
                raise ValueError(f"{name} = {three!r}: must be a list of 3 dicts")
        return self._set(type="generic", **_plain({**axes, **keys}))

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

    def spring_damper(
        self, target: float, stiffness: float, damping: float = 0.0, max_load: float | None = None
    ) -> Self:
        """Add a spring and damper to the free axis (m and N/m, or rad and N m/rad; N s/m or N m s/rad)."""
        values = {"target": target, "stiffness": stiffness, "damping": damping, "max_load": max_load}
        return self._set(spring={key: _check.number(key, x) for key, x in values.items() if x is not None})

    def colliding(self) -> Self:
        """Let the two bodies collide with each other."""
        return self._set(collide=True)

    def breaking_at(self, force: float) -> Self:
        """Make the joint break at a force (N)."""
        return self._set(break_force=_check.number("force", force))

    def set(self, **keys: Any) -> Self:
        """Set other keys of scene files, such as `enabled`."""
        return self._set(**_plain(keys))

    def to_dict(self) -> dict[str, Any]:
        """The joint in the form of scene files."""
        return dict(self._data)

    def __repr__(self) -> str:
        return f"<Joint {self._data['type']}: {' - '.join([*self._data['bodies'], 'world'][:2])}>"

    def _set(self, **values: Any) -> Self:
        self._data.update(values)
        return self


class World:
    """Bodies and joints for `Scene.from_world`. `gravity` is an acceleration (m/s²).

    >>> import drystone as ds
    >>> world = ds.World(gravity=(0, -9.81, 0))
    >>> floor = world.add(ds.Body.fixed("floor").half_space())
    >>> box = world.add(ds.Body.dynamic("box").cuboid(0.5, 0.5, 0.5).at(0, 1, 0))
    >>> world.join(ds.Joint(box).hinge((0, 0, 1)).at(0, 2, 0).motor(2, 50))
    >>> ds.Scene.from_world(world).actuators
    ('joint 0: box - world',)
    """

    def __init__(self, gravity: Vector = (0, -9.81, 0)) -> None:
        self._gravity = _check.vector("gravity", gravity)
        self._bodies: list[dict[str, Any]] = []
        self._joints: list[dict[str, Any]] = []

    def add(self, body: Body) -> str:
        """Add a body, and return its name."""
        data = _check.kind_of("body", body, Body).to_dict()
        data.setdefault("name", f"body {len(self._bodies)}")
        self._bodies.append(data)
        return str(data["name"])

    def join(self, joint: Joint) -> None:
        """Add a joint."""
        self._joints.append(_check.kind_of("joint", joint, Joint).to_dict())

    def to_dict(self) -> dict[str, Any]:
        """The world in the form of scene files."""
        return {"version": 1, "gravity": self._gravity, "bodies": self._bodies, "joints": self._joints}

    def __repr__(self) -> str:
        return f"<World: {len(self._bodies)} bodies, {len(self._joints)} joints>"


def _plain(value: Any) -> Any:
    """A value with lists in place of arrays and tuples."""
    if isinstance(value, Mapping):
        return {str(key): _plain(one) for key, one in value.items()}
    if isinstance(value, (np.ndarray, np.generic)):
        return value.tolist()
    return [_plain(one) for one in value] if isinstance(value, (list, tuple)) else value


def _indices(name: str, value: ArrayLike, count: int) -> list[list[int]]:
    """Rows of three indices below `count`."""
    rows = _whole_rows(name, value)
    low, high = min(map(min, rows), default=0), max(map(max, rows), default=0)
    if rows and (low < 0 or high >= count):
        raise ValueError(f"{name} has {low} to {high}: must be 0 to {count - 1}")
    return rows


def _whole_rows(name: str, value: ArrayLike) -> list[list[int]]:
    """Rows of three whole numbers."""
    array = np.asarray(value)
    if array.dtype.kind not in "iu":
        raise ValueError(f"{name} has dtype {array.dtype}: must be whole numbers")
    if array.ndim != 2 or array.shape[1] != 3:
        raise ValueError(f"{name} has shape {array.shape}: must be (any, 3)")
    rows: list[list[int]] = array.tolist()
    return rows
