"""Small full systems of equations in compiled loops: factors L U of a matrix whose rows may change places."""

from __future__ import annotations

from flexctrl.kernels.native import Reals, Wholes

__all__ = ["full_factors", "full_solve"]


def full_factors(n: int, a: Reals, order: Wholes) -> None:
    """Put the factors of a matrix in its place; those of a singular one are not finite.

    Parameters
    ----------
    n : int
    a : Reals, (n · n,)
        Column by column.
    order : Wholes, (n,)
        The row that changes places with each.
    """
    for k in range(n):
        best = k
        for i in range(k + 1, n):
            if abs(a[n * k + i]) > abs(a[n * k + best]):
                best = i
        order[k] = best
        if best != k:
            for j in range(k, n):
                other = a[n * j + best]
                a[n * j + best] = a[n * j + k]
                a[n * j + k] = other
        share = 1.0 / a[n * k + k]
        for i in range(k + 1, n):
            a[n * k + i] *= share
        for j in range(k + 1, n):
            times = a[n * j + k]
            for i in range(k + 1, n):
                a[n * j + i] -= a[n * k + i] * times


def full_solve(n: int, a: Reals, order: Wholes, b: Reals) -> None:
    """Put the solution in the place of the right-hand side.

    Parameters
    ----------
    n : int
    a, order : Reals, Wholes
        What `full_factors` has left.
    b : Reals, (n,)
    """
    for k in range(n):
        times = b[order[k]]
        b[order[k]] = b[k]
        b[k] = times
        column = a[n * k :]
        for i in range(k + 1, n):
            b[i] -= column[i] * times
    for j in range(n):
        k = n - 1 - j
        column = a[n * k :]
        times = b[k] / column[k]
        b[k] = times
        for i in range(k):
            b[i] -= column[i] * times
