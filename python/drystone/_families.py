"""Families of hard cases over a grid of settings: the passing share and the price of each setting."""

from __future__ import annotations

import inspect
import itertools
import math
import os
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np

from . import _check, _drystone
from ._scene import Config
from ._survey import Row, Rows, merge, plain, survey
from .studies import color_of, text

Settings = Mapping[str, Any]

# Columns of the page of families (docs/families.md).
PRESETS: tuple[Settings, ...] = ({"preset": "fast"}, {"preset": "balanced"}, {"preset": "accurate"})
# A double represents every whole number up to here.
LAST_SEED = 2**53
# Columns that a clock gives. They differ between two runs of one world.
TIMED = ("seconds",)

# Lower limits of the cells of a map.
RATIOS = (1, 3, 10, 30, 100, 300, 1000)
STOREYS = (1, 2, 4, 8, 16, 32, 64)
CELL, GAP, LEFT, TOP, LEGEND = 44, 36, 80, 56, 150
# A distinct color for each family.
COLORS = ("#1f77b4", "#d62728", "#2ca02c", "#9467bd", "#ff7f0e", "#8c564b", "#e377c2", "#17becf", "#bcbd22", "#7f7f7f")


def judged(run: Settings) -> dict[str, Any]:
    """Run the world of a family and a seed, and check it against its law. `drystone.survey.families` runs this
    function.

    `run` has `family`, `seed` and `settings`. Bodies do not sleep. `Stability` describes the result.

    >>> from drystone._families import judged
    >>> result = judged({"family": "slopes", "seed": 1, "settings": {"preset": "fast"}})
    >>> result["passed"], result["bodies"], [check["what"] for check in result["checks"]][-1]
    (True, 1, 'non-finite bodies')
    """
    config = _config(run["settings"])
    return _drystone.judge(str(run["family"]), int(run["seed"]), config._config)


def families(
    settings: Mapping[str, Any] | Sequence[Settings] = PRESETS,
    *,
    family: str | Collection[str] | None = None,
    seeds: int | Iterable[int] = 20,
    out: str | os.PathLike[str] | None = None,
    engine: str = "auto",
    workers: int | None = None,
    chunk: int | None = None,
    twice: float = 0.01,
    timing: bool = False,
    on_error: str = "row",
    progress: bool | None = None,
) -> Stability:
    """Judge random worlds of each family (docs/families.md) under several settings, like `drystone hard --families`.

    `settings` is a grid, such as {"preset": ["fast", "accurate"], "max_substeps": [8, 64]} for every pair of both, or a
    list of dicts of settings (docs/settings.md). `family` is one name or several; None selects all. `seeds` is a number
    of seeds from 1 on, or the seeds themselves. `out` and the arguments after it are those of `drystone.survey`. The
    rows are the same for every engine, except `seconds`, which a clock gives.

    ValueError: a family or setting is unknown, or a seed is invalid. RuntimeError: a run ended its worker three times.

    >>> import drystone as ds
    >>> found = ds.survey.families({"preset": ["fast"], "substeps": [1, 8]}, family="slopes", seeds=3, engine="here")
    >>> [(one["settings"]["substeps"], one["worlds"], one["passed"]) for one in found.shares()]
    [(1, 3, 1), (8, 3, 3)]
    """
    chosen = _grid(settings)
    known = [name for name, _ in _drystone.family_names()]
    names = known if family is None else _check.words("family", family, known)
    numbers = _seeds(seeds)
    if not names:
        raise ValueError("family is empty: must have at least one name, or be None for all")
    runs = [
        {"family": name, "seed": seed, "settings": one} for one, name, seed in itertools.product(chosen, names, numbers)
    ]
    rows = survey(
        judged,
        runs,
        out=out,
        engine=engine,
        workers=workers,
        chunk=chunk,
        twice=twice,
        timed=TIMED,
        timing=timing,
        on_error=on_error,
        progress=progress,
    )
    return Stability(rows)


def _config(settings: Settings) -> Config:
    # Sleep would hide the behavior that a law describes.
    return Config(**{"sleep": False, **settings})


def _grid(settings: Mapping[str, Any] | Sequence[Settings]) -> list[dict[str, Any]]:
    """All settings of a grid or of a list, checked."""
    if isinstance(settings, Mapping):
        axes = [[(name, one) for one in _values(name, values)] for name, values in settings.items()]
        chosen = [dict(one) for one in itertools.product(*axes)]
    elif isinstance(settings, Sequence) and all(isinstance(one, Mapping) for one in settings):
        chosen = [dict(one) for one in settings]
    else:
        raise ValueError(f"settings = {settings!r}: must be a dict of lists, or a list of dicts")
    if not chosen:
        raise ValueError("settings is empty: must have at least one dict of settings")
    checked = []
    for one in chosen:
        if bad := [name for name in one if not isinstance(name, str)]:
            raise ValueError(f"settings has {bad[0]!r}: must have names of settings")
        _config(one)
        if one in checked:
            raise ValueError(f"settings has {_label(one)} twice")
        checked.append(plain(one))
    return checked


def _values(name: str, values: Any) -> list[Any]:
    """The values of a setting in a grid, also if there is only one."""
    if isinstance(values, (str, Mapping)) or not isinstance(values, Iterable):
        return [values]
    several = list(values)
    if not several:
        raise ValueError(f"settings: {name!r} is empty: must have at least one value")
    return several


def _seeds(seeds: int | Iterable[int]) -> list[int]:
    if isinstance(seeds, Iterable):
        numbers = [_check.whole("seeds", seed) for seed in seeds]
    else:
        numbers = list(range(1, _check.whole("seeds", seeds, 1) + 1))
    if not numbers:
        raise ValueError("seeds is empty: must have at least one")
    if max(numbers) > LAST_SEED:
        raise ValueError(f"seeds has {max(numbers)}: must be at most 2^53")
    if len(set(numbers)) < len(numbers):
        raise ValueError("seeds: a seed occurs twice")
    return numbers


def _label(settings: Settings) -> str:
    """A short label for settings."""
    words = [f"{name}={value}" for name, value in settings.items() if name != "preset"]
    return ", ".join([str(settings.get("preset", "balanced")), *words])


@dataclass(frozen=True, repr=False)
class Stability:
    """The result of `drystone.survey.families`: the worlds that pass under each setting, and their price.

    `rows` has one row for each world and setting, with `family`, `seed` and `settings`; `bodies` (number of dynamic
    bodies), `height` (m), `storeys` (height in bodies), `mass_ratio` (heaviest to lightest body), `gravity` (m/s²),
    `dt` (s) and `steps`; `passed`, and `checks` with `what`, `value`, `limit` and `passed`; `overlap_max` (m, measured
    twenty times), `price` (substeps summed over dynamic bodies and steps), `seconds` (of processor time per simulated
    second) and `hash`. A run that raised an exception has `error` instead, and does not pass.

    >>> import drystone as ds
    >>> found = ds.survey.families([{"preset": "fast"}], family="pushed-blocks", seeds=2, engine="here")
    >>> found.rows[0]["family"], found.rows[0]["bodies"], found.rows[0]["storeys"], found.rows[0]["mass_ratio"]
    ('pushed-blocks', 1, 1.0, 1.0)
    """

    rows: Rows

    @property
    def settings(self) -> tuple[Settings, ...]:
        """The settings in order."""
        return tuple({_label(row["settings"]): row["settings"] for row in self.rows}.values())

    @property
    def families(self) -> tuple[str, ...]:
        """The families in order."""
        return tuple(dict.fromkeys(row["family"] for row in self.rows))

    def __repr__(self) -> str:
        sizes = f"{len(self.rows)} worlds of {len(self.families)} families under {len(self.settings)} settings"
        return f"<Stability: {sizes}>"

    def shares(self, *, together: bool = False) -> list[Row]:
        """The passing share of each family under each setting, or with `together` of all families in total.

        A row has `family`, `settings`, `worlds`, `passed`, `share`, its 95 % interval by Wilson's formula (`least`,
        `most`), and medians over the worlds: `seconds` (of processor time per simulated second), `overlap_max` (m),
        `substeps` (per body and step).

        >>> import drystone as ds
        >>> [one] = ds.survey.families([{"preset": "fast"}], family="slopes", seeds=2, engine="here").shares()
        >>> one["share"], round(one["least"], 3), one["most"], one["substeps"]
        (1.0, 0.342, 1.0, 4.0)
        """
        groups: dict[tuple[str, str], list[Row]] = {}
        for row in self.rows:
            name = "all" if together else row["family"]
            groups.setdefault((_label(row["settings"]), name), []).append(row)
        return [self._share(name, rows) for (_, name), rows in groups.items()]

    @staticmethod
    def _share(name: str, rows: list[Row]) -> Row:
        passed = sum(bool(row.get("passed")) for row in rows)
        ran = [row for row in rows if "error" not in row]
        least, most = _drystone.wilson(passed, len(rows))

        def middle(values: Iterable[float]) -> float:
            found = list(values)
            return median(found) if found else math.nan

        return {
            "family": name,
            "settings": rows[0]["settings"],
            "worlds": len(rows),
            "passed": passed,
            "share": passed / len(rows),
            "least": least,
            "most": most,
            "seconds": middle(row["seconds"] for row in ran),
            "overlap_max": middle(row["overlap_max"] for row in ran),
            "substeps": middle(row["price"] / (row["bodies"] * row["steps"]) for row in ran),
        }

    def table(self) -> str:
        """The shares as a Markdown table: share, interval, and milliseconds of processor time per simulated second.

        >>> import drystone as ds
        >>> found = ds.survey.families([{"preset": "fast"}], family="slopes", seeds=2, engine="here")
        >>> found.table().splitlines()[2].split(",")[0]
        '| slopes | 100 % (34.2 to 100.0)'
        """
        cells = {(one["family"], _label(one["settings"])): one for one in self.shares()}
        labels = [_label(one) for one in self.settings]
        lines = ["| family | " + " | ".join(labels) + " |", "|---" * (len(labels) + 1) + "|"]
        for name in self.families:
            lines.append(f"| {name} | " + " | ".join(_words(cells.get((name, label))) for label in labels) + " |")
        return "\n".join(lines)

    def price_svg(self) -> str:
        """The passing share against processor time, as SVG: one line for each family through its settings, and one for
        all families in total with 95 % intervals.

        ValueError: no world completed its run.

        >>> import drystone as ds
        >>> found = ds.survey.families([{"preset": "fast"}], family="slopes", seeds=2, engine="here")
        >>> found.price_svg().count("<circle")
        2
        """
        known = [one for one in self.shares() if one["seconds"] > 0]
        both = [one for one in self.shares(together=True) if one["seconds"] > 0]
        if not known:
            raise ValueError("rows: no world ran to its end")
        width, height, bottom = 760, 420, 376
        powers = [math.log10(one["seconds"]) for one in known + both]
        low, high = math.floor(min(powers) - 0.05), math.ceil(max(powers) + 0.05)
        # The axis of shares starts at a multiple of a quarter.
        ends = [float(one["share"]) for one in known] + [float(one["least"]) for one in both]
        first = math.floor(4 * min(0.75, *ends)) / 4

        def up(share: float) -> float:
            return bottom - (share - first) / (1 - first) * (bottom - TOP)

        def place(one: Row, share: float) -> tuple[float, float]:
            x = (math.log10(one["seconds"]) - low) / (high - low)
            return LEFT + x * (width - LEFT - LEGEND - 10), up(share)

        right = width - LEGEND - 10
        parts = [text((LEFT + right) / 2, 24, "share of the worlds that pass, against the time of the processor")]
        for share in np.linspace(first, 1, 6):
            y = up(share)
            parts += [f'<path d="M{LEFT} {y:g}H{right}" stroke="#ddd"/>', text(LEFT - 24, y + 4, f"{100 * share:g} %")]
        for power in range(low, high + 1):
            x = LEFT + (power - low) / (high - low) * (right - LEFT)
            parts += [f'<path d="M{x:g} {TOP}V{bottom}" stroke="#ddd"/>', text(x, bottom + 18, f"{1000 * 10.0**power:g}")]
        parts.append(text((LEFT + right) / 2, bottom + 36, "ms of the processor for a second of the world (median)"))
        for k, name in enumerate(self.families):
            color = COLORS[k % len(COLORS)]
            parts += _line([place(one, one["share"]) for one in known if one["family"] == name], color, 1.5)
            parts.append(f'<rect x="{right + 16}" y="{TOP + 18 * k - 9}" width="10" height="10" fill="{color}"/>')
            parts.append(f'<text x="{right + 32}" y="{TOP + 18 * k}" text-anchor="start">{name}</text>')
        parts += _line([place(one, one["share"]) for one in both], "#000", 3)
        for k, one in enumerate(sorted(both, key=lambda one: float(one["seconds"]))):
            x, _ = place(one, one["share"])
            low_y, high_y = up(one["least"]), up(one["most"])
            parts.append(f'<path d="M{x:.1f} {low_y:.1f}V{high_y:.1f}" stroke="#000" stroke-width="1.5"/>')
            # Stagger the labels, because settings can have nearly the same price.
            parts.append(text(round(x, 1), round(low_y + 16 + 14 * (k % 3), 1), _label(one["settings"])))
        end = TOP + 18 * len(self.families)
        parts.append(f'<rect x="{right + 16}" y="{end - 9}" width="10" height="10" fill="#000"/>')
        parts.append(f'<text x="{right + 32}" y="{end}" text-anchor="start">all</text>')
        return _svg(width, height, parts)

    def map_svg(self, family: str | Collection[str] | None = None) -> str:
        """The passing share over height and mass ratio, as SVG: one map for each setting. A cell has the share in
        percent and the number of worlds.

        `family` selects families; None selects all.

        ValueError: no world of these families completed its run.

        >>> import drystone as ds
        >>> found = ds.survey.families([{"preset": "fast"}], family="slopes", seeds=2, engine="here")
        >>> found.map_svg().count("<rect")
        1
        """
        names = list(self.families) if family is None else _check.words("family", family, self.families)
        cells: dict[tuple[str, int, int], list[bool]] = {}
        for row in self.rows:
            if row["family"] in names and "error" not in row:
                cell = (_label(row["settings"]), _cell(row["mass_ratio"], RATIOS), _cell(row["storeys"], STOREYS))
                cells.setdefault(cell, []).append(bool(row["passed"]))
        if not cells:
            raise ValueError("rows: no world ran to its end")
        columns, heights = 1 + max(cell[1] for cell in cells), 1 + max(cell[2] for cell in cells)
        panel, bottom = max(CELL * columns, 130), TOP + CELL * heights
        parts = [text(LEFT - 30, TOP - 12, "height")]
        parts += [text(LEFT - 24, bottom - CELL * (k + 0.5) + 4, f"{STOREYS[k]} +") for k in range(heights)]
        for k, label in enumerate(_label(one) for one in self.settings):
            left = LEFT + (panel + GAP) * k
            parts.append(text(left + panel / 2, 24, label))
            for (of, column, up), results in cells.items():
                if of == label:
                    corner = (left + CELL * column, bottom - CELL * (up + 1))
                    parts += _cell_svg(*corner, sum(results) / len(results), len(results))
            parts += [text(left + CELL * (j + 0.5), bottom + 16, f"{RATIOS[j]} +") for j in range(columns)]
            parts.append(text(left + CELL * columns / 2, bottom + 34, "mass ratio"))
        width = LEFT + (panel + GAP) * len(self.settings)
        parts.append(f'<text x="8" y="{bottom + 58}" text-anchor="start">share that passes (%), of so many worlds;'
                     " height in bodies</text>")
        return _svg(max(width, 400), bottom + 70, parts)

    def write(self, folder: str | os.PathLike[str]) -> list[Path]:
        """Write the table (families.md) and both pictures (families-price.svg, families-map.svg) into a folder, and
        return their paths.

        >>> import drystone as ds, tempfile
        >>> found = ds.survey.families([{"preset": "fast"}], family="slopes", seeds=2, engine="here")
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     print([path.name for path in found.write(folder)])
        ['families.md', 'families-price.svg', 'families-map.svg']
        """
        files = {"families.md": self.table() + "\n", "families-price.svg": self.price_svg(), "families-map.svg": self.map_svg()}
        made = Path(folder)
        made.mkdir(parents=True, exist_ok=True)
        for name, content in files.items():
            (made / name).write_text(content)
        return [made / name for name in files]


class _Surveys:
    """`drystone.survey`, with `families` and `merge` as attributes."""

    __call__ = staticmethod(survey)
    families = staticmethod(families)
    merge = staticmethod(merge)
    __doc__ = survey.__doc__
    __signature__ = inspect.signature(survey)

    def __repr__(self) -> str:
        return "<function drystone.survey>"


survey_with_families = _Surveys()


def _words(one: Row | None) -> str:
    if one is None:
        return ""
    least, most = 100 * one["least"], 100 * one["most"]
    return f"{100 * one['share']:.0f} % ({least:.1f} to {most:.1f}), {1000 * one['seconds']:.3g} ms"


def _cell(value: float, ends: Sequence[int]) -> int:
    """The index of the cell for a value. A value that is below a limit only by rounding counts as above."""
    return max(0, sum(value * (1 + 1e-6) >= end for end in ends) - 1)


def _cell_svg(x: float, y: float, share: float, count: int) -> list[str]:
    ink = "#fff" if share > 0.5 else "#000"
    middle = x + CELL / 2
    return [
        f'<rect x="{x}" y="{y}" width="{CELL}" height="{CELL}" fill="{color_of(share)}" stroke="#fff"/>',
        text(middle, y + CELL / 2, f"{100 * share:.0f}", ink),
        f'<text x="{middle:g}" y="{y + CELL - 8}" fill="{ink}" font-size="9">of {count}</text>',
    ]


def _line(points: list[tuple[float, float]], color: str, width: float) -> list[str]:
    points = sorted(points)
    places = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
    dots = [f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{1.5 + width}" fill="{color}"/>' for x, y in points]
    return [f'<polyline points="{places}" fill="none" stroke="{color}" stroke-width="{width}"/>', *dots]


def _svg(width: float, height: float, parts: list[str]) -> str:
    style = 'font-family="sans-serif" font-size="12" text-anchor="middle"'
    head = f'<svg xmlns="http://www.w3.org/2000/svg" width="{width:g}" height="{height:g}" {style}>'
    return "\n".join([head, *parts, "</svg>", ""])
