"""MATLAB (v5) files that MATLAB, Octave and Scilab read: M, C, K, B, Cq, Cv, D, names and units."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp

from flexctrl.errors import LinearizationError
from flexctrl.linear.model import LinearModel, PartMatrices

__all__ = ["load_mat", "save_mat"]

FORMAT = "flexctrl linear model 1"
UNITS = (
    "SI: time s, displacement m, rotation rad, mass kg and kg m^2, force N and N m; "
    "M q'' + C q' + K q = B u, y = Cq q + Cv q' + D u"
)


def save_mat(linear: LinearModel, path: str | Path) -> None:
    """Write the matrices (sparse ones kept sparse), names and units.

    In MATLAB: ``s = load(path); sys = mechss(s.M, s.C, s.K, s.B, s.Cq, s.Cv, s.D)``; in Scilab:
    ``loadmatfile(path)``.

    Parameters
    ----------
    linear : LinearModel
    path : str or pathlib.Path
    """
    from scipy.io import savemat

    names = list(linear.parts)
    content: dict[str, Any] = {
        "format": FORMAT,
        "units": UNITS,
        "name": linear.name,
        **{key: _sparse(getattr(linear, key)) for key in ("M", "C", "K")},
        **{key: np.asarray(getattr(linear, key), dtype=float) for key in ("B", "Cq", "Cv", "D")},
        **{key: _cell(getattr(linear, key)) for key in ("coordinates", "inputs", "outputs")},
        "part_names": _cell(names),
        "part_stiffness": _cell([_sparse(linear.parts[name].stiffness) for name in names]),
        "part_mass": _cell([_sparse(linear.parts[name].mass) for name in names]),
    }
    savemat(str(path), content, format="5", oned_as="column")


def load_mat(path: str | Path) -> LinearModel:
    """Read what :func:`save_mat` wrote.

    Parameters
    ----------
    path : str or pathlib.Path

    Returns
    -------
    LinearModel

    Raises
    ------
    LinearizationError
        If the file is not such a model.
    """
    from scipy.io import loadmat

    content = loadmat(str(path), chars_as_strings=True)
    missing = [key for key in ("M", "C", "K", "B", "Cq", "Cv", "D", "coordinates") if key not in content]
    if missing:
        raise LinearizationError(f"{path} is not a linear model written by save_mat: {', '.join(missing)} missing")
    coordinates, inputs, outputs = (_names(content[key]) for key in ("coordinates", "inputs", "outputs"))
    n, m, p = len(coordinates), len(inputs), len(outputs)
    parts = {
        name: PartMatrices(sp.csc_matrix(k), sp.csc_matrix(mass))
        for name, k, mass in zip(
            _names(content["part_names"]),
            content["part_stiffness"].ravel(),
            content["part_mass"].ravel(),
            strict=True,
        )
    }
    return LinearModel(
        M=sp.csc_matrix(content["M"]),
        C=sp.csc_matrix(content["C"]),
        K=sp.csc_matrix(content["K"]),
        B=content["B"].reshape(n, m),
        Cq=content["Cq"].reshape(p, n),
        Cv=content["Cv"].reshape(p, n),
        D=content["D"].reshape(p, m),
        coordinates=coordinates,
        inputs=inputs,
        outputs=outputs,
        name=str(np.ravel(content["name"])[0]),
        parts=parts,
    )


def _sparse(A: sp.spmatrix) -> sp.csc_matrix:
    return sp.csc_matrix(A, dtype=float)


def _cell(items: Sequence[Any]) -> np.ndarray:
    cell = np.empty((len(items), 1), dtype=object)
    for i, item in enumerate(items):
        cell[i, 0] = item
    return cell


def _names(cell: np.ndarray) -> tuple[str, ...]:
    return tuple(str(np.ravel(item)[0]) for item in np.ravel(cell))
