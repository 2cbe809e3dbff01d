"""A18: straight rod bent into an exact helix by a moment fixed to its end.

Radius 10, height 50, two coils. The moment (GJ τ, 0, EI κ) in the axes of the end section is constant along the rod,
so its strains are; a `FollowerTorque` about each axis makes it. From slenderness 10 to 1e4 (cardillo
``02_helix.py``). Where GJ is 0.6 EI, twenty elements a coil leave 3e-2 R0 and eighty 1.9e-3: of second order.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from recorder import Absolute
from statics import NONLINEAR

import flexctrl as fc

PAGE = "statics"
RADIUS, HEIGHT, COILS = 10.0, 50.0, 2.0
LENGTH = np.hypot(2 * np.pi * RADIUS * COILS, HEIGHT)
CURVATURE = RADIUS * (2 * np.pi * COILS / LENGTH) ** 2
TORSION = HEIGHT / LENGTH * (2 * np.pi * COILS / LENGTH)


def section(slenderness: float) -> fc.Section:
    side = LENGTH / slenderness
    area, second = side**2, side**4 / 12.0
    return fc.Section(area, second, second, second, 1.0, 1.0, GA_y=0.5 * area, GA_z=0.5 * area)


def helix(slenderness: float, elements: int) -> tuple[fc.Model, fc.Rest]:
    law = section(slenderness)
    rod = fc.Beam("rod", (0, 0, 0), (LENGTH, 0, 0), law, elements=elements)
    inputs = [fc.FollowerTorque("twist", rod.end, "x"), fc.FollowerTorque("bend", rod.end, "z")]
    outputs = [fc.Position(axis, rod.end, axis) for axis in "xyz"]
    model = fc.assemble(fc.Structure([rod], [fc.Support(rod.start)], inputs=inputs, outputs=outputs), NONLINEAR)
    return model, fc.equilibrium(model, inputs={"twist": law.GJ * TORSION, "bend": law.EI_z * CURVATURE})


def exact() -> np.ndarray:
    """The end: the rod's spin in its own axes is (τ, 0, κ) along the rod, a rotation about that axis."""
    from scipy.integrate import quad_vec
    from scipy.spatial.transform import Rotation

    spin = np.array([TORSION, 0.0, CURVATURE])
    return quad_vec(lambda s: Rotation.from_rotvec(s * spin).as_matrix()[:, 0], 0.0, LENGTH, epsabs=1e-12)[0]


@pytest.mark.slow
@pytest.mark.parametrize("slenderness", [1e1, 1e2, 1e3, 1e4])
def test_the_end_is_on_the_helix(record, slenderness):
    _, rest = helix(slenderness, 50)
    record(
        f"Helix, slenderness {slenderness:g}, 50 elements: end over the radius",
        ours=[rest.outputs[axis] / RADIUS for axis in "xyz"],
        reference=np.round(exact() / RADIUS, 9) + 0.0,
        source="closed form",
        tolerance=Absolute(1e-3),
    )


@pytest.mark.slow
def test_strains_are_constant(record):
    _, rest = helix(1e2, 40)
    R = rest.state.R[:41]
    turns = np.array([_angle(a.T @ b) for a, b in pairwise(R)])
    record(
        "Helix: spread of the turn from node to node over its mean",
        ours=np.ptp(turns) / turns.mean(),
        reference=0.0,
        source="constant strains",
        tolerance=Absolute(1e-6),
    )


def _angle(Q: np.ndarray) -> float:
    from scipy.spatial.transform import Rotation

    return float(Rotation.from_matrix(Q).magnitude())
