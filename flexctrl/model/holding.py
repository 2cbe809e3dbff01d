"""Freedoms that an equilibrium holds, by the names of nodes or of coordinates."""

from __future__ import annotations

from collections.abc import Mapping

from flexctrl.effects.flexibility import Flexible
from flexctrl.errors import StructureError, did_you_mean
from flexctrl.model.model import Model
from flexctrl.structure.freedoms import FREEDOMS, IDENTIFIERS
from flexctrl.structure.naming import node_of
from flexctrl.structure.structure import Structure

__all__ = ["held_at", "own_coordinate"]


def held_at(model: Model, hold: Mapping[str, float]) -> dict[str, float]:
    """Return which coordinates of a model are held where; what its rigid parts take away is left out.

    Parameters
    ----------
    model : Model
    hold : mapping of str to float
        ``"girder.start.u"`` or a coordinate's name, and where.

    Returns
    -------
    dict of str to float

    Raises
    ------
    StructureError
        For what the joints do not leave free.
    """
    found = {}
    for name, at in hold.items():
        own = own_coordinate(model, name)
        if own:
            found[own] = at
        elif not _free(model.structure, name):  # else rigid parts take it away
            hint = did_you_mean(name, model.coordinates)
            raise StructureError(f"hold: the machine has no free coordinate {name!r}{hint}")
    return found


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


def _free(structure: Structure, name: str) -> bool:
    """Whether the joints leave a freedom free, or all that can bend would have a coordinate of that name."""
    if "." in name:
        return bool(structure.join_table.rows[_cell(structure, name)[0]][_cell(structure, name)[1]])
    from flexctrl.model.assemble import assemble  # which holds freedoms itself

    return name in assemble(structure, [Flexible()]).coordinates


def _cell(structure: Structure, name: str) -> tuple[int, int]:
    """Node and column of ``girder.start.u``."""
    where, _, freedom = name.rpartition(".")
    column = {word: i for names in (FREEDOMS, IDENTIFIERS) for i, word in enumerate(names)}
    if freedom not in column:
        raise StructureError(f"hold {name!r}: there is no freedom {freedom!r}{did_you_mean(freedom, FREEDOMS)}")
    return structure.number(node_of(structure.elements, where)), column[freedom]
