"""What a trolley presses on its rail with."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from flexctrl.dynamics.alpha.point import Coefficients
from flexctrl.dynamics.alpha.steps import Stepper
from flexctrl.dynamics.feed import feed_of
from flexctrl.errors import StructureError, did_you_mean
from flexctrl.model.consistent import admitted
from flexctrl.model.model import Model
from flexctrl.model.state import State
from flexctrl.structure.elements import Part
from flexctrl.structure.references import name_of
from flexctrl.structure.trolleys import Trolley

__all__ = ["rail_force"]

_AT_ONCE, _TIGHT = 1e-6, 1e-12


def rail_force(
    model: Model, state: State, trolley: Trolley | str, inputs: Mapping[str, float] | None = None
) -> np.ndarray:
    """Return the force of a trolley on its rail, as the machine moves: weight, what hangs from it, and inertia.

    The wheel load of a crane. Accelerations are those that the machine has in the state. Along the rail it is minus
    what motors, brakes and friction on ``trolley.travel`` push with: nothing where it rolls freely.

    Parameters
    ----------
    model : Model
    state : State
        Of a run: ``run.at(t).state``, or of an equilibrium.
    trolley : Trolley or str
        The trolley or its name.
    inputs : mapping of str to float, optional
        Inputs at that instant; what is not named is zero.

    Returns
    -------
    numpy.ndarray, shape (3,)
        In global axes [N].

    Raises
    ------
    StructureError
        For a trolley that the machine does not have, a state it cannot be in, an unknown input, or a model of small
        motion.
    """
    trolleys = {p.name: p for p in model.structure.elements if isinstance(p, Trolley)}
    if isinstance(trolley, Part) and not isinstance(trolley, Trolley):
        raise StructureError(f"rail_force: {trolley.name!r} is a {type(trolley).__name__}; expected a Trolley")
    name = name_of(trolley, (Trolley,), "rail_force: trolley")
    if name not in trolleys:
        hint = did_you_mean(name, trolleys) or ": the structure has none"
        raise StructureError(f"rail_force: there is no trolley {name!r}{hint}")
    if not model.large:
        raise StructureError("rail_force: the model is one of small motion; give it LargeRotation()")
    state = admitted(model, state, "rail_force: state")
    feed = feed_of(model, None, model.input_vector(inputs or {}))
    point = Stepper(model, feed, Coefficients.of(1.0), _TIGHT).start(state, feed.first(state), _AT_ONCE)
    motion, now = model.motion, point.state
    raw = model.forces.raw(now, now.v, point.rate) + model.pushes(now, point.supply.u)
    nodes = [motion.nodes[f.node] for f in motion.tracks]
    pushes = motion.linkage.on_rails(motion.pose(now), raw[motion.linked_cells]).reshape(-1, 3)
    return pushes[nodes.index(model.structure.number(trolleys[name].node))]
