"""B18, dry friction and play: LuGre's bristles, an oscillator that Coulomb's friction stops, one with backlash.

Canudas de Wit et al. (1995): 1 kg on a spring of 2 N/m whose other end goes on at 0.1 m/s sticks and slips. The moving
end of the spring is a force that grows by 0.2 N/s beside a spring to the ground. Coulomb's friction takes 4 F/k from
the swing in each period, exactly, and at the end the mass stands still. Within play it flies
freely: T = 2π/ω + 2 b/v.

LuGre's creep in the stuck spring remembers where it stuck: a place wrong by 8e-5 at 20 s is a creep wrong by 1e-3 at
25 s, so the steps are chosen for 2e-9. (Radau at 1e-8 to 1e-12 gives 9.4241546 µm/s and 11.8167955 µm.)
"""

from __future__ import annotations

import numpy as np
import pytest
from recorder import Absolute

import flexctrl as fc
from flexctrl.design import PiecewisePolynomial

PAGE = "dynamics"
LUGRE = {10: 0.62758313, 20: 1.27259641, 25: 1.9088391992}
STOPS = {0.3: (-0.02, 7), 0.31: (-0.01, 8), 0.095: (0.015, 2)}
"""Start → where it stops, and after how many half periods."""


def oscillator(stiffness: float, friction: fc.LuGreFriction | fc.CoulombFriction | fc.Backlash) -> fc.Model:
    """1 kg on a spring along x."""
    block = fc.RigidBody("block", (0, 0, 0), 1.0, (1.0, 1.0, 1.0))
    spring = fc.Spring("spring", (-10, 0, 0), (0, 0, 0), stiffness)
    joints = [fc.Support(block.node, "v w rx ry rz"), fc.Support(spring.start), fc.Pin(spring.end, block.node)]
    outputs = [fc.Position("x", block.node, "x"), fc.Velocity("v", block.node, "x")]
    structure = fc.Structure([block, spring], joints, inputs=[fc.Force("pull", block.node, "x")], outputs=outputs)
    return fc.assemble(structure, [fc.LargeRotation(), fc.Flexible(), friction])


@pytest.mark.slow
def test_lugre_sticks_and_slips(record):
    law = fc.LuGre(1e5, kinetic=1.0, static=1.5, stribeck=1e-3, damping=np.sqrt(1e5), viscous=0.4)
    model = oscillator(2.0, fc.LuGreFriction({"block.u": law}))
    pull = fc.OpenLoop({"pull": PiecewisePolynomial((0.0,), ((0.0, 0.2),))})
    how = {"until": 25.0, "tolerance": fc.Tolerance(2e-9, 2e-12), "every": 2e-3}
    run = fc.simulate(model, pull, method=fc.Unchecked(fc.AdaptiveAlpha()), **how)
    source = "EXUDYN Examples/lugreFrictionTest.py; high-order integration"
    record(
        "B18 LuGre, place at 10, 20, 25 s [m]",
        ours=[run["x"][np.argmin(np.abs(run.t - t))] for t in LUGRE],
        reference=list(LUGRE.values()),
        source=source,
        tolerance=1e-4,
    )
    record(
        "B18 LuGre, creep and bristle at 25 s [µm/s, µm]",
        ours=[1e6 * run["v"][-1], 1e6 * run.final.q[model.coordinate("block_u_bristle")]],
        reference=[9.42415, 11.816795],
        source=source,
        tolerance=1e-4,
    )
    v = run["v"]
    slips = [np.interp(0.05, v[i : i + 2], run.t[i : i + 2]) for i in np.flatnonzero((v[1:] > 0.05) & (v[:-1] <= 0.05))]
    record(
        "B18 LuGre, first two slips (0.05 m/s reached) [s], first peak [m/s]",
        ours=[*slips[:2], v[run.t < 10.0].max()],
        reference=[7.5404, 13.9032, 0.36982],
        source=source,
        tolerance=1e-4,
    )


@pytest.mark.slow
@pytest.mark.parametrize("start", STOPS)
def test_coulomb_friction_stops_an_oscillator(start, record):
    """k = 100 N/m, F = 2 N, to break loose 2.001 N: from 0.3 m the spring ends up pulling with just 2 N."""
    model = oscillator(100.0, fc.CoulombFriction({"block.u": fc.Coulomb(2.0, static=2.001)}))
    stop, halves = STOPS[start]
    drawn = model.displace({"block_0_u": start})
    run = fc.simulate(
        model,
        until=0.1 * np.pi * halves + 1.0,
        start=drawn,
        method=fc.Unchecked(fc.ExplicitRungeKutta()),
        tolerance=fc.Tolerance(1e-9, 1e-9),
    )
    record(
        f"B18 Coulomb from {start:g} m: where it stops [m]",
        ours=run["x"][-1],
        reference=stop,
        source="closed form",
        tolerance=Absolute(1e-6),
    )
    record(
        f"B18 Coulomb from {start:g} m: when [s]",
        ours=run.events[-1].t,
        reference=0.1 * np.pi * halves,
        source="closed form",
        tolerance=1e-6,
    )
    record(
        f"B18 Coulomb from {start:g} m: creep afterwards [m/s]",
        ours=np.abs(run["v"][run.t > run.events[-1].t + 1e-9]).max(),
        reference=0.0,
        source="it sticks",
        tolerance=Absolute(1e-9),
    )


@pytest.mark.slow
def test_period_with_backlash(record):
    """A gap b of 20 mm; from rest at 50 mm it enters the gap at v = ω (50 mm − b/2)."""
    model = oscillator(100.0, fc.Backlash({"spring": 0.02}))
    run = fc.simulate(
        model,
        until=5.0,
        start=model.displace(np.array([0.05])),
        method=fc.Unchecked(fc.ExplicitRungeKutta()),
        tolerance=fc.Tolerance(1e-9, 1e-9),
        events=[fc.Event("turning", "v", direction=fc.Direction.FALLING)],
    )
    tops = [event.t for event in run.events if event.name == "turning"]
    record(
        "B18 backlash, period over five swings [s]",
        ours=np.diff([t for t in tops if t > 0.1])[:5].mean(),
        reference=2.0 * np.pi / 10.0 + 2.0 * 0.02 / (10.0 * 0.04),
        source="closed form",
        tolerance=1e-6,
    )
    assert run.report.energy_residual < 2e-6
