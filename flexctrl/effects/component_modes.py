"""Beams that bend in a handful of modes on a moving frame."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeGuard

import numpy as np

from flexctrl.effects.effect import Effect, Inner
from flexctrl.effects.flexibility import BeamFlexibility
from flexctrl.errors import StructureError
from flexctrl.structure.beams import Beam
from flexctrl.structure.drives import Drive
from flexctrl.structure.elements import Part
from flexctrl.structure.freedoms import check_finite
from flexctrl.structure.planes import held_across
from flexctrl.structure.structure import Structure

_MOST = 10
_ALONG = 1e-9


@dataclass(frozen=True, init=False)
class ComponentModes(BeamFlexibility):
    """Elements bend in clamped modes of their own beside the cubics of their ends: few elements do for a whole beam.

    Static shapes of the ends and the first modes of the clamped element are the Craig–Bampton basis (Craig & Bampton
    1968) on the element's moving frame. v(x) = N(x) d + Σ φᵢ(x) ηᵢ in each plane of bending; the amplitudes ηᵢ [m]
    are freedoms named ``<beam>_<element>_y1`` (along the element's y), ``…_z1`` and so on. Weight, inertia, tension
    and damping act on the axis as the modes bend it. A beam held in a plane (`planar`) has only the modes in it.

    Stretch and twist are linear along an element, and frequencies of rods with what hangs on them right to second order
    in its length. Each of the shapes ``along`` (integrals of Legendre's polynomials, 0 at the ends; amplitudes ``…_x1``
    [m] and ``…_t1`` [rad]) raises that by two orders: with one, ten elements have the frequencies of a rod with a load
    to 3e-5 where they had them to 7e-3.

    It takes the place of `BeamFlexibility` on the beams it names; see `flexctrl.coarsen` for a mesh that goes with it.

    Parameters
    ----------
    count : int
        Modes an element in each plane, 0 to 10; with no modes it is `BeamFlexibility`.
    of : sequence of str
        Names of the beams; default: all.
    along : int
        Shapes of stretch an element, and as many of twist, 0 to 10.

    Raises
    ------
    StructureError
        For counts that are no whole numbers from 0 to 10; by `assemble`, for a beam whose section shears or couples, or
        whose section's axes are askew to the plane in which it is held (more elements do for these).
    """

    count: int = 3
    along: int = 0

    def __init__(self, count: int = 3, of: Sequence[str] = (), along: int = 0) -> None:
        super().__init__(of)
        for name, value in (("count", count), ("along", along)):
            found = check_finite(value, name, "ComponentModes", least=0.0)
            if found != int(found) or found > _MOST:
                raise StructureError(f"ComponentModes: {name} = {value!r}; expected a whole number from 0 to {_MOST}")
            object.__setattr__(self, name, int(found))

    def check_on(self, structure: Structure) -> None:
        """Refuse sections that shear, or lie askew to a plane that holds their beam."""
        for part in structure.elements:
            if not self.modes(part):
                continue
            if part.section.shears:
                raise StructureError(
                    f"ComponentModes: the section of beam {part.name!r} shears or couples, for which there are no "
                    f"component modes; name the other beams (of=…) and give {part.name!r} more elements"
                )
            if np.any(np.abs(_across(structure, part) - 0.5) < 0.5 - _ALONG):
                raise StructureError(
                    f"ComponentModes: beam {part.name!r} is held in a plane to which its section lies askew, and modes "
                    "along its own axes lead out of that; give it an up in the plane or across it, or more elements"
                )

    def inner(self, structure: Structure) -> tuple[Inner, ...]:
        """Amplitudes of every element: along y, z, of stretch, of twist; those that a plane holds have no name."""
        kinds = (("y", self.count), ("z", self.count), ("x", self.along), ("t", self.along))
        return tuple(
            Inner(
                f"{part.name}_{element}_{kind}{mode}" if kind in free else "",
                1.0 if kind == "t" else part.length,
                order=2,
            )
            for part, free in ((p, _free(structure, p)) for p in structure.elements if self.modes(p))
            for element in range(part.elements)
            for kind, count in kinds
            for mode in range(1, count + 1)
        )

    def modes(self, part: Part | Drive) -> TypeGuard[Beam]:
        """Tell whether the elements of a part have modes of their own.

        Parameters
        ----------
        part : Part or Drive

        Returns
        -------
        bool
        """
        return self.count + self.along > 0 and isinstance(part, Beam) and self.bends(part)


def elements_alone(effects: Sequence[Effect]) -> list[Effect]:
    """Return effects with plain elements in place of component modes: the same beams bend.

    Parameters
    ----------
    effects : sequence of Effect
        None that stands for several.

    Returns
    -------
    list of Effect
        Those given, if there are no component modes among them.
    """
    bending = [e for e in effects if isinstance(e, BeamFlexibility)]
    if not any(isinstance(e, ComponentModes) for e in bending):
        return list(effects)
    named = () if any(not e.of for e in bending) else tuple(dict.fromkeys(name for e in bending for name in e.of))
    found: list[Effect] = []
    for effect in effects:
        if effect is bending[0]:
            found.append(BeamFlexibility(named))
        elif not isinstance(effect, BeamFlexibility):
            found.append(effect)
    return found


def _free(structure: Structure, beam: Beam) -> str:
    """Local axes of a beam along which, and twist in which, it is not held in a plane."""
    return "".join(kind for kind, share in zip("xyzt", _across(structure, beam), strict=True) if share < 0.5)


def _across(structure: Structure, beam: Beam) -> np.ndarray:
    """How much of the beam's x, y, z and of its twist leads out of a plane in which it is held, 0 to 1."""
    held = held_across(structure, beam)
    moved, turned = ([f - first for f in held if first <= f < first + 3] for first in (0, 3))
    along = np.linalg.norm(beam.axes[moved], axis=0)
    return np.append(along, np.linalg.norm(beam.axes[turned, 0]))
