"""Commands of a continuous controller at an instant, where it feels at once what they do.

Places and rates of freedoms without mass follow the inputs from one moment to the next, so that what a controller reads
there depends on what it commands: u = g(u, u̇), with u̇ felt through rates of freedoms that have no damping either.
Where it feels u̇ it damps them: they keep their place, and with it u stays what it is. Other commands are a root.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from flexctrl.errors import ControllerError
from flexctrl.frozen import frozen

if TYPE_CHECKING:
    from flexctrl.dynamics.feed import Feed, Supply
    from flexctrl.dynamics.linear_motion.modal_equations import ModalEquations
    from flexctrl.model.plant import Plant
    from flexctrl.model.state import State

__all__ = ["Ask", "Commands", "Instant", "commanded", "holding"]

_SMALL = 1e-6
_UNFELT = 1e-9
_SETTLED = 1e-13
_ROUND_OFF = 10.0 * float(np.finfo(float).eps)
_ITERATIONS = 30
_SOON = 1e-6

Ask = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""What is commanded under inputs u that change by u̇."""


@frozen
class Commands:
    """Commands at an instant.

    Attributes
    ----------
    u : numpy.ndarray, shape (inputs,)
    slide : numpy.ndarray, shape (inputs,)
        How fast those change that keep what they hold [1/s]; zero along all others.
    free : numpy.ndarray, shape (inputs, k)
        An orthonormal basis of these others.
    """

    u: np.ndarray
    slide: np.ndarray
    free: np.ndarray


@frozen
class Instant:
    """What a continuous controller commands at an instant.

    Attributes
    ----------
    equations : ModalEquations
        Their inputs are the commands.
    feed : Feed
    shown : callable
        The state of a modal state, near another one, under inputs that change.
    span : float
        A time that matters [s].
    """

    equations: ModalEquations
    feed: Feed
    shown: Callable[[State, np.ndarray, np.ndarray, float, np.ndarray | None], State]
    span: float

    def answered(self, state: State, modal: np.ndarray, supply: Supply, kept: np.ndarray) -> tuple[Supply, np.ndarray]:
        """Return the inputs at a modal state, and how fast they change.

        Parameters
        ----------
        state : State
            Near it, at its time.
        modal : numpy.ndarray
        supply : Supply
            About what the inputs are.
        kept : numpy.ndarray, shape (inputs,)
            Inputs that hold what has no mass where it is.
        """
        first, t, x = self.equations.first, _SOON * self.span, supply.x
        now = self._commands(state, modal, x, supply.u, kept)
        rate = self.feed.evaluate(self._state(state, modal, now.u, now.slide), x).rate
        later = modal + t * (first.A @ modal + first.B @ np.append(now.u, 1.0))
        about = now.u + t * now.slide
        soon = self._commands(state.with_(t=state.t + t), later, x + t * rate, about, about)
        slide = now.slide + now.free @ (now.free.T @ (soon.u - now.u)) / t
        return replace(self.feed.evaluate(self._state(state, modal, now.u, slide), x), u=now.u), slide

    def _state(self, state: State, modal: np.ndarray, u: np.ndarray, slide: np.ndarray) -> State:
        return self.shown(state, modal, np.append(u, 1.0), state.t, slide)

    def _commands(self, state: State, modal: np.ndarray, x: np.ndarray, u: np.ndarray, kept: np.ndarray) -> Commands:
        def ask(u: np.ndarray, slide: np.ndarray) -> np.ndarray:
            return self.feed.evaluate(self._state(state, modal, u, slide), x).u

        return commanded(ask, u, kept, self.span)


def holding(model: Plant, moved: np.ndarray, place: np.ndarray) -> np.ndarray:
    """Return the inputs that hold freedoms without mass where they are.

    Parameters
    ----------
    model : Plant
    moved : numpy.ndarray, shape (n, inputs)
        What inputs move at once.
    place : numpy.ndarray, shape (n,)
        Displacement from where they rest without inputs; the share of modes in it does no work on what is moved.
    """
    still = np.zeros(model.n)
    work = moved.T @ model.slope(model.rest, still, still, (-1.0, 0.0, 0.0), np.zeros(moved.shape[1]))
    return np.asarray(np.linalg.lstsq(work @ moved, work @ place, rcond=None)[0])


def commanded(ask: Ask, u: np.ndarray, kept: np.ndarray, span: float) -> Commands:
    """Return the commands at an instant.

    Parameters
    ----------
    ask : callable
    u : numpy.ndarray
        About what they are.
    kept : numpy.ndarray
        Those that hold what has no mass where it is.
    span : float
        A time that matters [s].

    Raises
    ------
    ControllerError
        If no commands are found that the controller also answers with.
    """
    damped, free = _directions(ask, u, span)
    held, k = damped @ (damped.T @ kept), free.shape[1]

    def taken(z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return held + free @ z[:k], damped @ z[k:] / span

    def gap(z: np.ndarray) -> np.ndarray:
        now, slide = taken(z)
        return now - ask(now, slide)

    u, slide = taken(_root(gap, np.append(free.T @ u, np.zeros(len(u) - k))))
    return Commands(u, slide, free)


def _directions(ask: Ask, u: np.ndarray, span: float) -> tuple[np.ndarray, np.ndarray]:
    """Bases of the commands whose change the controller feels, and of those whose change it does not feel."""
    size = _SMALL * max(1.0, float(np.abs(u).max(initial=0.0))) / span
    units, now = size * np.eye(len(u)), ask(u, np.zeros_like(u))
    slope = np.array([ask(u, unit) - now for unit in units]).T / size
    _, felt, across = np.linalg.svd(slope)
    count = int((felt > _UNFELT * span).sum())
    return across[:count].T, across[count:].T


def _root(gap: Callable[[np.ndarray], np.ndarray], z: np.ndarray) -> np.ndarray:
    """Newton's method with slopes by differences, until nothing is left but round-off."""
    off, last, noise = gap(z), np.inf, _SETTLED
    for _ in range(_ITERATIONS):
        size = float(np.abs(off).max(initial=0.0))
        if size == 0.0 or last <= size <= noise * max(1.0, float(np.abs(z).max(initial=0.0))):
            return z
        last = size
        steps = _SMALL * np.maximum(1.0, np.abs(z))
        slope = np.array([(gap(z + step) - off) / length for step, length in zip(np.diag(steps), steps, strict=True)]).T
        noise = max(_SETTLED, _ROUND_OFF * float(np.abs(slope).sum(axis=1).max()))
        try:
            z = z - np.linalg.solve(slope, off)
        except np.linalg.LinAlgError:
            break
        off = gap(z)
    raise ControllerError(
        "the controller moves freedoms without mass by what it reads of them, and no command answers itself: give them "
        "inertia, or lower its gains"
    )
