"""MATLAB (v5) files that MATLAB, Octave and Scilab read: M, C, K, B, Cq, Cv, D, names and units."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp

from flexctrl.errors import LinearizationError, StructureError, did_you_mean
from flexctrl.frozen import frozen
from flexctrl.linear.model import LinearModel
from flexctrl.linear.parts import PartMatrices

__all__ = ["Units", "load_mat", "load_units", "save_mat"]

FORMAT = "flexctrl linear model 1"
EQUATIONS = "M q'' + C q' + K q = B u, y = Cq q + Cv q' + D u"


KNOWN_UNITS: dict[str, dict[str, float]] = {
    "length": {
        "m": 1.0, "dm": 0.1, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "µm": 1e-6, "km": 1e3, "in": 0.0254, "ft": 0.3048,
    },
    "mass": {
        "kg": 1.0, "g": 1e-3, "mg": 1e-6, "ug": 1e-9, "µg": 1e-9, "t": 1e3, "Mg": 1e3, "kt": 1e6, "lb": 0.45359237,
        "slug": 14.593902937206364, "slinch": 175.12683524647636,
    },
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "min": 60.0, "h": 3600.0},
    "force": {
        "N": 1.0, "mN": 1e-3, "uN": 1e-6, "µN": 1e-6, "nN": 1e-9, "kN": 1e3, "MN": 1e6, "GN": 1e9, "dyn": 1e-5,
        "pdl": 0.138254954376, "lbf": 4.4482216152605, "kip": 4448.2216152605,
    },
    "angle": {"rad": 1.0},
}  # fmt: skip
"""Names of units by kind, and their sizes in SI."""


@frozen
class Units:
    """Names of the units that the numbers of a model are in; nothing is converted by them.

    Attributes
    ----------
    length, mass, time, force : str
        Consistent ones: force = mass · length/time², e.g. ``Units("mm", "t", "s", "N")``.
    angle : str
        ``"rad"``.

    Raises
    ------
    StructureError
        For a name that is no unit, or a force that is not that of the others.
    """

    length: str = "m"
    mass: str = "kg"
    time: str = "s"
    force: str = "N"
    angle: str = "rad"

    def __post_init__(self) -> None:
        for kind, known in KNOWN_UNITS.items():
            name = getattr(self, kind)
            if not isinstance(name, str) or name not in known:
                hint = did_you_mean(name, known) if isinstance(name, str) else f"; known: {', '.join(known)}"
                raise StructureError(f"Units: {kind} = {name!r} is no unit of {kind}{hint}")
        length, mass, time, force = (KNOWN_UNITS[kind][getattr(self, kind)] for kind in KNOWN_UNITS if kind != "angle")
        if abs(force / (mass * length / time**2) - 1.0) > 1e-6:
            raise StructureError(
                f"Units: {self.force} is not {self.mass}·{self.length}/{self.time}², so M q̈ and K q would not add; "
                "give consistent units, e.g. Units('mm', 't', 's', 'N')"
            )

    def __str__(self) -> str:
        return ", ".join(f"{field.name} {getattr(self, field.name)}" for field in fields(self))


SI = Units()


def save_mat(linear: LinearModel, path: str | Path, units: Units = SI) -> None:
    """Write the matrices (sparse ones kept sparse), names and units.

    In MATLAB: ``s = load(path); sys = mechss(s.M, s.C, s.K, s.B, s.Cq, s.Cv, s.D)``; in Scilab:
    ``loadmatfile(path)``.

    Parameters
    ----------
    linear : LinearModel
    path : str or pathlib.Path
    units : Units
        What the model's numbers are in, if the machine was not described in SI units.

    Raises
    ------
    LinearizationError
        If the file cannot be written there, or the units are none.
    """
    from scipy.io import savemat

    if not isinstance(units, Units):
        raise LinearizationError(f"save_mat: units = {units!r}; expected Units, e.g. Units('mm', 't', 's', 'N')")
    names = list(linear.parts)
    content: dict[str, Any] = {
        "format": FORMAT,
        "units": f"{units}; {EQUATIONS}",
        "name": linear.name,
        **{key: _sparse(getattr(linear, key)) for key in ("M", "C", "K")},
        **{key: np.asarray(getattr(linear, key), dtype=float) for key in ("B", "Cq", "Cv", "D")},
        **{key: _cell(getattr(linear, key)) for key in ("coordinates", "inputs", "outputs")},
        "part_names": _cell(names),
        "part_stiffness": _cell([_sparse(linear.parts[name].stiffness) for name in names]),
        "part_mass": _cell([_sparse(linear.parts[name].mass) for name in names]),
    }
    try:
        savemat(str(path), content, format="5", oned_as="column")
    except OSError as error:
        reason = error.strerror or str(error)
        raise LinearizationError(
            f"save_mat: {path} cannot be written ({reason}); give a file in a folder that exists"
        ) from error


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
    content = _content(path)
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


def load_units(path: str | Path) -> Units:
    """Read in which units a model written by :func:`save_mat` is.

    Parameters
    ----------
    path : str or pathlib.Path

    Returns
    -------
    Units

    Raises
    ------
    LinearizationError
        If the file is not such a model.
    """
    content = _content(path)
    text = str(np.ravel(content.get("units", [""]))[0]).split(";")[0]
    found = dict(term.strip().split(" ", 1) for term in text.split(",") if " " in term.strip())
    if set(found) != {field.name for field in fields(Units)}:
        raise LinearizationError(f"{path} does not tell its units as save_mat writes them; it says {text!r}")
    try:
        return Units(**found)
    except StructureError as error:
        raise LinearizationError(f"{path} is in units that are none: {error}") from error


def _content(path: str | Path) -> dict[str, Any]:
    """What a MATLAB file holds."""
    from scipy.io import loadmat
    from scipy.io.matlab import MatReadError

    try:
        return dict(loadmat(str(path), chars_as_strings=True))
    except FileNotFoundError as error:
        raise LinearizationError(f"there is no file {path}") from error
    except RuntimeError as error:
        raise LinearizationError(f"{path} is a MATLAB 7.3 (HDF5) file; write it with save(…, '-v7')") from error
    except (ValueError, TypeError, KeyError, IndexError, OSError, MatReadError, struct.error, zlib.error) as error:
        raise LinearizationError(f"{path} is no MATLAB file ({error}); give one that save_mat wrote") from error


def _sparse(A: sp.spmatrix) -> sp.csc_matrix:
    return sp.csc_matrix(A, dtype=float)


def _cell(items: Sequence[Any]) -> np.ndarray:
    cell = np.empty((len(items), 1), dtype=object)
    for i, item in enumerate(items):
        cell[i, 0] = item
    return cell


def _names(cell: np.ndarray) -> tuple[str, ...]:
    return tuple(str(np.ravel(item)[0]) for item in np.ravel(cell))
