"""A streamed run that goes on writes the file of one that was never stopped, also where a sample is due at the join."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.design import pd as law_of
from flexctrl.errors import StructureError


class Counting:
    """Sample k commands k + 1."""

    inputs, outputs, sample_time = ("x",), ("f",), 0.1

    def initial(self) -> np.ndarray:
        return np.zeros(0)

    def command(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.array([1.0 + round(t / 0.1)])


def cart() -> fc.Model:
    mass = fc.PointMass("mass", (0, 0, 0), 1.0)
    inputs, outputs = (
        [fc.Force("f", mass.node, "x")],
        [fc.Position("x", mass.node, "x"), fc.Velocity("v", mass.node, "x")],
    )
    structure = fc.Structure([mass], [fc.Support(mass.node, "v w")], inputs=inputs, outputs=outputs)
    return fc.assemble(structure, [fc.LargeRotation()])


def test_a_file_that_is_gone_or_another_one_is_refused_and_not_touched(tmp_path: Path):
    """What followed alone was written, without a word."""
    path, how = tmp_path / "rows.csv", {"method": fc.GeneralizedAlpha(0.01), "every": 0.1}
    half = fc.simulate(cart(), Counting(), until=0.5, record=fc.CsvStream(path), **how)
    path.unlink()
    with pytest.raises(StructureError, match=r"rows.csv is not there, .*behind the \d rows .*; give the file that has"):
        fc.simulate(cart(), Counting(), until=1.0, start=half.checkpoint, record=fc.CsvStream(path), **how)
    assert not path.exists()
    path.write_text("a,b\n1,2\n")
    with pytest.raises(StructureError, match=r"not what the checkpoint goes on from: .*; give the file that has them"):
        fc.simulate(cart(), Counting(), until=1.0, start=half.checkpoint, record=fc.CsvStream(path), **how)
    assert path.read_text() == "a,b\n1,2\n"


def test_a_run_in_memory_goes_on_in_a_file(tmp_path: Path):
    joined, whole = tmp_path / "joined.csv", tmp_path / "whole.csv"
    how = {"method": fc.GeneralizedAlpha(0.01), "every": 0.1}
    half = fc.simulate(cart(), Counting(), until=0.55, **how)
    half.save_csv(joined)
    fc.simulate(cart(), Counting(), until=1.0, start=half.checkpoint, record=fc.CsvStream(joined), **how)
    fc.simulate(cart(), Counting(), until=1.0, record=fc.CsvStream(whole), **how)
    assert np.array_equal(*(np.loadtxt(path, delimiter=",", skiprows=1) for path in (joined, whole)))


def pd() -> fc.Sampled:
    return fc.Sampled(law_of(kp=4.0, kd=2.0, measured="x", rate="v", command="f"), 0.1)


@pytest.mark.parametrize("law", [Counting(), pd()])
@pytest.mark.parametrize("every", [None, 0.1, 0.05, 0.3, 0.07])
@pytest.mark.parametrize("stop", [0.1, 0.5, 0.55])
@pytest.mark.parametrize("method", [None, fc.GeneralizedAlpha(0.01), fc.GeneralizedAlpha(0.1)])
def test_the_file_is_that_of_a_run_that_was_never_stopped(tmp_path: Path, law, every, stop, method):
    """The row at the join kept the command of the sample before."""
    model, whole, joined = cart(), tmp_path / "whole.csv", tmp_path / "joined.csv"
    start = model.rest.with_(v=np.array([1.0]))
    how = {"method": method, "every": every}
    one = fc.simulate(model, law, until=1.5, start=start, record=fc.CsvStream(whole), **how)
    half = fc.simulate(model, law, until=stop, start=start, record=fc.CsvStream(joined), **how)
    rest = fc.simulate(model, law, until=1.5, start=half.checkpoint, record=fc.CsvStream(joined), **how)
    assert joined.read_text() == whole.read_text()
    assert (rest.final.q == one.final.q).all()
