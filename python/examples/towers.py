"""Which towers stand, at what price: 200 towers of several heights and heavy tops under two settings, as a table and as maps.

    python examples/towers.py [FOLDER]

Run it again with other settings, or with `engine="ray"` on a cluster: the rows have the same bits.
"""

import itertools
import sys
import time
from pathlib import Path

import drystone as ds
from drystone.studies import map_svg, stands, table

HEIGHTS = (2, 4, 6, 8, 10, 12, 14, 16, 18, 20)
RATIOS = (1, 3, 10, 30, 100, 300, 1000, 3000, 10000, 30000)
# As drystone chooses substeps, and with 8 for every tower.
SETTINGS = ({"preset": "balanced"}, {"preset": "balanced", "max_substeps": 8})


def main(folder: Path) -> None:
    runs = [
        {"scene": "tower", "n": n, "top_ratio": ratio, "gap": 0.005, "steps": 300, "config": config}
        for config, n, ratio in itertools.product(SETTINGS, HEIGHTS, RATIOS)
    ]
    begin = time.perf_counter()
    rows = ds.survey(stands, runs, out=folder / "towers.jsonl", twice=0.02)
    print(f"{len(rows)} towers in {time.perf_counter() - begin:.1f} s, rows in {folder / 'towers.jsonl'}")
    for config in SETTINGS:
        own = [row for row in rows if row["config"] == config]
        name = "substeps as needed" if "max_substeps" not in config else "8 substeps"
        path = folder / f"towers, {name}.svg"
        path.write_text(map_svg(own, "n", "top_ratio", "stands", title=f"share of boxes that stand: {name}"))
        price = sum(row["price"] for row in own)
        print(f"\n{name}: {price / 1e6:.1f} million substeps of bodies; the map is {path}\n")
        print(table(own, "n", "top_ratio", "stands"))


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "."))
