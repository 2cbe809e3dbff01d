"""Matrices of narrow band in compiled loops: factors, counts of eigenvalues, Lanczos' recurrence."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Any

import numpy as np

from flexctrl.frozen import frozen
from flexctrl.kernels.native import Packed
from flexctrl.linear.band_loops import (
    Factorising,
    LanczosRun,
    Product,
    Solving,
    Tiles,
    complete,
    factorise,
    lanczos,
    ready,
    solve,
)
from flexctrl.linear.banded import Band, Factor
from flexctrl.linear.krylov import NOTHING, Grown
from flexctrl.linear.pattern_loops import Arranging, Filling, arrange, fill

__all__ = ["CompiledBand", "Recurrence"]


@frozen(eq=False)
class CompiledBand(Band):
    """A band in tiles of eight rows and columns; see `band_loops`."""

    @cached_property
    def _arranged(self) -> Arranging:
        n, (starts, rows) = self.order.size, (a.astype(np.int64) for a in (self.starts, self.indices))
        found = (np.empty(size, dtype=np.int64) for size in (n, -(-n // 8), -(-n // 8), rows.size))
        arranging = Arranging(n, -(-n // 8), starts, rows, self.back, *found)
        Packed(arranging).bound(arrange)()
        return arranging

    @cached_property
    def reach(self) -> np.ndarray:
        """See `Band`."""
        return self._arranged.reach

    @cached_property
    def tiles(self) -> Any:
        """The tiles between the diagonal and where a panel, or one before it, reaches: `Tiles`, packed."""
        a = self._arranged
        return Packed(Tiles(a.panels, a.first, a.below))

    @cached_property
    def room(self) -> int:
        """Numbers in all tiles."""
        return int(64 * (self.tiles.first[-1] + 1))

    @cached_property
    def _tallest(self) -> int:
        """Tiles in the panel that has most."""
        return int(self.tiles.below.max()) + 1

    @cached_property
    def _own(self) -> np.ndarray:
        """Where the diagonal stands."""
        return ((self.tiles.first << 6)[:, None] + 9 * np.arange(8)).ravel()

    def lower(self, data: np.ndarray) -> np.ndarray:
        """Tiles of the lower triangle of the matrix with these entries in the order of the pattern."""
        where, lower = self._arranged.where, np.empty(self.room + 1)
        Packed(Filling(where.size, lower.size, where, data, lower)).bound(fill)()
        return lower[: self.room]

    def whole(self, data: np.ndarray) -> np.ndarray:
        """As `lower`, with whole tiles on the diagonal."""
        lower = self.lower(data)
        Packed(Product(self.tiles, lower)).bound(complete)()
        return lower

    def padded(self, x: np.ndarray) -> np.ndarray:
        """Columns of x, shape (n, k), as rows in the band's order and filled up to whole panels."""
        rows = np.zeros((x.shape[1], 8 * self.tiles.panels))
        rows[:, : len(x)] = x.take(self.order, axis=0, mode="clip").T
        return rows

    def unpadded(self, rows: np.ndarray) -> np.ndarray:
        """What `padded` was given."""
        return rows.T.copy().take(self.back, axis=0, mode="clip")

    def _eliminated(self, data: np.ndarray) -> tuple[Any, int, np.ndarray]:
        """Factors, the number of negative pivots, and the diagonal of the matrix."""
        t, n, lower = self.tiles, self.order.size, self.lower(data)
        diagonal = lower.take(self._own)[:n]
        lower[self.room - 64 + 9 * (n % 8 or 8) :: 9] = 1.0
        pivots, size = np.zeros((2, 8 * t.panels))
        f = Packed(Factorising(t, lower, np.empty(64 * t.panels), pivots, size, np.empty(64 * self._tallest)))
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
