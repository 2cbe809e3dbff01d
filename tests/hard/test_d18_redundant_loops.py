"""D18: loops with more conditions than needed, through the position where all bars lie in line;
and conditions that say nothing more only because parts are drawn in line: rigid bars between two walls cannot move.

N-four-bar of the IFToMM benchmark A02 (B10): N + 1 upright bars of 1 m and N across, N loops that one freedom is left
of; let go upright at 1 m/s, 10 s.
"""

from __future__ import annotations

from functools import cache
from itertools import pairwise

import numpy as np
import pytest
from recorder import Absolute

import flexctrl as fc
from flexctrl.errors import EquilibriumError, LinearizationError

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
        tolerance=fc.Tolerance(0.0, 1e-11),
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


def bars(angle: float = 0.0, held: str = "u v w rx", count: int = 2) -> fc.Structure:
    """Bars of 1 m end to end between two walls, each turned by an angle against the line, to and fro."""
    step, rise = np.cos(angle), np.sin(angle)
    joints = [(i * step, 0.0, rise * (i % 2)) for i in range(count + 1)]
    parts = [fc.Beam(f"bar{i}", a, b, STIFF) for i, (a, b) in enumerate(pairwise(joints))]
    ends = [fc.Support(parts[0].start, "u v w rx"), fc.Support(parts[-1].end, held)]
    turns = [fc.Support(part.start, "rx") for part in parts[1:-1]]
    outputs = [fc.Position("mid", parts[0].end, "z"), fc.Position("wall", parts[-1].end, "x")]
    return fc.Structure(parts, [*ends, *turns, *(fc.Pin(a.end, b.start) for a, b in pairwise(parts))], outputs=outputs)


STIFF = fc.Section(EA=1e6, EI_y=1e3, EI_z=1e3, GJ=1e3, rhoA=1.0, rhoJ=1e-3)
WEIGHT = [fc.LargeRotation(), fc.Gravity()]
METHODS = [None, fc.ExplicitRungeKutta(), fc.GeneralizedAlpha(1e-3), fc.ConservingMidpoint(1e-3)]


@pytest.mark.parametrize("method", METHODS, ids=lambda m: type(m).__name__)
@pytest.mark.parametrize("backend", [fc.CasadiVM(), None], ids=["plain", "best"])
def test_bars_in_line_between_walls_come_apart_in_no_run(method, backend):
    run = fc.simulate(fc.assemble(bars(), WEIGHT, backend), until=0.5, method=method)
    assert run.status is fc.Status.FAILED
    assert "of bar1 has come apart by" in run.report.message
    assert "leave one of them flexible" in run.report.message
    assert 0.0 < run.t[-1] < 0.05
    assert abs(run["wall"][-1] - 2.0) < 1e-4
    assert 1e-6 < run.report.closure_error < 1e-4
    assert any("left free to second order" in note for note in run.report.notes)


def test_bars_in_line_between_walls_have_no_equilibrium_and_no_linear_model():
    model = fc.assemble(bars(), WEIGHT, fc.CasadiVM())
    for find in (fc.equilibrium, fc.linearize):
        with pytest.raises(EquilibriumError, match=r"u of node 1 of bar1 has come apart by .* m"):
            find(model)
    still = fc.assemble(bars(), [fc.LargeRotation()], fc.CasadiVM())
    sunk = still.displace([0.1] * still.n)
    with pytest.raises(LinearizationError, match="has come apart"):
        fc.linearize(still, at=sunk)


@pytest.mark.parametrize("structure", [bars(0.1), bars(held="v w rx"), bars(0.2, count=3)])
def test_bars_off_the_line_or_free_along_it_run(structure):
    model = fc.assemble(structure, WEIGHT, fc.CasadiVM())
    run = fc.simulate(model, until=0.1)
    assert run.status is fc.Status.FINISHED
    assert run.report.closure_error < 1e-12
    assert not any("left free" in note for note in model.notes)


def test_bars_in_line_of_which_one_is_flexible_run():
    run = fc.simulate(fc.assemble(bars(), [*WEIGHT, fc.BeamFlexibility(["bar0"])], fc.CasadiVM()), until=0.1)
    assert run.status is fc.Status.FINISHED


def test_a_body_comes_off_no_guide_square_to_its_arm():
    """Its tip can leave the plane only as the square of a turn about the pin; the pin stays where it is."""
    body = fc.RigidBody("body", (0, 0, 0), 2.0, (1, 1, 1), {"tip": (1, 0, 0)})
    mass = fc.PointMass("mass", (1, 0, 0), 1.0)
    joints = [fc.Support(body.node, "u v w"), fc.Pin(body.point("tip"), mass.node), fc.Support(mass.node, "u")]
    run = fc.simulate(fc.assemble(fc.Structure([body, mass], joints), WEIGHT, fc.CasadiVM()), until=1.0)
    assert run.status is fc.Status.FAILED
    assert "has come apart" in run.report.message


def test_a_taut_rope_of_rigid_links_does_not_hang_in_two_halves():
    rope = fc.Rope("rope", (0, 0, 0), (100, 0, 0), EA=1.0, rhoA=5.0, elements=20)
    structure = fc.Structure([rope], [fc.Support(rope.start), fc.Support(rope.end)])
    with pytest.raises(EquilibriumError, match=r"of rope10 has come apart by .* m"):
        fc.equilibrium(fc.assemble(structure, [fc.RopeMass(), *WEIGHT], fc.CasadiVM()))


def test_a_condition_too_many_is_harmless_and_stays_closed():
    """Of four wheels on a plane three are enough."""
    wheels = {"a": (1, 0.6, 0), "b": (1, -0.6, 0), "c": (-1, 0.6, 0), "d": (-1, -0.6, 0)}
    trolley = fc.RigidBody("trolley", (0.2, 0.1, 0.3), 10.0, (1, 1, 1.5), wheels)
    model = fc.assemble(fc.Structure([trolley], [fc.Support(trolley.point(w), "w") for w in wheels]), WEIGHT)
    assert [note for note in model.notes if "one condition too many, which is harmless" in note]
    assert not any("left free" in note for note in model.notes)
    assert model.motion.spare
    assert model.motion.closure_error(model.displace([0.4, -0.3, 0.8])) < 1e-14
    run = fc.simulate(model, start=model.rest.with_(v=np.array([1.0, 0.5, 3.0])), until=1.0)
    assert run.status is fc.Status.FINISHED
    assert run.report.closure_error < 1e-14


def test_in_small_motion_bars_in_line_are_as_free_as_linear_theory_says():
    model = fc.assemble(bars(), [fc.Gravity()], fc.CasadiVM())
    assert fc.simulate(model, until=0.5).status is fc.Status.FINISHED


def test_a_path_of_equilibria_ends_where_bars_in_line_would_come_apart():
    """A spring in the middle carries all of the load that the bars seem to give way to."""
    plain = bars()
    middle = plain.elements[0].end
    stay = fc.Spring("stay", (1, 0, -1), middle.position, stiffness=100.0)
    side = fc.Spring("side", (1, -1, 0), middle.position, stiffness=100.0)
    joints = [*plain.joints, *(fc.Support(s.start) for s in (stay, side))]
    joints += [fc.Pin(middle, s.end) for s in (stay, side)]
    push = fc.Force("push", middle, "-z")
    structure = fc.Structure([*plain.elements, stay, side], joints, inputs=[push], outputs=plain.outputs)
    path = fc.equilibrium_path(fc.assemble(structure, [fc.LargeRotation()], fc.CasadiVM()), {"push": 1.0}, until=10.0)
    assert path.end is fc.PathEnd.STUCK
    assert abs(path["mid"][-1]) < 6e-3
    assert np.abs(path["wall"] - 2.0).max() < 4e-5
