"""A9: Lee's frame, through snap-through and snap-back.

Two hinged legs of 120 with a dead load 24 from the corner (data: AeroBeams.jl ``test/examples/LeeFrameDeadLoad.jl``).
Reference limits by shooting with an extended system; the digitised curve often quoted (18.76e3, −9.47e3) is off by
1 %. One call follows the path from rest past both limits.
"""

from __future__ import annotations

import pytest
from statics import NONLINEAR, out_of_plane

import flexctrl as fc

PAGE = "statics"
LIMITS = {
    False: ((18556.73, 26.8806, -48.7351), (-9414.43, 90.1957, -58.2168)),
    True: ((18548.90, 26.8791, -48.7474), (-9400.36, 90.1837, -58.2220)),
}
"""With shear stiffness EA/2 or none: P, u, v at both limits."""


def frame(shear: bool) -> fc.Model:
    EA, EI = 7.2e6 * 6.0, 7.2e6 * 2.0
    stiff = {"GA_y": EA / 2, "GA_z": EA / 2} if shear else {}
    section = fc.Section(EA, EI, EI, EI, rhoA=1.0, rhoJ=1.0, **stiff)
    column = fc.Beam("column", (0, 0, 0), (0, 120, 0), section, elements=10)
    near = fc.Beam("near", (0, 120, 0), (24, 120, 0), section, elements=2)
    far = fc.Beam("far", (24, 120, 0), (120, 120, 0), section, elements=8)
    hinged = [fc.Support(column.start, "u v w rx ry"), fc.Support(far.end, "u v w rx ry")]
    welds = [fc.Weld(column.end, near.start), fc.Weld(near.end, far.start)]
    planar = out_of_plane((*column.nodes[1:], *near.nodes[1:], *far.nodes[1:-1]))
    structure = fc.Structure(
        [column, near, far],
        [*hinged, *welds, *planar],
        inputs=[fc.Force("P", near.end, "-y")],
        outputs=[fc.Position("x", near.end, "x"), fc.Position("y", near.end, "y")],
    )
    return fc.assemble(structure, NONLINEAR)


@pytest.fixture(scope="module")
def path() -> fc.EquilibriumPath:
    return fc.equilibrium_path(frame(False), load={"P": 1.0}, until={"y": 120.0 - 94.0})


def limits(path: fc.EquilibriumPath) -> list[tuple[float, float, float]]:
    return [(p.factor, p.outputs["x"] - 24.0, p.outputs["y"] - 120.0) for p in path.limits]


@pytest.mark.parametrize("which", [0, 1])
def test_limits(record, path, which):
    record(
        f"Lee's frame, limit {which + 1}, 20 elements: P, u, v",
        ours=limits(path)[which],
        reference=LIMITS[False][which],
        source="shooting, extended system",
        tolerance=2e-3,
    )


@pytest.mark.slow
@pytest.mark.parametrize("which", [0, 1])
def test_limits_with_shear(record, which):
    sheared = fc.equilibrium_path(frame(True), load={"P": 1.0}, until={"y": 120.0 - 94.0})
    record(
        f"Lee's frame, shear stiffness EA/2, limit {which + 1}: P, u, v",
        ours=limits(sheared)[which],
        reference=LIMITS[True][which],
        source="shooting, extended system",
        tolerance=2e-3,
    )


def test_the_path_goes_on_past_both(record, path):
    assert path.end is fc.PathEnd.REACHED
    assert len(path.limits) == 2
    record(
        "Lee's frame, P where v = −94",
        ours=path.factor[-1],
        reference=3.78e4,
        source="shooting",
        tolerance=2e-3,
    )


def test_stability_changes_by_one_at_each_limit(path):
    """Stable as far as the first, one negative pivot between them, stable again after the second."""
    turns = [i for i in range(1, len(path.points)) if path.unstable[i] != path.unstable[i - 1]]
    assert path.unstable[[0, *turns]].tolist() == [0, 1, 0]
    for i, limit in zip(turns, path.limits, strict=True):
        assert min(path["y"][i - 1 : i + 1]) <= limit.outputs["y"] <= max(path["y"][i - 1 : i + 1])
