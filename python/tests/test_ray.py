"""Surveys and fleets on a real Ray: a cluster of three nodes on this machine, workers that are killed, nodes that leave, a driver that is stopped.

DRYSTONE_RUNS is the number of runs of the survey (200).
"""

import json
import logging
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest

import drystone as ds

ray = pytest.importorskip("ray")
pytestmark = pytest.mark.ray

RUNS = [
    {"scene": "pile", "n": n, "seed": seed, "steps": 120}
    for seed in range(int(os.environ.get("DRYSTONE_RUNS", "200")) // 2)
    for n in (20, 27)
]
HERE = Path(__file__).resolve().parent
PATHS = os.pathsep.join([str(Path(ds.__file__).parents[1]), str(HERE)])


def pile(run: dict) -> dict:
    batch = ds.Batch(ds.Scene.find(run["scene"], n=run["n"], seed=run["seed"]), num_threads=1)
    batch.step(run["steps"])
    return {"hash": f"{batch.hash()[0]:016x}", "lowest": batch.position[0, :, 1].min()}


@pytest.fixture(scope="module")
def cluster():
    from ray.cluster_utils import Cluster

    os.environ["PYTHONPATH"] = PATHS
    memory = 80 * 2**20
    made = Cluster(
        initialize_head=True,
        head_node_args={"num_cpus": 0, "include_dashboard": False, "object_store_memory": memory},
    )
    nodes = [made.add_node(num_cpus=1, object_store_memory=memory) for _ in range(3)]
    ray.init(address=made.address, log_to_driver=False, logging_level=logging.ERROR)
    made.wait_for_nodes()
    yield made, nodes
    ray.shutdown()
    made.shutdown()


def when(path: Path, rows: int, act) -> threading.Thread:
    """Do something once so many rows are there."""

    def wait() -> None:
        deadline = time.monotonic() + 300
        while time.monotonic() < deadline:
            if path.exists() and path.read_bytes().count(b"\n") >= rows:
                return act()
            time.sleep(0.02)

    thread = threading.Thread(target=wait)
    thread.start()
    return thread


def a_worker() -> int:
    """The process of a worker of Ray that computes."""
    found = subprocess.run(["pgrep", "-f", "ray::_call"], capture_output=True, text=True).stdout.split()
    return int(found[0])


def test_a_survey_with_a_killed_worker_and_a_removed_node_has_the_bytes_of_one_process(cluster, tmp_path: Path) -> None:
    made, nodes = cluster
    alone, shared = tmp_path / "alone.jsonl", tmp_path / "shared.jsonl"
    ds.survey(pile, RUNS, out=alone, engine="here")
    done = []

    def kill() -> None:
        os.kill(a_worker(), signal.SIGKILL)
        done.append("killed a worker")

    def remove() -> None:
        made.remove_node(nodes.pop(), allow_graceful=False)
        done.append("removed a node")

    threads = [when(shared, len(RUNS) // 5, kill), when(shared, len(RUNS) // 2, remove)]
    begin = time.perf_counter()
    rows = ds.survey(pile, RUNS, out=shared, twice=0.05, chunk=5)
    seconds = time.perf_counter() - begin
    [thread.join() for thread in threads]
    workers = {who["machine"] for who in rows.who}
    print(f"{len(rows)} runs in {seconds:.1f} s by {len(workers)} workers; {', '.join(done)}")
    assert done == ["killed a worker", "removed a node"]
    assert shared.read_bytes() == alone.read_bytes() and len(workers) >= 3


def test_a_driver_that_is_stopped_goes_on(cluster, tmp_path: Path) -> None:
    made, _ = cluster
    path = tmp_path / "rows.jsonl"
    program = tmp_path / "main.py"
    program.write_text(
        "import sys, logging, ray, drystone as ds, test_ray as t\n"
        "ray.init(address=sys.argv[1], log_to_driver=False, logging_level=logging.ERROR)\n"
        f"ds.survey(t.pile, t.RUNS, out={str(path)!r}, chunk=2)\n"
    )
    command = [sys.executable, str(program), made.address]
    environment = {**os.environ, "PYTHONPATH": PATHS}
    driver = subprocess.Popen(command, env=environment, stderr=subprocess.DEVNULL)
    when(path, len(RUNS) // 4, driver.kill).join()
    driver.wait(60)
    lines = path.read_text().splitlines()
    assert len(RUNS) // 4 <= len(lines) < len(RUNS)
    path.write_text("\n".join(lines) + "\n" + lines[-1][:30])
    subprocess.run(command, env=environment, check=True, timeout=300, stderr=subprocess.DEVNULL)
    rows = [json.loads(line) for line in path.read_text().splitlines()]
    assert rows == list(ds.survey(pile, RUNS, engine="here", twice=0))


def test_a_fleet_whose_actor_dies_has_the_hashes_of_one_batch(cluster) -> None:
    scene = ds.Scene.find("drawbridge")
    rng = np.random.default_rng(1)
    inputs = [rng.uniform(-0.5, 0.5, (7, 10, 2)).astype(np.float32) for _ in range(9)]
    batch, fleet = ds.Batch(scene, 7), fleet_of(scene)
    for k, ctrl in enumerate(inputs):
        one, many = batch.rollout(10, ctrl, every=5), fleet.rollout(10, ctrl, every=5)
        assert np.array_equal(one["position"], many["position"], equal_nan=True), k
        if k in (2, 4, 7):
            # Before the first bytes were kept, and after that.
            actor = fleet._shares[k % 2].actor
            pid = ray.get(actor.__ray_call__.remote(lambda self: os.getpid()))
            os.kill(pid, signal.SIGKILL)
        if k == 5:
            batch.reset([1, 6]), fleet.reset([1, 6])
    assert (batch.hash() == fleet.hash()).all() and fleet.rebuilt >= 3
    assert np.array_equal(batch.measure("overlap_max")["overlap_max"], fleet.measure("overlap_max")["overlap_max"])
    assert fleet.save() == batch.save()
    assert repr(fleet) == "<Fleet of 7 worlds on 2 actors>" and len(fleet) == 7
    with pytest.raises(ValueError, match="^record = 'positon': did you mean 'position'\\?$"):
        fleet.rollout(1, record=["positon"])
    with pytest.raises(ValueError, match="ctrl has shape"):
        fleet.rollout(1, np.zeros((3, 1, 2)))
    # Where some worlds fail the others go on, also of an actor that dies afterwards.
    bad = np.zeros((7, 1, 2), np.float32)
    bad[[2, 5]] = 1e30
    for worlds in (batch, fleet):
        with pytest.raises(ds.WorldError, match=r"^world 2: [^\n]* \(and 1 more\)$") as caught:
            worlds.rollout(5, bad)
        # Numbers of the fleet, not of the actor.
        assert caught.value.worlds.tolist() == [2, 5] and len(caught.value.records["position"]) == 7
    pid = ray.get(fleet._shares[0].actor.__ray_call__.remote(lambda self: os.getpid()))
    os.kill(pid, signal.SIGKILL)
    assert (batch.hash() == fleet.hash()).all()
    fleet.close()


def fleet_of(scene: ds.Scene):
    from drystone.ray import Fleet

    return Fleet(scene, 7, worlds_per_actor=4, keep_every=3)
