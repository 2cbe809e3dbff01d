"""Dry contacts of one freedom bear together what each bears alone; what they can just bear they do (D5)."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import linprog

import flexctrl as fc
from flexctrl.model.laws import switches
from flexctrl.model.laws.sharing import evened, led, spare, tied

METHODS = {"adaptive": fc.AdaptiveAlpha(), "fixed": fc.GeneralizedAlpha(2e-3), "explicit": fc.ExplicitRungeKutta()}
INERTIA, RATIO = 2.0 + 10.0**2 * 1e-3, 10.0
STATIC, SLIDING = 4.0 + RATIO * 0.3, 3.0 + RATIO * 0.2


def geared() -> fc.Model:
    """A motor behind a rigid shaft and the hinge that it turns, both dry."""
    arm = fc.RigidBody("arm", (0, 0, 0), 1.0, (2.0, 2.0, 2.0))
    base = fc.RigidBody("base", (0, 0, 0), 1.0, (1.0, 1.0, 1.0))
    drive = fc.RotaryDrive("motor", arm.nodes[0], base.nodes[0], axis="z", stiffness=50.0, ratio=RATIO, inertia=1e-3)
    structure = fc.Structure(
        [arm, base],
        [fc.Support(base.nodes[0]), fc.Hinge(base.nodes[0], arm.nodes[0], axis="z")],
        [drive],
        [fc.MotorTorque("torque", drive)],
        [fc.DriveAngle("angle", drive)],
    )
    rubs = {"motor": fc.Coulomb(0.2, 0.3), "arm.rz": fc.Coulomb(3.0, 4.0)}
    return fc.assemble(structure, [fc.LargeRotation(), fc.CoulombFriction(rubs)])


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("torque", [0.0, -0.1, 0.45, 0.6, 0.69, STATIC / RATIO])
def test_they_hold_up_to_the_sum_of_what_they_bear(torque, method):
    run = fc.simulate(geared(), until=0.1, inputs={"torque": torque}, method=METHODS[method])
    assert run.status is fc.Status.FINISHED
    assert np.abs(run["angle"]).max() < 1e-15
    assert not run.events


@pytest.mark.parametrize("method", METHODS)
def test_beyond_it_they_break_loose_together(method):
    run = fc.simulate(geared(), until=1.0, inputs={"torque": -0.71}, method=METHODS[method])
    slid = -RATIO * 0.5 * (7.1 - SLIDING) / INERTIA
    assert run["angle"][-1] == pytest.approx(slid, rel=1e-9)


class Swinging:
    """0.9 sin 3 t."""

    inputs, outputs, sample_time = ("angle",), ("torque",), 0.01

    def initial(self) -> np.ndarray:
        return np.zeros(0)

    def command(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.array([0.9 * np.sin(3.0 * t)])


def swung(until: float) -> tuple[float, list[float]]:
    """The angle of the motor at the end and when it slides and sticks, from sample to sample in closed form."""
    x = v = side = 0.0
    told = []
    for k in range(round(until / 0.01)):
        load, t, left = RATIO * 0.9 * np.sin(3.0 * k * 0.01), k * 0.01, 0.01
        if side == 0.0 and abs(load) > STATIC:
            side = np.sign(load)
            told.append(t)
        if side == 0.0:
            continue
        a = (load - SLIDING * side) / INERTIA
        stop = -v / a if v * a < 0.0 else np.inf
        span = min(stop, left)
        x, v = x + v * span + 0.5 * a * span**2, v + a * span
        if stop <= left:
            v = side = 0.0
            told.append(t + stop)
    return RATIO * x, told


@pytest.mark.parametrize("method", METHODS)
def test_they_stop_and_break_loose_as_one(method):
    run = fc.simulate(geared(), Swinging(), until=3.0, method=METHODS[method])
    angle, told = swung(3.0)
    assert run["angle"][-1] == pytest.approx(angle, rel=1e-9)
    for name in ("motor", "arm.rz"):
        own = [e for e in run.events if e.name == name]
        assert [e.t for e in own] == pytest.approx(told, abs=1e-8)
        assert [e.rising for e in own] == [True, False, True, False, True]


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("most", [3.0, 0.1])
def test_what_it_can_just_bear_a_contact_bears(most, method):
    """And a billionth more it does not."""
    block = fc.PointMass("block", (0, 0, 0), 1.0)
    structure = fc.Structure(
        [block],
        [fc.Support(block.node, "v w")],
        inputs=[fc.Force("pull", block.node, "x")],
        outputs=[fc.Position("x", block.node, "x")],
    )
    model = fc.assemble(structure, [fc.LargeRotation(), fc.CoulombFriction({"block.u": fc.Coulomb(0.5 * most, most)})])
    for share, loose in ((1.0 - 1e-10, False), (1.0, False), (1.0 + 1e-9, True)):
        run = fc.simulate(model, until=1.0, inputs={"pull": most * share}, method=METHODS[method])
        assert run["x"][-1] == pytest.approx(0.25 * most if loose else 0.0, rel=1e-6, abs=1e-15)


@pytest.mark.parametrize("seed", range(8))
def test_shares_are_those_of_the_theorems_of_plasticity(seed):
    """Five contacts of two freedoms: the least of the largest shares is the most that a mechanism needs."""
    rng = np.random.default_rng(seed)
    W = rng.normal(size=(5, 2)) * 10.0 ** rng.uniform(-6.0, 6.0, size=(5, 1))
    most = 10.0 ** rng.uniform(-1.0, 1.0, size=5) / np.abs(W).max(axis=1)
    anyhow = rng.normal(size=5) * most
    borne, load = evened(W, anyhow, most), W.T @ anyhow
    assert W.T @ borne == pytest.approx(load, rel=1e-12, abs=1e-12 * np.abs(load).max())
    mechanisms = np.array([(-w[1], w[0]) for w in W])  # one contact each does not slip
    needed = max(abs(load @ v) / (most @ np.abs(W @ v)) for v in mechanisms)
    assert np.abs(borne / most).max() == pytest.approx(needed, rel=1e-10)


@pytest.mark.parametrize("seed", range(8))
def test_no_other_shares_are_less(seed):
    """Up to fifteen contacts of up to five freedoms, some alike: what a linear program finds is no less."""
    rng = np.random.default_rng(seed)
    W = np.repeat(rng.normal(size=(5, rng.integers(1, 6))), rng.integers(1, 4), axis=0)
    anyhow, most = rng.normal(size=len(W)), rng.uniform(0.5, 2.0, len(W))
    borne, load, one = evened(W, anyhow, most), W.T @ anyhow, np.ones((2 * len(W), 1))
    both = np.hstack([np.vstack([np.eye(len(W)), -np.eye(len(W))]), -one])
    goal, equal = np.append(np.zeros(len(W)), 1.0), np.hstack([W.T * most, np.zeros((W.shape[1], 1))])
    least = linprog(goal, both, np.zeros(len(one)), equal, load, (None, None))
    assert W.T @ borne == pytest.approx(load, abs=1e-12)
    assert np.abs(borne / most).max() == pytest.approx(least.fun, rel=1e-9)


def test_what_shares_with_what():
    """Two of one freedom, one by itself, and three of two freedoms."""
    W = np.zeros((6, 4))
    W[0, 0], W[1, 0], W[2, 1] = 10.0, 1.0, 3.0
    W[3:, 2:] = [[1.0, 0.0], [0.0, 1.0], [1.0, 1.0]]
    label = tied(W)
    assert label[0] == label[1] != label[2]
    assert len(set(label[3:])) == 1
    assert len(set(label)) == 3
    alone, most = np.array([0.0, 0.7, 5.0, 0.0, 0.0, 1.0]), np.array([0.1, 1.0, 2.0, 1.0, 1.0, 1.0])
    borne = evened(W, alone, most)
    assert borne == pytest.approx([0.035, 0.35, 5.0, 0.5, 0.5, 0.5], rel=1e-12)
    assert spare(W, most).tolist() == [False, True, False, False, True, False]
    assert led(W[[0, 3]], W).tolist() == [True, True, False, True, False, False]


class Pulling:
    """Pulls two blocks to and fro, sampled."""

    inputs, outputs, sample_time = (), ("f1", "f2"), 0.02

    def initial(self) -> np.ndarray:
        return np.zeros(0)

    def command(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.array([1.5 + 8.0 * np.sin(3.0 * t), 5.0 * np.cos(2.1 * t + 0.3)])


def stacked() -> fc.Model:
    """Two blocks on each other and between walls, all dry, the lower one at a stiff spring: it slips by microns."""
    base, low, top = (fc.RigidBody(name, (0, 0, 0), m, (1, 1, 1)) for name, m in (("base", 1), ("b1", 2), ("b2", 0.7)))
    spring = fc.Spring("s", (-1, 0, 0), (0, 0, 0), stiffness=1e5)
    joints = [
        fc.Support(base.node),
        fc.Support(spring.start),
        fc.Slide(base.node, low.node, along="x"),
        fc.Slide(low.node, top.node, along="x"),
        fc.Pin(low.node, spring.end),
    ]
    forces = [fc.Force("f1", low.node, "x"), fc.Force("f2", top.node, "x")]
    structure = fc.Structure([base, low, top, spring], joints, [], forces, [fc.Position("x1", low.node, "x")])
    rubs = {"b1.u": 4.1, "b2": 0.6, "b2.u": 6.7}
    return fc.assemble(structure, [fc.LargeRotation(), fc.CoulombFriction(rubs)])


def test_what_is_borne_is_worked_out_a_few_times_a_step(monkeypatch):
    """In the middle of a step and at its ends; what is overcome from the start of a step on is not looked for in it."""
    worked, solve = [], switches.factorise
    monkeypatch.setattr(switches, "factorise", lambda M: worked.append(1) or solve(M))
    run = fc.simulate(stacked(), Pulling(), until=1.0, method=fc.Unchecked(fc.AdaptiveAlpha()))
    assert len(run.events) > 10
    assert len(worked) < 3 * run.report.steps
