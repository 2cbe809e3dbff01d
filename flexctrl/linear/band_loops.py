"""Factors, products and Lanczos steps of symmetric matrices of narrow band, in compiled loops.

A matrix is cut into tiles of eight rows and eight columns. Of its lower triangle those are kept that stand between the
diagonal and where a panel (eight columns) or one before it reaches; a tile is stored column by column.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from flexctrl.frozen import frozen
from flexctrl.kernels.eights import eight, put, total
from flexctrl.kernels.native import Reals, Wholes

__all__ = [
    "Factorising",
    "LanczosRun",
    "Product",
    "Solving",
    "Tiles",
    "complete",
    "factorise",
    "lanczos",
    "ready",
    "solve",
]


@frozen(eq=False)
class Tiles:
    """Where the tiles stand: those of a panel one after the other, that of the diagonal first.

    Attributes
    ----------
    panels : int
    first : numpy.ndarray of int, shape (panels,)
        Number of each panel's first tile.
    below : numpy.ndarray of int, shape (panels,)
        How many tiles there are under the diagonal.
    """

    panels: int
    first: Wholes
    below: Wholes


@frozen(eq=False)
class Factorising:
    """A = L D Lᵀ without exchange of rows.

    Attributes
    ----------
    tiles : Tiles
    lower : numpy.ndarray
        A, then L; ready for solving, with the inverses of its tiles on the diagonal.
    turned : numpy.ndarray, shape (64 panels,)
        Transposes of these inverses.
    pivots : numpy.ndarray, shape (8 panels,)
        D; ready for solving, D⁻¹.
    size : numpy.ndarray, shape (8 panels,)
        Diagonal of |L| |D| |L|ᵀ: how far rounding has grown, beside the diagonal of A (N. J. Higham, Accuracy and
        Stability of Numerical Algorithms, 2002, § 11.1).
    work : numpy.ndarray
        Room for the tiles of a panel.
    """

    tiles: Tiles
    lower: Reals
    turned: Reals
    pivots: Reals
    size: Reals
    work: Reals


@frozen(eq=False)
class Solving:
    """Right-hand sides, solved for in place.

    Attributes
    ----------
    factor : Factorising
    count : int
    x : numpy.ndarray, shape (count · 8 panels,)
        One after the other.
    """

    factor: Factorising
    count: int
    x: Reals


@frozen(eq=False)
class Product:
    """A symmetric matrix as it is multiplied.

    Attributes
    ----------
    tiles : Tiles
    lower : numpy.ndarray
        Its lower triangle.
    """

    tiles: Tiles
    lower: Reals


@dataclass(eq=False)
class LanczosRun:
    """Lanczos' recurrence for A⁻¹M with full reorthogonalisation.

    Attributes
    ----------
    factor : Factorising
        Of A.
    mass : numpy.ndarray
        Tiles of M, on the diagonal whole.
    unit : numpy.ndarray, shape (64,)
        A tile with ones on its diagonal.
    size : int
        Vectors there are.
    until : int
        Vectors wanted.
    least : float
        What a new vector has to be long, as a share of the largest entry of the projected matrix.
    vectors, images : numpy.ndarray, shape (room · 8 panels,)
        Q, M-orthonormal, and M Q.
    own, beside : numpy.ndarray, shape (room,)
        Diagonal of Qᵀ M A⁻¹ M Q, and the entries beside it.
    work : numpy.ndarray, shape (16 panels,)
    """

    factor: Factorising
    mass: Reals
    unit: Reals
    size: int
    until: int
    least: float
    vectors: Reals
    images: Reals
    own: Reals
    beside: Reals
    work: Reals


def factorise(f: Factorising) -> int:
    """Factorise in place; return how many pivots are negative, or −1 if one is zero."""
    negative = 0
    t = f.tiles
    for p in range(t.panels):
        own = f.lower[64 * t.first[p] :]
        below = t.below[p]
        for k in range(8):
            pivot = own[9 * k]
            if pivot == 0.0:
                return -1
            if pivot < 0.0:
                negative += 1
            f.pivots[8 * p + k] = pivot
            eliminate(k, below, 1.0 / pivot, own)
        settle(below, f.pivots[8 * p :], own, f.work, f.size[8 * p :])
        for q in range(p + 1, p + 1 + below):
            for r in range(q, p + 1 + below):
                into = f.lower[64 * (t.first[q] + r - q) :]
                subtract(f.work[64 * (r - p) :], own[64 * (q - p) :], into)
    return negative


def ready(f: Factorising) -> int:
    """Make factors ready for solving."""
    for p in range(f.tiles.panels):
        own = f.lower[64 * f.tiles.first[p] :]
        invert(own, f.work)
        for i in range(8):
            for j in range(8):
                f.turned[64 * p + 8 * i + j] = own[8 * j + i]
        put(f.pivots[8 * p :], 1.0 / eight(f.pivots[8 * p :]))
    return 0


def complete(m: Product) -> int:
    """Make the tiles on the diagonal whole."""
    for p in range(m.tiles.panels):
        own = m.lower[64 * m.tiles.first[p] :]
        for k in range(8):
            for i in range(k + 1, 8):
                own[8 * i + k] = own[8 * k + i]
    return 0


def eliminate(k: int, below: int, inverse: float, own: Reals) -> None:
    """Take column k of a panel out of those after it."""
    for j in range(k + 1, 8):
        share = inverse * own[8 * k + j]
        for q in range(0, 64 * (below + 1), 64):
            put(own[q + 8 * j :], eight(own[q + 8 * j :]) - share * eight(own[q + 8 * k :]))


def settle(below: int, pivots: Reals, own: Reals, work: Reals, size: Reals) -> None:
    """Copy L D of a panel, divide by D, and note how large |L| |D| |L|ᵀ is."""
    for k in range(8):
        for i in range(k):
            own[8 * k + i] = 0.0
        inverse = 1.0 / pivots[k]
        for q in range(below + 1):
            entries = eight(own[64 * q + 8 * k :])
            put(work[64 * q + 8 * k :], entries)
            put(own[64 * q + 8 * k :], inverse * entries)
            put(size[8 * q :], eight(size[8 * q :]) + abs(inverse) * entries * entries)


def subtract(scaled: Reals, own: Reals, into: Reals) -> None:
    """Take (L D) Lᵀ of two tiles of a panel from the tile where they meet."""
    for i in range(8):
        left = eight(scaled) * own[i] + eight(scaled[8:]) * own[8 + i]
        right = eight(scaled[16:]) * own[16 + i] + eight(scaled[24:]) * own[24 + i]
        left = left + eight(scaled[32:]) * own[32 + i] + eight(scaled[40:]) * own[40 + i]
        right = right + eight(scaled[48:]) * own[48 + i] + eight(scaled[56:]) * own[56 + i]
        put(into[8 * i :], eight(into[8 * i :]) - left - right)


def invert(own: Reals, work: Reals) -> None:
    """Invert a lower triangular tile with a diagonal of ones."""
    for k in range(7, -1, -1):
        put(work, eight(own[8 * k :]))
        for i in range(k + 1, 8):
            own[8 * k + i] = 0.0
        for i in range(k + 1, 8):
            put(own[8 * k :], eight(own[8 * k :]) - work[i] * eight(own[8 * i :]))


def solve(s: Solving) -> int:
    """Solve for all right-hand sides."""
    substitute(s.factor, s.count, s.x)
    return 0


def substitute(f: Factorising, count: int, x: Reals) -> None:
    """(L D Lᵀ)⁻¹ x in place, for vectors x that stand one after the other."""
    t = f.tiles
    n = 8 * t.panels
    for p in range(t.panels):
        own = f.lower[64 * t.first[p] :]
        below = t.below[p]
        for here in range(8 * p, count * n, n):
            turn(own, x[here:])
            spread(below, own[64:], x[here:], x[here + 8 :], -1.0)
    for p in range(t.panels - 1, -1, -1):
        own = f.lower[64 * t.first[p] :]
        below = t.below[p]
        for here in range(8 * p, count * n, n):
            put(x[here:], eight(x[here:]) * eight(f.pivots[8 * p :]))
            gather(below, own[64:], f.turned[64 * p :], x[here + 8 :], x[here:], -1.0)


def turn(tile: Reals, x: Reals) -> None:
    """Put a tile's product with x into x."""
    left = eight(tile) * x[0] + eight(tile[8:]) * x[1] + eight(tile[16:]) * x[2] + eight(tile[24:]) * x[3]
    right = eight(tile[32:]) * x[4] + eight(tile[40:]) * x[5] + eight(tile[48:]) * x[6] + eight(tile[56:]) * x[7]
    put(x, left + right)


def spread(count: int, tiles: Reals, x: Reals, y: Reals, sign: float) -> None:
    """Add the products of tiles that stand one under the other with x to y, with a sign."""
    a = sign * x[0]
    b = sign * x[1]
    c = sign * x[2]
    d = sign * x[3]
    e = sign * x[4]
    f = sign * x[5]
    g = sign * x[6]
    h = sign * x[7]
    for q in range(count):
        tile = tiles[64 * q :]
        left = eight(y[8 * q :]) + a * eight(tile) + b * eight(tile[8:]) + c * eight(tile[16:]) + d * eight(tile[24:])
        right = e * eight(tile[32:]) + f * eight(tile[40:]) + g * eight(tile[48:]) + h * eight(tile[56:])
        put(y[8 * q :], left + right)


def gather(count: int, tiles: Reals, last: Reals, x: Reals, y: Reals, sign: float) -> None:
    """Add the products of the transposes of tiles that stand one under the other with x to y, with a sign.

    What comes of that is multiplied by a last tile.
    """
    a = 0.0 * eight(y)
    b = a
    c = a
    d = a
    e = a
    f = a
    g = a
    h = a
    for q in range(count):
        tile = tiles[64 * q :]
        z = eight(x[8 * q :])
        a = a + z * eight(tile)
        b = b + z * eight(tile[8:])
        c = c + z * eight(tile[16:])
        d = d + z * eight(tile[24:])
        e = e + z * eight(tile[32:])
        f = f + z * eight(tile[40:])
        g = g + z * eight(tile[48:])
        h = h + z * eight(tile[56:])
    left = (y[0] + sign * total(a)) * eight(last) + (y[1] + sign * total(b)) * eight(last[8:])
    right = (y[2] + sign * total(c)) * eight(last[16:]) + (y[3] + sign * total(d)) * eight(last[24:])
    left = left + (y[4] + sign * total(e)) * eight(last[32:]) + (y[5] + sign * total(f)) * eight(last[40:])
    right = right + (y[6] + sign * total(g)) * eight(last[48:]) + (y[7] + sign * total(h)) * eight(last[56:])
    put(y, left + right)


def multiply(t: Tiles, lower: Reals, unit: Reals, x: Reals, y: Reals) -> None:
    """Put A x into y; tiles on the diagonal are whole, and there is a unit tile."""
    for p in range(t.panels):
        put(y[8 * p :], 0.0 * eight(x))
    for p in range(t.panels):
        own = 64 * t.first[p]
        spread(t.below[p] + 1, lower[own:], x[8 * p :], y[8 * p :], 1.0)
        gather(t.below[p], lower[own + 64 :], unit, x[8 * p + 8 :], y[8 * p :], 1.0)


def dot(n: int, a: Reals, b: Reals) -> float:
    """Σ a b; n is a multiple of eight."""
    left = 0.0 * eight(a)
    right = left
    for r in range(0, n - 8, 16):
        left = left + eight(a[r:]) * eight(b[r:])
        right = right + eight(a[r + 8 :]) * eight(b[r + 8 :])
    if n % 16 != 0:
        left = left + eight(a[n - 8 :]) * eight(b[n - 8 :])
    return total(left + right)


def add(n: int, share: float, a: Reals, b: Reals) -> None:
    """Add a share of a to b."""
    for r in range(0, n, 8):
        put(b[r:], eight(b[r:]) + share * eight(a[r:]))


def lanczos(s: LanczosRun) -> int:
    """Add vectors until there are as many as wanted; return 1 if there are no more."""
    t = s.factor.tiles
    n = 8 * t.panels
    z = s.work
    image = s.work[n:]
    largest = 0.0
    for i in range(s.size - 1):
        largest = max(largest, abs(s.own[i]))
    while s.size < s.until:
        last = s.size - 1
        for r in range(0, n, 8):
            put(z[r:], eight(s.images[last * n + r :]))
        substitute(s.factor, 1, z)
        s.own[last] = 0.0
        for repeat in range(2):  # but for rounding, what is new stands across all but the last two
            for i in range(last, -1 if repeat > 0 else max(last - 2, -1), -1):
                share = dot(n, s.images[i * n :], z)
                add(n, -share, s.vectors[i * n :], z)
                if i == last:
                    s.own[last] += share
        largest = max(largest, abs(s.own[last]))
        multiply(t, s.mass, s.unit, z, image)
        length = math.sqrt(max(dot(n, z, image), 0.0))
        s.beside[last] = length
        if not length > s.least * largest:
            return 1
        for r in range(0, n, 8):
            put(s.vectors[s.size * n + r :], eight(z[r:]) / length)
            put(s.images[s.size * n + r :], eight(image[r:]) / length)
        s.size += 1
    return 0
