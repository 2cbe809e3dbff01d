"""Parts that neither push nor pull where a machine rests."""

from __future__ import annotations

from typing import TYPE_CHECKING

from flexctrl.model.laws.loose_kinds import loose_names
from flexctrl.model.state import State

if TYPE_CHECKING:
    from flexctrl.model.model import Model

__all__ = ["idle"]


def idle(model: Model, state: State) -> tuple[str, ...]:
    """Say in words which parts with play stand within it and which ropes are slack: they are in no linear model there.

    Parameters
    ----------
    model : Model
    state : State

    Returns
    -------
    tuple of str
    """
    if not model.large:
        return ()
    kinks, loose = model.kinks, loose_names(model.structure, model.effects)
    strains: dict[str, list[float]] = {}
    for name, end, value in zip(kinks.names, kinks.ends, kinks.values(state, state).tolist(), strict=True):
        if not end:
            strains.setdefault(name, []).append(value)  # from its corners: the two flanks, or the length of a rope
    opened = [name for name, beyond in strains.items() if name in loose and min(beyond) < 0.0 < max(beyond)]
    slack = [name for name, beyond in strains.items() if name not in loose and max(beyond) < 0.0]
    return (
        *(f"the play of {name} is open at rest: a linear model has no stiffness there" for name in opened),
        *(f"{name} is slack at rest: a linear model has no stiffness there" for name in slack),
    )
