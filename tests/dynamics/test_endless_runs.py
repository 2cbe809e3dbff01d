"""A run that would take steps for days ends, and says why; one that is merely long goes on."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

import flexctrl as fc


@cache
def pendulum() -> fc.Model:
    bob = fc.RigidBody("bob", (0, 0, -1), 1.0, (1e-3,) * 3, points={"top": (0, 0, 0)})
    support = fc.Support(bob.point("top"), "u v w rx rz")
    machine = fc.Structure([bob], [support], outputs=[fc.Rotation("angle", bob.node, "y")])
    return fc.assemble(machine, [fc.Gravity(), fc.LargeRotation()])


def spun(speed: float, until: float, method: fc.AdaptiveAlpha | fc.ExplicitRungeKutta) -> fc.Run:
    """The pendulum from a speed at which the rounding of its forces asks for short steps."""
    start = pendulum().rest.with_(v=np.full(pendulum().n, speed))
    return fc.simulate(pendulum(), until=until, start=start, method=method, every=0.1 * until)


@pytest.mark.slow
def test_a_run_without_end_says_so():
    run = spun(1e11, 1e4, fc.AdaptiveAlpha())
    assert run.status is fc.Status.FAILED
    assert "most_steps (now 1e+08)" in run.report.message
    assert "s long on average at t = " in run.report.message
    assert run.report.steps < 1_000_000
    assert np.isfinite(run.y).all()
    assert run.final.t > 0.0


@pytest.mark.slow
def test_how_many_steps_are_too_many_is_a_value_of_the_method():
    few = fc.AdaptiveAlpha(largest_step=1e-6, most_steps=1e6)
    assert spun(1.0, 2.0, few).status is fc.Status.FAILED
    assert spun(1.0, 0.9, few).status is fc.Status.FINISHED


@pytest.mark.parametrize("method", [fc.AdaptiveAlpha, fc.ExplicitRungeKutta])
@pytest.mark.parametrize("value", [0.0, -1.0, float("nan")])
def test_a_number_of_steps_is_above_zero(method, value):
    with pytest.raises(fc.errors.StructureError, match="most_steps"):
        method(most_steps=value)
