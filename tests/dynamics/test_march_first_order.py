"""Motors whose torque takes time, and bristles: marched as plain steps take them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.dynamics.alpha.point import Coefficients
from flexctrl.dynamics.alpha.steps import Stepper
from flexctrl.dynamics.feed import feed_of
from flexctrl.dynamics.march.loops import run as tasks
from flexctrl.dynamics.march.making import Method
from flexctrl.dynamics.march.marching import Marcher
from flexctrl.dynamics.march.record import DONE, FIXED, JUMP, SETTLE
from flexctrl.dynamics.march.stepper import MarchingStepper

pytest.importorskip("llvmlite")

TIGHT = fc.Tolerance(relative=1e-3, absolute=1e-10)
PACES = {
    "fixed": fc.Unchecked(fc.GeneralizedAlpha(2e-3)),
    "controlled": fc.Unchecked(fc.AdaptiveAlpha(first_step=1e-3)),
}
LAG = fc.MotorLag({"motor": 0.02, "winch": 0.03})
BRISTLES = fc.LuGreFriction({"motor": fc.LuGre(200.0, 0.05, 0.08, 0.1, 0.2, 0.01)})
ADDED = {"lag": [LAG], "bristles": [BRISTLES], "both": [LAG, BRISTLES]}


def slewing(rigid: bool, *more: fc.Effect) -> fc.Model:
    """A boom on a slewing drive with a load on a spring, and a load on a winch beside it."""
    tube = fc.Section.tube(fc.STEEL, radius=0.05, thickness=0.004)
    boom = fc.Beam("boom", (0, 0, 0), (2, 0, 0), tube, elements=2)
    crab, hook = fc.PointMass("crab", (0, 1, 5), 10.0), fc.PointMass("hook", (0, 1, 3), 4.0)
    motor = fc.RotaryDrive("motor", boom.start, axis="z", stiffness=50.0, ratio=20.0, inertia=1e-3)
    winch = fc.Winch("winch", hook.node, crab.node, EA=1e5, radius=0.1, ratio=2.0, inertia=0.02)
    plan = fc.Structure(
        [boom, crab, hook],
        [fc.Support(boom.start, held="u v w rx ry"), fc.Support(crab.node)],
        [motor, winch],
        [fc.MotorTorque("torque", motor), fc.MotorTorque("hoist", winch)],
        [fc.DriveAngle("angle", "motor"), fc.DriveSpeed("speed", "motor"), fc.Position("z", hook.node, "z")],
    )
    flexible = [] if rigid else [fc.Flexible(), fc.RayleighDamping(0.1, 1e-3)]
    return fc.assemble(plan, [fc.Gravity(), fc.LargeRotation(), *flexible, *more])


@dataclass(frozen=True)
class Rocking:
    """Torque to and fro, sampled."""

    sample_time: float = 8e-3
    inputs: ClassVar[tuple[str, ...]] = ("speed",)
    outputs: ClassVar[tuple[str, ...]] = ("torque",)

    def initial(self) -> np.ndarray:
        return np.zeros(1)

    def command(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.array([(0.2 if x[0] % 6 < 3 else -0.3) - 0.01 * y[0]])

    def update(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return x + 1.0


def both(model: fc.Model, monkeypatch: pytest.MonkeyPatch, **how):
    """A run by compiled marches that must not take a plain step, and one by plain steps."""
    with monkeypatch.context() as patch:
        patch.setattr(Stepper, "step", lambda self, point, h: pytest.fail("a plain step"))
        marched = fc.simulate(model, **how)
    with monkeypatch.context() as patch:
        patch.setattr("flexctrl.dynamics.alpha.method._quickest", lambda plain: plain)
        return marched, fc.simulate(model, **how)


def alike(a, b) -> None:
    assert a.status is b.status is fc.Status.FINISHED
    assert a.report.steps == b.report.steps
    scale = np.abs(b.y).max(axis=0, initial=1.0)
    assert (np.abs(a.y - b.y) < 1e-6 * scale).all()  # what Newton leaves adds up in speeds
    assert np.allclose(a.final.q, b.final.q, rtol=0.0, atol=1e-7)
    assert np.allclose(a.final.v, b.final.v, rtol=1e-5, atol=1e-5)
    for name in ("work", "dissipated", "kinetic", "stored"):
        ours, theirs = (getattr(run.report.energy, name) for run in (a, b))
        assert ours == pytest.approx(theirs, rel=1e-6, abs=1e-9)
    assert a.report.energy_residual < 1e-2


@pytest.mark.parametrize("pace", PACES)
@pytest.mark.parametrize("rigid", [True, False])
@pytest.mark.parametrize("added", ADDED)
def test_marched_runs_are_plain_runs(added, rigid, pace, monkeypatch):
    """Tangents of pieces, and those probed where drives are rigid."""
    how = {"until": 0.05, "inputs": {"torque": 0.3, "hoist": 20.0}, "method": PACES[pace], "tolerance": TIGHT}
    alike(*both(slewing(rigid, *ADDED[added]), monkeypatch, **how))


@pytest.mark.parametrize("pace", PACES)
@pytest.mark.parametrize("rigid", [True, False])
def test_samples_jump_as_plain_ones_do(rigid, pace, monkeypatch):
    """Rates of first order jump with the inputs; so does what is dissipated."""
    how = {"controller": Rocking(), "until": 0.1, "inputs": {"hoist": 20.0}, "method": PACES[pace], "tolerance": TIGHT}
    a, b = both(slewing(rigid, *ADDED["both"]), monkeypatch, **how)
    alike(a, b)
    for t in (0.008, 0.011, 0.05):
        assert np.allclose(a.at(t).state.q, b.at(t).state.q, rtol=0.0, atol=1e-7)


def test_runs_go_on_bit_for_bit():
    """Stopped between two samples and resumed."""
    for method in PACES.values():
        how = {"controller": Rocking(), "method": method, "tolerance": TIGHT, "inputs": {"hoist": 20.0}}
        model = slewing(True, *ADDED["both"])
        whole = fc.simulate(model, until=0.06, **how)
        half = fc.simulate(model, until=0.03, **how)
        rest = fc.simulate(model, until=0.06, start=half.checkpoint, **how)
        assert np.array_equal(rest.final.q, whole.final.q)
        assert np.array_equal(rest.final.v, whole.final.v)


@pytest.mark.parametrize("added", ADDED)
def test_marches_start_where_plain_steps_do(added):
    model = slewing(False, *ADDED[added])
    rng = np.random.default_rng(1)
    state = model.displace(0.01 * rng.normal(size=model.n)).with_(v=rng.normal(size=model.n))
    feed = feed_of(model, None, np.array([0.3, 20.0]))
    plain = Stepper(model, feed, Coefficients.of(0.9), 1e-12)
    first = feed.first(state)
    a, b = MarchingStepper(plain).start(state, first, 1e-3), plain.start(state, first, 1e-3)
    assert np.allclose(a.state.v, b.state.v, rtol=1e-12, atol=1e-12)
    assert np.allclose(a.rate, b.rate, rtol=0.0, atol=1e-9 * np.abs(b.rate).max())


@pytest.mark.parametrize("method", [fc.GeneralizedAlpha(2e-3), fc.Exact(2e-3)])
@pytest.mark.parametrize("controller", [None, Rocking()])
def test_lags_march_in_small_motion(method, controller, monkeypatch):
    plan = slewing(False).structure
    model = fc.assemble(plan, [fc.Flexible(), fc.RayleighDamping(0.1, 1e-3), LAG])
    how = {"until": 0.1, "inputs": {"torque": 0.3}, "method": method, "controller": controller, "tolerance": TIGHT}
    marched = fc.simulate(model, **how)
    with monkeypatch.context() as patch:
        patch.setattr("flexctrl.dynamics.march.marching.can_march", lambda model: False)
        alike(marched, fc.simulate(model, **how))


@pytest.mark.parametrize("rigid", [True, False])
def test_the_march_runs_uncompiled(rigid):
    """A few steps and a jump of the inputs, by the same functions in Python on plain records."""
    model = slewing(rigid, *ADDED["both"])
    feed = feed_of(model, None, np.array([0.3, 20.0]))
    plain = Stepper(model, feed, Coefficients.of(0.9), 1e-12)
    method = Method(plain.coefficients, plain.tolerance, plain.weight, plain.turning)
    compiled, slow = Marcher(model, method), Marcher(model, method)
    point = plain.start(model.rest, feed.first(model.rest), 1e-3)
    record, m = slow.march._record, compiled.march
    assert compiled.entered(point).fixed(1e-3, 4) == DONE
    slow.entered(point)
    record.t, record.h, record.wanted, record.lean = 0.0, 1e-3, 4, point.lean
    for record.task in (SETTLE, FIXED):
        assert tasks(record) == DONE
    assert compiled.jump(np.array([-0.2, 50.0])) == DONE
    slow.supply(np.array([-0.2, 50.0]))
    record.task = JUMP
    assert tasks(record) == DONE
    for name in ("v", "rate", "algorithmic"):
        ours, theirs = getattr(record, name), getattr(m, name)
        assert np.allclose(ours, theirs, rtol=0.0, atol=1e-9 * max(1.0, np.abs(theirs).max()))
