"""Shafts from soft to stiffer than the digits of motor angles: a torque moves an arm as through a rigid one."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import flexctrl as fc

G, RATIO, ROTOR, LOAD, HUB, TORQUE = 9.81, 50.0, 1e-3, 2.0, 1.5, 0.8
BAR = fc.Section(EA=1.0, EI_y=1.0, EI_z=1.0, GJ=1.0, rhoA=1e-9, rhoJ=0.0)
METHODS = [fc.AdaptiveAlpha(), fc.GeneralizedAlpha(5e-3), fc.ConservingMidpoint(5e-3)]


def lifted(stiffness: float) -> fc.Model:
    """A load on a light, rigid arm, let go from the horizontal; the motor holds on through its shaft."""
    hub = fc.RigidBody("hub", (0, 0, 0), mass=1.0, inertia=np.diag([HUB, HUB, HUB]).tolist())
    arm = fc.Beam("arm", (0, 0, 0), (1, 0, 0), BAR)
    load = fc.PointMass("load", arm.end, LOAD)
    motor = fc.RotaryDrive("motor", hub.node, axis="z", stiffness=stiffness, ratio=RATIO, inertia=ROTOR)
    structure = fc.Structure(
        [hub, arm, load],
        [fc.Support(hub.node, "u v w rx ry"), fc.Weld(hub.node, arm.start), fc.Pin(arm.end, load.node)],
        drives=[motor],
        inputs=[fc.MotorTorque("torque", motor)],
        outputs=[fc.Position(axis, load.node, axis) for axis in "xy"],
    )
    return fc.assemble(structure, [fc.LargeRotation(), fc.Gravity((0, -G, 0)), fc.ShaftElasticity()])


def turned(t: np.ndarray, stiffness: float) -> np.ndarray:
    """The arm's angle from Lagrange's equations, of two freedoms or, where the shaft is as good as rigid, of one."""
    arm = HUB + LOAD
    if stiffness > 1e3:
        return solve_ivp(
            lambda _, y: [y[1], (RATIO * TORQUE - G * LOAD * np.cos(y[0])) / (arm + RATIO**2 * ROTOR)],
            (0.0, t[-1]), [0.0, 0.0], t_eval=t, rtol=1e-10, atol=1e-12,
        ).y[0]  # fmt: skip

    def rates(_: float, y: np.ndarray) -> list[float]:
        through = stiffness * (RATIO * y[0] - y[1])
        return [y[2], y[3], (-RATIO * through - G * LOAD * np.cos(y[0])) / arm, (through + TORQUE) / ROTOR]

    return solve_ivp(rates, (0.0, t[-1]), np.zeros(4), "Radau", t_eval=t, rtol=1e-8, atol=1e-10).y[0]


@pytest.mark.parametrize("stiffness", [1e1, 1e4, 1e8, 1e12, 1e14], ids="{:.0e}".format)
@pytest.mark.parametrize("method", METHODS, ids=lambda method: type(method).__name__)
def test_a_torque_through_a_shaft_however_stiff(method, stiffness):
    run = fc.simulate(lifted(stiffness), until=1.0, inputs={"torque": TORQUE}, method=method)
    assert run.status is fc.Status.FINISHED
    angle = np.unwrap(np.arctan2(run["y"], run["x"]))
    assert np.abs(angle - turned(run.t, stiffness)).max() < 4e-3
    assert run.report.energy_residual < 5e-2  # what the stiffest stores is rounding
    assert run.report.steps < 500
