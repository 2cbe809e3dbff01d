"""Cables drawn straight whose far end is held nearer hang, whatever they are stretched by: none is pressed straight."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq

import flexctrl as fc

WEIGHT, G, SPAN = 50.0, 10.0, 100.0
OBLIQUE = np.linalg.qr(np.array([[2.0, 1.0, 0.5], [0.3, 1.5, -1.0], [-0.7, 0.4, 1.2]]))[0]


def cable(EA: float, EI: float, length: float, turn: np.ndarray, plane: bool) -> fc.Rest:
    """Twenty beams, the start clamped or, in the plane, pinned."""
    section = fc.Section(EA=EA, EI_y=EI, EI_z=EI, GJ=EI, rhoA=WEIGHT / G, rhoJ=1e-6)
    along, down = turn @ [1.0, 0.0, 0.0], turn @ [0.0, 0.0, -1.0]
    beam = fc.Beam("cable", (0, 0, 0), tuple(length * along), section, elements=20, up=tuple(-down))
    structure = fc.Structure([beam], [fc.Support(beam.start, "u w" if plane else "all")])
    structure = fc.planar(structure, "y") if plane else structure
    model = fc.assemble(structure, [fc.Gravity(tuple(G * down)), fc.Flexible(), fc.LargeRotation()])
    held = dict(zip(("u", "v", "w"), (SPAN - length) * along, strict=True))
    return fc.equilibrium(model, {f"cable_20_{axis}": held[axis] for axis in ("uw" if plane else "uvw")})


def depth(rest: fc.Rest, turn: np.ndarray) -> float:
    return float(-(rest.state.x @ turn)[:, 2].min())


def catenary(EA: float, length: float) -> float:
    """Sag of the elastic catenary (Irvine, Cable Structures, 1981, § 2.1)."""

    def short(H: float) -> float:
        return 2.0 * H / WEIGHT * np.arcsinh(WEIGHT * length / 2.0 / H) + H * length / EA - SPAN

    H = brentq(short, 1.0, 1e6, xtol=1e-9)
    rise = np.sqrt(1.0 + (WEIGHT * length / 2.0 / H) ** 2) - 1.0
    return float(H / WEIGHT * rise + WEIGHT * length**2 / 8.0 / EA)


@pytest.mark.parametrize("length", [100.5, 110.0])
@pytest.mark.parametrize("EA", [1e8, 1e10, 1e11])
@pytest.mark.parametrize("EI", [0.3, 1.0])
def test_a_plane_cable_hangs_as_a_catenary(EA, EI, length):
    """Three of these six were pressed straight, by 9 MN, and left that in forty directions."""
    rest = cable(EA, EI, length, np.eye(3), True)
    assert rest.stable
    assert not rest.notes
    assert depth(rest, np.eye(3)) == pytest.approx(catenary(EA, length), rel=1e-5)


@pytest.mark.parametrize("EI", [30.0, 3e3])
def test_a_clamped_one_hangs_alike_in_any_direction(EI):
    """With 3 kN m² the oblique one stood up as an arch."""
    along, oblique = (depth(cable(1e8, EI, 110.0, turn, False), turn) for turn in (np.eye(3), OBLIQUE))
    assert along == pytest.approx(oblique, rel=1e-9)
    assert along == pytest.approx(20.0, abs=0.05)


def test_what_does_not_last_is_said():
    """A mast on a pin stands on its head, and so does what is pressed straight."""
    mast = fc.Beam("mast", (0, 0, 0), (0, 0, 2), fc.Section.tube(fc.STEEL, 0.05, 0.003))
    model = fc.assemble(
        fc.Structure([mast], [fc.Support(mast.start, "u v w rz")]), [fc.Gravity(), fc.Flexible(), fc.LargeRotation()]
    )
    rest = fc.equilibrium(model)
    assert rest.unstable == 2
    [note] = rest.notes
    assert note.startswith("it does not last: the machine would leave it by itself in 2 independent directions")


def test_so_is_flutter():
    """Beck's column beyond 20.05 EI/L² (Beck 1952): its load follows the tip."""
    mast = fc.Beam("mast", (0, 0, 0), (0, 0, 1), fc.Section.tube(fc.STEEL, 0.01, 0.001), elements=6)
    push = fc.FollowerForce("push", mast.end, "-z")
    model = fc.assemble(fc.Structure([mast], [fc.Support(mast.start)], [], [push]), [fc.Flexible(), fc.LargeRotation()])
    bending = float(mast.section.EI_y)
    calm, fluttering = (fc.equilibrium(model, inputs={"push": share * bending}) for share in (19.0, 22.0))
    assert not calm.notes
    assert "it does not last" in fluttering.notes[0]
