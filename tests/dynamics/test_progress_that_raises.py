"""What a callback of progress raises ends the run, with all that was computed kept, and is not the machine's fault."""

from __future__ import annotations

import pytest

import flexctrl as fc
from flexctrl.errors import StructureError


def cart() -> fc.Model:
    mass = fc.PointMass("cart", (0, 0, 0), 2.0)
    inputs, outputs = [fc.Force("push", mass.node, "x")], [fc.Position("x", mass.node, "x")]
    plan = fc.Structure([mass], [fc.Support(mass.node, "v w")], inputs=inputs, outputs=outputs)
    return fc.assemble(plan, [fc.LargeRotation()])


@pytest.mark.parametrize(
    "error", [ZeroDivisionError("mine"), ValueError("mine"), RuntimeError("mine"), OSError("mine")]
)
def test_rows_are_kept_and_the_callback_is_named(error, monkeypatch):
    """Arithmetic was said to fail at a freedom of the machine; other errors came out of `simulate`: all was lost."""
    monkeypatch.setattr("flexctrl.dynamics.journey._SECONDS", 0.0)

    def told(share: float) -> None:
        if share > 0.3:
            raise error

    law = fc.OpenLoop({"push": lambda t: 1.0})  # step by step: compiled loops may be through before it is asked
    run = fc.simulate(cart(), law, until=10.0, progress=told, method=fc.GeneralizedAlpha(0.1))
    assert run.status is fc.Status.FAILED
    assert run.fault is error
    assert f"progress raised {type(error).__name__}: mine" in run.report.message
    assert 3.0 < run.t[-1] < 10.0


@pytest.mark.parametrize("times", [[0.1, 0.2], "now", float("nan"), None])
def test_a_run_is_asked_at_times(times):
    run = fc.simulate(cart(), until=1.0, inputs={"push": 1.0})
    with pytest.raises(StructureError, match=r"run\.at: t = "):
        run.at(times)
