"""Which setting stands which worlds, at what price: random worlds of the families of hard cases under three presets and two limits of substeps.

    python examples/families.py [FOLDER] [SEEDS]

Run it again with more seeds, or with `engine="ray"` on a cluster: rows that are there are not computed again.
"""

import sys
import time
from pathlib import Path

import drystone as ds

SETTINGS = (
    {"preset": "fast"},
    {"preset": "balanced"},
    {"preset": "balanced", "max_substeps": 8},
    {"preset": "accurate"},
)


def main(folder: Path, seeds: int) -> None:
    begin = time.perf_counter()
    found = ds.survey.families(SETTINGS, seeds=seeds, out=folder / "families.jsonl")
    print(f"{len(found.rows)} worlds in {time.perf_counter() - begin:.1f} s, rows in {folder / 'families.jsonl'}\n")
    print(found.table())
    print("\n" + "\n".join(str(path) for path in found.write(folder)))


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "."), int(sys.argv[2] if len(sys.argv) > 2 else 10))
