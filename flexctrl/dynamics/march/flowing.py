"""Inner freedoms of first order in compiled loops: how fast they must change when the inputs jump.

As `flexctrl.model.flows` does: their own equations tell their rates, and where these go is how the rates change.
Within steps they are freedoms like all others.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flexctrl.dynamics.swift.easing import felt_rate, unresolved
from flexctrl.kernels.eights import eight, put
from flexctrl.kernels.native import Reals, Wholes, seldom
from flexctrl.model.flat.flat import clear, drive, place, push
from flexctrl.model.flat.flattened import Flattened
from flexctrl.model.flat.workspace import Flat

__all__ = ["Flows", "feel_mean", "flow_on", "flows_of", "pivot", "released"]

_SHARE = 1e-3


@dataclass
class Flows:
    """The inner freedoms of first order of a model.

    Attributes
    ----------
    count : int
    places, cells : Wholes
        Where they stand in the order of elimination; their own entries in the fronts.
    settles : Wholes
        Which of them settle by themselves, whatever moves.
    ease : Reals
        Rate per unit of force; 0 where no rate holds against it.
    rates, changes : Reals
        Their rates, and how fast these change.
    shares : Reals
        What others feel of their rates at the outset; less than 1 of what is over within the step.
    mass : float
        What stands for their mass, which they do not have.
    """

    LASTING = ("count",)

    count: int
    places: Wholes
    cells: Wholes
    settles: Wholes
    ease: Reals
    rates: Reals
    changes: Reals
    shares: Reals
    mass: float


def flows_of(F: Flattened) -> Flows:
    """Return the inner freedoms of first order of a model: their equations are linear in their own rates."""
    model, inner = F.model, F.model.motion.flows
    still, ease = np.zeros(model.n), np.zeros(inner.size)
    if not inner.size:
        none = np.zeros(0, dtype=int)
        return Flows(0, none, none, none, ease, ease, ease, ease, 0.0)
    drag = -model.slope(model.rest, still, still, (0.0, 1.0, 0.0), np.zeros(len(model.inputs))).diagonal()[inner]
    np.divide(1.0, drag, out=ease, where=drag > 0.0)
    mass = float(model.mass().diagonal().max()) or 1.0
    rates, changes, shares = np.zeros((3, inner.size))
    settles = np.isin(inner, model.motion.settling).astype(np.int64)
    position, cells = F.plan.position[inner], F.plan.places(inner, inner)
    return Flows(inner.size, position, cells, settles, ease, rates, changes, shares, mass)


def flow_on(w: Flows, f: Flat, h: float) -> None:
    """Give the motion under way the rates that they have; work out how these change in a small share of a step."""
    t = _SHARE * h
    flow(w, f)
    for k in range(w.count):
        w.rates[k] = f.v[w.places[k]]
    for i in range(0, f.padded, 8):
        put(f.step[i:], t * eight(f.v[i:]))
    place(f)
    flow(w, f)
    for k in range(w.count):
        w.changes[k] = (f.v[w.places[k]] - w.rates[k]) / t
        f.v[w.places[k]] = w.rates[k]
    clear(f.padded, f.step)
    place(f)


def feel_mean(w: Flows, f: Flat, h: float, beta: float, gamma: float) -> None:
    """Let all others feel the mean of what settles and is over within the step."""
    for k in range(w.count):
        w.shares[k] = 1.0
        if w.settles[k] == 1 and unresolved(w.rates[k], w.changes[k], h):
            f.v[w.places[k]] = felt_rate(w.rates[k], w.changes[k], h, beta, gamma)
            w.shares[k] = f.v[w.places[k]] / w.rates[k]


def flow(w: Flows, f: Flat) -> None:
    """Give them the rates that they have where the motion under way is."""
    released(w, f.v)
    drive(f)
    push(f)
    for k in range(w.count):
        f.v[w.places[k]] = w.ease[k] * f.force[w.places[k]]


def released(w: Flows, x: Reals) -> None:
    """Set their entries to zero."""
    for k in range(w.count):
        x[w.places[k]] = 0.0


@seldom
def pivot(w: Flows, entries: Reals) -> None:
    """Put what stands for their mass into the slope of the forces with accelerations."""
    for k in range(w.count):
        entries[w.cells[k]] = -w.mass
