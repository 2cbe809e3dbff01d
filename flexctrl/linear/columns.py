"""Quadratic forms of sparse matrices with twice the digits: eight vectors at once, in compiled loops."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from flexctrl.frozen import frozen
from flexctrl.kernels.eights import eight, lost, put, rounded
from flexctrl.kernels.kernel import can_compile
from flexctrl.kernels.native import Packed, Reals, Wholes

__all__ = ["Columns", "energies", "strain"]

SMALL = 300


@frozen(eq=False)
class Columns:
    """A sparse matrix, column by column, and vectors in groups of eight.

    Attributes
    ----------
    n : int
    width : int
        Vectors, a multiple of eight.
    starts, rows : numpy.ndarray of int
        Where the columns of the matrix start, and the rows of its entries.
    data : numpy.ndarray
    x : numpy.ndarray, shape (n · width,)
        The vectors.
    found : numpy.ndarray, shape (width,)
    """

    n: int
    width: int
    starts: Wholes
    rows: Wholes
    data: Reals
    x: Reals
    found: Reals


def strain(c: Columns) -> int:
    """Find xᵀ A x of each vector, with about twice the digits of a double on the way.

    Every sum carries what its additions and products have lost (T. Ogita, S. M. Rump, S. Oishi, SIAM J. Sci. Comput.
    26 (2005) 1955–1988, algorithm 5.3).
    """
    for block in range(0, c.width, 8):
        high = 0.0 * eight(c.x)
        low = high
        for j in range(c.n):
            own = eight(c.x[c.width * j + block :])
            top = 0.0 * own
            rest = top
            for k in range(c.starts[j], c.starts[j + 1]):
                other = eight(c.x[c.width * c.rows[k] + block :])
                part = rounded(c.data[k], other)
                new = top + part
                took = new - top
                rest = rest + ((top - (new - took)) + (part - took) + lost(c.data[k], other))
                top = new
            part = rounded(own, top)
            new = high + part
            took = new - high
            low = low + ((high - (new - took)) + (part - took) + lost(own, top) + own * rest)
            high = new
        put(c.found[block:], high + low)
    return 0


def energies(A: sp.csc_matrix, x: np.ndarray) -> np.ndarray:
    """xᵀ A x of every column, in extended precision.

    Parameters
    ----------
    A : scipy.sparse.csc_matrix, shape (n, n)
    x : numpy.ndarray, shape (n, k)

    Returns
    -------
    numpy.ndarray, shape (k,)
    """
    if len(x) <= SMALL or not can_compile():
        long = x.astype(np.longdouble)
        return np.einsum("ij,ij->j", long, A.astype(np.longdouble) @ long).astype(float)
    n, k = x.shape
    vectors = np.zeros((n, -(-k // 8) * 8))
    vectors[:, :k] = x
    found = np.empty(vectors.shape[1])
    starts, rows = A.indptr.astype(np.int64), A.indices.astype(np.int64)
    Packed(Columns(n, found.size, starts, rows, A.data, vectors.ravel(), found)).bound(strain)()
    return found[:k]
