"""Many worlds of rigid bodies in contact, with the same bits on every machine.

>>> import drystone as ds
>>> batch = ds.Batch(ds.Scene.find("tower", n=3), 2)
>>> batch.step(60)
>>> batch.position.shape
(2, 4, 3)
>>> bool(batch.measure("overlap_max")["overlap_max"].max() < 1e-3)
True
"""

import importlib
from types import ModuleType

from ._batch import Batch, Contacts, Hits, Snapshots, WorldError, wxyz
from ._build import Body, Joint, World
from ._drystone import AdapterError, InternalError
from ._families import Stability
from ._families import survey_with_families as survey
from ._scene import Config, Parameter, Scene, SceneInfo, scenes
from ._survey import NotTheSame, Rows

__all__ = [
    "AdapterError",
    "Batch",
    "Body",
    "Config",
    "Contacts",
    "Hits",
    "InternalError",
    "Joint",
    "NotTheSame",
    "Parameter",
    "Rows",
    "Scene",
    "SceneInfo",
    "Snapshots",
    "Stability",
    "World",
    "WorldError",
    "scenes",
    "survey",
    "wxyz",
]

# Modules that need an extra, or that few programs use. They are imported when they are first named.
_LAZY = ("gym", "ray", "rerun", "studies")


def __getattr__(name: str) -> ModuleType:
    if name in _LAZY:
        return importlib.import_module(f"{__name__}.{name}")
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
