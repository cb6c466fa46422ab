"""Surveys: the same rows by every engine, files that were cut, runs that fail, workers that die, results that differ."""

import json
import os
import pickle
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import drystone as ds
from drystone._survey import _share_of_machine
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


def vectors(run: dict) -> dict:
    if run["k"] == 2:
        raise ValueError("no vector")
    return {"vector": np.arange(3) * run["k"], "key": 1} if run["k"] == 3 else {"vector": np.arange(3) * run["k"]}


def test_arguments_and_results_are_numpy_arrays_too() -> None:
    rows = ds.survey(vectors, [{"k": k} for k in np.arange(4)], engine="here")
    assert rows[3]["error"] == "ValueError: the result has 'key': this name is for the key of a row"
    columns = rows.columns()
    assert columns["k"].tolist() == [0, 1, 2, 3] and columns["vector"].tolist() == [[0, 0, 0], [0, 1, 2], None, None]


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
    again = pickle.loads(pickle.dumps(caught.value))
    assert str(again) == str(caught.value) and again.machines == machines
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


def test_parts_of_a_survey_merge_to_the_bytes_of_one_machine(tmp_path: Path) -> None:
    # The last run is the first one again, in another part.
    runs = [*RUNS[:7], RUNS[0]]
    whole, merged = tmp_path / "whole.jsonl", tmp_path / "merged.jsonl"
    ds.survey(pile, runs, out=whole, engine="here")
    parts = [tmp_path / f"part-{k}.jsonl" for k in (1, 2, 3)]
    for k, part in enumerate(parts, 1):
        rows = ds.survey(pile, runs, out=part, engine="here", shard=(k, 3))
        assert [row["seed"] for row in rows] == [run["seed"] for run in runs[k - 1 :: 3]]
    rows = ds.survey.merge(pile, runs, parts, out=merged)
    assert merged.read_bytes() == whole.read_bytes() and len(rows) == 8
    with pytest.raises(ValueError, match="^parts: 3 of 8 rows are missing, first that of {.*'seed': 1,"):
        ds.survey.merge(pile, runs, [parts[0], parts[2]])
    # A part that another machine computed otherwise.
    other = tmp_path / "other.jsonl"
    other.write_text(parts[1].read_text().replace('"hash": "', '"hash": "0'))
    with pytest.raises(ds.NotTheSame, match="part-2.jsonl and .* on .*other.jsonl$"):
        ds.survey.merge(pile, runs, [*parts, other])
    assert len(ds.survey.merge(pile, runs, [*parts, other], timed=["hash"])) == 8


def test_the_command_of_parts(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text("def double(run):\n    return {'double': 2 * run['k']}\n")
    (tmp_path / "runs.jsonl").write_text("".join(f'{{"k": {k}}}\n' for k in range(5)))
    environment = {**os.environ, "PYTHONPATH": str(Path(ds.__file__).parents[1])}

    def command(*words: str) -> subprocess.CompletedProcess:
        line = [sys.executable, "-m", "drystone.shard", "mine:double", "--runs", "runs.jsonl", *words]
        return subprocess.run(line, cwd=tmp_path, env=environment, capture_output=True, text=True)

    ran = command("--shard", "1/2", "--out", "1.jsonl", "--workers", "1")
    assert ran.stdout == "3 rows, 0 with an error: 1.jsonl\n", ran.stderr
    assert command("--shard", "2/2", "--out", "2.jsonl", "--engine", "here").returncode == 0
    assert command("--merge", "1.jsonl", "2.jsonl", "--out", "all.jsonl").returncode == 0
    rows = [json.loads(line) for line in (tmp_path / "all.jsonl").read_text().splitlines()]
    assert [row["double"] for row in rows] == [0, 2, 4, 6, 8]
    for words, line in [
        (("--merge", "1.jsonl", "--out", "all.jsonl"), "error: parts: 2 of 5 rows are missing, first that of {'k': 1}\n"),
        (("--shard", "3/2", "--out", "a"), "error: shard = (3, 2): must be at most (2, 2)\n"),
        (("--shard", "3", "--out", "a"), "error: shard = '3': must be two numbers, such as 2/4\n"),
    ]:
        wrong = command(*words)
        assert wrong.returncode == 2 and wrong.stderr == line


def test_a_script_without_a_guard_and_functions_that_others_cannot_import_are_named(tmp_path: Path) -> None:
    script = tmp_path / "main.py"
    script.write_text(
        "import drystone as ds\nfrom drystone.studies import stands\n"
        "ds.survey(stands, [{'scene': 'tower', 'n': 2}], engine='processes', workers=1)\n"
    )
    environment = {**os.environ, "PYTHONPATH": str(Path(ds.__file__).parents[1])}
    ran = subprocess.run([sys.executable, str(script)], env=environment, capture_output=True, text=True)
    assert ran.returncode == 1 and "if __name__ ==" in ran.stderr.splitlines()[-1]
    # A session without a file.
    program = "import drystone as ds\ndef run(one): return {}\nds.survey(run, [{}], engine='processes')\n"
    ran = subprocess.run([sys.executable, "-"], input=program, env=environment, capture_output=True, text=True)
    assert "must be in a file, or engine be 'here'" in ran.stderr.splitlines()[-1]
    with pytest.raises(ValueError, match="^run = <function .*<lambda>.*: must be a function of a module"):
        ds.survey(lambda run: {}, [{}], engine="processes")
    assert len(ds.survey(lambda run: {}, [{}], engine="here")) == 1


def test_a_survey_of_times_has_one_run_at_a_time() -> None:
    rows = ds.survey(by_process, [{"k": k} for k in range(4)], engine="processes", timing=True, twice=0)
    assert len({row["process"] for row in rows}) == 1
    # On a cluster a task takes more than half of the processors of the largest node.
    assert [_share_of_machine(counts) for counts in ([], [1], [2, 2], [8, 3, 0], [7])] == [1, 1, 2, 5, 4]


@pytest.mark.parametrize(
    ("options", "line"),
    [
        ({"runs": 3}, "runs is int: must be a list of dicts"),
        ({"out": 3}, "out is int: must be a path"),
        ({"timed": 3}, "timed = 3: must be a word or a list of words"),
        ({"shard": 3}, "shard = 3: must be two numbers, such as (2, 4)"),
        ({"shard": (5, 4)}, "shard = (5, 4): must be at most (4, 4)"),
        ({"engine": "rays"}, "engine = 'rays': did you mean 'ray'?"),
        ({"twice": 2}, "twice = 2: must be 0 to 1"),
        ({"chunk": 0}, "chunk = 0: must be 1 or more"),
        ({"on_error": "skip"}, "on_error = 'skip': must be one of row, raise"),
        ({"runs": [{"k": object}]}, None),
        ({"runs": [{"key": 1}]}, "runs[0] has 'key': this name is for the key of a row"),
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
