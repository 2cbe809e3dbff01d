"""Continuous loops that grow faster than steps see: implicit steps turn growth into decay, and the run says so.

Poles are those of equations by hand: a link (joint inertia J) behind an elastic gear, J q'' = −R s,
I a'' = s + u, s = k (R q − a) + d (R q' − a'), and the motor's lag T u' = c − u.
"""

from __future__ import annotations

from typing import Any

import control
import numpy as np
import pytest

import flexctrl as fc
from flexctrl.design import MinimumJerk, pd
from flexctrl.dynamics.feed import feed_of
from flexctrl.dynamics.notes.growing import loop_poles
from flexctrl.errors import ControllerError

INERTIA, MOTOR, K, D, R = 2.0, 1e-3, 50.0, 0.01, 10.0
IMPLICIT = [
    fc.GeneralizedAlpha(2e-3),
    fc.GeneralizedAlpha(2e-3, rho=1.0),
    fc.Richardson(fc.GeneralizedAlpha(2e-3)),
    fc.ConservingMidpoint(2e-3),
    fc.AdaptiveAlpha(),
]


def link(*effects: fc.Effect) -> fc.Model:
    body = fc.RigidBody("link", (0.5, 0, 0), 1.0, (1.0, 1.0, INERTIA - 0.25), {"hinge": (0, 0, 0)})
    hinge = body.point("hinge")
    motor = fc.RotaryDrive("motor", hinge, axis="z", stiffness=K, ratio=R, inertia=MOTOR, damping=D)
    machine = fc.Structure(
        [body],
        [fc.Support(hinge, "u v w rx ry")],
        [motor],
        [fc.MotorTorque("torque", motor), fc.Torque("load", hinge, "z")],
        [fc.DriveAngle("angle", motor), fc.DriveSpeed("speed", motor)],
    )
    return fc.assemble(machine, [fc.LargeRotation(), fc.ShaftElasticity(), *effects])


def law(kp: float, kd: float) -> fc.Tracking:
    return fc.Tracking(pd(kp=kp, kd=kd, measured="angle", rate="speed", command="torque"), {})


def by_hand(kp: float, kd: float, lag: float) -> np.ndarray:
    """Poles of (q, q', a, a', u); without lag of the first four."""
    shaft = np.array([K * R, D * R, -K, -D])
    A = np.zeros((5, 5))
    A[0, 1] = A[2, 3] = 1.0
    A[1, :4], A[3, :4] = -R * shaft / INERTIA, shaft / MOTOR
    asked = np.array([0.0, 0.0, -kp, -kd])
    if lag == 0.0:
        A[3, :4] += asked / MOTOR
        return np.linalg.eigvals(A[:4, :4])
    A[3, 4], A[4, :4], A[4, 4] = 1.0 / MOTOR, asked / lag, -1.0 / lag
    return np.linalg.eigvals(A)


def poles(model: fc.dynamics.feed.Plant, controller: Any, step: float = 2e-3) -> np.ndarray:
    feed = feed_of(model, controller, np.zeros(len(model.inputs)))
    return loop_poles(feed, model.rest, feed.first(model.rest), step)


def same(found: np.ndarray, wanted: np.ndarray) -> bool:
    """Both ways round, a pole at rest being one of the square root of round-off."""
    apart = abs(found[:, None] - wanted[None]) / (1.0 + abs(wanted[None]))
    return max(apart.min(axis=0).max(), apart.min(axis=1).max()) < 1e-4


@pytest.mark.parametrize("lag", [0.0, 1e-4, 0.02])
@pytest.mark.parametrize(("kp", "kd"), [(2.0, 0.05), (0.0, -1.0), (1e4, 0.01), (-5.0, -100.0)])
def test_poles_of_a_motor_under_a_law_are_those_by_hand(kp, kd, lag):
    effects = [fc.MotorLag({"motor": lag})] if lag else []
    assert same(poles(link(*effects), law(kp, kd)), by_hand(kp, kd, lag))


def test_a_law_with_states_has_its_own_poles_beside():
    """A filter in front: x' = −30 x + a, u = 500 x − 80 a − a' / 2."""
    filtered = control.ss(
        [[-30.0]], [[1.0, 0.0]], [[500.0]], [[-80.0, -0.5]], inputs=["angle", "speed"], outputs=["torque"]
    )
    A = np.zeros((5, 5))
    A[0, 1] = A[2, 3] = 1.0
    shaft = np.array([K * R, D * R, -K, -D])
    A[1, :4], A[3, :4] = -R * shaft / INERTIA, (shaft - [0.0, 0.0, 80.0, 0.5]) / MOTOR
    A[3, 4], A[4, 2], A[4, 4] = 500.0 / MOTOR, 1.0, -30.0
    assert same(poles(link(), filtered), np.linalg.eigvals(A))


def run(controller: Any, method: Any, until: float, *effects: fc.Effect) -> fc.Run:
    return fc.simulate(link(*effects), controller, until=until, method=method, inputs={"load": 1.0}, every=until / 2)


@pytest.mark.parametrize("method", IMPLICIT, ids=repr)
@pytest.mark.parametrize("kd", [-10.0, -100.0, -1000.0])
def test_growth_that_steps_map_to_decay_fails_the_run(kd, method):
    """It grows by e²⁰⁰ and more, and implicit steps end where they began."""
    found = run(law(0.0, kd), method, 0.02)
    assert found.status is fc.Status.FAILED
    assert np.isfinite(found.y).all()
    grows = by_hand(0.0, kd, 0.0).real.max()
    assert f"unstable, with a pole at {grows:.3g} 1/s" in found.report.message


@pytest.mark.parametrize("step", [5e-3, 1e-2])
def test_a_gain_too_high_for_the_motors_lag_is_told(step):
    """The angle arrives where it is sent to, by steps that are too long to see how the loop swings up."""
    sent = fc.Tracking(law(1e4, 0.01).controller, {"angle": MinimumJerk(distance=1.0, duration=0.2)})
    found = run(sent, fc.GeneralizedAlpha(step), 0.3, fc.MotorLag({"motor": 1e-4}))
    assert found["angle"][-1] == pytest.approx(1.0, abs=0.01)
    assert found.status is fc.Status.FAILED
    assert "unstable" in found.report.message


def test_growth_that_steps_see_is_told_with_what_it_does_to_errors():
    found = run(law(0.0, -1.0), fc.AdaptiveAlpha(), 0.02)
    assert found.status is fc.Status.FINISHED
    assert any("unstable" in note and "e^19" in note for note in found.report.notes)


@pytest.mark.parametrize("method", [*IMPLICIT, fc.ExplicitRungeKutta()], ids=repr)
def test_stable_loops_are_not_told_of(method):
    for controller in (law(2.0, 0.05), law(0.0, 0.0), law(10.0, 10.0)):
        found = run(controller, method, 0.05)
        assert found.status is fc.Status.FINISHED
        assert not any("unstable" in note for note in found.report.notes)


def test_a_law_that_does_not_answer_beside_its_course_loses_no_run(monkeypatch):
    def refused(*_: Any) -> None:
        raise ControllerError("turned back")

    monkeypatch.setattr("flexctrl.dynamics.journey.growth", refused)
    found = run(law(2.0, 0.05), fc.GeneralizedAlpha(2e-3), 0.02)
    assert found.status is fc.Status.FINISHED
    assert any("could not be told" in note and "turned back" in note for note in found.report.notes)
