"""Tiles: nodes that are placed, turned and pushed a few dozen at a time.

Models that fit no near cache wait for memory in every loop over all of their nodes. What a tile of nodes reads and
writes is still near when the next loop wants it. A piece is computed with the tile of the last of its nodes.
"""

from __future__ import annotations

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
        How many of `Flat.forces` are in tiles.
    nodes, freedoms : Wholes, (count + 1,)
        The first of `Flat.whole` of each tile, and of the degrees of freedom.
    turn : Runs
        Kernels that turn the nodes of each tile, by little and by any step.
    forces : Runs
        Kernels of the pieces, tile by tile.
    """

    LASTING = ("count",)

    count: int
    families: int
    nodes: Wholes
    freedoms: Wholes
    turn: Runs
    forces: Runs


NO_TILES = Tiles(0, 0, np.zeros(1, dtype=int), np.zeros(1, dtype=int), (), ())


@frozen(eq=False)
class Tiling:
    """How a model is cut into tiles.

    Attributes
    ----------
    nodes, freedoms : numpy.ndarray of int, (tiles + 1,)
        See `Tiles`.
    orders : tuple of numpy.ndarray of int
        The order of each family's pieces.
    ends : tuple of numpy.ndarray of int, each (tiles,)
        How many of them are in tiles up to each.
    """

    nodes: np.ndarray
    freedoms: np.ndarray
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
        none = np.zeros(1, dtype=int)
        return Tiling(none, none, tuple(np.arange(f.count) for f in families), ())
    # kernels compute up to eight at once, and loops copy as many
    nodes = np.append(8 * (np.arange(count) * len(whole) // (8 * count)), len(whole))
    first = layout.position[layout.owned[whole[nodes[1:-1]], 0]]
    freedoms = np.concatenate([[0], -(-first // 8) * 8, [layout.padded]])
    tile = np.where((layout.owned < m.n).any(axis=1), count - 1, 0)
    tile[whole] = np.repeat(np.arange(count), np.diff(nodes))
    last = [tile[f.nodes].max(axis=1) for f in families]
    ends = tuple(np.cumsum(np.bincount(tiles, minlength=count)) for tiles in last)
    return Tiling(nodes, freedoms, tuple(np.argsort(tiles, kind="stable") for tiles in last), ends)


def tiles_of(tiling: Tiling, turn: tuple[Run, ...], forces: tuple[Run, ...]) -> Tiles:
    """Return the tiles as loops read them.

    Parameters
    ----------
    tiling : Tiling
    turn : tuple of Run
        Kernels that turn nodes, those in tiles first.
    forces : tuple of Run
        Those of each family's pieces, in the order of the tiling.

    Returns
    -------
    Tiles
    """
    count = len(tiling.nodes) - 1
    if not count:
        return NO_TILES
    turns = zip(*(run.parts(tiling.nodes[1:]) for run in turn), strict=True)
    pieces = zip(*(run.parts(ends) for run, ends in zip(forces, tiling.ends, strict=True)), strict=True)
    near_far, pushed = (tuple(run for tile in tiles for run in tile) for tiles in (turns, pieces))
    return Tiles(count, len(forces), tiling.nodes, tiling.freedoms, near_far, pushed)
