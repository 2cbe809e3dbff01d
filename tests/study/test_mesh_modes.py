"""Modes that the mesh resists: told from slow ones that are there."""

from __future__ import annotations

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.structure.refine import refine
from flexctrl.study.mesh_modes import vanishing

EFFECTS = (fc.Gravity(), fc.Flexible(), fc.LargeRotation())


def sagging(held: str, elements: int = 6) -> fc.Scene:
    """A round bar of 6 m that sags under 3 N in its middle, on two ball joints."""
    bar = fc.Beam("bar", (0, -3, 0), (0, 3, 0), fc.Section(6e5, 157.0, 157.0, 157.0, 1.0, 1e-4), elements=elements)
    load = fc.PointMass("load", bar.node(elements // 2), 0.3)
    joints = [fc.Support(bar.start, held), fc.Support(bar.end, "u w"), fc.Pin(bar.node(elements // 2), load.node)]
    return fc.Scene(fc.Structure([bar, load], joints, name="sagging"), EFFECTS)


def test_a_bent_bar_that_turns_about_its_own_line_is_free_but_for_its_elements():
    """Its energy does not know which way a round section points: what resists falls with each refinement."""
    scene = sagging("u v w")
    modes = scene.linear.modes()
    (found,) = vanishing(scene, modes)
    assert found.mode == modes.unstable + modes.rigid
    assert modes.coordinates[np.argmax(np.abs(modes.shapes[:, found.mode]))].endswith("_ry")
    assert found.finer < 0.25 * found.omega_squared
    assert found.finer == scene.with_(structure=refine(scene.structure, 2)).linear.modes().omega_squared[found.mode]


@pytest.mark.parametrize("stiffness", [1e4, 1e9])
def test_what_is_slow_and_there_is_not_called_so(stiffness):
    """A hinged rod swings at √(3g/2L), though bending stiffness that its terms are made of is 10⁹ times as large."""
    rod = fc.Beam("rod", (0, 0, 0), (0, 0, -10), fc.Section(10.0 * stiffness, *[stiffness] * 3, 1.0, 0.1), elements=2)
    scene = fc.Scene(fc.Structure([rod], [fc.Support(rod.start, "u v w rz")], name="rod"), EFFECTS)
    modes = scene.linear.modes()
    assert modes.omega_squared[:2] == pytest.approx(1.5 * 9.81 / 10.0, rel=1e-2)
    assert vanishing(scene, modes) == ()


def test_ends_that_do_not_turn_keep_the_bar_from_turning():
    scene = sagging("u v w ry")
    assert vanishing(scene, scene.linear.modes()) == ()
