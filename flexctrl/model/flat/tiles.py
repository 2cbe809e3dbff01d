"""Tiles: nodes that are placed, turned and pushed a few dozen at a time.

Models that fit no near cache wait for memory in every loop over all of their nodes. What a tile of nodes reads and
writes is still near when the next loop wants it. A piece is computed with the tile of the last of its nodes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from flexctrl.frozen import frozen
from flexctrl.kernels.kernel import Run
from flexctrl.kernels.native import Runs, Wholes

if TYPE_CHECKING:
    from flexctrl.model.flat.layout import Layout

__all__ = ["NO_TILES", "Tiles", "Tiling", "tiles_of", "tiling_of"]

_NODES = 64
"""Of a tile: their slots, poses and motion fill half of a first cache."""
_LEAST, _MOST = 4, 512
"""Tiles: of fewer, all is near anyway."""


@dataclass
class Tiles:
    """The tiles of a model, as compiled loops read them.

    Attributes
    ----------
    count : int
    families : int
        How many of `Flat.forces` and `Flat.tangents` are in tiles.
    nodes, freedoms, entries : Wholes, (count + 1,)
        The first of `Flat.whole` of each tile, of the degrees of freedom, and of the tangent's entries.
    turn : Runs
        Kernels that turn the nodes of each tile, by little and by any step.
    forces, tangents : Runs
        Kernels of the pieces, tile by tile; without the latter where followers turn.
    """

    LASTING = ("count",)

    count: int
    families: int
    nodes: Wholes
    freedoms: Wholes
    entries: Wholes
    turn: Runs
    forces: Runs
    tangents: Runs


_NONE = np.zeros(1, dtype=int)
NO_TILES = Tiles(0, 0, _NONE, _NONE, _NONE, (), (), ())


@frozen(eq=False)
class Tiling:
    """How a model is cut into tiles.

    Attributes
    ----------
    nodes, freedoms, entries : numpy.ndarray of int, (tiles + 1,)
        See `Tiles`.
    orders : tuple of numpy.ndarray of int
        The order of each family's pieces.
    ends : tuple of numpy.ndarray of int, each (tiles,)
        How many of them are in tiles up to each.
    """

    nodes: np.ndarray
    freedoms: np.ndarray
    entries: np.ndarray
    orders: tuple[np.ndarray, ...]
    ends: tuple[np.ndarray, ...]


def tiling_of(layout: Layout) -> Tiling:
    """Cut a model into tiles: into none where its nodes are few, or where nodes or drives follow others.

    Parameters
    ----------
    layout : Layout

    Returns
    -------
    Tiling
    """
    m, whole, families = layout.motion, layout.whole, layout.forces.families
    count = min(len(whole) // _NODES, _MOST)
    if not m.plain or m.drives or m.inner.size or count < _LEAST:
        return Tiling(_NONE, _NONE, _NONE, tuple(np.arange(f.count) for f in families), ())
    # kernels compute up to eight at once, and loops copy as many
    nodes = np.append(8 * (np.arange(count) * len(whole) // (8 * count)), len(whole))
    # welded nodes share their freedoms, also with the tile before, which has begun to sum up the forces on them
    beyond = layout.position[layout.owned[whole[nodes[1:-1] - 1], -1]] + 1
    freedoms = np.concatenate([[0], -(-beyond // 8) * 8, [layout.padded]])
    fronts, length = layout.plan.fronts, layout.plan.length
    # of several nodes in one front the first says where it is
    begins = np.append(fronts.base, length)[np.searchsorted(fronts.first, beyond)]
    entries = np.concatenate([[0], begins, [length]])
    tile = np.where((layout.owned < m.n).any(axis=1), count - 1, 0)
    tile[whole] = np.repeat(np.arange(count), np.diff(nodes))
    last = [tile[f.nodes].max(axis=1) for f in families]
    ends = tuple(np.cumsum(np.bincount(tiles, minlength=count)) for tiles in last)
    return Tiling(nodes, freedoms, entries, tuple(np.argsort(tiles, kind="stable") for tiles in last), ends)


def tiles_of(tiling: Tiling, turn: tuple[Run, ...], forces: tuple[Run, ...], tangents: tuple[Run, ...]) -> Tiles:
    """Return the tiles as loops read them.

    Parameters
    ----------
    tiling : Tiling
    turn : tuple of Run
        Kernels that turn nodes, those in tiles first.
    forces, tangents : tuple of Run
        Those of each family's pieces, in the order of the tiling; of the latter maybe none.

    Returns
    -------
    Tiles
    """
    count = len(tiling.nodes) - 1
    if not count:
        return NO_TILES
    turns = _by_tiles(turn, [tiling.nodes[1:]] * len(turn))
    pieces = (_by_tiles(kernels, tiling.ends) for kernels in (forces, tangents))
    return Tiles(count, len(forces), tiling.nodes, tiling.freedoms, tiling.entries, turns, *pieces)


def _by_tiles(runs: Sequence[Run], ends: Sequence[np.ndarray]) -> tuple[Run, ...]:
    """Parts of runs, if there are any, those of each tile together."""
    parts = [run.parts(end) for run, end in zip(runs, ends, strict=False)]
    return tuple(run for tile in zip(*parts, strict=True) for run in tile)
