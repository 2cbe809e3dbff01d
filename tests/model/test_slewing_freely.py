"""Equilibria of machines that turn without resistance: rounding is not to turn them for ever."""

from __future__ import annotations

import numpy as np
import pytest

import flexctrl as fc


def crane(seed: int) -> fc.Model:
    """A soft, inclined jib on a mast, slewed through a gear; a load on a rope, on a link, or at its head."""
    rng = np.random.default_rng(seed)
    reach = np.array([*rng.uniform(-3.0, 3.0, 2), rng.uniform(-1.5, 2.5)])
    reach[0] += 1.5 * (np.hypot(*reach[:2]) < 0.5)
    radius, mass, hang = 10 ** rng.uniform(-1.9, -1.2), 10 ** rng.uniform(0.0, 2.0), rng.uniform(0.5, 2.0)
    mast = fc.Beam("mast", (0, 0, 0), (0, 0, 4), fc.Section.tube(fc.STEEL, 2.0 * radius, 0.2 * radius), elements=2)
    tip = np.array([0, 0, 4.0]) + reach
    section = fc.Section.tube(fc.STEEL, radius, 0.1 * radius)
    jib = fc.Beam("jib", mast.end, tuple(tip), section, elements=int(rng.integers(1, 4)))
    ratio, inertia = 10 ** rng.uniform(0.0, 3.0), 10 ** rng.uniform(-5.0, -2.0)
    drive = fc.RotaryDrive("slew", mast.end, jib.start, axis="z", stiffness=100.0, ratio=ratio, inertia=inertia)
    parts: list = [mast, jib]
    joints = [fc.Support(mast.start), fc.Hinge(mast.end, jib.start, "z")]
    below = tuple(tip - [0, 0, hang])
    if seed % 3 == 0:
        load = fc.PointMass("load", jib.end, mass)
    elif seed % 3 == 1:
        load = fc.PointMass("load", below, mass)
        parts.append(fc.Rope("rope", jib.end, load.node, EA=1e5))
    else:
        link = fc.Beam("link", tuple(tip), below, fc.Section.circular(fc.STEEL, radius=0.01), elements=2)
        load = fc.PointMass("load", link.end, mass)
        parts.append(link)
        joints.append(fc.Pin(jib.end, link.start))
    last = {0: jib.end, 1: parts[-1].end, 2: parts[-1].end}[seed % 3]
    if seed % 3 == 1:
        joints.append(fc.Pin(jib.end, parts[-1].start))
    joints.append(fc.Pin(last, load.node))
    outputs = [fc.Position(name, load.node, name) for name in "xyz"] + [fc.DriveAngle("angle", drive)]
    structure = fc.Structure([*parts, load], joints, drives=[drive], outputs=outputs)
    return fc.assemble(structure, [fc.Gravity(), fc.Flexible(), fc.LargeRotation()])


@pytest.mark.parametrize("seed", range(12))
def test_a_geared_inclined_slewing_crane_hangs_where_it_hangs_with_its_slewing_held(seed):
    """Round about the vertical, all its places are alike: height and radius are those with the motor held."""
    model = crane(seed)
    free = fc.equilibrium(model)
    held = fc.equilibrium(model, hold={"slew_source": 0.0})
    assert free.iterations < 100
    assert free.stable
    assert free.outputs["z"] == pytest.approx(held.outputs["z"], abs=1e-6)
    radius = (np.hypot(rest.outputs["x"], rest.outputs["y"]) for rest in (free, held))
    assert next(radius) == pytest.approx(next(radius), abs=1e-6)
