"""Stewart platforms: legs between ball joints may spin about themselves, which carries no load."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq

import flexctrl as fc
from flexctrl.errors import EquilibriumError

PLATFORM, LOWER, UPPER, RADIUS = 50.0, 5.0, 3.0, 0.01
MOTORS = {f"d{i}_source": 0.0 for i in range(6)}
SPINS = [f"lower{i}_0_rz" for i in range(6)]


def ends(size: float, tilt: float = 0.0, aside: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Where legs begin and end."""
    below, above = (np.deg2rad(a) for a in ([-15, 15, 105, 135, 225, 255], [-45, 45, 75, 165, 195, 285]))
    base = 1.2 * size * np.c_[np.cos(below), np.sin(below), 0.0 * below]
    top = 0.7 * size * np.c_[np.cos(above), np.sin(above) * np.cos(tilt), np.sin(above) * np.sin(tilt)]
    return base, top + np.array([aside, 0.3 * aside, 1.5 * size])


def stewart(
    g: float = 9.81, size: float = 1.0, tilt: float = 0.0, aside: float = 0.0, stiffness: float = 2e6
) -> fc.Model:
    """Each leg: a lower body on a ball joint, a slide with a drive, an upper body pinned to the platform."""
    base, top = ends(size, tilt, aside)
    places = {f"p{i}": tuple(end) for i, end in enumerate(top)}
    platform = fc.RigidBody("platform", (aside, 0.3 * aside, 1.6 * size), PLATFORM, (4.0, 4.0, 7.0), places)
    parts, joints, drives = [platform], [], []
    for i, (start, end) in enumerate(zip(base, top, strict=True)):
        along, middle = end - start, tuple(0.5 * (start + end))
        axis = along / np.linalg.norm(along)
        inertia = 0.5 * (np.eye(3) - np.outer(axis, axis)) + 0.005 * np.outer(axis, axis)
        lower = fc.RigidBody(f"lower{i}", tuple(start + 0.25 * along), LOWER, inertia, {"b": tuple(start), "s": middle})
        upper = fc.RigidBody(f"upper{i}", tuple(start + 0.75 * along), UPPER, inertia, {"t": tuple(end), "s": middle})
        parts += [lower, upper]
        joints += [
            fc.Support(lower.point("b"), "u v w"),
            fc.Slide(lower.point("s"), upper.point("s"), tuple(axis)),
            fc.Pin(upper.point("t"), platform.point(f"p{i}")),
        ]
        of = {"direction": tuple(axis), "radius": RADIUS, "stiffness": stiffness * RADIUS**2, "inertia": 1e-3}
        drives.append(fc.LinearDrive(f"d{i}", upper.point("s"), lower.point("s"), **of))
    outputs = [fc.Position(name, platform.node, name) for name in "xyz"] + [fc.Rotation("turn", platform.node, "z")]
    inputs = [fc.Force("down", platform.node, "z"), fc.Force("across", platform.node, "x")]
    effects = [fc.LargeRotation(), fc.Flexible(), *([fc.Gravity((0.0, 0.0, -g))] if g else [])]
    return fc.assemble(fc.Structure(parts, joints, drives, inputs, outputs), effects)


def height(g: float, size: float, stiffness: float = 2e6) -> float:
    """Where the platform hangs by d/dh (Σ k (L − L₀)²/2 + g Σ m z) = 0, h between the ends of the legs."""
    base, top = ends(size)
    drawn = np.linalg.norm(top - base, axis=1)

    def left(h: float) -> float:
        L = np.hypot(h, np.linalg.norm((top - base)[:, :2], axis=1))
        swung = 0.25 * drawn * (1.0 - (h / L) ** 2) / L
        weights = PLATFORM + (LOWER * swung + UPPER * (1.0 - swung)).sum()
        return float((stiffness * (L - drawn) * h / L).sum() + g * weights)

    return float(brentq(left, 1.2 * size, 1.6 * size, xtol=1e-15, rtol=1e-14)) + 0.1 * size


@pytest.mark.parametrize(("g", "size"), [(9.81, 1.0), (0.01, 1.0), (100.0, 0.1), (9.81, 10.0)])
def test_a_platform_sags_as_its_drives_give_whether_its_legs_may_spin_or_not(g, size):
    model = stewart(g, size)
    for held in (0, 1, 6):
        rest = fc.equilibrium(model, hold=MOTORS | dict.fromkeys(SPINS[:held], 0.0))
        assert rest.outputs["z"] == pytest.approx(height(g, size), abs=1e-12 * size)
        assert (rest.iterations < 40, rest.unstable) == (True, 0)


@pytest.mark.parametrize("shape", [{"aside": 0.2}, {"tilt": 0.2}, {"aside": 0.3, "tilt": -0.3, "stiffness": 2e5}])
def test_legs_of_unlike_lengths_may_spin_as_well(shape):
    model = stewart(**shape)
    held = fc.equilibrium(model, hold=MOTORS | dict.fromkeys(SPINS, 0.0))
    for some in ([], SPINS[1:4]):
        rest = fc.equilibrium(model, hold=MOTORS | dict.fromkeys(some, 0.0))
        assert rest.outputs == pytest.approx(held.outputs, abs=1e-11)
        assert rest.iterations < 40


@pytest.mark.parametrize("stiffness", [2e6, 2e12])
def test_without_weights_a_platform_is_pushed_where_it_is_with_all_spins_held(stiffness):
    """What nothing but drives resists, they bear; by the last digits of levers they bear spins as well."""
    model, load = stewart(0.0, stiffness=stiffness), {"down": -500.0, "across": 100.0}
    held = fc.equilibrium(model, hold=MOTORS | dict.fromkeys(SPINS, 0.0), inputs=load)
    rest = fc.equilibrium(model, hold=MOTORS, inputs=load)
    assert rest.outputs == pytest.approx(held.outputs, abs=1e-11)


def test_with_motors_that_are_free_the_platform_falls():
    with pytest.raises(EquilibriumError, match="no equilibrium found: relative residual"):
        fc.equilibrium(stewart())
