"""Cables of beams with next to no bending stiffness, drawn straight: found by their masses, at any stiffness."""

from __future__ import annotations

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.model.balance import Balance
from flexctrl.model.seeking import _pushed_freely


def cable(EA: float, EI: float, elements: int = 10) -> fc.Model:
    """100 m between two supports, in a plane; its far end may be led along x."""
    section = fc.Section(EA=EA, EI_y=EI, EI_z=EI, GJ=EI, rhoA=5.0, rhoJ=1e-6)
    beam = fc.Beam("cable", (0, 0, 0), (100, 0, 0), section, elements=elements)
    structure = fc.Structure([beam], [fc.Support(beam.start, "u v w"), fc.Support(beam.end, "v w")])
    return fc.assemble(fc.planar(structure, "y"), [fc.Gravity(), fc.Flexible(), fc.LargeRotation()], fc.CasadiVM())


@pytest.mark.parametrize("EA", [1e5, 1e6, 1e8])
@pytest.mark.parametrize("EI", [10.0, 1e-1, 1e-3])
def test_a_straight_cable_is_led_to_its_support(EA, EI):
    """However little it resists bending, which would carry it through in 10 million parts at best."""
    rest = fc.equilibrium(cable(EA, EI), hold={"cable_10_u": -0.5})
    assert rest.stable
    assert rest.iterations < 40
    x = rest.state.x[:11]
    assert x[:, 0] + x[::-1, 0] == pytest.approx(99.5, rel=1e-9)
    assert x[5, 2] < -3.0


def test_a_straight_cable_between_supports_is_not_called_free():
    """Its bending stiffness resists a translation across, though it is next to nothing beside that along it."""
    model = cable(1e12, 1.0)
    pinned = Balance(model, np.zeros(0), {model.coordinate("cable_10_u"): 0.0})
    assert _pushed_freely(pinned, model.rest) == []
