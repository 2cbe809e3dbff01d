"""Exact motion of machines with freedoms that move no mass, from any start: against equations reduced by hand."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
import scipy.linalg as la
import scipy.sparse as sp

import flexctrl as fc
from flexctrl.design import Constant, MinimumJerk, Tracking
from flexctrl.design.controller import LinearController

UNTIL, SAMPLE, ROWS, DEGREE = 0.6, 0.05, 12, 9
PLACE, RATE = np.array([[3.0, 0.7], [-0.5, 2.0]]), np.array([[0.4, 0.1], [0.0, 0.3]])
Force = Callable[[float], np.ndarray]


@dataclass(frozen=True)
class Reduced:
    """M q'' + C q' + K q = f with x = (p, p', r): q = P p + R r + N s, where C does not damp N and M does not weigh
    R and N; x' = A x + G f, q = Q x + S f and q' = V x + W f where f is held."""

    A: np.ndarray
    G: np.ndarray
    Q: np.ndarray
    S: np.ndarray
    V: np.ndarray
    W: np.ndarray
    begin: np.ndarray

    @classmethod
    def of(cls, M: np.ndarray, C: np.ndarray, K: np.ndarray) -> Reduced:
        light = la.null_space(M, rcond=1e-10)
        heavy = la.null_space(light.T)
        damping = light.T @ C @ light
        N = light @ la.null_space(damping, rcond=1e-9)
        R = light @ la.orth(damping.T, rcond=1e-9)
        assert np.abs(C @ N).max(initial=0.0) < 1e-9 * np.abs(C).max(initial=1.0)
        h, r, n = heavy.shape[1], R.shape[1], len(M)
        place, rate, creep = np.split(np.eye(2 * h + r), [h, 2 * h])
        known = heavy @ place + R @ creep
        inner = np.linalg.inv(np.hstack([light.T @ C @ R, light.T @ K @ N]))
        on_x, on_f = -inner @ light.T @ (C @ heavy @ rate + K @ known), inner @ light.T
        Q, S = known + N @ on_x[r:], N @ on_f[r:]
        V, W = heavy @ rate + R @ on_x[:r], R @ on_f[:r]
        mass = np.linalg.inv(heavy.T @ M @ heavy) @ heavy.T
        A = np.vstack([rate, -mass @ (C @ V + K @ Q), on_x[:r]])
        G = np.vstack([np.zeros((h, n)), mass @ (np.eye(n) - C @ W - K @ S), on_f[:r]])
        V, W = V + N @ on_x[r:] @ A, W + N @ on_x[r:] @ G
        basis = np.linalg.inv(np.hstack([heavy, R, N]))
        begin = np.block(
            [[basis[:h], np.zeros((h, n))], [np.zeros((h, n)), basis[:h]], [basis[h : h + r], 0.0 * basis[h : h + r]]]
        )
        return cls(A, G, Q, S, V, W, begin)

    def held(self, x: np.ndarray, f: np.ndarray, t: float) -> np.ndarray:
        whole = np.block([[self.A, (self.G @ f)[:, None]], [np.zeros((1, len(x) + 1))]])
        return np.asarray((la.expm(whole * t) @ np.append(x, 1.0))[:-1])

    def forced(self, x: np.ndarray, f: Force, before: float, after: float) -> np.ndarray:
        """Where a smooth force, a polynomial of the time within a row to round-off, has brought it."""
        h, size = after - before, len(x)
        s = 0.5 - 0.5 * np.cos(np.pi * (np.arange(DEGREE + 1) + 0.5) / (DEGREE + 1))
        course = np.polynomial.polynomial.polyfit(s, np.array([f(before + h * at) for at in s]), DEGREE).T
        powers = np.diag(np.arange(1.0, DEGREE + 1), -1)
        whole = np.block([[h * self.A, h * self.G @ course], [np.zeros((DEGREE + 1, size)), powers]])
        return np.asarray((la.expm(whole) @ np.concatenate([x, np.eye(DEGREE + 1)[0]]))[:size])

    def seen(self, x: np.ndarray, f: np.ndarray, slide: np.ndarray | float = 0.0) -> np.ndarray:
        return np.concatenate([self.Q @ x + self.S @ f, self.V @ x + self.W @ f + self.S @ (slide * np.ones(len(f)))])


def random_model(seed: int, kind: str) -> fc.LinearModel:
    """Three freedoms with mass, two with damping alone, two with stiffness alone, in coordinates that mix them all.

    Outputs are the work coordinates of the inputs and their rates.
    """
    rng = np.random.default_rng(seed)
    T = la.qr(rng.standard_normal((7, 7)))[0] * rng.uniform(0.5, 2.0, 7)
    mass = np.diag([1.0, 2.0, 0.5, 0.0, 0.0, 0.0, 0.0])
    damper = rng.standard_normal((5, 3)) * [0.7, 0.5, 1.0]
    spring = rng.standard_normal((7, 7)) + 2.0 * np.eye(7)
    if kind == "free":
        spring -= np.outer(rigid := np.array([1.0, 0.3, -0.2, 0.4, 0.8, 0.6, -0.5]), rigid @ spring) / (rigid @ rigid)
        damper -= np.outer(rigid[:5], rigid[:5] @ damper) / (rigid[:5] @ rigid[:5])
    stiffness = spring @ spring.T
    if kind == "growing":
        stiffness -= 1.2 * la.eigh(stiffness, np.eye(7))[0][0] * np.eye(7) + np.diag([6.0, 0, 0, 0, 0, 0, 0])
    damping = la.block_diag(damper @ damper.T, np.zeros((2, 2)))
    M, C, K = (sp.csc_matrix(0.5 * (A + A.T)) for A in (T @ A @ T.T for A in (mass, damping, stiffness)))
    B = rng.standard_normal((7, 2))
    zero, names = np.zeros((2, 7)), tuple(f"q{i}" for i in range(7))
    Cq, Cv = (
        np.vstack(rows) for rows in ((B.T, zero, np.eye(7), 0 * np.eye(7)), (zero, B.T, 0 * np.eye(7), np.eye(7)))
    )
    outputs = ("a", "b", "da", "db", *names, *(f"d{name}" for name in names))
    return fc.LinearModel(M, C, K, B, Cq, Cv, np.zeros((18, 2)), names, ("u", "w"), outputs)


def dense(linear: fc.LinearModel) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    return linear.M.toarray(), linear.C.toarray(), linear.K.toarray()


def started(linear: fc.LinearModel, seed: int) -> tuple[fc.State, np.ndarray]:
    """A start at random, not where massless freedoms balance."""
    n, rng = len(linear.coordinates), np.random.default_rng(seed)
    q, v = rng.standard_normal((2, n))
    return fc.State(np.zeros((1, 3)), np.eye(3)[None], q, v, np.zeros(len(linear.inputs))), np.append(q, v)


MODELS = [(seed, kind) for kind in ("held", "free", "growing") for seed in (1, 2)]


def off(run: fc.Run, rows: np.ndarray) -> float:
    """The largest difference of coordinates and rates, of the largest of each kind."""
    found = run.y[: len(rows), -rows.shape[1] :]
    kinds = np.split(np.arange(rows.shape[1]), 2)
    return float(max(np.abs((found - rows)[:, k]).max() / np.abs(rows[:, k]).max() for k in kinds))


@pytest.mark.parametrize(("seed", "kind"), MODELS)
def test_held_inputs_from_any_start(seed, kind):
    linear = random_model(seed, kind)
    reduced = Reduced.of(*dense(linear))
    state, both = started(linear, seed)
    f = linear.B @ [1.0, -2.0]
    run = fc.simulate(linear, until=UNTIL, start=state, inputs={"u": 1.0, "w": -2.0}, every=UNTIL / ROWS)
    rows = np.array([reduced.seen(reduced.held(reduced.begin @ both, f, t), f) for t in run.t])
    assert off(run, rows) < 1e-9


@pytest.mark.parametrize(("seed", "kind"), MODELS)
def test_a_sampled_law_from_any_start(seed, kind):
    """The first sample reads the start as it is given, later ones what the inputs before them have left."""
    linear = random_model(seed, kind)
    reduced = Reduced.of(*dense(linear))
    state, both = started(linear, seed)
    law = LinearController(
        np.zeros((0, 0)),
        np.zeros((0, 4)),
        np.zeros((2, 0)),
        -np.hstack([PLACE, RATE]),
        ("a", "b", "da", "db"),
        ("u", "w"),
        SAMPLE,
    )
    run = fc.simulate(linear, law, until=UNTIL, start=state, inputs={"u": 1.0}, every=SAMPLE)
    x, y, rows = reduced.begin @ both, both, []
    for _ in run.t[:-1]:  # what the sample at the end would do is not asked any more
        q, v = np.split(y, 2)
        f = linear.B @ ([1.0, 0.0] - PLACE @ (linear.B.T @ q) - RATE @ (linear.B.T @ v))
        rows.append(reduced.seen(x, f))
        x = reduced.held(x, f, SAMPLE)
        y = reduced.seen(x, f)
    assert off(run, np.array(rows)) < 1e-8


@pytest.mark.parametrize(("seed", "kind"), MODELS)
def test_a_linear_law_of_places_from_any_start(seed, kind):
    """With a state of its own, which filters what it commands: T z' = y − z, u = −z − G y."""
    linear, T = random_model(seed, kind), 0.1
    reduced = Reduced.of(dense(linear)[0], dense(linear)[1], dense(linear)[2] + linear.B @ PLACE @ linear.B.T)
    state, both = started(linear, seed)
    law = LinearController(-np.eye(2) / T, np.eye(2) / T, -np.eye(2), -PLACE, ("a", "b"), ("u", "w"))
    run = fc.simulate(linear, law, until=UNTIL, start=state, inputs={"u": 1.0}, every=UNTIL / ROWS)
    read, B = linear.B.T, linear.B
    x, base = reduced.begin @ both, B[:, 0]
    on_z = -read @ reduced.S @ B / T - np.eye(2) / T
    A = np.block([[reduced.A, -reduced.G @ B], [read @ reduced.Q / T, on_z]])
    b = np.append(reduced.G @ base, read @ reduced.S @ base / T)
    rows, size = [], len(A)
    for t in run.t:
        z = (la.expm(np.block([[A, b[:, None]], [np.zeros((1, size + 1))]]) * t) @ np.r_[x, 0.0, 0.0, 1.0])[:-1]
        slide = -B @ (A @ z + b)[-2:]
        rows.append(reduced.seen(z[:-2], base - B @ z[-2:], slide))
    assert off(run, np.array(rows)) < 1e-9


class Curved:
    """Feedback in Python, of places alone or of rates too."""

    inputs, outputs, sample_time = ("a", "b", "da", "db"), ("u", "w"), 0.0

    def __init__(self, damped: bool) -> None:
        self.rate_gain = 3.0 * (RATE + RATE.T) if damped else np.zeros((2, 2))

    def initial(self) -> np.ndarray:
        return np.zeros(0)

    def command(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.array(np.array([np.sin(3.0 * t), 0.5]) - 0.2 * (y[:2]) - self.rate_gain @ y[2:])


@pytest.mark.parametrize("damped", [False, True], ids=["places", "places and rates"])
@pytest.mark.parametrize(("seed", "kind"), MODELS[::2])
def test_a_continuous_law_from_any_start(seed, kind, damped):
    """One that reads rates damps what has stiffness alone: this keeps its place then."""
    linear, law = random_model(seed, kind), Curved(damped)
    M, C, K = dense(linear)
    B = linear.B
    reduced = Reduced.of(M, C + B @ law.rate_gain @ B.T, K + 0.2 * B @ B.T)
    state, both = started(linear, seed)
    run = fc.simulate(linear, law, until=UNTIL, start=state, every=UNTIL / ROWS, method=fc.Exact(1e-3))
    assert run.status is fc.Status.FINISHED

    def force(t: float) -> np.ndarray:
        return np.asarray(B @ [np.sin(3.0 * t), 0.5])

    x, rows = reduced.begin @ both, []
    for before, after in zip([0.0, *run.t], run.t, strict=False):
        x = reduced.forced(x, force, before, after) if after > before else x
        slide = B @ [3.0 * np.cos(3.0 * after), 0.0]
        rows.append(reduced.seen(x, force(after), slide))
    assert off(run, np.array(rows)) < 1e-8


def test_a_run_under_such_a_law_goes_on_from_its_checkpoint():
    linear = random_model(1, "held")
    ask = {"every": UNTIL / ROWS, "method": fc.Exact(2e-3)}
    whole = fc.simulate(linear, Curved(True), until=UNTIL, **ask)
    half = fc.simulate(linear, Curved(True), until=UNTIL / 2, **ask)
    rest = fc.simulate(linear, Curved(True), until=UNTIL, start=half.checkpoint, **ask)
    assert (rest.y[-1] == whole.y[-1]).all()


def rotor(inertia: float, damping: float = 0.0) -> fc.Structure:
    body = fc.RigidBody("rotor", (0, 0, 0), 1.0, (1.0, 1.0, 1.0))
    drive = fc.RotaryDrive("d", body.node, axis="z", stiffness=40.0, ratio=1.0, inertia=inertia, damping=damping)
    outputs = [fc.DriveAngle("as", drive), fc.Rotation("turn", body.node, "z"), fc.DriveSpeed("ss", drive)]
    return fc.Structure([body], [fc.Support(body.node, "u v w rx ry")], [drive], [fc.MotorTorque("ms", drive)], outputs)


def bar() -> fc.Structure:
    """A beam whose twist has no inertia, with a body at its end."""
    section = fc.Section(EA=2e8, EI_y=4e4, EI_z=4e4, GJ=2e3, rhoA=6.0, rhoJ=0.0)
    beam = fc.Beam("b", (0, 0, 0), (3, 0, 0), section, elements=2)
    body = fc.RigidBody("d", beam.end, 1.0, (0.5, 0.5, 0.5))
    inputs, outputs = [fc.Torque("ms", beam.node(1), "x")], [fc.Rotation("as", beam.node(1), "x")]
    outputs += [fc.Rotation("turn", beam.end, "x")]
    return fc.Structure([beam, body], [fc.Support(beam.start), fc.Weld(beam.end, body.node)], [], inputs, outputs)


MACHINES: dict[str, Any] = {
    "lag": lambda: fc.assemble(rotor(0.05), [fc.Flexible(), fc.MotorLag({"d": 0.02})]),
    "lag on a rigid shaft": lambda: fc.assemble(rotor(0.05), [fc.MotorLag({"d": 0.02})]),
    "no inertia": lambda: fc.assemble(rotor(0.0), [fc.Flexible()]),
    "friction without inertia": lambda: fc.assemble(rotor(0.0), [fc.Flexible(), fc.ViscousFriction({"d": 0.5})]),
    "damping without inertia": lambda: fc.assemble(rotor(0.0, 0.5), [fc.Flexible()]),
    "twist without inertia": lambda: fc.assemble(bar(), [fc.Flexible(), fc.RayleighDamping(beta=1e-3)]),
}


@pytest.mark.parametrize("name", MACHINES)
@pytest.mark.parametrize("made", [lambda model: model, fc.linearize], ids=["model", "linear model"])
def test_a_machine_at_rest_that_an_input_pushes_from_the_start(name, made):
    model = MACHINES[name]()
    linear = fc.linearize(model)
    reduced = Reduced.of(*dense(linear))
    f = linear.B[:, 0] * 10.0
    run = fc.simulate(made(model), until=0.2, inputs={"ms": 10.0}, method=fc.Exact(0.02))
    rows = np.array([reduced.seen(reduced.held(0.0 * reduced.begin[:, 0], f, t), f) for t in run.t])
    expected = rows @ np.hstack([linear.Cq, linear.Cv]).T
    assert np.abs(run.y - expected).max(axis=0) == pytest.approx(0.0, abs=1e-9 * np.abs(expected).max())
    springs = 0.5 * rows[0, : len(f)] @ linear.K @ rows[0, : len(f)]
    assert run.report.energy.start == pytest.approx(springs, rel=1e-9, abs=1e-20)
    assert run.report.energy_residual < 1e-11


@pytest.mark.parametrize("reference", [Constant(1.0), MinimumJerk(distance=1.0, duration=0.2)], ids=["jump", "course"])
@pytest.mark.parametrize("name", [name for name in MACHINES if "twist" not in name])
@pytest.mark.parametrize("made", [lambda model: model, fc.linearize], ids=["model", "linear model"])
def test_a_machine_under_a_continuous_law_of_angle_and_speed(name, made, reference):
    """u = 8 (r − a) − a': without inertia or damping the motor's angle keeps its place, whatever jumps.

    What the law alone damps is of third order in the step.
    """
    method = fc.Exact(2e-4 if name == "no inertia" else 1e-3)
    model = MACHINES[name]()
    linear, gains = fc.linearize(model), np.array([8.0, 1.0])
    law = LinearController(np.zeros((0, 0)), np.zeros((0, 2)), np.zeros((1, 0)), -gains[None], ("as", "ss"), ("ms",))
    M, C, K = dense(linear)
    B, read = linear.B, linear.Cv[2:]
    reduced = Reduced.of(M, C + gains[1] * B @ read, K + gains[0] * B @ linear.Cq[:1])

    def force(t: float) -> np.ndarray:
        return B[:, 0] * gains[0] * float(reference(t))

    run = fc.simulate(made(model), Tracking(law, {"as": reference}), until=0.2, method=method, every=0.02)
    x, rows = 0.0 * reduced.begin[:, 0], []
    for before, after in zip([0.0, *run.t], run.t, strict=False):
        x = reduced.forced(x, force, before, after) if after > before else x
        rows.append(reduced.seen(x, force(after)))
    expected = np.array(rows) @ np.hstack([linear.Cq, linear.Cv]).T
    assert np.abs(run.y - expected).max() < 1e-8 * np.abs(expected).max()
    if isinstance(reference, Constant):
        regulated = fc.simulate(made(model), law, until=0.2, inputs={"ms": gains[0]}, method=method, every=0.02)
        assert np.abs(regulated.y - expected).max() < 1e-8 * np.abs(expected).max()


def test_modes_that_are_kept_move_as_with_all_of_them():
    linear = fc.linearize(fc.assemble(bar(), [fc.Flexible()]))
    shapes = linear.modes().lowest(3).shapes
    momenta = (linear.M @ shapes).T @ np.eye(len(linear.coordinates))
    seen = fc.LinearModel(
        linear.M,
        linear.C,
        linear.K,
        linear.B,
        momenta,
        0.0 * momenta,
        np.zeros((3, 1)),
        linear.coordinates,
        linear.inputs,
        ("one", "two", "three"),
    )
    state, _ = started(linear, 4)
    few, every = (
        fc.simulate(seen, until=0.1, start=state, inputs={"ms": 10.0}, method=fc.Exact(0.01, modes))
        for modes in (3, None)
    )
    assert few.y == pytest.approx(every.y, abs=1e-9 * np.abs(every.y).max())
    assert (np.abs(every.y).max(axis=0) > 1e-3).all()
