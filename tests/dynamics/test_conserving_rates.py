"""Rates of the conserving midpoint behind shafts and in beams whose force hangs on the last digits of places."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import flexctrl as fc

MASS, ARM, INERTIA, RATIO, TORQUE, G = 2.0, 1.5, 0.1, 1e3, 0.01, 9.81


def driven(stiffness: float, rotor: float) -> fc.Model:
    """A rigid bar on a hinge, let go from the horizontal; its motor holds on through a shaft of k R² as given."""
    bar = fc.RigidBody("bar", (ARM, 0, 0), MASS, (1e-3, INERTIA, INERTIA), {"hinge": (0, 0, 0), "tip": (ARM, 0, 0)})
    hinge, tip = bar.point("hinge"), bar.point("tip")
    motor = fc.RotaryDrive("motor", hinge, axis="y", stiffness=stiffness / RATIO**2, ratio=RATIO, inertia=rotor)
    outputs = [fc.Rotation("angle", hinge, "y"), fc.DriveSpeed("speed", motor), fc.Velocity("fall", tip, "z")]
    held = [fc.Support(hinge, "u v w rx rz")]
    structure = fc.Structure([bar], held, [motor], [fc.MotorTorque("torque", motor)], outputs)
    return fc.assemble(structure, [fc.Gravity(), fc.LargeRotation(), fc.ShaftElasticity()])


@pytest.mark.parametrize("rotor", [1e-6, 1e-3])
@pytest.mark.parametrize("stiffness", [1e15, 3e16, 1e18, 1e21], ids="{:.0e}".format)
def test_speeds_behind_a_stiff_shaft_are_those_of_a_rigid_one(stiffness, rotor):
    run = fc.simulate(
        driven(stiffness, rotor), until=1.0, inputs={"torque": TORQUE}, method=fc.ConservingMidpoint(5e-3), every=0.05
    )
    assert run.status is fc.Status.FINISHED
    inertia = INERTIA + MASS * ARM**2 + rotor * RATIO**2
    angle, rate = solve_ivp(
        lambda _, y: [y[1], (MASS * G * ARM * np.cos(y[0]) + TORQUE * RATIO) / inertia],
        (0.0, 1.0), [0.0, 0.0], t_eval=run.t, rtol=1e-11, atol=1e-12,
    ).y  # fmt: skip
    for found, right in ("angle", angle), ("speed", RATIO * rate), ("fall", -ARM * np.cos(angle) * rate):
        assert np.abs(run[found] - right).max() < 1e-4 * np.abs(right).max(), found
    assert not run.report.notes


@pytest.mark.parametrize("stiffness", [1e12, 1e15, 1e17], ids="{:.0e}".format)
def test_speeds_of_a_beam_as_good_as_rigid(stiffness):
    bent = 1e-4 * stiffness
    section = fc.Section(EA=stiffness, EI_y=bent, EI_z=bent, GJ=bent, rhoA=2.0, rhoJ=1e-3)
    beam = fc.Beam("beam", (0, 0, 0), (ARM, 0, 0), section, elements=3)
    outputs = [fc.Rotation("angle", beam.start, "y"), fc.Velocity("fall", beam.end, "z")]
    structure = fc.Structure([beam], [fc.Support(beam.start, "u v w rx rz")], outputs=outputs)
    model = fc.assemble(structure, [fc.Gravity(), fc.LargeRotation(), fc.Flexible()])
    run = fc.simulate(model, until=1.0, method=fc.ConservingMidpoint(2e-3), every=0.05)
    angle, rate = solve_ivp(
        lambda _, y: [y[1], 1.5 * G / ARM * np.cos(y[0])],
        (0.0, 1.0), [0.0, 0.0], t_eval=run.t, rtol=1e-11, atol=1e-12,
    ).y  # fmt: skip
    for found, right in ("angle", angle), ("fall", -ARM * np.cos(angle) * rate):
        assert np.abs(run[found] - right).max() < 3e-4 * np.abs(right).max(), found
    assert run.report.energy_residual < 1e-6
