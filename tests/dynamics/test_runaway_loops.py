"""Sampled loops that run away end as failed where their poles say, in chosen steps and in fixed ones."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg as la

import flexctrl as fc
from flexctrl.design import pd
from flexctrl.dynamics.notes.sampled_growth import Missed
from flexctrl.dynamics.notes.sampled_loop import Answers, SampledLoop

SAMPLE, STIFF, DAMPING, OWN, ROTOR = 0.005, 50.0, 0.05, 0.01, 0.1
KP, KD, BEGUN = 20.0, 4.2, 1e-6
METHODS = [None, fc.GeneralizedAlpha(SAMPLE / 20), fc.GeneralizedAlpha(SAMPLE / 25, rho=0.5)]


def shaft() -> fc.Model:
    rotor = fc.RigidBody("rotor", (0, 0, 0), 1.0, (ROTOR,) * 3)
    motor = fc.RotaryDrive("m", rotor.node, axis="z", stiffness=STIFF, ratio=1.0, inertia=OWN, damping=DAMPING)
    plan = fc.Structure(
        [rotor],
        [fc.Support(rotor.node, "u v w rx ry")],
        [motor],
        [fc.MotorTorque("tq", motor)],
        [fc.DriveAngle("a", motor), fc.DriveSpeed("s", motor), fc.AngularVelocity("w", rotor.node, "z")],
    )
    return fc.assemble(plan, [fc.LargeRotation(), fc.ShaftElasticity()])


def runs_away(far: float, fast: float) -> tuple[float, float]:
    """When the motor has gone so far, and the rotor turns so fast, by the loop's own matrices from sample to sample."""
    k, c, A = STIFF, DAMPING, np.zeros((5, 5))
    A[0, 2] = A[1, 3] = 1.0
    A[2, :4] = np.array([-k, k, -c, c]) / ROTOR
    A[3] = np.array([k, -k, c, -c, 1.0]) / OWN
    moved = la.expm(SAMPLE * A)
    Z = moved[:4, :4] - np.outer(moved[:4, 4], [0.0, KP, 0.0, KD])
    x, samples, gone = np.array([BEGUN, BEGUN, 0.0, 0.0]), 0, [np.inf, np.inf]
    while np.inf in gone:
        x, samples = Z @ x, samples + 1
        for i, (size, most) in enumerate([(abs(x[1]), far), (abs(x[2]), fast)]):
            gone[i] = min(gone[i], samples * SAMPLE if size > most else np.inf)
    return gone[0], gone[1]


@pytest.mark.parametrize("method", METHODS, ids=repr)
def test_a_loop_that_runs_away_ends_where_its_poles_say(method):
    """Fixed steps went on to 5e11 times the size of the machine, and finished."""
    model, law = shaft(), fc.Sampled(pd(KP, KD, measured="a", rate="s", command="tq"), SAMPLE)
    start = model.displace({"rotor_0_rz": BEGUN, "m_source": BEGUN})
    run = fc.simulate(model, law, until=2.0, start=start, method=method)
    assert run.status is fc.Status.FAILED
    assert "the loop is not stable" in run.report.message
    assert "ever faster" in run.report.message
    far, fast = runs_away(1e6, 1e3 / SAMPLE)
    assert 0.95 * min(far, fast) <= run.final.t <= 1.1 * max(far, fast)
    assert not any("e^" in note or "NaN" in note for note in run.report.notes)


class Spinning:
    """A constant torque after a time, and none once a spindle is fast."""

    inputs, outputs, sample_time = ("s",), ("tq",), 0.01

    def __init__(self, since: float, most: float) -> None:
        self.since, self.most = since, most

    def initial(self) -> np.ndarray:
        return np.zeros(0)

    def command(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.array([1e4 if t > self.since and y[0] < self.most else 0.0])


@pytest.mark.parametrize("method", [None, fc.GeneralizedAlpha(1e-3)], ids=repr)
@pytest.mark.parametrize("since", [0.0, 1.0])
def test_spindles_may_be_fast(since, method):
    """They turn by hundreds of radians a sample, and have waited: speeds go up by torque, as they should."""
    run = fc.simulate(shaft(), Spinning(since, 3e4), until=1.5, method=method, every=0.01)
    assert run.status is fc.Status.FINISHED, run.report.message
    assert run["w"][-1] == pytest.approx(
        1e4 * 0.01 * round(run["w"][-1] * (OWN + ROTOR) / 100.0) / (OWN + ROTOR), rel=1e-2
    )
    assert run["w"][-1] > 3e4 * 0.99


def test_growth_beyond_all_numbers_is_said_in_words():
    missed = Missed(pole=-1.982e25 + 0j, whole=1.02e4, seen=0.0, most=0.0, step=1e-5, finer=1e-7)
    assert "it grows beyond all numbers over the run" in missed.said()
    assert "it grows by e^12 over the run" in missed._replace(whole=12.0).told("about its start", "")


def test_a_loop_beyond_numbers_says_so():
    one, none = np.eye(1), np.zeros(0, dtype=int)
    law = Answers(np.full((1, 1), np.inf), np.zeros((1, 0)), np.zeros((0, 1)), np.zeros((0, 0)))
    loop = SampledLoop(one, one, one, one, one, one, law, 0.1, np.ones(1, dtype=bool), none, none)
    with pytest.raises(ArithmeticError, match="beyond what numbers can tell"):
        loop.poles(1.0)
