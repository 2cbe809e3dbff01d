"""What has mass and does not bend: points and rigid bodies."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field

import numpy as np

from flexctrl.errors import StructureError, did_you_mean, shortened
from flexctrl.frozen import frozen
from flexctrl.structure.freedoms import HUGE, TRANSLATIONS, Vector, check_finite, check_name, numbers, parse_point
from flexctrl.structure.nodes import Node, position_of

__all__ = ["PointMass", "RigidBody"]


@frozen
class PointMass:
    """A mass without size: one node with translations only.

    Parameters
    ----------
    name : str
    at : sequence of 3 floats or Node
        Position at rest [m].
    mass : float
        [kg], ≥ 0.

    Raises
    ------
    StructureError
        For a negative or undefined mass.
    """

    name: str
    at: Vector
    mass: float

    def __init__(self, name: str, at: Node | Sequence[float], mass: float) -> None:
        owner = f"PointMass {check_name(name, 'PointMass')!r}"
        object.__setattr__(self, "name", name)
        object.__setattr__(self, "at", position_of(at, owner))
        object.__setattr__(self, "mass", check_finite(mass, "mass", owner, least=0.0))

    @property
    def node(self) -> Node:
        """The mass's only node."""
        return Node(self.name, 0, self.at, TRANSLATIONS)

    @property
    def nodes(self) -> tuple[Node, ...]:
        """The only node, as for every part."""
        return (self.node,)


@frozen
class RigidBody:
    """A body that does not bend: its first node is the centre of mass, the others ride on it.

    Parameters
    ----------
    name : str
    at : sequence of 3 floats or Node
        Centre of mass at rest [m].
    mass : float
        [kg], ≥ 0.
    inertia : sequence of 3 floats or 3 × 3 array
        Moments of inertia about the centre of mass in global axes at rest [kg m²]; three numbers
        are the diagonal. Symmetric, positive semidefinite, and no moment larger than the sum of
        the other two.
    points : mapping of str to 3 floats, optional
        Named points of the body at rest [m], reached by ``body.point(name)``.

    Raises
    ------
    StructureError
        For an inertia no body can have, or a bad name or number.
    """

    name: str
    at: Vector
    mass: float
    inertia: tuple[Vector, Vector, Vector]
    points: Mapping[str, Vector] = field(default_factory=dict)

    def __init__(
        self,
        name: str,
        at: Node | Sequence[float],
        mass: float,
        inertia: Sequence[float] | Sequence[Sequence[float]] | np.ndarray,
        points: Mapping[str, Sequence[float]] | None = None,
    ) -> None:
        owner = f"RigidBody {check_name(name, 'RigidBody')!r}"
        object.__setattr__(self, "name", name)
        object.__setattr__(self, "at", position_of(at, owner))
        object.__setattr__(self, "mass", check_finite(mass, "mass", owner, least=0.0))
        object.__setattr__(self, "inertia", _check_inertia(inertia, owner))
        if not isinstance(points, Mapping | None):
            raise StructureError(
                f"{owner}: points = {shortened(points)}; expected a mapping of names to places (x, y, z)"
            )
        named = {check_name(k, f"{owner}, point"): parse_point(p, owner) for k, p in (points or {}).items()}
        object.__setattr__(self, "points", named)

    @property
    def node(self) -> Node:
        """The centre of mass."""
        return Node(self.name, 0, self.at)

    @property
    def nodes(self) -> tuple[Node, ...]:
        """The centre of mass, then the named points in order."""
        return (self.node, *(self.point(name) for name in self.points))

    def point(self, name: str) -> Node:
        """Return the node at a named point.

        Parameters
        ----------
        name : str

        Returns
        -------
        Node

        Raises
        ------
        StructureError
            If the body has no point of that name.
        """
        if not isinstance(name, str) or name not in self.points:
            known = did_you_mean(name, self.points) or f"; it has none: give it points={{{name!r}: (x, y, z)}}"
            raise StructureError(f"RigidBody {self.name!r} has no point {name!r}{known}")
        return Node(self.name, 1 + list(self.points).index(name), self.points[name])


def _check_inertia(inertia: object, owner: str) -> tuple[Vector, Vector, Vector]:
    flat = numbers(inertia)
    rows = [numbers(row) for row in inertia] if flat else []  # type: ignore[attr-defined]
    full = np.array(rows) if [len(row) for row in rows] == [3, 3, 3] else np.full((3, 3), np.nan)
    tensor = np.diag(flat) if len(flat) == 3 and np.isfinite(flat).all() else full
    if not np.abs(tensor - tensor.T).max() <= 1e-9 * np.abs(tensor).max() < HUGE:
        raise StructureError(
            f"{owner}: inertia = {shortened(inertia)}; expected 3 moments or a symmetric 3 × 3 tensor [kg m²]"
        )
    moments = np.linalg.eigvalsh(tensor)
    if moments[0] < -1e-9 * abs(moments[2]) or moments[2] > (moments[0] + moments[1]) * (1 + 1e-9):
        raise StructureError(
            f"{owner}: principal moments {moments.tolist()} kg m² belong to no body: none may be negative "
            "or larger than the sum of the other two"
        )
    a, b, c = tensor.tolist()
    return (tuple(a), tuple(b), tuple(c))
