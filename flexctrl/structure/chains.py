"""Beams along a curve: straight elements welded end to end, with axes and sections of their own."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from flexctrl.errors import StructureError
from flexctrl.frozen import frozen
from flexctrl.structure.beams import Beam
from flexctrl.structure.freedoms import check_finite, check_whole, listed, parse_direction, parse_point
from flexctrl.structure.joints import Weld
from flexctrl.structure.nodes import Node
from flexctrl.structure.sections import Section

__all__ = ["BeamChain", "arc", "polygon"]


@frozen
class BeamChain:
    """A curved or twisted beam: one straight `Beam` between each two points of it, welded.

    Parameters
    ----------
    name : str
        The beams are called ``name0``, ``name1`` …
    points : sequence of points, or array of shape (n + 1, 3)
        Where the beams join [m]; see `arc` and `polygon`.
    section : Section, or sequence of n
        The same for all, or one for each beam.
    up : str or 3 floats, or sequence of n of these, optional
        As of `Beam`; one for each beam makes a twisted one.

    Raises
    ------
    StructureError
        For fewer than two points, or as many sections or directions as there are no beams.

    Examples
    --------
    >>> import flexctrl as fc
    >>> wire = fc.Section(EA=1e5, EI_y=10, EI_z=10, GJ=8, rhoA=1, rhoJ=1e-4)
    >>> ring = fc.BeamChain("ring", fc.arc((0, 0, 0), (1, 0, 0), axis="z", angle=1.5, elements=8), wire)
    >>> crane = fc.Structure(ring.beams, [fc.Support(ring.start), *ring.welds])
    """

    name: str
    beams: tuple[Beam, ...]
    welds: tuple[Weld, ...]

    def __init__(
        self,
        name: str,
        points: Sequence[Sequence[float]] | np.ndarray,
        section: Section | Sequence[Section],
        up: str | Sequence[float] | Sequence[Sequence[float] | str] | None = None,
    ) -> None:
        owner = f"BeamChain {name!r}"
        places = [parse_point(point, owner) for point in listed(points, f"{owner}: points")]
        count = len(places) - 1
        if count < 1:
            raise StructureError(f"{owner}: {len(places)} points; give two at least")
        sections = [section] * count if isinstance(section, Section) else listed(section, f"{owner}: section")
        ups = [up] * count if up is None or _single(up) else listed(up, f"{owner}: up")
        for what, given in (("sections", sections), ("directions up", ups)):
            if len(given) != count:
                raise StructureError(f"{owner}: {len(given)} {what} for {count} beams; give one, or one for each")
        beams = tuple(
            Beam(f"{name}{i}", a, b, sections[i], up=ups[i])  # type: ignore[arg-type]
            for i, (a, b) in enumerate(pairwise(places))
        )
        object.__setattr__(self, "name", name)
        object.__setattr__(self, "beams", beams)
        object.__setattr__(self, "welds", tuple(Weld(a.end, b.start) for a, b in pairwise(beams)))

    @property
    def start(self) -> Node:
        """The first node."""
        return self.beams[0].start

    @property
    def end(self) -> Node:
        """The last node."""
        return self.beams[-1].end

    def node(self, index: int) -> Node:
        """Return the node at a point, counted from 0, or from the end if negative.

        Parameters
        ----------
        index : int

        Returns
        -------
        Node

        Raises
        ------
        StructureError
            If there is no such point.
        """
        count = len(self.beams) + 1
        place = check_whole(index, "index", f"BeamChain {self.name!r}", least=-count, most=count - 1) % count
        return self.end if place == count - 1 else self.beams[place].start


def arc(
    center: Sequence[float], start: Sequence[float], axis: str | Sequence[float], angle: float, elements: int
) -> np.ndarray:
    """Return points on a circular arc.

    Parameters
    ----------
    center, start : sequence of 3 floats
        Centre of the circle, and the first point [m].
    axis : str or sequence of 3 floats
        About which the arc turns.
    angle : float
        How far [rad].
    elements : int
        Pieces of equal length.

    Returns
    -------
    numpy.ndarray, shape (elements + 1, 3)
    """
    middle, first = np.array(parse_point(center, "arc")), np.array(parse_point(start, "arc"))
    about = np.array(parse_direction(axis, "arc"))
    turns = np.linspace(0.0, check_finite(angle, "angle", "arc"), check_whole(elements, "elements", "arc", least=1) + 1)
    out = first - middle
    along = about * (about @ out)
    across = out - along
    side = np.cross(about, across)
    return np.asarray(middle + along + np.outer(np.cos(turns), across) + np.outer(np.sin(turns), side))


def polygon(points: Sequence[Sequence[float]] | np.ndarray) -> np.ndarray:
    """Return the corners of a polygon that runs along a smooth curve, not inside its bends.

    Chords of a curve lie inside its bends, in the mean by a twelfth of the second differences of its points. The inner
    corners are moved out by that: few straight beams then do for a curved one (eight for an arc of 45°, 24 for one of
    215°), where with nodes on the curve ten times as many would be needed. The ends stay.

    Parameters
    ----------
    points : sequence of points, or array of shape (n + 1, 3)
        On the curve, evenly spaced, less than half a radian of its turn from one to the next [m]; see `arc`.

    Returns
    -------
    numpy.ndarray, shape (n + 1, 3)

    Raises
    ------
    StructureError
        For fewer than two points, or what is no point.

    Examples
    --------
    >>> import flexctrl as fc
    >>> fc.polygon([(-1, 0, 1), (0, 0, 0), (1, 0, 1)])[1].round(4).tolist()
    [0.0, 0.0, -0.1667]
    """
    corners = np.array([parse_point(point, "polygon") for point in listed(points, "polygon: points")])
    if len(corners) < 2:
        raise StructureError(f"polygon: {len(corners)} points; give two at least")
    corners[1:-1] -= np.diff(corners, 2, axis=0) / 12.0
    return corners


def _single(up: object) -> bool:
    """Whether one direction is meant, not one for each beam."""
    return isinstance(up, str) or (isinstance(up, Sequence | np.ndarray) and len(up) == 3 and np.isscalar(up[0]))
