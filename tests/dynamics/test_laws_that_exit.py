"""``sys.exit`` in a law, an event or ``progress`` ends the run as any exception does, and what it has is kept."""

from __future__ import annotations

import sys

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.errors import ControllerError


def swing() -> fc.Model:
    spring, mass = fc.Spring("spring", (0, 0, 0), (1, 0, 0), stiffness=100.0), fc.PointMass("mass", (1, 0, 0), 1.0)
    structure = fc.Structure(
        [spring, mass],
        [fc.Support(spring.start), fc.Pin(spring.end, mass.node), fc.Support(mass.node, "v w")],
        inputs=[fc.Force("push", mass.node, "x")],
        outputs=[fc.Position("x", mass.node, "x")],
    )
    return fc.assemble(structure, [fc.LargeRotation()])


def leave(late: bool) -> float:
    if late:
        sys.exit(2)
    return 0.0


class Leaving:
    """A law that reads and leaves after a while."""

    inputs, outputs = ("x",), ("push",)

    def __init__(self, sample_time: float, after: float) -> None:
        self.sample_time, self.after = sample_time, after

    def initial(self) -> np.ndarray:
        return np.zeros(0)

    def command(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.array([leave(t >= self.after)])


def check(run: fc.Run, said: str) -> None:
    """As without a law: 1 + 0.3 cos 10 t until then."""
    assert run.status is fc.Status.FAILED
    assert f"{said} raised SystemExit: 2" in run.report.message
    assert isinstance(run.fault, SystemExit)
    assert 0.35 < run.t[-1] <= 0.55
    assert run["x"] == pytest.approx(1.0 + 0.3 * np.cos(10.0 * run.t), abs=5e-3)


@pytest.mark.parametrize("method", [None, fc.GeneralizedAlpha(1e-2), fc.ExplicitRungeKutta()], ids=str)
@pytest.mark.parametrize("sample_time", [0.0, 0.1])
def test_of_a_law_all_is_kept(method, sample_time):
    model = swing()
    how = {"until": 1.0, "start": model.displace([0.3]), "method": method, "every": 0.01}
    check(fc.simulate(model, Leaving(sample_time, 0.45), **how), "the controller")


@pytest.mark.parametrize("method", [None, fc.GeneralizedAlpha(1e-2)], ids=str)
@pytest.mark.parametrize("sampled", [False, True])
def test_of_a_function_of_time_all_is_kept(method, sampled):
    model = swing()
    law = fc.OpenLoop({"push": lambda t: leave(t >= 0.45)})
    law = fc.Sampled(law, 0.01) if sampled else law
    check(fc.simulate(model, law, until=1.0, start=model.displace([0.3]), method=method, every=0.01), "the controller")


def test_of_a_sampled_function_of_time_that_raises_all_is_kept():
    """So it is with any exception: compiled loops stop before it and ask once more."""

    def told(t: float) -> float:
        return 0.0 if t < 0.45 else {}["later"]

    model, law = swing(), fc.Sampled(fc.OpenLoop({"push": told}), 0.01)
    run = fc.simulate(model, law, until=1.0, start=model.displace([0.3]), every=0.01)
    assert run.status is fc.Status.FAILED
    assert isinstance(run.fault, KeyError)
    assert run["x"] == pytest.approx(1.0 + 0.3 * np.cos(10.0 * run.t), abs=5e-3)


def test_of_a_linear_model_all_is_kept():
    model = swing()
    run = fc.simulate(fc.linearize(model), Leaving(0.1, 0.45), until=1.0, start=model.displace([0.3]), every=0.01)
    assert run.status is fc.Status.FAILED
    assert isinstance(run.fault, SystemExit)
    assert run["x"] == pytest.approx(0.3 * np.cos(10.0 * run.t), abs=1e-6)


def test_of_an_event_all_is_kept():
    model = swing()
    late = fc.Event("late", lambda y: leave(y["x"] < 0.8) + y["x"] - 7.0)  # at cos 10 t = −2/3
    run = fc.simulate(model, until=1.0, start=model.displace([0.3]), events=[late], method=fc.GeneralizedAlpha(1e-3))
    assert run.status is fc.Status.FAILED
    assert "raised SystemExit: 2" in run.report.message
    assert run.t[-1] == pytest.approx(np.arccos(-2.0 / 3.0) / 10.0, abs=3e-3)


def test_of_progress_all_is_kept(monkeypatch):
    monkeypatch.setattr("flexctrl.dynamics.journey._SECONDS", 0.0)
    model, law = swing(), fc.OpenLoop({"push": lambda t: 0.0})  # 64 steps, 128, and so on: asked after each
    how = {"until": 1.0, "start": model.displace([0.3]), "method": fc.GeneralizedAlpha(5e-4), "every": 0.01}
    check(fc.simulate(model, law, progress=lambda share: leave(share > 0.45), **how), "progress")


def test_at_once_it_is_told_with_its_cause():
    with pytest.raises(ControllerError, match="raised SystemExit: 2") as told:
        fc.simulate(swing(), Leaving(0.1, 0.0), until=1.0)
    assert isinstance(told.value.__cause__, SystemExit)
