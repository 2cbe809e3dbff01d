"""What each part contributes to K and M, kept part by part without a matrix of the whole machine for each."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from flexctrl.frozen import frozen

__all__ = ["PartMatrices", "Parts", "energies_by_part", "parts_of", "projected_parts", "with_springs"]


@frozen
class PartMatrices:
    """What one part (a beam, a drive …) contributes to K and M: for energy shares by part.

    Attributes
    ----------
    stiffness, mass : scipy.sparse.csc_matrix, shape (n, n)
        The part's own share, in the model's coordinates.
    """

    stiffness: sp.csc_matrix
    mass: sp.csc_matrix


@frozen(eq=False)
class Parts(Mapping[str, PartMatrices]):
    """The shares of all parts in one stack: rows of a part's own freedoms, one part after the other.

    Attributes
    ----------
    names : tuple of str
    starts : numpy.ndarray of int, shape (parts + 1,)
        Where each part's rows begin, and where the last end.
    reach : scipy.sparse.csr_matrix, shape (rows, n)
        Motion of the parts' own freedoms with the model's coordinates.
    stiffness, mass : scipy.sparse.csr_matrix, shape (rows, rows)
        Symmetric, a diagonal block for each part.
    """

    names: tuple[str, ...]
    starts: np.ndarray
    reach: sp.csr_matrix
    stiffness: sp.csr_matrix
    mass: sp.csr_matrix

    @cached_property
    def _places(self) -> dict[str, int]:
        return {name: i for i, name in enumerate(self.names)}

    def __getitem__(self, name: str) -> PartMatrices:
        i = self._places[name]
        rows = slice(int(self.starts[i]), int(self.starts[i + 1]))
        T = self.reach[rows]
        stiffness, mass = (sp.csc_matrix(T.T @ A[rows, rows] @ T) for A in (self.stiffness, self.mass))
        return PartMatrices(stiffness, mass)

    def __iter__(self) -> Iterator[str]:
        return iter(self.names)

    def __len__(self) -> int:
        return len(self.names)

    def projected(self, basis: sp.spmatrix) -> Parts:
        """The same in other coordinates b, q = T b.

        Parameters
        ----------
        basis : sparse matrix, shape (n, k)

        Returns
        -------
        Parts
        """
        return replace(self, reach=sp.csr_matrix(self.reach @ basis))

    def energies(self, shapes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """φᴴ K φ and φᴴ M φ of every part.

        Parameters
        ----------
        shapes : numpy.ndarray, shape (n, k)
            May be complex.

        Returns
        -------
        tuple of two numpy.ndarray, shape (parts, k)
        """
        own = self.reach @ shapes
        strain, kinetic = (self._summed((own.conj() * (A @ own)).real) for A in (self.stiffness, self.mass))
        return strain, kinetic

    def _summed(self, density: np.ndarray) -> np.ndarray:
        return np.add.reduceat(density, self.starts[:-1], axis=0)


def parts_of(
    owners: np.ndarray, cells: list[np.ndarray], stiffness: np.ndarray, mass: np.ndarray, reach: sp.csr_matrix
) -> Parts:
    """Stack the tangent blocks of pieces by the parts that own them.

    Parameters
    ----------
    owners : numpy.ndarray of str, shape (pieces,)
        The part of each piece.
    cells : list of numpy.ndarray of int
        Raw freedoms of each piece, family by family: shape (pieces of the family, width).
    stiffness, mass : numpy.ndarray
        Entries of the pieces' blocks, column by column, piece after piece.
    reach : scipy.sparse.csr_matrix, shape (raw, n)
        Motion of the raw freedoms with the model's coordinates.

    Returns
    -------
    Parts
    """
    names = tuple(dict.fromkeys(owners.tolist()))
    number = {name: i for i, name in enumerate(names)}
    part = np.array([number[name] for name in owners.tolist()], dtype=int)
    widths = np.concatenate([np.full(len(c), c.shape[1], dtype=int) for c in cells])
    keys, own = np.unique(
        np.repeat(part, widths) * reach.shape[0] + np.concatenate([c.ravel() for c in cells]), return_inverse=True
    )
    starts = np.searchsorted(keys, np.arange(len(names) + 1) * reach.shape[0])
    rows, columns = _block_places(own, cells)
    size = (keys.size, keys.size)
    blocks = (sp.csr_matrix((data, (rows, columns)), shape=size) for data in (stiffness, mass))
    K, M = (sp.csr_matrix(0.5 * (A + A.T)) for A in blocks)
    return Parts(names, starts, sp.csr_matrix(reach[keys % reach.shape[0]]), K, M)


def with_springs(parts: Parts, owners: Mapping[str, int], stiffness: np.ndarray) -> Parts:
    """Add springs that hold single coordinates to the ground.

    Parameters
    ----------
    parts : Parts
    owners : mapping of str to int
        The part that each belongs to, and the coordinate.
    stiffness : numpy.ndarray, shape (n,)
        By coordinates.

    Returns
    -------
    Parts
    """
    part = np.array([parts.names.index(name) for name in owners], dtype=int)
    held, n = np.fromiter(owners.values(), dtype=int), parts.reach.shape[1]
    rows = np.append(np.repeat(np.arange(len(parts)), np.diff(parts.starts)), part)
    order = np.argsort(rows, kind="stable")
    springs, none = sp.diags(stiffness[held]), sp.csr_matrix((held.size, held.size))
    K, M = (sp.block_diag([A, B], "csr")[order][:, order] for A, B in ((parts.stiffness, springs), (parts.mass, none)))
    reach = sp.vstack([parts.reach, sp.identity(n, format="csr")[held]], "csr")[order]
    return Parts(parts.names, np.searchsorted(rows[order], np.arange(len(parts) + 1)), sp.csr_matrix(reach), K, M)


def _block_places(own: np.ndarray, cells: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Rows and columns in the stack of all block entries."""
    rows, columns, start = [], [], 0
    for c in cells:
        local = own[start : start + c.size].reshape(c.shape)
        rows.append(np.tile(local, (1, c.shape[1])).ravel())
        columns.append(np.repeat(local, c.shape[1], axis=1).ravel())
        start += c.size
    return np.concatenate(rows), np.concatenate(columns)


def projected_parts(parts: Mapping[str, PartMatrices], basis: sp.spmatrix) -> Mapping[str, PartMatrices]:
    """The shares of the parts in other coordinates b, q = T b.

    Parameters
    ----------
    parts : mapping of str to PartMatrices
    basis : sparse matrix, shape (n, k)

    Returns
    -------
    mapping of str to PartMatrices
    """
    if isinstance(parts, Parts):
        return parts.projected(basis)
    return {
        name: PartMatrices(*(sp.csc_matrix(basis.T @ A @ basis) for A in (part.stiffness, part.mass)))
        for name, part in parts.items()
    }


def energies_by_part(parts: Mapping[str, PartMatrices], shapes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """φᴴ K φ and φᴴ M φ of every part.

    Parameters
    ----------
    parts : mapping of str to PartMatrices
    shapes : numpy.ndarray, shape (n, k)
        May be complex.

    Returns
    -------
    tuple of two numpy.ndarray, shape (parts, k)
    """
    if isinstance(parts, Parts):
        return parts.energies(shapes)
    size = (len(parts), shapes.shape[1])
    strain, kinetic = (
        np.array([np.einsum("ij,ij->j", shapes.conj(), A @ shapes).real for A in matrices]).reshape(size)
        for matrices in ([p.stiffness for p in parts.values()], [p.mass for p in parts.values()])
    )
    return strain, kinetic
