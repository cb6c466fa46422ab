"""Runs for surveys: whether scenes stand under their settings, and at what price."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from ._batch import Batch
from ._scene import Config, Scene


def stands(run: Mapping[str, Any]) -> dict[str, Any]:
    """Run a scene, and measure whether it stands.

    `run` has `scene`, the parameters of the scene, `steps` (600 by default), and `config` (a dict of settings, with
    `preset`). The result has `stands` (the share of the dynamic bodies that moved by less than 0.2 m), `overlap_max`
    (m), `joint_gap` (m), `fastest` (m/s), `price` (substeps summed over awake bodies and steps), and `hash`.

    >>> from drystone.studies import stands
    >>> result = stands({"scene": "tower", "n": 3, "steps": 60})
    >>> result["stands"], result["overlap_max"] < 1e-3
    (1.0, True)
    """
    rest = dict(run)
    steps = int(rest.pop("steps", 600))
    config = dict(rest.pop("config", {}))
    scene = Scene.find(str(rest.pop("scene")), **rest)
    is_dynamic = [body.get("kind", "dynamic") == "dynamic" for body in scene.to_dict()["bodies"]]
    batch = Batch(scene, config=Config(**config), num_threads=1)
    start, price = batch.position.copy(), 0
    for _ in range(0, steps, 10):
        batch.step(min(10, steps - int(batch.steps[0])))
        price += 10 * int(batch.substeps[~batch.asleep].sum())
    moved = ((batch.position - start) ** 2).sum(axis=2) ** 0.5
    measures = {name: float(value[0]) for name, value in batch.measure("overlap_max", "joint_gap", "fastest").items()}
    return {"stands": float((moved[0, is_dynamic] < 0.2).mean()), **measures, "price": price, "hash": f"{batch.hash()[0]:016x}"}


# Lowest and highest color of a map.
LOW, HIGH = (247, 251, 255), (8, 48, 107)
CELL = 44


def map_svg(
    rows: Iterable[Mapping[str, Any]], x: str, y: str, value: str, *, title: str = "", low: float = 0.0, high: float = 1.0
) -> str:
    """A map of a survey as SVG. Each pair of `x` and `y` has a cell, with the mean of `value` over its rows as its
    color and number.

    ValueError: no row has all three.

    >>> from drystone.studies import map_svg
    >>> rows = [{"n": n, "gap": g, "stands": n / 2} for n in (1, 2) for g in (0, 1)]
    >>> map_svg(rows, "n", "gap", "stands").count("<rect")
    4
    """
    cells = means(rows, x, y, value)
    across, up = (sorted({pair[k] for pair in cells}) for k in (0, 1))
    left, top = 90, 40
    parts = []
    for (a, b), mean in cells.items():
        share = min(1.0, max(0.0, (mean - low) / (high - low)))
        px, py = left + CELL * across.index(a), top + CELL * (len(up) - 1 - up.index(b))
        parts.append(f'<rect x="{px}" y="{py}" width="{CELL}" height="{CELL}" fill="{color_of(share)}" stroke="#fff"/>')
        ink = "#fff" if share > 0.5 else "#000"
        parts.append(text(px + CELL / 2, py + CELL / 2 + 4, f"{mean:.2g}", ink))
    bottom = top + CELL * len(up)
    parts += [text(left + CELL * (k + 0.5), bottom + 16, f"{a:g}") for k, a in enumerate(across)]
    parts += [text(left - 24, bottom - CELL * (k + 0.5) + 4, f"{b:g}") for k, b in enumerate(up)]
    parts += [text(left + CELL * len(across) / 2, bottom + 36, x), text(30, top - 10, y)]
    parts.append(text(left + CELL * len(across) / 2, 20, title or value))
    size = f'width="{left + CELL * len(across) + 20}" height="{bottom + 50}"'
    style = 'font-family="sans-serif" font-size="12" text-anchor="middle"'
    return f'<svg xmlns="http://www.w3.org/2000/svg" {size} {style}>\n' + "\n".join(parts) + "\n</svg>\n"


def means(rows: Iterable[Mapping[str, Any]], x: str, y: str, value: str) -> dict[tuple[float, float], float]:
    """The mean of `value` over the rows of each pair of `x` and `y`. Rows without all three are left out.

    ValueError: no row has all three.

    >>> from drystone.studies import means
    >>> means([{"n": 1, "gap": 0, "stands": 1}, {"n": 1, "gap": 0, "stands": 0}], "n", "gap", "stands")
    {(1, 0): 0.5}
    """
    cells: dict[tuple[float, float], list[float]] = {}
    for row in rows:
        if all(isinstance(row.get(name), (int, float)) for name in (x, y, value)):
            cells.setdefault((row[x], row[y]), []).append(float(row[value]))
    if not cells:
        raise ValueError(f"rows: none has numbers of {x!r}, {y!r} and {value!r}")
    return {pair: sum(values) / len(values) for pair, values in sorted(cells.items())}


def table(rows: Iterable[Mapping[str, Any]], x: str, y: str, value: str) -> str:
    """The same as a Markdown table.

    >>> from drystone.studies import table
    >>> print(table([{"n": 1, "gap": 0, "stands": 1.0}], "n", "gap", "stands"))
    | gap \\ n | 1 |
    |--:|--:|
    | 0 | 1 |
    """
    cells = means(rows, x, y, value)
    across, up = (sorted({pair[k] for pair in cells}) for k in (0, 1))
    lines = [f"| {y} \\ {x} | " + " | ".join(f"{a:g}" for a in across) + " |", "|--:" * (len(across) + 1) + "|"]
    for b in up:
        values = (f"{cells[a, b]:.3g}" if (a, b) in cells else "" for a in across)
        lines.append(f"| {b:g} | " + " | ".join(values) + " |")
    return "\n".join(lines)


def color_of(share: float) -> str:
    """The color for a share from 0 to 1.

    >>> from drystone.studies import color_of
    >>> color_of(0), color_of(1)
    ('#f7fbff', '#08306b')
    """
    return "#" + "".join(f"{round(p + (q - p) * share):02x}" for p, q in zip(LOW, HIGH, strict=True))


def text(x: float, y: float, words: str, color: str = "#000") -> str:
    """Text centered at a place of a picture, as SVG.

    >>> from drystone.studies import text
    >>> text(1, 2, "n < 3")
    '<text x="1" y="2" fill="#000">n &lt; 3</text>'
    """
    safe = words.replace("&", "&amp;").replace("<", "&lt;")
    return f'<text x="{x:g}" y="{y:g}" fill="{color}">{safe}</text>'
