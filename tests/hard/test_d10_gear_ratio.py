"""D10: reductions of a hundred to ten thousand: the same physics from either side.

5 kg m² on 1000 N m/rad, the motor behind a reduction, or reflected by hand. Frequencies are in tests/validation.
"""

from __future__ import annotations

import numpy as np
import pytest
from recorder import Absolute
from turntable import turntable

import flexctrl as fc

PAGE = "hard"
CASES = [(1e-4, 1e2), (1e-6, 1e3), (1e-8, 1e4)]


@pytest.mark.parametrize(("inertia", "ratio"), CASES)
def test_frequencies(record, inertia, ratio):
    found = fc.linearize(turntable(1000.0 / ratio**2, inertia, ratio)).modes().omega
    record(
        f"D10 R = {ratio:g}, J = {inertia:g}: resonance [rad/s]",
        ours=found[1],
        reference=np.sqrt(1200.0),
        source="√(k(1/J_L + 1/(R²J_m)))",
        tolerance=1e-9,
    )


@pytest.mark.parametrize("method", [fc.GeneralizedAlpha(2e-3), fc.AdaptiveAlpha()], ids=lambda m: type(m).__name__)
@pytest.mark.parametrize(("inertia", "ratio"), CASES)
def test_runs_are_the_same_from_either_side(record, inertia, ratio, method):
    """A step of torque for 2 s: the same angles; steps, rejections, Newton iterations but for round-off."""
    runs = []
    for r, model in (
        (ratio, turntable(1000.0 / ratio**2, inertia, ratio)),
        (1.0, turntable(1000.0, inertia * ratio**2, 1.0)),
    ):
        runs.append((r, fc.simulate(model, until=2.0, inputs={"torque": 10.0 / r}, method=method)))
    (r, behind), (_, reflected) = runs
    name = type(method).__name__
    assert np.allclose(behind.t, reflected.t, rtol=1e-9, atol=0.0)
    worst = [np.abs(behind["table"] - reflected["table"]).max(), np.abs(behind["angle"] / r - reflected["angle"]).max()]
    record(
        f"D10 R = {ratio:g}, {name}: angles behind the reduction less reflected by hand [rad]",
        ours=worst,
        reference=[0, 0],
        source="the same machine",
        tolerance=Absolute(1e-9),
    )
    counts = [(x.steps, x.rejected_steps, x.newton_iterations) for x in (behind.report, reflected.report)]
    record(
        f"D10 R = {ratio:g}, {name}: steps, rejections, Newton iterations more than reflected by hand",
        ours=np.subtract(*counts),
        reference=[0, 0, 0],
        source="the same machine",
        tolerance=Absolute(2),
    )
