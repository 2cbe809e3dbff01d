"""Machines with a share of the stiffness of some shafts or ropes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import scipy.sparse as sp

from flexctrl.model.laws.families import Family
from flexctrl.model.laws.loose_kinds import LOOSE_DRIVES
from flexctrl.model.laws.part_kinds import HEAVY_ROPE, LINEAR_DRIVE, ROPE, ROTARY_DRIVE
from flexctrl.model.model import Model
from flexctrl.structure.drives import LinearDrive, RotaryDrive
from flexctrl.structure.lines import Rope

__all__ = ["ropes_of", "shafts_of", "softened"]

_SHAFTS, _ROPES = (ROTARY_DRIVE, LINEAR_DRIVE, *LOOSE_DRIVES), (ROPE, HEAVY_ROPE)


def shafts_of(model: Model) -> dict[int, str]:
    """Return the coordinates of motors behind shafts, and their drives; what pays out a rope is none of them.

    Parameters
    ----------
    model : Model

    Returns
    -------
    dict of int to str
    """
    drives = zip(model.motion.sources.tolist(), model.structure.drives, strict=True)
    shafts = [(i, drive.name) for i, drive in drives if isinstance(drive, RotaryDrive | LinearDrive)]
    return {i: name for i, name in shafts if i < model.n}


def ropes_of(model: Model) -> dict[str, float]:
    """Return the stiffness EA of ropes that turn and stretch [N], by name; small motion has none.

    Parameters
    ----------
    model : Model

    Returns
    -------
    dict of str to float
    """
    ropes = [p for p in model.structure.elements if isinstance(p, Rope)] if model.large else []
    return {rope.name: rope.EA for rope in ropes if model.bends(rope)}


def softened(model: Model, shares: Mapping[str, float]) -> Model:
    """Return a machine with a share of the stiffness and damping of the shafts of some drives, or of that of ropes.

    Parameters
    ----------
    model : Model
        Of no small motion about an equilibrium (`GeometricStiffness`).
    shares : mapping of str to float
        By the names of drives and ropes.

    Returns
    -------
    Model
    """
    soft = replace(model)
    soft.__dict__.update({name: model.__dict__[name] for name in ("signals", "gusts") if name in model.__dict__})
    soft.__dict__["forces"] = replace(model.forces, families=tuple(_soft(f, shares) for f in model.forces.families))
    if not model.large:
        soft.__dict__["_stiffness"] = _stiffness(model, shares)
    return soft


def _soft(family: Family, shares: Mapping[str, float]) -> Family:
    columns = 2 if family.kernels.kind in _SHAFTS else 1 if family.kernels.kind in _ROPES else 0
    parameters = family.parameters.copy()
    parameters[:, :columns] *= np.array([shares.get(name, 1.0) for name in family.parts])[:, None]
    return replace(family, parameters=parameters)


def _stiffness(model: Model, shares: Mapping[str, float]) -> sp.csc_matrix:
    """K of small motion: without these shafts, and the shares of theirs."""
    whole, left = model.stiffness(), model.stiffness_but(frozenset(shares))
    added = (share * (whole - model.stiffness_but(frozenset({name}))) for name, share in shares.items())
    return sp.csc_matrix(sum(added, start=left))
