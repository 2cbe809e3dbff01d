"""Elements of beams that are turned too far from end to end: what to say of a search or a run that ends at one."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from flexctrl.structure.beams import Beam

if TYPE_CHECKING:
    from flexctrl.model.model import Model
    from flexctrl.model.state import State

__all__ = ["bent", "displaced_beyond", "overturned", "twirled"]

_FAR, _MOST = 2.2, 2.74
_BENT = 1.0
"""Where one element bends so far under a force at its end it is off by 1.6 % of that."""
_LEAP, _ALIKE = 0.75, 1e-9
"""What is between 2.74 rad and as much on the other side of half a turn is 0.8 rad wide."""
_MORE = "give {} more elements"


def overturned(model: Model, state: State) -> str:
    """Say which element of a beam is turned by nearly as much as one can be.

    Its frame stands upright on what both ends have in common, which may be nothing at half a turn; beyond 2.74 rad its
    forces are no numbers.

    Parameters
    ----------
    model : Model
    state : State

    Returns
    -------
    str
        By how much, and what helps; empty if none is.
    """
    parts, i, angle = _farthest(model, state)
    return _turned(parts, i, angle) if angle > _FAR else ""


def bent(model: Model, states: Sequence[State]) -> str:
    """Say which element of a beam bends, or twists, by more than a mesh should leave to one.

    Parameters
    ----------
    model : Model
    states : sequence of State

    Returns
    -------
    str
        By how much, and what helps; empty if none does.
    """
    parts, i, angle = max((_farthest(model, state) for state in states), key=lambda found: found[-1])
    if angle <= _BENT:
        return ""
    turned = f"{_named(parts, i)} is turned by {angle:.2g} rad from end to end"
    return f"{turned}, and may be some per cent too stiff or too soft: {_MORE.format(parts[i])}"


def _farthest(model: Model, state: State) -> tuple[Sequence[str], int, float]:
    """Names of a family's parts, which element of it is turned farthest from end to end, and by what angle."""
    worst: tuple[Sequence[str], int, float] = ((), 0, 0.0)
    for parts, ends in _beams(model):
        first, second = state.R[ends[:, 0]], state.R[ends[:, 1]]
        angles = np.arccos(np.clip(0.5 * (np.einsum("eij,eij->e", first, second) - 1.0), -1.0, 1.0))
        i = int(np.argmax(angles))
        if angles[i] > worst[-1]:
            worst = (parts, i, float(angles[i]))
    return worst


def displaced_beyond(model: Model, q: np.ndarray) -> str:
    """Say which element displacements turn by more than one can be, though what is left of whole turns looks like less.

    Where both ends turn about one axis: there alone displacements are angles.

    Parameters
    ----------
    model : Model
    q : numpy.ndarray, shape (n,)
        From the drawn shape.

    Returns
    -------
    str
        Empty if there is none.
    """
    if not model.large:
        return ""
    turns = _turns(model, model.motion.jacobian(model.rest) @ q)
    for parts, ends in _beams(model):
        first, second = turns[ends[:, 0]], turns[ends[:, 1]]
        far = np.linalg.norm(second - first, axis=1)
        alike = np.linalg.norm(np.cross(first, second), axis=1) <= _ALIKE * far * far
        beyond = np.flatnonzero(alike & (far > _MOST))
        if beyond.size:
            return _turned(parts, int(beyond[0]), float(far[beyond[0]]))
    return ""


def twirled(model: Model, states: Sequence[State], step: float) -> str:
    """Say which element turns so fast, from end to end, that a step may pass half a turn unseen.

    Parameters
    ----------
    model : Model
    states : sequence of State
    step : float
        Length of a step [s].

    Returns
    -------
    str
        Empty if none does.
    """
    worst, said, beams = _LEAP, "", list(_beams(model))
    for state in states if beams else ():
        spins = _turns(model, model.rates(state))
        for parts, ends in beams:
            leaps = step * np.linalg.norm(spins[ends[:, 1]] - spins[ends[:, 0]], axis=1)
            i = int(np.argmax(leaps))
            if leaps[i] > worst:
                worst = float(leaps[i])
                turned = f"{_named(parts, i)} turns by {worst:.2g} rad a step from end to end"
                said = f"{turned}, and may pass half a turn unseen: take shorter steps, or {_MORE.format(parts[i])}"
    return said


def _turns(model: Model, raw: np.ndarray) -> np.ndarray:
    """What turns of raw displacements or rates, one row a node and none of the ground's, which is last."""
    nodes = len(model.structure.nodes)
    return np.vstack([raw[: 6 * nodes].reshape(nodes, 6)[:, 3:], np.zeros(3)])


def _beams(model: Model) -> Iterator[tuple[tuple[str, ...], np.ndarray]]:
    """Names of beams that bend, one for each element, and the numbers of its nodes, shape (elements, 2)."""
    beams = {part.name for part in model.structure.elements if isinstance(part, Beam)}
    for family in model.forces.families if model.large else ():
        if family.nodes.shape[1] == 2 and beams.issuperset(family.parts):
            yield family.parts, family.nodes


def _turned(parts: Sequence[str], i: int, angle: float) -> str:
    far = f"{'beyond' if angle > _MOST else 'near'} the {_MOST:g} that one can be"
    return f"{_named(parts, i)} is turned by {angle:.2f} rad from end to end, {far}: {_MORE.format(parts[i])}"


def _named(parts: Sequence[str], i: int) -> str:
    return f"element {parts[: i + 1].count(parts[i])} of {parts[i]}"
