"""D13: a rope hauled in to nothing: the pendulum's angle grows as it must, and the run stops where no rope is left.

A winch of great inertia hauls a load from 10 m at 1 m/s; 1 mrad at the start.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import flexctrl as fc
from flexctrl.dynamics.run import Status

PAGE = "hard"
G, LENGTH, ANGLE = 9.81, 10.0, 1e-3


def reference(length: float) -> float:
    """θ̈ = −(2 l̇ θ̇ + g sin θ)/l with l̇ = −1."""

    def rates(t: float, z: np.ndarray) -> tuple[float, float]:
        return z[1], (2.0 * z[1] - G * np.sin(z[0])) / (LENGTH - t)

    return float(solve_ivp(rates, (0, LENGTH - length), (ANGLE, 0), method="DOP853", rtol=1e-11, atol=1e-15).y[0, -1])


def hoisted(inertia: float, shortest: float, until: float, torque: float = 0.0) -> fc.Run:
    """A kilogram hauled in by a drum of a metre that turns at 1 rad/s at the start."""
    drum = fc.PointMass("drum", (0, 0, 0), 1.0)
    load = fc.PointMass("load", (LENGTH * np.sin(ANGLE), 0, -LENGTH * np.cos(ANGLE)), 1.0)
    winch = fc.Winch("winch", load.node, drum.node, EA=1e9, radius=1.0, inertia=inertia, shortest=shortest)
    structure = fc.Structure(
        [drum, load],
        [fc.Support(drum.node), fc.Support(load.node, "v")],
        [winch],
        inputs=[fc.MotorTorque("torque", "winch")],
        outputs=[fc.Position(axis, load.node, axis) for axis in "xz"],
    )
    model = fc.assemble(structure, [fc.LargeRotation(), fc.Gravity()])
    start = fc.project(model, model.rest, {load.node: (-np.sin(ANGLE), 0.0, np.cos(ANGLE))}).state
    method, tolerance = fc.ExplicitRungeKutta(first_step=1e-4), fc.Tolerance(1e-9, 1e-12)
    return fc.simulate(model, start=start, until=until, inputs={"torque": torque}, method=method, tolerance=tolerance)


@pytest.mark.slow
def test_to_a_tenth_of_a_metre_and_to_the_stop(record):
    """So heavy a drum keeps its speed; the rope may not be shorter than a millimetre."""
    run = hoisted(1e9, 1e-3, 11.0)
    sway = [float(np.arctan2(run.at(LENGTH - left)["x"], -run.at(LENGTH - left)["z"])) for left in (1.0, 0.1)]
    record(
        "D13 hauled in from 10 m: angle at 1 m and 0.1 m [rad]",
        ours=sway,
        reference=[0.0029932618, 0.0149308028],
        source="θ̈ = −(2 l̇ θ̇ + g sin θ)/l by DOP853",
        tolerance=1e-4,
    )
    assert sway == pytest.approx([reference(1.0), reference(0.1)], rel=1e-4)
    assert run.status is Status.STOPPED
    record(
        "D13 hauled in from 10 m: where the run stops [s]",
        ours=run.final.t,
        reference=LENGTH - 1e-3,
        source="1 mm of rope left",
        tolerance=1e-6,
    )
    assert "winch" in run.report.message


@pytest.mark.slow
def test_work_is_the_change_of_energy(record):
    """A torque of the load's weight on a light drum, until half a metre is left."""
    run = hoisted(1.0, 0.5, 20.0, torque=-G)
    energy = run.report.energy
    change = energy.kinetic + energy.stored - energy.start
    record(
        "D13 hauled in by a torque: work over change of energy, until 0.5 m is left",
        ours=energy.work / change,
        reference=1.0,
        source="nothing dissipates",
        tolerance=1e-6,
    )
    assert run.status is Status.STOPPED
