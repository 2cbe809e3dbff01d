"""D19: loads that turn with the machine: an unsymmetric stiffness, flutter and not divergence.

Beck's column: a cantilever under a thrust that stays tangent to its end has no other equilibrium near; its first two
frequencies meet at P L²/EI = 20.0509, and beyond they are a complex pair, one of which grows.
"""

from __future__ import annotations

import numpy as np
import pytest
from recorder import Absolute

import flexctrl as fc
from flexctrl.errors import LinearizationError, StructureError

PAGE = "hard"
SECTION = fc.Section(EA=1e6, EI_y=1.0, EI_z=1.0, GJ=1.0, rhoA=1.0, rhoJ=1e-3)
NONLINEAR = (fc.Flexible(), fc.LargeRotation())


def column(load: type, direction: str = "-x", elements: int = 10) -> fc.Model:
    beam = fc.Beam("beam", (0, 0, 0), (1, 0, 0), SECTION, elements=elements)
    planar = [fc.Support(node, held="w rx ry") for node in beam.nodes[1:]]
    structure = fc.Structure(
        [beam],
        [fc.Support(beam.start), *planar],
        inputs=[load("thrust", beam.end, direction)],
        outputs=[fc.Position("y", beam.end, "y"), fc.Rotation("turn", beam.end, "z")],
    )
    return fc.assemble(structure, NONLINEAR)


def poles(load: float, elements: int = 10) -> np.ndarray:
    model = column(fc.FollowerForce, elements=elements)
    found = fc.linearize(model, fc.equilibrium(model, inputs={"thrust": load})).damped_poles()
    return found[found.imag > 0][:2]


def test_becks_column(record):
    def apart(load: float) -> float:
        found = poles(load, 20)
        return float(abs(found[1].imag - found[0].imag))

    low, high = 20.0, 20.2
    for _ in range(12):
        low, high = (low, 0.5 * (low + high)) if apart(0.5 * (low + high)) < 1e-6 else (0.5 * (low + high), high)
    record(
        "D19 Beck's column, 20 elements: load at which the frequencies meet",
        ours=0.5 * (low + high),
        reference=20.0509,
        source="closed form (Beck 1952)",
        tolerance=1e-3,
    )
    record(
        "D19 Beck's column at P = 20: two real frequencies",
        ours=np.sort(poles(20.0, 20).imag),
        reference=[10.5289, 11.5106],
        source="closed form",
        tolerance=1e-3,
    )
    record(
        "D19 Beck's column at P = 20.2: frequencies of the pair apart",
        ours=apart(20.2),
        reference=0.0,
        source="a complex pair",
        tolerance=Absolute(1e-6),
    )
    record(
        "D19 Beck's column at P = 20.2: sum of the pair's growth rates; one grows, one decays",
        ours=float(poles(20.2, 20).real.sum()),
        reference=0.0,
        source="nothing dissipates",
        tolerance=Absolute(1e-6),
    )
    assert poles(20.2, 20).real.max() > 0.1


@pytest.mark.parametrize(("load", "flutters"), [(2.0, False), (10.0, False), (19.5, False), (20.3, True), (24.0, True)])
def test_a_column_under_a_following_thrust_flutters_beyond_twenty(load, flutters):
    growth = float(poles(load).real.max())
    assert (growth > 0.1) if flutters else (abs(growth) < 1e-5)


def test_a_dead_thrust_buckles_it_and_a_following_one_does_not():
    """At twice Euler's load the dead thrust has left the straight column; the following one bends nothing."""
    euler = np.pi**2 / 4
    dead = fc.equilibrium_path(column(fc.Force), load={"thrust": euler}, until=2.0)
    assert [p.factor for p in dead.branchings] == pytest.approx([1.0], rel=1e-3)
    following = poles(2.0 * euler)
    assert np.abs(following.real).max() < 1e-6


def test_the_certificate_names_the_load():
    model = column(fc.FollowerForce)
    linear = fc.linearize(model, fc.equilibrium(model, inputs={"thrust": 10.0}))
    assert linear.certificate.loads == ("thrust",)
    assert "(by thrust)" in str(linear.certificate)
    assert linear.certificate.taylor_slope > 1.9
    assert abs(linear.K - linear.K.T).max() == pytest.approx(10.0, rel=1e-6)
    with pytest.raises(LinearizationError, match="not symmetric"):
        linear.modes()


def test_without_load_the_stiffness_is_symmetric():
    model = column(fc.FollowerForce)
    linear = fc.linearize(model)
    assert abs(linear.K - linear.K.T).max() == 0.0
    assert linear.certificate.loads == ()


@pytest.mark.parametrize("load", [0.5, 2.0, 6.0])
def test_a_load_square_to_the_end_stays_square(load):
    """EI θ'' = −F cos(θ_L − θ) for a force square to the end section, integrated from the free end."""
    from scipy.integrate import solve_ivp
    from scipy.optimize import brentq

    def root(tip: float) -> float:
        """Angle at the clamp when the tip has turned by ``tip``; s from the tip inward."""
        bent = solve_ivp(
            lambda s, z: (-z[1], load * np.cos(tip - z[0])), (0.0, 1.0), (tip, 0.0), rtol=1e-10, atol=1e-12
        )
        return float(bent.y[0, -1])

    exact = brentq(root, 0.0, 3.0)
    model = column(fc.FollowerForce, "y", elements=20)
    rest = fc.equilibrium(model, inputs={"thrust": load})
    assert rest.outputs["turn"] == pytest.approx(exact, rel=2e-4)


def test_a_following_torque_about_the_axis_of_bending_is_the_fixed_one():
    fixed, following = (
        fc.equilibrium(column(load, "z"), inputs={"thrust": 2.0}).outputs for load in (fc.Torque, fc.FollowerTorque)
    )
    assert following["turn"] == pytest.approx(fixed["turn"], rel=1e-12)
    assert following["turn"] == pytest.approx(2.0, rel=1e-9)


def test_a_node_without_rotations_carries_no_load_that_turns():
    mass = fc.PointMass("mass", (0, 0, 0), 1.0)
    with pytest.raises(StructureError, match="FollowerForce 'push'"):
        fc.FollowerForce("push", mass.node, "x")


def test_a_thruster_flies_a_body_on_a_circle():
    """Pushed square to its path by a load that turns with it, it turns once in 2π/ω: v = F/(m ω)."""
    body = fc.RigidBody("body", (0, 0, 0), 2.0, (1.0, 1.0, 1.0))
    structure = fc.Structure(
        [body],
        [fc.Support(body.node, held="w rx ry")],
        inputs=[fc.FollowerForce("thrust", body.node, "y")],
        outputs=[fc.Position("x", body.node, "x"), fc.Position("y", body.node, "y")],
    )
    model = fc.assemble(structure, [fc.LargeRotation()])
    spin, thrust = 3.0, 12.0
    speed = thrust / (2.0 * spin)
    v = np.zeros(model.n)
    v[model.coordinate("body_0_rz")], v[model.coordinate("body_0_u")] = spin, speed
    run = fc.simulate(model, start=model.rest.with_(v=v), until=2.0 * np.pi / spin, inputs={"thrust": thrust})
    radius = speed / spin
    assert np.hypot(run["x"], run["y"] - radius) == pytest.approx(radius, rel=1e-2)
