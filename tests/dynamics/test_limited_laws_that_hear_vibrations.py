"""A sampled law with limits that reads a shaft's vibration, which steps do not resolve: against the exact map."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm

import flexctrl as fc
from flexctrl.dynamics.feed import feed_of
from flexctrl.dynamics.notes.shocks import Shock, Train

MOTOR, LOAD = 1.2816, 1.2276


class Limited:
    """Proportional and derivative on the motor's side, limited in size and in rate; kept commands are its state."""

    inputs, outputs = ("x", "v"), ("u",)

    def __init__(self, sample: float, stiff: float, rate: float, most: float, lasts: float = 10.0) -> None:
        self.sample_time, self.stiff, self.rate, self.most, self.lasts = sample, stiff, rate, most, lasts

    def initial(self) -> np.ndarray:
        return np.zeros(1)

    def command(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        omega, share = self.stiff / self.sample_time, min(t * self.stiff / self.sample_time / self.lasts, 1.0)
        wanted = 3.0 * share**3 * (10.0 - 15.0 * share + 6.0 * share**2)
        mass = MOTOR + LOAD
        most = self.most * mass * omega**2 * 3.0
        u = mass * omega**2 * (wanted - y[0]) - 1.4 * mass * omega * y[1]
        return np.clip(np.clip([u], x - self.rate * most, x + self.rate * most), -most, most)

    def update(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return self.command(t, x, y)


def shaft(omega: float, zeta: float) -> tuple[fc.Model, np.ndarray]:
    """The machine, and its equations with the command as last state."""
    mu = MOTOR * LOAD / (MOTOR + LOAD)
    k, c = mu * omega**2, 2.0 * zeta * mu * omega
    a, b = fc.PointMass("a", (0, 0, 0), MOTOR), fc.PointMass("b", (1, 0, 0), LOAD)
    spring = fc.Spring("shaft", (0, 0, 0), (1, 0, 0), stiffness=k, damping=c)
    joints = [fc.Support(a.node, "v w"), fc.Support(b.node, "v w"), fc.Pin(a.node, spring.start)]
    outputs = [fc.Position("x", a.node, "x"), fc.Velocity("v", a.node, "x"), fc.Position("far", b.node, "x")]
    force = fc.Force("u", a.node, "x")
    plan = fc.Structure([a, b, spring], [*joints, fc.Pin(spring.end, b.node)], inputs=[force], outputs=outputs)
    A = np.zeros((5, 5))
    A[0, 2] = A[1, 3] = 1.0
    A[2], A[3] = np.array([-k, k, -c, c, 1.0]) / MOTOR, np.array([k, -k, c, -c, 0.0]) / LOAD
    return fc.assemble(plan, [fc.LargeRotation()]), A


def exact(A: np.ndarray, law: Limited, samples: int) -> np.ndarray:
    on, z, kept, found = expm(A * law.sample_time), np.zeros(5), law.initial(), []
    for i in range(samples + 1):
        found.append(z[[0, 2, 1]])
        kept = law.command(i * law.sample_time, kept, z[[0, 2]])
        z[4] = kept[0]
        z = on @ z
    return np.array(found)


def judged(omega: float, zeta: float, law: Limited) -> None:
    """What is off by more than a percent is told as a third of that at least, or there is a note; or it has failed."""
    model, A = shaft(omega, zeta)
    samples = round(2.0 * law.lasts / law.stiff)
    run = fc.simulate(model, law, until=samples * law.sample_time, every=law.sample_time)
    true = exact(A, law, samples)
    for i, name in enumerate(("x", "v")):
        off = abs(run[name] - true[:, i]).max() / np.ptp(true[:, i])
        told = run.report.output_errors.get(name, 0.0)
        noted = run.status is fc.Status.FAILED or any(name in note.split() for note in run.report.notes)
        assert noted or off < max(0.01, 3.0 * told), (name, off, told)


@pytest.mark.parametrize("seed", [2, 3, 5, 46, 92, 244])
def test_errors_are_told(seed):
    rng = np.random.default_rng(seed)
    omega, zeta = rng.uniform(15.0, 60.0), rng.uniform(0.005, 0.05)
    law = Limited(rng.uniform(2.0, 5.0) / omega, rng.uniform(0.1, 0.25), rng.uniform(0.02, 0.2), rng.uniform(0.2, 1.0))
    judged(omega, zeta, law)


def test_what_is_kept_of_a_misread_sample_is_told():
    """Its place was 2.3 % off, told as 0.5 without a note: nothing grows here, and steps are shorter than samples."""
    judged(30.764, 0.0200127, Limited(0.069948, 0.314368, 0.027598, 0.709451, 6.49008))


def test_what_is_unseen_is_what_modes_swing_by():
    """A force put on at once: the motor's speed rings by F/(m₁ ω) · m₂/(m₁ + m₂), in closed form."""
    omega, force = 40.0, 2.5
    model, _ = shaft(omega, 0.0)
    law = Limited(0.1, 0.1, 0.1, 1.0)
    feed = feed_of(model, law, np.zeros(1))  # type: ignore[arg-type]
    run = fc.simulate(model, until=0.01, method=fc.Unchecked(fc.GeneralizedAlpha(0.01)))

    class Journey:
        plan = type("Plan", (), {"model": model, "feed": feed})

    shock = Shock.of(run, Journey(), model.rest, [np.zeros(1), np.array([force])], "", Train())  # type: ignore[arg-type]
    rings = force / (MOTOR * omega) * LOAD / (MOTOR + LOAD)
    np.testing.assert_allclose(shock.unseen(30.0)[1], rings, rtol=1e-9)
    np.testing.assert_allclose(shock.unseen(30.0)[0], rings / omega, rtol=1e-9)
    assert not shock.unseen(50.0).any()
