"""Speeds of what bends and is shaken by a command that jumps: told of where steps damp its vibration or have it lag.

The reference is a mast of Hermite's cubics, put up here, under the same command.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from scipy.linalg import expm

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


def by_hand(width: float, height: float, cart_mass: float, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The speeds of cart and tip by the matrix exponential, with 12 elements of cubics (Przemieniecki 1968)."""
    bending, line, count = E * width**4 / 12.0, DENSITY * width**2, 12
    h = height / count
    k = [[12, 6 * h, -12, 6 * h], [6 * h, 4 * h * h, -6 * h, 2 * h * h], [-12, -6 * h, 12, -6 * h]]
    k += [[6 * h, 2 * h * h, -6 * h, 4 * h * h]]
    m = [[156, 22 * h, 54, -13 * h], [22 * h, 4 * h * h, 13 * h, -3 * h * h], [54, 13 * h, 156, -22 * h]]
    m += [[-13 * h, -3 * h * h, -22 * h, 4 * h * h]]
    K, M = np.zeros((2, 2 * count + 2, 2 * count + 2))
    for i in range(0, 2 * count, 2):
        K[i : i + 4, i : i + 4] += bending / h**3 * np.array(k)
        M[i : i + 4, i : i + 4] += line * h / 420.0 * np.array(m)
    M[0, 0] += cart_mass
    M[-2, -2] += 1.0
    total, C = cart_mass + 1.0 + line * height, np.zeros_like(K)
    free = np.delete(np.arange(len(K)), 1)  # the foot does not turn
    K[0, 0] += 4.0 * total
    C[0, 0] += 2.8 * total
    K, C, M = (A[np.ix_(free, free)] for A in (K, C, M))
    n = len(free)
    A = np.block([[np.zeros((n, n)), np.eye(n)], [-np.linalg.solve(M, K), -np.linalg.solve(M, C)]])
    to = np.array([*(1.0 - i % 2 for i in free), *np.zeros(n)])  # a metre away, and nothing has turned
    step, x, found = expm(A * (t[1] - t[0])), -to, []
    for now in t:
        found.append((x[n], x[2 * n - 2]) if now > AT else (0.0, 0.0))
        x = step @ x if now > AT - 1e-9 else x
    cart, tip = np.array(found).T
    return cart, tip


def both(model: fc.Model, law: Tracking, mast_of: tuple[float, float, float]) -> tuple[fc.Run, np.ndarray, float]:
    """A default run, the tip's speed against the cart's, and how far the run's are off over what it goes through."""
    run = fc.simulate(model, law, until=UNTIL, every=2e-3)
    cart, tip = by_hand(*mast_of, run.t)
    return run, tip - cart, float(np.abs(run["tip_speed"] - tip).max() / np.ptp(tip))


@pytest.mark.parametrize("large", [False, True], ids=["small motion", "large motion"])
def test_it_is_told_where_the_vibration_lags(large):
    """The tip's speed was 14 % of its range off, told as 0.1 %, and without a note."""
    run, beside, apart = both(*mast(0.02, 1.0, 500.0, large), (0.02, 1.0, 500.0))
    assert apart > 0.1
    note = next(note for note in run.report.notes if note.startswith("tip_speed rings"))
    swing = 0.5 * np.ptp(beside[run.t > UNTIL - 0.2])
    assert float(note.split("up to ")[1].split()[0]) == pytest.approx(swing, rel=0.15)
    assert f"from t = {AT:g} s on" in note


@pytest.mark.parametrize(("width", "cart_mass"), [(0.1, 5.0), (0.05, 5.0)])
def test_nothing_is_told_where_the_law_ends_the_vibration(width, cart_mass):
    """The cart's own damping by the controller does, on a light cart."""
    run, _, apart = both(*mast(width, 4.0, cart_mass, False), (width, 4.0, cart_mass))
    assert apart < 0.03
    assert run.report.notes == ()
