"""Small full systems in compiled loops are solved as numpy does."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from flexctrl.kernels.dense import full_factors, full_solve
from flexctrl.kernels.native import Packed, Reals, Wholes

pytest.importorskip("llvmlite")


@dataclass
class System:
    n: int
    a: Reals
    order: Wholes
    b: Reals


def solved(s: System) -> int:
    full_factors(s.n, s.a, s.order)
    full_solve(s.n, s.a, s.order, s.b)
    return 0


def system(A: np.ndarray, b: np.ndarray) -> System:
    return System(len(A), A.ravel(order="F").copy(), np.zeros(len(A), dtype=int), b.astype(float))


@pytest.mark.parametrize("n", [1, 2, 3, 7, 24, 60])
def test_solutions(n):
    rng = np.random.default_rng(n)
    A, b = rng.normal(size=(n, n)), rng.normal(size=n)
    one, other = system(A, b), system(A, b)
    solved(one)
    Packed(other).bound(solved)()
    for found in (one.b, other.b):
        assert np.abs(A @ found - b).max() <= 1e-12 * np.abs(A).max() * n * np.abs(found).max()


def test_rows_change_places_where_pivots_vanish():
    """A cyclic shift: every pivot is 0 where it stands."""
    A = np.roll(np.eye(5), 1, axis=0)
    found = system(A, np.arange(5.0))
    Packed(found).bound(solved)()
    assert np.array_equal(found.b, [1.0, 2.0, 3.0, 4.0, 0.0])


def test_of_singular_ones_nothing_is_made_up():
    found = system(np.array([[1.0, 2.0], [2.0, 4.0]]), np.ones(2))
    Packed(found).bound(solved)()
    assert not np.isfinite(found.b).all()
