"""An element that is twisted by more than half a turn: its forces would change their sign without a word."""

from __future__ import annotations

import numpy as np
import pytest

import flexctrl as fc

WIRE = fc.Section.circular(fc.STEEL, radius=1e-3)
LENGTH, INERTIA = 2.0, 1e-3
STIFFNESS = WIRE.GJ / LENGTH


def pendulum(elements: int) -> fc.Model:
    """A disk on a wire, about whose axis alone it turns."""
    wire = fc.Beam("wire", (0, 0, 0), (LENGTH, 0, 0), WIRE, elements=elements)
    disk = fc.RigidBody("disk", (LENGTH, 0, 0), 1.0, (INERTIA,) * 3)
    joints = [fc.Support(wire.start), fc.Weld(wire.end, disk.node), fc.Support(disk.node, "v w ry rz")]
    inputs, outputs = [fc.Torque("M", disk.node, "x")], [fc.Rotation("a", disk.node, "x")]
    structure = fc.Structure([wire, disk], joints, inputs=inputs, outputs=outputs)
    return fc.assemble(structure, [fc.Flexible(), fc.LargeRotation()])


@pytest.mark.parametrize(
    "method",
    [fc.AdaptiveAlpha(), fc.GeneralizedAlpha(2e-3), fc.ExplicitRungeKutta(), fc.ConservingMidpoint(5e-3)],
    ids=lambda method: type(method).__name__,
)
def test_a_run_ends_before_and_names_the_element(method):
    """It went on to 31 rad, for 4, at any tolerance."""
    period = 2.0 * np.pi * np.sqrt((INERTIA + WIRE.rhoJ * LENGTH / 3.0) / STIFFNESS)
    run = fc.simulate(pendulum(1), until=period, inputs={"M": 2.0 * STIFFNESS}, method=method)
    assert run.status is fc.Status.FAILED
    assert "element 1 of wire is turned by 2.7" in run.report.message
    assert "give wire more elements" in run.report.message
    assert 2.7 < run["a"].max() < 2.75
    true = 2.0 - 2.0 * np.cos(2.0 * np.pi * run.t / period)
    assert np.abs(run["a"] - true).max() < 2e-2


def test_two_elements_go_there():
    period = 2.0 * np.pi * np.sqrt((INERTIA + WIRE.rhoJ * LENGTH / 3.0) / STIFFNESS)
    tight = fc.Tolerance(1e-7, 1e-10)
    run = fc.simulate(pendulum(2), until=period, inputs={"M": 2.0 * STIFFNESS}, tolerance=tight)
    assert run.status is fc.Status.FINISHED
    assert run["a"].max() == pytest.approx(4.0, abs=1e-3)


def test_equilibria_are_refused_and_paths_end():
    """`equilibrium_path` gave 2000 wrong ones, to 178 rad."""
    with pytest.raises(fc.errors.EquilibriumError, match=r"element 1 of wire is turned by 2\.7"):
        fc.equilibrium(pendulum(1), inputs={"M": 4.0 * STIFFNESS})
    assert fc.equilibrium(pendulum(2), inputs={"M": 4.0 * STIFFNESS}).outputs["a"] == pytest.approx(4.0, rel=1e-9)
    path = fc.equilibrium_path(pendulum(1), load={"M": STIFFNESS}, until=4.0)
    assert "element 1 of wire is turned by 2.7" in str(path)
    assert np.allclose(path["a"], path.factor, rtol=1e-6)
    assert 2.7 < path.factor[-1] < 2.75


@pytest.mark.parametrize("axis", ["ry", "rz"])
def test_so_do_ends_that_are_bent(axis):
    """A wire under a torque at its free end, with one element."""
    strip = fc.Beam("strip", (0, 0, 0), (1, 0, 0), WIRE, elements=1)
    inputs = [fc.Torque("M", strip.end, axis[1])]
    structure = fc.Structure([strip], [fc.Support(strip.start)], inputs=inputs)
    model = fc.assemble(structure, [fc.Flexible(), fc.LargeRotation()])
    path = fc.equilibrium_path(model, load={"M": WIRE.EI_y}, until=20.0)
    assert "element 1 of strip is turned by 2.7" in str(path)
    assert 2.7 < path.factor[-1] < 2.75


def twirling(elements: int) -> fc.Model:
    """A wire whose end turns about its axis alone."""
    section = fc.Section(EA=1e6, EI_y=2e4, EI_z=2e4, GJ=1.0, rhoA=1e-3, rhoJ=1e-6)
    wire = fc.Beam("wire", (0, 0, 0), (1, 0, 0), section, elements=elements)
    disk = fc.RigidBody("disk", (1, 0, 0), 1.0, (1.0,) * 3)
    joints = [fc.Support(wire.start), fc.Weld(wire.end, disk.node)]
    joints += [fc.Support(node, held="u v w ry rz") for node in wire.nodes[1:]]
    outputs = [fc.AngularVelocity("w", disk.node, "x")]
    return fc.assemble(fc.Structure([wire, disk], joints, outputs=outputs), [fc.Flexible(), fc.LargeRotation()])


@pytest.mark.parametrize(
    ("elements", "speed", "how"),
    [
        (1, 202.5121, {}),
        (1, 52.6795, {"tolerance": fc.Tolerance(1e-3, 1e-6)}),
        (2, 1109.7098, {"tolerance": fc.Tolerance(1e-3, 1e-6)}),
        (1, 314.2017, {"method": fc.GeneralizedAlpha(0.02)}),
        (4, 8.0 * np.pi / 0.02, {"method": fc.GeneralizedAlpha(0.02)}),
    ],
)
def test_what_passes_half_a_turn_in_a_step_is_told(elements, speed, how):
    """12 % off, at a hundred radians an element, and twice the speed where steps are whole turns: without a word."""
    model = twirling(elements)
    start = model.rest.with_(v=speed * np.arange(1, elements + 1) / elements)
    run = fc.simulate(model, until=0.5, start=start, **how)
    assert run.status is fc.Status.FAILED or any("may pass half a turn unseen" in note for note in run.report.notes)


def test_it_is_told_of_a_run_that_goes_on_too():
    model, how = twirling(1), {"method": fc.GeneralizedAlpha(0.02)}
    half = fc.simulate(model, until=0.4, start=model.rest.with_(v=np.array([314.2017])), **how)
    rest = fc.simulate(model, until=0.5, start=half.checkpoint, **how)
    for run in (half, rest):
        assert any("turns by 6.3 rad a step" in note for note in run.report.notes)


def test_many_elements_go_there_without_a_word():
    model = twirling(32)
    run = fc.simulate(model, until=1.0, start=model.rest.with_(v=20.0 * np.arange(1, 33) / 32))
    assert run.status is fc.Status.FINISHED
    assert not any("turns by" in note for note in run.report.notes)
    assert np.abs(run["w"] - 20.0 * np.cos(run.t)).max() < 0.2


@pytest.mark.parametrize("angle", [2.9, 4.0, 2.0 * np.pi, 7.0, -4.0])
def test_displacements_beyond_half_a_turn_are_refused_at_any_angle(angle):
    """4 rad were felt as −2.28."""
    with pytest.raises(fc.errors.StructureError, match="element 1 of wire is turned by"):
        twirling(1).displace({"wire_1_rx": angle})
    with pytest.raises(fc.errors.FlexctrlError, match="element 1 of wire is turned by"):
        fc.equilibrium(twirling(1), hold={"wire_1_rx": angle})
    fine = twirling(4).displace({f"wire_{i}_rx": angle * i / 4.0 for i in range(1, 5)})
    assert twirling(4).energy(fine)[1] == pytest.approx(0.5 * angle**2, rel=1e-9)
