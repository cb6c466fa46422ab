"""Surveys: one function of many arguments, in this process, in several processes or on a cluster, with the same rows.
"""

from __future__ import annotations

import hashlib
import importlib
import inspect
import json
import os
import pickle
import platform
import signal
import sys
import time
from collections import deque
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from concurrent import futures
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass, field
from functools import cache, partial
from multiprocessing import current_process, get_context
from pathlib import Path
from typing import Any, Protocol, TextIO, overload

import numpy as np

from . import _check, _drystone

Run = Callable[[dict[str, Any]], Mapping[str, Any]]
Row = dict[str, Any]
ENGINES = ("auto", "here", "processes", "ray")

# Target duration of a task: a shorter one has more overhead, and a longer one loses more work with its worker.
TASK_SECONDS = 1.0
MAX_RUNS_A_TASK = 4096
# Additional duration for each task that runs at the same time, because the driver takes 2 ms for a task
# (docs/cluster.md).
SECONDS_A_TASK = 0.005
# Simultaneous tasks of each worker: one that runs and one that waits.
TASKS_A_WORKER = 2
# Number of times that a run may end its worker.
MAX_DEATHS = 3
NO_GUARD = (
    "a new process ran the survey of its script again: put the calls of the script under `if __name__ == \"__main__\":`"
)
# Number of attempts of a check to find a worker other than that of the first run.
MAX_SEARCHES = 5


class NotTheSame(RuntimeError):
    """Two computations of one run gave different results. `run` has its argument, `results` both results, and
    `machines` where they were computed.

    >>> import drystone as ds, itertools
    >>> counter = itertools.count()
    >>> try:
    ...     ds.survey(lambda run: {"n": next(counter)}, [{"k": 1}], engine="here", twice=1)
    ... except ds.NotTheSame as error:
    ...     print(error.run, error.results)
    {'k': 1} ({'n': 0}, {'n': 1})
    """

    def __init__(self, run: Any, results: tuple[Any, Any], machines: tuple[str, str]) -> None:
        self.run, self.results, self.machines = run, results, machines
        super().__init__(f"run {json.dumps(run)} gave {results[0]} on {machines[0]} and {results[1]} on {machines[1]}")

    def __reduce__(self) -> tuple[Any, ...]:
        return NotTheSame, (self.run, self.results, self.machines)


@dataclass(frozen=True, repr=False)
class Rows(Sequence[Row]):
    """The rows of a survey in the order of its runs. A row has `key`, the argument, and the result or `error`.

    `who` has the machine and process that computed each row, and the time (s). It is empty for rows from an earlier
    file.

    >>> import drystone as ds
    >>> rows = ds.survey(lambda run: {"square": run["n"] ** 2}, [{"n": 2}, {"n": 3}], engine="here")
    >>> rows, rows[1]["square"], [row["n"] for row in rows]
    (<Rows: 2 rows of 3 columns>, 9, [2, 3])
    """

    rows: tuple[Row, ...]
    who: tuple[Row, ...] = ()

    @overload
    def __getitem__(self, index: int) -> Row: ...
    @overload
    def __getitem__(self, index: slice) -> tuple[Row, ...]: ...
    def __getitem__(self, index: int | slice) -> Row | tuple[Row, ...]:
        return self.rows[index]

    def __len__(self) -> int:
        return len(self.rows)

    def columns(self) -> dict[str, np.ndarray[Any, Any]]:
        """An array for each name of any row, with None for rows without a value.

        >>> import drystone as ds
        >>> ds.Rows(({"key": "a", "n": 1}, {"key": "b", "n": 2})).columns()["n"].tolist()
        [1, 2]
        """
        return {name: _column([row.get(name) for row in self.rows]) for name in self._names()}

    def _names(self) -> dict[str, None]:
        return dict.fromkeys(name for row in self.rows for name in row)

    def __repr__(self) -> str:
        return f"<Rows: {len(self)} rows of {len(self._names())} columns>"


def _column(values: list[Any]) -> np.ndarray[Any, Any]:
    try:
        return np.array(values)
    except ValueError:
        # Lists of several lengths, or lists and None.
        column = np.empty(len(values), object)
        for k, value in enumerate(values):
            column[k] = value
        return column


def survey(
    run: Run,
    runs: Iterable[Mapping[str, Any]],
    *,
    out: str | os.PathLike[str] | None = None,
    engine: str = "auto",
    workers: int | None = None,
    chunk: int | None = None,
    twice: float = 0.01,
    timed: Collection[str] = (),
    timing: bool = False,
    shard: tuple[int, int] | None = None,
    on_error: str = "row",
    progress: bool | None = None,
) -> Rows:
    """Compute `run` for every argument in `runs`. The rows are in the order of `runs`, and have the same bits for every
    engine.

    `run` is a function of a module. Its result (numbers, strings, small arrays) depends only on its argument.

    `out` is a file of JSON lines. Each row is added when it is computed, and the rows are sorted at the end. A repeated
    call reuses the rows of the file, and discards an incomplete line.

    `engine`: "here" is this process, "processes" is a pool of `workers` processes (by default one for each processor),
    and "ray" is a cluster (drystone[ray]). "auto" is "ray" if Ray is initialized, else "processes". A script that
    starts processes needs `if __name__ == "__main__":` around its calls. `chunk` is the number of runs in a task; None
    aims at a second for each task.

    `twice` is the share of runs that another worker computes again. If the results differ, NotTheSame names the run and
    both machines. `timed` names results that a clock gives, which may differ. With `timing`, each machine computes one
    run at a time; on a cluster, machines with less than half of the processors of the largest one take no part.

    `shard` (2, 4) computes the second of four equal parts of the runs, for machines without a cluster. `survey.merge`
    joins the files of all parts.

    `on_error`: "row" makes a row with the `error` of an exception, and "raise" raises it. `progress` shows completed
    rows and the remaining time; None shows them on a terminal. Ctrl-C keeps the completed rows.

    ValueError: an argument is invalid. OSError: `out` cannot be read or written. RuntimeError: a run ended its worker
    three times. NotTheSame: two workers computed different results.

    >>> import drystone as ds
    >>> from drystone.studies import stands
    >>> rows = ds.survey(stands, [{"scene": "tower", "n": n, "steps": 30} for n in (2, 3)], engine="here")
    >>> [row["n"] for row in rows], [row["stands"] for row in rows]
    ([2, 3], [1.0, 1.0])
    """
    _check.one_of("engine", engine, ENGINES)
    _check.one_of("on_error", on_error, ("row", "raise"))
    share = _check.number("twice", twice)
    if not 0 <= share <= 1:
        raise ValueError(f"twice = {twice}: must be 0 to 1")
    if getattr(current_process(), "_inheriting", False):
        # A new process imports the script before its first task.
        raise RuntimeError(NO_GUARD)
    size = None if chunk is None else _check.whole("chunk", chunk, 1)
    path = None if out is None else Path(_check.path("out", out))
    asked, keys = _asked(run, runs)
    if shard is not None:
        part = _part(shard, len(keys))
        asked, keys = asked[part], keys[part]
    left_out = set(_check.words("timed", timed))
    made = _engine(engine, workers, run, bool(timing))
    with _Store(path, keys) as store:
        state = _Survey(run, asked, keys, store, share, left_out, on_error, size, _Progress(len(keys), progress))
        state.go_through(made)
    return store.rows(keys)


def merge(
    run: Run,
    runs: Iterable[Mapping[str, Any]],
    parts: Iterable[str | os.PathLike[str]],
    *,
    out: str | os.PathLike[str] | None = None,
    timed: Collection[str] = (),
) -> Rows:
    """Join the rows of the files `parts`, which `survey` wrote with `shard`, in the order of `runs`. `run`, `runs` and
    `timed` are those of the survey. `out` is the file for all rows.

    ValueError: a row is missing, because a part is incomplete or another program wrote it. NotTheSame: two parts have
    different results for one run. OSError: a file cannot be read or written.

    >>> import drystone as ds, pathlib, tempfile
    >>> from drystone.studies import stands
    >>> runs = [{"scene": "tower", "n": n, "steps": 10} for n in (2, 3)]
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     parts = [pathlib.Path(folder, f"{k}.jsonl") for k in (1, 2)]
    ...     for k, part in enumerate(parts, 1):
    ...         _ = ds.survey(stands, runs, out=part, engine="here", shard=(k, 2))
    ...     rows = ds.survey.merge(stands, runs, parts)
    >>> [row["n"] for row in rows]
    [2, 3]
    """
    asked, keys = _asked(run, runs)
    left_out = {"key", *_check.words("timed", timed)}
    lines: dict[str, tuple[str, str]] = {}
    for part in parts:
        path = _check.path("parts", part)
        for line in Path(path).read_text().split("\n"):
            key = _key_of(line)
            if key is not None:
                if key in lines:
                    first, again = (
                        {name: value for name, value in json.loads(text).items() if name not in left_out}
                        for text in (lines[key][0], line)
                    )
                    if not _same(first, again):
                        given = asked[keys.index(key)] if key in keys else key
                        raise NotTheSame(given, (first, again), (lines[key][1], path))
                lines.setdefault(key, (line, path))
    missing = [one for key, one in zip(keys, asked, strict=True) if key not in lines]
    if missing:
        raise ValueError(f"parts: {len(missing)} of {len(keys)} rows are missing, first that of {missing[0]}")
    with _Store(None if out is None else Path(_check.path("out", out)), keys) as store:
        store.have = {key: lines[key][0] for key in keys}
    return store.rows(keys)


def _asked(run: Run, runs: Any) -> tuple[list[dict[str, Any]], list[str]]:
    """The arguments of a survey, and their keys."""
    if not callable(run):
        raise ValueError(f"run is {type(run).__name__}: must be a function of one argument")
    if isinstance(runs, (str, bytes, Mapping)) or not isinstance(runs, Iterable):
        raise ValueError(f"runs is {type(runs).__name__}: must be a list of dicts")
    asked = [_plain_run(k, one) for k, one in enumerate(runs)]
    return asked, _keys(run, asked)


def _part(shard: Any, count: int) -> slice:
    """The runs of a part."""
    if not isinstance(shard, (tuple, list)) or len(shard) != 2:
        raise ValueError(f"shard = {shard!r}: must be two numbers, such as (2, 4)")
    number, parts = (_check.whole("shard", one, 1) for one in shard)
    if number > parts:
        raise ValueError(f"shard = {shard!r}: must be at most ({parts}, {parts})")
    return slice(number - 1, count, parts)


def _plain_run(k: int, one: Any) -> dict[str, Any]:
    try:
        argument: dict[str, Any] = json.loads(json.dumps(plain(dict(one))))
    except (TypeError, ValueError) as error:
        raise ValueError(f"runs[{k}] = {one!r}: must be a dict of numbers, strings and lists ({error})") from None
    if "key" in argument:
        raise ValueError(f"runs[{k}] has 'key': this name is for the key of a row")
    return argument


def _keys(run: Run, asked: list[dict[str, Any]]) -> list[str]:
    """A key for each run: a hash of its argument, the function and the program. Repeated runs are numbered, so that
    their keys differ.
    """
    try:
        source = inspect.getsource(run)
    except (OSError, TypeError):
        source = repr(run)
    program = _program()
    seen: dict[str, int] = {}
    keys = []
    for one in asked:
        text = json.dumps([one, source, program], sort_keys=True)
        count = seen[text] = seen.get(text, -1) + 1
        keys.append(hashlib.sha256(f"{text}{count or ''}".encode()).hexdigest()[:20])
    return keys


@cache
def _program() -> str:
    """A hash of the program."""
    return hashlib.sha256(Path(str(_drystone.__file__)).read_bytes()).hexdigest()


def _machine() -> str:
    return f"{platform.node()}:{os.getpid()}"


def _compute(run: Run, part: list[tuple[str, dict[str, Any]]], not_by: str | None, on_error: str) -> list[Row] | None:
    """Compute some runs. Returns rows with their machines, or None if this process is the excluded one."""
    if not_by == _machine():
        return None
    rows = []
    for key, one in part:
        begin = time.perf_counter()
        try:
            result = plain(dict(run(dict(one))))
            if "key" in result:
                raise ValueError("the result has 'key': this name is for the key of a row")
        except Exception as error:
            if on_error == "raise":
                raise
            result = {"error": f"{type(error).__name__}: {error}"}
        rows.append({"key": key, "result": result, "machine": _machine(), "seconds": time.perf_counter() - begin})
    return rows


def plain(value: Any) -> Any:
    """An argument or a result in the form of JSON, with every number to the last bit."""
    if isinstance(value, Mapping):
        return {str(key): plain(one) for key, one in value.items()}
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, (list, tuple)):
        return [plain(one) for one in value]
    if value is None or isinstance(value, (bool, int, float, str)):
        return value
    raise TypeError(f"{type(value).__name__}: must be numbers, strings and small arrays")


def _same(a: Any, b: Any) -> bool:
    # NaN differs from itself, but its text does not.
    return json.dumps(a, sort_keys=True) == json.dumps(b, sort_keys=True)


class _Store:
    """The completed rows, and their file."""

    def __init__(self, path: Path | None, keys: list[str]) -> None:
        self.path, self.have, self.who = path, dict[str, str](), dict[str, Row]()
        self.file: TextIO | None = None
        if path is not None and path.exists():
            wanted = set(keys)
            for line in path.read_text().split("\n"):
                key = _key_of(line)
                if key in wanted:
                    self.have[str(key)] = line

    def __enter__(self) -> _Store:
        if self.path is not None:
            # Remove incomplete lines and rows of other surveys before adding rows.
            self._write(list(self.have.values()))
            self.file = self.path.open("a")
        return self

    def __exit__(self, *_: object) -> None:
        if self.file is not None:
            self.file.close()

    def add(self, key: str, one: dict[str, Any], row: Row) -> None:
        line = json.dumps({"key": key, **one, **row["result"]})
        self.have[key] = line
        self.who[key] = {"machine": row["machine"], "seconds": row["seconds"]}
        if self.file is not None:
            self.file.write(line + "\n")
            self.file.flush()

    def rows(self, keys: list[str]) -> Rows:
        if self.path is not None:
            self._write([self.have[key] for key in keys])
        rows = tuple(json.loads(self.have[key]) for key in keys)
        return Rows(rows, tuple(self.who.get(key, {}) for key in keys))

    def _write(self, lines: list[str]) -> None:
        assert self.path is not None
        self.path.parent.mkdir(parents=True, exist_ok=True)
        beside = self.path.with_name(self.path.name + ".new")
        beside.write_text("".join(line + "\n" for line in lines))
        beside.replace(self.path)


def _key_of(line: str) -> str | None:
    try:
        row = json.loads(line)
    except ValueError:
        return None
    return row.get("key") if isinstance(row, dict) else None


class _Progress:
    """A progress line on a terminal: completed rows, and the remaining time."""

    def __init__(self, all_rows: int, wanted: bool | None) -> None:
        self.all, self.begin, self.first, self.last = all_rows, time.monotonic(), -1, 0.0
        self.is_on = sys.stderr.isatty() if wanted is None else wanted

    def tell(self, done: int) -> None:
        now = time.monotonic()
        self.first = done if self.first < 0 else self.first
        if not self.is_on or (now - self.last < 0.2 and done < self.all):
            return
        self.last = now
        made = done - self.first
        left = f"{(now - self.begin) / made * (self.all - done):.0f} s left" if made else ""
        end = "\n" if done == self.all else ""
        print(f"\r{done} of {self.all} runs  {left:20}", end=end, file=sys.stderr, flush=True)


Task = tuple[list[int], str | None, int]


@dataclass
class _Survey:
    """The remaining work of a survey."""

    run: Run
    asked: list[dict[str, Any]]
    keys: list[str]
    store: _Store
    twice: float
    timed: set[str]
    on_error: str
    chunk: int | None
    progress: _Progress

    def go_through(self, engine: _Engine) -> None:
        todo = deque(k for k, key in enumerate(self.keys) if key not in self.store.have)
        checks: deque[Task] = deque()
        running: dict[int, Task] = {}
        mean = 0.0
        self.progress.tell(len(self.store.have))
        with engine:
            while todo or checks or running:
                while len(running) < engine.room and (todo or checks):
                    task = checks.popleft() if checks else self._next(todo, mean, engine.room)
                    running[engine.submit(self._work(task), task[1])] = task
                number, rows = engine.next()
                numbers, not_by, searches = running.pop(number)
                if rows is None:
                    # The worker of the first run got this check: try again.
                    other = not_by if searches < MAX_SEARCHES else None
                    checks.append((numbers, other, searches + 1))
                    continue
                if searches:
                    self._compare(numbers, rows)
                    continue
                for k, row in zip(numbers, rows, strict=True):
                    self.store.add(self.keys[k], self.asked[k], row)
                    mean = row["seconds"] if mean == 0 else 0.9 * mean + 0.1 * row["seconds"]
                    if int(self.keys[k][:8], 16) < self.twice * 2**32:
                        checks.append(([k], row["machine"] if engine.has_others else None, 1))
                self.progress.tell(len(self.store.have))

    def _next(self, todo: deque[int], mean: float, room: int) -> Task:
        wanted = max(TASK_SECONDS, SECONDS_A_TASK * room)
        size = self.chunk or min(MAX_RUNS_A_TASK, max(1, round(wanted / mean)) if mean else 1)
        if self.chunk is None:
            # Near the end, every worker should still get a task.
            size = max(1, min(size, len(todo) // max(1, room)))
        return [todo.popleft() for _ in range(min(size, len(todo)))], None, 0

    def _work(self, task: Task) -> Callable[[], list[Row] | None]:
        numbers, not_by, _ = task
        return partial(_compute, self.run, [(self.keys[k], self.asked[k]) for k in numbers], not_by, self.on_error)

    def _compare(self, numbers: list[int], rows: list[Row]) -> None:
        for k, row in zip(numbers, rows, strict=True):
            kept = json.loads(self.store.have[self.keys[k]])
            left_out = {"key", *self.asked[k], *self.timed}
            first, again = (
                {name: value for name, value in of.items() if name not in left_out} for of in (kept, row["result"])
            )
            if not _same(first, again):
                machines = (str(self.store.who[self.keys[k]]["machine"]), str(row["machine"]))
                raise NotTheSame(self.asked[k], (first, again), machines)


class _Engine(Protocol):
    """Runs tasks. A task is repeated if its worker dies."""

    @property
    def room(self) -> int:
        """Number of simultaneous tasks."""

    @property
    def has_others(self) -> bool:
        """Whether a worker other than that of a task can run it."""

    def __enter__(self) -> _Engine: ...
    def __exit__(self, *_: object) -> None: ...
    def submit(self, work: Callable[[], list[Row] | None], not_by: str | None) -> int: ...
    def next(self) -> tuple[int, list[Row] | None]: ...


def _engine(name: str, workers: int | None, run: Run, timing: bool) -> _Engine:
    count = None if workers is None else _check.whole("workers", workers, 1)
    if name == "auto":
        ray = sys.modules.get("ray")
        name = "ray" if ray is not None and ray.is_initialized() else "processes"
    if name == "here":
        return _Here()
    if name == "ray":
        return _Ray(timing)
    _check_found(run)
    return _Processes(1 if timing else count or os.cpu_count() or 1)


def _check_found(run: Run) -> None:
    """Refuse a function that a new process cannot import."""
    try:
        pickle.dumps(run)
    except Exception as error:
        raise ValueError(
            f"run = {run!r}: must be a function of a module, or engine be 'here', since other processes import it ({error})"
        ) from None
    main = sys.modules.get("__main__")
    if getattr(run, "__module__", None) == "__main__" and not os.path.exists(getattr(main, "__file__", None) or ""):
        raise ValueError(
            f"run = {run!r}: must be in a file, or engine be 'here', since other processes cannot import an interactive session"
        )


class _Here:
    """Runs tasks in this process."""

    room, has_others = 1, False

    def __init__(self) -> None:
        self.waiting: deque[tuple[int, Callable[[], list[Row] | None]]] = deque()
        self.count = 0

    def __enter__(self) -> _Here:
        return self

    def __exit__(self, *_: object) -> None: ...

    def submit(self, work: Callable[[], list[Row] | None], not_by: str | None) -> int:
        self.count += 1
        self.waiting.append((self.count, work))
        return self.count

    def next(self) -> tuple[int, list[Row] | None]:
        number, work = self.waiting.popleft()
        return number, work()


def _begin_worker(has_begun: Any) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    has_begun.set()


@dataclass
class _Worker:
    """A process, and its tasks in order."""

    pool: futures.ProcessPoolExecutor
    tasks: dict[int, futures.Future[list[Row] | None]] = field(default_factory=dict)
    machine: str | None = None


class _Processes:
    """Processes of this machine, each with its own queue. If a process dies, the first task of its queue is blamed."""

    def __init__(self, workers: int) -> None:
        self.room, self.has_others = TASKS_A_WORKER * workers, workers > 1
        self.count, self.workers = workers, list[_Worker]()
        self.work: dict[int, Callable[[], list[Row] | None]] = {}
        self.deaths: dict[int, int] = {}
        self.numbers = 0

    def __enter__(self) -> _Processes:
        self.context = get_context("spawn")
        self.has_begun = self.context.Event()
        self.workers = [_Worker(self._new_pool()) for _ in range(self.count)]
        return self

    def __exit__(self, *_: object) -> None:
        for worker in self.workers:
            worker.pool.shutdown(wait=not worker.tasks, cancel_futures=True)

    def _new_pool(self) -> futures.ProcessPoolExecutor:
        return futures.ProcessPoolExecutor(1, self.context, _begin_worker, (self.has_begun,))

    def submit(self, work: Callable[[], list[Row] | None], not_by: str | None) -> int:
        self.numbers += 1
        self.work[self.numbers] = work
        others = [worker for worker in self.workers if not_by is None or worker.machine != not_by]
        self._start(self.numbers, min(others or self.workers, key=lambda worker: len(worker.tasks)))
        return self.numbers

    def _start(self, number: int, worker: _Worker) -> None:
        try:
            worker.tasks[number] = worker.pool.submit(self.work[number])
        except BrokenProcessPool:
            self._replace(worker)
            worker.tasks[number] = worker.pool.submit(self.work[number])

    def next(self) -> tuple[int, list[Row] | None]:
        while True:
            all_tasks = {future: (n, w) for w in self.workers for n, future in w.tasks.items()}
            done, _ = futures.wait(all_tasks, return_when=futures.FIRST_COMPLETED)
            number, worker = all_tasks[done.pop()]
            try:
                rows = worker.tasks[number].result()
            except BrokenProcessPool:
                self._replace(worker)
                continue
            del worker.tasks[number], self.work[number]
            if rows:
                worker.machine = str(rows[0]["machine"])
            return number, rows

    def _replace(self, worker: _Worker) -> None:
        """Start a new process in place of a dead one, with the same tasks."""
        if not self.has_begun.is_set():
            raise RuntimeError(f"no worker got to its first run: its error is above. Perhaps {NO_GUARD}")
        tasks = sorted(worker.tasks)
        for first in tasks[:1]:
            self.deaths[first] = self.deaths.get(first, 0) + 1
            if self.deaths[first] >= MAX_DEATHS:
                raise RuntimeError(f"a run ended its worker {MAX_DEATHS} times: {_runs_of(self.work[first])}")
        worker.pool.shutdown(wait=False, cancel_futures=True)
        worker.pool, worker.machine = self._new_pool(), None
        worker.tasks = {number: worker.pool.submit(self.work[number]) for number in tasks}


def _runs_of(work: Callable[[], list[Row] | None]) -> str:
    """The runs of a task in words."""
    runs = [one for _, one in work.args[1]] if isinstance(work, partial) else [work]
    return str(runs[0]) if len(runs) == 1 else f"one of {runs}"


def _share_of_machine(processors: Collection[float]) -> int:
    """Number of processors for a task, so that no machine of the cluster has room for two tasks."""
    return int(max(processors, default=1)) // 2 + 1


class _Ray:
    """A Ray cluster. Ray repeats the tasks of dead workers and nodes."""

    def __init__(self, timing: bool = False) -> None:
        try:
            self.ray: Any = importlib.import_module("ray")
        except ImportError:
            raise ValueError("engine = 'ray': Ray is not installed; pip install 'drystone[ray]'") from None
        self.running: dict[Any, int] = {}
        self.count = 0
        # Nodes come and go, and a query for them takes as long as a task.
        self.workers, self.asked = 1, -1.0
        self.timing, self.each = timing, 1

    def __enter__(self) -> _Ray:
        if not self.ray.is_initialized():
            self.ray.init(log_to_driver=False)
        self.each = _share_of_machine(self._processors()) if self.timing else 1
        self.task = self.ray.remote(max_retries=-1, num_cpus=self.each)(_call)
        return self

    def _processors(self) -> list[float]:
        """Number of processors of each node."""
        return [node.get("Resources", {}).get("CPU", 0.0) for node in self.ray.nodes() if node["Alive"]]

    def __exit__(self, *_: object) -> None:
        for reference in self.running:
            self.ray.cancel(reference, force=True)

    @property
    def room(self) -> int:
        if time.monotonic() > self.asked + 1:
            self.workers = max(1, sum(int(count // self.each) for count in self._processors()))
            self.asked = time.monotonic()
        return TASKS_A_WORKER * self.workers

    @property
    def has_others(self) -> bool:
        return self.room > TASKS_A_WORKER

    def submit(self, work: Callable[[], list[Row] | None], not_by: str | None) -> int:
        self.count += 1
        self.running[self.task.remote(work)] = self.count
        return self.count

    def next(self) -> tuple[int, list[Row] | None]:
        [done], _ = self.ray.wait(list(self.running), num_returns=1)
        number = self.running.pop(done)
        try:
            rows: list[Row] | None = self.ray.get(done)
        except self.ray.exceptions.RayTaskError as error:
            raise error.as_instanceof_cause() from None
        return number, rows


def _call(work: Callable[[], list[Row] | None]) -> list[Row] | None:
    return work()

