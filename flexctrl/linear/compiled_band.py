"""Matrices of narrow band in compiled loops: factors, counts of eigenvalues, Lanczos' recurrence."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from flexctrl.kernels.native import Packed
from flexctrl.linear.band_loops import Factorising, LanczosRun, Solving, Tiles, factorise, lanczos, ready, solve
from flexctrl.linear.banded import Band, Factor
from flexctrl.linear.krylov import NOTHING, Grown

__all__ = ["CompiledBand", "Recurrence"]


@dataclass(frozen=True, eq=False)
class CompiledBand(Band):
    """A band in tiles of eight rows and columns; see `band_loops`."""

    @cached_property
    def tiles(self) -> Any:
        """The tiles between the diagonal and where a panel, or one before it, reaches: `Tiles`, packed."""
        panels = -(-self.order.size // 8)
        ends = np.maximum.reduceat(self.reach, np.arange(0, self.order.size, 8)) // 8
        below = np.maximum.accumulate(ends) - np.arange(panels)
        return Packed(Tiles(panels, np.cumsum(below + 1) - below - 1, below))

    @cached_property
    def room(self) -> int:
        """Numbers in all tiles."""
        return int(64 * (self.tiles.first[-1] + 1))

    @cached_property
    def _tiled(self) -> np.ndarray:
        """Where the lower entries stand."""
        panel = self.columns >> 3
        tile = self.tiles.first.take(panel) + (self.rows >> 3) - panel
        return (tile << 6) + ((self.columns & 7) << 3) + (self.rows & 7)

    def lower(self, data: np.ndarray) -> np.ndarray:
        """Tiles of the lower triangle of the matrix with these entries in the order of the pattern."""
        tiles = np.zeros(self.room)
        tiles[self._tiled] = data.take(self.chosen)
        return tiles

    def whole(self, data: np.ndarray) -> np.ndarray:
        """As `lower`, with whole tiles on the diagonal."""
        tiles = self.lower(data)
        near = np.flatnonzero(self.rows >> 3 == self.columns >> 3)
        across = (self._tiled[near] & ~63) + ((self.rows[near] & 7) << 3) + (self.columns[near] & 7)
        tiles[across] = data[self.chosen[near]]
        return tiles

    def padded(self, x: np.ndarray) -> np.ndarray:
        """Columns of x, shape (n, k), as rows in the band's order and filled up to whole panels."""
        rows = np.zeros((x.shape[1], 8 * self.tiles.panels))
        rows[:, : len(x)] = x.take(self.order, axis=0).T
        return rows

    def unpadded(self, rows: np.ndarray) -> np.ndarray:
        """What `padded` was given."""
        return np.ascontiguousarray(rows.take(self.back, axis=1).T)

    def _eliminated(self, data: np.ndarray) -> tuple[Any, int, np.ndarray]:
        """Factors, the number of negative pivots, and the diagonal of the matrix."""
        t, n, lower = self.tiles, self.order.size, self.lower(data)
        diagonal = lower.reshape(-1, 64)[t.first, ::9].ravel()[:n]
        lower[self.room - 64 + 9 * np.arange(n % 8 or 8, 8)] = 1.0
        pivots, size = np.zeros((2, 8 * t.panels))
        f = Packed(
            Factorising(t, lower, np.empty(64 * t.panels), pivots, size, np.empty(64 * (int(t.below.max()) + 1)))
        )
        return f, f.bound(factorise)(), diagonal

    def factorise(self, data: np.ndarray) -> Factor | None:
        """See `Band`."""
        f, negative, diagonal = self._eliminated(data)
        n = self.order.size
        if negative or not np.isfinite(f.pivots).all():
            return None
        pivots = f.pivots[:n].copy()
        f.bound(ready)()

        def solved(rhs: np.ndarray) -> np.ndarray:
            x = self.padded(rhs)
            Packed(Solving(f, len(x), x.ravel())).bound(solve)()
            return self.unpadded(x)

        def space(mass: np.ndarray, start: np.ndarray, image: np.ndarray) -> Recurrence:
            return Recurrence(self, f, mass, start, image)

        return Factor(pivots, diagonal, self.order, solved, space)

    def negative(self, data: np.ndarray, near: Callable[[], np.ndarray], growth: float) -> int | None:
        """See `Band`. Counted by the pivots of an elimination without exchange, where rounding does not grow in it."""
        f, negative, diagonal = self._eliminated(data)
        if negative >= 0 and (f.size[: diagonal.size] <= growth * np.abs(diagonal)).all():
            return negative
        return super().negative(data, near, growth)


class Recurrence:
    """The space of Lanczos' recurrence for one vector; see `krylov.Space`.

    Parameters
    ----------
    band : CompiledBand
    factor : Packed
        `Factorising` of A.
    mass : numpy.ndarray
        Entries of M in the order of the pattern.
    start : numpy.ndarray, shape (n, 1)
        Of M-length one.
    image : numpy.ndarray, shape (n, 1)
        M start.
    """

    width = 1

    def __init__(self, band: CompiledBand, factor: Any, mass: np.ndarray, start: np.ndarray, image: np.ndarray) -> None:
        self._band, self._factor, self._mass, self._size = band, factor, band.whole(mass), 1
        self._vectors, self._images, self._coefficients = band.padded(start), band.padded(image), np.zeros((2, 1))

    @property
    def vectors(self) -> np.ndarray:
        """See `Space`."""
        return self._band.unpadded(self._vectors[: self._size])

    def combined(self, shares: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """See `Space`."""
        vectors, images = (shares.T @ a[: len(shares)] for a in (self._vectors, self._images))
        return self._band.unpadded(vectors), self._band.unpadded(images)

    def projected(self, known: int) -> np.ndarray:
        """See `Space`."""
        own, beside = self._coefficients[:, :known]
        return np.diag(own) + np.diag(beside[:-1], -1)

    def grown(self, until: int) -> Grown:
        """See `Space`."""
        until = min(until, self._band.order.size)
        if until >= len(self._vectors):
            self._vectors, self._images = (_lengthened(a, 2 * until) for a in (self._vectors, self._images))
            self._coefficients = np.ascontiguousarray(_lengthened(self._coefficients.T, 2 * until).T)
        run = Packed(
            LanczosRun(
                factor=self._factor,
                mass=self._mass,
                unit=np.eye(8).ravel(),
                size=self._size,
                until=until + 1,
                least=NOTHING,
                vectors=self._vectors.ravel(),
                images=self._images.ravel(),
                own=self._coefficients[0],
                beside=self._coefficients[1],
                work=np.empty(2 * self._vectors.shape[1]),
            )
        )
        ended = bool(run.bound(lanczos)())
        known = run.size if ended else run.size - 1
        self._size = run.size
        return Grown(known, self._coefficients[1:, known - 1 : known], ended or known == self._band.order.size)


def _lengthened(a: np.ndarray, rows: int) -> np.ndarray:
    more = np.empty((rows, a.shape[1]))
    more[: len(a)] = a
    return more
