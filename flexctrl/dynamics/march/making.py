"""The record of a march, made for a model and a method."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import numpy as np

from flexctrl.dynamics.alpha.coning import coning_of
from flexctrl.dynamics.alpha.point import Coefficients
from flexctrl.dynamics.floating import floats
from flexctrl.dynamics.march.answer import no_answer
from flexctrl.dynamics.march.closing import closing_of
from flexctrl.dynamics.march.corners import corners_of
from flexctrl.dynamics.march.flowing import flows_of
from flexctrl.dynamics.march.lagging import lags_of
from flexctrl.dynamics.march.law import no_law
from flexctrl.dynamics.march.probing import probes_of
from flexctrl.dynamics.march.record import (
    Factors,
    March,
    no_leap,
)
from flexctrl.dynamics.march.shelf import width_of
from flexctrl.dynamics.scales import components
from flexctrl.dynamics.swift.stiff_lines import firmest
from flexctrl.dynamics.swift.thrown import holding_inputs, may_throw
from flexctrl.frozen import frozen
from flexctrl.kernels.native import Packed
from flexctrl.model.flat.flattening import Flattened
from flexctrl.model.flat.fronts import LARGE

__all__ = ["CAPACITY", "Method", "march_of"]


CAPACITY = 4096
"""Steps in one call."""
_SHELF, _BYTES = 1024, 16e6
"""States kept in one call, and what they may take."""
_SHARE, _KEEPING = 3e-3, 1e-4  # where nothing is damped, what Newton's method leaves adds up
_MADE, _ASKED = 5.0, 100.0
_LOOSEST = 1e-6
_TIGHT = 0.99e-10
_ADRIFT = 3e-13
"""Where nothing holds a part: under a tangent that is kept what is left has one sign in all steps, and is momentum."""


@frozen
class Method:
    """What a march needs to know of the method.

    Attributes
    ----------
    coefficients : Coefficients
    least : float
        Tolerance of Newton's method; one that is not tight may be loosened to a share of the method's own error.
    weight : numpy.ndarray, shape (n,)
        One over the yardsticks of the degrees of freedom.
    turning : numpy.ndarray of bool, shape (n,)
    """

    coefficients: Coefficients
    least: float
    weight: np.ndarray
    turning: np.ndarray


def march_of(F: Flattened, contacts: Any, method: Method, leaping: int, answering: int) -> March:
    """Return the record of a march.

    Parameters
    ----------
    F : Flattened
    contacts : Packed
        Dry ones, of the same model.
    method : Method
    leaping : int
        Whether steps are exact ones.
    answering : int
        Whether inputs follow from what is at the end of a step.
    """
    corners: Any = Packed(corners_of(F))
    closing: Any = Packed(closing_of(F))
    probes = probes_of(F, method.weight)
    lags: Any = Packed(lags_of(F.model, F.plan.position, F.flat.padded))
    brief = contacts.count == 0 and _brief(F, probes.groups)
    return March(
        flat=F.flat,
        gauges=F.gauges,
        corners=corners,
        closing=closing,
        flows=flows_of(F),
        contacts=contacts,
        law=no_law(),
        answer=no_answer(),
        leap=no_leap(),
        fronts=F.plan.fronts,
        axes=F.axes,
        tangent=_factors(F, F.axes.swaying, brief),
        mass=_factors(F, 0, False),
        probes=probes,
        lags=lags,
        entries=np.zeros(F.plan.length + 1),
        leaping=leaping,
        answering=answering,
        brief=int(brief),
        **_motion(F),
        **_yardsticks(F, method),
        **_room(F),
        **asdict(method.coefficients),
        **_newton(F, method, probes.groups),
    )


def _motion(F: Flattened) -> dict[str, Any]:
    """Where the motion stands, and what turns in it."""
    names = ["v", "left", "own", "rate", "algorithmic", "trend", "pulled", "fresh", "before", "asked", "reach", "first"]
    names += ["ahead", "swept", "bent", "path", "stray"]
    cones = F.plan.position[coning_of(F.model).triples]
    cones = cones[np.argsort(cones.max(axis=1, initial=0))]
    vectors = dict(zip(names, np.zeros((len(names), F.flat.padded)), strict=True))
    return {**vectors, "cones": cones.ravel(), "coning": len(cones), "firmest": firmest(F.model), **_throwing(F)}


def _throwing(F: Flattened) -> dict[str, Any]:
    damping, holding = holding_inputs(F.model)
    return {"throws": int(may_throw(F.model)), "damping": damping, "holding": holding}


def _yardsticks(F: Flattened, method: Method) -> dict[str, Any]:
    part = components(F.model)
    parts = int(part.max(initial=0)) + 1
    return {
        "weight": F.ordered(method.weight),
        "turns": F.ordered(method.turning.astype(float)),
        "dust": F.ordered(F.model.dust),
        "parts": parts,
        "part": part[F.plan.order],
        "farthest": np.zeros(parts),
    }


def _room(F: Flattened) -> dict[str, Any]:
    """Room for rows and states."""
    state = width_of(F)
    shelf = int(min(_SHELF, max(1, _BYTES // (8 * state))))
    return {"rows": np.zeros((1 + F.gauges.outputs) * CAPACITY), "states": np.zeros(state * shelf), "shelf": shelf}


def _newton(F: Flattened, method: Method, groups: int) -> dict[str, Any]:
    """How exactly Newton's method solves steps, and with which tangents."""
    flat = F.flat
    least = min(method.least, _ADRIFT) if floats(F.model) else method.least
    return {
        "least": least,
        "tolerance": least,
        "loosest": max(least, _LOOSEST if least >= _TIGHT else 0.0),
        "share": _SHARE if method.coefficients.damping else _KEEPING,
        "price": _MADE + groups if flat.tangents or groups else _ASKED,
        "asking": int(not flat.tangents and not groups),
        "swift": int(flat.quick > 0 and not flat.pressing),
        "whole": flat.pressing,
        "lawful": int(F.model.large),
    }


def _brief(F: Flattened, groups: int) -> bool:
    """Tell whether tangents may be solved with in single precision: of what is large and has no line that is stiff.

    What sticks is held by what the tangent answers: there rounding was seen to cost up to ten times the tangents.
    """
    fronts = F.plan.fronts
    return fronts.n > LARGE and fronts.beyond == 0 and bool(F.flat.tangents) and groups == 0 and firmest(F.model) == 0.0


def _factors(F: Flattened, swaying: int, brief: bool) -> Factors:
    axes, fronts = F.axes, F.plan.fronts
    return Factors(
        down=np.zeros(fronts.below + 8),
        up=np.zeros(fronts.right + 8),
        diagonal=np.zeros(fronts.n),
        work=np.zeros(F.plan.widest),
        wide=np.zeros(fronts.n + 8 if fronts.beyond else 0),
        made=np.zeros(9 * axes.count),
        turned=np.zeros(9 * axes.count),
        angles=np.zeros(axes.angle_count),
        place=np.zeros(F.flat.posed),
        brief_down=np.zeros(fronts.below + 8 if brief else 0, dtype=np.float32),
        brief_up=np.zeros(fronts.right + 8 if brief else 0, dtype=np.float32),
        swaying=swaying,
        bends=np.zeros(6 * axes.count if swaying else 0),
    )
