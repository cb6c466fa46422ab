"""The package: documentation of every public name, modules that are found, the command."""

import inspect
import subprocess
import sys
from types import ModuleType

import pytest

import drystone as ds


def modules() -> list[ModuleType]:
    pytest.importorskip("gymnasium")
    from drystone import shard

    return [ds, ds.gym, ds.ray, ds.rerun, ds.studies, shard]


def test_every_public_name_is_documented_with_an_example() -> None:
    bare = []
    for module in modules():
        for name, value in vars(module).items():
            own = str(getattr(value, "__module__", "")).startswith("drystone")
            # Exceptions of Rust have a line, and no example.
            if name.startswith("_") or not own or not (inspect.isclass(value) or inspect.isfunction(value)):
                continue
            text = value.__dict__.get("__doc__") or "" if inspect.isclass(value) else value.__doc__ or ""
            if not text or (">>>" not in text and name not in ("AdapterError", "InternalError")):
                bare.append(name)
            if inspect.isclass(value):
                for inner, member in vars(value).items():
                    known = isinstance(member, (property, classmethod, staticmethod)) or inspect.isfunction(member)
                    if known and not inner.startswith("_") and not inspect.getdoc(member):
                        bare.append(f"{name}.{inner}")
    assert not bare
    assert ds.survey.__doc__ and "engine" in inspect.signature(ds.survey).parameters


def test_modules_are_found_without_an_import() -> None:
    code = "import drystone as ds; print(ds.studies.table.__name__, ds.ray.Fleet.__name__); ds.raay"
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert ran.stdout.split() == ["table", "Fleet"]
    assert ran.stderr.splitlines()[-1].startswith("AttributeError: module 'drystone' has no attribute 'raay'")
    # An extra that is missing says what to install.
    code = "import sys; sys.modules['gymnasium'] = None; import drystone as ds; ds.gym"
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert ran.stderr.splitlines()[-1] == "ImportError: Gymnasium is not installed: pip install 'drystone[gym]'"


def test_the_command_is_a_module_too() -> None:
    ran = subprocess.run([sys.executable, "-m", "drystone", "scenes"], capture_output=True, text=True)
    assert ran.returncode == 0 and "tower" in ran.stdout
