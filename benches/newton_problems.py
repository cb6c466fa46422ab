#!/usr/bin/env python3
"""Contact problems that are hard for Newton's method: soups of boxes and capsules in a tray, and plank towers that fall.

    python3 benches/newton_problems.py --drystone target/release/drystone --out problems [--only PART]

The script writes scene files with fixed seeds, runs them with `drystone run --save-problem`, and so makes the same problems each
time. With --solve it also solves each problem with `--method newton` and prints steps, sweeps, milliseconds and e_vel. With --solve
OLD NEW it runs two programs in turn and prints the ratio of their times.
"""

import argparse
import json
import math
import pathlib
import random
import statistics
import subprocess


def turn(rng):
    """A quaternion, uniform over all turns."""
    x = [rng.gauss(0.0, 1.0) for _ in range(4)]
    length = math.sqrt(sum(v * v for v in x))
    return [v / length for v in x]


def tray(half, height=6.0, friction=0.5):
    """A floor and four walls."""
    wall = lambda x, z, normal: {"kind": "fixed", "position": [x, 0, z], "friction": friction,
                                 "shapes": [{"type": "half_space", "normal": normal}]}
    return [wall(0, 0, [0, 1, 0]), wall(-half, 0, [1, 0, 0]), wall(half, 0, [-1, 0, 0]),
            wall(0, -half, [0, 0, 1]), wall(0, half, [0, 0, -1])]


def soup(seed, count, ratio=1.0, friction=(0.5, 0.5), shapes="bc", dt=1 / 60):
    """Boxes and capsules with densities from 100 to 100 ratio kg/m³ and friction between two bounds fall into a tray."""
    rng = random.Random(seed)
    side = max(2, math.ceil((count / 3.0) ** (1 / 3)))
    bodies = tray(0.3 * side + 0.2, friction=sum(friction) / 2)
    for i in range(count):
        x, y, z = i % side, i // (side * side), i // side % side
        size = lambda: rng.uniform(0.08, 0.2)
        shape = {"type": "cuboid", "half_extents": [size(), size(), size()]}
        if rng.choice(shapes) == "c":
            shape = {"type": "capsule", "half_height": rng.uniform(0.05, 0.15), "radius": rng.uniform(0.06, 0.14)}
        place = [0.6 * (x - side / 2 + 0.5), 0.4 + 0.6 * y, 0.6 * (z - side / 2 + 0.5)]
        bodies.append({"position": [p + rng.uniform(-0.05, 0.05) for p in place], "rotation": turn(rng), "shapes": [shape],
                       "density": 100.0 * ratio ** rng.random(), "friction": rng.uniform(*friction)})
    return {"version": 1, "dt": dt, "bodies": bodies}


def planks(seed, floors, push, ratio=1.0, friction=0.5, across=3):
    """A tower of planks, two and two crosswise, with a push at its upper half, so that it falls."""
    rng = random.Random(seed)
    bodies = [{"kind": "fixed", "friction": friction, "shapes": [{"type": "half_space", "normal": [0, 1, 0]}]}]
    half = [0.06, 0.02, 0.3]
    for floor in range(floors):
        for k in range(across):
            off = (k - (across - 1) / 2) * 0.48 / max(1, across - 1) + rng.uniform(-0.004, 0.004)
            along = floor % 2 == 1
            bodies.append({"position": [0, half[1] * (2 * floor + 1), off] if along else [off, half[1] * (2 * floor + 1), 0],
                           "rotation": [0, math.sqrt(0.5), 0, math.sqrt(0.5)] if along else [0, 0, 0, 1],
                           "linear_velocity": [push, 0, 0.3 * push] if 2 * floor > floors else [0, 0, 0],
                           "density": 600.0 * ratio ** rng.random(), "friction": friction,
                           "shapes": [{"type": "cuboid", "half_extents": half}]})
    return {"version": 1, "dt": 1 / 60, "bodies": bodies}


# Name, scene and steps whose problems are kept.
SCENES = [
    ("soup-100", soup(1, 100), [30, 60, 120]),
    ("soup-100-ratio-100", soup(2, 100, ratio=100), [30, 60, 120]),
    ("soup-100-ratio-1000", soup(3, 100, ratio=1000, friction=(0.1, 1.0)), [30, 60, 120]),
    ("soup-300", soup(4, 300, friction=(0.2, 0.8)), [30, 60, 120]),
    ("soup-300-ratio-1000", soup(5, 300, ratio=1000, friction=(0.0, 1.0)), [40, 80]),
    ("soup-300-smooth", soup(6, 300, ratio=10, friction=(0.02, 0.1)), [40, 80]),
    ("capsules-300", soup(7, 300, shapes="c", friction=(0.3, 1.0)), [40, 90]),
    ("boxes-300", soup(8, 300, shapes="b", ratio=100, friction=(0.3, 1.0)), [40, 90]),
    ("mujoco-250", soup(9, 250, dt=0.004, friction=(1.0, 1.0)), [100, 200, 400]),
    ("mujoco-600-ratio-100", soup(10, 600, dt=0.004, ratio=100, friction=(0.5, 1.0)), [150, 250, 500]),
    ("soup-1000", soup(11, 1000, ratio=100, friction=(0.2, 1.0)), [60, 120]),
    ("soup-2000", soup(12, 2000, friction=(0.3, 0.7)), [90]),
    ("planks-10", planks(1, 10, 0.5), [10, 30, 60, 90]),
    ("planks-20", planks(2, 20, 1.0), [10, 30, 60, 90]),
    ("planks-20-ratio-100", planks(3, 20, 0.7, ratio=100), [10, 30, 60]),
    ("planks-40", planks(4, 40, 1.0, friction=0.7), [10, 40, 80]),
    ("planks-40-ratio-30", planks(5, 40, 1.5, ratio=30, friction=0.3), [10, 40, 80]),
    ("planks-100", planks(6, 100, 2.0, friction=0.6), [20, 60, 120]),
]


def make(drystone, out, only):
    out.mkdir(parents=True, exist_ok=True)
    for name, scene, steps in SCENES:
        if only not in name:
            continue
        path = out / f"{name}.json"
        path.write_text(json.dumps(scene))
        for step in steps:
            problem = out / f"{name}-step-{step}.contacts"
            command = [drystone, "run", path, "--backend", "cpu", "--steps", str(step), "--save-problem", f"{step}:{problem}"]
            subprocess.run(command, check=True, stdout=subprocess.DEVNULL)


def solve(programs, out, only):
    ratios, solved = [], [0 for _ in programs]
    files = [file for file in sorted(out.glob("*.contacts")) if only in file.name]
    for file in files:
        words, times = [], []
        for i, program in enumerate(programs):
            text = subprocess.run([program, "solve", file, "--method", "newton", "--json"], check=True, capture_output=True).stdout
            r = json.loads(text)
            error = r["residuals"]["e_vel"]
            solved[i] += error <= 1.01e-8
            times.append(r["ms"])
            words.append(f"{r['iterations']:4d} + {r['sweeps']:6d} {r['ms']:10.1f} ms {error:.1e}")
        if len(times) == 2:
            ratios.append(times[1] / times[0])
        print(f"{file.stem:32} {r['contacts']:6d}", *words, *(f"{x:.2f}" for x in ratios[-1:]), sep="  ", flush=True)
    print(f"solved to 1e-8, of {len(files)}:", *solved)
    if ratios:
        print(f"ratio of times: median {statistics.median(ratios):.2f}")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--drystone", default="target/release/drystone", help="the program that makes the problems")
    parser.add_argument("--out", type=pathlib.Path, default=pathlib.Path("problems"))
    parser.add_argument("--only", default="", help="part of the names")
    parser.add_argument("--solve", nargs="+", metavar="PROGRAM", help="solve what --out holds, with one program or two")
    arguments = parser.parse_args()
    if arguments.solve:
        solve(arguments.solve, arguments.out, arguments.only)
    else:
        make(arguments.drystone, arguments.out, arguments.only)


main()
