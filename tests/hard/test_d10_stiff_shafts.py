"""D10: shafts so stiff that they would drown in K what they drive: k_θ to 1e12 N m/rad behind a reduction of 1000.

k_θ R² is 1e18 N m/rad where the arm bends at 1e4: the twist is a coordinate of its own, so that K has both.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

import flexctrl as fc
from flexctrl.errors import StructureError
from flexctrl.model.linearize import released

LENGTH, EI, LINE, TIP, ROTOR, RATIO = 2.5, 2e3, 2.0, 3.0, 1e-5, 1e3
SECTION = fc.Section(EA=1e9, EI_y=EI, EI_z=EI, GJ=EI, rhoA=LINE, rhoJ=1e-4)
LEVEL, TILTED = np.eye(3), Rotation.from_rotvec([0.7, -1.1, 0.4]).as_matrix()
STIFF = [(1e8, 20), (1e10, 100), (1e11, 20), (1e12, 6), (1e12, 20)]


def arm(stiffness: float, elements: int, turned: np.ndarray = LEVEL, axis: int = 2) -> fc.Structure:
    """A bending arm with 3 kg at its end, turned about an axis by a motor."""
    axes = [tuple(column) for column in turned.T]
    beam = fc.Beam("arm", (0, 0, 0), tuple(LENGTH * turned[:, 0]), SECTION, elements=elements, up=axes[2])
    tip, ground = fc.PointMass("tip", beam.end, TIP), fc.RigidBody("ground", (0, 0, 0), 1.0, (1, 1, 1))
    motor = fc.RotaryDrive("motor", beam.start, axis=axes[axis], stiffness=stiffness, ratio=RATIO, inertia=ROTOR)
    hinge = fc.Hinge(ground.node, beam.start, axis=axes[axis])
    return fc.Structure(
        [beam, tip, ground],
        [fc.Support(ground.node), hinge, fc.Pin(beam.end, tip.node)],
        drives=[motor],
        inputs=[fc.MotorTorque("torque", motor)],
        outputs=[fc.DriveAngle("angle", motor), fc.Position("y", beam.end, axes[1])],
    )


def linear(stiffness: float, elements: int, turned: np.ndarray = LEVEL, shaft: bool = True) -> fc.LinearModel:
    bent = fc.Flexible() if shaft else fc.BeamFlexibility()
    return fc.linearize(fc.assemble(arm(stiffness, elements, turned), [bent, fc.LargeRotation()]))


def turning(stiffness: float) -> np.ndarray:
    """The first two frequencies [rad/s] of a bar with a rotor behind a spring at its root, and a mass at its end."""
    k, J = stiffness * RATIO**2, ROTOR * RATIO**2

    def left(b: float) -> float:
        """Shear at the end that its mass does not explain, of W = A sin bx + B sinh bx + C (cos bx − cosh bx)."""
        x, square = b * LENGTH, EI * b**4 / LINE
        root = k * J * square / (k - J * square)
        columns = []
        for A, B in ((1.0, 0.0), (0.0, 1.0)):
            C = root * (A + B) / (2.0 * EI * b)
            W = A * np.sin(x) + B * np.sinh(x) + C * (np.cos(x) - np.cosh(x))
            bent = -A * np.sin(x) + B * np.sinh(x) - C * (np.cos(x) + np.cosh(x))
            sheared = -A * np.cos(x) + B * np.cosh(x) + C * (np.sin(x) - np.sinh(x))
            columns.append((bent, EI * b**3 * sheared + TIP * square * W))
        return float(np.linalg.det(np.array(columns)) * (k - J * square) / np.cosh(x) ** 2)

    b = np.linspace(1e-3, 8.0, 8001) / LENGTH
    signs = np.sign([left(x) for x in b])
    roots = [brentq(left, b[i], b[i + 1], xtol=1e-15) for i in np.flatnonzero(np.diff(signs))]
    return np.sqrt(EI / LINE) * np.array(roots[:2]) ** 2


@pytest.mark.parametrize("turned", [LEVEL, TILTED], ids=["level", "tilted"])
@pytest.mark.parametrize("stiffness", [1e1, 1e4, 1e6, 1e8, 1e10, 1e12])
def test_frequencies_in_the_plane_are_those_of_a_bar_on_a_rotor_behind_a_spring(stiffness, turned):
    found = linear(stiffness, 40, turned).modes(12)
    near = [found.omega[np.argmin(np.abs(found.omega - w))] for w in turning(stiffness)]
    assert found.rigid == 1
    assert near == pytest.approx(turning(stiffness), rel=1e-5)


@pytest.mark.parametrize("turned", [LEVEL, TILTED], ids=["level", "tilted"])
@pytest.mark.parametrize(("stiffness", "elements"), STIFF)
def test_all_that_a_linear_model_gives_is_that_behind_a_rigid_shaft(stiffness, elements, turned):
    elastic, rigid = (linear(stiffness, elements, turned, shaft) for shaft in (True, False))
    assert "motor_twist" in elastic.coordinates
    assert elastic.certificate.frequency_error < 1e-7
    assert elastic.modes(10).rigid == 1
    assert elastic.modes(10).omega[1:] == pytest.approx(rigid.modes(10).omega[1:], rel=1e-6)
    assert elastic.condense().modes(10).omega[1:] == pytest.approx(rigid.modes(10).omega[1:], rel=1e-6)
    omega = np.array([5.0, 15.0, 30.0])
    answers = [np.asarray(m.frequency_response(omega).values) for m in (elastic, rigid)]
    assert np.abs(answers[0] - answers[1]).max(axis=0) == pytest.approx(0.0, abs=1e-4 * np.abs(answers[1]).max())
    poles = elastic.damped_poles(8), rigid.damped_poles(8)
    assert np.sort(poles[0].imag) == pytest.approx(np.sort(poles[1].imag), rel=1e-6, abs=1e-9)
    runs = [fc.simulate(m, until=0.5, inputs={"torque": 0.05}, every=0.01) for m in (elastic, rigid)]
    assert runs[0].report.energy_residual < 1e-6
    assert runs[0]["y"] == pytest.approx(runs[1]["y"], rel=1e-6, abs=1e-9)
    assert runs[0]["angle"] == pytest.approx(runs[1]["angle"], rel=1e-6, abs=1e-6)


def test_the_runs_of_the_machine_and_of_its_linear_model_agree():
    """A torque of 0.5 mN m for half a second: 4 mm at the end."""
    model = fc.assemble(arm(1e12, 20, TILTED), [fc.Flexible(), fc.LargeRotation()])
    runs = [fc.simulate(m, until=0.5, inputs={"torque": 5e-4}, every=0.05) for m in (model, fc.linearize(model))]
    assert runs[0]["y"] == pytest.approx(runs[1]["y"], abs=2e-6)


def test_damping_of_strain_leaves_what_is_driven_as_it_is_behind_a_rigid_shaft():
    """β k R² is 1e14 N m s/rad; poles are the roots of s² + β ω² s + ω²."""
    damping, machine = fc.RayleighDamping(0.0, 1e-4), arm(1e12, 10, TILTED)
    poles = fc.linearize(fc.assemble(machine, [fc.Flexible(), fc.LargeRotation(), damping])).damped_poles(8)
    squares = linear(1e12, 10, shaft=False).modes(4).omega_squared[1:]
    expected = [root for w2 in squares for root in np.roots([1.0, 1e-4 * w2, w2])]
    assert np.count_nonzero(poles == 0.0) == 2
    assert np.sort_complex(poles[poles != 0.0]) == pytest.approx(np.sort_complex(expected), rel=1e-6)


@pytest.mark.parametrize("stiffness", [1e8, 1e10, 1e12])
def test_a_shaft_that_bears_weight_turns_with_what_it_drives(stiffness):
    """Released from where the motor holds the arm level: geometric stiffness of the torque, all 62 modes."""
    found = []
    for bent, name in ((fc.Flexible(), "motor_source"), (fc.BeamFlexibility(), "arm_0_ry")):
        model = fc.assemble(arm(stiffness, 10, axis=1), [bent, fc.LargeRotation(), fc.Gravity()])
        found.append(released(fc.equilibrium(model, hold={name: 0.0})).modes().omega_squared)
    assert found[0][:40] == pytest.approx(found[1][:40], rel=1e-6, abs=1e-6)


def test_energies_are_those_of_the_parts():
    shares = linear(1e12, 10, TILTED).modes().strain_shares
    assert shares["motor"][1:5] == pytest.approx(0.0, abs=1e-9)
    assert shares["motor"][-1] == pytest.approx(1.0, abs=1e-6)


def test_a_run_starts_from_a_state_of_the_machine():
    """Turned as a whole by 1e-3 rad, the motor along with it: nothing moves."""
    model = fc.assemble(arm(1e12, 10), [fc.Flexible(), fc.LargeRotation()])
    step = np.zeros(model.n)
    for i, name in enumerate(model.coordinates):
        if name.endswith("_v"):
            step[i] = 1e-3 * LENGTH * int(name.split("_")[1]) / 10 if name.startswith("arm") else 1e-3 * LENGTH
        if name.endswith("_rz"):
            step[i] = 1e-3
    step[model.coordinate("motor_source")] = 1e-3 * RATIO
    state = model.advance(model.rest, step, np.zeros(model.n), 0.0)
    run = fc.simulate(fc.linearize(model), start=state, until=0.1, every=0.05)
    assert run["angle"] == pytest.approx(1.0, rel=1e-6)
    assert run["y"] == pytest.approx(2.5e-3, rel=1e-3)


def test_small_motion_about_another_place_is_refused_with_the_remedy():
    with pytest.raises(StructureError, match=r"motor \(1e\+12 N m/rad\).*leave ShaftElasticity out"):
        fc.assemble(arm(1e12, 10), [fc.Flexible(), fc.GeometricStiffness()])
