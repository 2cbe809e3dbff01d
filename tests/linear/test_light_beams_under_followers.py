"""Poles under follower loads where light, stiff freedoms stand beside heavy, soft ones: the limit is without mass."""

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.linear.model import LinearModel

EI, LENGTH, MASS, INERTIA = 100.0, 1.0, 5.0, 0.02


def column(push: float, rhoA: float) -> LinearModel:
    """A column, clamped below, with a body on top that a thrust follows; ``push`` in units of EI/L²."""
    section = fc.Section(EA=1e7, EI_y=EI, EI_z=EI, GJ=EI, rhoA=rhoA, rhoJ=0.0)
    beam = fc.Beam("beam", (0, 0, 0), (0, 0, LENGTH), section, elements=4)
    body = fc.RigidBody("body", beam.end, MASS, (INERTIA,) * 3)
    drawn = fc.Structure(
        [beam, body],
        [fc.Support(beam.start), fc.Weld(beam.end, body.node)],
        inputs=[fc.FollowerForce("thrust", beam.end, "-z"), fc.Force("f", beam.end, "x")],
        outputs=[fc.Position("x", beam.end, "x")],
    )
    model = fc.assemble(fc.planar(drawn, "y"), [fc.Flexible(), fc.LargeRotation()])
    return fc.linearize(model, inputs={"thrust": push * EI / LENGTH**2})


def closed_form(push: float) -> np.ndarray:
    """ω² of a massless column with a body on top: M ω² x = K x, K of the beam-column under a thrust that follows.

    EI w⁗ + P w″ = 0, w(0) = w′(0) = 0, so w = a (1 − cos kx) + b (kx − sin kx); at the top the thrust has the
    direction of the axis, so that −EI w‴ is the force that holds it, EI w″ the moment.
    """
    k = np.sqrt(push) / LENGTH
    s, c = np.sin(k * LENGTH), np.cos(k * LENGTH)
    places = np.array([[1.0 - c, k * LENGTH - s], [k * s, k * (1.0 - c)]])
    forces = EI * k**2 * np.array([[k * s, -k * c], [c, s]])
    return np.sort_complex(np.linalg.eigvals(np.diag([1 / MASS, 1 / INERTIA]) @ forces @ np.linalg.inv(places)))


@pytest.mark.parametrize("push", [5.0, 15.0])
@pytest.mark.parametrize("rhoA", [0.0, 1e-10, 1e-8])
def test_poles_are_those_of_the_massless_column(push, rhoA):
    linear = column(push, rhoA)
    poles = linear.damped_poles()
    found = np.sort(np.abs(poles[poles.imag > 0]))[:2]
    exact = np.sqrt(closed_form(push).real)
    np.testing.assert_allclose(found, exact, rtol=4e-3)
    np.testing.assert_allclose(np.sort(np.abs(linear.to_ss().poles()))[:4], np.repeat(found, 2), rtol=1e-7)
    omega = np.array([0.3, 3.0])
    response = linear.frequency_response(omega).channel("x", "f")
    np.testing.assert_allclose(response, linear.to_ss()(1j * omega)[0, 1], rtol=1e-7)
