"""Transmission zeros against held structures, closed forms and extended precision."""

from __future__ import annotations

import numpy as np
import pytest
from plants import cantilever, chain, constrained_frequencies, crane, plant

from flexctrl.study.zeros import sensor_choices, zeros

CRANES = [
    (3.355, 1.0, 0.5, 5.046582, 4.429447),
    (1.155, 1.0, 0.5, 6.050373, 4.429447),
    (59008.0, 65000.0, 25.0, 0.908100, 0.626418),
    (59008.0, 15000.0, 25.0, 0.701533, 0.626418),
]


@pytest.mark.parametrize(("trolley", "load", "rope", "pole", "zero"), CRANES)
def test_cranes_of_the_reference(trolley, load, rope, pole, zero):
    """Case C5: (l s² + g)/(s² (M l s² + (M + m) g)) and −1/(M l s² + (M + m) g)."""
    linear = crane(trolley, load, rope)
    poles = linear.damped_poles()
    assert (poles[:2] == 0).all()
    np.testing.assert_allclose(abs(poles[2:]), pole, rtol=1e-6)
    to_trolley = zeros(linear, ["force"], ["trolley"])
    np.testing.assert_allclose(to_trolley.finite, [-1j * zero, 1j * zero], rtol=1e-6, atol=1e-9)
    assert to_trolley.infinite == 2
    # the sway does not see the trolley's free motion: −1/(M l s² + (M + m) g) has no zero
    to_sway = zeros(linear, ["force"], ["sway"])
    assert len(to_sway.finite) == 0
    assert to_sway.infinite == 2
    # the load (x + l θ) moves as g/(s² (M l s² + (M + m) g)): no finite zero
    assert zeros(linear, ["force"], ["load"]).infinite == 4


@pytest.mark.parametrize("elements", [4, 10, 25])
def test_collocated_zeros_are_the_frequencies_of_the_held_structure(elements):
    linear = cantilever(elements)
    found = zeros(linear, outputs=["tip"])
    held = constrained_frequencies(linear, linear.Cq[0].argmax())
    upper = found.finite[found.finite.imag > 0]
    np.testing.assert_allclose(upper.imag, held, rtol=1e-9)
    assert abs(upper.real).max() < 1e-9 * held.max()
    assert found.infinite == 2


@pytest.mark.parametrize("sensor", [1, 2, 5, 12, 20])
def test_a_chain_has_the_zeros_of_the_masses_beyond_its_sensor(sensor):
    """Force on mass 1, position of mass j: the numerator is det of the chain beyond j, times kʲ⁻¹."""
    masses = 20
    linear = chain(masses)
    found = zeros(linear, outputs=[f"x{sensor}"])
    beyond = linear.K.toarray()[sensor:, sensor:]
    exact = np.sqrt(np.linalg.eigvalsh(beyond)) if sensor < masses else np.zeros(0)
    assert found.infinite == 2 * sensor
    np.testing.assert_allclose(found.finite[found.finite.imag > 0].imag, exact, rtol=1e-10)


def test_damped_chain_has_the_zero_of_its_dampers():
    """Stiffness-proportional damping: each spring crossed brings the real zero −k/c."""
    found = zeros(chain(8, beta=0.02), outputs=["x2"])
    assert found.infinite == 3
    assert abs(found.finite + 50.0).min() < 1e-6


def extended_zeros(linear, output: int) -> np.ndarray:
    """Zeros of an undamped force–position pair from 60-digit arithmetic: Wᵀ(K − λM)N without row and column."""
    mpmath = pytest.importorskip("mpmath", reason="extended precision needs mpmath")
    mpmath.mp.dps = 60
    row, column = linear.B[:, 0].argmax(), linear.Cq[output].argmax()
    K, M = (np.delete(np.delete(A.toarray(), row, 0), column, 1) for A in (linear.K, linear.M))
    pencil = mpmath.inverse(mpmath.matrix(M.tolist())) * mpmath.matrix(K.tolist())
    roots = mpmath.eig(pencil, left=False, right=False)
    return np.array([complex(mpmath.sqrt(-x)) for x in roots])


@pytest.mark.parametrize(("elements", "output"), [(6, 1), (10, 1), (10, 2)])
def test_noncollocated_zeros_and_their_uncertainty(elements, output):
    """Every zero lies within its stated uncertainty of the exact one; the low ones are right to 1e-10."""
    linear = cantilever(elements)
    exact = extended_zeros(linear, output)
    exact = np.concatenate([exact, -exact])
    found = zeros(linear, outputs=[linear.outputs[output]])
    miss = abs(found.finite[:, None] - exact).min(axis=1) / abs(found.finite)
    assert (miss <= np.maximum(found.uncertainty, 1e-14)).all()
    assert (miss[:8] < 1e-10).all()
    assert len(found.nonminimum_phase) > 0


def test_python_control_misses_what_is_found_here():
    """Design fact: in [q; q'] form SLICOT's non-collocated zeros of a stiff beam are wrong, without a word."""
    pytest.importorskip("slycot", reason="without the extra [slicot] control takes scipy's zeros, which are right")
    from flexctrl.linear.statespace import PhysicalForm

    linear = cantilever(20).select(outputs=["middle"])
    found = zeros(linear).finite
    lowest = found[0].real
    np.testing.assert_allclose(abs(lowest), 21.7567478307, rtol=1e-9)
    theirs = linear.to_ss(PhysicalForm()).zeros()
    assert abs(abs(theirs.real) - abs(lowest)).min() > 1e-6 * abs(lowest)


def test_zeros_of_two_channels_together():
    """Both ends of a mass held by both outputs: no dynamics is left, so there are no zeros."""
    linear = plant(
        np.eye(3), np.diag([1.0, 4.0, 9.0]), np.eye(3)[:, :2], np.eye(3)[:2], inputs=("a", "b"), outputs=("c", "d")
    )
    found = zeros(linear)
    np.testing.assert_allclose(np.sort(found.finite.imag), [-3.0, 3.0], rtol=1e-12)
    assert found.infinite == 4


def test_acceleration_like_feedthrough_has_as_many_zeros_as_poles():
    from dataclasses import replace

    linear = replace(chain(3, beta=0.1).select(outputs=["x1"]), D=np.array([[2.0]]))
    found = zeros(linear)
    assert found.infinite == 0
    s = found.finite
    value = [
        linear.Cq @ np.linalg.solve((z**2 * linear.M + z * linear.C + linear.K).toarray(), linear.B) + 2 for z in s
    ]
    assert abs(np.array(value)).max() < 1e-10


def test_sensor_choices_are_labelled():
    linear = cantilever(10)
    tip, middle, fifth = sensor_choices(linear)
    assert (tip.collocated, tip.in_phase, tip.first_flip) == (True, True, np.inf)
    assert not middle.collocated
    np.testing.assert_allclose(middle.first_flip, linear.modes().omega[1], rtol=1e-9)
    assert sensor_choices(linear, below=10.0)[1].in_phase
    assert not fifth.in_phase


def test_repeated_and_rigid_modes_are_judged_together():
    """Two free masses side by side: each rigid mode alone has a sign that means nothing."""
    linear = plant(np.eye(2), np.zeros((2, 2)), [[1.0], [0.5]], [[1.0, 0.2]], inputs=("f",), outputs=("y",))
    label = sensor_choices(linear)[0]
    assert label.in_phase
    assert not label.collocated
