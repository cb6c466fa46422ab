"""Worlds x steps a second of drystone and of MuJoCo, and the errors of both, in one interleaved run.

    pip install mujoco; python benches/speed.py [--quick] [--json FILE]

Each scene is built for both of the same bodies, masses, joints and motors. MuJoCo runs `mujoco.rollout` with the implicit integrator that it advises for motors, else at its defaults. Rounds of both follow each
other, and the best of all rounds counts. Errors are those of one world over ten seconds: the deepest overlap of the second half, the largest gap
of a joint, and for what swings the drift of energy over its range.
"""

import argparse
import json
import time
from dataclasses import dataclass

import mujoco
import mujoco.rollout
import numpy as np

import drystone as ds

ROUNDS = 5
SECONDS = 0.4


@dataclass
class Case:
    """A scene for both: bodies with shapes, and joints to a parent."""

    name: str
    worlds: int
    bodies: list[dict]
    joints: list[dict]
    floor: bool = True
    fixed: tuple[dict, ...] = ()
    energy: bool = False

    def drystone(self, dt: float) -> ds.Scene:
        world = ds.World()
        if self.floor:
            world.add(ds.Body.fixed("floor").half_space().friction(0.5))
        for wall in self.fixed:
            world.add(shaped(ds.Body.fixed(wall["name"]), wall).at(*wall["at"]).friction(0.5))
        for body in self.bodies:
            own = shaped(ds.Body.dynamic(body["name"]), body).at(*body["at"]).mass(body["mass"]).friction(0.5)
            # The parts of one machine meet the floor and not each other.
            world.add(own.groups(2, 1) if self.joints else own)
        for joint in self.joints:
            own = ds.Joint(joint["body"], joint.get("parent")).at(*joint["at"])
            own = own.slider(joint["axis"]) if joint["type"] == "slide" else own.hinge(joint["axis"])
            world.join(own.motor(0, joint["load"]) if "load" in joint else own)
        return ds.Scene.from_world(world, dt=dt, name=self.name)

    def mujoco(self, dt: float) -> mujoco.MjModel:
        children: dict[str | None, list[dict]] = {}
        joint_of = {joint["body"]: joint for joint in self.joints}
        for body in self.bodies:
            children.setdefault(joint_of.get(body["name"], {}).get("parent"), []).append(body)

        def element(body: dict, at: np.ndarray) -> str:
            joint = joint_of.get(body["name"])
            place = np.array(body["at"]) - at
            inner = '<freejoint/>' if joint is None else joint_xml(joint, np.array(joint["at"]) - np.array(body["at"]))
            inner += geom(body, mass=body["mass"], meets=(2, 1) if self.joints else (1, 1))
            inner += "".join(element(child, np.array(body["at"])) for child in children.get(body["name"], []))
            return f'<body name="{body["name"]}" pos="{vector(place)}">{inner}</body>'

        still = '<geom type="plane" size="0 0 1" quat="0.70710678 -0.70710678 0 0" friction="0.5"/>' if self.floor else ""
        still += "".join(geom(wall, pos=wall["at"], meets=(1, 1)) for wall in self.fixed)
        moving = "".join(element(body, np.zeros(3)) for body in children.get(None, []))
        motors = "".join(
            f'<velocity joint="{joint["body"]}" kv="20" forcerange="-{joint["load"]} {joint["load"]}" forcelimited="true"/>'
            for joint in self.joints
            if "load" in joint
        )
        return mujoco.MjModel.from_xml_string(
            f'<mujoco><option timestep="{dt}" gravity="0 -9.81 0" integrator="implicitfast"><flag energy="enable"/></option>'
            f"<worldbody>{still}{moving}</worldbody><actuator>{motors}</actuator></mujoco>"
        )


def vector(numbers) -> str:
    return " ".join(f"{x:.9g}" for x in numbers)


def shaped(body: ds.Body, of: dict) -> ds.Body:
    if "box" in of:
        return body.cuboid(*of["box"])
    return body.ball(of["ball"]) if "ball" in of else body.capsule(*of["capsule"])


def geom(of: dict, meets: tuple[int, int], mass: float | None = None, pos=(0, 0, 0)) -> str:
    if "box" in of:
        kind = f'type="box" size="{vector(of["box"])}"'
    elif "ball" in of:
        kind = f'type="sphere" size="{of["ball"]}"'
    else:
        # Along z there, along y here.
        half, radius = of["capsule"]
        kind = f'type="capsule" size="{radius} {half}" quat="0.70710678 -0.70710678 0 0"'
    weight = "" if mass is None else f' mass="{mass}"'
    groups = f' contype="{meets[0]}" conaffinity="{meets[1]}"'
    return f'<geom {kind}{weight}{groups} pos="{vector(pos)}" friction="0.5"/>'


def joint_xml(joint: dict, place: np.ndarray) -> str:
    name = joint["body"]
    return f'<joint name="{name}" type="{joint["type"]}" axis="{vector(joint["axis"])}" pos="{vector(place)}"/>'


def tower() -> Case:
    boxes = [{"name": f"b{k}", "box": (0.5, 0.5, 0.5), "at": (0, 0.5 + k, 0), "mass": 1000} for k in range(10)]
    return Case("64 towers of 10 boxes", 64, boxes, [])


def pendulum() -> Case:
    bob = {"name": "bob", "ball": 0.1, "at": (1, 0, 0), "mass": 4.19}
    pivot = {"body": "bob", "type": "hinge", "axis": (0, 0, 1), "at": (0, 0, 0)}
    return Case("1024 pendulums", 1024, [bob], [pivot], floor=False, energy=True)


def cart() -> Case:
    bodies = [
        {"name": "cart", "box": (0.25, 0.1, 0.15), "at": (0, 0, 0), "mass": 1},
        {"name": "pole", "box": (0.03, 0.5, 0.03), "at": (0.5, 0, 0), "mass": 0.1},
    ]
    # The pole lies beside the cart and swings down.
    bodies[1]["box"] = (0.5, 0.03, 0.03)
    joints = [
        {"body": "cart", "type": "slide", "axis": (1, 0, 0), "at": (0, 0, 0)},
        {"body": "pole", "parent": "cart", "type": "hinge", "axis": (0, 0, 1), "at": (0, 0, 0)},
    ]
    return Case("1024 carts with a pole", 1024, bodies, joints, floor=False, energy=True)


def robot() -> Case:
    bodies = [{"name": "torso", "box": (0.3, 0.06, 0.15), "at": (0, 0.55, 0), "mass": 10}]
    joints = []
    for leg, (x, z) in enumerate(((1, 1), (1, -1), (-1, 1), (-1, -1))):
        at = np.array([0.28 * x, 0.5, 0.18 * z])
        parent = "torso"
        for part, (axis, half, mass) in enumerate((((1, 0, 0), 0.03, 0.6), ((0, 0, 1), 0.1, 1.0), ((0, 0, 1), 0.1, 0.5))):
            name = f"l{leg}{part}"
            joints.append(
                {"body": name, "parent": parent, "type": "hinge", "axis": axis, "at": tuple(at), "load": 40}
            )
            bodies.append({"name": name, "capsule": (half, 0.025), "at": tuple(at - (0, half, 0)), "mass": mass})
            at, parent = at - (0, 2 * half, 0), name
    return Case("256 robots of 13 bodies, 12 motors", 256, bodies, joints)


def tray() -> Case:
    rng = np.random.default_rng(3)
    walls = tuple(
        {"name": f"w{k}", "box": box, "at": at}
        for k, (box, at) in enumerate(
            [((0.05, 0.5, 1), (1, 0.5, 0)), ((0.05, 0.5, 1), (-1, 0.5, 0)), ((1, 0.5, 0.05), (0, 0.5, 1)), ((1, 0.5, 0.05), (0, 0.5, -1))]
        )
    )
    kinds = [("box", (0.15, 0.1, 0.12)), ("ball", 0.13), ("capsule", (0.12, 0.08))]
    bodies = []
    for k in range(20):
        kind, size = kinds[k % 3]
        x, z = 0.45 * (k % 2) - 0.2, 0.45 * (k // 2 % 2) - 0.2
        at = np.array([x, 0.3 + 0.35 * (k // 4), z]) + rng.uniform(-0.03, 0.03, 3)
        bodies.append({"name": f"s{k}", kind: size, "at": tuple(at), "mass": float(rng.uniform(1, 10))})
    return Case("64 trays with 20 shapes", 64, bodies, [], fixed=walls)


class Drystone:
    def __init__(self, case: Case, dt: float, threads: int, config: ds.Config) -> None:
        self.batch = ds.Batch(case.drystone(dt), case.worlds, num_threads=threads, config=config)

    def run(self, steps: int) -> None:
        self.batch.rollout(steps, record=(), every=steps)


class Mujoco:
    def __init__(self, case: Case, dt: float, threads: int) -> None:
        self.model = case.mujoco(dt)
        self.data = [mujoco.MjData(self.model) for _ in range(threads)]
        self.pool = mujoco.rollout.Rollout(nthread=threads if threads > 1 else 0)
        size = mujoco.mj_stateSize(self.model, mujoco.mjtState.mjSTATE_FULLPHYSICS)
        first = np.zeros(size)
        mujoco.mj_getState(self.model, self.data[0], first, mujoco.mjtState.mjSTATE_FULLPHYSICS)
        self.state = np.tile(first, (case.worlds, 1))

    def run(self, steps: int) -> None:
        states, _ = self.pool.rollout(self.model, self.data, self.state, nstep=steps)
        self.state = np.ascontiguousarray(states[:, -1])


def rates(case: Case, dt: float, threads: int, config: ds.Config) -> tuple[float, float]:
    """Worlds x steps a second of both: the best of rounds that follow each other."""
    engines = [Drystone(case, dt, threads, config), Mujoco(case, dt, threads)]
    best, steps = [0.0, 0.0], [20, 20]
    for round_ in range(ROUNDS + 1):
        for k, engine in enumerate(engines):
            begin = time.perf_counter()
            engine.run(steps[k])
            seconds = time.perf_counter() - begin
            if round_:
                best[k] = max(best[k], case.worlds * steps[k] / seconds)
            else:
                steps[k] = max(2, min(2000, int(steps[k] * SECONDS / seconds)))
    return best[0], best[1]


def errors(case: Case, dt: float, config: ds.Config) -> tuple[dict, dict]:
    """Errors of both over ten seconds."""
    steps = round(10 / dt)
    batch = ds.Batch(case.drystone(dt), config=config)
    names = ("overlap_max", "joint_gap", "kinetic_energy", "potential_energy")
    out = batch.rollout(steps, record=names)
    own = summary(case, out["overlap_max"][0], out["joint_gap"][0].max(), (out["kinetic_energy"] + out["potential_energy"])[0])
    model = case.mujoco(dt)
    data = mujoco.MjData(model)
    overlap, energy = np.zeros(steps), np.zeros(steps)
    for step in range(steps):
        mujoco.mj_step(model, data)
        overlap[step] = max(0.0, -min(data.contact.dist, default=0.0))
        # Where the step ends, and not where it began.
        mujoco.mj_forward(model, data)
        energy[step] = data.energy.sum()
    return own, summary(case, overlap, 0.0, energy)


def summary(case: Case, overlap: np.ndarray, gap: float, energy: np.ndarray) -> dict:
    result = {"overlap_mm": 1e3 * float(overlap[len(overlap) // 2 :].max()), "joint_gap_mm": 1e3 * float(gap)}
    if case.energy:
        mass, length = case.bodies[-1]["mass"], 1.0 if case.name.endswith("pendulums") else 0.5
        result["energy_drift"] = float((energy[-1] - energy[0]) / (mass * 9.81 * length))
    return result


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="one thread and 1/60 s alone")
    parser.add_argument("--json", help="file for the rows")
    options = parser.parse_args()
    config = ds.Config(sleep=False)
    rows = []
    print("| scene | step | threads | drystone /s | MuJoCo /s | ratio | drystone errors | MuJoCo errors |")
    print("|---|---|--:|--:|--:|--:|---|---|")
    for case in (tower(), pendulum(), cart(), robot(), tray()):
        for rate in (60,) if options.quick else (60, 500):
            of = errors(case, 1 / rate, config)
            for threads in (1,) if options.quick else (1, 2):
                own, other = rates(case, 1 / rate, threads, config)
                words = [", ".join(f"{name} {value:.3g}" for name, value in e.items()) for e in of]
                print(f"| {case.name} | 1/{rate} s | {threads} | {own:,.0f} | {other:,.0f} | {own / other:.2f} | {words[0]} | {words[1]} |", flush=True)
                rows.append({"scene": case.name, "rate": rate, "threads": threads, "drystone": own, "mujoco": other, "errors": of})
    if options.json:
        with open(options.json, "w") as file:
            json.dump(rows, file, indent=1)


if __name__ == "__main__":
    main()
