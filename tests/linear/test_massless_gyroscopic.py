"""Massless freedoms that velocities of others push: condensed exactly, as the limit of vanishing mass."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
import scipy.linalg as la
import scipy.sparse as sp

import flexctrl as fc
from flexctrl.errors import LinearizationError, MechanismError
from flexctrl.linear.condense import Freedom
from flexctrl.linear.model import LinearModel

AXES = [(1.0, 0.0, 0.0), (0.6, 0.8, 0.0), (0.6, 0.0, 0.8)]


def machine(axis: tuple[float, ...], rhoJ: float = 0.0, elements: int = 1, held: str = "") -> fc.Model:
    """A steel rod on a turntable; it has no rotary inertia about its own axis."""
    area, bending = np.pi * 0.02**2, np.pi * 0.02**4 / 4
    section = fc.Section(2.1e11 * area, 2.1e11 * bending, 2.1e11 * bending, 1.6e11 * bending, 7850 * area, rhoJ)
    rod = fc.Beam("rod", (0.1, 0, 0), (0.1 + axis[0], axis[1], axis[2]), section, elements=elements)
    supports = [fc.Support(rod.start, held), fc.Support(rod.end, held)] if held else [fc.Support(rod.start)]
    inner = rod.node(elements // 2 + elements % 2)
    inputs = [fc.Force("push", inner, "z"), fc.Torque("twist", inner, "x")]
    outputs = [fc.Position("z", inner, "z"), fc.Velocity("rise", inner, "z"), fc.Rotation("turn", inner, "x")]
    structure = fc.Structure([rod], supports, inputs=inputs, outputs=outputs)
    return fc.assemble(structure, [fc.Flexible(), fc.LargeRotation(), fc.RotatingFrame((0, 0, 20.0))])


@cache
def blade(axis: tuple[float, ...], rhoJ: float = 0.0, elements: int = 1) -> LinearModel:
    return fc.linearize(machine(axis, rhoJ, elements))


def planted(seed: int, flung: bool = False) -> LinearModel:
    """Random M, K > 0 and skew C, in mixed coordinates, with two massless directions that C pushes and no input."""
    rng = np.random.default_rng(seed)
    n, gone = 8, 2
    M, K = np.zeros((n, n)), rng.standard_normal((n, n))
    heavy = rng.standard_normal((n - gone, n - gone))
    M[gone:, gone:] = heavy @ heavy.T + np.eye(n - gone)
    skew = 3.0 * rng.standard_normal((n, n))
    C = skew - skew.T
    C[:gone, :gone] = 0.0
    B = rng.standard_normal((n, 2))
    B[:gone] = 0.0
    Cq, Cv = rng.standard_normal((2, 3, n))
    Cv[:, :gone] *= float(flung)
    back = np.linalg.inv(np.linalg.qr(rng.standard_normal((n, n)))[0] * rng.uniform(0.3, 3.0, n))
    M, C, K = (sp.csc_matrix(back.T @ A @ back) for A in (M, C, K @ K.T + np.eye(n)))
    names = tuple(f"q{i}" for i in range(n))
    symmetric = (0.5 * (M + M.T)).tocsc(), C, (0.5 * (K + K.T)).tocsc()
    return LinearModel(
        *symmetric, back.T @ B, Cq @ back, Cv @ back, rng.standard_normal((3, 2)), names, ("u1", "u2"), ("a", "b", "c")
    )


def response(linear: LinearModel, s: complex) -> np.ndarray:
    """(Cq + s Cv)(s² M + s C + K)⁻¹ B + D of all freedoms: nothing is left out of it."""
    M, C, K = (A.toarray() for A in (linear.M, linear.C, linear.K))
    return (linear.Cq + s * linear.Cv) @ la.solve(K + s * C + s * s * M, linear.B) + linear.D


@pytest.mark.parametrize("flung", [False, True])
@pytest.mark.parametrize("seed", range(6))
def test_the_response_is_that_of_all_freedoms(seed, flung):
    """Also of outputs that are velocities of massless freedoms, and so see accelerations of the others."""
    linear = planted(seed, flung)
    assert len(linear.audit().named(Freedom.STATIC)) == 2
    condensed, space = linear.condense(), linear.to_ss()
    omega = np.array([0.05, 0.7, 4.0, 60.0])
    ours = linear.frequency_response(omega).values
    for k, s in enumerate(1j * omega):
        exact = response(linear, s)
        for found in (response(condensed, s), space(s), ours[:, :, k]):
            np.testing.assert_allclose(found, exact, rtol=0.0, atol=1e-9 * np.abs(exact).max())


@pytest.mark.parametrize("seed", range(6))
def test_poles_are_the_limit_of_vanishing_mass(seed):
    """The poles of M + ε N Nᵀ draw near in proportion to ε; extrapolated to 0, they are ours."""
    linear = planted(seed)
    M, C, K = (A.toarray() for A in (linear.M, linear.C, linear.K))
    null = la.null_space(M, rcond=1e-10)
    n = len(M)
    ours = linear.damped_poles()
    assert len(ours) == 2 * (n - 2)

    def nearest(light: float) -> np.ndarray:
        heavy = M + light * null @ null.T
        A = np.block([[np.zeros((n, n)), np.eye(n)], [-la.solve(heavy, K), -la.solve(heavy, C)]])
        every = la.eigvals(A)
        return every[np.abs(ours[:, None] - every).argmin(axis=1)]

    limit = (8.0 * nearest(1e-4) - 6.0 * nearest(2e-4) + nearest(4e-4)) / 3.0
    assert (np.abs(limit - ours) / np.maximum(np.abs(ours), 1.0)).max() < 1e-8


@pytest.mark.parametrize("axis", AXES)
@pytest.mark.parametrize("elements", [1, 2])
def test_a_rod_without_rotary_inertia_turns_on_a_table(axis, elements):
    """Its spin is massless and pushed by Coriolis forces; poles as of rods with less and less rotary inertia."""
    poles = blade(axis, 0.0, elements).select(["push"]).damped_poles()
    slow = np.sort(poles.imag[poles.imag > 0.0])[:5]
    light, lighter = (
        np.sort(found.imag[found.imag > 0.0])[:5]
        for found in (blade(axis, rhoJ, elements).damped_poles() for rhoJ in (2e-6, 1e-6))
    )
    np.testing.assert_allclose(2.0 * lighter - light, slow, rtol=1e-8)


@pytest.mark.parametrize("axis", AXES)
def test_its_response_is_that_of_all_its_freedoms(axis):
    linear = blade(axis, 0.0, 2).select(["push"])
    omega = np.array([1.0, 30.0, 900.0])
    values = linear.frequency_response(omega).values
    for k, s in enumerate(1j * omega):
        exact = response(linear, s)
        np.testing.assert_allclose(values[:, :, k], exact, rtol=0.0, atol=1e-9 * np.abs(exact).max())


def test_a_torque_on_the_massless_spin_would_be_felt_as_its_derivative():
    with pytest.raises(LinearizationError, match=r"input 'twist' acts on .* rod_1_rx \(rod 1: rotation about"):
        blade((1.0, 0.0, 0.0)).to_ss()


@pytest.mark.parametrize("axis", [*AXES, (1 / 3, 2 / 3, 2 / 3)])
def test_a_rod_that_spins_freely_is_refused_by_node(axis):
    model = machine(axis, elements=2, held="u v w")
    assert len(fc.audit(model).mechanisms) == 1
    with pytest.raises(MechanismError, match=r"rod_\d_r[xyz].*rod \d: rotation about"):
        fc.linearize(model)


def test_massless_freedoms_that_push_each_other_are_refused_by_name():
    names = ("a", "b", "c")
    C = sp.csc_matrix([[0.0, 2.0, 0.0], [-2.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    M, K = sp.csc_matrix(np.diag([0.0, 0.0, 1.0])), sp.csc_matrix(np.diag([1.0, 1.0, 1.0]))
    linear = LinearModel(M, C, K, np.eye(3)[:, 2:], np.eye(3)[2:], np.zeros((1, 3)), np.zeros((1, 1)), names, "u", "y")
    assert len(linear.audit().named(Freedom.STATIC)) == 2
    with pytest.raises(LinearizationError, match="push each other by their velocities"):
        linear.damped_poles()
