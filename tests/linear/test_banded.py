"""Matrices of narrow band: factors, counts of eigenvalues and modes, in compiled loops and by LAPACK."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
import scipy.sparse as sp
from fixtures import structures as s

from flexctrl.linear import banded, columns, pattern
from flexctrl.linear.band_loops import Factorising, factorise
from flexctrl.linear.banded import Band, band_of


def shuffled_band(n: int, width: int, seed: int) -> tuple[sp.csc_matrix, np.ndarray]:
    """A symmetric matrix with gaps in its band, rows and columns in no order."""
    rng = np.random.default_rng(seed)
    A = np.diag(rng.normal(size=n))
    for k in range(1, width + 1):
        A += np.diag(rng.normal(size=n - k) * (rng.random(n - k) < 0.6), -k)
    A = A + A.T
    order = rng.permutation(n)
    return sp.csc_matrix(A[np.ix_(order, order)]), np.linalg.eigvalsh(A)


@pytest.fixture(params=["compiled", "LAPACK"])
def way(request, monkeypatch):
    if request.param == "LAPACK":
        monkeypatch.setattr(banded, "can_compile", lambda: False)
    else:
        pytest.importorskip("llvmlite")
    return request.param


@pytest.mark.parametrize("n", [1, 7, 8, 61, 200])
def test_factors_solve_and_know_what_is_definite(way, n):
    A, values = shuffled_band(n, min(9, n - 1), n)
    B = sp.csc_matrix(A + (1.0 - values[0]) * sp.identity(n))
    band = band_of(B)
    assert (type(band) is Band) == (way == "LAPACK")
    factor = band.factorise(B.data)
    rhs = np.random.default_rng(n).normal(size=(n, 3))
    np.testing.assert_allclose(factor.solve(rhs), np.linalg.solve(B.toarray(), rhs), rtol=1e-11, atol=1e-13)
    np.testing.assert_allclose(np.log(factor.pivots).sum(), np.linalg.slogdet(B.toarray())[1], atol=1e-10)
    np.testing.assert_allclose(factor.diagonal, B.diagonal()[factor.order], rtol=1e-14)
    if n > 1:
        C = sp.csc_matrix(A - 0.5 * (values[0] + values[-1]) * sp.identity(n))
        assert band_of(C).factorise(C.data) is None


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("growth", [1.0, 1e5])
def test_negative_eigenvalues_are_counted_or_not_told(way, seed, growth):
    A, values = shuffled_band(90, 7, seed)
    below = 5 + 3 * seed
    shift = 0.5 * (values[below - 1] + values[below])
    B = sp.csc_matrix(A - shift * sp.identity(90))
    vectors = np.linalg.eigh(B.toarray())[1][:, : below + 2]
    assert band_of(B).negative(B.data, lambda: vectors, growth) in (below, None)


@pytest.mark.parametrize("n", [201, 260])
def test_entries_across_the_diagonal_are_found_or_missed(way, n, monkeypatch):
    monkeypatch.setattr(pattern, "can_compile", banded.can_compile)
    A, _ = shuffled_band(n, 6, n)
    A.sort_indices()
    np.testing.assert_array_equal(A.data[pattern.mirror(A)], A.data)
    odd = sp.csc_matrix(sp.triu(A) + sp.tril(A, -2))
    odd.sort_indices()
    assert pattern.mirror(odd) is None


def test_quadratic_forms_lose_nothing_to_cancellation(way, monkeypatch):
    monkeypatch.setattr(columns, "can_compile", banded.can_compile)
    monkeypatch.setattr(columns, "SMALL", 0)
    A = shuffled_band(40, 4, 1)[0]
    x = np.random.default_rng(2).normal(size=(40, 11)) * 10.0 ** np.linspace(0, 8, 40)[:, None]
    x[-1] -= (A @ x)[-1] / A[-1, -1]
    exact = [
        sum(Fraction(a) * Fraction(v[i]) * Fraction(v[j]) for i, j, a in zip(*sp.find(A), strict=True)) for v in x.T
    ]
    size = np.einsum("ij,ij->j", abs(x), abs(A) @ abs(x))
    assert (np.abs(columns.energies(A, x) - [float(e) for e in exact]) <= 2e-18 * size + 2e-16 * np.abs(exact)).all()


def test_rounding_that_grows_is_not_trusted():
    pytest.importorskip("llvmlite")
    A = sp.csc_matrix(np.array([[1e-13, 1.0, 0.0], [1.0, 1.0, 1.0], [0.0, 1.0, 3.0]]))
    assert band_of(A).negative(A.data, lambda: np.linalg.eigh(A.toarray())[1][:, :1], 1e5) == 1


def test_loops_say_the_same_uncompiled():
    pytest.importorskip("llvmlite")
    A, values = shuffled_band(30, 5, 3)
    band = band_of(A)
    compiled, negative, _ = band._eliminated(A.data)
    lower = band.lower(A.data)
    lower[-64 + 9 * np.arange(30 % 8, 8)] = 1.0
    plain = Factorising(band.tiles._record, lower, np.empty(64 * 4), *np.zeros((2, 32)), np.empty(64 * 4))
    assert factorise(plain) == negative == np.count_nonzero(values < 0)
    np.testing.assert_allclose(plain.lower, compiled.lower, rtol=1e-8, atol=1e-8)


@pytest.mark.parametrize("count", [5, 30])
def test_modes_of_a_long_chain_have_their_sine_frequencies(way, count):
    linear = s.chain(2000, mass=3.0, stiffness=7e4)
    modes = linear.modes(count)
    np.testing.assert_allclose(modes.omega, s.chain_omega(2000, 3.0, 7e4)[:count], rtol=2e-12)
    assert np.abs(modes.shapes.T @ (linear.M @ modes.shapes) - np.eye(count)).max() < 1e-13
