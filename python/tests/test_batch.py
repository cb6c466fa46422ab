"""Batches: bits, states, arrays, errors, threads, forks, signals."""

import gc
import multiprocessing
import os
import pickle
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pytest

import drystone as ds
from drystone._batch import MEASURES

SCENES = [("tower", {"n": 5}), ("pile", {"n": 27}), ("bridge", {"planks": 6, "boxes": 2}), ("drawbridge", {})]


def moving(batch: ds.Batch) -> int:
    """A body that can be pushed."""
    return int(np.flatnonzero(batch.exists[0])[-1])


def drive(batch: ds.Batch, steps: int, worlds: list[int] | None = None) -> None:
    """Push the last body of each world by a force of its own."""
    for world in range(batch.num_worlds) if worlds is None else worlds:
        batch.force[world, moving(batch)] = (100 * (world + 1), 50, 0)
    batch.step(steps, worlds=worlds)


@pytest.mark.parametrize(("name", "parameters"), SCENES)
def test_bits_do_not_depend_on_neighbours_threads_or_calls(name: str, parameters: dict) -> None:
    scene = ds.Scene.find(name, **parameters)
    alone = ds.Batch(scene, 1, num_threads=1)
    drive(alone, 60)
    for worlds, threads in [(1, 2), (5, 1), (5, 2), (8, 3)]:
        batch = ds.Batch(scene, worlds, num_threads=threads)
        drive(batch, 25)
        batch.step(35)
        assert batch.hash()[0] == alone.hash()[0], (worlds, threads)
        assert len(set(batch.hash().tolist())) == worlds
        assert np.array_equal(batch.position[0], alone.position[0], equal_nan=True)


def test_the_hash_is_that_of_the_command() -> None:
    command = [sys.executable, "-c", "from drystone._command import main; main()", "run", "pile", "-p", "n=27"]
    out = subprocess.run([*command, "--steps", "50"], capture_output=True, text=True, check=True).stdout
    printed = next(line.split()[1] for line in out.splitlines() if line.split()[:1] == ["hash"])
    batch = ds.Batch(ds.Scene.find("pile", n=27), 3)
    batch.step(50)
    assert {f"{h:016x}" for h in batch.hash()} == {printed}
    wrong = subprocess.run([*command, "--steps", "-1"], capture_output=True, text=True)
    assert wrong.returncode == 2 and "--steps" in wrong.stderr


@pytest.mark.parametrize(("name", "parameters"), SCENES)
def test_reset_restore_save_and_load_are_exact(name: str, parameters: dict) -> None:
    scene = ds.Scene.find(name, **parameters)
    batch, fresh = ds.Batch(scene, 4), ds.Batch(scene, 4)
    start = batch.hash()
    drive(batch, 37)
    before = batch.hash()
    batch.reset(np.array([False, True, False, True]))
    assert (batch.hash()[[1, 3]] == start[[1, 3]]).all() and (batch.hash()[[0, 2]] == before[[0, 2]]).all()
    assert batch.steps.tolist() == [37, 0, 37, 0] and batch.time[1] == 0
    drive(batch, 60, [1])
    drive(fresh, 60, [1])
    assert batch.hash()[1] == fresh.hash()[1] and batch.hash()[0] == before[0]
    # One state into others, and as bytes into another batch.
    states = pickle.loads(pickle.dumps(batch.snapshot([1, 2])))
    batch.restore(states, [0, 3], source=[1, 0])
    assert batch.hash().tolist() == [states.hash[1], states.hash[0], states.hash[1], states.hash[0]]
    assert batch.steps.tolist() == [37, 60, 37, 60] and states.steps.tolist() == [60, 37]
    loaded = ds.Batch.load(batch.save([1]))
    batch.step(30), loaded.step(30)
    assert (batch.hash()[[1, 3]] == loaded.hash()[0]).all()
    loaded.reset()
    assert loaded.hash()[0] == states.hash[0] and loaded.steps[0] == 60


def test_views_outlive_the_batch_and_cannot_be_written() -> None:
    batch = ds.Batch(ds.Scene.find("pile", n=27), 3)
    position, again = batch.position, batch.position
    assert position is again and position.flags.c_contiguous and position.dtype == np.float32
    copy = position.copy()
    batch.step(30)
    assert not np.array_equal(position, copy, equal_nan=True), "a view shows what the last call left"
    with pytest.raises(ValueError):
        position[0, 0, 0] = 1
    last = position.copy()
    del batch
    gc.collect()
    filler = [np.ones_like(last) for _ in range(50)]
    assert np.array_equal(position, last, equal_nan=True) and len(filler) == 50


def test_worlds_of_several_sizes_and_settings() -> None:
    scenes = [ds.Scene.find("tower", n=n) for n in (2, 5, 3)]
    batch = ds.Batch(scenes, config=[ds.Config("fast"), ds.Config("accurate"), ds.Config(sleep=False)])
    batch.step(20)
    assert batch.exists.sum(axis=1).tolist() == [3, 6, 4]
    assert np.isnan(batch.position[0, 3:]).all() and np.isfinite(batch.position[1]).all()
    assert [int(batch.substeps[k, 1]) for k in range(3)] == [4, 32, 8] and batch.substeps[0, 5] == 0
    alone = ds.Batch(scenes[2], config=ds.Config(sleep=False))
    alone.step(20)
    assert batch.hash()[2] == alone.hash()[0]


def test_arrays_of_worlds_of_several_sizes_can_be_written_back() -> None:
    scenes = [ds.Scene.find("tower", n=2), ds.Scene.find("drawbridge"), ds.Scene.find("tower", n=4)]
    batch = ds.Batch(scenes)
    batch.step(5)
    before = batch.hash()
    batch.set_state(position=batch.position, rotation=batch.rotation, linear_velocity=batch.linear_velocity)
    batch.set_material(friction=batch.friction, mass_scale=batch.mass_scale)
    batch.force, batch.ctrl = batch.force + 0, batch.ctrl * 1
    batch.apply_impulse(batch.position * 0)
    assert (batch.hash() == before).all() and np.isnan(batch.ctrl[0]).all()
    batch.step(5)
    same = ds.Batch(scenes)
    same.step(10)
    assert (batch.hash() == same.hash()).all()
    wrong = batch.position.copy()
    wrong[0, 1, 1] = np.nan
    with pytest.raises(ValueError, match=r"^position\[0, 1, 1\] = nan: must be finite$"):
        batch.set_state(position=wrong)
    with pytest.raises(ValueError, match=r"^ctrl\[1, 1\] = nan: must be finite$"):
        batch.ctrl = [[np.nan] * 2, [0, np.nan], [np.nan] * 2]


def test_a_rollout_records_what_steps_give() -> None:
    scene = ds.Scene.find("drawbridge")
    ctrl = np.random.default_rng(0).uniform(-0.5, 0.5, (3, 24, 2)).astype(np.float32)
    names = ("position", "joint_position", "kinetic_energy", "ctrl", "hash", "friction")
    out = ds.Batch(scene, 3, num_threads=2).rollout(24, ctrl, every=6, record=names)
    batch = ds.Batch(scene, 3, num_threads=1)
    for step in range(24):
        batch.ctrl = ctrl[:, step]
        batch.step()
        if step % 6 == 5:
            row = step // 6
            assert np.array_equal(out["hash"][:, row], batch.hash())
            assert np.array_equal(out["position"][:, row], batch.position, equal_nan=True)
            assert np.array_equal(out["joint_position"][:, row], batch.joint_position, equal_nan=True)
            assert np.array_equal(out["kinetic_energy"][:, row], batch.measure("kinetic_energy")["kinetic_energy"])
            assert np.array_equal(out["ctrl"][:, row], ctrl[:, step])
    assert len(set(out["hash"][:, -1].tolist())) == 3
    assert out["friction"].shape == (3, 4, batch.num_bodies)


def test_a_rollout_until_stops_each_world_where_it_says() -> None:
    scene = ds.Scene.find("drawbridge")
    ctrl = np.random.default_rng(1).uniform(-0.5, 0.5, (3, 24, 2)).astype(np.float32)
    names = ("position", "joint_gap", "hash")
    whole, never, some = ds.Batch(scene, 3), ds.Batch(scene, 3), ds.Batch(scene, 4)
    expected = whole.rollout(24, ctrl, every=5, record=names)
    found = never.rollout(24, ctrl, every=5, record=names, until=lambda batch: np.zeros(3, bool))
    assert all(np.array_equal(expected[name], found[name], equal_nan=True) for name in names)
    assert (whole.hash() == never.hash()).all() and np.array_equal(whole.ctrl, never.ctrl)
    # World 1 is not in the call, and the others stop after 10, 24 and 15 steps.
    start = some.hash()[1]
    out = some.rollout(
        24, ctrl, every=5, record=names, worlds=[0, 2, 3], until=lambda batch: batch.steps >= [10, 0, 99, 15]
    )
    assert some.steps.tolist() == [10, 0, 24, 15] and some.hash()[1] == start
    for row, reached in enumerate((2, 4, 3)):
        assert np.array_equal(out["hash"][row, :reached], expected["hash"][row, :reached])
        assert not out["hash"][row, reached:].any() and np.isnan(out["joint_gap"][row, reached:]).all()
        assert np.array_equal(out["position"][row, :reached], expected["position"][row, :reached], equal_nan=True)
        assert np.isnan(out["position"][row, reached:]).all()
    # Inputs that `until` writes act from the next steps on; a world that fails stops alone.
    batch = ds.Batch(ds.Scene.find("tower", n=2), 3)

    def push(batch: ds.Batch) -> np.ndarray:
        batch.force[1, 2] = (np.nan, 0, 0)
        return batch.steps >= 8

    with pytest.raises(ds.WorldError, match="^world 1: body 2 .*force") as caught:
        batch.rollout(20, every=4, until=push)
    assert batch.steps.tolist() == [8, 4, 8]
    assert np.isfinite(caught.value.records["position"][:, :, 0, 0]).sum(axis=1).tolist() == [2, 1, 2]


def test_a_rollout_fills_arrays_of_the_caller() -> None:
    scene = ds.Scene.find("tower", n=2)
    one, two = ds.Batch(scene, 2), ds.Batch(scene, 2)
    names = ["position", "kinetic_energy", "hash"]
    expected = one.rollout(6, every=2, record=names)
    mine = {"position": np.zeros((2, 3, 3, 3), np.float32), "hash": np.ones((2, 3), np.uint64)}
    found = two.rollout(6, every=2, record=names, out=mine)
    assert found["position"] is mine["position"] and found["hash"] is mine["hash"]
    assert all(np.array_equal(expected[name], found[name], equal_nan=True) for name in names)


def test_a_reset_keeps_what_a_batch_listens_to() -> None:
    scene = ds.Scene.find("tower", n=2)
    config = ds.Config(sleep=False)
    batch, deaf = ds.Batch(scene, 2, config=config, listen=["contacts", "impulses"]), ds.Batch(scene, 2, config=config)
    assert (batch.hash() == deaf.hash()).all() and batch.steps.tolist() == [0, 0]
    seen = []
    for _ in range(3):
        batch.step()
        seen.append((batch.events().tolist(), batch.contact_impulse.tolist(), batch.hash().tolist()))
        batch.step(30)
        batch.reset()
    assert seen[0] == seen[1] == seen[2] and len(seen[0][0]) == 4 and abs(np.array(seen[0][1])).max() > 10
    deaf.step()
    assert seen[0][2] == deaf.hash().tolist(), "to listen changes no bit"
    batch.reset([1])
    batch.set_material(worlds=[0], mass_scale=[[1, 1, 2]])
    assert batch.mass_scale.tolist() == [[1, 1, 2], [1, 1, 1]]
    # Loaded worlds listen as their states do, or as asked.
    batch.step(9), deaf.step(9)
    for states, listen, is_heard in [(batch, None, True), (deaf, None, False), (deaf, ("impulses",), True)]:
        loaded = ds.Batch.load(states.save(), listen=listen)
        for _ in range(2):
            loaded.step(5)
            assert (abs(loaded.contact_impulse).max() > 10) == is_heard
            loaded.reset()


def test_contact_impulses_of_bodies_are_sums_of_contacts() -> None:
    scenes = [ds.Scene.find("tower", n=2), ds.Scene.find("pile", n=8)]
    batch = ds.Batch(scenes, config=ds.Config(sleep=False), listen=["impulses"])
    batch.step(90)
    contacts, sums = batch.contacts(), np.zeros((2, batch.num_bodies, 3))
    for world in range(2):
        own = contacts.of(world)
        for (a, b), impulse in zip(own.bodies, own.impulse, strict=True):
            sums[world, a] -= impulse
            sums[world, b] += impulse
    sums[~batch.exists] = np.nan
    assert batch.contact_impulse.dtype == np.float32
    assert np.allclose(batch.contact_impulse, sums, rtol=1e-5, atol=1e-3, equal_nan=True)
    assert np.allclose(60 * batch.contact_impulse[0, 1:3], [0, 9810, 0], atol=100)
    with pytest.raises(ValueError, match="^contact_impulse: the batch does not listen to 'impulses'$"):
        _ = ds.Batch(scenes[0]).contact_impulse


def test_objects_are_shown_in_one_short_line() -> None:
    world = ds.World()
    ball = world.add(ds.Body.dynamic("bob").ball(0.1).at(1, 0, 0))
    world.join(ds.Joint(ball).hinge((0, 0, 1)).at(0, 0, 0))
    batch = ds.Batch(ds.Scene.find("tower", n=2), 3, num_threads=1)
    batch.step()
    rows = ds.Rows(({"key": "a", "n": 1},) * 500)
    shown = {
        "<World: 1 bodies, 1 joints>": world,
        "<Body 'bob', dynamic: ball>": ds.Body.dynamic("bob").ball(0.1),
        "<Body, fixed: no shapes>": ds.Body.fixed(),
        "<Joint hinge: bob - world>": ds.Joint("bob").hinge((0, 0, 1)),
        "<Scene scene: 1 bodies, 1 joints>": ds.Scene.from_world(world),
        "<Batch of 3 worlds, up to 3 bodies each, on 1 threads>": batch,
        "<Snapshots of 2 worlds>": batch.snapshot([0, 2]),
        "<Contacts of 3 worlds: 6 contacts, 24 points>": batch.contacts(),
        "<Hits of 2 rays in 3 worlds: 3 hits>": batch.ray([[0, 9, 0], [0, 9, 0]], [[0, -1, 0], [0, 1, 0]]),
        "<Rows: 500 rows of 2 columns>": rows,
        "<Stability: 0 worlds of 0 families under 0 settings>": ds.Stability(ds.Rows(())),
        "Config(substeps=4)": ds.Config("fast"),
    }
    assert {repr(value): value for value in shown.values()} == shown


def test_a_world_that_fails_stops_alone_as_it_was() -> None:
    batch = ds.Batch(ds.Scene.find("tower", n=3), 4, num_threads=2)
    batch.step(10)
    before = batch.hash()
    batch.force[2, 1] = (np.nan, 0, 0)
    with pytest.raises(ds.WorldError, match=r'^world 2: body 1 .*force') as caught:
        batch.step(20)
    again = pickle.loads(pickle.dumps(caught.value))
    assert again.worlds.tolist() == [2] and again.messages == caught.value.messages and str(again) == str(caught.value)
    assert batch.steps.tolist() == [30, 30, 10, 30] and batch.hash()[2] == before[2]
    batch.force[2, 1] = 0
    batch.step(20, worlds=[2])
    assert batch.hash()[2] == batch.hash()[0]
    # Within a rollout: numbers before the failing step are there, and none after it.
    ctrl = np.zeros((2, 1, 2))
    bridge = ds.Batch(ds.Scene.find("drawbridge"), 2)
    bridge.gravity[1] = (0, -1e30, 0)
    with pytest.raises(ds.WorldError, match="world 1: .*gravity") as caught:
        bridge.rollout(4, ctrl)
    record = caught.value.records["position"]
    assert np.isfinite(record[0]).all() and np.isnan(record[1]).all()


BATCH = ds.Batch(ds.Scene.find("drawbridge"), 8)
B, U = BATCH.num_bodies, BATCH.num_actuators


def roll(array: object, name: str = "position", record: str = "position") -> dict[str, np.ndarray]:
    """A rollout of two steps into an array."""
    return BATCH.rollout(2, record=record, out={name: array})


def body(**keys: object) -> ds.Scene:
    """A scene of one ball with further keys."""
    world = ds.World()
    world.add(ds.Body.dynamic("a").ball(1).set(**keys))
    return ds.Scene.from_world(world)


FLOATS = np.zeros((8, 2, B, 3), np.float32)
READ_ONLY = FLOATS.copy()
READ_ONLY.flags.writeable = False


@pytest.mark.parametrize(
    ("call", "line"),
    [
        (lambda: BATCH.apply_impulse(np.zeros((8, 2))), f"impulse has shape (8, 2): must be (8, {B}, 3)"),
        (lambda: BATCH.apply_impulse(np.full((8, B, 3), np.nan)), "impulse[0, 0, 0] = nan: must be finite"),
        (lambda: BATCH.apply_impulse(np.full((8, B, 3), 1e300)), "impulse[0, 0, 0] = 1e+300: must be finite"),
        (lambda: BATCH.apply_impulse([["a"]]), "impulse has dtype <U1: must be numbers"),
        (lambda: BATCH.apply_impulse([[1], [1, 2]]), f"impulse has rows of several lengths: must have shape (8, {B}, 3)"),
        (lambda: BATCH.step(-1), "n = -1: must be 0 or more"),
        (lambda: BATCH.step(1.5), "n = 1.5: must be a whole number"),
        (lambda: BATCH.step(dt=2), "dt = 2.0: must be 1e-9 to 1 s"),
        (lambda: BATCH.step(worlds=np.ones(5, bool)), "worlds is a mask of shape (5,): must be (8,)"),
        (lambda: BATCH.step(worlds=[3, 8]), "worlds has 8: must be 0 to 7"),
        (lambda: BATCH.step(worlds=[3, 1]), "worlds = [3, 1]: must ascend"),
        (lambda: BATCH.step(worlds=[0.5]), "worlds has dtype float64: must be a mask of bools or whole numbers"),
        (lambda: BATCH.rollout(4, np.zeros((8, 3, U))), f"ctrl has shape (8, 3, {U}): must be (8 or 1, 4 or 1, {U})"),
        (lambda: BATCH.rollout(4, record=["positon"]), "record = 'positon': did you mean 'position'?"),
        (lambda: BATCH.rollout(4, every=0), "every = 0: must be 1 or more"),
        (lambda: BATCH.measure("overlap"), "name = 'overlap': did you mean 'overlap_95'?"),
        (lambda: BATCH.set_state(position=np.zeros((8, 1, 3))), f"position has shape (8, 1, 3): must be (8, {B}, 3)"),
        (lambda: BATCH.restore(BATCH.snapshot([0, 1])), "snapshots has 2 states: must be 1 or 8"),
        (lambda: BATCH.restore(b"", [0]), "snapshots is bytes: must be Snapshots; Snapshots.from_bytes makes them of bytes"),
        (lambda: BATCH.ray([[0, 0, 0]], [[0, 0, 0]]), "direction[0] = [0.0, 0.0, 0.0]: must have a length"),
        (lambda: BATCH.ray([[0, 0, 0]], [[0, 1, 0]], -1), "max_distance = -1.0: must be 0 or more"),
        (lambda: BATCH.set_state(worlds=[1], bodies=[1], rotation=[[[0, 0, 0, 2]]]), "rotation[0, 0] = [0.0, 0.0, 0.0, 2.0]: must have unit length"),
        (lambda: BATCH.set_material(worlds=[1], bodies=[1], friction=[[-1]]), "friction[0, 0] = -1.0: must be 0 or more"),
        (lambda: BATCH.set_material(worlds=[1], bodies=[1], restitution=[[2]]), "restitution[0, 0] = 2.0: must be 0 to 1"),
        (lambda: BATCH.ray([[0, 0]], [[0, 0]]), "origin has shape (1, 2): must be (any, 3)"),
        (lambda: ds.Batch.load([b"drystone"]), "a saved world of a batch cannot be loaded: cut short"),
        (lambda: ds.Batch.load([BATCH.save()[0][:-1]]), None),
        (lambda: ds.Batch(ds.Scene.find("tower"), num_threads=1025), "num_threads = 1025: must be at most 1024"),
        (lambda: ds.Batch("tower"), "scene is str: must be Scene or a list of Scene"),
        (lambda: ds.Batch([]), "scene is empty: must have at least one Scene"),
        (lambda: ds.Batch(ds.Scene.find("tower"), 0), "num_worlds = 0: must be 1 or more"),
        (lambda: ds.Batch(ds.Scene.find("tower"), 2, listen=["contact"]), "listen = 'contact': did you mean 'contacts'?"),
        (lambda: ds.Scene.find("tower", m=3), None),
        (lambda: ds.Scene.find("tower", n=0), None),
        (lambda: ds.Scene.find("tower", n="many"), "n = 'many': must be a number"),
        (lambda: ds.Scene.from_dict({"version": 1, "bodies": [{"kind": "stone"}]}), None),
        (lambda: ds.Config("quick"), None),
        (lambda: ds.Config(substeps=0), "substeps = 0: must be 1 to 4096"),
        (lambda: roll(FLOATS[:, :1]), f"out['position'] has shape (8, 1, {B}, 3): must be (8, 2, {B}, 3)"),
        (lambda: roll(np.zeros((8, 2, B, 3))), "out['position'] has dtype float64: must be float32"),
        (lambda: roll(np.zeros((8, 2), np.int64), "hash", "hash"), "out['hash'] has dtype int64: must be uint64"),
        (lambda: roll(np.asfortranarray(FLOATS)), "out['position'] is not contiguous: must be in C order"),
        (lambda: roll(READ_ONLY), "out['position'] is read-only: must be writable"),
        (lambda: roll([1.0]), "out['position'] is list: must be ndarray"),
        (lambda: roll(FLOATS, "positon"), "out = 'positon': did you mean 'position'?"),
        (lambda: BATCH.rollout(1, record="gravity", out={"gravity": BATCH.gravity[:, None]}), "out['gravity'] shares memory with gravity: must have memory of its own"),
        (lambda: BATCH.rollout(1, out=[1]), "out is list: must be a dict of arrays"),
        (lambda: BATCH.rollout(1, until=True), "until is bool: must be a function of a batch"),
        (lambda: BATCH.rollout(1, record=5), "record = 5: must be a word or a list of words"),
        (lambda: BATCH.step(10**30), f"n = {10**30}: must be at most 2^63 - 1"),
        (lambda: BATCH.step(worlds=[[1], [1, 2]]), "worlds has rows of several lengths: must have one axis"),
        (lambda: BATCH.step(dt=1j), "dt = 1j: must be a number"),
        (lambda: BATCH.contacts().of(1.5), "k = 1.5: must be a whole number"),
        (lambda: ds.Batch.load(5), "states is int: must be a list of bytes, one for each world"),
        (lambda: ds.Batch.load(["a"]), "states[0] is str: must be bytes"),
        (lambda: ds.Scene.find(3), "name is int: must be str"),
        (lambda: ds.Scene.load(3), "path is int: must be a path"),
        (lambda: ds.Scene.from_dict(3), "data is int: must be a dict"),
        (lambda: ds.Scene.from_world({}), "world is dict: must be World"),
        (lambda: ds.World().add("ball"), "body is str: must be Body"),
        (lambda: ds.World(5), "gravity = 5: must be 3 numbers"),
        (lambda: ds.Joint("a").hinge((0, 1)), "axis has 2 numbers: must have 3"),
        (lambda: ds.Body.fixed().mesh([[0, 0, 0]], [[0, 1, 2]]), "triangles has 0 to 2: must be 0 to 0"),
        (lambda: body(wept=True), None),
        (lambda: ds.Config(3), "preset is int: must be str"),
        (lambda: ds.Config(rules=3), "rules = 3: must be a dict"),
        (lambda: ds.Config(rules={"clampng": 1}), "rules: clampng: did you mean 'clamping'?"),
        (lambda: ds.Config(rules={"slip_friction": "x"}), "slip_friction = 'x': must be True or False"),
        (lambda: ds.Config(substeps=2.5), "substeps = 2.5: must be a whole number"),
        (lambda: ds.Config(sleep="no"), "sleep = 'no': must be True or False"),
        (lambda: ds.Config(relax=1, method="quick"), "method: unknown variant `quick`, expected `plain` or `accelerated`"),
        (lambda: setattr(BATCH, "ctrl", np.zeros((8, U + 1))), f"ctrl has shape (8, {U + 1}): must be (8, {U})"),
    ],
)
def test_wrong_arguments_are_named_and_change_nothing(call, line: str | None) -> None:
    before = BATCH.hash()
    with pytest.raises(ValueError) as caught:
        call()
    text = str(caught.value)
    assert text == line if line else ("\n" not in text and ":" in text), text
    assert (BATCH.hash() == before).all() and (BATCH.steps == 0).all()


def test_a_state_of_more_bodies_does_not_fit() -> None:
    small, large = (ds.Batch(ds.Scene.find("tower", n=n)) for n in (2, 5))
    with pytest.raises(ValueError, match=r"snapshots\[0\] has 6 bodies, 0 joints, 0 drives: must be at most 3 bodies"):
        small.restore(large.snapshot())
    large.restore(small.snapshot())
    large.step(10), small.step(10)
    assert large.hash()[0] == small.hash()[0] and large.exists.sum() == 3


def test_threads_wait_for_each_other_and_leave_python_running() -> None:
    batch = ds.Batch(ds.Scene.find("pile", n=60), 8, config=ds.Config(sleep=False), num_threads=1)
    ticks, over = 0, threading.Event()

    def count() -> None:
        nonlocal ticks
        while not over.is_set():
            ticks += 1
            time.sleep(0.001)

    counter = threading.Thread(target=count)
    counter.start()
    callers = [threading.Thread(target=batch.step, args=(25,)) for _ in range(2)]
    begin = time.perf_counter()
    [caller.start() for caller in callers]
    [caller.join() for caller in callers]
    seconds = time.perf_counter() - begin
    over.set()
    counter.join()
    assert batch.steps.tolist() == [50] * 8
    assert ticks > 20 * seconds, f"{ticks} ticks in {seconds} s"


def _in_child(batch: ds.Batch, queue) -> None:
    try:
        batch.step()
        queue.put("stepped")
    except RuntimeError as error:
        other = ds.Batch(ds.Scene.find("pile", n=60), 2, num_threads=2)
        other.step(3)
        queue.put((str(error), int(other.hash()[0]), float(other.measure("overlap_max")["overlap_max"][0])))


def test_after_a_fork_a_batch_says_so_and_a_new_one_works() -> None:
    batch = ds.Batch(ds.Scene.find("pile", n=60), 2, num_threads=2)
    batch.step(3)
    context = multiprocessing.get_context("fork")
    queue = context.Queue()
    child = context.Process(target=_in_child, args=(batch, queue))
    child.start()
    message, hash_, overlap = queue.get(timeout=60)
    child.join(30)
    assert "before a fork" in message
    assert hash_ == int(batch.hash()[0]) and overlap == batch.measure("overlap_max")["overlap_max"][0]


def test_ctrl_c_ends_a_rollout_between_two_steps() -> None:
    batch = ds.Batch(ds.Scene.find("pile", n=27), 3, config=ds.Config(sleep=False), num_threads=2)
    timer = threading.Timer(0.5, os.kill, (os.getpid(), signal.SIGINT))
    timer.start()
    begin = time.perf_counter()
    with pytest.raises(KeyboardInterrupt):
        batch.step(10**9)
    assert time.perf_counter() - begin < 5
    steps = batch.steps.copy()
    assert (steps > 0).any() and np.isfinite(batch.position).all()
    same = ds.Batch(ds.Scene.find("pile", n=27), 3, config=ds.Config(sleep=False))
    for world, count in enumerate(steps):
        same.step(int(count), worlds=[world])
    assert (same.hash() == batch.hash()).all() and np.array_equal(same.position, batch.position)


def test_ctrl_c_ends_a_rollout_that_records_and_asks() -> None:
    batch = ds.Batch(ds.Scene.find("pile", n=8), 2, config=ds.Config(sleep=False), num_threads=1)
    for until in (None, lambda batch: np.zeros(2, bool)):
        threading.Timer(0.3, os.kill, (os.getpid(), signal.SIGINT)).start()
        with pytest.raises(KeyboardInterrupt):
            batch.rollout(10**6, every=1000, record="hash", until=until)
        same = ds.Batch(ds.Scene.find("pile", n=8), 2, config=ds.Config(sleep=False))
        for world, count in enumerate(batch.steps):
            same.step(int(count), worlds=[world])
        assert (same.hash() == batch.hash()).all() and np.array_equal(same.position, batch.position)
        batch.reset()


def test_contacts_events_rays_and_materials() -> None:
    batch = ds.Batch(ds.Scene.find("tower", n=3), 2, listen=["contacts", "impulses", "hits"], hits_above=0.1)
    batch.step()
    assert batch.events()["kind"].tolist() == ["began"] * 6 and batch.events([1])["world"].tolist() == [1] * 3
    batch.step(119)
    contacts = batch.contacts()
    assert contacts.world_start.tolist() == [0, 3, 6] and contacts.bodies[:3].tolist() == [[0, 1], [1, 2], [2, 3]]
    weight = 1000 * 9.81 / 60
    assert np.allclose(contacts.of(1).impulse[:, 1], [3 * weight, 2 * weight, weight], rtol=0.02)
    assert np.isclose(contacts.point_impulse.sum(), 12 * weight, rtol=0.02)
    hits = batch.ray([[0, 9, 0], [5, 9, 0]], [[0, -1, 0], [0, 1, 0]])
    assert hits.body.tolist() == [[3, -1]] * 2 and np.isinf(hits.distance[0, 1]) and np.isnan(hits.normal[0, 1]).all()
    assert np.allclose(hits.normal[0, 0], [0, 1, 0])
    # A tower without friction slides where one with friction stays.
    batch.set_material(friction=[[0.5] * 4, [0.0] * 4])
    batch.gravity[:] = (2, -9.81, 0)
    batch.step(30)
    moved = batch.position[:, 3, 0]
    assert abs(moved[0]) < 0.01 and moved[1] > 0.1
    batch.reset()
    assert np.allclose(batch.friction, 0.5) and np.allclose(batch.gravity, (0, -9.81, 0))


def test_a_world_is_built_of_every_shape_and_joint() -> None:
    world = ds.World()
    world.add(ds.Body.fixed("ground").height_field(np.zeros((3, 4)), (8, 1, 8)))
    world.add(ds.Body.fixed("roof").mesh([[0, 0, 0], [1, 0, 0], [0, 0, 1]], [[0, 2, 1]]).at(0, -3, 0))
    hull = world.add(ds.Body.dynamic("hull").convex_hull(np.eye(4, 3)).at(0, 2, 0).gravity_scale(0.5).damping(0.1, 0.2))
    hammer = ds.Body.dynamic("hammer").cuboid(0.1, 0.1, 0.3).cylinder(0.5, 0.02, position=(0, -0.6, 0), material={"friction": 0.1})
    world.add(hammer.at(3, 2, 0).set(can_sleep=False))
    world.join(ds.Joint("hammer").generic([{}, {"locked": True}, {"locked": True}], [{"locked": True}] * 3).at(3, 2, 0))
    world.join(ds.Joint(hull).slider((0, 1, 0)).at(0, 2, 0).spring_damper(0, 100, 5))
    scene = ds.Scene.from_world(world)
    data = scene.to_dict()
    springs = [axis["spring"]["stiffness"] for axis in data["joints"][1]["linear"] if axis.get("spring")]
    assert scene.actuators == ("joint 1: hull - world",) and springs == [100]
    assert data["bodies"][3]["shapes"][1]["position"] == pytest.approx([0, -0.6, 0]) and not data["bodies"][3]["can_sleep"]
    batch = ds.Batch(scene)
    batch.step(60)
    assert batch.position[0, 2, 1] < 2 and np.allclose(batch.position[0, 3], [3, 2, 0]) and batch.measure("finite")["finite"][0]


def test_scenes_and_settings_are_pickled_and_read_back() -> None:
    scene = ds.Scene.find("tower", n=3, top_ratio=5)
    for again in (pickle.loads(pickle.dumps(scene)), ds.Scene.from_dict(scene.to_dict())):
        one, two = ds.Batch(scene), ds.Batch(again)
        one.step(30), two.step(30)
        assert one.hash() == two.hash()
    config = ds.Config("fast", sleep=False, relax=2)
    assert pickle.loads(pickle.dumps(config)).to_dict() == config.to_dict()
    assert (config["substeps"], config["relax"], config["sleep_after"]) == (4, 2, 0)
    with pytest.raises(TypeError, match="save"):
        pickle.dumps(ds.Batch(scene))


def test_a_pendulum_built_by_hand_keeps_its_energy() -> None:
    world = ds.World()
    world.add(ds.Body.dynamic("bob").ball(0.1).at(1, 0, 0))
    world.join(ds.Joint("bob").hinge((0, 0, 1)).at(0, 0, 0))
    batch = ds.Batch(ds.Scene.from_world(world, dt=1 / 240), config=ds.Config("accurate", sleep=False))
    energy = []
    for _ in range(60):
        batch.step(4)
        energy.append(sum(batch.measure("kinetic_energy", "potential_energy").values())[0])
    mass = 1000 * 4 / 3 * np.pi * 0.1**3
    assert batch.joint_position.shape == (1, 1, 6) and batch.position[0, 0, 1] < 0
    assert np.ptp(energy) < 1e-3 * mass * 9.81


def test_residuals_fall_with_substeps_and_are_nan_with_joints() -> None:
    names = [name for name in MEASURES if name.startswith("residual")]
    config = ds.Config(sleep=False)
    batch = ds.Batch(ds.Scene.find("pile", n=27), 2, config=config)
    batch.step(60)
    before = batch.hash()
    values = batch.measure(*names)
    assert len(names) == 4 and (before == batch.hash()).all()
    assert all(np.isfinite(value).all() and value[0] == value[1] for value in values.values())
    assert 0 < values["residual_velocity"][0] < 0.5
    # A rollout records them, and goes where it went.
    out = batch.rollout(10, every=5, record=["residual_velocity"], worlds=[0])
    batch.step(10, worlds=[1])
    assert out["residual_velocity"].shape == (1, 2) and batch.hash()[0] == batch.hash()[1]
    jointed = ds.Batch(ds.Scene.find("drawbridge"))
    assert all(np.isnan(value).all() for value in jointed.measure(*names).values())


def test_masses_are_scaled_from_those_of_the_start() -> None:
    batch = ds.Batch(ds.Scene.find("tower", n=3), 2, config=ds.Config(sleep=False))
    batch.set_material(worlds=[1], bodies=[3], mass_scale=[[3]])
    batch.set_material(worlds=[1], bodies=[3], mass_scale=[[9]])
    assert batch.mass_scale.tolist() == [[1, 1, 1, 1], [1, 1, 1, 9]]
    # The same impulse gives a ninth of the speed.
    batch.apply_impulse(np.full((2, 1, 3), [90, 0, 0]), bodies=[3])
    assert batch.linear_velocity[0, 3, 0] == pytest.approx(9 * batch.linear_velocity[1, 3, 0])
    state = batch.snapshot([1])
    batch.restore(state, [0])
    batch.step(20)
    assert batch.mass_scale[0, 3] == 9 and batch.hash()[0] == batch.hash()[1]
    batch.reset([1])
    assert batch.mass_scale[1, 3] == 1
    with pytest.raises(ValueError, match="^mass_scale = 0 of a body of .* kg: must give 1e-15 to 1e15 kg$"):
        batch.set_material(mass_scale=np.zeros((2, 4)))
    with pytest.raises(ValueError, match="^mass_scale has shape"):
        batch.set_material(mass_scale=[1, 2])


def test_a_scene_whose_bodies_come_and_go_is_refused_by_name() -> None:
    with pytest.raises(ValueError, match="^conveyor: the scene has spawners or leaving bodies, which a batch does not support$"):
        ds.Batch(ds.Scene.find("conveyor"))


def test_a_picture_shows_the_world_as_it_is() -> None:
    batch = ds.Batch(ds.Scene.find("tower", n=3), 2)
    try:
        first = batch.picture(0, 160, 120)
    except ds.AdapterError as error:
        pytest.skip(str(error))
    assert first.shape == (120, 160, 3) and first.dtype == np.uint8 and len(np.unique(first.reshape(-1, 3), axis=0)) > 20
    before = batch.hash()
    assert np.array_equal(first, batch.picture(1, 160, 120)) and (before == batch.hash()).all()
    batch.set_state(worlds=[1], bodies=[3], position=[[[2, 0.5, 0]]])
    assert not np.array_equal(first, batch.picture(1, 160, 120))
    assert not np.array_equal(first, batch.picture(0, 160, 120, yaw=80))


@pytest.mark.parametrize(
    ("options", "line"),
    [
        ({"world": 2}, "world has 2: must be 0 to 1"),
        ({"width": 0}, "width = 0: must be 1 or more"),
        ({"height": 10**6}, "height = 1000000: must be at most 8192"),
        ({"yaw": float("nan")}, "yaw = nan: must be finite"),
    ],
)
def test_a_picture_names_wrong_arguments(options: dict, line: str) -> None:
    with pytest.raises(ValueError) as caught:
        ds.Batch(ds.Scene.find("tower", n=1), 2).picture(**options)
    assert str(caught.value) == line


def test_a_gpu_has_the_bits_of_the_cpu() -> None:
    scenes = [ds.Scene.find("tower", n=5), ds.Scene.find("drawbridge"), ds.Scene.find("pile", n=27), ds.Scene.find("tower", n=4)]
    try:
        cpu, gpu = ds.Batch(scenes), ds.Batch(scenes, backend="gpu", exact=True)
    except ds.AdapterError as error:
        pytest.skip(str(error))
    assert (cpu.backend, gpu.backend) == ("cpu", "gpu")
    for batch in (cpu, gpu):
        batch.force[0, 3] = (500, 0, 0)
        batch.step(40)
        batch.step(20, worlds=[0, 2])
    assert (cpu.hash() == gpu.hash()).all() and gpu.fault is None
    again = ds.Batch.load(gpu.save(), backend="gpu", exact=True)
    again.step(5)
    cpu.step(5)
    assert (cpu.hash() == again.hash()).all()
    plain = ds.Batch(scenes, backend="gpu")
    plain.step(2)
    cpu.reset()
    cpu.step(2)
    assert np.allclose(plain.position, cpu.position, atol=1e-4, equal_nan=True)


@pytest.mark.parametrize(("arguments", "part"), [({"backend": "tpu"}, "must be one of 'cpu', 'gpu'"), ({"backend": 3}, "backend = 3"), ({"exact": 1}, "exact = 1: must be True or False")])
def test_an_unknown_backend_is_refused(arguments: dict, part: str) -> None:
    with pytest.raises(ValueError, match=part):
        ds.Batch(ds.Scene.find("tower", n=2), **arguments)
