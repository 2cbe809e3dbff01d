"""Where freedoms are: displacements from the drawn shape, which sums of steps are not once their axes turn."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp

from flexctrl.frozen import frozen
from flexctrl.mechanics.rotation import logarithm

if TYPE_CHECKING:
    from flexctrl.model.linkages.chart import Chart, Follower, TurningNode
    from flexctrl.model.model import Model
    from flexctrl.model.state import State

__all__ = ["Places", "places_of", "standing", "wandered"]

_TURN = 2.0 * np.pi
_STILL, _WANDERED, _SMALL = 1e-9, 0.02, 1e-5


@frozen(eq=False)
class Places:
    """Coordinates that are places, as `Model.displace` and the chart of `to_nlsys` have them.

    Of a node that turns about several axes its rotation vector in space axes, of hinges and slides what they have
    turned and slid, with what carries them; all else is the sum of its steps.

    Attributes
    ----------
    chart : Chart
        About the drawn shape.
    rotations : tuple of TurningNode
    hinges, slides : tuple of Follower
        What is looked at: all of the chart's, or those of some degrees of freedom.
    """

    chart: Chart
    rotations: tuple[TurningNode, ...]
    hinges: tuple[Follower, ...]
    slides: tuple[Follower, ...]

    @property
    def n(self) -> int:
        """Number of degrees of freedom."""
        return self.chart.model.n

    def at(self, state: State) -> np.ndarray:
        """Return where all degrees of freedom are in a state, shape (n,)."""
        found = state.q.copy()
        for turning in self.rotations:
            theta = self.turned(turning, state)
            for k, number in enumerate(turning.coordinates):
                if 0 <= number < self.n:
                    found[number] = theta[k]
        for hinge in self.hinges:
            found[hinge.freedom] = self._hinged(hinge, state)
        for slide in self.slides:
            found[slide.freedom] = self._slid(slide, state)
        return found

    def among(self, numbers: Iterable[int]) -> Places:
        """Return the places of some degrees of freedom."""
        wanted = set(numbers)
        return replace(
            self,
            rotations=tuple(r for r in self.rotations if wanted & set(r.coordinates)),
            hinges=tuple(h for h in self.hinges if h.freedom in wanted),
            slides=tuple(s for s in self.slides if s.freedom in wanted),
        )

    @property
    def led(self) -> set[int]:
        """Degrees of freedom whose places are no sums of steps."""
        turning = {k for rotation in self.rotations for k in rotation.coordinates if 0 <= k < self.n}
        return turning | {follower.freedom for follower in (*self.hinges, *self.slides)}

    def steps(self, state: State, numbers: np.ndarray, away: np.ndarray) -> np.ndarray:
        """Return which steps of some degrees of freedom move them by some displacements, all others standing still."""
        return np.asarray(np.linalg.solve(self.rates(state, numbers)[:, numbers], away))

    def change(self, state: State, numbers: np.ndarray) -> sp.csr_matrix:
        """Return the steps of all in which some keep their places, beside steps of their own, shape (n, n)."""
        rates = self.rates(state, numbers)
        follow = -np.linalg.solve(rates[:, numbers], rates)
        follow[:, numbers] = 0.0
        rows = sp.csr_matrix((np.ones(len(numbers)), (numbers, np.arange(len(numbers)))), (self.n, len(numbers)))
        return (sp.identity(self.n) + rows @ sp.csr_matrix(follow)).tocsr()

    def holding(self, state: State, numbers: np.ndarray, force: np.ndarray) -> np.ndarray:
        """Return the forces λ on the places of some degrees of freedom that hold them, f + Rᵀ λ = 0."""
        return np.asarray(-np.linalg.solve(self.rates(state, numbers)[:, numbers].T, force[numbers]))

    def turning(self, state: State, numbers: np.ndarray, pulls: np.ndarray) -> sp.csr_matrix:
        """Return how forces λ on the places of some degrees of freedom turn with the steps of all, shape (n, n).

        That is Σ λ ∂R/∂q with R the rates of places; by differences.
        """
        rates = self.rates(state, numbers)
        found = sp.lil_matrix((self.n, self.n))
        for j in np.flatnonzero((rates != 0.0).any(axis=0)) if pulls.any() else ():
            step = np.zeros(self.n)
            step[j] = _SMALL
            ahead, behind = (self.rates(self._moved(state, sign * step), numbers) for sign in (1.0, -1.0))
            found[:, j] = ((ahead - behind).T @ pulls / (2.0 * _SMALL))[:, None]
        return found.tocsr()

    def _moved(self, state: State, step: np.ndarray) -> State:
        return self.chart.model.advance(state, step, state.v, state.t)

    def rates(self, state: State, numbers: np.ndarray) -> np.ndarray:
        """Return how fast the places of some degrees of freedom change with the steps of all, shape (some, n)."""
        order = {int(number): i for i, number in enumerate(numbers)}
        rates = np.zeros((len(order), self.n))
        rates[np.arange(len(order)), numbers] = 1.0
        for turning in self.rotations:
            known = [k for k, number in enumerate(turning.coordinates) if 0 <= number < self.n]
            own = [turning.coordinates[k] for k in known]
            tangent = _inverse_tangent(self.turned(turning, state))[:, known]
            for k, number in zip(known, own, strict=True):
                if number in order:
                    rates[order[number], own] = tangent[k]
        # what carries a hinge or a slide moves its place, too, beside its own step
        for hinge in (h for h in self.hinges if h.freedom in order):
            now, drawn, J = self._master(hinge, state)
            rates[order[hinge.freedom]] += (
                drawn @ _inverse_tangent(_since(self.chart, state, hinge.master)) - now
            ) @ J[3:]
        for slide in (s for s in self.slides if s.freedom in order):
            now, drawn, J = self._master(slide, state)
            size, moved = (
                float(np.linalg.norm(now + drawn)),
                state.x[slide.master] - self.chart.reference.x[slide.master],
            )
            mean = (now + drawn) / size
            across = moved - mean * (mean @ moved)
            rates[order[slide.freedom]] += (mean - now) @ J[:3] + np.cross(now, across) @ J[3:] / size
        return rates

    def _master(self, follower: Follower, state: State) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The axis of a hinge or slide now and as drawn, and the rates of the node that carries it."""
        m, model = follower.master, self.chart.model
        J = model.motion.jacobian(model.place(state))[6 * m : 6 * m + 6].toarray()
        return state.R[m] @ follower.axis, self.chart.reference.R[m] @ follower.axis, J

    def wandered(self, state: State) -> tuple[float, str]:
        """Return by how much a rotation has wandered about an axis about which its spin is held, and which has most."""
        found = [(0.0, "")]
        for turning in (r for r in self.rotations if max(r.coordinates) >= self.n):
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


def standing(model: Model, state: State, numbers: Sequence[int]) -> dict[int, float]:
    """Return where some degrees of freedom are, from the drawn shape.

    Parameters
    ----------
    model : Model
    state : State
    numbers : sequence of int

    Returns
    -------
    dict of int to float
        By number.
    """
    where = places_of(model).among(numbers).at(state) if model.large else state.q
    return {number: float(where[number]) for number in numbers}


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
        chart = chart_of(model, model.rest)
        known = model.__dict__["_places"] = Places(chart, chart.rotations, chart.hinges, chart.slides)
    return known
