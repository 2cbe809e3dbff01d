"""Machines all at one place have the lengths that their parts have: nothing in a run depends on units."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg as la
from units import OTHERS, SI, Units

import flexctrl as fc

SAMPLE, SAMPLES = 0.1, 12
UNITS = {**OTHERS, "Gm, 1e20 kg, Ms": Units(1e-9, 1e-20, 1e-6), "fm, ag, ns": Units(1e15, 1e21, 1e9)}


def cart(u: Units, body: bool = False) -> fc.Model:
    """A cart of 5 kg on a drive of ten turns per pinion turn."""
    moments = (0.2 * u.mass * u.length**2,) * 3
    part = fc.RigidBody("cart", (0, 0, 0), 5 * u.mass, moments) if body else fc.PointMass("cart", (0, 0, 0), 5 * u.mass)
    moment = u.force * u.length
    drive = fc.LinearDrive(
        "drive",
        part.node,
        direction="x",
        radius=0.1 * u.length,
        ratio=10.0,
        stiffness=5.0 * moment,
        inertia=0.002 * u.mass * u.length**2,
    )
    structure = fc.Structure(
        [part],
        [fc.Support(part.node, "v w rx ry rz" if body else "v w")],
        drives=[drive],
        inputs=[fc.MotorTorque("torque", drive)],
        outputs=[fc.Position("x", part.node, "x")],
    )
    return fc.assemble(structure, [fc.LargeRotation(), fc.ShaftElasticity()])


def shaken(u: Units, method: fc.Integrator | None) -> fc.Run:
    class Law:
        inputs, outputs, sample_time = (), ("torque",), SAMPLE * u.time

        def initial(self):
            return np.zeros(0)

        def command(self, t, x, y):
            return np.array([torque(t / u.time)]) * u.force * u.length

    return fc.simulate(cart(u), Law(), until=SAMPLES * SAMPLE * u.time, every=SAMPLE * u.time, method=method)


def torque(t: float) -> float:
    return 0.8 * np.sin(3.0 * t)


def exact() -> float:
    """Where the cart of 5 kg is: two masses and a shaft under torques that are held, by their matrix exponential."""
    A = np.zeros((5, 5))
    A[0, 1] = A[2, 3] = 1.0
    A[1, :3:2] = -5.0 * 100.0**2 / 5.0, 5.0 * 100.0 / 5.0
    A[3] = 5.0 * 100.0 / 0.002, 0.0, -5.0 / 0.002, 0.0, 1.0 / 0.002
    step, x = la.expm(A * SAMPLE), np.zeros(5)
    for k in range(SAMPLES):
        x[4] = torque(k * SAMPLE)
        x = step @ x
    return x[0]


@pytest.mark.parametrize("method", [None, fc.ExplicitRungeKutta()], ids=["alpha", "explicit"])
@pytest.mark.parametrize("units", UNITS)
def test_a_cart_on_a_drive_takes_the_same_steps_in_all_units(units, method):
    run, other = shaken(SI, method), shaken(UNITS[units], method)
    assert run["x"][-1] == pytest.approx(exact(), rel=2e-4)
    assert other["x"] / UNITS[units].length == pytest.approx(run["x"], rel=1e-6, abs=1e-9)
    assert other.report.steps == run.report.steps
    assert other.report.rejected_steps == run.report.rejected_steps
    assert other.status is run.status is fc.Status.FINISHED
    assert other.report.notes == run.report.notes


@pytest.mark.parametrize("units", UNITS)
def test_the_size_is_that_of_wheels_or_of_bodies_if_these_are_larger(units):
    u = UNITS[units]
    assert cart(u).structure.size == pytest.approx(0.1 * u.length, rel=1e-12)
    assert cart(u, body=True).structure.size == pytest.approx(np.sqrt(0.3 / 5.0) * u.length, rel=1e-12)


def test_a_body_has_the_same_size_however_it_is_turned():
    turn = la.expm(np.cross(np.eye(3), (0.3, -0.7, 1.1)))
    for R in (np.eye(3), turn):
        body = fc.RigidBody("body", (1.0, 2.0, 3.0), 4.0, R @ np.diag([3.0, 4.0, 5.0]) @ R.T)
        assert fc.Structure([body]).size == pytest.approx(np.sqrt(1.5), rel=1e-12)


@pytest.mark.parametrize(("push", "told"), [(1e-3, True), (1.0, False)])
def test_a_point_that_hardly_moves_is_told_that_it_has_no_size(push, told):
    """Nothing in the model has a length: only how far it has come can tell what is little."""
    mass = fc.PointMass("mass", (0, 0, 0), 1.0)
    structure = fc.Structure([mass], inputs=[fc.Force("push", mass.node, "x")])
    model = fc.assemble(structure, [fc.LargeRotation(), fc.ViscousFriction({"mass.u": 5.0})])
    notes = fc.simulate(model, until=1.0, inputs={"push": push}).report.notes
    assert any("nothing in the machine has a length" in note for note in notes) is told
    if told:
        finer = fc.Tolerance(1e-4, 1e-11)
        assert not fc.simulate(model, until=1.0, inputs={"push": push}, tolerance=finer).report.notes
