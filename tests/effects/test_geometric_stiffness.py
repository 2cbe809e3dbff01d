"""Small motion about a loaded equilibrium equals the linearised large motion."""

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.cranes import bridge_crane

BASE = [fc.Gravity(), fc.Flexible(), fc.RayleighDamping(0.01, 1e-3)]


@pytest.fixture(scope="module")
def models():
    crane = bridge_crane()
    return fc.assemble(crane, [*BASE, fc.LargeRotation()]), fc.assemble(crane, [*BASE, fc.GeometricStiffness()])


def test_matrices_are_those_of_the_linearised_machine(models):
    large, small = models
    linear = fc.linearize(large)
    for ours, theirs in ((small.stiffness(), linear.K), (small.mass(), linear.M)):
        assert abs(ours - theirs).max() <= 1e-12 * abs(theirs).max()
    again = fc.linearize(small)
    np.testing.assert_allclose(again.modes().omega, linear.modes().omega, rtol=1e-9, atol=1e-9)


def test_it_rests_at_the_equilibrium_of_the_large_motion(models):
    large, small = models
    np.testing.assert_allclose(small.rest.x, fc.equilibrium(large).state.x, atol=1e-12)
    assert np.abs(fc.equilibrium(small).state.q).max() < 1e-12


def test_a_small_push_moves_both_alike(models):
    until = 4.0
    runs = [
        fc.simulate(
            m,
            until=until,
            start=fc.equilibrium(m),
            inputs={"left_torque": 1e-3},
            every=0.1,
            tolerance=fc.Tolerance(1e-7, 1e-12),
        )
        for m in models
    ]
    for name in ("sway", "travel", "left_angle"):
        first, second = (r[name] - r[name][0] for r in runs)
        np.testing.assert_allclose(second, first, atol=2e-4 * np.abs(first).max())


def test_modal_damping_is_counted_once():
    effects = [fc.Gravity(), fc.Flexible(), fc.ModalDamping(0.02)]
    crane = bridge_crane()
    ratios = [
        fc.linearize(fc.assemble(crane, [*effects, e])).modes().damping
        for e in (fc.LargeRotation(), fc.GeometricStiffness())
    ]
    np.testing.assert_allclose(ratios[0], ratios[1], rtol=1e-6, atol=1e-9)


def test_beside_large_rotation_it_is_refused():
    with pytest.raises(fc.errors.StructureError, match="part of LargeRotation"):
        fc.assemble(bridge_crane(), [*BASE, fc.LargeRotation(), fc.GeometricStiffness()])
