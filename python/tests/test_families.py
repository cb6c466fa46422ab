"""Surveys of families: the verdicts of the command, the same rows by every engine, shares, pictures, refusals."""

import json
import subprocess
import sys
import xml.etree.ElementTree as xml
from pathlib import Path

import pytest

import drystone as ds

GRID = {"preset": ["fast"], "substeps": [1, 8]}
SMALL = ["slopes", "pushed-blocks", "leaned-towers"]


def without_times(rows: ds.Rows) -> list[dict]:
    return [{name: value for name, value in row.items() if name != "seconds"} for row in rows]


@pytest.fixture(scope="module")
def found() -> ds.Stability:
    return ds.survey.families(GRID, family=SMALL, seeds=4, engine="here", twice=0)


def test_the_verdicts_are_those_of_the_command() -> None:
    seeds, kinds = 3, ["slopes", "leaned-towers", "chains"]
    words = ["hard", "--families", str(seeds), "--json", "--preset", "fast", "--set", "max_substeps=4"]
    words += [word for kind in kinds for word in ("--family", kind)]
    code = "import sys; from drystone._command import main; sys.exit(main())"
    ran = subprocess.run([sys.executable, "-c", code, *words], capture_output=True, text=True, check=True)
    command = {
        (of["family"], world["seed"]): [(check["what"], check["value"], check["passed"]) for check in world["checks"]]
        for of in json.loads(ran.stdout)["families"]
        for world in of["worlds"]
    }
    found = ds.survey.families([{"preset": "fast", "max_substeps": 4}], family=kinds, seeds=seeds, engine="here", twice=0)
    own = {
        (row["family"], row["seed"]): [(check["what"], check["value"], check["passed"]) for check in row["checks"]]
        for row in found.rows
    }
    assert own == command and len(own) == 9


def test_rows_are_the_same_by_every_engine_and_a_file_goes_on(found: ds.Stability, tmp_path: Path) -> None:
    path = tmp_path / "rows.jsonl"
    many = ds.survey.families(GRID, family=SMALL, seeds=4, out=path, engine="processes", workers=2, chunk=3, twice=1)
    assert without_times(many.rows) == without_times(found.rows)
    again = ds.survey.families(GRID, family=SMALL, seeds=4, out=path, engine="here")
    assert again.rows.rows == many.rows.rows and not any(again.rows.who)
    # One more seed is 6 more worlds.
    more = ds.survey.families(GRID, family=SMALL, seeds=5, out=path, engine="here")
    assert sum(bool(who) for who in more.rows.who) == 6


@pytest.mark.ray
def test_rows_are_the_same_on_ray(found: ds.Stability) -> None:
    ray = pytest.importorskip("ray")
    # A cluster of its own: Ray would join one that a stopped program left behind.
    ray.init(address="local", log_to_driver=False)
    try:
        far = ds.survey.families(GRID, family=SMALL, seeds=4, engine="ray", twice=0.2)
    finally:
        ray.shutdown()
    assert without_times(far.rows) == without_times(found.rows)


def test_a_row_says_what_was_run_and_what_came_of_it(found: ds.Stability) -> None:
    row = next(row for row in found.rows if row["family"] == "leaned-towers" and row["settings"]["substeps"] == 8)
    assert row["storeys"] == pytest.approx(row["bodies"], rel=1e-5) and row["mass_ratio"] == 1
    assert 0 < row["overlap_max"] < 1e-2 and row["seconds"] > 0 and len(row["hash"]) == 16
    # Islands may take more substeps than those of the settings, and no fewer.
    assert row["price"] >= 8 * row["bodies"] * row["steps"]
    batch = ds.Batch(ds.Scene.find("family", kind=1, seed=row["seed"]), config=ds.Config("fast", substeps=8, sleep=False))
    batch.step(row["steps"])
    assert f"{batch.hash()[0]:016x}" == row["hash"] and float(batch.steps[0]) * row["dt"] == batch.time[0]


def test_shares_have_the_counts_of_the_rows(found: ds.Stability) -> None:
    shares = found.shares()
    assert [(one["settings"]["substeps"], one["family"]) for one in shares] == [(n, kind) for n in (1, 8) for kind in SMALL]
    for one in shares:
        own = [row for row in found.rows if row["family"] == one["family"] and row["settings"] == one["settings"]]
        assert one["worlds"] == 4 and one["passed"] == sum(row["passed"] for row in own)
        assert 0 <= one["least"] <= one["share"] <= one["most"] + 1e-9 <= 1 + 1e-9
    assert sum(one["passed"] for one in shares[:3]) < sum(one["passed"] for one in shares[3:])
    together = found.shares(together=True)
    assert [one["worlds"] for one in together] == [12, 12] and together[1]["substeps"] >= 8
    assert found.settings == tuple(one["settings"] for one in together) and found.families == tuple(SMALL)


def test_table_and_pictures_have_every_share(found: ds.Stability, tmp_path: Path) -> None:
    lines = found.table().splitlines()
    assert lines[0] == "| family | fast, substeps=1 | fast, substeps=8 |" and len(lines) == 5
    price = xml.fromstring(found.price_svg())
    # Three families and all of them, under two settings.
    assert len(price.findall(".//{*}circle")) == 8
    of_one = xml.fromstring(found.map_svg("slopes"))
    assert [cell.text for cell in of_one.iter() if (cell.text or "").startswith("of ")] == ["of 4", "of 4"]
    assert [path.name for path in found.write(tmp_path)] == ["families.md", "families-price.svg", "families-map.svg"]
    assert (tmp_path / "families-map.svg").read_text() == found.map_svg()


def test_a_run_that_raises_is_a_row_that_does_not_pass(found: ds.Stability) -> None:
    rows = list(found.rows[:4])
    rows[1] = {name: rows[1][name] for name in ("key", "family", "seed", "settings")} | {"error": "RuntimeError: no"}
    [one] = ds.Stability(ds.Rows(tuple(rows))).shares()
    assert one["worlds"] == 4 and one["passed"] == sum(bool(row.get("passed")) for row in rows)
    with pytest.raises(ValueError, match="^rows: no world ran to its end$"):
        ds.Stability(ds.Rows(tuple(rows[1:2]))).map_svg()


@pytest.mark.parametrize(
    ("settings", "options", "line"),
    [
        ({"preset": ["fats"]}, {}, "preset: "),
        ({"substep": [1]}, {}, "substep: did you mean 'substeps'?"),
        ({"substeps": [0]}, {}, "substeps"),
        ({"substeps": []}, {}, "settings: 'substeps' is empty: must have at least one value"),
        ([], {}, "settings is empty: must have at least one dict of settings"),
        (["fast"], {}, "settings = ['fast']: must be a dict of lists, or a list of dicts"),
        ([{"preset": "fast"}] * 2, {}, "settings has fast twice"),
        ({}, {"family": "stack"}, "family = 'stack': did you mean 'stacks'?"),
        ({}, {"family": []}, "family is empty: must have at least one name, or be None for all"),
        ({}, {"seeds": 0}, "seeds = 0: must be 1 or more"),
        ({}, {"seeds": [1.5]}, "seeds = 1.5: must be a whole number"),
        ({}, {"seeds": [2**60]}, f"seeds has {2**60}: must be at most 2^53"),
        ({}, {"seeds": [3, 3]}, "seeds: a seed occurs twice"),
        ({}, {"engine": "rays"}, "engine = 'rays': did you mean 'ray'?"),
    ],
)
def test_wrong_arguments_are_named(settings: object, options: dict, line: str) -> None:
    with pytest.raises(ValueError) as caught:
        ds.survey.families(settings, **{"engine": "here", "seeds": 1, "family": "slopes", **options})
    assert str(caught.value).startswith(line) and "\n" not in str(caught.value)
