"""A rod of next to no mass on a drive's shaft, with drag at its tip: it is as fast as the wind lets it be at once."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import flexctrl as fc

LENGTH, RATIO, MOTOR, DAMPING, STIFFNESS, AREA, WIND, ANGLE = 1.287, -0.967, 2.04e-3, 0.0387, 9.02, 0.408, -5.03, -1.187


def rod(mass):
    along, inertia = np.array([np.sin(ANGLE), 0.0, -np.cos(ANGLE)]), 0.238 * mass
    tip = tuple(LENGTH * along)
    body = fc.RigidBody("rod", tuple(0.5 * LENGTH * along), mass, (inertia,) * 3, {"a": (0, 0, 0), "tip": tip})
    motor = fc.RotaryDrive(
        "motor", body.point("a"), axis="y", stiffness=STIFFNESS, ratio=RATIO, inertia=MOTOR, damping=DAMPING
    )
    held = [fc.Support(body.point("a"), "u v w rx rz")]
    structure = fc.Structure([body], held, [motor], [], [fc.Position(axis, body.point("tip"), axis) for axis in "xz"])
    wind = fc.Wind({"rod.tip": AREA}, speed=(WIND, 0, 0))
    return fc.assemble(structure, [fc.LargeRotation(), fc.Gravity(), fc.ShaftElasticity(), wind])


def tip(mass, until):
    """Where it is by another code, from the two equations of motion."""

    def slope(_, y):
        angle, turn, motor, spin = y
        across, down = WIND - LENGTH * np.cos(angle) * turn, -LENGTH * np.sin(angle) * turn
        drag = 0.5 * 1.25 * AREA * np.hypot(across, down)
        torque = STIFFNESS * (RATIO * (ANGLE - angle) - motor) + DAMPING * (-RATIO * turn - spin)
        pushed = LENGTH * drag * (np.cos(angle) * across + np.sin(angle) * down)
        pulled = -mass * 9.81 * LENGTH / 2 * np.sin(angle)
        inertia = 0.238 * mass + mass * LENGTH * LENGTH / 4
        return [turn, (RATIO * torque + pulled + pushed) / inertia, spin, torque / MOTOR]

    end = solve_ivp(slope, (0, until), [ANGLE, 0, 0, 0], rtol=1e-10, atol=1e-12, method="Radau").y[0, -1]
    return np.array([LENGTH * np.sin(end), -LENGTH * np.cos(end)])


@pytest.mark.parametrize(
    "method", [fc.GeneralizedAlpha(1e-3), fc.ConservingMidpoint(1e-3), fc.Richardson(fc.GeneralizedAlpha(2e-3))]
)
@pytest.mark.parametrize("mass", [6.7e-10, 6.7e-7, 6.7e-4])
def test_fixed_steps_come_to_its_speed(mass, method):
    if mass == 6.7e-10 and isinstance(method, fc.ConservingMidpoint):
        pytest.skip("keeps what rounding leaves of the swing")
    run = fc.simulate(rod(mass), until=0.1, method=method)
    assert run.status is fc.Status.FINISHED
    assert np.abs(run.y[-1] - tip(mass, 0.1)).max() <= 1e-4
    assert run.report.energy_residual < 0.2


def test_chosen_steps_see_it_or_say_what_is_wrong():
    run = fc.simulate(rod(6.7e-7), until=0.1)
    assert run.status is fc.Status.FINISHED
    assert np.abs(run.y[-1] - tip(6.7e-7, 0.1)).max() <= 1e-4
    lost = fc.simulate(rod(6.7e-10), until=0.1)
    assert lost.status is fc.Status.FAILED
    assert "what rod_0_ry moves has next to no mass against what damps it" in lost.report.message
    assert "GeneralizedAlpha(step)" in lost.report.message
