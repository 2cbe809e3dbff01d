"""Craig–Bampton: interface coordinates kept, the interior by its static and fixed-interface modes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import splu

from flexctrl.errors import LinearizationError, ReductionError, did_you_mean, shortened
from flexctrl.frozen import frozen
from flexctrl.linear.eigen import Eigenpairs, complete_pairs, coordinate_scales, lowest_pairs
from flexctrl.linear.model import LinearModel
from flexctrl.linear.pattern import congruent
from flexctrl.linear.reduction.low_frequency import rigid_basis
from flexctrl.linear.reduction.result import ReducedModel, galerkin
from flexctrl.linear.reduction.selection import BelowFrequency

__all__ = ["CraigBampton"]

DENSE = 300


@frozen
class CraigBampton:
    """Component mode synthesis (R. R. Craig, M. C. C. Bampton, AIAA J. 6 (1968) 1313–1319).

    q = [I 0; −K_ii⁻¹ K_ib, Φ_i] [q_b; η]: the interface coordinates q_b stay as they are (names
    included), so reduced parts can be joined afterwards; Φ_i are modes of the interior with the
    interface held. A Galerkin projection: frequencies come out from above, the static response to
    interface loads is exact, rigid-body motion is kept.

    Parameters
    ----------
    interface : tuple of str
        Names of the coordinates kept.
    modes : int or BelowFrequency
        Fixed-interface modes of *each* piece the interior falls into when the interface is held:
        a number, or all below a frequency.
    static_correction : bool
        Add the feedthrough D that makes the DC gain of interior loads exact as well.
    """

    interface: tuple[str, ...]
    modes: int | BelowFrequency = 10
    static_correction: bool = False

    def __post_init__(self) -> None:
        named = isinstance(self.interface, tuple | list) and all(isinstance(name, str) for name in self.interface)
        if not named:
            raise ReductionError(
                f"CraigBampton: interface = {shortened(self.interface)}; expected names of coordinates, as "
                f"CraigBampton(('beam_4_u',), modes={self.modes!r})"
            )
        whole = isinstance(self.modes, int) and self.modes >= 0
        if not whole and not isinstance(self.modes, BelowFrequency):
            raise ReductionError(
                f"CraigBampton: modes = {self.modes!r}; expected a number of modes from 0 on, or BelowFrequency(hz)"
            )

    def apply(self, full: LinearModel) -> ReducedModel:
        """Reduce a model.

        Parameters
        ----------
        full : LinearModel

        Returns
        -------
        ReducedModel

        Raises
        ------
        ReductionError
            For an unknown interface coordinate, or an interior that can still move as a rigid body.
        """
        held = _positions(self.interface, full.coordinates)
        inner = np.setdiff1d(np.arange(len(full.coordinates)), held)
        shapes = _fixed_interface_modes(full, inner, self.modes)
        basis = np.zeros((len(full.coordinates), len(held) + shapes.shape[1]))
        basis[held, : len(held)] = np.eye(len(held))
        basis[inner, : len(held)] = _static_modes(full, held, inner)
        basis[inner, len(held) :] = shapes
        names = (*self.interface, *(f"fixed_mode{j + 1}" for j in range(shapes.shape[1])))
        rigid = np.vstack([rigid_basis(full)[held], np.zeros((shapes.shape[1], rigid_basis(full).shape[1]))])
        return galerkin(full, self, basis, names, rigid, self.static_correction)


def _positions(wanted: tuple[str, ...], known: tuple[str, ...]) -> np.ndarray:
    for name in wanted:
        if name not in known:
            raise ReductionError(f"interface coordinate {name!r} does not exist{did_you_mean(name, known)}")
    if not wanted or len(set(wanted)) < len(wanted):
        raise ReductionError("interface must name at least one coordinate, each once")
    return np.array([known.index(name) for name in wanted])


def _static_modes(full: LinearModel, held: np.ndarray, inner: np.ndarray) -> np.ndarray:
    if not len(inner):
        return np.zeros((0, len(held)))
    rows = full.K.tocsr()[inner]
    return -splu(sp.csc_matrix(rows[:, inner])).solve(rows[:, held].toarray())


def _fixed_interface_modes(full: LinearModel, inner: np.ndarray, choice: int | BelowFrequency) -> np.ndarray:
    """Modes of every uncoupled piece of the interior, lowest first over all pieces."""
    K, M = (A.tocsr()[inner][:, inner] for A in (full.K, full.M))
    count, label = connected_components(abs(K) + abs(M), directed=False)
    columns, squares = [np.zeros((len(inner), 0))], [np.zeros(0)]
    for piece in range(count):
        rows = np.flatnonzero(label == piece)
        try:
            pairs = _piece_modes(K[rows][:, rows], M[rows][:, rows], choice)
        except LinearizationError as error:
            some = ", ".join(full.coordinates[inner[r]] for r in rows[:3])
            raise ReductionError(f"no fixed-interface modes of the piece with {some}: {error}") from error
        if pairs.rigid.any() or (pairs.values <= 0).any():
            worst = full.coordinates[inner[rows[abs(pairs.shapes[:, 0]).argmax()]]]
            raise ReductionError(
                f"with the interface held, coordinate {worst!r} can still move without elastic force: "
                "add coordinates of that piece to the interface until it is held"
            )
        keep = _chosen(pairs, choice)
        shape = np.zeros((len(inner), keep))
        shape[rows] = pairs.shapes[:, :keep]
        columns.append(shape)
        squares.append(pairs.values[:keep])
    return np.hstack(columns)[:, np.argsort(np.concatenate(squares), kind="stable")]


def _chosen(pairs: Eigenpairs, choice: int | BelowFrequency) -> int:
    if isinstance(choice, BelowFrequency):
        return int(np.count_nonzero(pairs.values < (2 * np.pi * choice.hz) ** 2))
    return min(choice, len(pairs.values))


def _piece_modes(K: sp.csr_matrix, M: sp.csr_matrix, choice: int | BelowFrequency) -> Eigenpairs:
    """Enough of the lowest pairs of one piece, in its own coordinates; at least one, to see rigid motion."""
    s = coordinate_scales(M, 0 * M, K)
    k, m = congruent(s, K, M)
    n = k.shape[0]
    if n <= DENSE:
        pairs = complete_pairs(k.toarray(), m.toarray())
    else:
        wanted = choice if isinstance(choice, int) else 20
        pairs = lowest_pairs(k, m, max(wanted, 1))
        while (
            isinstance(choice, BelowFrequency) and pairs.values[-1] < (2 * np.pi * choice.hz) ** 2 and wanted < n // 2
        ):
            wanted *= 2
            pairs = lowest_pairs(k, m, wanted)
    return replace(pairs, shapes=s[:, None] * pairs.shapes)
