"""Speeds of what bends and is shaken by a command that jumps: told of where steps damp its vibration or have it lag."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.design import Step, Tracking, pd

E, DENSITY, UNTIL, AT = 2.1e11, 7850.0, 2.0, 0.2


@cache
def mast(width: float, height: float, cart_mass: float, large: bool) -> tuple[fc.Model, Tracking]:
    """A steel mast with a kilogram at its tip, on a cart that is sent a metre away at once."""
    area, bending = width**2, width**4 / 12.0
    bar = fc.Section(
        EA=E * area, EI_y=E * bending, EI_z=E * bending, GJ=E * bending, rhoA=DENSITY * area, rhoJ=DENSITY * bending
    )
    cart, tip = fc.PointMass("cart", (0, 0, 0), cart_mass), fc.PointMass("tip", (0, 0, height), 1.0)
    beam = fc.Beam("mast", (0, 0, 0), (0, 0, height), bar, elements=3)
    joints = [
        fc.Support(cart.node, "v w"),
        fc.Pin(cart.node, beam.start),
        fc.Support(beam.start, "rx ry rz"),
        fc.Pin(tip.node, beam.end),
        fc.Support(beam.end, "v"),
    ]
    outputs = [
        fc.Position("x", cart.node, "x"),
        fc.Velocity("vx", cart.node, "x"),
        fc.Velocity("tip_speed", beam.end, "x"),
    ]
    plan = fc.Structure([cart, beam, tip], joints, [], [fc.Force("force", cart.node, "x")], outputs)
    total = cart_mass + 1.0 + DENSITY * area * height
    law = Tracking(pd(4.0 * total, 2.8 * total, measured="x", rate="vx", command="force"), {"x": Step(1.0, at=AT)})
    return fc.assemble(plan, [fc.Flexible(), fc.LargeRotation()] if large else [fc.Flexible()]), law


def both(model: fc.Model, law: Tracking) -> tuple[fc.Run, fc.Run, float]:
    """A default run, a fine one, and how far the tip's speeds are apart over what it goes through."""
    run = fc.simulate(model, law, until=UNTIL, every=2e-3)
    fine = fc.simulate(model, law, until=UNTIL, every=2e-3, method=fc.Unchecked(fc.GeneralizedAlpha(1e-4, 0.99)))
    apart = np.abs(run["tip_speed"] - fine["tip_speed"]).max() / np.ptp(fine["tip_speed"])
    return run, fine, float(apart)


@pytest.mark.parametrize("large", [False, True], ids=["small motion", "large motion"])
def test_it_is_told_where_the_vibration_lags(large):
    """The tip's speed was 14 % of its range off, told as 0.1 %, and without a note."""
    run, fine, apart = both(*mast(0.02, 1.0, 500.0, large))
    assert apart > 0.1
    note = next(note for note in run.report.notes if note.startswith("tip_speed rings"))
    late = fine.t > UNTIL - 0.2
    swing = 0.5 * np.ptp((fine["tip_speed"] - fine["vx"])[late])
    assert float(note.split("up to ")[1].split()[0]) == pytest.approx(swing, rel=0.15)
    assert f"from t = {AT:g} s on" in note


@pytest.mark.parametrize(("width", "cart_mass"), [(0.1, 5.0), (0.05, 5.0)])
def test_nothing_is_told_where_the_law_ends_the_vibration(width, cart_mass):
    """The cart's own damping by the controller does, on a light cart."""
    run, _, apart = both(*mast(width, 4.0, cart_mass, False))
    assert apart < 0.03
    assert run.report.notes == ()
