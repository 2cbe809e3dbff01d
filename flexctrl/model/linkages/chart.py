"""A chart of a machine's shapes: coordinates that are the place, not only its rate.

The rates of a model are quasi-velocities (spatial spins), which no coordinates have as derivatives once a
machine turns in three dimensions. A chart measures every shape from a reference shape: displacements as
they are, rotations by rotation vectors in space axes, hinges and slides by what they turned and slid. The
shape is `Motion.advance` by one step from the reference, so the coordinates agree with those of the linear
model to first order, and their rates follow exactly from the quasi-velocities.

A node that may turn about two axes while the spin about the third is held can reach every rotation: it
wanders about the held axis to second order (the constraint is not integrable). Such a rotation has three
coordinates, and the chart one more than the model has freedoms. The twist of a rigid rope has no effect
and is left out.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from flexctrl.errors import ChartError
from flexctrl.frozen import frozen
from flexctrl.mechanics.rotation import cross, logarithm
from flexctrl.model.model import Model
from flexctrl.model.motion import Motion
from flexctrl.model.state import State

__all__ = ["Chart", "Follower", "LeaningRope", "TurningNode", "inverse_tangents"]

_CLOSINGS = 3
_SMALL = 1e-6
_FULL_TURN, _HALF_TURN = 6.1, 3.05
_WHOLE = 1e-4
"""Nearer to whole turns than that round-off across the axis would be all that there is to a rate."""


@frozen
class TurningNode:
    """A node that turns about several axes; its coordinates (-1: computed by a loop)."""

    node: int
    coordinates: tuple[int, int, int]


@frozen
class LeaningRope:
    """A rigid rope that leans two ways: its node, body axes (columns), main one, its two freedoms."""

    node: int
    axes: np.ndarray
    main: int
    freedoms: tuple[int, int]

    @property
    def across(self) -> list[int]:
        """The axes that are not the main one."""
        return [k for k in range(3) if k != self.main]

    def twisted(self, v: np.ndarray, angle: float) -> np.ndarray:
        """Return rates, shape (n,), turned about the rope by an angle [rad]."""
        spin, main, places = np.zeros(3), np.zeros(3), list(self.freedoms)
        spin[self.across], main[self.main] = v[places], 1.0
        turned = np.cos(angle) * spin + np.sin(angle) * cross(main, spin)
        found = v.copy()
        found[places] = turned[self.across]
        return found


@frozen
class Follower:
    """A turn about a master's axis, or a slide along it, and its freedom."""

    node: int
    master: int
    axis: np.ndarray
    freedom: int


@frozen(eq=False)
class Chart:
    """Coordinates of a model's shapes about a reference.

    Attributes
    ----------
    model : Model
    motion : Motion
        The model's, with a freedom more for every rotation that wanders about a held axis.
    reference : State
        Of that motion.
    rotations, lines, hinges, slides
        What is not simply the integral of its rate.
    """

    model: Model
    motion: Motion
    reference: State
    rotations: tuple[TurningNode, ...]
    lines: tuple[LeaningRope, ...]
    hinges: tuple[Follower, ...]
    slides: tuple[Follower, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """Coordinates: the model's degrees of freedom, then held axes about which a rotation wanders."""
        return self.motion.names

    def state(self, xi: np.ndarray, v: np.ndarray, t: float = 0.0) -> State:
        """Return the state at some coordinates and rates.

        Parameters
        ----------
        xi : numpy.ndarray, shape (coordinates,)
        v : numpy.ndarray, shape (n,)
            Rates of the degrees of freedom.
        t : float

        Returns
        -------
        State

        Raises
        ------
        ChartError
            About a full turn away from the reference (half a turn for a rigid rope), or where rigid parts that were
            drawn in line come apart.
        """
        if not self.model.large:
            return self.model.advance(self.reference, xi, v, t)
        self._check(xi)
        moved = self.motion.advance(self.reference, xi, xi, t)
        for _ in range(_CLOSINGS if self.motion.linkage.loops else 0):
            moved = self.motion.advance(moved, np.zeros_like(xi), xi, t)
        if apart := self.motion.apart(moved):
            raise ChartError(apart)
        driven = self.motion.unwound(moved.x, moved.R, self.reference.driven + self._turning @ xi)
        return State(moved.x, moved.R, moved.q[: self.model.n], v, driven, t, moved.dry, moved.shown)

    def rate(self, xi: np.ndarray, state: State) -> tuple[np.ndarray, np.ndarray]:
        """Return how fast the coordinates change, and what the chart's own turning adds to the accelerations.

        Parameters
        ----------
        xi : numpy.ndarray, shape (coordinates,)
        state : State
            Of these coordinates.

        Returns
        -------
        rate : numpy.ndarray, shape (coordinates,)
        swirl : numpy.ndarray, shape (n,)
            To be added to the accelerations: a rigid rope's body axes do not twist in the chart as they do in
            the motion.
        """
        rate, swirl = np.append(state.v, np.zeros(len(xi) - self.model.n)), np.zeros(self.model.n)
        if not self.model.large or not (self.rotations or self.lines or self.hinges or self.slides):
            return rate, swirl
        raw = self.model.rates(state)[: self.motion.source_base].reshape(-1, 6)
        self._turn(rate, xi, state, raw)
        for line in self.lines:
            self._lean(line, rate, swirl, xi, raw, state.v)
        for hinge in self.hinges:
            rate[hinge.freedom] += self._hinged(hinge, state, raw)
        for slide in self.slides:
            rate[slide.freedom] += self._slid(slide, state, raw)
        return rate, swirl

    def _check(self, xi: np.ndarray) -> None:
        for places, most, what in self._reach:
            turned = float(np.sqrt(np.einsum("ij,ij->i", xi[places], xi[places])).max(initial=0.0))
            if not turned < most:
                worst = self.names[places[int(np.argmax((xi[places] ** 2).sum(axis=1))), 0]]
                raise ChartError(
                    f"{worst} has turned by {turned:.3g} rad from where the coordinates start, about {what}: they end "
                    "there. Start them nearer, to_nlsys(at=…), or use simulate, which has no such limit"
                )

    @cached_property
    def _reach(self) -> tuple[tuple[np.ndarray, float, str], ...]:
        known = [r.coordinates for r in self.rotations if min(r.coordinates) >= 0]
        turns = np.array(known, dtype=int).reshape(-1, 3)
        leans = np.array([line.freedoms for line in self.lines], dtype=int).reshape(-1, 2)
        return (turns, _FULL_TURN, "a full turn"), (leans, _HALF_TURN, "half a turn")

    @cached_property
    def _turning(self) -> np.ndarray:
        """Driven coordinates from chart coordinates near the reference: tells whole turns apart."""
        ref, n = self.reference, len(self.names)
        slopes = np.zeros((len(ref.driven), n))
        for i in range(n) if len(ref.driven) else ():
            step = np.zeros(n)
            step[i] = _SMALL
            ahead, behind = (self.motion.advance(ref, s * step, ref.v, 0.0).driven for s in (1.0, -1.0))
            slopes[:, i] = (ahead - behind) / (2.0 * _SMALL)
        return slopes

    @cached_property
    def _turned(self) -> tuple[np.ndarray, np.ndarray]:
        """Nodes of the rotations, and their coordinates, one row each."""
        nodes = np.array([r.node for r in self.rotations], dtype=int)
        return nodes, np.array([r.coordinates for r in self.rotations], dtype=int).reshape(-1, 3)

    def _since(self, state: State, node: int) -> np.ndarray:
        """The rotation vector of a node since the reference."""
        return logarithm((state.R[node] @ self.reference.R[node].T)[None])[0]

    def _turn(self, rate: np.ndarray, xi: np.ndarray, state: State, raw: np.ndarray) -> None:
        nodes, places = self._turned
        if not nodes.size:
            return
        theta = np.append(xi, 0.0)[places]
        for i in np.flatnonzero((places < 0).any(axis=1)):
            theta[i] = self._since(state, nodes[i])
        changed = inverse_tangents(theta, raw[nodes, 3:])
        known = places >= 0
        rate[places[known]] = changed[known]

    def _lean(
        self, line: LeaningRope, rate: np.ndarray, swirl: np.ndarray, xi: np.ndarray, raw: np.ndarray, v: np.ndarray
    ) -> None:
        """Leave the twist τ about the rope out of the chart: θ stays across the rope at the reference."""
        axes = self.reference.R[line.node] @ line.axes
        across = line.across
        places = list(line.freedoms)
        theta = axes[:, across] @ xi[places]
        along = self._direction(line, axes, theta)
        vectors = inverse_tangents(np.array([theta, theta]), np.array([raw[line.node, 3:], along]))
        twist = -(axes[:, line.main] @ vectors[0]) / (axes[:, line.main] @ vectors[1])
        rate[places] = axes[:, across].T @ (vectors[0] + twist * vectors[1])
        spin, main = np.zeros(3), np.zeros(3)
        spin[across], main[line.main] = v[places], 1.0
        swirl[places] = -twist * cross(main, spin)[across]

    def _direction(self, line: LeaningRope, axes: np.ndarray, theta: np.ndarray) -> np.ndarray:
        """Where the rope points: turned by θ, which lies across it, from its direction at the reference."""
        angle, along = float(np.linalg.norm(theta)), axes[:, line.main]
        return np.cos(angle) * along + np.sinc(angle / np.pi) * cross(theta, along)

    def _hinged(self, hinge: Follower, state: State, raw: np.ndarray) -> float:
        spin, theta = raw[hinge.master, 3:], self._since(state, hinge.master)
        turned = inverse_tangents(theta[None], spin[None])[0]
        return float(
            (self.reference.R[hinge.master] @ hinge.axis) @ turned - (state.R[hinge.master] @ hinge.axis) @ spin
        )

    def _slid(self, slide: Follower, state: State, raw: np.ndarray) -> float:
        m = slide.master
        now = state.R[m] @ slide.axis
        both = now + self.reference.R[m] @ slide.axis
        size = float(np.linalg.norm(both))
        mean, moved = both / size, state.x[m] - self.reference.x[m]
        bent = cross(raw[m, 3:], now)
        return float((mean - now) @ raw[m, :3] + moved @ (bent - mean * (mean @ bent)) / size)


def inverse_tangents(theta: np.ndarray, spin: np.ndarray) -> np.ndarray:
    """Return rates of rotation vectors from spatial spins: ω − ½ θ×ω + η θ×(θ×ω), η = (1 − (θ/2) cot(θ/2))/θ².

    Parameters
    ----------
    theta, spin : numpy.ndarray, shape (n, 3)

    Returns
    -------
    numpy.ndarray, shape (n, 3)
    """
    square = np.einsum("ni,ni->n", theta, theta)
    small = square < 1e-3
    safe = np.where(small, 1.0, square)
    half = 0.5 * np.sqrt(safe)
    tangent = np.tan(half)
    least = _WHOLE * half
    tangent = np.where(np.abs(tangent) < least, np.where(tangent > 0.0, least, -least), tangent)
    series = 1.0 / 12.0 + square * (1.0 / 720.0 + square * (1.0 / 30240.0 + square / 1209600.0))
    eta = np.where(small, series, (1.0 - half / tangent) / safe)
    turned = cross(theta, spin)
    return np.asarray(spin - 0.5 * turned + eta[:, None] * cross(theta, turned))
