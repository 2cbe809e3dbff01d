"""Where the entries of a sparse matrix stand, in compiled loops: in the tiles of `band_loops`, across the diagonal."""

from __future__ import annotations

from flexctrl.frozen import frozen
from flexctrl.kernels.eights import put
from flexctrl.kernels.native import Reals, Wholes

__all__ = ["Arranging", "Filling", "Mirroring", "arrange", "fill", "reflect"]


@frozen(eq=False)
class Arranging:
    """A symmetric pattern, the order of its columns, and what comes of that.

    Attributes
    ----------
    n, panels : int
    starts, rows : numpy.ndarray of int
        The pattern: where its columns start, and the rows of their entries.
    back : numpy.ndarray of int, shape (n,)
        Place of each column in the order.
    reach : numpy.ndarray of int, shape (n,)
        Found: last row of each column of the ordered matrix, its diagonal at least.
    first, below : numpy.ndarray of int, shape (panels,)
        Found: see `Tiles`.
    where : numpy.ndarray of int
        Found: where each entry stands in the tiles; behind all of them what is above the diagonal.
    """

    n: int
    panels: int
    starts: Wholes
    rows: Wholes
    back: Wholes
    reach: Wholes
    first: Wholes
    below: Wholes
    where: Wholes


@frozen(eq=False)
class Filling:
    """Entries on their way to the tiles.

    Attributes
    ----------
    count, size : int
        How many entries there are, and numbers in the tiles.
    where : numpy.ndarray of int
        See `Arranging`.
    data : numpy.ndarray
    lower : numpy.ndarray, shape (size,)
        The tiles, and room for one number behind them, where entries above the diagonal go.
    """

    count: int
    size: int
    where: Wholes
    data: Reals
    lower: Reals


@frozen(eq=False)
class Mirroring:
    """A pattern and its mirror image.

    Attributes
    ----------
    n : int
    starts, rows : numpy.ndarray of int
        Where its columns start, and the rows of their entries, ascending.
    next : numpy.ndarray of int, shape (n,)
        Room.
    across : numpy.ndarray of int
        Found: where the entry across the diagonal stands for every entry.
    """

    n: int
    starts: Wholes
    rows: Wholes
    next: Wholes
    across: Wholes


def reflect(m: Mirroring) -> int:
    """Find what stands across the diagonal; return 1 if something has nothing there."""
    for j in range(m.n):
        m.next[j] = m.starts[j]
    for j in range(m.n):
        for k in range(m.starts[j], m.starts[j + 1]):
            i = m.rows[k]
            there = m.next[i]
            if there >= m.starts[i + 1] or m.rows[there] != j:
                return 1
            m.across[there] = k
            m.next[i] = there + 1
    return 0


def arrange(a: Arranging) -> int:
    """Find the tiles and the places in them."""
    for j in range(a.n):
        here = a.back[j]
        last = here
        for k in range(a.starts[j], a.starts[j + 1]):
            last = max(last, a.back[a.rows[k]])
        a.reach[here] = last
    furthest = 0
    tiles = 0
    for p in range(a.panels):
        for i in range(8 * p, min(8 * p + 8, a.n)):
            furthest = max(furthest, a.reach[i])
        a.first[p] = tiles
        a.below[p] = furthest // 8 - p
        tiles += a.below[p] + 1
    for j in range(a.n):
        column = a.back[j]
        panel = column // 8
        start = 64 * (a.first[panel] - panel) + 8 * (column % 8)
        for k in range(a.starts[j], a.starts[j + 1]):
            row = a.back[a.rows[k]]
            a.where[k] = start + 64 * (row // 8) + row % 8 if row >= column else 64 * tiles
    return 0


def fill(f: Filling) -> int:
    """Put the entries on and under the diagonal into the tiles."""
    for i in range(0, f.size - 1, 8):
        put(f.lower[i:], 0.0)
    for k in range(f.count):
        f.lower[f.where[k]] = f.data[k]
    return 0
