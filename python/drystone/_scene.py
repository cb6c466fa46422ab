"""Scenes and settings."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from . import _check, _drystone
from ._build import World


@dataclass(frozen=True)
class Parameter:
    """A parameter of a scene: its default, its smallest and largest value, and whether it is a whole number.

    >>> import drystone as ds
    >>> tower = next(scene for scene in ds.scenes() if scene.name == "tower")
    >>> tower.parameters[0].name, tower.parameters[0].whole
    ('n', True)
    """

    name: str
    default: float
    low: float
    high: float
    whole: bool
    summary: str


@dataclass(frozen=True)
class SceneInfo:
    """A scene of the catalogue.

    >>> import drystone as ds
    >>> ds.scenes()[0].name in [scene.name for scene in ds.scenes()]
    True
    """

    name: str
    summary: str
    parameters: tuple[Parameter, ...]


def scenes() -> tuple[SceneInfo, ...]:
    """The catalogue of scenes.

    >>> import drystone as ds
    >>> [p.name for p in next(s for s in ds.scenes() if s.name == "tower").parameters]
    ['n', 'offset', 'top_ratio', 'gap']
    """
    rows = _drystone.catalogue()
    return tuple(SceneInfo(name, text, tuple(Parameter(*p) for p in parameters)) for name, text, parameters in rows)


class Scene:
    """Initial bodies and joints, and the length of a step. A scene is immutable.

    >>> import drystone as ds
    >>> scene = ds.Scene.find("tower", n=3, top_ratio=100)
    >>> len(scene.bodies), scene.joints, round(1 / scene.dt)
    (4, (), 60)
    """

    __slots__ = ("_made_by", "_scene")

    def __init__(self, _scene: _drystone.Scene, _made_by: tuple[Any, ...]) -> None:
        self._scene = _scene
        self._made_by = _made_by

    @classmethod
    def find(cls, name: str, **parameters: float) -> Scene:
        """Find a scene of the catalogue (`scenes()`) with its parameters.

        ValueError: there is no scene or parameter of that name, or a value is out of range.

        >>> import drystone as ds
        >>> ds.Scene.find("towr")
        Traceback (most recent call last):
        ValueError: "towr" is neither a scene nor a scene file; did you mean "tower"? `drystone scenes` lists the scenes
        """
        _check.kind_of("name", name, str)
        words = [f"{key}={_plain(key, value)}" for key, value in parameters.items()]
        return cls(_drystone.Scene.find(name, words), (cls.find, name, parameters))

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Scene:
        """Read a scene file (JSON, docs/scene-files.md).

        OSError: the file cannot be read. ValueError: no scene can be built from it; the message has the reason.

        >>> import drystone as ds, tempfile, json, pathlib
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     path = pathlib.Path(folder, "a.json")
        ...     _ = path.write_text(json.dumps(ds.Scene.find("tower", n=2).to_dict()))
        ...     len(ds.Scene.load(path).bodies)
        3
        """
        return cls(_drystone.Scene.load(_check.path("path", path)), ())

    @classmethod
    def from_dict(cls, data: Mapping[str, Any], name: str = "scene") -> Scene:
        """A scene from the content of a scene file.

        ValueError: a key or a value is invalid. The line names the body.

        >>> import drystone as ds
        >>> ball = {"shapes": [{"type": "ball", "radius": 0.5}]}
        >>> ds.Scene.from_dict({"version": 1, "bodies": [ball]}).bodies
        ('body 0',)
        """
        if not isinstance(data, Mapping):
            raise ValueError(f"data is {type(data).__name__}: must be a dict")
        try:
            text = json.dumps(dict(data))
        except (TypeError, ValueError) as error:
            raise ValueError(f"data: {error}") from None
        try:
            return cls(_drystone.Scene.from_text(text, _check.kind_of("name", name, str)), ())
        except ValueError as error:
            # Remove the place in the text: the caller never saw the text.
            raise ValueError(re.sub(r" at line \d+ column \d+", "", str(error))) from None

    @classmethod
    def from_world(cls, world: World, dt: float = 1 / 60, name: str = "scene") -> Scene:
        """A scene from a world that was built body by body.

        ValueError: that of `from_dict`.

        >>> import drystone as ds
        >>> world = ds.World()
        >>> world.add(ds.Body.dynamic("box").cuboid(0.5, 0.5, 0.5).at(0, 1, 0))
        'box'
        >>> ds.Scene.from_world(world, dt=1 / 120).bodies
        ('box',)
        """
        data = _check.kind_of("world", world, World).to_dict()
        return cls.from_dict({**data, "dt": _check.number("dt", dt)}, name)

    def to_dict(self) -> dict[str, Any]:
        """The content of a scene file for this scene, with every number to the last bit.

        >>> import drystone as ds
        >>> len(ds.Scene.find("tower", n=2).to_dict()["bodies"])
        3
        """
        data: dict[str, Any] = json.loads(self._scene.to_text())
        return data

    @property
    def name(self) -> str:
        """The name of the scene."""
        return self._scene.name

    @property
    def dt(self) -> float:
        """Length of a step (s)."""
        return self._scene.dt

    @property
    def bodies(self) -> tuple[str, ...]:
        """Names of the bodies, in the order of the arrays of a batch."""
        return tuple(name or f"body {k}" for k, name in enumerate(self._scene.bodies))

    @property
    def joints(self) -> tuple[str, ...]:
        """The bodies of each joint, in the order of the arrays of a batch."""
        return tuple(self._scene.joints)

    @property
    def actuators(self) -> tuple[str, ...]:
        """Names of the driven axes of joints, in the order of `ctrl`."""
        return tuple(self._scene.actuators)

    def __repr__(self) -> str:
        return f"<Scene {self.name}: {len(self.bodies)} bodies, {len(self.joints)} joints>"

    def __reduce__(self) -> tuple[Any, ...]:
        if self._made_by:
            _, name, parameters = self._made_by
            return _found, (name, parameters)
        return Scene.from_dict, (self.to_dict(), self.name)


def _found(name: str, parameters: dict[str, float]) -> Scene:
    return Scene.find(name, **parameters)


def _plain(key: str, value: Any) -> str:
    """The text of a number for the catalogue."""
    number = _check.number(key, value)
    return str(int(number)) if number.is_integer() else repr(number)


class Config:
    """Settings of the solver (docs/settings.md), immutable.

    ValueError: there is no setting of that name, or a value is invalid.

    >>> import drystone as ds
    >>> ds.Config("accurate", sleep=False)["substeps"]
    32
    >>> ds.Config(substep=4)
    Traceback (most recent call last):
    ValueError: substep: did you mean 'substeps'?
    """

    __slots__ = ("_config", "_settings")

    def __init__(self, preset: str = "balanced", *, sleep: bool = True, **settings: Any) -> None:
        found: dict[str, Any] = json.loads(_drystone.Config.preset(_check.kind_of("preset", preset, str)).to_text())
        known = dict(found)
        if not _like("sleep", sleep, True):
            settings = {"sleep_after": 0.0, **settings}
        for key, value in settings.items():
            if key not in known:
                raise ValueError(f"{key}: {_check.hint(key, known)}")
            known[key] = _like(key, value, known[key])
        try:
            self._config = _drystone.Config.from_text(json.dumps(known))
        except ValueError as error:
            raise ValueError(_named(str(error), found, {key: known[key] for key in settings})) from None
        self._settings: dict[str, Any] = known

    def __getitem__(self, key: str) -> Any:
        """The value of a setting. KeyError: there is no setting of that name."""
        if not isinstance(key, str) or key not in self._settings:
            raise KeyError(f"{key}: {_check.hint(str(key), self._settings)}")
        return self._settings[key]

    def to_dict(self) -> dict[str, Any]:
        """All settings by name.

        >>> import drystone as ds
        >>> ds.Config().to_dict()["relax"]
        1
        """
        return dict(self._settings)

    def __repr__(self) -> str:
        usual = Config().to_dict() if self._settings else {}
        return f"Config({', '.join(f'{k}={v!r}' for k, v in self._settings.items() if usual[k] != v)})"

    def __reduce__(self) -> tuple[Any, ...]:
        return _config_of, (self._settings,)


def _config_of(settings: dict[str, Any]) -> Config:
    return Config(**settings)


def _like(key: str, value: Any, known: Any) -> Any:
    """A value for a setting, of the type of its known value."""
    if isinstance(known, dict):
        if not isinstance(value, Mapping):
            raise ValueError(f"{key} = {value!r}: must be a dict")
        for name in value:
            if name not in known:
                raise ValueError(f"{key}: {name}: {_check.hint(str(name), known)}")
        return {**known, **{name: _like(name, one, known[name]) for name, one in value.items()}}
    if isinstance(known, bool):
        if not isinstance(value, (bool, np.bool_)):
            raise ValueError(f"{key} = {value!r}: must be True or False")
        return bool(value)
    if isinstance(known, str):
        if not isinstance(value, str):
            raise ValueError(f"{key} = {value!r}: must be a word")
        return value
    return _check.whole(key, value) if isinstance(known, int) else _check.number(key, value)


def _named(text: str, found: dict[str, Any], changed: dict[str, Any]) -> str:
    """An error of some settings, with the name of the one that has this error alone."""
    for key, value in changed.items():
        try:
            _drystone.Config.from_text(json.dumps({**found, key: value}))
        except ValueError as error:
            if str(error) == text and key not in text:
                return f"{key}: {text}"
    return text
