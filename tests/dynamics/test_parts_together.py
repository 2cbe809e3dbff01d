"""Machines and copies of them, uncoupled: all parts that switch at one instant are told of, each once."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.dynamics.events.roots import nearly

STEPS = {
    "chosen": (fc.AdaptiveAlpha(), 2e-4),
    "even": (fc.GeneralizedAlpha(1e-3), 1e-9),
    "midpoint": (fc.ConservingMidpoint(1e-3), 1e-9),
    "explicit": (fc.ExplicitRungeKutta(), 1e-6),
    "extrapolated": (fc.Richardson(fc.GeneralizedAlpha(1e-3)), 1e-9),
}
"""Methods, and how far apart instants may be: where steps are chosen, they are others with another number of copies."""
BACKENDS = {"compiled": None, "plain": fc.CasadiVM()}


class Sampled:
    """Pushes what no part hangs on."""

    inputs, outputs, sample_time = ("z0",), ("push",), 1e-3

    def initial(self):
        return np.zeros(0)

    def command(self, t, x, y):
        return np.array([0.3 * np.sin(40.0 * t)])


class Continuous(Sampled):
    """The same, all the time."""

    sample_time = 0.0

    def derivative(self, t, x, y):
        return np.zeros(0)


LAWS = {"none": None, "sampled": Sampled(), "continuous": Continuous()}


def roped(count: int, apart: float, backend: str) -> tuple[fc.Model, np.ndarray, float]:
    """Masses that fall into ropes and are thrown back."""
    ropes = [fc.Rope(f"p{i}", (i, 0, 0), (i, 0, -1), EA=1e4, length=1.01 + apart * 0.44 * i) for i in range(count)]
    masses = [fc.PointMass(f"m{i}", rope.end, 1.0) for i, rope in enumerate(ropes)]
    joints = [fc.Pin(rope.end, mass.node) for rope, mass in zip(ropes, masses, strict=True)]
    joints += [fc.Support(rope.start, "u v w") for rope in ropes]
    model = built([*ropes, *masses], masses, joints, "z", [fc.Gravity(), fc.Flexible()], backend)
    return model, np.zeros(model.n), 0.1


def played(count: int, apart: float, backend: str) -> tuple[fc.Model, np.ndarray, float]:
    """Masses on springs with play."""
    springs = [fc.Spring(f"p{i}", (0, i, 0), (1, i, 0), stiffness=1e3) for i in range(count)]
    masses = [fc.PointMass(f"m{i}", spring.end, 1.0) for i, spring in enumerate(springs)]
    joints = [fc.Pin(spring.end, mass.node) for spring, mass in zip(springs, masses, strict=True)]
    joints += [fc.Support(spring.start) for spring in springs]
    play = fc.Backlash({f"p{i}": 0.1 + 2.0 * apart * i for i in range(count)})
    model = built([*springs, *masses], masses, joints, "x", [play], backend)
    return model, np.repeat([1.0, 0.0], [count, model.n - count]), 0.3


def rubbed(count: int, apart: float, backend: str) -> tuple[fc.Model, np.ndarray, float]:
    """Blocks that come to a stand by friction."""
    blocks = [fc.PointMass(f"m{i}", (i, 0, 0), 2.0) for i in range(count)]
    friction = fc.CoulombFriction({f"m{i}.u": 2.0 for i in range(count)})
    model = built(blocks, blocks, [], "x", [friction], backend)
    return model, np.append(0.1 + apart * np.arange(count), np.zeros(model.n - count)), 0.2


def built(parts, masses, joints, axis, effects, backend) -> fc.Model:
    """Copies on rails along an axis, and a mass beside them that is pushed."""
    aside = fc.PointMass("aside", (-5, 0, 0), 1.0)
    held = "u v" if axis == "z" else "v w"
    joints = [*joints, *(fc.Support(mass.node, held) for mass in (*masses, aside))]
    outputs = [fc.Position(f"z{i}", mass.node, axis) for i, mass in enumerate(masses)]
    push = fc.Force("push", aside.node, axis)
    structure = fc.Structure([*parts, aside], joints, inputs=[push], outputs=outputs)
    return fc.assemble(structure, [fc.LargeRotation(), *effects], BACKENDS[backend])


def ran(make, count, method, law="none", apart=0.0, backend="compiled") -> list[tuple[str, float, bool]]:
    """Return what a run of copies tells, whose events are in order."""
    model, v, until = make(count, apart, backend)
    start = model.rest.with_(v=v)
    run = fc.simulate(model, LAWS[law], until=until, method=fc.Unchecked(STEPS[method][0]), start=start)
    assert all(one.t <= other.t for one, other in pairwise(run.events))
    return [(e.name.removesuffix(".u")[1:], e.t, e.rising) for e in run.events]


def agree(make, count, method, **kinds) -> None:
    """Hold that each of so many copies tells what one alone does, at the same instants."""
    alone, all_told = ran(make, 1, method, **{**kinds, "apart": 0.0}), ran(make, count, method, **kinds)
    assert alone
    for i in range(count):
        told = [event for event in all_told if event[0] == str(i)]
        assert [rising for *_, rising in told] == [rising for *_, rising in alone]
        near = STEPS[method][1] + 20.0 * kinds.get("apart", 0.0) * count
        assert [t for _, t, _ in told] == pytest.approx([t for _, t, _ in alone], abs=near)


CASES = [(roped, m) for m in STEPS] + [(played, m) for m in STEPS] + [(rubbed, m) for m in STEPS if m != "midpoint"]


@pytest.mark.parametrize(("make", "method"), CASES)
def test_copies_of_a_machine_tell_what_it_tells(make, method):
    for count in (2, 3, 7):
        agree(make, count, method)


@pytest.mark.parametrize("law", ["sampled", "continuous"])
@pytest.mark.parametrize("make", [roped, played, rubbed])
@pytest.mark.parametrize("method", ["chosen", "even"])
def test_so_they_do_under_a_law(make, method, law):
    agree(make, 3, method, law=law)


@pytest.mark.parametrize("make", [roped, played, rubbed])
@pytest.mark.parametrize("method", ["chosen", "even"])
def test_so_they_do_in_plain_steps(make, method):
    agree(make, 3, method, backend="plain")


@pytest.mark.parametrize("apart", [1e-12, 1e-9, 1e-6])
@pytest.mark.parametrize(("make", "method"), CASES)
def test_so_they_do_where_they_switch_within_rounding_of_an_instant(make, method, apart):
    agree(make, 3, method, apart=apart)


@pytest.mark.parametrize("terminal", [False, True])
@pytest.mark.parametrize("method", STEPS)
def test_events_asked_for_are_told_with_parts_that_switch_there(method, terminal):
    model, _, until = roped(3, 0.0, "compiled")
    caught = fc.Event("caught", "z1", -1.01, terminal=terminal)
    run = fc.simulate(model, until=until, method=fc.Unchecked(STEPS[method][0]), events=[caught])
    names, times = [e.name for e in run.events], [e.t for e in run.events]
    assert times == sorted(times)
    assert names.count("caught") == (1 if terminal else 2)
    assert terminal or all(names.count(f"p{i}") == 2 for i in range(3))


def sticking(count: int, apart: float, method: fc.Integrator) -> fc.Run:
    """Blocks that stick one shortly after the other, and what passes a place in the middle of that."""
    blocks = [fc.PointMass(f"b{i}", (i, 0, 0), 1.0) for i in range(count)]
    passing = fc.PointMass("passing", (0, 1, 0), 1.0)
    place = [fc.Position("place", passing.node, "x")]
    supports = [fc.Support(mass.node, "v w") for mass in (*blocks, passing)]
    structure = fc.Structure([*blocks, passing], supports, outputs=place)
    friction = fc.CoulombFriction({f"b{i}.u": 1.0 / (0.05 + apart * i) for i in range(count)})
    model = fc.assemble(structure, [fc.LargeRotation(), friction])
    start = model.rest.with_(v=np.ones(count + 1))
    event = fc.Event("passes", "place", 0.05 + 0.5 * apart * (count - 1))
    return fc.simulate(model, until=0.06, start=start, method=fc.Unchecked(method), events=[event])


@pytest.mark.parametrize("apart", [0.0, 1e-14, 1e-12, 1e-11, 1e-9, 1e-7])
@pytest.mark.parametrize("count", [2, 5, 30])
@pytest.mark.parametrize("method", ["chosen", "even", "explicit"])
def test_many_blocks_stick_at_once_and_what_passes_meanwhile_does_so_once(
    count: int, apart: float, method: str
) -> None:
    run = sticking(count, apart, STEPS[method][0])
    assert run.status is fc.Status.FINISHED
    assert sorted(e.name for e in run.events) == sorted([*(f"b{i}.u" for i in range(count)), "passes"])


@pytest.mark.parametrize("third", [(0.0, -1.0), (1.0, 3.0)])
def test_places_at_one_instant_are_not_taken_for_a_parabola(third: tuple[float, float]) -> None:
    assert nearly([(0.0, -1.0), (1.0, 3.0), third], 0.0) == pytest.approx(0.25)
    assert nearly([(0.5, -1.0), (0.5, 1.0), (1.0, 3.0)], 0.5) == 0.5
