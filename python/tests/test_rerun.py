"""Files of rerun, read back."""

from pathlib import Path

import pytest

import drystone as ds

rerun = pytest.importorskip("rerun")


def test_a_run_is_written_with_poses_contacts_and_errors(tmp_path: Path) -> None:
    import drystone.rerun

    scene = ds.Scene.find("tower", n=3)
    batch = ds.Batch(scene, 2, listen=["impulses"])
    path = tmp_path / "run.rrd"
    with drystone.rerun.log(batch, scene.to_dict(), world=1, to=path, every=5) as run:
        run.step(60)
    alone = ds.Batch(scene)
    alone.step(60)
    assert batch.hash()[1] == alone.hash()[0], "to be watched changes nothing"
    data = path.read_bytes()
    assert len(data) > 5000
    for name in (b"world/bodies/3", b"world/contacts", b"errors/overlap_max"):
        assert name in data, name
    with pytest.raises(ValueError, match="measures = 'overlap'"):
        drystone.rerun.log(batch, to=path, measures=["overlap"])
    with pytest.raises(ValueError, match="world has 2: must be 0 to 1"):
        drystone.rerun.log(batch, world=2, to=path)
