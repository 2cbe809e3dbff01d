"""D18: loops with more conditions than needed, through the position where all bars lie in line.

N-four-bar of the IFToMM benchmark A02 (B10): N + 1 upright bars of 1 m and N across, N loops that one freedom is left
of; let go upright at 1 m/s, 10 s.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from recorder import Absolute

import flexctrl as fc

PAGE = "hard"
ROD = fc.Section(EA=1.0, EI_y=1.0, EI_z=1.0, GJ=1.0, rhoA=1.0, rhoJ=0.0)


@cache
def linkage(count: int) -> fc.Model:
    ups = [fc.Beam(f"up{i}", (i, 0, 0), (i, 1, 0), ROD) for i in range(count + 1)]
    tops = [fc.Beam(f"top{i}", (i, 1, 0), (i + 1, 1, 0), ROD) for i in range(count)]
    joints = [fc.Support(up.start, "u v w") for up in ups]
    for i, top in enumerate(tops):
        joints += [fc.Pin(ups[i].end, top.start), fc.Pin(top.end, ups[i + 1].end)]
    first = ups[0].end
    outputs = [*(fc.Position(a, first, a) for a in "xy"), *(fc.Velocity(f"v{a}", first, a) for a in "xy")]
    structure = fc.planar(fc.Structure([*ups, *tops], joints, outputs=outputs), "z")
    return fc.assemble(structure, [fc.LargeRotation(), fc.Gravity((0, -9.81, 0))])


REFERENCE = {2: (0.328458112, 0.944518538, 1.423051470, -0.494868845), 40: (0.180512227, 0.983572741)}


@pytest.mark.slow
@pytest.mark.parametrize("count", REFERENCE)
def test_ten_seconds(record, count):
    model = linkage(count)
    assert model.n == 1
    run = fc.simulate(
        model,
        start=model.rest.with_(v=np.array([-1.0])),
        until=10.0,
        method=fc.ExplicitRungeKutta(),
        tolerance=fc.Tolerance(0.0, 1e-10),
    )
    record(
        f"D18 {count}-four-bar at 10 s: place and velocity of the first corner",
        ours=[run[name][-1] for name, _ in zip(("x", "y", "vx", "vy"), REFERENCE[count], strict=False)],
        reference=REFERENCE[count],
        source="IFToMM A02; one equation for the angle",
        tolerance=1e-5,
    )
    record(
        f"D18 {count}-four-bar over 10 s: energy lost or made",
        ours=run.report.energy_residual,
        reference=0,
        source="nothing dissipates",
        tolerance=Absolute(1e-5),
    )
    record(
        f"D18 {count}-four-bar over 10 s: loops open by [rad, or shares of what they span]",
        ours=run.report.closure_error,
        reference=0,
        source="conditions of the loops",
        tolerance=Absolute(1e-10),
    )


def test_more_bars_than_needed_move_as_one():
    """Middle bars of a parallelogram add mass and nothing else: α = 3 g (N + 1 + 2 N) sin/(2 (N + 1 + 3 N)) …"""
    for count in (1, 3):
        model = linkage(count)
        assert model.n == 1
        state = model.displace([0.4])
        mass = -model.slope(state, state.v, np.zeros(1), (0.0, 0.0, 1.0), np.zeros(0)).toarray()[0, 0]
        push = model.balance(state, state.v, np.zeros(1))[0]
        assert abs(mass) == pytest.approx((count + 1) / 3 + count, rel=1e-9)
        assert abs(push) == pytest.approx(9.81 * np.sin(0.4) * ((count + 1) / 2 + count), rel=1e-9)
