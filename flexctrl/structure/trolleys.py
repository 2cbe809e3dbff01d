"""Trolleys: masses that travel along beams as these bend."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np

from flexctrl.errors import StructureError, did_you_mean
from flexctrl.frozen import frozen
from flexctrl.structure.beams import Beam
from flexctrl.structure.bodies import PointMass
from flexctrl.structure.chains import BeamChain
from flexctrl.structure.drives import Drive, Winch
from flexctrl.structure.elements import Part
from flexctrl.structure.freedoms import TRANSLATIONS, TRAVEL, check_finite, check_name
from flexctrl.structure.inputs import Force, Input
from flexctrl.structure.joints import Joint, Support, Weld
from flexctrl.structure.nodes import Node
from flexctrl.structure.outputs import Output, Position, SwayAngle, Velocity
from flexctrl.structure.relations import Track

__all__ = ["Trolley", "check_rails", "check_travels", "tracks_of"]

_STRAIGHT = 1e-6


@frozen
class Trolley(PointMass):
    """A mass that travels along a beam, or several in a row, and stays on the axis as it bends.

    Its place is r(s), with s measured along the rail [m]: between two nodes the cubic through both along their turned
    axes, the shape in which the element bends. It has a tangent everywhere, over the borders of elements too. All
    inertia of the moving mass (for small deflections m (ẅ + 2 ṡ ẇ' + ṡ² w'' + s̈ w'), Frýba 1999) follows from it.

    ``node`` is where it is: hang a `Rope`, a `Winch` or a pendulum there. ``travel`` is a node that is nowhere in
    space: its freedom u, direction ``"x"``, is s whatever way the rail runs. Push it there with a `Force` (wheels that
    pull on the rail), drive it with a `LinearDrive`, hold it with ``Support(trolley.travel, "u")``, slow it by friction
    at ``"trolley.travel.u"``, and read s with ``Position("s", trolley.travel, "x")``. A run that takes it to an end of
    the rail stops there.

    Parameters
    ----------
    name : str
    along : Beam, sequence of Beam, or BeamChain
        The rail: straight as drawn, several beams each welded to the next.
    at : float
        Where it stands as drawn: s from the start of the first beam [m], on the rail.
    mass : float
        [kg], ≥ 0.

    Raises
    ------
    StructureError
        For a rail that is none or has corners, or a place that is not on it.

    Examples
    --------
    >>> import flexctrl as fc
    >>> wire = fc.Section(EA=1e8, EI_y=1e6, EI_z=1e6, GJ=1e6, rhoA=100, rhoJ=1)
    >>> girder = fc.Beam("girder", (0, -5, 8), (0, 5, 8), wire, elements=8)
    >>> trolley = fc.Trolley("trolley", girder, at=2.0, mass=500.0)
    >>> trolley.node.position, trolley.travel.position
    ((0.0, -3.0, 8.0), (2.0, 0.0, 0.0))
    """

    rail: tuple[str, ...]
    distance: float

    def __init__(self, name: str, along: Beam | Sequence[Beam] | BeamChain, at: float, mass: float) -> None:
        owner = f"Trolley {check_name(name, 'Trolley')!r}"
        beams = _rail(along, owner)
        length = sum(b.length for b in beams)
        distance = check_finite(at, "at", owner, least=0.0)
        if distance > length:
            raise StructureError(f"{owner}: at = {distance:g} m is beyond the end of its rail, {length:g} m long")
        object.__setattr__(self, "rail", tuple(b.name for b in beams))
        object.__setattr__(self, "distance", distance)
        super().__init__(name, _point(beams, distance), mass)

    @property
    def node(self) -> Node:
        """Where it is: translations only."""
        return Node(self.name, 0, self.at, TRANSLATIONS)

    @property
    def travel(self) -> Node:
        """How far along the rail it is: a node whose only freedom u is s [m]."""
        return Node(self.name, 1, (self.distance, 0.0, 0.0), TRAVEL)

    @property
    def nodes(self) -> tuple[Node, ...]:
        """Both."""
        return (self.node, self.travel)


def _rail(along: Beam | Sequence[Beam] | BeamChain, owner: str) -> tuple[Beam, ...]:
    """Return the beams of a straight rail."""
    given = along.beams if isinstance(along, BeamChain) else (along,) if isinstance(along, Beam) else along
    beams = tuple(given) if isinstance(given, Sequence) else ()
    if not beams or not all(isinstance(b, Beam) for b in beams):
        raise StructureError(f"{owner}: along = {along!r}; expected a Beam, or several in a row")
    first = beams[0]
    for a, b in pairwise(beams):
        gap = np.subtract(b.start.position, a.end.position)
        bent = np.linalg.norm(b.axes[:, 0] - first.axes[:, 0])
        if np.linalg.norm(gap) > _STRAIGHT * first.length or bent > _STRAIGHT:
            raise StructureError(
                f"{owner}: {b.name!r} does not go on straight where {a.name!r} ends; a rail is straight as drawn"
            )
    return beams


def _point(beams: Sequence[Beam], distance: float) -> list[float]:
    place = np.array(beams[0].start.position) + beams[0].axes[:, 0] * distance
    return [float(p) for p in place]


def check_rails(elements: Sequence[Part], joints: Sequence[Joint], owner: str) -> None:
    """Raise StructureError for a trolley whose rail the structure does not have in one piece.

    Parameters
    ----------
    elements : sequence of Part
    joints : sequence of Joint
    owner : str
        Who asks, for messages.

    Raises
    ------
    StructureError
    """
    beams = {p.name: p for p in elements if isinstance(p, Beam)}
    welded = {frozenset((n.part, n.index) for n in j.nodes) for j in joints if isinstance(j, Weld)}
    for trolley in (p for p in elements if isinstance(p, Trolley)):
        who = f"{owner}: Trolley {trolley.name!r}"
        for name in trolley.rail:
            if name not in beams:
                raise StructureError(f"{who}: there is no beam {name!r}{did_you_mean(name, beams)}")
        rail = _rail([beams[name] for name in trolley.rail], who)
        for a, b in pairwise(rail):
            if frozenset((n.part, n.index) for n in (a.end, b.start)) not in welded:
                raise StructureError(f"{who}: {a.name!r} and {b.name!r} are not welded; a rail is one piece")
        length = sum(b.length for b in rail)
        off = np.linalg.norm(np.subtract(_point(rail, trolley.distance), trolley.at))
        if off > _STRAIGHT * length or trolley.distance > length:
            raise StructureError(f"{who}: its rail lies elsewhere; make it along the beams that the structure has")


def check_travels(joints: Sequence[Joint], drives: Sequence[Drive], signals: Sequence[Input | Output]) -> None:
    """Raise StructureError where a node that is nowhere in space is taken for a place.

    Parameters
    ----------
    joints : sequence of Joint
    drives : sequence of Drive
    signals : sequence of Input or Output

    Raises
    ------
    StructureError
    """
    for joint in joints:
        if not isinstance(joint, Support):
            _refuse_travels(joint.nodes, str(joint))
    for drive in drives:
        both = (drive.node, drive.against)
        if isinstance(drive, Winch) or not _alike(*both):
            _refuse_travels(both, f"drive {drive.name!r}")
    for signal in signals:
        who = f"{type(signal).__name__} {signal.name!r}"
        if isinstance(signal, SwayAngle):
            _refuse_travels((signal.top, signal.load), who)
        elif isinstance(signal, Position | Velocity | Force):
            nodes = signal.at if isinstance(signal, Force) else (signal.at, signal.minus)
            along = abs(signal.direction[0]) > 1.0 - 1e-12
            if not along or (not isinstance(signal, Force) and not _alike(*nodes)):
                _refuse_travels(nodes, who)


def _alike(node: Node, other: Node | None) -> bool:
    return other is None or (node.freedoms == TRAVEL) == (other.freedoms == TRAVEL)


def _refuse_travels(nodes: Sequence[Node | None], who: str) -> None:
    for node in nodes:
        if node is not None and node.freedoms == TRAVEL:
            raise StructureError(
                f"{who}: {node.part}.travel is no place in space, only how far {node.part} has travelled (direction "
                f"'x'); for where it is take {node.part}.node"
            )


def tracks_of(elements: Sequence[Part], number: Mapping[tuple[str, int], int]) -> tuple[Track, ...]:
    """Return how the trolleys of some parts follow their rails.

    Parameters
    ----------
    elements : sequence of Part
    number : mapping of (str, int) to int
        Numbers of the nodes, by part and index.

    Returns
    -------
    tuple of Track
    """
    beams = {p.name: p for p in elements if isinstance(p, Beam)}
    return tuple(_track([beams[n] for n in p.rail], p, number) for p in elements if isinstance(p, Trolley))


def _track(rail: Sequence[Beam], trolley: Trolley, number: Mapping[tuple[str, int], int]) -> Track:
    nodes, places = [number[rail[0].name, 0]], [0.0]
    for beam in rail:
        begin = places[-1]
        nodes += [number[beam.name, i] for i in range(1, beam.elements + 1)]
        places += [begin + beam.length * i / beam.elements for i in range(1, beam.elements + 1)]
    x, y, z = rail[0].axes[:, 0].tolist()
    own = (number[trolley.name, 0], number[trolley.name, 1])
    return Track(*own, tuple(nodes), tuple(places), (x, y, z), trolley.distance)
