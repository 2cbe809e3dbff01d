"""What is told of a run is the same wherever its curves go."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.dynamics.records.digest import Digested


def caught() -> fc.Model:
    """A load that falls into a rope."""
    rope = fc.Rope("rope", (0, 0, 0), (0, 0, -1.0), EA=2e5, length=1.5, damping=50.0)
    load = fc.PointMass("load", rope.end, 100.0)
    outputs = [fc.Position("z", load.node, "z"), fc.Velocity("vz", load.node, "z"), fc.Tension("tension", rope)]
    joints = [fc.Support(rope.start), fc.Pin(rope.end, load.node), fc.Support(load.node, "u v")]
    machine = fc.Structure([rope, load], joints, [], [], outputs)
    return fc.assemble(machine, [fc.Gravity(), fc.LargeRotation(), fc.RopeStretch()])


def carts() -> fc.Model:
    """A heavy one on a soft spring, and a light one on a stiff spring that hangs on it."""
    soft, stiff = fc.Spring("soft", (0, 0, 0), (1, 0, 0), 40.0), fc.Spring("stiff", (1, 0, 0), (1.5, 0, 0), 4e3)
    heavy, light = fc.PointMass("heavy", soft.end, 10.0), fc.PointMass("light", stiff.end, 0.1)
    joints = [
        fc.Support(soft.start),
        fc.Pin(soft.end, heavy.node),
        fc.Pin(soft.end, stiff.start),
        fc.Pin(stiff.end, light.node),
        fc.Support(heavy.node, "v w"),
        fc.Support(light.node, "v w"),
    ]
    outputs = [
        fc.Position("x", light.node, "x"),
        fc.Velocity("vx", light.node, "x"),
        fc.Tension("tension", stiff),
    ]
    machine = fc.Structure([soft, heavy, stiff, light], joints, [], [fc.Force("push", light.node, "x")], outputs)
    return fc.assemble(machine, [fc.LargeRotation()])


def told(run: fc.Run) -> tuple:
    return run.status, replace(run.report, wall_s=0.0), run.events, run.final.q.tolist()


@pytest.mark.parametrize("every", [None, 0.01])
@pytest.mark.parametrize("method", [None, fc.GeneralizedAlpha(0.01), fc.GeneralizedAlpha(0.02)])
@pytest.mark.parametrize("made", [caught, carts])
def test_a_streamed_run_is_told_the_same_of(made, method, every, tmp_path):
    """By first and last rows the largest tension was "here 0", and speeds that were 43 % off were told 0.3."""
    model = made()
    kwargs = {"until": 2.0, "method": method, "every": every, "inputs": {"push": 30.0} if model.inputs else None}
    path = tmp_path / "rows.csv"
    kept, streamed = fc.simulate(model, **kwargs), fc.simulate(model, record=fc.CsvStream(path), **kwargs)
    assert told(kept) == told(streamed)
    assert kept.report.output_errors
    rows = np.loadtxt(path, delimiter=",", skiprows=1)
    assert np.array_equal(rows[:, 1 : 1 + len(model.outputs)], kept.y)
    assert np.array_equal(streamed.y, kept.y[[0, -1]])
    assert streamed.at(1.0)["tension"] == kept.at(1.0)["tension"]


@pytest.mark.parametrize("lump", [1, 3, 50])
@pytest.mark.parametrize("after", [0, 1, 37])
def test_a_digest_keeps_rows_evenly_spaced_and_the_last(after, lump):
    digest, numbers = Digested(3, after, 20), np.arange(after, after + 500)
    for first in range(0, len(numbers), lump):
        rows = numbers[first : first + lump]
        digest.rows(np.column_stack([rows, 2.0 * rows]), np.array([7.0]))
        assert len(digest.table()) <= 21
        assert digest.table()[-1, 0] == rows[-1]
    kept = digest.table()
    assert set(kept[:-1, 0]) <= set(numbers[numbers % digest.stride == 0])
    assert np.array_equal(np.unique(np.diff(kept[:-1, 0])), [digest.stride])
    assert len(kept) >= 10
    assert np.array_equal(kept[:, 1], 2.0 * kept[:, 0])
    assert np.array_equal(kept[:, 2], np.full(len(kept), 7.0))


def test_a_short_digest_is_all_rows():
    digest = Digested(2, 0, 20)
    for t in range(15):
        digest.row(float(t), np.zeros(0), np.array([1.0]))
    assert np.array_equal(digest.table()[:, 0], np.arange(15.0))
