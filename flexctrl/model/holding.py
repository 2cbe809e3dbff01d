"""Freedoms that an equilibrium holds, by the names of nodes or of coordinates."""

from __future__ import annotations

import numpy as np

from flexctrl.effects.flexibility import Flexible
from flexctrl.errors import StructureError, did_you_mean
from flexctrl.model.model import Model
from flexctrl.structure.freedoms import FREEDOMS, IDENTIFIERS
from flexctrl.structure.naming import node_of
from flexctrl.structure.structure import Structure

__all__ = ["check_free", "coordinate_held", "own_coordinate", "raw_place"]

_FEW = 10
"""As many names are told."""


def own_coordinate(model: Model, name: str) -> str:
    """Return the coordinate behind ``girder.start.u`` or its own name; empty if the model has none of its own.

    Parameters
    ----------
    model : Model
    name : str

    Returns
    -------
    str
    """
    if "." not in name:
        return name if name in model.coordinates else ""
    number = int(model.motion.place[_cell(model.structure, name)])
    return model.coordinates[number] if number < model.n else ""


def coordinate_held(model: Model, name: str) -> int:
    """Return the number of a coordinate that is to be held.

    Parameters
    ----------
    model : Model
    name : str

    Returns
    -------
    int

    Raises
    ------
    StructureError
        For what is none: where the machine has such a freedom, with what can be held here, and what holds it elsewhere.
    """
    if not isinstance(name, str) or name in model.coordinates:
        return model.coordinate(name)
    try:
        own, there = own_coordinate(model, name), raw_place(model, name) >= 0
    except StructureError:
        own, there = "", False
    if own:
        raise StructureError(f"hold {name!r}: name it as this model does, {own!r}")
    if not there:
        return model.coordinate(name)
    here = ", ".join(model.coordinates[:_FEW]) + " …" * (model.n > _FEW)
    raise StructureError(
        f"hold {name!r}: no coordinate of this model, in which it follows from others or stands still, as what is "
        f"between is rigid; what can be held here: {here or 'nothing'}. Scene(…, hold=…) holds it in every model"
    )


def check_free(model: Model, name: str) -> None:
    """Refuse a name that no equilibrium of a model can hold.

    Parameters
    ----------
    model : Model
    name : str
        ``"girder.start.u"`` or a coordinate's name.

    Raises
    ------
    StructureError
        For what is not there, or not left free by the joints.
    """
    if not own_coordinate(model, name):
        raw_place(model, name)


def raw_place(model: Model, name: str) -> int:
    """Where a freedom that the joints leave free stands in raw vectors, or one that all that can bend would have.

    Parameters
    ----------
    model : Model
    name : str

    Returns
    -------
    int

    Raises
    ------
    StructureError
        As `check_free`.
    """
    structure = model.structure
    if "." in name:
        node, column = _cell(structure, name)
        row = structure.join_table.rows[node]
        if row[column]:
            return 6 * node + column
        free = [IDENTIFIERS[i] for i in range(6) if row[i]]
        raise StructureError(
            f"hold {name!r}: the joints leave no such freedom there; free: {', '.join(free) or 'none'}"
        )
    else:
        motors = [f"{drive.name}_source" for drive in structure.drives]
        if name in motors:
            return model.motion.source_base + motors.index(name)
        from flexctrl.model.assemble import assemble  # which holds freedoms itself

        elastic = assemble(structure, [Flexible()])
        if name in elastic.coordinates:
            return int(np.flatnonzero(elastic.motion.cells == elastic.coordinate(name))[0])
    known = [*dict.fromkeys([*motors, *elastic.coordinates])]  # not what effects add: a lag's torque, a bristle's bend
    own = [other for other in known if other.startswith(f"{name}_")]  # those of a part or drive of that name
    hint = did_you_mean("", own) if own else did_you_mean(name, known)
    raise StructureError(f"hold: the machine has no free coordinate {name!r}{hint}")


def _cell(structure: Structure, name: str) -> tuple[int, int]:
    """Node and column of ``girder.start.u``."""
    where, _, freedom = name.rpartition(".")
    column = {word: i for names in (FREEDOMS, IDENTIFIERS) for i, word in enumerate(names)}
    if freedom not in column:
        raise StructureError(f"hold {name!r}: there is no freedom {freedom!r}{did_you_mean(freedom, FREEDOMS)}")
    return structure.number(node_of(structure.elements, where)), column[freedom]
