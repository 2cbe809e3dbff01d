"""A17: hanging cable between supports of equal height.

Span 100 m, 50 N/m; without stretch where EA = 10¹¹ N. As 20 beams of next to no bending stiffness (EI/H is 1 cm² to
3 cm²), drawn straight in their own length, the far end held where the support is, it is within 1e-6 of the closed form:
weight acts on the axis as it sags between the nodes. A `Rope` with `RopeMass` is a polygon, from a straight start that
is slack or stretched and has no stiffness across: with n elements its tensions differ from the catenary's by 1/n³, 5e-5
with 20, its nodes' sag by 1/n², 1e-3 with 20; with 10 and 20 extrapolated both are within 1e-4. How stiff it is does
not change the number of iterations.
"""

from __future__ import annotations

import numpy as np
import pytest
from recorder import Absolute

import flexctrl as fc

PAGE = "statics"
SPAN, WEIGHT, G = 100.0, 50.0, 9.81
STIFF = 1e11
CABLES = {
    "Elastic catenary, EA = 1e5": (1e5, 100.5, (4354.511585, 14.0883907, 5027.36784)),
    "Elastic catenary, EA = 1e6": (1e6, 100.5, (8632.083688, 7.2274872, 8990.30172)),
    "Elastic catenary, EA = 1e8": (1e8, 100.5, (14239.441656, 4.3998718, 14459.40369)),
    "Inextensible catenary, L = 110": (STIFF, 110.0, (3274.81974, 20.030079, 4276.32369)),
}
"""EA, unstretched length, and horizontal tension, sag, greatest tension."""
SOURCE = "closed form (Irvine)"


def of_beams(EA: float, length: float, elements: int) -> np.ndarray:
    """Horizontal tension, sag, tension at the support of a bar whose end is held where the support is."""
    section = fc.Section(EA=EA, EI_y=1.0, EI_z=1.0, GJ=1.0, rhoA=WEIGHT / G, rhoJ=1e-6)
    beam = fc.Beam("cable", (0, 0, 0), (length, 0, 0), section, elements=elements)
    joints = [fc.Support(beam.start, "u v w"), fc.Support(beam.end, "v w")]
    structure = fc.Structure([beam], joints, outputs=[fc.Position("sag", beam.node(elements // 2), "-z")])
    model = fc.assemble(fc.planar(structure, "y"), [fc.Gravity(), fc.Flexible(), fc.LargeRotation()])
    end, still = f"cable_{elements}_u", np.zeros(model.n)
    rest = fc.equilibrium(model, hold={end: SPAN - length})
    assert rest.stable
    across = -model.balance(rest.state, still, still)[model.coordinate(end)]
    return np.array([across, rest.outputs["sag"], np.hypot(across, 0.5 * WEIGHT * length)])


def of_rope(EA: float, length: float, elements: int) -> tuple[np.ndarray, fc.Rest]:
    """The same of a rope: the support bears 11/24 of the element whose tension is measured."""
    rope = fc.Rope("rope", (0, 0, 0), (SPAN, 0, 0), EA=EA, length=length, rhoA=WEIGHT / G, elements=elements)
    joints = [fc.Support(rope.start), fc.Support(rope.end)]
    structure = fc.Structure([rope], joints, outputs=[fc.Tension("steepest", rope)])
    rest = fc.equilibrium(fc.assemble(structure, [fc.Gravity(), fc.LargeRotation(), fc.RopeMass(), fc.RopeStretch()]))
    hanging = 0.5 * WEIGHT * length
    across = np.sqrt(rest.outputs["steepest"] ** 2 - (hanging * (1.0 - 11.0 / 12.0 / elements)) ** 2)
    return np.array([across, -rest.state.x[:, 2].min(), np.hypot(across, hanging)]), rest


@pytest.mark.parametrize("cable", CABLES)
def test_twenty_beams(record, cable):
    EA, length, expected = CABLES[cable]
    record(
        f"{cable}, 20 beams without bending stiffness to speak of: H, sag, greatest tension",
        ours=of_beams(EA, length, 20),
        reference=expected,
        source=SOURCE,
        tolerance=1e-5,
    )


@pytest.mark.parametrize("cable", CABLES)
def test_ropes(record, cable):
    EA, length, expected = CABLES[cable]
    coarse, fine = (of_rope(EA, length, n)[0] for n in (10, 20))
    record(f"{cable}, rope of 20 elements", ours=fine, reference=expected, source=SOURCE, tolerance=1e-3)
    record(
        f"{cable}, rope of 20 elements: tensions",
        ours=fine[[0, 2]],
        reference=(expected[0], expected[2]),
        source=SOURCE,
        tolerance=1e-4,
    )
    record(
        f"{cable}, ropes of 10 and 20 elements extrapolated",
        ours=(4.0 * fine - coarse) / 3.0,
        reference=expected,
        source=SOURCE,
        tolerance=1e-4,
    )


def test_iterations_do_not_depend_on_stretch(record):
    soft, stiff = (of_rope(EA, 110.0, 20)[1].iterations for EA in (1e8, 1e13))
    record(
        "Catenary, L = 110: iterations at EA = 1e13 less those at 1e8",
        ours=stiff - soft,
        reference=0.0,
        source="none wanted",
        tolerance=Absolute(2.0),
    )
