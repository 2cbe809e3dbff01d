"""Parts far too stiff for the step are not thrown where a force jumps onto them: against Radau's method."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import flexctrl as fc
from flexctrl.design import Step

STIFF, FORCE, DRAG = 1e8, 100.0, 20.0
BENT = FORCE / STIFF
METHODS = {"coarse": fc.GeneralizedAlpha(1e-2), "fine": fc.GeneralizedAlpha(1e-3), "chosen": fc.AdaptiveAlpha()}
BACKENDS = {"compiled": None, "plain": fc.CasadiVM()}


@dataclass(frozen=True)
class Switched:
    """A force that is there from the sample at 50 ms on."""

    sample_time: float = 0.01
    inputs: tuple[str, ...] = ()
    outputs: tuple[str, ...] = ("push",)

    def initial(self) -> np.ndarray:
        return np.zeros(0)

    def command(self, t: float, x: np.ndarray, y: np.ndarray) -> list[float]:
        return [FORCE if t > 0.049 else 0.0]

    def update(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return x


def pushed(light: float, stiff: float, backend: str = "compiled") -> fc.Model:
    """A light part on a stiff spring to the ground, and a block of 1 kg behind a damper."""
    spring = fc.Spring("spring", (-1, 0, 0), (0, 0, 0), stiffness=stiff)
    damper = fc.Spring("damper", (0, 0, 0), (1, 0, 0), stiffness=0.0, damping=DRAG)
    part, block = fc.PointMass("part", (0, 0, 0), light), fc.PointMass("block", (1, 0, 0), 1.0)
    joints = [fc.Support(spring.start), fc.Pin(spring.end, part.node), fc.Pin(damper.start, part.node)]
    joints += [fc.Pin(damper.end, block.node), fc.Support(part.node, "v w"), fc.Support(block.node, "v w")]
    outputs = [fc.Position(one.name, one.node, "x") for one in (part, block)]
    structure = fc.Structure(
        [spring, damper, part, block], joints, inputs=[fc.Force("push", part.node, "x")], outputs=outputs
    )
    return fc.assemble(structure, [fc.LargeRotation()], BACKENDS[backend])


@cache
def radau(light: float, stiff: float, t: float) -> tuple[float, float]:
    """Where part and block are so long after the force has jumped."""

    def rates(_: float, y: np.ndarray) -> list[float]:
        drag = DRAG * (y[3] - y[2])
        return [y[2], y[3], (FORCE - stiff * y[0] + drag) / light, -drag]

    found = solve_ivp(rates, (0.0, t), np.zeros(4), "Radau", rtol=1e-8, atol=1e-12)
    return float(found.y[0, -1]), float(found.y[1, -1])


@pytest.mark.parametrize("law", [Switched(), fc.OpenLoop({"push": Step(FORCE, at=0.05)}), None])
@pytest.mark.parametrize("method", METHODS)
def test_a_force_that_is_switched_on_moves_what_it_bends(law, method):
    """At a sample, at a break, and as a run begins; all that moves does so by the static deflection, 1 µm."""
    inputs, until = ({}, 0.1) if law else ({"push": FORCE}, 0.05)
    run = fc.simulate(pushed(1e-3, STIFF), law, until=until, inputs=inputs, method=METHODS[method])
    part, block = radau(1e-3, STIFF, 0.05)
    assert run.status is fc.Status.FINISHED
    assert run["part"][-1] == pytest.approx(part, abs=0.01 * BENT)
    assert run["block"][-1] - 1.0 == pytest.approx(block, abs=0.7 * BENT)
    assert np.abs(run["block"] - 1.0).max() < 1.5 * BENT


def stopped(light: float, backend: str = "compiled", stiff: float = STIFF) -> tuple[fc.Model, fc.State]:
    """A block of 1 kg flies at 1 m/s at a stop with damping on a light part that a stiff spring holds."""
    spring = fc.Spring("spring", (1, 0, 0), (2, 0, 0), stiffness=stiff)
    stop = fc.Spring("stop", (0, 0, 0), (1, 0, 0), stiffness=1e4, damping=30.0)
    part, block = fc.PointMass("part", (1, 0, 0), light), fc.PointMass("block", (0, 0, 0), 1.0)
    joints = [fc.Support(spring.end), fc.Pin(spring.start, part.node), fc.Pin(stop.end, part.node)]
    joints += [fc.Pin(stop.start, block.node), fc.Support(part.node, "v w"), fc.Support(block.node, "v w")]
    outputs = [fc.Velocity("speed", block.node, "x")]
    structure = fc.Structure([spring, stop, part, block], joints, outputs=outputs)
    model = fc.assemble(structure, [fc.LargeRotation(), fc.Backlash({"stop": 0.02})], BACKENDS[backend])
    return model, model.rest.with_(v=np.array([0.0, 1.0]))


@cache
def returned(light: float) -> float:
    """The speed with which it leaves the stop, which does not hold it."""

    def pull(y: np.ndarray) -> float:
        return float(1e4 * (y[1] - y[0]) + 30.0 * (y[3] - y[2]))

    def rates(_: float, y: np.ndarray) -> list[float]:
        return [y[2], y[3], (pull(y) - STIFF * y[0]) / light, -pull(y)]

    def leaves(t: float, y: np.ndarray) -> float:
        return pull(y) if t > 1e-3 else 1.0

    leaves.terminal = True  # type: ignore[attr-defined]
    found = solve_ivp(rates, (0.0, 0.1), [0.0, 0.0, 0.0, 1.0], "Radau", rtol=1e-8, atol=1e-12, events=leaves)
    return float(found.y[3, -1])


@pytest.mark.parametrize("method", ["fine", "chosen"])
@pytest.mark.parametrize("backend", BACKENDS)
def test_a_damped_stop_gives_back_what_it_does(method, backend):
    model, start = stopped(1e-4, backend)
    run = fc.simulate(model, until=0.06, start=start, method=METHODS[method])
    assert run.status is fc.Status.FINISHED
    assert run["speed"][-1] == pytest.approx(returned(1e-4), rel=5e-3)


@dataclass(frozen=True)
class Idle:
    """Nothing, from sample to sample."""

    sample_time: float = 0.01
    inputs: tuple[str, ...] = ()
    outputs: tuple[str, ...] = ()

    def initial(self) -> np.ndarray:
        return np.zeros(0)

    def command(self, t: float, x: np.ndarray, y: np.ndarray) -> list[float]:
        return []

    def update(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return x


SHIFTS = [-1e-6, -1e-10, 0.0, 1e-11, 2e-8, 1e-7, 1e-6, 3e-6, 1e-5, 1e-4, 3e-4, 5e-4, 7e-4, 9e-4]
"""How much earlier than after ten steps of 1 ms the stop is met [s]: anywhere in a step."""


def met(model: fc.Model, start: fc.State, shift: float, law: fc.OpenLoop | Idle | None = None, **how) -> fc.Run:
    start = model.advance(start, np.array([0.0, shift]), start.v, 0.0)
    return fc.simulate(model, law, start=start, **{"until": 0.06, "method": METHODS["fine"], **how})


@pytest.mark.parametrize("sample_time", [0.01, 0.001])
@pytest.mark.parametrize("backend", BACKENDS)
def test_a_stop_may_be_met_anywhere_in_a_step(backend, sample_time):
    """Just before a sample, too, where a tiny step is left to that, and full ones follow."""
    model, start = stopped(1e-4, backend)
    for shift in SHIFTS:
        run = met(model, start, shift, Idle(sample_time))
        assert run.status is fc.Status.FINISHED, shift
        assert run["speed"][-1] == pytest.approx(returned(1e-4), rel=5e-3), shift


def test_extrapolated_runs_too():
    model, start = stopped(1e-4)
    for shift in (1e-9, 1e-6, 1e-5):
        run = met(model, start, shift, Idle(), method=fc.Richardson(METHODS["fine"]))
        assert run.status is fc.Status.FINISHED
        assert run["speed"][-1] == pytest.approx(returned(1e-4), rel=2e-3)


def test_a_stop_met_just_before_a_sample_is_the_same_uncompiled():
    for shift in (1e-7, 1e-6, 1e-5):
        ours, plain = (met(*stopped(1e-4, backend), shift, Idle()) for backend in BACKENDS)
        assert ours.t == pytest.approx(plain.t, rel=1e-9)
        assert ours.y == pytest.approx(plain.y, abs=1e-8)


@pytest.mark.parametrize("backend", BACKENDS)
def test_runs_go_on_from_a_tiny_step(backend):
    """Bit for bit, from its ends and from the next one; states on the way are those of the run."""
    model, start = stopped(1e-4, backend)
    whole = met(model, start, 1e-7, Idle())
    tiny = int(np.argmin(np.diff(whole.t)))
    for until in whole.t[tiny : tiny + 3].tolist():
        half = met(model, start, 1e-7, Idle(), until=until)
        rest = fc.simulate(model, Idle(), until=0.06, start=half.checkpoint, method=METHODS["fine"])
        assert np.array_equal(rest.final.v, whole.final.v)
    for k in range(tiny, len(whole.t), 7):
        assert whole.at(whole.t[k])["speed"] == pytest.approx(whole["speed"][k], abs=1e-12)


@pytest.mark.parametrize("method", METHODS)
def test_uncompiled_as_compiled(method):
    runs = [
        fc.simulate(pushed(1e-3, STIFF, backend), Switched(), until=0.1, method=METHODS[method]) for backend in BACKENDS
    ]
    assert runs[0].t == pytest.approx(runs[1].t, rel=1e-9)
    assert runs[0].y == pytest.approx(runs[1].y, abs=1e-6 * BENT)


def carried(backend: str = "compiled") -> fc.Model:
    """A light part before a block of 1 kg that swings on a soft spring: a force pushes the part."""
    soft = fc.Spring("soft", (1, 0, 0), (2, 0, 0), stiffness=1e3)
    stiff = fc.Spring("stiff", (0, 0, 0), (1, 0, 0), stiffness=STIFF, damping=10.0)
    part, block = fc.PointMass("part", (0, 0, 0), 1e-3), fc.PointMass("block", (1, 0, 0), 1.0)
    joints = [fc.Support(soft.end), fc.Pin(soft.start, block.node), fc.Pin(stiff.end, block.node)]
    joints += [fc.Pin(stiff.start, part.node), fc.Support(part.node, "v w"), fc.Support(block.node, "v w")]
    push, outputs = [fc.Force("push", part.node, "x")], [fc.Position("block", block.node, "x")]
    structure = fc.Structure([soft, stiff, part, block], joints, inputs=push, outputs=outputs)
    return fc.assemble(structure, [fc.LargeRotation()], BACKENDS[backend])


def test_what_steps_resolve_keeps_its_order():
    """F/k (1 − cos ωt) from the sample on, with a thousandth of the mass before it; half the step, a quarter."""
    omega, t = np.sqrt(1e3 / 1.001), 0.45
    wanted = 1.0 + FORCE / 1e3 * (1.0 - np.cos(omega * t))
    steps = [1e-2, 5e-3, 2.5e-3, 1.25e-3]
    runs = [fc.simulate(carried(), Switched(), until=0.5, method=fc.GeneralizedAlpha(h)) for h in steps]
    errors = [abs(run["block"][-1] - wanted) for run in runs]
    assert errors[0] < 0.02
    assert all(3.4 < one / other < 4.6 for one, other in pairwise(errors))


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("method", ["fine", "chosen"])
def test_nothing_changes_where_nothing_is_thrown(method, backend, monkeypatch):
    """To the bit: a spring of 10⁴ N/m, 100 rad/s with 1 kg; a rope that catches a load; a stop just before a sample."""

    def curves() -> list[np.ndarray]:
        rope = fc.Rope("rope", (0, 0, 1), (0, 0, 0.1), EA=1e4, length=1.0)
        load = fc.PointMass("load", rope.end, 1.0)
        joints = [fc.Support(rope.start, "u v w"), fc.Pin(rope.end, load.node), fc.Support(load.node, "u v")]
        structure = fc.Structure([rope, load], joints, outputs=[fc.Position("z", load.node, "z")])
        caught = fc.assemble(structure, [fc.Gravity(), fc.LargeRotation(), fc.RopeStretch()], BACKENDS[backend])
        how = METHODS[method]
        return [
            fc.simulate(pushed(1.0, 1e4, backend), Switched(), until=0.1, method=how).y,
            fc.simulate(caught, until=0.5, method=how).y,
            met(*stopped(1.0, backend, 1e4), 1e-7, Idle(), method=how).y,
        ]

    ours = curves()
    monkeypatch.setattr("flexctrl.dynamics.alpha.steps.may_throw", lambda model: False)
    monkeypatch.setattr("flexctrl.dynamics.march.making.may_throw", lambda model: False)
    assert all(np.array_equal(one, other) for one, other in zip(ours, curves(), strict=True))
