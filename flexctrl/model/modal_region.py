"""Where modal damping is that of modes: near the equilibrium that they are about."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from flexctrl.model.units import turning
from flexctrl.structure.lines import Rope, Spring

if TYPE_CHECKING:
    from flexctrl.model.model import Model
    from flexctrl.model.state import State

__all__ = ["beyond_modes"]

_FAR, _NOTHING = 0.1, np.zeros(0)
"""What swings turned by θ is braked θ² ω/ω₀ as much as what swings, by modes along it with a higher frequency ω."""


def beyond_modes(model: Model, states: Sequence[State], moved: np.ndarray = _NOTHING) -> str:
    """Say what is turned so far from the equilibrium of a machine's modes that modal damping brakes more than them.

    Its matrix stays that of the modes where they were: a jib that has slewed by a quarter of a turn is braked as if it
    were stretched.

    Parameters
    ----------
    model : Model
    states : sequence of State
    moved : numpy.ndarray, shape (n,), or empty
        How far each degree of freedom has been from where a run began.

    Returns
    -------
    str
        What is turned farthest, and what goes along; empty if nothing is.
    """
    about = model.modal_about
    if about is None or not model.large:
        return ""
    found = [turn for state in states for turn in _turns(model, about, state)]
    found += [(float(moved[i]), model.coordinates[i]) for i in np.flatnonzero(turning(model)) if moved.size]
    angle, name = max(found, default=(0.0, ""))
    if angle <= _FAR:
        return ""
    return (
        f"{name} is turned by {angle:.2g} rad from the equilibrium whose modes ModalDamping is of, which brakes more "
        "than vibrations there: take RayleighDamping, which goes along, or name another equilibrium (hold, inputs)"
    )


def _turns(model: Model, about: State, state: State) -> Iterator[tuple[float, str]]:
    """Angles by which nodes and lines are turned [rad], and what they are."""
    structure = model.structure
    traces = np.einsum("nij,nij->n", about.R, state.R)[: len(structure.nodes)]
    angles = np.arccos(np.clip(0.5 * (traces - 1.0), -1.0, 1.0))
    if angles.size:
        yield float(angles.max()), str(structure.nodes[int(np.argmax(angles))])
    for line in structure.elements:
        if isinstance(line, Rope | Spring):
            ends = [structure.number(node) for node in (line.nodes[0], line.nodes[-1])]
            one, other = (s.x[ends[1]] - s.x[ends[0]] for s in (about, state))
            yield float(np.arctan2(np.linalg.norm(np.cross(one, other)), one @ other)), line.name
