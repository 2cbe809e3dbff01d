"""How fast dry contacts slip by themselves: what small and large speeds and times are to them, in any units."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flexctrl.frozen import frozen
from flexctrl.model.solve import factorise
from flexctrl.model.units import units

if TYPE_CHECKING:
    from flexctrl.model.model import Model

__all__ = ["SlipScales", "mobilities", "slip_scales"]


@frozen(eq=False)
class SlipScales:
    """What the force F that a contact bears makes of the mass m that it moves, within a radian or a machine's size L.

    Attributes
    ----------
    speeds : numpy.ndarray, shape (contacts,)
        √(F L / m) [m/s or rad/s].
    rate : float
        √(F / (m L)), the geometric mean over all contacts [1/s].
    """

    speeds: np.ndarray
    rate: float


def slip_scales(model: Model, W: np.ndarray, bears: np.ndarray) -> SlipScales:
    """Return the scales of contacts of a machine at rest.

    Parameters
    ----------
    model : Model
    W : numpy.ndarray, shape (contacts, n)
        Slip speeds from the rates of the degrees of freedom.
    bears : numpy.ndarray, shape (contacts,)
        F [N or N m].

    Returns
    -------
    SlipScales
    """
    if not len(W):
        return SlipScales(np.zeros(0), 1.0)
    spans = np.abs(W * units(model, model.structure.size)).max(axis=1)
    moved = bears * mobilities(model, W)
    moves = (spans > 0.0) & (moved > 0.0)  # else nothing with mass is there: a run does not begin
    spans, moved = np.where(moves, spans, 1.0), np.where(moves, moved, 1.0)
    return SlipScales(np.sqrt(moved * spans), float(np.exp(0.5 * np.log(moved / spans).mean())))


def mobilities(model: Model, W: np.ndarray) -> np.ndarray:
    """Return what accelerations along themselves unit forces along rows W bring about at rest, shape (contacts,)."""
    still = np.zeros(model.n)
    M = -model.slope(model.rest.loose, still, still, (0.0, 0.0, 1.0), np.zeros(len(model.inputs)))
    heavy = np.flatnonzero(M.diagonal() > model.dust)
    solve = factorise(M[heavy][:, heavy])
    return np.array([row @ solve(row) for row in W[:, heavy]])
