"""Steps of large machines, guessed, pushed and kept tile by tile, are those of loops over all of the machine."""

from __future__ import annotations

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.model.flat import tiles
from flexctrl.model.flat.flattening import flatten

pytest.importorskip("llvmlite")

SECTION = fc.Section(EA=1e5, EI_y=10.0, EI_z=20.0, GJ=5.0, rhoA=1.0, rhoJ=1e-3)


def chain() -> fc.Structure:
    """Held where it turns: its first node has freedoms that stand apart."""
    beam = fc.Beam("chain", (0, 0, 0), (3, 1, -2), SECTION, elements=300)
    outputs = [fc.Position("tip", beam.end, "z"), fc.AngularVelocity("spin", beam.node(150), "x")]
    return fc.Structure([beam], [fc.Support(beam.start, held="u v w")], [], [fc.Force("push", beam.end, "y")], outputs)


def fork() -> fc.Structure:
    """Welded, and nothing pushes but the weight."""
    stem = fc.Beam("stem", (0, 0, 0), (1, 0, 0), SECTION, elements=60)
    arms = [fc.Beam(f"arm{k}", (1, 0, 0), (2, k - 0.5, 0.3), SECTION, elements=110) for k in range(2)]
    joints = [fc.Support(stem.start), *(fc.Weld(stem.end, arm.start) for arm in arms)]
    outputs = [fc.Position("tip", arms[0].end, "z"), fc.AngularVelocity("spin", arms[1].end, "x")]
    return fc.Structure([stem, *arms], joints, [], [], outputs)


@pytest.mark.parametrize("machine", [chain, fork])
@pytest.mark.parametrize("method", [fc.GeneralizedAlpha(2e-3), fc.AdaptiveAlpha()])
def test_tiles_change_no_step(monkeypatch, machine, method):
    runs = []
    for least in (4, 10**9):
        monkeypatch.setattr(tiles, "_LEAST", least)
        model = fc.assemble(machine(), [fc.Gravity(), fc.Flexible(), fc.LargeRotation(), fc.RayleighDamping(0.1, 1e-3)])
        assert (flatten(model).flat.tiles.count > 0) == (least == 4)
        how = {"inputs": dict.fromkeys(model.inputs, 3.0), "until": 0.2, "every": 0.01}
        runs.append(fc.simulate(model, method=fc.Unchecked(method), **how))
    ours, theirs = runs
    assert ours.report.newton_iterations == theirs.report.newton_iterations
    assert np.ptp(theirs.y, axis=0).min() > 1e-3
    np.testing.assert_allclose(ours.y, theirs.y, rtol=0, atol=1e-9)
    np.testing.assert_allclose(ours.final.v, theirs.final.v, rtol=0, atol=1e-7)
