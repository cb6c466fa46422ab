"""The parts of a survey on machines without a cluster, as a command.

    python -m drystone.shard module:function --runs runs.jsonl --shard 2/4 --out part-2.jsonl
    python -m drystone.shard module:function --runs runs.jsonl --merge part-*.jsonl --out rows.jsonl

`runs.jsonl` has one argument of the function in each line. Without `--shard` the command computes all runs. The rows
are those of `drystone.survey`, byte for byte.
"""

from __future__ import annotations

import argparse
import importlib
import json
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ._families import survey_with_families as survey
from ._survey import NotTheSame, Run


def main(words: Sequence[str] | None = None) -> int:
    """Run the command with words in place of the arguments of the process. Returns its exit code: 0, 1 if results
    differ, or 2 for an invalid argument.

    >>> import json, pathlib, tempfile
    >>> from drystone.shard import main
    >>> with tempfile.TemporaryDirectory() as folder:  # doctest: +ELLIPSIS
    ...     runs, rows = pathlib.Path(folder, "runs.jsonl"), pathlib.Path(folder, "rows.jsonl")
    ...     _ = runs.write_text(json.dumps({"scene": "tower", "n": 2, "steps": 10}))
    ...     command = ["drystone.studies:stands", "--runs", str(runs), "--out", str(rows), "--engine", "here"]
    ...     code = main(command)
    1 rows, 0 with an error: ...rows.jsonl
    """
    parser = argparse.ArgumentParser("python -m drystone.shard", description="A part of a survey, or the merge of all parts.")
    parser.add_argument("run", metavar="MODULE:FUNCTION")
    parser.add_argument("--runs", required=True, metavar="FILE", help="JSON lines, one argument of the function each")
    parser.add_argument("--out", required=True, metavar="FILE", help="JSON lines of rows; a repeated command resumes")
    parser.add_argument("--shard", metavar="I/N", help="the I-th of N parts, such as 2/4")
    parser.add_argument("--merge", nargs="+", metavar="FILE", help="join the rows of all parts")
    parser.add_argument("--engine", default="processes", choices=["processes", "here"])
    parser.add_argument("--workers", type=int, help="number of processes")
    parser.add_argument("--timed", action="append", default=[], metavar="NAME", help="a result that a clock gives")
    parser.add_argument("--timing", action="store_true", help="one run at a time")
    given = parser.parse_args(words)
    if given.merge and given.shard:
        parser.error("--merge and --shard: give one of them")
    try:
        run, runs = _function(given.run), _lines(given.runs)
        if given.merge:
            rows = survey.merge(run, runs, given.merge, out=given.out, timed=given.timed)
        else:
            shard = None if given.shard is None else _shard(given.shard)
            options = {"workers": given.workers, "timed": given.timed, "timing": given.timing}
            rows = survey(run, runs, out=given.out, engine=given.engine, shard=shard, **options)
    except (ValueError, OSError, NotTheSame) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1 if isinstance(error, NotTheSame) else 2
    errors = sum("error" in row for row in rows)
    print(f"{len(rows)} rows, {errors} with an error: {given.out}")
    return 0


def _function(name: str) -> Run:
    module, colon, function = name.partition(":")
    if not (module and colon and function):
        raise ValueError(f"run = {name!r}: must be module:function")
    sys.path.insert(0, os.getcwd())
    try:
        found = getattr(importlib.import_module(module), function)
    except (ImportError, AttributeError) as error:
        raise ValueError(f"run = {name!r}: {error}") from None
    result: Run = found
    return result


def _lines(path: str) -> list[Any]:
    runs = []
    for k, line in enumerate(Path(path).read_text().splitlines(), 1):
        if line.strip():
            try:
                runs.append(json.loads(line))
            except ValueError as error:
                raise ValueError(f"{path}: line {k}: {error}") from None
    return runs


def _shard(text: str) -> tuple[int, int]:
    number, slash, parts = text.partition("/")
    if not (slash and number.isdecimal() and parts.isdecimal()):
        raise ValueError(f"shard = {text!r}: must be two numbers, such as 2/4")
    return int(number), int(parts)


if __name__ == "__main__":
    sys.exit(main())
