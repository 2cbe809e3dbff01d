"""Machines with a share of the stiffness of some shafts, or with ropes and beams that stretch."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import scipy.sparse as sp

from flexctrl.mechanics.corotation import PARAMETERS
from flexctrl.model.laws.families import Family
from flexctrl.model.laws.loose_kinds import LOOSE_DRIVES
from flexctrl.model.laws.part_kinds import BEAM, HEAVY_ROPE, LINEAR_DRIVE, ROPE, ROTARY_DRIVE
from flexctrl.model.model import Model
from flexctrl.structure.drives import LinearDrive, RotaryDrive

__all__ = ["shafts_of", "softened", "stiffest", "stretching"]

_KINDS = (ROTARY_DRIVE, LINEAR_DRIVE, *LOOSE_DRIVES)
_ROPES, _EA = (ROPE, HEAVY_ROPE), PARAMETERS.index("EA")


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


def softened(model: Model, shares: Mapping[str, float]) -> Model:
    """Return a machine with a share of the stiffness and damping of the shafts of some drives.

    Parameters
    ----------
    model : Model
        Of no small motion about an equilibrium (`GeometricStiffness`).
    shares : mapping of str to float
        By the names of drives.

    Returns
    -------
    Model
    """
    soft = _with(model, tuple(_soft(f, shares) for f in model.forces.families))
    if not model.large:
        soft.__dict__["_stiffness"] = _stiffness(model, shares)
    return soft


def stiffest(model: Model) -> float:
    """Return the largest axial stiffness EA among ropes and beams that turn [N]; 0 where there is none."""
    found = (_axial(family)[0].max(initial=0.0) for family in model.forces.families if model.large)
    return float(max(found, default=0.0))


def stretching(model: Model, most: float) -> Model:
    """Return a machine whose ropes and beams have an axial stiffness EA of no more than so much [N].

    Parameters
    ----------
    model : Model
        Of large motion.
    most : float

    Returns
    -------
    Model
    """

    def soft(family: Family) -> Family:
        EA, column = _axial(family)
        firm = most < EA
        parameters = family.parameters.copy()
        parameters[firm, column] *= most / EA[firm]
        return replace(family, parameters=parameters)

    return _with(model, tuple(soft(family) for family in model.forces.families))


def _axial(family: Family) -> tuple[np.ndarray, int]:
    """The axial stiffness of ropes and beams, and the parameter that it goes by; 0 of others."""
    parameters = family.parameters
    if family.kernels.kind in _ROPES:
        return parameters[:, 0] * parameters[:, 1], 0
    return (parameters[:, _EA], _EA) if family.kernels.kind == BEAM else (np.zeros(len(parameters)), 0)


def _with(model: Model, families: tuple[Family, ...]) -> Model:
    """A machine with others in place of its families."""
    soft = replace(model)
    soft.__dict__.update({name: model.__dict__[name] for name in ("signals", "gusts") if name in model.__dict__})
    soft.__dict__["forces"] = replace(model.forces, families=families)
    return soft


def _soft(family: Family, shares: Mapping[str, float]) -> Family:
    if family.kernels.kind not in _KINDS:
        return family
    parameters = family.parameters.copy()
    parameters[:, :2] *= np.array([shares.get(name, 1.0) for name in family.parts])[:, None]
    return replace(family, parameters=parameters)


def _stiffness(model: Model, shares: Mapping[str, float]) -> sp.csc_matrix:
    """K of small motion: without these shafts, and the shares of theirs."""
    whole, left = model.stiffness(), model.stiffness_but(frozenset(shares))
    added = (share * (whole - model.stiffness_but(frozenset({name}))) for name, share in shares.items())
    return sp.csc_matrix(sum(added, start=left))
