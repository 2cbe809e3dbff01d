"""Positions from which a loop of rigid parts cannot be moved by its coordinate, and those it passes all the same.

Four-bar linkages by the lengths of crank, coupler, rocker and frame, drawn at an angle of the crank.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.dynamics.run import Status

ROD = fc.Section(EA=1.0, EI_y=1.0, EI_z=1.0, GJ=1.0, rhoA=1.0, rhoJ=0.0)


def linkage(*points: tuple[float, float]) -> fc.Structure:
    """Rods from point to point, pinned, with fixed ends."""
    rods = [fc.Beam(f"rod{i}", (*a, 0), (*b, 0), ROD) for i, (a, b) in enumerate(pairwise(points))]
    joints = [fc.Pin(a.end, b.start) for a, b in pairwise(rods)]
    joints += [fc.Support(rods[0].start, "u v w"), fc.Support(rods[-1].end, "u v w")]
    push = [fc.Torque("push", rods[0].start, "z")]
    outputs = [fc.Rotation("turn", rods[0].start, "z")]
    outputs += [fc.AngularVelocity(f"rate{i}", rod.start, "z") for i, rod in enumerate(rods)]
    return fc.planar(fc.Structure(rods, joints, inputs=push, outputs=outputs))


def four_bar(lengths: tuple[float, ...], angle: float) -> fc.Model:
    crank, coupler, rocker, frame = lengths
    pin, far = crank * np.exp(1j * angle), complex(frame)
    apart = abs(far - pin)
    along = (apart**2 + coupler**2 - rocker**2) / (2 * apart)
    corner = pin + (along + 1j * np.sqrt(coupler**2 - along**2)) * (far - pin) / apart
    points = [(z.real, z.imag) for z in (0j, pin, corner, far)]
    return fc.assemble(linkage(*points), [fc.LargeRotation()])


def drawn(seed: int, count: int, wanted: Callable[[np.ndarray], bool]) -> list[tuple[tuple[float, ...], float]]:
    """Some linkages of a kind, at some angles at which they can be drawn."""
    rng, found = np.random.default_rng(seed), list[tuple[tuple[float, ...], float]]()
    while len(found) < count:
        lengths, angle = rng.uniform(0.2, 1.5, 4), rng.uniform(0.0, 2 * np.pi)
        apart = abs(lengths[3] - lengths[0] * np.exp(1j * angle))
        fits = 1.05 * abs(lengths[1] - lengths[2]) < apart < 0.95 * (lengths[1] + lengths[2])
        if fits and wanted(lengths):
            found.append((tuple(lengths.tolist()), float(angle)))
    return found


def goes_round(lengths: np.ndarray) -> bool:
    """The shortest bar does, by Grashof's rule; by some margin."""
    least, *middle, most = np.sort(lengths)
    return bool(least + most < 0.98 * sum(middle))


def goes_nowhere_round(lengths: np.ndarray) -> bool:
    least, *middle, most = np.sort(lengths)
    return bool(least + most > 1.02 * sum(middle))


@pytest.mark.parametrize("step", [0.04, 1e-3, 2e-4])
def test_a_parallelogram_passes_the_line_with_any_step(step):
    """Equal bars, no weight: it turns at a constant rate through the line at 90°.

    A step that would end on the line goes 2e-6 further; near it a gap that is off by one digit, the last, makes
    accelerations of 1e-6.
    """
    model = fc.assemble(linkage((0, 0), (0, 1), (1, 1), (1, 0)), [fc.LargeRotation()])
    start = model.displace([-0.5 * np.pi + 0.05]).with_(v=np.array([-1.0]))
    run = fc.simulate(model, until=0.1, start=start, method=fc.GeneralizedAlpha(step))
    assert run.status is Status.FINISHED
    assert run["turn"][-1] == pytest.approx(-0.5 * np.pi - 0.05, abs=6e-6)
    assert run.report.closure_error < 1e-12


def test_a_rocker_stops_where_its_coupler_and_crank_are_in_line():
    """The rocker's angle cannot move the crank there: the run ends with what it has, and says so."""
    model = fc.assemble(linkage((0, 0), (0.3, 0), (1.2, 0.9), (1.2, 0)), [fc.LargeRotation()])
    run = fc.simulate(model, until=60.0, start=model.rest.with_(v=np.ones(1)), method=fc.GeneralizedAlpha(0.01))
    if run.status is Status.FAILED:
        assert "dead point" in run.report.message
    assert np.isfinite(run.y).all()
    assert run.report.closure_error < 1e-9


@pytest.mark.parametrize("method", [fc.AdaptiveAlpha(), fc.GeneralizedAlpha(1e-3), fc.GeneralizedAlpha(1e-2)])
def test_a_loop_is_not_sent_back_from_a_dead_point(method):
    """A mass on two rigid ropes swings about the line of its supports as a pendulum: what cannot go on is told."""
    left, right = fc.Rope("left", (-1, 0, 0), (0, 0, -1), EA=1e5), fc.Rope("right", (1, 0, 0), (0, 0, -1), EA=1e5)
    mass = fc.PointMass("mass", (0, 0, -1), 1.0)
    s = fc.Structure(
        [left, right, mass],
        [fc.Support(left.start), fc.Support(right.start), fc.Pin(left.end, mass.node), fc.Pin(right.end, mass.node)],
        outputs=[fc.Position("y", mass.node, "y"), fc.Position("z", mass.node, "z")],
    )
    model = fc.assemble(s, [fc.Gravity(), fc.LargeRotation()])
    start = fc.project(model, model.rest, {mass.node: (0.0, 7.0, 0.0)}).state
    run = fc.simulate(model, until=1.0, start=start, every=0.02, method=method)
    if run.status is fc.Status.FINISHED:
        assert run.at(0.48)["y"] == pytest.approx(0.514, abs=0.02)  # DOP853 of the pendulum's equation
    else:
        assert "dead point" in run.report.message
        assert run.t[-1] < 0.4


METHODS = [fc.AdaptiveAlpha(), fc.Unchecked(fc.AdaptiveAlpha()), fc.GeneralizedAlpha(5e-3), fc.ExplicitRungeKutta()]


@pytest.mark.parametrize("method", [*METHODS, fc.ConservingMidpoint(1e-2)], ids=lambda m: type(m).__name__)
def test_no_linkage_turns_back_under_a_torque_before_the_run_ends(method):
    """From rest, without weight: the energy is the torque times the crank's turn, so a way once begun is gone on."""
    for lengths, angle in drawn(3, 5, goes_nowhere_round):
        run = fc.simulate(four_bar(lengths, angle), until=1.2, inputs={"push": 2.0}, every=2e-3, method=method)
        rates = np.column_stack([run[f"rate{i}"] for i in range(3)])[1:]
        ways = rates / np.linalg.norm(rates, axis=1)[:, None]
        assert np.einsum("ij,ij->i", ways[1:], ways[:-1])[run["turn"][2:] > 0.01].min() > 0.0
        assert run.report.closure_error < 1e-9
        if run.status is Status.FAILED:
            assert "dead point" in run.report.message


def test_the_coordinate_of_a_linkage_is_a_bar_that_goes_round_wherever_it_is_drawn():
    """Grashof: the shortest bar goes round; if that is the frame, all others do."""
    for lengths, angle in drawn(4, 30, goes_round):
        shortest = int(np.argmin(lengths))
        (name,) = four_bar(lengths, angle).coordinates
        assert shortest == 3 or name == f"rod{shortest}_0_rz"


def test_linkages_that_go_round_do_so_under_a_torque():
    for lengths, angle in drawn(5, 3, lambda lengths: goes_round(lengths) and np.argmin(lengths) == 0):
        run = fc.simulate(four_bar(lengths, angle), until=1.0, inputs={"push": 20.0}, method=METHODS[1])
        assert run.status is Status.FINISHED
        assert run["turn"][-1] > 2 * np.pi
        assert (np.diff(run["turn"]) > 0.0).all()
