"""A beam hung on a pin and drawn at any angle with any mesh swings down to where it hangs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.errors import LinearizationError

EFFECTS = (fc.Gravity(), fc.Flexible(), fc.LargeRotation())
LIGHT = replace(fc.Section.circular(fc.STEEL, 0.05), rhoA=1e-9, rhoJ=0.0, rhoI_y=0.0, rhoI_z=0.0)


def pendulum(angle: float, elements: int) -> fc.Structure:
    """3 kg at the end of a stiff bar of one metre, drawn at an angle from the vertical, in a plane."""
    rod = fc.Beam("rod", (0, 0, 0), (np.sin(angle), 0, -np.cos(angle)), LIGHT, elements=elements)
    bob = fc.PointMass("bob", rod.end, 3.0)
    joints = [fc.Support(rod.start, "u v w"), fc.Pin(rod.end, bob.node)]
    inputs, outputs = [fc.Force("push", rod.end, "x")], [fc.Position("x", rod.end, "x")]
    return fc.planar(fc.Structure([rod, bob], joints, inputs=inputs, outputs=outputs), "y")


@pytest.mark.parametrize("angle", [0.1, 0.6435, 1.0, -1.5])
@pytest.mark.parametrize("elements", [1, 4, 10, 11, 30])
def test_it_hangs_straight_down(angle, elements):
    rest = fc.equilibrium(fc.assemble(pendulum(angle, elements), EFFECTS))
    assert rest.stable
    assert rest.outputs["x"] == pytest.approx(0.0, abs=1e-6)
    assert rest.state.x[-2, 2] == pytest.approx(-1.0, abs=1e-6)


@pytest.mark.parametrize(("elements", "error"), [(1, 1e-8), (4, 1e-8), (20, 1e-8), (50, 1e-6), (200, 3e-6)])
def test_it_swings_as_a_pendulum_however_fine_the_mesh(elements, error):
    """ω² = g/L, L stretched by the weight; entries of K grow as the cube of the number of elements."""
    linear = fc.linearize(fc.assemble(pendulum(0.6435, elements), EFFECTS))
    length = 1.0 + 3.0 * 9.81 / LIGHT.EA
    assert linear.modes(1).omega_squared[0] == pytest.approx(9.81 / length, rel=error)
    assert linear.certificate.frequency_error < 2.0 * error  # last digits of places, a stretch of the rod, included
    poles = linear.to_ss().poles()
    assert np.abs(poles.imag).min() == pytest.approx(np.sqrt(9.81 / length), rel=error)


def test_a_swing_lost_in_rounding_is_refused_with_its_remedy():
    """A bar of 0.4 m diameter in 5 mm slices: K has entries of 5e16, whose last digit is 8 N/m."""
    thick = replace(fc.Section.circular(fc.STEEL, 0.2), rhoA=1e-9, rhoJ=0.0, rhoI_y=0.0, rhoI_z=0.0)
    rod = fc.Beam("rod", (0, 0, 0), (0, 0, -1), thick, elements=200)
    bob = fc.PointMass("bob", rod.end, 3.0)
    machine = fc.planar(fc.Structure([rod, bob], [fc.Support(rod.start, "u v w"), fc.Pin(rod.end, bob.node)]), "y")
    with pytest.raises(LinearizationError, match=r"lost in the rounding.*fewer elements, or a rigid part"):
        fc.linearize(fc.assemble(machine, EFFECTS))


@pytest.mark.parametrize("elements", [60, 250])
def test_the_kinetic_energy_of_its_modes_keeps_its_digits_in_double(elements):
    """Where φᵀ K φ has none left; both sums against extended precision."""
    linear = fc.linearize(fc.assemble(pendulum(0.6435, elements), EFFECTS))
    slowest = linear.modes(1).shapes[:, 0]
    lost = []
    for A in (linear.M.tocoo(), linear.K.tocoo()):
        terms = slowest.astype(np.longdouble)[A.row] * A.data * slowest[A.col]
        exact = float(terms.sum())
        lost.append(abs(float(slowest @ (A @ slowest)) - exact) / abs(exact))
    assert lost[0] < 1e-13
    assert lost[1] > 1e4 * lost[0]
