"""Steps that end at corners of laws of force: found by few trials, and told first by the parabola of a step."""

from __future__ import annotations

import numpy as np
import pytest
from test_corners_and_switches import bouncing
from test_march_first_order import Rocking, slewing

import flexctrl as fc
from flexctrl.dynamics.events.roots import nearly
from flexctrl.dynamics.march.stepper import MarchingStepper

pytest.importorskip("llvmlite")


def test_the_root_of_a_parabola_is_exact():
    rng = np.random.default_rng(0)
    for _ in range(200):
        times, (root, other, size) = np.sort(rng.uniform(0.0, 1.0, 3)), rng.uniform((0.0, -1.0, -2.0), (1.0, 2.0, 2.0))
        values = size * (times - root) * (times - other)
        for i in np.flatnonzero(values[:-1] * values[1:] < 0.0):
            found = nearly(list(zip(times, values, strict=True)), float(times[i]))
            assert min(abs(found - root), abs(found - other)) < 1e-9
            assert times[i] <= found <= times[i + 1]


@pytest.mark.parametrize(
    ("model", "how"),
    [
        (bouncing, {"until": 10.0}),
        (lambda: slewing(True, fc.CoulombFriction({"motor": 0.15})), {"until": 1.0, "controller": Rocking()}),
    ],
    ids=["rope", "friction"],
)
def test_landings_take_few_trials(model, how, monkeypatch):
    """Those and the steps that pass what they then land on: three for each."""
    taken, step = [], MarchingStepper.step
    monkeypatch.setattr(MarchingStepper, "step", lambda *given: taken.append(None) or step(*given))
    run = fc.simulate(model(), method=fc.Unchecked(fc.GeneralizedAlpha(1e-3)), **how)
    assert run.status is fc.Status.FINISHED
    assert len(run.events) > 4
    assert len(taken) < 4 * len(run.events)
