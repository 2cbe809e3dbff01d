"""Motions in words: which node turns about or moves along which axis."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np
import scipy.sparse as sp

__all__ = ["motions_in_words"]

_FREEDOM = re.compile(r"(.+)_(\d+)_(r?)([uvwxyz])$")
_MOST, _SHARE, _DUST = 4, 0.1, 1e-3


def motions_in_words(basis: sp.csc_matrix, names: Sequence[str], scales: np.ndarray) -> tuple[str, ...]:
    """Say what moves in each of some motions, most first.

    Parameters
    ----------
    basis : scipy.sparse.csc_matrix, shape (n, k)
        Columns, in scaled coordinates.
    names : sequence of n str
        Coordinates.
    scales : numpy.ndarray, shape (n,)
        Displacement of a coordinate for one of the scaled one.

    Returns
    -------
    tuple of k str
        E.g. ``"strut 0: rotation about (0.6, 0.8, 0)"``.
    """
    return tuple(_words(column, names, scales) for column in basis.toarray().T) if basis.shape[1] else ()


def _words(column: np.ndarray, names: Sequence[str], scales: np.ndarray) -> str:
    sizes: dict[str, float] = {}
    along: dict[str, np.ndarray] = {}
    for i in np.argsort(-np.abs(column), kind="stable").tolist():
        label, axis = _place(names[i])
        sizes[label] = max(sizes.get(label, 0.0), abs(float(column[i])))
        if axis >= 0:
            along.setdefault(label, np.zeros(3))[axis] = column[i] * scales[i]
    moving = [label for label, size in sizes.items() if size > _SHARE * max(sizes.values())]
    said = [label + (_axis(along[label]) if label in along else "") for label in moving[:_MOST]]
    return ", ".join(said) + (" and others" if len(moving) > _MOST else "")


def _place(name: str) -> tuple[str, int]:
    """What a coordinate is a component of, and which one; −1 for one that stands for itself."""
    found = _FREEDOM.match(name)
    if not found or (found[3] == "r") != (found[4] in "xyz"):
        return name, -1
    kind = "rotation about" if found[3] else "translation along"
    return f"{found[1]} {found[2]}: {kind} ", "xyz".index(found[4]) if found[3] else "uvw".index(found[4])


def _axis(vector: np.ndarray) -> str:
    unit = vector / np.linalg.norm(vector)
    unit = np.where(np.abs(unit) < _DUST, 0.0, unit)
    unit = unit * np.sign(unit[np.flatnonzero(unit)[0]]) + 0.0
    return "(" + ", ".join(f"{x:.3g}" for x in unit) + ")"
