"""Wind on loads and structures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import ClassVar

from flexctrl.effects.effect import Effect
from flexctrl.effects.geometric_stiffness import GeometricStiffness
from flexctrl.effects.places import by_place, not_negative
from flexctrl.effects.rotating_frame import RotatingFrame
from flexctrl.errors import StructureError
from flexctrl.frozen import frozen
from flexctrl.structure.beams import Beam
from flexctrl.structure.freedoms import Vector, check_finite, parse_point
from flexctrl.structure.naming import node_of
from flexctrl.structure.nodes import Node
from flexctrl.structure.structure import Structure


@frozen
class Wind(Effect):
    """Drag of the air on nodes: F = ½ ρ c_d A |w − v| (w − v) (EN 1991-1-4, EN 13001-2), v the speed of the node.

    In still air, w = 0, it is drag alone. Linear models are about the mean wind: they hold the force on the machine at
    rest and the aerodynamic damping ½ ρ c_d A (|w| I + w wᵀ/|w|), twice as large along the wind as across it. What the
    wind does to the machine is in the books under dissipation, negative where it drives.

    Gusts are inputs of the structure, `WindSpeed`: with them the air moves at w + Σ gᵢ eᵢ. What they add to the force
    of the mean wind is an input's force and its work an input's work. In a linear model a gust's column of B is
    ∂F/∂gᵢ = ½ ρ c_d A (|w| I + w wᵀ/|w|) eᵢ, the aerodynamic damping; about still air it is none.

    In a `RotatingFrame` the air does not turn along: v is the speed seen from outside, and the wind blows along the
    axis (across it, it would turn for who turns). There drag has no potential, and K of linear models is unsymmetric.

    Parameters
    ----------
    areas : mapping of str to float
        Place → drag area c_d A ≥ 0 [m²]. A place is a node (``"boom.end"``, ``"load"``), or a beam, whose area is
        spread over its nodes, half as much at its ends.
    speed : sequence of 3 floats
        Velocity of the air w [m/s]; default: still.
    density : float
        ρ ≥ 0 [kg/m³]; default: 1.25.

    Raises
    ------
    StructureError
        For a value out of range; when the model is assembled, for a place that there is not, and in a
        `RotatingFrame` for wind across its axis or with `GeometricStiffness`, which has no room for an unsymmetric K.

    Examples
    --------
    >>> import flexctrl as fc
    >>> fc.Wind({"load": 12.0}, speed=(15, 0, 0)).speed
    (15.0, 0.0, 0.0)
    """

    apart: ClassVar[bool] = True
    areas: tuple[tuple[str, float], ...]
    speed: Vector
    density: float

    def __init__(
        self, areas: Mapping[str, float], speed: Sequence[float] = (0.0, 0.0, 0.0), density: float = 1.25
    ) -> None:
        object.__setattr__(self, "areas", by_place(areas, "Wind", "area", not_negative))
        object.__setattr__(self, "speed", parse_point(speed, "Wind: speed"))
        object.__setattr__(self, "density", check_finite(density, "density", "Wind", least=0.0))

    def check_on(self, structure: Structure) -> None:
        """Look for every place."""
        self.shares(structure)

    def check_beside(self, others: Sequence[Effect]) -> None:
        """Refuse wind that would turn in a frame that turns, and drag without a potential in a model of K alone."""
        for frame in (e for e in others if isinstance(e, RotatingFrame) and any(e.rate)):
            if any(isinstance(e, GeometricStiffness) for e in others):
                raise StructureError(
                    "Wind: in a RotatingFrame it needs LargeRotation() instead of GeometricStiffness()"
                )
            if frame.turns(self.speed):
                raise StructureError(
                    f"Wind: speed {self.speed} would turn in a frame that turns about {frame.rate}; "
                    "let the wind blow along the axis, or describe the machine in axes that do not turn"
                )

    def acts(self, structure: Structure) -> bool:
        """Tell whether there is any drag: neither area nor density is zero.

        Parameters
        ----------
        structure : Structure

        Returns
        -------
        bool
        """
        return bool(self.density and self.shares(structure))

    def shares(self, structure: Structure) -> list[tuple[Node, float]]:
        """Return the nodes that have a drag area, and how much of it [m²].

        Parameters
        ----------
        structure : Structure

        Returns
        -------
        list of (Node, float)
        """
        beams = {p.name: p for p in structure.elements if isinstance(p, Beam)}
        found: list[tuple[Node, float]] = []
        for where, area in self.areas:
            if where in beams:
                found += _spread(beams[where], area)
            else:
                found.append((_node(structure, where), area))
        return [(node, area) for node, area in found if area]


def _spread(beam: Beam, area: float) -> list[tuple[Node, float]]:
    inner = area / beam.elements
    return [(n, 0.5 * inner if n in (beam.start, beam.end) else inner) for n in beam.nodes]


def _node(structure: Structure, where: str) -> Node:
    try:
        return node_of(structure.elements, where)
    except StructureError as error:
        raise StructureError(f"Wind: {error}") from None
