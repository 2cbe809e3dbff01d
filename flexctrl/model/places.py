"""Where freedoms are: displacements from the drawn shape, which sums of steps are not once their axes turn."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp

from flexctrl.mechanics.rotation import logarithm

if TYPE_CHECKING:
    from flexctrl.model.linkages.chart import Chart, Follower, TurningNode
    from flexctrl.model.model import Model
    from flexctrl.model.state import State

__all__ = ["Places", "places_of", "standing", "wandered"]

_TURN = 2.0 * np.pi
_STILL, _WANDERED = 1e-9, 0.02


@dataclass(frozen=True, eq=False)
class Places:
    """Coordinates that are places, as `Model.displace` and the chart of `to_nlsys` have them.

    Of a node that turns about several axes its rotation vector in space axes, of hinges and slides what they have
    turned and slid, with what carries them; all else is the sum of its steps.

    Attributes
    ----------
    chart : Chart
        About the drawn shape.
    n : int
        Degrees of freedom.
    """

    chart: Chart
    n: int

    def at(self, state: State) -> np.ndarray:
        """Return where all degrees of freedom are in a state, shape (n,)."""
        found = state.q.copy()
        for turning in self.chart.rotations:
            theta = self.turned(turning, state)
            for k, number in enumerate(turning.coordinates):
                if 0 <= number < self.n:
                    found[number] = theta[k]
        for hinge in self.chart.hinges:
            found[hinge.freedom] = self._hinged(hinge, state)
        for slide in self.chart.slides:
            found[slide.freedom] = self._slid(slide, state)
        return found

    def simple(self, numbers: np.ndarray) -> bool:
        """Tell whether sums of steps are the places of some degrees of freedom."""
        chart = self.chart
        turning = {k for rotation in chart.rotations for k in rotation.coordinates}
        riding = {follower.freedom for follower in (*chart.hinges, *chart.slides)}
        return not (turning | riding) & set(numbers.tolist())

    def steps(self, state: State, numbers: np.ndarray, away: np.ndarray) -> np.ndarray:
        """Return which steps of some degrees of freedom move them by some displacements, all others standing still."""
        return np.asarray(np.linalg.solve(self._rates(state, numbers)[:, numbers], away))

    def led(self, state: State, numbers: np.ndarray) -> sp.csr_matrix:
        """Return how all degrees of freedom step as others do where some keep their places, shape (n, n)."""
        rates = self._rates(state, numbers)
        follow = -np.linalg.solve(rates[:, numbers], rates)
        follow[:, numbers] = 0.0
        rows = sp.csr_matrix((np.ones(len(numbers)), (numbers, np.arange(len(numbers)))), (self.n, len(numbers)))
        keep = np.ones(self.n)
        keep[numbers] = 0.0
        return (sp.diags(keep) + rows @ sp.csr_matrix(follow)).tocsr()

    def _rates(self, state: State, numbers: np.ndarray) -> np.ndarray:
        """How fast the places of some degrees of freedom change with the steps of all, shape (some, n)."""
        order = {int(number): i for i, number in enumerate(numbers)}
        rates = np.zeros((len(order), self.n))
        rates[np.arange(len(order)), numbers] = 1.0
        for turning in self.chart.rotations:
            known = [k for k, number in enumerate(turning.coordinates) if 0 <= number < self.n]
            own = [turning.coordinates[k] for k in known]
            tangent = _inverse_tangent(self.turned(turning, state))[:, known]
            for k, number in zip(known, own, strict=True):
                if number in order:
                    rates[order[number], own] = tangent[k]
        for follower in (*self.chart.hinges, *self.chart.slides):
            if follower.freedom in order:
                rates[order[follower.freedom]] += self._carried(follower, state)
        return rates

    def _carried(self, follower: Follower, state: State) -> np.ndarray:
        """How fast a hinge's or slide's place changes with what carries it, beside its own step, shape (n,)."""
        m, reference = follower.master, self.chart.reference
        J = self.chart.model.motion.jacobian(self.chart.model.place(state))[6 * m : 6 * m + 6].toarray()
        now, drawn = state.R[m] @ follower.axis, reference.R[m] @ follower.axis
        if follower in self.chart.hinges:
            return np.asarray((drawn @ _inverse_tangent(_since(self.chart, state, m)) - now) @ J[3:])
        size = float(np.linalg.norm(now + drawn))
        mean, moved = (now + drawn) / size, state.x[m] - reference.x[m]
        across = moved - mean * (mean @ moved)
        return np.asarray((mean - now) @ J[:3] + np.cross(now, across) @ J[3:] / size)

    def wandered(self, state: State) -> tuple[float, str]:
        """Return by how much a rotation has wandered about an axis about which its spin is held, and which has most."""
        found = [(0.0, "")]
        for turning in self.chart.rotations:
            theta = self.turned(turning, state)
            for k, number in enumerate(turning.coordinates):
                if number >= self.n:
                    found.append((abs(float(theta[k])), self.chart.names[number]))
        return max(found)

    def turned(self, turning: TurningNode, state: State) -> np.ndarray:
        """Return the rotation vector of a node since it was drawn, with the whole turns that its steps tell of."""
        theta = _since(self.chart, state, turning.node)
        known = [k for k, number in enumerate(turning.coordinates) if 0 <= number < self.n]
        summed = np.zeros(3)
        summed[known] = state.q[[turning.coordinates[k] for k in known]]
        size = float(np.linalg.norm(theta))
        way = theta / size if size > _STILL else summed / max(float(np.linalg.norm(summed)), _STILL)
        along = float(way[known] @ way[known])
        turns = np.rint((summed[known] - theta[known]) @ way[known] / (_TURN * along)) if along > _STILL else 0.0
        return np.asarray(theta + _TURN * turns * way)

    def _hinged(self, hinge: Follower, state: State) -> float:
        relative = state.R[hinge.master].T @ state.R[hinge.node]
        drawn = self.chart.reference.R[hinge.master].T @ self.chart.reference.R[hinge.node]
        angle = float(logarithm((relative @ drawn.T)[None])[0] @ hinge.axis)
        carried = self.chart.reference.R[hinge.master] @ hinge.axis @ _since(self.chart, state, hinge.master)
        found = angle + float(carried)
        return found + _TURN * float(np.rint((state.q[hinge.freedom] - found) / _TURN))

    def _slid(self, slide: Follower, state: State) -> float:
        reference, m = self.chart.reference, slide.master
        now, drawn = state.R[m] @ slide.axis, reference.R[m] @ slide.axis
        along = float(now @ (state.x[slide.node] - state.x[m]) - drawn @ (reference.x[slide.node] - reference.x[m]))
        mean = (now + drawn) / np.linalg.norm(now + drawn)
        return along + float(mean @ (state.x[m] - reference.x[m]))


def standing(model: Model, state: State) -> np.ndarray:
    """Return where all degrees of freedom are, from the drawn shape, shape (n,).

    Parameters
    ----------
    model : Model
    state : State

    Returns
    -------
    numpy.ndarray, shape (n,)
    """
    return places_of(model).at(state) if model.large else state.q


def wandered(model: Model, *states: State) -> str:
    """Say which rotation has wandered about an axis about which a `Support` holds it, and it alone.

    A node that turns about two axes of space, the spin about the third being held, reaches every rotation: that is no
    condition on places, and where the machine rests hangs on the way there.

    Parameters
    ----------
    model : Model
    *states : State

    Returns
    -------
    str
        Which, how far, and what helps; empty if none has.
    """
    if not (model.large and ((model.motion.place[:-1, 3:] < model.n).sum(axis=1) == 2).any()):
        return ""
    angle, name = max(places_of(model).wandered(state) for state in states)
    if angle <= _WANDERED:
        return ""
    return (
        f"{name} is held, but the node turns about two other axes: in space that holds a spin, no angle, and it has "
        f"turned by {angle:.2g} rad about that axis on the way. Where it gets to hangs on the way there: hold two "
        "rotations or none, or let it turn on a Hinge"
    )


def _inverse_tangent(theta: np.ndarray) -> np.ndarray:
    """Return the rates of a rotation vector for each spin, as columns."""
    from flexctrl.model.linkages.chart import inverse_tangents

    return inverse_tangents(np.tile(theta, (3, 1)), np.eye(3)).T


def _since(chart: Chart, state: State, node: int) -> np.ndarray:
    return np.asarray(logarithm((state.R[node] @ chart.reference.R[node].T)[None])[0])


def places_of(model: Model) -> Places:
    """Return the places of a model whose parts may move as far as they like, kept with it.

    Parameters
    ----------
    model : Model

    Returns
    -------
    Places
    """
    from flexctrl.model.linkages.charting import chart_of

    known: Places | None = model.__dict__.get("_places")
    if known is None:
        known = model.__dict__["_places"] = Places(chart_of(model, model.rest), model.n)
    return known
