"""Surveys: the same rows by every engine, files that were cut, runs that fail, workers that die, results that differ."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import drystone as ds
from drystone.studies import map_svg, means, stands, table

RUNS = [{"scene": "pile", "n": 8, "seed": seed, "steps": 20} for seed in range(24)]


def pile(run: dict) -> dict:
    batch = ds.Batch(ds.Scene.find(run["scene"], n=run["n"], seed=run["seed"]), num_threads=1)
    batch.step(run["steps"])
    return {"hash": f"{batch.hash()[0]:016x}", "lowest": batch.position[0, :, 1].min(), "last": batch.position[0, -1]}


def odd_fails(run: dict) -> dict:
    if run["k"] % 2:
        raise ValueError(f"k = {run['k']}: must be even")
    return {"half": run["k"] // 2}


def dies_once(run: dict) -> dict:
    mark = Path(run["folder"], f"died-{run['k']}")
    if run["k"] % 5 == 2 and not mark.exists():
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return {"k": run["k"], "square": run["k"] ** 2}


def dies(run: dict) -> dict:
    if run["k"] == 3:
        os.kill(os.getpid(), signal.SIGKILL)
    return {"k": run["k"]}


def by_process(run: dict) -> dict:
    return {"process": os.getpid()}


def by_clock(run: dict) -> dict:
    return {"time": time.perf_counter()}


def slow(run: dict) -> dict:
    time.sleep(0.05)
    return {"k": run["k"]}


def test_rows_are_the_same_by_every_engine_to_the_byte(tmp_path: Path) -> None:
    files = {}
    for engine, chunk in [("here", None), ("processes", None), ("processes", 5)]:
        path = tmp_path / f"{engine}-{chunk}.jsonl"
        rows = ds.survey(pile, RUNS, out=path, engine=engine, workers=2, chunk=chunk, twice=0.3)
        assert [row["seed"] for row in rows] == list(range(24)) and rows[3]["last"] != rows[4]["last"]
        assert all(who["seconds"] > 0 for who in rows.who)
        files[engine, chunk] = path.read_bytes()
    assert len(set(files.values())) == 1
    assert len({row["hash"] for row in rows}) == 24
    columns = rows.columns()
    assert columns["lowest"].dtype == np.float64 and columns["last"].shape == (24, 3)


def test_a_file_that_was_cut_goes_on(tmp_path: Path) -> None:
    path = tmp_path / "rows.jsonl"
    ds.survey(pile, RUNS, out=path, engine="here")
    whole = path.read_bytes()
    lines = whole.split(b"\n")
    for kept in (0, 1, 13, 23):
        path.write_bytes(b"\n".join([*lines[:kept], lines[kept][:40]]))
        rows = ds.survey(pile, RUNS, out=path, engine="here")
        assert path.read_bytes() == whole
        assert sum(bool(who) for who in rows.who) == 24 - kept, "rows that were there are not computed again"
    # Another argument, and another function, are other rows.
    other = [{**run, "steps": 21} for run in RUNS[:2]]
    assert all(ds.survey(pile, other, out=path, engine="here").who)


def test_errors_are_rows_or_are_raised(tmp_path: Path) -> None:
    runs = [{"k": k} for k in range(5)]
    for engine in ("here", "processes"):
        rows = ds.survey(odd_fails, runs, engine=engine, workers=2, twice=1)
        assert [row.get("half") for row in rows] == [0, None, 1, None, 2]
        assert rows[3]["error"] == "ValueError: k = 3: must be even"
        with pytest.raises(ValueError, match="^k = [13]: must be even$"):
            ds.survey(odd_fails, runs, engine=engine, workers=2, on_error="raise")


def test_a_worker_that_dies_is_replaced_and_a_run_that_kills_is_named(tmp_path: Path) -> None:
    runs = [{"k": k, "folder": str(tmp_path)} for k in range(15)]
    rows = ds.survey(dies_once, runs, engine="processes", workers=2, chunk=2)
    assert [row["square"] for row in rows] == [k * k for k in range(15)]
    assert len(list(tmp_path.glob("died-*"))) == 3
    with pytest.raises(RuntimeError, match=r"ended its worker 3 times: .*'k': 3"):
        ds.survey(dies, [{"k": k} for k in range(5)], engine="processes", workers=2, chunk=1)


def test_results_that_differ_are_found(tmp_path: Path) -> None:
    with pytest.raises(ds.NotTheSame, match=r'^run \{"k": 0\} gave .* on .*:\d+ and .* on .*:\d+$') as caught:
        ds.survey(by_process, [{"k": 0}], engine="processes", workers=2, twice=1)
    machines = caught.value.machines
    assert machines[0] != machines[1] and f":{caught.value.results[0]['process']}" in machines[0]
    with pytest.raises(ds.NotTheSame):
        ds.survey(by_clock, [{"k": 0}], engine="here", twice=1)
    assert len(ds.survey(by_clock, [{"k": 0}], engine="here", twice=0)) == 1


def test_ctrl_c_keeps_the_rows(tmp_path: Path) -> None:
    path, here = tmp_path / "rows.jsonl", Path(__file__).resolve()
    text = (
        f"import sys; sys.path.insert(0, {str(here.parent)!r})\n"
        "import drystone as ds, test_survey as t\n"
        f"if __name__ == '__main__': ds.survey(t.slow, [{{'k': k}} for k in range(2000)], out={str(path)!r}, "
        "engine=sys.argv[1], workers=2, chunk=1)\n"
    )
    (tmp_path / "main.py").write_text(text)
    environment = {**os.environ, "PYTHONPATH": str(Path(ds.__file__).parents[1])}
    for engine in ("here", "processes"):
        path.unlink(missing_ok=True)
        child = subprocess.Popen([sys.executable, str(tmp_path / "main.py"), engine], stderr=subprocess.PIPE, env=environment)
        deadline = time.monotonic() + 60
        while time.monotonic() < deadline and not (path.exists() and path.read_bytes().count(b"\n") >= 5):
            time.sleep(0.05)
        child.send_signal(signal.SIGINT)
        _, errors = child.communicate(timeout=30)
        assert b"KeyboardInterrupt" in errors
        rows = [json.loads(line) for line in path.read_text().splitlines()]
        assert len(rows) >= 5 and all(row["k"] >= 0 for row in rows)


@pytest.mark.parametrize(
    ("options", "line"),
    [
        ({"engine": "rays"}, "engine = 'rays': did you mean 'ray'?"),
        ({"twice": 2}, "twice = 2: must be 0 to 1"),
        ({"chunk": 0}, "chunk = 0: must be 1 or more"),
        ({"on_error": "skip"}, "on_error = 'skip': must be one of row, raise"),
        ({"runs": [{"k": object}]}, None),
    ],
)
def test_wrong_arguments_are_named(options: dict, line: str | None) -> None:
    with pytest.raises(ValueError) as caught:
        ds.survey(slow, options.pop("runs", [{"k": 1}]), **{"engine": "here", **options})
    assert line is None or str(caught.value) == line


def test_maps_and_tables_show_the_means() -> None:
    runs = [{"scene": "tower", "n": n, "gap": gap, "steps": 60} for n in (2, 4) for gap in (0.0, 0.01)]
    rows = ds.survey(stands, runs, engine="here")
    assert means(rows, "n", "gap", "stands") == dict.fromkeys([(2, 0.0), (2, 0.01), (4, 0.0), (4, 0.01)], 1.0)
    svg = map_svg(rows, "n", "gap", "stands")
    assert svg.count("<rect") == 4 and svg.count('fill="#08306b"') == 4
    assert table(rows, "n", "gap", "stands").splitlines()[2] == "| 0 | 1 | 1 |"
    with pytest.raises(ValueError, match="none has numbers"):
        map_svg(rows, "n", "gap", "stand")
