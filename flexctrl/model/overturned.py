"""Elements of beams that are turned too far from end to end: what to say of a search or a run that ends at one."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flexctrl.structure.beams import Beam

if TYPE_CHECKING:
    from flexctrl.model.model import Model
    from flexctrl.model.state import State

__all__ = ["overturned"]

_FAR, _MOST = 2.2, 2.74


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
    beams = {part.name for part in model.structure.elements if isinstance(part, Beam)}
    worst, said = _FAR, ""
    for family in model.forces.families if model.large else ():
        if family.nodes.shape[1] != 2 or not beams.issuperset(family.parts):
            continue
        turns = np.einsum("eij,eij->e", state.R[family.nodes[:, 0]], state.R[family.nodes[:, 1]])
        angles = np.arccos(np.clip(0.5 * (turns - 1.0), -1.0, 1.0))
        i = int(np.argmax(angles))
        if angles[i] > worst:
            worst, part = float(angles[i]), family.parts[i]
            which = family.parts[: i + 1].count(part)
            far = f"{'beyond' if worst > _MOST else 'near'} the {_MOST:g} that one can be"
            turned = f"element {which} of {part} is turned by {worst:.2f} rad from end to end"
            said = f"{turned}, {far}: give {part} more elements"
    return said
