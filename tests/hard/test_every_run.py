"""Every run tells its energy, steps, rejections, Newton counts, worst freedom; what fails says so, keeping the rest.

The fixture in conftest.py asks this of every simulation of these tests; here are runs that cannot reach their end.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.dynamics.run import Status
from flexctrl.errors import MechanismError, StructureError

ROD = fc.Section(EA=1.0, EI_y=1.0, EI_z=1.0, GJ=1.0, rhoA=1.0, rhoJ=0.0)


def chain(count: int = 12, stiffness: float = 1e8) -> fc.Model:
    """Masses on stiff springs, let go from the horizontal."""
    springs = [fc.Spring(f"s{i}", (i, 0, 0), (i + 1, 0, 0), stiffness=stiffness) for i in range(count)]
    masses = [fc.PointMass(f"m{i}", spring.end, 1.0) for i, spring in enumerate(springs)]
    joints = [fc.Support(springs[0].start), *(fc.Pin(a.end, b.start) for a, b in pairwise(springs))]
    joints += [fc.Pin(spring.end, mass.node) for spring, mass in zip(springs, masses, strict=True)]
    outputs = [fc.Position("z", masses[-1].node, "z")]
    structure = fc.planar(fc.Structure([*springs, *masses], joints, outputs=outputs), "y")
    return fc.assemble(structure, [fc.LargeRotation(), fc.Gravity()])


def test_steps_that_make_energy_from_nothing_end_the_run():
    """Fixed steps of many periods of the springs: an energy that grows without a source is no result.

    With damping of the method's own it is chance whether it grows; without it does.
    """
    run = fc.simulate(chain(), until=20.0, method=fc.GeneralizedAlpha(0.02, rho=1.0))
    assert run.status is Status.FAILED
    assert "has made" in run.report.message
    assert "steps smaller than 0.02 s, or AdaptiveAlpha" in run.report.message
    assert "ConservingMidpoint(0.02)" in run.report.message
    assert len(run.t) > 10


@pytest.mark.parametrize(("stiffness", "step", "rho"), [(1e4, 0.15, 0.9), (1e4, 0.2, 0.9), (1e5, 0.2, 0.6)])
def test_energy_that_was_made_and_lost_again_on_the_way_is_not_forgotten(stiffness, step, rho):
    """Three springs in steps in which they turn by a radian: a spike of energy, most of which is damped again."""
    run = fc.simulate(chain(3, stiffness), until=5.0, method=fc.GeneralizedAlpha(step, rho))
    assert run.report.energy_residual > 0.5
    assert run.status is Status.FAILED
    assert "the motion is not resolved" in run.report.message
    assert len(run.t) > 10


def test_an_event_that_ends_a_run_vouches_for_nothing():
    """A chain in steps that make energy in it, ended by an event on its way."""
    event = fc.Event("through", "z", at=0.5, direction=fc.Direction.RISING, terminal=True)
    run = fc.simulate(chain(3, 1e4), until=5.0, method=fc.GeneralizedAlpha(0.2), events=[event])
    assert run.report.energy_residual > 0.5
    assert run.status is Status.FAILED
    assert "the motion is not resolved" in run.report.message
    assert "through" in run.report.message


def test_an_interrupted_run_says_what_its_books_miss():
    calls = iter(range(10**6))

    def interrupting(seen):
        if next(calls) > 80:
            raise KeyboardInterrupt
        return 1.0

    method = fc.GeneralizedAlpha(0.15)
    run = fc.simulate(chain(3, 1e4), until=50.0, method=method, events=[fc.Event("never", interrupting)])
    assert run.status is Status.INTERRUPTED
    assert run.report.energy_residual > 0.05
    assert any("resolved" in note for note in run.report.notes)


def test_steps_that_are_controlled_reach_the_end_of_the_same_run():
    run = fc.simulate(chain(), until=5.0)
    assert run.status is Status.FINISHED
    assert run.report.energy.gap < 0.0


def test_a_dead_point_ends_the_run_by_name():
    """Rockers: the first leans out until the coupler and the second are in line, and cannot say how they go on."""
    points = [(0, 0, 0), (0.6, 0.8, 0), (1.4, 0.8, 0), (2.0, 0, 0)]
    rods = [fc.Beam(f"rod{i}", a, b, ROD) for i, (a, b) in enumerate(pairwise(points))]
    joints = [fc.Pin(a.end, b.start) for a, b in pairwise(rods)]
    joints += [fc.Support(rods[0].start, "u v w"), fc.Support(rods[-1].end, "u v w")]
    model = fc.assemble(fc.planar(fc.Structure(rods, joints), "z"), [fc.LargeRotation()])
    run = fc.simulate(model, start=model.rest.with_(v=np.ones(1)), until=5.0, method=fc.GeneralizedAlpha(0.01))
    assert run.status is Status.FAILED
    assert "dead point" in run.report.message
    assert "worst freedom" in run.report.message


def test_a_freedom_without_mass_and_stiffness_is_refused_by_name():
    spring, mass = fc.Spring("spring", (0, 0, 0), (1, 0, 0), stiffness=0.0), fc.PointMass("mass", (1, 0, 0), 0.0)
    structure = fc.Structure([spring, mass], [fc.Support(spring.start), fc.Pin(spring.end, mass.node)])
    with pytest.raises(MechanismError, match="spring_1_u"):
        fc.simulate(fc.assemble(structure, [fc.LargeRotation()]), until=1.0)


@pytest.mark.parametrize("until", [0.0, -1.0, float("nan"), float("inf")])
def test_an_end_that_is_none_is_refused(until):
    with pytest.raises(StructureError, match="until"):
        fc.simulate(chain(2), until=until)
