"""Lines that turn by whole turns from sample to sample: each command finds them as the last one did, and adds to it.

Steps are as long as samples there, and half as long they see nothing of it either.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm

import flexctrl as fc

TS, UNTIL = 2e-3, 1.0
CART, LOAD = 20.0, 1.0


class Mover:
    """Pushes the cart along a path of constant acceleration, and back to rest, by what its place and speed lack."""

    inputs, outputs, sample_time = ("p", "v"), ("push",), TS

    def initial(self) -> np.ndarray:
        return np.zeros(0)

    def command(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        a, T = 2.0, 0.3
        place, speed = (
            (a * t * t / 2, a * t) if t < T else (a * T * T - a * max(2 * T - t, 0) ** 2 / 2, a * max(2 * T - t, 0))
        )
        return np.array([21.0 * (20.0**2 * (place - y[0]) + 28.0 * (speed - y[1]))])

    def update(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return x


def wagons(turned: float, ratio: float) -> tuple[fc.Model, float, float]:
    """A cart that draws another one by a spring, its stiffness and its damping."""
    stiffness = (turned / TS) ** 2 * CART * LOAD / (CART + LOAD)
    damping = 2.0 * ratio * stiffness * TS / turned
    spring = fc.Spring("spring", (0, 0, 0), (1, 0, 0), stiffness=stiffness, damping=damping)
    cart, load = fc.PointMass("cart", spring.start, CART), fc.PointMass("load", spring.end, LOAD)
    joints = [fc.Pin(spring.start, cart.node), fc.Pin(spring.end, load.node)]
    joints += [fc.Support(mass.node, "v w") for mass in (cart, load)]
    outputs = [fc.Position("p", cart.node, "x"), fc.Velocity("v", cart.node, "x"), fc.Tension("force", spring)]
    inputs = [fc.Force("push", cart.node, "x")]
    structure = fc.Structure([spring, cart, load], joints, [], inputs, outputs)
    return fc.assemble(structure, [fc.LargeRotation()]), stiffness, damping


def exact(times: np.ndarray, stiffness: float, damping: float) -> np.ndarray:
    """The spring's force by the exact map from sample to sample, for (p, e, v, ė)."""
    A = np.zeros((5, 5))
    A[0, 2] = A[1, 3] = 1.0
    A[2, [1, 3, 4]] = stiffness / CART, damping / CART, 1.0 / CART
    A[3, [1, 3, 4]] = -stiffness * (1 / CART + 1 / LOAD), -damping * (1 / CART + 1 / LOAD), -1.0 / CART
    state, found, law = np.zeros(5), [], Mover()
    for k in range(round(UNTIL / TS)):
        state[4] = law.command(k * TS, np.zeros(0), state[[0, 2]])[0]
        for t in times[(times > (k - 1e-9) * TS) & (times < (k + 1 - 1e-9) * TS)]:
            within = expm(A * (t - k * TS)) @ state
            found.append(stiffness * within[1] + damping * within[3])
        state = expm(A * TS) @ state
    return np.array([*found, stiffness * state[1] + damping * state[3]])


@pytest.mark.parametrize("every", [TS, 0.0127], ids=["each sample", "a few"])
@pytest.mark.parametrize(("turned", "ratio"), [(2 * np.pi, 0.005), (2 * np.pi, 0.05), (6.0, 0.005), (4 * np.pi, 0.01)])
def test_what_samples_add_up_to_is_told(turned, ratio, every):
    model, stiffness, damping = wagons(turned, ratio)
    run = fc.simulate(model, Mover(), until=UNTIL, every=every)
    rows = slice(0, len(run.t) if every == TS else -1)
    right = exact(run.t[rows], stiffness, damping)[: len(run.t[rows])]
    off = np.abs(run["force"][rows] - right).max() / np.ptp(right)
    told = run.report.output_errors["force"]
    assert off > 0.01
    assert 0.6 * off < told < 5.0 * off
    assert (told > 0.05) == any("force rings by up to" in note for note in run.report.notes)


def test_between_whole_turns_commands_do_not_add_up():
    """At 9 rad from sample to sample what is told is what other runs tell, or one command."""
    model, stiffness, damping = wagons(9.0, 0.02)
    run = fc.simulate(model, Mover(), until=UNTIL, every=TS)
    right = exact(run.t, stiffness, damping)
    off = np.abs(run["force"] - right).max() / np.ptp(right)
    assert 0.5 * off < run.report.output_errors["force"] < 5.0 * off


def test_a_line_that_is_pulled_by_another_is_told_of_as_well():
    """Three masses in a row, the first is moved: of the second spring, 9 % off, a sixth of a percent was told."""
    masses, springs = [7.3, 0.49, 0.0303], [(20348822.246, 196.478), (2103074.2, 6.62)]
    bodies = [fc.PointMass(f"m{i}", (2.0 * i, 0, 0), mass) for i, mass in enumerate(masses)]
    lines = [
        fc.Spring(f"s{i}", bodies[i].node, bodies[i + 1].node, stiffness=k, damping=c)
        for i, (k, c) in enumerate(springs)
    ]
    joints = [fc.Support(body.node, "v w") for body in bodies]
    joints += [fc.Pin(s.start, body.node) for s, body in zip(lines, bodies, strict=False)]
    joints += [fc.Pin(s.end, body.node) for s, body in zip(lines, bodies[1:], strict=True)]
    outputs = [fc.Position("p", bodies[0].node, "x"), fc.Velocity("v", bodies[0].node, "x"), fc.Tension("T", lines[1])]
    plan = fc.Structure([*bodies, *lines], joints, inputs=[fc.Force("push", bodies[0].node, "x")], outputs=outputs)
    law, until = Servo(), 0.534
    run = fc.simulate(fc.assemble(plan, [fc.LargeRotation(), fc.Flexible()]), law, until=until, every=TS)
    A = np.zeros((7, 7))
    A[:3, 3:6] = np.eye(3)
    for i, (k, c) in enumerate(springs):
        for j, sign in ((i, 1.0), (i + 1, -1.0)):
            A[3 + j, [i, i + 1, 3 + i, 4 + i]] += sign * np.array([-k, k, -c, c]) / masses[j]
    A[3, 6] = 1.0 / masses[0]
    on, z, right = expm(TS * A), np.zeros(7), []
    for i in range(len(run.t)):
        z[6] = law.command(i * TS, np.zeros(0), z[[0, 3]])[0]
        right.append(springs[1] @ np.array([z[2] - z[1], z[5] - z[4]]))
        z = on @ z
    off = np.abs(run["T"] - right).max() / np.ptp(right)
    assert off > 0.05
    assert 0.5 * off < run.report.output_errors["T"] < 5.0 * off


class Servo(Mover):
    """Brings a mass 0.2 m on within 0.378 s."""

    def command(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        s, T = min(t / 0.378, 1.0), 0.378
        place, speed = 0.2 * s**3 * (10 - 15 * s + 6 * s**2), 6.0 * s**2 * (1 - s) ** 2 / T
        return np.array([2148.32 * (place - y[0]) + 234.374 * (speed - y[1])])


@pytest.mark.parametrize("stiffness", [1e8, 1e9, 1e10, 1e12])
def test_tensions_of_lines_that_stretch_by_less_than_the_tolerance_are_told(stiffness):
    """A pendulum set going at v: m (v² − 2 g z + g (1 − z)) where it has risen by z; off by per cents with z right."""
    mass = fc.PointMass("mass", (0, 0, -1), 10.0)
    rope = fc.Rope("rope", (0, 0, 0), (0, 0, -1), EA=stiffness, damping=0.6 * np.sqrt(stiffness * 10.0))
    joints = [fc.Support(rope.start), fc.Pin(rope.end, mass.node), fc.Support(mass.node, "v")]
    outputs = [fc.Tension("tension", rope), fc.Position("x", mass.node, "x"), fc.Position("z", mass.node, "z")]
    model = fc.assemble(
        fc.Structure([rope, mass], joints, outputs=outputs), [fc.Gravity(), fc.Flexible(), fc.LargeRotation()]
    )
    rest = fc.equilibrium(model).state
    v = np.zeros(model.n)
    v[next(i for i, name in enumerate(model.coordinates) if name.endswith("_u"))] = 2.0
    run = fc.simulate(model, until=3.0, every=0.01, start=rest.with_(v=v))
    risen = 1.0 + run["z"]
    right = 10.0 * (4.0 - 2 * 9.81 * risen + 9.81 * (1.0 - risen))
    off = np.abs(run["tension"] - right)[1:].max() / np.ptp(right)
    assert 0.3 * off < run.report.output_errors["tension"]
