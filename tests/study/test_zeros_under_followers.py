"""Zeros, sensor choices and loops where loads follow the machine: K is not symmetric."""

from __future__ import annotations

from functools import cache

import control as ct
import numpy as np
import pytest
import scipy.linalg as la

import flexctrl as fc
from flexctrl.errors import LinearizationError
from flexctrl.linear.model import LinearModel


@cache
def column(thrust: float, rhoA: float = 1.0) -> LinearModel:
    """Beck's column with a body on top, pushed across at its top and in its middle."""
    beam = fc.Beam("beam", (0, 0, 0), (1, 0, 0), fc.Section(1e4, 1.0, 1.0, 1.0, rhoA, 0.0), elements=4)
    body = fc.RigidBody("body", beam.end, 0.05, (1e-4,) * 3)
    drawn = fc.Structure(
        [beam, body],
        [fc.Support(beam.start), fc.Weld(beam.end, body.node)],
        inputs=[
            fc.FollowerForce("thrust", beam.end, "-x"),
            fc.Force("top", beam.end, "y"),
            fc.Force("middle", beam.node(2), "y"),
        ],
        outputs=[fc.Position("y", beam.end, "y"), fc.Position("bend", beam.node(2), "y")],
    )
    effects = [fc.Flexible(), fc.LargeRotation(), fc.RayleighDamping(alpha=0.1)]
    return fc.linearize(fc.assemble(fc.planar(drawn, "z"), effects), inputs={"thrust": thrust})


@pytest.mark.parametrize(("push", "seen"), [("top", "y"), ("middle", "bend")])
@pytest.mark.parametrize("thrust", [4.0, 12.0])
def test_collocated_zeros_are_the_poles_of_the_held_column(push, seen, thrust):
    linear = column(thrust)
    held = int(np.flatnonzero(linear.B[:, linear.inputs.index(push)])[0])
    free = np.setdiff1d(np.arange(len(linear.coordinates)), [held])
    M, C, K = (A.toarray()[np.ix_(free, free)] for A in (linear.M, linear.C, linear.K))
    n = len(free)
    A = np.block([[np.zeros((n, n)), np.eye(n)], [-la.solve(M, K), -la.solve(M, C)]])
    expected, found = la.eigvals(A), fc.zeros(linear, [push], [seen]).finite
    assert len(found) == 2 * n
    distance = np.abs(found[:, None] - expected).min(axis=1) / np.abs(found)
    assert distance.max() < 1e-8


@pytest.mark.parametrize(
    ("push", "seen", "rhoA"), [("top", "y", 1.0), ("top", "bend", 1.0), ("middle", "y", 1.0), ("top", "y", 0.0)]
)
def test_the_response_vanishes_at_the_zeros(push, seen, rhoA):
    """All zeros and poles together are the response, up to a factor."""
    linear = column(6.0, rhoA)
    found, poles = fc.zeros(linear, [push], [seen]), linear.condense().damped_poles()
    s = 1j * np.array([0.7, 3.0, 11.0])
    shape = np.array([np.prod(1.0 - z / found.finite) / np.prod(1.0 - z / poles) for z in s])
    response = linear.frequency_response(s.imag).channel(seen, push)
    np.testing.assert_allclose(shape / shape[0], response / response[0], rtol=1e-6)


def test_a_followed_collocated_sensor_loses_its_phase_and_is_told():
    """Residues (c φ)(ψᵀ b)/(ψᵀ M φ) from the eigenvectors of K and of Kᵀ, both sides solved apart."""
    linear = column(12.0).select(["top"], ["y", "bend"])
    M, K = linear.M.toarray(), linear.K.toarray()
    values, right = la.eig(K, M)
    others, left = la.eig(K.T, M)
    right, left = right[:, np.argsort(values.real)].real, left[:, np.argsort(others.real)].real
    omega = np.sqrt(np.sort(values.real))
    for choice, row in zip(fc.sensor_choices(linear, below=500.0), linear.Cq, strict=True):
        residue = (row @ right) * (linear.B[:, 0] @ left) / np.einsum("ij,ik,kj->j", left, M, right)
        signs = np.sign(residue[(omega <= 500.0) & (np.abs(residue) > 1e-9 * np.abs(residue).max())])
        assert choice.in_phase == bool((signs == signs[0]).all())
        flips = omega[: len(signs)][signs != signs[0]]
        assert choice.first_flip == pytest.approx(flips[0] if flips.size else np.inf, rel=1e-6)


def test_fluttering_modes_have_no_phase():
    with pytest.raises(LinearizationError, match="flutters"):
        fc.sensor_choices(column(40.0))


def test_a_loop_closes_on_it_as_on_its_matrices():
    linear = column(8.0).select(["top"], ["y"])
    law = ct.tf([0.5, 2.0], [0.01, 1.0], inputs="y", outputs="top")
    loop = fc.open_loop(linear, law, "top", "y")
    plant = linear.to_ss(fc.PhysicalForm())
    for gain in (0.5, 2.0):
        closed = ct.feedback(plant, gain * law)
        growth = float(np.real(ct.poles(closed)).max())
        found = fc.root_locus(loop, [gain]).poles.real.max()
        assert found == pytest.approx(growth, abs=1e-6 * np.abs(ct.poles(closed)).max())
