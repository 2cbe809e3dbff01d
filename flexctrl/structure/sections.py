"""What a beam is made of: stiffness and mass per length of its cross-section."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from flexctrl.errors import StructureError, shortened
from flexctrl.frozen import frozen
from flexctrl.structure.freedoms import check_finite, check_number


@frozen
class Material:
    """A linear elastic, isotropic material.

    Parameters
    ----------
    E : float
        Young's modulus [Pa], > 0.
    rho : float
        Density [kg/m³], ≥ 0.
    nu : float
        Poisson's ratio, -1 < nu ≤ 0.5. The shear modulus is G = E / (2 (1 + nu)).

    Raises
    ------
    StructureError
        If a value is out of its range or not a number.
    """

    E: float
    rho: float
    nu: float = 0.3

    def __post_init__(self) -> None:
        object.__setattr__(self, "E", check_finite(self.E, "E", "Material", above=0.0))
        object.__setattr__(self, "rho", check_finite(self.rho, "rho", "Material", least=0.0))
        if not -1.0 < check_finite(self.nu, "nu", "Material") <= 0.5:
            raise StructureError(f"Material: nu = {self.nu!r}; expected -1 < nu ≤ 0.5")
        object.__setattr__(self, "nu", float(self.nu))

    @property
    def G(self) -> float:
        """Shear modulus [Pa]."""
        return self.E / (2.0 * (1.0 + self.nu))


STEEL = Material(E=210e9, rho=7850.0, nu=0.3)
"""Structural steel (EN 1993-1-1, 3.2.6, with its usual density)."""


@frozen
class Section:
    """Stiffness and inertia of a beam's cross-section, per metre of length.

    Parameters
    ----------
    EA : float
        Axial stiffness [N], > 0.
    EI_y, EI_z : float
        Bending stiffness about the beam's local y and z axes [N m²], > 0.
    GJ : float
        Torsional stiffness [N m²], > 0.
    rhoA : float
        Mass per length [kg/m], ≥ 0.
    rhoJ : float
        Polar rotary inertia about the beam's axis per length [kg m], ≥ 0.
    rhoI_y, rhoI_z : float
        Rotary inertia of the section in bending about local y and z per length [kg m], ≥ 0
        (zero: Euler–Bernoulli; ρI: Rayleigh, or Timoshenko together with GA).
    GA_y, GA_z : float
        Effective shear stiffness κGA along local y and z [N], > 0; infinite (the default) means no
        shear deformation.
    stiffness : 6 × 6 floats
        The whole law of a section whose deformations are coupled, as `coupled` makes it; empty for none.

    Raises
    ------
    StructureError
        If a value is negative, zero where it must not be, or not a number.
    """

    EA: float
    EI_y: float
    EI_z: float
    GJ: float
    rhoA: float
    rhoJ: float
    rhoI_y: float = 0.0
    rhoI_z: float = 0.0
    GA_y: float = math.inf
    GA_z: float = math.inf
    stiffness: tuple[tuple[float, ...], ...] = ()

    def __post_init__(self) -> None:
        for name in ("EA", "EI_y", "EI_z", "GJ"):
            object.__setattr__(self, name, check_finite(getattr(self, name), name, "Section", above=0.0))
        for name in ("rhoA", "rhoJ", "rhoI_y", "rhoI_z"):
            object.__setattr__(self, name, check_finite(getattr(self, name), name, "Section", least=0.0))
        for name in ("GA_y", "GA_z"):
            object.__setattr__(self, name, check_number(getattr(self, name), name, "Section", above=0.0))

    @property
    def shears(self) -> bool:
        """Whether it deforms in shear."""
        return bool(self.stiffness) or math.isfinite(self.GA_y) or math.isfinite(self.GA_z)

    @classmethod
    def coupled(
        cls,
        stiffness: Sequence[Sequence[float]] | np.ndarray,
        rhoA: float,
        rhoJ: float,
        rhoI_y: float = 0.0,
        rhoI_z: float = 0.0,
    ) -> Section:
        """Section with a full stiffness: composites, centres off the axis, bending coupled with torsion.

        Parameters
        ----------
        stiffness : array_like, shape (6, 6)
            Force and moment (N, V_y, V_z, T, M_y, M_z) per strain (stretch, two shears, twist, two curvatures) in
            the beam's local axes; symmetric, positive definite [N, N m, N m²].
        rhoA, rhoJ, rhoI_y, rhoI_z : float
            As of `Section`.

        Returns
        -------
        Section
            Its EA, GA, GJ and EI are the diagonal of the stiffness.

        Raises
        ------
        StructureError
            If the stiffness is not six by six, not symmetric or not positive definite.
        """
        C = _checked_law(stiffness)
        EA, GA_y, GA_z, GJ, EI_y, EI_z = np.diag(C).tolist()
        law = tuple(tuple(row) for row in C.tolist())
        return cls(EA, EI_y, EI_z, GJ, rhoA, rhoJ, rhoI_y, rhoI_z, GA_y, GA_z, law)

    @classmethod
    def circular(cls, material: Material, radius: float) -> Section:
        """Solid round bar, no shear deformation; J = πr⁴/2.

        Parameters
        ----------
        material : Material
        radius : float
            Outer radius [m].

        Returns
        -------
        Section
        """
        radius = check_finite(radius, "radius", "Section.circular", above=0.0)
        second = math.pi * radius**4 / 4.0
        return _from_moments(material, math.pi * radius**2, second, second, 2.0 * second)

    @classmethod
    def tube(cls, material: Material, radius: float, thickness: float) -> Section:
        """Round tube of outer radius ``radius``, no shear deformation.

        Parameters
        ----------
        material : Material
        radius : float
            Outer radius [m].
        thickness : float
            Wall [m], at most the radius.

        Returns
        -------
        Section
        """
        radius = check_finite(radius, "radius", "Section.tube", above=0.0)
        thickness = check_finite(thickness, "thickness", "Section.tube", above=0.0)
        _check_wall(thickness, "thickness", radius, "the radius", "Section.tube")
        inner = radius - thickness
        second = math.pi * (radius**4 - inner**4) / 4.0
        return _from_moments(material, math.pi * (radius**2 - inner**2), second, second, 2.0 * second)

    @classmethod
    def rectangle(cls, material: Material, width: float, height: float) -> Section:
        """Solid rectangle, ``width`` along local y and ``height`` along local z.

        The torsion constant is the series of Timoshenko & Goodier, Theory of Elasticity, §109.

        Parameters
        ----------
        material : Material
        width, height : float
            Sides [m].

        Returns
        -------
        Section
        """
        width = check_finite(width, "width", "Section.rectangle", above=0.0)
        height = check_finite(height, "height", "Section.rectangle", above=0.0)
        long, short = max(width, height), min(width, height)
        series = sum(math.tanh(k * math.pi * long / (2.0 * short)) / k**5 for k in range(1, 40, 2))
        torsion = long * short**3 / 3.0 * (1.0 - 192.0 * short / (math.pi**5 * long) * series)
        return _from_moments(material, width * height, width * height**3 / 12, height * width**3 / 12, torsion)

    @classmethod
    def box(cls, material: Material, width: float, height: float, web: float, flange: float) -> Section:
        """Rectangular hollow box; torsion by Bredt's formula for thin walls.

        Parameters
        ----------
        material : Material
        width, height : float
            Outer sides along local y and z [m].
        web, flange : float
            Thickness of the walls along z (webs) and along y (flanges) [m].

        Returns
        -------
        Section
        """
        width = check_finite(width, "width", "Section.box", above=0.0)
        height = check_finite(height, "height", "Section.box", above=0.0)
        web = check_finite(web, "web", "Section.box", above=0.0)
        flange = check_finite(flange, "flange", "Section.box", above=0.0)
        _check_wall(web, "web", 0.5 * width, "half the width", "Section.box")
        _check_wall(flange, "flange", 0.5 * height, "half the height", "Section.box")
        b, h = width - 2 * web, height - 2 * flange
        around_y = (width * height**3 - b * h**3) / 12.0
        around_z = (height * width**3 - h * b**3) / 12.0
        mid_b, mid_h = width - web, height - flange
        torsion = 4.0 * (mid_b * mid_h) ** 2 / (2.0 * mid_b / flange + 2.0 * mid_h / web)
        return _from_moments(material, width * height - b * h, around_y, around_z, torsion)


def _check_wall(wall: float, name: str, room: float, side: str, owner: str) -> None:
    if wall > room:
        raise StructureError(f"{owner}: {name} = {wall:g} m; expected at most {side}, {room:g} m")


def _checked_law(stiffness: Sequence[Sequence[float]] | np.ndarray) -> np.ndarray:
    try:
        C = np.array(stiffness, dtype=float)
    except (TypeError, ValueError):
        C = np.zeros(0)
    if C.shape != (6, 6) or not np.isfinite(C).all():
        raise StructureError(
            f"Section.coupled: stiffness = {shortened(stiffness)}; expected six rows of six finite numbers"
        )
    size = np.sqrt(np.abs(np.diag(C)))
    scaled = C / np.where(size > 0.0, np.outer(size, size), 1.0)
    if np.abs(scaled - scaled.T).max() > 1e-9:
        raise StructureError("Section.coupled: the stiffness is not symmetric; a section's law has an energy")
    if not (np.diag(C) > 0.0).all() or np.linalg.eigvalsh(scaled)[0] <= 0.0:
        raise StructureError("Section.coupled: the stiffness is not positive definite: some strain costs no energy")
    return np.asarray(0.5 * (C + C.T))


def _from_moments(m: Material, area: float, I_y: float, I_z: float, J: float) -> Section:
    if not isinstance(m, Material):
        raise StructureError(f"Section: material = {shortened(m)}; expected a flexctrl.Material, e.g. flexctrl.STEEL")
    return Section(
        EA=m.E * area,
        EI_y=m.E * I_y,
        EI_z=m.E * I_z,
        GJ=m.G * J,
        rhoA=m.rho * area,
        rhoJ=m.rho * (I_y + I_z),
        rhoI_y=m.rho * I_y,
        rhoI_z=m.rho * I_z,
    )
