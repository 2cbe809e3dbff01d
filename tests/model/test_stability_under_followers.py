"""The verdict on an equilibrium under loads without a potential: flutter and divergence by poles, not by pivots."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from scipy.optimize import brentq

import flexctrl as fc
from flexctrl.errors import LinearizationError

SECTION = fc.Section(EA=1e6, EI_y=1.0, EI_z=1.0, GJ=1.0, rhoA=1.0, rhoJ=1e-3)
NONLINEAR = (fc.Flexible(), fc.LargeRotation())
BECK = 20.0509
"""Flutter load of the clamped column under a tangential thrust, in EI/L² (M. Beck 1952)."""


@cache
def column(stiffer: float = 1.0, planar: bool = True) -> fc.Model:
    section = fc.Section(*(stiffer * k for k in (SECTION.EA, SECTION.EI_y, SECTION.EI_z, SECTION.GJ)), 1.0, 1e-3)
    beam = fc.Beam("beam", (0, 0, 0), (1, 0, 0), section, elements=10)
    held = [fc.Support(node, held="w rx ry") for node in beam.nodes[1:]] if planar else []
    structure = fc.Structure(
        [beam],
        [fc.Support(beam.start), *held],
        inputs=[fc.FollowerForce("thrust", beam.end, "-x"), fc.Force("dead", beam.end, "-x")],
        outputs=[fc.Position("y", beam.end, "y")],
    )
    return fc.assemble(structure, NONLINEAR)


@pytest.mark.parametrize(("stiffer", "planar"), [(1.0, True), (1.0, False), (1e4, True)])
def test_a_column_is_stable_up_to_becks_load_and_not_beyond(stiffer, planar):
    """Pivots of the symmetric part turn negative at half of it."""
    below, above = (
        fc.equilibrium(column(stiffer, planar), inputs={"thrust": share * BECK * stiffer}) for share in (0.999, 1.001)
    )
    assert below.stable
    assert above.unstable == (1 if planar else 2)


def test_a_path_tells_where_it_flutters():
    path = fc.equilibrium_path(column(), {"thrust": BECK}, until=1.3)
    assert not path.branchings
    np.testing.assert_array_equal(path.unstable, np.where(path.factor < 1.0, 0, 1))


@pytest.mark.parametrize("share", [0.1, 0.3, 0.45])
def test_a_thrust_that_follows_in_part_makes_it_diverge(share):
    """A share α of the thrust follows: EI w⁗ + P w″ = 0 has a bent shape where cos kL = −α/(1 − α), P = EI k²."""
    critical = np.arccos(-share / (1.0 - share)) ** 2
    for factor, expected in ((0.995, 0), (1.005, 1)):
        thrust = factor * critical
        rest = fc.equilibrium(column(), inputs={"thrust": share * thrust, "dead": (1.0 - share) * thrust})
        assert rest.unstable == expected


def test_the_onset_is_that_of_the_massless_column_in_closed_form():
    """Two freedoms on a massless beam-column: they flutter where the roots ω² meet."""
    mass, inertia = 5.0, 0.02
    beam = fc.Beam("beam", (0, 0, 0), (1, 0, 0), fc.Section(1e5, 1.0, 1.0, 1.0, 0.0, 0.0), elements=8)
    body = fc.RigidBody("body", beam.end, mass, (inertia,) * 3)
    drawn = fc.Structure(
        [beam, body],
        [fc.Support(beam.start), fc.Weld(beam.end, body.node)],
        inputs=[fc.FollowerForce("thrust", beam.end, "-x")],
    )
    model = fc.assemble(fc.planar(drawn, "z"), NONLINEAR)

    def discriminant(push: float) -> float:
        k = np.sqrt(push)
        s, c = np.sin(k), np.cos(k)
        places = np.array([[1.0 - c, k - s], [k * s, k * (1.0 - c)]])
        forces = push * np.array([[k * s, -k * c], [c, s]])
        A = np.diag([1.0 / mass, 1.0 / inertia]) @ forces @ np.linalg.inv(places)
        return float(np.trace(A) ** 2 - 4.0 * np.linalg.det(A))

    onset = brentq(discriminant, 15.0, 20.0)
    assert fc.equilibrium(model, inputs={"thrust": 0.99 * onset}).stable
    assert fc.equilibrium(model, inputs={"thrust": 1.01 * onset}).unstable == 1


@pytest.mark.parametrize("axis", [(1, 0, 0), (0.6, 0.0, 0.8), (1, 2, 2)])
def test_free_motion_between_two_thrusts_does_not_grow_but_bending_does_in_both_planes(axis):
    beam = fc.Beam("beam", (0, 0, 0), tuple(np.array(axis) / np.linalg.norm(axis)), SECTION, elements=6)
    back = tuple(-k for k in axis)
    inputs = [fc.FollowerForce("push", beam.end, back), fc.FollowerForce("back", beam.start, axis)]
    model = fc.assemble(fc.Structure([beam], [], inputs=inputs), NONLINEAR)
    assert fc.equilibrium(model, inputs={"push": 3.0, "back": 3.0}).stable
    assert fc.equilibrium(model, inputs={"push": 60.0, "back": 60.0}).unstable == 2


def test_what_poles_cannot_tell_is_refused_and_not_called_stable():
    section = fc.Section(EA=1e6, EI_y=1.0, EI_z=1.0, GJ=1.0, rhoA=1.0, rhoJ=1e-3)
    beam = fc.Beam("beam", (0, 0, 0), (1, 0, 0), section, elements=350)
    held = [fc.Support(node, held="w rx ry") for node in beam.nodes[1:]]
    structure = fc.Structure(
        [beam], [fc.Support(beam.start), *held], inputs=[fc.FollowerForce("thrust", beam.end, "-x")]
    )
    rest = fc.equilibrium(fc.assemble(structure, NONLINEAR), inputs={"thrust": 15.0})
    with pytest.raises(LinearizationError, match="1050 freedoms"):
        assert rest.stable
