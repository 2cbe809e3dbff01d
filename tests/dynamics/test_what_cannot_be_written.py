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


@pytest.mark.parametrize("kind", [fc.CsvStream, fc.Autosave])
def test_a_folder_that_is_not_there_is_named(kind, tmp_path):
    with pytest.raises(StructureError, match=r"there is no folder '.*nowhere'; make it first"):
        kind(tmp_path / "nowhere" / "run.csv")


def test_a_stream_that_cannot_be_opened_is_refused(tmp_path):
    with pytest.raises(StructureError, match="cannot be opened: Is a directory"):
        fc.simulate(falling(), until=0.1, record=fc.CsvStream(tmp_path))


def test_a_checkpoint_that_cannot_be_written_ends_the_run(tmp_path):
    """Its folder goes while the run does."""
    folder = tmp_path / "soon_gone"
    folder.mkdir()
    autosave = fc.Autosave(folder / "run.npz", seconds=1e-9)
    folder.rmdir()
    run = fc.simulate(falling(), until=3e4, every=1e3, method=fc.GeneralizedAlpha(1e-4), autosave=autosave)
    assert run.status is fc.Status.FAILED
    assert "run.npz cannot be written: No such file" in run.report.message
