"""A motor with dry friction under a PD law: near its target it sticks and slips by less and less, less than a step.

Held to scipy's integration of the sliding and sticking pieces, joined where they end.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import flexctrl as fc
from flexctrl.design import FilteredRate, Step, Tracking, pd

J, MOTOR, STIFF, DAMPING, RATIO, FRICTION, FILTER, END = 1.0, 0.05, 30.0, 0.05, 2.0, 0.5, 0.02, 3.5


def model() -> fc.Model:
    wheel = fc.RigidBody("wheel", (0, 0, 0), 1.0, (1.0, 1.0, J))
    drive = fc.RotaryDrive("motor", wheel.node, axis="z", stiffness=STIFF, ratio=RATIO, inertia=MOTOR, damping=DAMPING)
    structure = fc.Structure(
        [wheel],
        [fc.Support(wheel.node, "u v w rx ry")],
        [drive],
        inputs=[fc.MotorTorque("torque", "motor")],
        outputs=[
            fc.DriveAngle("angle", "motor"),
            fc.DriveSpeed("speed", "motor"),
            fc.Rotation("turn", wheel.node, "z"),
        ],
    )
    friction = fc.CoulombFriction({"motor": FRICTION})
    return fc.assemble(structure, [fc.LargeRotation(), fc.ShaftElasticity(), friction])


def pieces(kp: float, kd: float, filtered: bool) -> tuple[float, float, int]:
    """Return where motor and wheel are at the end, and how often the motor stuck or broke loose."""

    def push(y: np.ndarray) -> float:
        off = y[2] - 1.0
        rate = (off - y[4]) / FILTER if filtered else y[3]
        return STIFF * (RATIO * y[0] - y[2]) + DAMPING * (RATIO * y[1] - y[3]) - kp * off - kd * rate

    def motion(t: float, y: np.ndarray, side: float) -> list[float]:
        shaft = STIFF * (RATIO * y[0] - y[2]) + DAMPING * (RATIO * y[1] - y[3])
        slips = (push(y) - side * FRICTION) / MOTOR if side else 0.0
        return [y[1], -RATIO * shaft / J, y[3], slips, (y[2] - 1.0 - y[4]) / FILTER]

    def ends(t: float, y: np.ndarray, side: float) -> float:
        return side * y[3] if side else FRICTION - abs(push(y))

    ends.terminal, ends.direction = True, -1  # type: ignore[attr-defined]
    t, y, side, switches = 0.0, np.zeros(5), 1.0, 0
    while True:
        part = solve_ivp(
            motion, (t, END), y, "DOP853", args=(side,), events=ends, rtol=1e-9, atol=1e-12, max_step=0.005
        )
        t, y = float(part.t[-1]), part.y[:, -1].copy()
        if part.status == 0:
            return float(y[2]), float(y[0]), switches
        y[3], switches = 0.0, switches + 1
        side = float(np.sign(push(y))) if side == 0.0 or abs(push(y)) > FRICTION else 0.0


@pytest.mark.parametrize(
    ("kd", "filtered", "method"),
    [(5.0, True, fc.GeneralizedAlpha(0.01)), (1.0, False, fc.AdaptiveAlpha())],
    ids=["fixed", "adaptive"],
)
def test_it_comes_to_rest_near_its_target(kd, filtered, method):
    rate = FilteredRate(FILTER) if filtered else "speed"
    law = Tracking(pd(20.0, kd, measured="angle", rate=rate, command="torque"), {"angle": Step(1.0)})
    run = fc.simulate(model(), law, until=END, method=method)
    angle, turn, switches = pieces(20.0, kd, filtered)
    assert run.status is fc.Status.FINISHED
    assert run["angle"][-1] == pytest.approx(angle, abs=1e-4)
    assert run["turn"][-1] == pytest.approx(turn, abs=3e-3)
    assert len(run.events) == switches


class Swelling:
    """2 N sin 2t, sampled."""

    inputs, outputs, sample_time = ("x",), ("push",), 0.01

    def initial(self) -> np.ndarray:
        return np.zeros(0)

    def command(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.array([2.0 * np.sin(2.0 * t)])


@pytest.mark.parametrize(
    "method",
    [fc.GeneralizedAlpha(1e-3), fc.AdaptiveAlpha(), fc.ExplicitRungeKutta(), fc.Richardson(fc.GeneralizedAlpha(5e-3))],
    ids=str,
)
def test_what_a_sample_tears_loose_is_told(method):
    """It bears 1.5 N: loose at the first sample at which more is asked for, and stuck again between samples."""
    mass = fc.PointMass("mass", (0, 0, 0), 1.0)
    outputs, inputs = [fc.Position("x", mass.node, "x")], [fc.Force("push", mass.node, "x")]
    structure = fc.Structure([mass], [fc.Support(mass.node, "v w")], inputs=inputs, outputs=outputs)
    dry = fc.CoulombFriction({"mass.u": fc.Coulomb(1.0, static=1.5)})
    run = fc.simulate(fc.assemble(structure, [fc.LargeRotation(), dry]), Swelling(), until=7.0, method=method)
    assert [e.rising for e in run.events] == [True, False] * 4 + [True]
    swelled = 0.5 * (np.arange(5) * np.pi + np.arcsin(0.75))
    assert np.allclose([e.t for e in run.events[::2]], np.ceil(swelled / 0.01) * 0.01, atol=1e-9)
