"""Snap-through of trusses far shallower than the machine is large: a first step may not pass it all."""

from __future__ import annotations

import numpy as np
import pytest

import flexctrl as fc

HALF, EA = 10.0, 1e3


def truss(rise: float) -> tuple[fc.Model, float]:
    """Two springs that meet a little above their feet, and the load that snaps them through."""
    length = float(np.hypot(HALF, rise))
    left = fc.Spring("left", (-HALF, 0, 0), (0, 0, rise), stiffness=EA / length)
    right = fc.Spring("right", (HALF, 0, 0), (0, 0, rise), stiffness=EA / length)
    mass = fc.PointMass("mass", (0, 0, rise), 1.0)
    joints = [fc.Support(left.start), fc.Support(right.start), fc.Support(mass.node, "u v")]
    joints += [fc.Pin(left.end, mass.node), fc.Pin(right.end, mass.node)]
    inputs, outputs = [fc.Force("f", mass.node, "-z")], [fc.Position("z", mass.node, "z")]
    model = fc.assemble(fc.Structure([left, right, mass], joints, inputs=inputs, outputs=outputs), [fc.LargeRotation()])
    now = (HALF**2 * length) ** (1.0 / 3.0)  # where 2 EA (1/l − 1/L) z is largest
    return model, 2.0 * EA * (1.0 / now - 1.0 / length) * float(np.sqrt(now**2 - HALF**2))


@pytest.mark.parametrize("rise", [1.0, 0.1, 0.02, 0.01, 0.005])
def test_both_limits_are_found_on_the_way_down(rise):
    """With a rise of 0.02 m the first step was beyond both, and nothing told of them."""
    model, limit = truss(rise)
    path = fc.equilibrium_path(model, {"f": 1.0}, until={"z": -0.99 * rise})
    assert [point.factor / limit for point in path.limits] == pytest.approx([1.0, -1.0], rel=1e-5)
    assert path.end.name == "REACHED"


@pytest.mark.parametrize("rise", [0.1, 0.02, 0.01])
def test_a_load_beyond_the_limit_is_reached_through_both(rise):
    model, limit = truss(rise)
    path = fc.equilibrium_path(model, {"f": 1.0}, until=1.5 * limit)
    assert [point.factor / limit for point in path.limits] == pytest.approx([1.0, -1.0], rel=1e-5)
    assert path.end.name == "REACHED"


def test_what_nothing_holds_is_named():
    left = fc.Spring("left", (-1, 0, 0), (0, 0, 0.5), stiffness=1e3)
    right = fc.Spring("right", (1, 0, 0), (0, 0, 0.5), stiffness=1e3)
    mass = fc.PointMass("mass", (0, 0, 0.5), 1.0)
    joints = [
        fc.Support(left.start),
        fc.Support(right.start),
        fc.Pin(left.end, mass.node),
        fc.Support(mass.node, "u v"),
    ]
    structure = fc.Structure([left, right, mass], joints, inputs=[fc.Force("f", mass.node, "-z")])
    model = fc.assemble(structure, [fc.LargeRotation()])
    with pytest.raises(fc.errors.MechanismError, match=r"nothing says where right_1_. is"):
        fc.equilibrium_path(model, {"f": 1.0}, until=5.0)
