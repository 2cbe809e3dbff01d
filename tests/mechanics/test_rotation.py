"""Rotations: against scipy, near zero, near π, after many turns."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

from flexctrl.mechanics import rotation

ANGLES = [0.0, 1e-12, 1e-7, 1e-5, 0.99e-4, 1.01e-4, 1e-3, 0.99e-3, 1.01e-3, 0.03, 0.0317, 0.1, 1.0, 2.0, 3.0]
AXES = np.array([[1.0, 0, 0], [0, 0, -1.0], [2.0, -1.0, 2.0], [1e-3, 1.0, 0.5]])
AXES /= np.linalg.norm(AXES, axis=1)[:, None]


def skew(v):
    return np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])


def function(make, *shapes):
    symbols = [ca.SX.sym(f"a{i}", *shape) for i, shape in enumerate(shapes)]
    compiled = ca.Function("f", symbols, [make(*symbols)])
    return lambda *values: np.array(compiled(*values)).squeeze()


VECTOR = function(rotation.rotation_vector, (3, 3))
MATRIX = function(rotation.rotation_of, (3,))
NEAR = function(rotation.near_rotation_of, (3,))
BEND = function(rotation.bend_vector, (3, 3))
INVERSE = function(rotation.inverse_tangent, (3,), (3,))


@pytest.mark.parametrize("axis", AXES)
@pytest.mark.parametrize("angle", ANGLES)
def test_rotation_vector_undoes_the_exponential(axis, angle):
    theta = angle * axis
    for vector, near in ((VECTOR, 1e-13), (BEND, 4e-13)):
        assert np.allclose(vector(expm(skew(theta))), theta, rtol=0, atol=near + 1e-15 * angle)


@pytest.mark.parametrize("angle", [0.0, 1e-9, 0.01, 0.3, 1.0, 1.5, 1.6, 2.0, 2.5, 3.1])
def test_the_length_of_a_rotation_vector_is_right_to_the_last_digits(angle):
    """Of a turn about one axis, whose sine and cosine are all that is rounded."""
    R = np.array([[np.cos(angle), -np.sin(angle), 0.0], [np.sin(angle), np.cos(angle), 0.0], [0.0, 0.0, 1.0]])
    sharp = 4e-16 / (1.0 + np.cos(angle))
    assert VECTOR(R) == pytest.approx([0.0, 0.0, angle], rel=1e-14, abs=0)
    assert BEND(R) == pytest.approx([0.0, 0.0, angle], rel=5e-16 + sharp, abs=0)


@pytest.mark.parametrize("axis", AXES)
@pytest.mark.parametrize("angle", [a for a in ANGLES if a <= rotation.NEAR] + [rotation.NEAR])
def test_polynomials_turn_as_the_exponential_does(axis, angle):
    """For all components within NEAR: up to 1.39 rad."""
    theta = angle * axis / np.abs(axis).max()
    exact = Rotation.from_rotvec(theta).as_matrix()
    assert np.allclose(NEAR(theta), exact, rtol=0, atol=3e-16)
    assert np.allclose(NEAR(theta), MATRIX(theta), rtol=0, atol=5e-16)


@pytest.mark.parametrize(("gap", "tolerance"), [(1e-2, 1e-12), (1e-4, 1e-10), (1e-6, 1e-8)])
def test_rotation_vector_near_half_a_turn(gap, tolerance):
    """The direction is in the sine, so digits go as the gap closes: 1e-16 / gap."""
    for axis in AXES:
        theta = (np.pi - gap) * axis
        assert np.allclose(VECTOR(expm(skew(theta))), theta, rtol=0, atol=tolerance)


def test_rotation_vector_has_finite_slopes_at_no_rotation():
    R = ca.SX.sym("R", 3, 3)
    # R = 1 + s×: only the skew part counts
    s = np.array([0.3, -0.7, 0.2])
    for vector in (rotation.rotation_vector, rotation.bend_vector):
        slope = ca.Function("slope", [R], [ca.jacobian(vector(R), ca.vec(R))])
        assert np.allclose(np.array(slope(np.eye(3))) @ skew(s).T.ravel(), s)


def tangent(theta):
    """T(θ) = 1 + (1 − cos)/θ² θ× + (θ − sin)/θ³ θ×²: rate of the rotation vector to spatial spin."""
    angle, S = np.linalg.norm(theta), skew(theta)
    if angle < 1e-4:
        return np.eye(3) + S / 2 + S @ S / 6
    return np.eye(3) + (1 - np.cos(angle)) / angle**2 * S + (angle - np.sin(angle)) / angle**3 * S @ S


@pytest.mark.parametrize("axis", AXES)
@pytest.mark.parametrize("angle", [*ANGLES, np.pi - 1e-3, np.pi])
def test_inverse_tangent_is_the_inverse_of_the_tangent_transposed(axis, angle):
    theta, v = angle * axis, np.array([0.4, -1.1, 0.9])
    assert np.allclose(INVERSE(theta, v), np.linalg.solve(tangent(theta).T, v), rtol=0, atol=1e-11)


def test_tangent_maps_the_rate_of_the_rotation_vector_to_the_spin():
    """T above, and so the meaning of inverse_tangent, from a difference of rotations."""
    theta, rate, h = np.array([0.8, -0.5, 1.1]), np.array([0.2, 0.3, -0.4]), 1e-6
    turned = Rotation.from_rotvec(theta + h * rate) * Rotation.from_rotvec(theta - h * rate).inv()
    assert np.allclose(turned.as_rotvec() / (2 * h), tangent(theta) @ rate, atol=1e-9)


@pytest.mark.parametrize("angle", [*ANGLES, np.pi, 2 * np.pi, 4 * np.pi, 100.0])
def test_exponentials_are_rotations(angle):
    theta = angle * AXES
    expected = Rotation.from_rotvec(theta).as_matrix()
    assert np.allclose(rotation.exponential(theta), expected, rtol=0, atol=2e-14 * max(1.0, angle))
    for vector, matrix in zip(theta, expected, strict=True):
        assert np.allclose(MATRIX(vector), matrix, rtol=0, atol=2e-14 * max(1.0, angle))


def test_exponentials_of_nothing():
    assert rotation.exponential(np.zeros((0, 3))).shape == (0, 3, 3)


def test_logarithm_undoes_exponential_up_to_half_a_turn():
    theta = np.random.default_rng(0).normal(size=(50, 3))
    theta *= np.linspace(0, np.pi, 50)[:, None] / np.linalg.norm(theta, axis=1)[:, None]
    assert np.allclose(
        rotation.exponential(rotation.logarithm(rotation.exponential(theta))), rotation.exponential(theta)
    )


def test_drift_from_orthonormality_is_squared():
    """One Newton step on E = RᵀR − 1 leaves 3/4 E² to leading order."""

    def drift(R):
        return np.linalg.norm(np.swapaxes(R, 1, 2) @ R - np.eye(3), ord=2, axis=(1, 2))

    R = rotation.exponential(np.random.default_rng(1).normal(size=(20, 3)))
    drifted = R + 1e-4 * np.random.default_rng(2).normal(size=R.shape)
    assert (drift(rotation.orthonormal(drifted)) < 0.8 * drift(drifted) ** 2).all()


def test_a_thousand_turns_in_steps_come_back():
    R, steps = np.eye(3)[None], 5000
    axis = AXES[2:3]
    for _ in range(steps):
        R = rotation.orthonormal(rotation.exponential(axis * (2 * np.pi * 1000 / steps)) @ R)
    assert np.allclose(R[0], np.eye(3), atol=1e-11)


def test_cross_broadcasts_as_numpy_does():
    rng = np.random.default_rng(3)
    a, b = rng.normal(size=(4, 1, 3)), rng.normal(size=(5, 3))
    assert np.array_equal(rotation.cross(a, b), np.cross(a, b))
