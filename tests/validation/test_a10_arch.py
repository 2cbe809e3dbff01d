"""A10: deep clamped-hinged circular arch of 215° under a load at its crown (DaDeppo & Schmidt 1975).

R = 100, EI = 1e6; the arch leans over and gives way at P R²/EI = 8.973. Straight elements between nodes on the circle
take 96 to be within 5e-4 of the limit load; along it in the mean (`polygon`), 24 are within 7e-5. The drop is that of
their crown, which stands 0.2 above the circle's.
"""

from __future__ import annotations

import numpy as np
import pytest
from statics import NONLINEAR, out_of_plane

import flexctrl as fc

PAGE = "statics"
RADIUS, EI, HALF = 100.0, 1e6, np.radians(107.5)


def arch(EA: float, elements: int) -> fc.Model:
    section = fc.Section(EA, EI, EI, EI, rhoA=1.0, rhoJ=1.0)
    foot = (-RADIUS * np.sin(HALF), RADIUS * np.cos(HALF), 0.0)
    chain = fc.BeamChain("arch", fc.polygon(fc.arc((0, 0, 0), foot, "-z", 2 * HALF, elements)), section)
    crown = chain.node(elements // 2)
    inner = tuple(chain.node(i) for i in range(1, elements))
    joints = [fc.Support(chain.start), fc.Support(chain.end, "u v w rx ry"), *chain.welds, *out_of_plane(inner)]
    inputs, outputs = [fc.Force("P", crown, "-y")], [fc.Position("crown", crown, "y")]
    return fc.assemble(fc.Structure(chain.beams, joints, inputs=inputs, outputs=outputs), NONLINEAR)


@pytest.mark.parametrize(("EA", "expected"), [(1e8, 897.289), (1e10, 897.309)])
def test_limit(record, EA, expected):
    model = arch(EA, 24)
    path = fc.equilibrium_path(model, load={"P": 1.0}, until={"crown": -20.0})
    limit = path.limits[0]
    record(
        f"Deep arch, EA = {EA:g}, 24 elements: limit load, drop of the crown",
        ours=(limit.factor, model.measure(model.rest)[0] - limit.outputs["crown"]),
        reference=(expected, 113.73),
        source="cubic rod elements; DaDeppo & Schmidt 1975: 897",
        tolerance=1e-3,
    )
