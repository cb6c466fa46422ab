"""The package: documentation of every public name, modules that are found, the command."""

import ast
import inspect
import re
import subprocess
import sys
from pathlib import Path
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
    # The error of a missing extra names the package.
    code = "import sys; sys.modules['gymnasium'] = None; import drystone as ds; ds.gym"
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert ran.stderr.splitlines()[-1] == "ImportError: Gymnasium is not installed: pip install 'drystone[gym]'"


def test_the_command_is_a_module_too() -> None:
    ran = subprocess.run([sys.executable, "-m", "drystone", "scenes"], capture_output=True, text=True)
    assert ran.returncode == 0 and "tower" in ran.stdout


def test_the_programs_of_the_readme_call_what_there_is() -> None:
    pytest.importorskip("gymnasium")
    text = (Path(__file__).parents[1] / "README.md").read_text()
    programs = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    of = {"ds": ds, "batch": ds.Batch, "found": ds.Stability}
    names = set()
    for node in (node for program in programs for node in ast.walk(ast.parse(program))):
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id in of:
            # A field of a data class is no attribute of the class.
            owner = of[node.value.id]
            assert hasattr(owner, node.attr) or node.attr in getattr(owner, "__annotations__", {}), ast.unparse(node)
            names.add(node.attr)
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
            inner = node.func
            path = ast.unparse(inner).split(".")
            if path[0] in of:
                target = of[path[0]]
                for name in path[1:]:
                    target = getattr(target, name)
                known = inspect.signature(target).parameters
                loose = any(one.kind is one.VAR_KEYWORD for one in known.values())
                assert loose or {word.arg for word in node.keywords} <= set(known), ast.unparse(node)
    assert len(programs) >= 4 and {"Batch", "step", "survey", "table"} <= names
