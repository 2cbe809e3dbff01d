"""A12: von Mises' truss of two springs, snapping through.

P(w) = 2 EA (1/√(l² + (h − w)²) − 1/L₀)(h − w) with limits where L_w = (l² L₀)^(1/3): exact, to all digits.
"""

from __future__ import annotations

import numpy as np
import pytest
from recorder import Absolute

import flexctrl as fc

PAGE = "statics"
TRUSSES = {(10.0, 0.5): (4.79925e-5, 0.21144500, 0.78855500), (1.0, 1.0): (0.1874032752, 0.49017547, 1.50982453)}
"""l, h → limit load over EA, w at both limits."""


def truss(span: float, height: float) -> fc.Model:
    EA, length = 1e4, float(np.hypot(span, height))
    left = fc.Spring("left", (-span, 0, 0), (0, height, 0), stiffness=EA / length)
    right = fc.Spring("right", (span, 0, 0), (0, height, 0), stiffness=EA / length)
    apex = fc.PointMass("apex", (0, height, 0), 1.0)
    joints = [
        fc.Support(left.start, "u v w"),
        fc.Support(right.start, "u v w"),
        fc.Support(apex.node, "w"),
        fc.Pin(left.end, apex.node),
        fc.Pin(right.end, apex.node),
    ]
    structure = fc.Structure(
        [left, right, apex], joints, inputs=[fc.Force("P", apex.node, "-y")], outputs=[fc.Position("y", apex.node, "y")]
    )
    return fc.assemble(structure, [fc.Flexible(), fc.LargeRotation()])


def limit(span: float, height: float) -> tuple[float, float]:
    """P/EA and w at the first limit, in closed form."""
    length = np.hypot(span, height)
    at = (span**2 * length) ** (1.0 / 3.0)
    rise = np.sqrt(at**2 - span**2)
    return 2.0 * (1.0 / at - 1.0 / length) * rise, height - rise


@pytest.mark.parametrize(("span", "height"), TRUSSES)
def test_limits(record, span, height):
    load, w = limit(span, height)
    assert load == pytest.approx(TRUSSES[span, height][0], rel=2e-6)
    path = fc.equilibrium_path(truss(span, height), load={"P": 1e4}, until={"y": -1.2 * height})
    assert path.end is fc.PathEnd.REACHED
    found = [(p.factor, height - p.outputs["y"]) for p in path.limits]
    record(
        f"Von Mises truss, l = {span:g}, h = {height:g}: P/EA and w at both limits",
        ours=np.ravel(found),
        reference=(load, w, -load, 2 * height - w),
        source="closed form",
        tolerance=1e-8,
    )


def test_the_whole_path_obeys_the_formula(record):
    path = fc.equilibrium_path(truss(10.0, 0.5), load={"P": 1e4}, until={"y": -0.6})
    rise, length = path["y"], np.hypot(10.0, 0.5)
    exact = 2.0 * (1.0 / np.hypot(10.0, rise) - 1.0 / length) * rise
    record(
        "Von Mises truss: largest P(w) − exact over the limit load",
        ours=np.abs(path.factor - exact).max() / limit(10.0, 0.5)[0],
        reference=0.0,
        source="closed form",
        tolerance=Absolute(1e-8),
    )
