"""One closed loop has one set of poles, wherever it is cut: machines and laws at random, against python-control."""

from __future__ import annotations

from dataclasses import dataclass

import control as ct
import numpy as np
import pytest
import scipy.sparse as sp
from scenes import EXAMPLES
from scipy.optimize import linear_sum_assignment

from flexctrl.design import Delayed, FilteredRate, Sampled, Together, pd, pi, pid
from flexctrl.linear.model import LinearModel
from flexctrl.scene import load_scene
from flexctrl.study.broken_loop import broken_loop, linear_law
from flexctrl.study.frequency import margins
from flexctrl.study.loop import open_loop
from flexctrl.study.root_locus import root_locus

OMEGA = np.geomspace(0.03, 300.0, 40)
SAMPLE_TIME = 0.01


@dataclass(frozen=True)
class Machine:
    """A machine, its law for flexctrl, and the same law built by python-control alone."""

    plant: LinearModel
    law: object
    closed_plant: ct.StateSpace
    closed_law: ct.StateSpace


def random_plant(rng: np.random.Generator, commands: int) -> LinearModel:
    """Masses on springs, of very different stiffness, free to travel as a whole; collocated drives."""
    n = commands + 2
    scale = np.diag(10.0 ** rng.uniform(-1.0, 1.5, n))
    springs = np.diff(np.eye(n), axis=0).T * 10.0 ** rng.uniform(0.0, 1.5, n - 1)
    K, M = springs @ springs.T, scale @ scale
    rows = np.eye(n)[rng.permutation(n)[:commands]]
    return LinearModel(
        M=sp.csc_matrix(M),
        C=sp.csc_matrix(0.2 * np.sqrt(np.diag(M)) * np.eye(n) + 0.003 * K),
        K=sp.csc_matrix(K),
        B=rows.T,
        Cq=np.vstack([rows, 0 * rows]),
        Cv=np.vstack([0 * rows, rows]),
        D=np.zeros((2 * commands, commands)),
        coordinates=tuple(f"q{i}" for i in range(n)),
        inputs=tuple(f"u{i}" for i in range(commands)),
        outputs=tuple(f"y{i}" for i in range(commands)) + tuple(f"v{i}" for i in range(commands)),
        name="random",
    )


def random_law(rng: np.random.Generator, i: int, commands: int) -> ct.StateSpace:
    """A law for command i: any of PD, PI, PID, a filtered derivative, or a compensator that reads every channel."""
    kp, ki, kd = 10.0 ** rng.uniform([-0.5, -1.5, -0.5], [1.0, 0.5, 1.0])
    y, v, u = f"y{i}", f"v{i}", f"u{i}"
    names = [f"y{k}" for k in range(commands)]
    return [
        lambda: pd(kp, kd, measured=y, rate=v, command=u),
        lambda: pi(kp, 0.1 * ki, measured=y, command=u),
        lambda: pid(kp, ki, kd, measured=y, rate=v, command=u),
        lambda: pid(kp, ki, kd, measured=y, rate=FilteredRate(0.05), command=u),
        lambda: ct.ss(
            -np.diag(10.0 ** rng.uniform(-1, 2, 3)) + np.triu(rng.normal(size=(3, 3)), 1),
            rng.normal(size=(3, commands)),
            -rng.normal(size=(1, 3)),
            -rng.normal(size=(1, commands)),
            inputs=names,
            outputs=[u],
        ),
    ][rng.integers(5)]()


def joined(laws: list[ct.StateSpace], plant: LinearModel) -> ct.StateSpace:
    """The laws as one system from every output of the plant to every input of it."""
    reads = [[plant.outputs.index(name) for name in law.input_labels] for law in laws]
    picks = [np.eye(len(plant.outputs))[places] for places in reads]
    return ct.append(*laws) * ct.ss([], [], [], np.vstack(picks), laws[0].dt)


def machine(seed: int, delay: int | None) -> Machine:
    """Continuous without a delay; else sampled, with so many samples of delay."""
    rng = np.random.default_rng(seed)
    commands = int(rng.integers(2, 4))
    plant = random_plant(rng, commands)
    laws = [random_law(rng, i, commands) for i in range(commands)]
    if delay is None:
        return Machine(plant, Together(*laws), plant.to_ss(), joined(laws, plant))
    sampled = Delayed(Together(*(Sampled(law, SAMPLE_TIME) for law in laws)), delay)
    held = [law if law.nstates == 0 else ct.sample_system(law, SAMPLE_TIME) for law in laws]
    held = [ct.ss(law.A, law.B, law.C, law.D, SAMPLE_TIME, inputs=law.input_labels) for law in held]
    one = ct.ss([[0.0]], [[1.0]], [[1.0]], [[0.0]], SAMPLE_TIME)
    late = joined(held, plant)
    for _ in range(delay):
        late = ct.append(*[one] * commands) * late
    return Machine(plant, sampled, ct.sample_system(plant.to_ss(), SAMPLE_TIME), late)


def apart(one: np.ndarray, other: np.ndarray) -> float:
    """The largest distance of poles paired one to one, in units of the largest."""
    assert len(one) == len(other)
    distance = abs(one[:, None] - other)
    return float(distance[linear_sum_assignment(distance)].max() / abs(other).max())


def cut_by_hand(made: Machine, place: int) -> np.ndarray:
    """−(what comes back)/(what goes in) with the other channels closed by python-control, at OMEGA."""
    D, others = np.eye(len(made.plant.inputs)), np.arange(len(made.plant.inputs)) != place
    law, dt = made.closed_law, made.closed_law.dt
    inner = ct.feedback(made.closed_plant, ct.ss([], [], [], D * others, dt) * law, sign=1)
    whole = -(ct.ss([], [], [], D[[place]], dt) * law * inner * ct.ss([], [], [], D[:, [place]], dt))
    return np.asarray(whole(np.exp(1j * OMEGA * dt) if dt else 1j * OMEGA))


CASES = [(seed, delay) for seed in range(12) for delay in (None, 0, 2)]


@pytest.mark.parametrize(("seed", "delay"), CASES)
def test_the_poles_are_the_same_wherever_the_loop_is_cut(seed, delay):
    made = machine(seed, delay)
    expected = ct.feedback(made.closed_plant, made.closed_law, sign=1).poles()
    for name in made.plant.inputs:
        loop = broken_loop(made.plant, made.law, name)
        assert apart(loop.closed_poles(), expected) < 1e-8
        assert apart(root_locus(loop, [0.5, 1.0]).loci[-1], expected) < 1e-8


@pytest.mark.parametrize(("seed", "delay"), CASES)
def test_the_cut_loop_is_what_comes_back_through_the_other_channels(seed, delay):
    made = machine(seed, delay)
    for place, name in enumerate(made.plant.inputs):
        np.testing.assert_allclose(broken_loop(made.plant, made.law, name).at(OMEGA), cut_by_hand(made, place), 1e-7)


@pytest.mark.parametrize(("seed", "delay"), CASES)
def test_the_verdict_on_the_closed_loop_is_the_same_wherever_it_is_cut(seed, delay):
    made = machine(seed, delay)
    poles = ct.feedback(made.closed_plant, made.closed_law, sign=1).poles()
    stable = bool((abs(poles) < 1).all() if delay is not None else (poles.real < 0).all())
    found = {margins(broken_loop(made.plant, made.law, name)).stable for name in made.plant.inputs}
    assert found == {stable}


@pytest.mark.parametrize("sample_time", [0.0, 0.002])
def test_an_arm_whose_joints_have_integrators_is_stable_at_both_of_them(tmp_path, sample_time):
    text = (EXAMPLES / "flexible_arm.toml").read_text(encoding="utf-8")
    text = text.replace("kp = 2.0", "kp = 2.0\nki = 1.5")
    text = text if sample_time else text.replace("sample_time = 0.002", "")
    (tmp_path / "arm.toml").write_text(text, encoding="utf-8")
    scene = load_scene(tmp_path / "arm.toml")
    plant, law = scene.linear, linear_law(scene.law)
    states = plant.select(law.outputs, law.inputs).to_ss()
    states = ct.sample_system(states, sample_time) if sample_time else states
    expected = ct.feedback(states, ct.ss(law.A, law.B, law.C, law.D, sample_time), sign=1).poles()
    loops = [broken_loop(plant, law, name) for name in law.outputs]
    assert [apart(loop.closed_poles(), expected) < 1e-8 for loop in loops] == [True, True]
    assert [margins(loop).stable for loop in loops] == [True, True]


@pytest.mark.parametrize("seed", range(20))
def test_a_plant_in_blocks_keeps_its_response_in_a_loop(seed):
    """Poles that stand alone (integrators, lags in a row) are moved to the ends before the states are scaled."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(3, 9))
    order, size = rng.permutation(n), 10.0 ** rng.uniform(-4.0, 4.0, n)
    full = np.triu(rng.normal(size=(n, n)) * (rng.random((n, n)) < 0.6), 1) - np.diag(rng.uniform(0.0, 3.0, n))
    full[n // 2 : n // 2 + 2, n // 2 : n // 2 + 2] = [[-0.5, 2.0], [-3.0, -0.5]]
    A = (full * size[:, None] / size)[np.ix_(order, order)]
    b, c = rng.normal(size=(2, n))
    B, C = (b * size)[order, None], (c / size)[None, order]
    loop = open_loop(ct.ss(A, B, C, [[0.0]]))
    expected = [(C @ np.linalg.solve(1j * w * np.eye(n) - A, B))[0, 0] for w in OMEGA]
    np.testing.assert_allclose(loop.at(OMEGA), expected, rtol=1e-9, atol=1e-12 * abs(np.array(expected)).max())
    assert apart(loop.closed_poles(0.7), np.linalg.eigvals(A - 0.7 * B @ C)) < 1e-9
    still = np.linalg.eigvals(full - np.outer(b, c @ full) / (c @ b))  # the output held at 0, and c x itself
    expected = np.delete(still, np.argmin(abs(still)))
    assert apart(loop.zeros, expected) < 1e-7
