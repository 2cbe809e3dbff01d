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
