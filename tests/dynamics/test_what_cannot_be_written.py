"""A disk that is full, a folder that is not there: told by name, and no run is lost for it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.errors import StructureError

FULL = Path("/dev/full")


def falling() -> fc.Model:
    load = fc.PointMass("load", (0, 0, 10), 1.0)
    structure = fc.Structure([load], [fc.Support(load.node, "u v")], outputs=[fc.Position("z", load.node, "z")])
    return fc.assemble(structure, [fc.LargeRotation(), fc.Gravity()])


@pytest.mark.skipif(not FULL.is_char_device(), reason="there is no device that is always full")
@pytest.mark.parametrize("until", [1.0, 30.0])
def test_a_full_disk_ends_a_run_that_keeps_what_it_has(until):
    """Met as the run ends, or on the way."""
    run = fc.simulate(falling(), until=until, every=1e-3, record=fc.CsvStream(FULL))
    assert run.status is fc.Status.FAILED
    assert "/dev/full cannot be written: No space left on device" in run.report.message
    assert run["z"][0] == 10.0
    assert np.isfinite(run["z"]).all()
    assert isinstance(run.fault, OSError)


@pytest.fixture(scope="module")
def run() -> fc.Run:
    return fc.simulate(falling(), until=0.01)


WRITERS = {
    "CsvStream": lambda run: fc.CsvStream,
    "Autosave": lambda run: fc.Autosave,
    "Checkpoint.save": lambda run: run.checkpoint.save,
    "run.save_csv": lambda run: run.save_csv,
    "comparison.save_csv": lambda run: fc.compare(falling(), until=0.01).save_csv,
    "comparison.save_json": lambda run: fc.compare(falling(), until=0.01).save_json,
}


@pytest.mark.parametrize("name", WRITERS)
def test_what_is_no_place_for_a_file_is_named_and_nothing_is_left_there(name, run, tmp_path, monkeypatch):
    """As a folder that is not there, or one in place of a file."""
    monkeypatch.chdir(tmp_path)
    write = WRITERS[name](run)
    with pytest.raises(StructureError, match=rf"{name}: path = .* there is no folder '.*nowhere'; make it first"):
        write(tmp_path / "nowhere" / "run.csv")
    with pytest.raises(StructureError, match=rf"{name}: path = '.' is a folder; expected the name of a file"):
        write(".")
    with pytest.raises(StructureError, match=rf"{name}: path = 3; expected the name of a file"):
        write(3)
    assert not list(tmp_path.iterdir())


@pytest.mark.skipif(not FULL.is_char_device(), reason="there is no device that is always full")
def test_what_a_full_disk_does_not_take_is_told_and_no_part_is_left(run, tmp_path):
    with pytest.raises(StructureError, match=r"run.save_csv: /dev/full cannot be written: No space left on device"):
        run.save_csv(FULL)
    (tmp_path / "run.npz.part").symlink_to(FULL)
    with pytest.raises(StructureError, match=r"Checkpoint.save: .*run.npz cannot be written: No space left on device"):
        run.checkpoint.save(tmp_path / "run.npz")
    assert not list(tmp_path.iterdir())


def test_a_checkpoint_that_is_not_there_is_told(tmp_path):
    with pytest.raises(StructureError, match=r"load_checkpoint: .*run.npz cannot be read: No such file.*; give a file"):
        fc.load_checkpoint(tmp_path / "run.npz")
    (tmp_path / "run_1.npz").touch()
    with pytest.raises(StructureError, match=r"cannot be read: No such file.*; did you mean 'run_1.npz'\?"):
        fc.load_checkpoint(tmp_path / "run.npz")
    with pytest.raises(StructureError, match=r"load_checkpoint: path = .* is a folder; expected the name of a file"):
        fc.load_checkpoint(tmp_path)


def test_a_stream_that_cannot_be_opened_is_refused(tmp_path):
    stream = fc.CsvStream(tmp_path / "rows")
    (tmp_path / "rows").mkdir()
    with pytest.raises(StructureError, match="cannot be opened: Is a directory"):
        fc.simulate(falling(), until=0.1, record=stream)


def test_a_checkpoint_that_cannot_be_written_ends_the_run(tmp_path):
    """Its folder goes while the run does."""
    folder = tmp_path / "soon_gone"
    folder.mkdir()
    autosave = fc.Autosave(folder / "run.npz", seconds=1e-9)
    folder.rmdir()
    run = fc.simulate(falling(), until=3e4, every=1e3, method=fc.GeneralizedAlpha(1e-4), autosave=autosave)
    assert run.status is fc.Status.FAILED
    assert "run.npz cannot be written: No such file" in run.report.message
