"""Exact steps may be as long as half a period, or longer: events are found in them as motion between rows goes."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg as la

import flexctrl as fc

MASSES, STIFFNESS = (2.0, 0.3), (800.0, 900.0)


def masses(count: int) -> fc.Model:
    """One or two of them, one spring after the other; they move without large rotations."""
    parts, joints, last = [], [], None
    for i in range(count):
        mass = fc.PointMass(f"m{i}", (i + 1.0, 0, 0), MASSES[i])
        spring = fc.Spring(f"s{i}", (i, 0, 0), (i + 1.0, 0, 0), stiffness=STIFFNESS[i], damping=0.2)
        joints += [fc.Pin(spring.end, mass.node), fc.Support(mass.node, "v w")]
        joints.append(fc.Support(spring.start) if last is None else fc.Pin(spring.start, last))
        parts += [mass, spring]
        last = mass.node
    outputs = [fc.Position(f"x{i}", parts[2 * i].node, "x") for i in range(count)]
    return fc.assemble(fc.Structure(parts, joints, inputs=[fc.Force("push", last, "x")], outputs=outputs), [])


def by_hand(count: int, push: float, speed: float, t: np.ndarray) -> np.ndarray:
    """Places by the matrix exponential, the last mass pushed and sent off."""
    M = np.diag(MASSES[:count])
    chain = np.array([[1.0, 0.0], [-1.0, 1.0]])[:count, :count]
    K, C = (chain.T @ np.diag(values[:count]) @ chain for values in (STIFFNESS, (0.2, 0.2)))
    A = np.zeros((2 * count + 1,) * 2)
    A[:count, count:-1] = np.eye(count)
    A[count:-1, :count], A[count:-1, count:-1] = -la.solve(M, K), -la.solve(M, C)
    A[2 * count - 1, -1] = push / MASSES[count - 1]
    start = np.zeros(2 * count + 1)
    start[-2:] = speed, 1.0
    once = la.expm(A * (t[1] - t[0]))
    found = [start]
    for _ in t[1:]:
        found.append(once @ found[-1])
    return np.array(found)[:, :count] + 1.0 + np.arange(count)


def simulated(count: int, push: float, speed: float, step: float, of: object, at: float) -> list[float]:
    model = masses(count)
    v = np.zeros(model.n)
    v[-1] = speed
    event = fc.Event("level", of, at=at)  # type: ignore[arg-type]
    start = model.rest.with_(v=v)
    run = fc.simulate(model, until=3.0, start=start, inputs={"push": push}, events=[event], method=fc.Exact(step))
    return [e.t for e in run.events]


@pytest.mark.parametrize("seed", range(12))
@pytest.mark.parametrize("count", [1, 2])
def test_all_crossings_are_found(count, seed):
    """Levels that motion crosses clearly, in steps of a tenth to most of a period."""
    rng = np.random.default_rng(seed)
    push, speed = rng.uniform(-20.0, 20.0), rng.uniform(0.5, 2.0)
    step = rng.uniform(0.02, 0.25)
    t = np.linspace(0.0, 3.0, 30_001)
    x = by_hand(count, push, speed, t)[:, -1]
    level = x.min() + rng.uniform(0.1, 0.9) * np.ptp(x)
    crossed = np.flatnonzero(np.diff(np.sign(x - level)) != 0.0)
    turns = t[np.flatnonzero(np.diff(np.sign(np.diff(x)))) + 1]
    apart = np.abs(np.interp(turns, t, x) - level).min()
    found = simulated(count, push, speed, step, f"x{count - 1}", level)
    if apart > 0.05 * np.ptp(x):  # it does not just touch the level, as then it may come back between two places
        assert len(found) == len(crossed)
        np.testing.assert_allclose(found, t[crossed], atol=2e-4)
    assert simulated(count, push, speed, step, lambda y: y[f"x{count - 1}"] - level, 0.0) == pytest.approx(found)


def test_what_vibrates_too_fast_for_steps_counts_by_as_much_as_it_moves():
    """Two masses of which the second one rings by 1.6 cm, in steps of two thirds of its period."""
    model = masses(2)
    fast = fc.linearize(model).modes().omega[-1]
    step = 2.0 * np.pi / fast / 1.5
    t = np.linspace(0.0, 3.0, 30_001)
    x = by_hand(2, 0.0, 1.0, t)[:, 1]
    rows = x[:: round(step / (t[1] - t[0]))]
    level = 0.5 * (rows.max() + x.max())  # between what rows show and what there is
    crossed = np.flatnonzero(np.diff(np.sign(x - level)) != 0.0)
    assert rows.max() < level
    assert crossed.size
    np.testing.assert_allclose(simulated(2, 0.0, 1.0, step, "x1", level), t[crossed], atol=2e-4)


@pytest.mark.parametrize("level", [-0.6, 0.2, 0.9])
@pytest.mark.parametrize("step", [0.45, 0.6, 0.95, 1.3])
def test_those_of_one_direction_are_half_of_them(step, level):
    """A step may go through a level twice, of which one way is asked for: what comes next has its side from the end."""
    mass = fc.PointMass("mass", (0, 0, 0), 1.0)
    spring = fc.Spring("spring", (-5, 0, 0), (0, 0, 0), stiffness=(2.0 * np.pi) ** 2)
    joints = [fc.Support(spring.start), fc.Pin(spring.end, mass.node), fc.Support(mass.node, "v w")]
    model = fc.assemble(fc.Structure([mass, spring], joints, outputs=[fc.Position("x", mass.node, "x")]), [])
    start = model.displace([0]).with_(v=np.array([2.0 * np.pi]))
    k, rises = np.arange(-1, 42), np.arcsin(level) / (2.0 * np.pi)
    for direction, at in ((fc.Direction.RISING, k + rises), (fc.Direction.FALLING, k + 0.5 - rises)):
        event = fc.Event("level", "x", level, direction)
        run = fc.simulate(model, until=40.3, start=start, events=[event], method=fc.Exact(step))
        np.testing.assert_allclose([e.t for e in run.events], at[(at > 1e-9) & (at < 40.3)], atol=1e-9)
