"""Freedoms that an equilibrium holds, by the names of nodes or of coordinates."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from flexctrl.effects.flexibility import Flexible
from flexctrl.errors import StructureError, did_you_mean
from flexctrl.model.model import Model
from flexctrl.structure.freedoms import FREEDOMS, IDENTIFIERS
from flexctrl.structure.naming import node_of
from flexctrl.structure.structure import Structure

__all__ = ["check_free", "held_at", "own_coordinate"]

_ROUNDING = 1e-9


def held_at(model: Model, hold: Mapping[str, float]) -> dict[str, float]:
    """Return which coordinates of a model are held where.

    What rigid parts and shafts take away (a motor's source angle in the rigid twin) is held by the coordinates that
    it moves with at rest, T q = at, wherever these equations tell them; a motion that they leave free stays free.

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
    found, lost = {}, {}
    for name, at in hold.items():
        if own := own_coordinate(model, name):
            found[own] = at
        else:
            lost[_raw_place(model, name)] = at
    return found | _followed(model, lost, found) if lost else found


def _followed(model: Model, lost: Mapping[int, float], found: Mapping[str, float]) -> dict[str, float]:
    """Return the coordinates that raw freedoms tell, by their places, where others are held already.

    Told are those that no motion has which leaves the raw freedoms where they are.
    """
    from scipy.linalg import lstsq, null_space

    T = model.motion.jacobian(model.motion.rest)[list(lost)].toarray()
    own = [model.coordinate(name) for name in found]
    rest = np.array(list(lost.values())) - T[:, own] @ np.array(list(found.values()), dtype=float)
    T[:, own] = 0.0
    moved = np.flatnonzero(T.any(axis=0))
    if not moved.size:
        return {}
    places = lstsq(T[:, moved], rest, cond=_ROUNDING)[0]
    told = np.abs(null_space(T[:, moved], rcond=_ROUNDING)).max(axis=1, initial=0.0) < _ROUNDING
    return {model.coordinates[i]: float(at) for i, at in zip(moved[told], places[told], strict=True)}


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
        _raw_place(model, name)


def _raw_place(model: Model, name: str) -> int:
    """Where a freedom that the joints leave free stands in raw vectors, or one that all that can bend would have."""
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
        from flexctrl.model.assemble import assemble  # which holds freedoms itself

        elastic = assemble(structure, [Flexible()])
        if name in elastic.coordinates:
            return int(np.flatnonzero(elastic.motion.cells == elastic.coordinate(name))[0])
    hint = did_you_mean(name, model.coordinates)
    raise StructureError(f"hold: the machine has no free coordinate {name!r}{hint}")


def _cell(structure: Structure, name: str) -> tuple[int, int]:
    """Node and column of ``girder.start.u``."""
    where, _, freedom = name.rpartition(".")
    column = {word: i for names in (FREEDOMS, IDENTIFIERS) for i, word in enumerate(names)}
    if freedom not in column:
        raise StructureError(f"hold {name!r}: there is no freedom {freedom!r}{did_you_mean(freedom, FREEDOMS)}")
    return structure.number(node_of(structure.elements, where)), column[freedom]
