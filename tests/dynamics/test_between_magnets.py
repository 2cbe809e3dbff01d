"""A mass that is shaken between magnets: what laws leave that `Exact` interpolates adds up and grows, and is told."""

from __future__ import annotations

import control
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

import flexctrl as fc
from flexctrl.dynamics.notes.lengths import in_words

EVERY = 0.2


class Wells:
    """Two magnets that draw a mass out of the middle, and what shakes it."""

    inputs, outputs, sample_time = ("x", "v"), ("pull",), 0.0

    def __init__(self, pace: float = 1.0) -> None:
        self.pace = pace

    def initial(self):
        return np.zeros(0)

    def command(self, t, x, y):
        return np.array([2.0 * y[0] - y[0] ** 3 + 0.3 * np.cos(self.pace * t)])

    def rate(self, t, x, y):
        return np.zeros(0)


def sprung(damping: float, *effects: fc.Effect) -> fc.Model:
    mass = fc.PointMass("mass", (0, 0, 0), 1.0)
    spring = fc.Spring("spring", (-10, 0, 0), mass.node, stiffness=1.0, damping=damping)
    return fc.assemble(
        fc.Structure(
            [mass, spring],
            [fc.Support(spring.start), fc.Pin(spring.end, mass.node), fc.Support(mass.node, "v w")],
            inputs=[fc.Force("pull", mass.node, "x")],
            outputs=[fc.Position("x", mass.node, "x"), fc.Velocity("v", mass.node, "x")],
        ),
        effects,
    )


def shaken(kind: str, method: fc.Integrator | None, until: float) -> tuple[fc.Run, np.ndarray]:
    """A run, and by how much each output is off over its range."""
    model = sprung(0.15)
    machine = fc.linearize(model) if kind == "linear" else model
    run = fc.simulate(machine, Wells(), until=until, every=EVERY, start=model.displace([0.2]), method=method)
    assert run.status is fc.Status.FINISHED
    return run, far_off(run, 0.15, 1.0).max(axis=0)


def far_off(run: fc.Run, damping: float, pace: float) -> np.ndarray:
    """By how much each output is off in each row, over its range."""
    true = solve_ivp(
        lambda t, z: [z[1], z[0] - damping * z[1] - z[0] ** 3 + 0.3 * np.cos(pace * t)],
        (0.0, run.final.t + EVERY),
        [0.2, 0.0],
        t_eval=run.t,
        method="DOP853",
        rtol=1e-12,
        atol=1e-13,
    ).y.T
    return np.abs(run.y - true) / np.ptp(true, axis=0)


@pytest.mark.parametrize(
    ("kind", "method"),
    [
        ("linear", None),
        ("small", fc.Exact(0.2)),
        ("linear", fc.AdaptiveAlpha()),
        ("linear", fc.Richardson(fc.GeneralizedAlpha(0.05))),
    ],
)
@pytest.mark.parametrize("until", [15.0, 90.0])
def test_what_grows_under_a_law_that_is_interpolated_is_told(kind, method, until):
    """Of the linear default half of the motion was off at 90 s, and the report told 0."""
    run, off = shaken(kind, method, until)
    told = [run.report.output_errors[name] for name in ("x", "v")]
    assert (told >= np.minimum(0.6 * off, 0.5)).all()
    assert (told <= np.maximum(4.0 * off, 0.02)).all()
    assert run.report.error >= 0.6 * min(off[0], 0.5)
    assert any("by a finer run" in note for note in run.report.notes) == (run.report.error > 0.03)


@pytest.mark.parametrize(("length", "words"), [(0.158, "0.16"), (0.14, "0.1"), (0.199, "0.2"), (1.2e-4, "0.0001")])
def test_a_remedy_is_no_step_as_long_as_the_one_taken(length, words):
    assert in_words(length, 0.2) == words


@pytest.mark.parametrize("step", [0.2, 0.5])
def test_a_linear_law_on_a_model_in_small_motion_is_told_as_it_is(step):
    """Against the exponential of the closed loop: interpolated there, and closed on the linear model."""
    model, law = sprung(0.0), control.ss([[-3.0]], [[1.0, 0.5]], [[-4.0]], [[-6.0, -1.0]])
    law.set_inputs(["x", "v"])
    law.set_outputs(["pull"])
    run = fc.simulate(model, law, until=5.0, every=0.1, start=model.displace([0.2]), method=fc.Exact(step))
    loop = np.array([[0.0, 1.0, 0.0], [-1.0 - 6.0, -1.0, -4.0], [1.0, 0.5, -3.0]])
    true = np.array([expm(loop * t) @ [0.2, 0.0, 0.0] for t in run.t])[:, :2]
    off = np.abs(run.y - true).max(axis=0) / np.ptp(true, axis=0)
    told = np.array([run.report.output_errors[name] for name in ("x", "v")])
    assert (off > 1e-8).all()
    assert (told >= 0.5 * off).all()
    assert (told <= 20.0 * off).all()
    exact = fc.simulate(fc.linearize(model), law, until=5.0, every=0.1, start=model.displace([0.2]))
    assert exact.y == pytest.approx(true, abs=1e-11)
    assert not exact.report.output_errors


def test_nothing_is_run_again_where_nothing_is_interpolated_or_it_is_not_wanted():
    model = sprung(0.15)
    held = fc.simulate(fc.linearize(model), until=5.0, every=EVERY, inputs={"pull": 1.0})
    unasked, _ = shaken("linear", fc.Unchecked(fc.Exact(EVERY)), 30.0)
    for run in (held, unasked):
        assert not run.report.error
        assert not run.report.output_errors
        assert not run.report.notes


def test_what_is_interrupted_is_not_called_right():
    def stop(share):
        if share > 0.5:
            raise KeyboardInterrupt

    model = sprung(0.15)
    run = fc.simulate(fc.linearize(model), Wells(), until=20.0, start=model.displace([0.2]), progress=stop)
    assert run.status is fc.Status.INTERRUPTED
    assert run.report.notes == ("how far small differences have grown is not told by another run (interrupted)",)


def test_of_few_rows_no_output_is_called_right():
    """They were told as off by 0.0, as nothing was known between them."""
    model = sprung(0.15)
    run = fc.simulate(fc.linearize(model), Wells(), until=85.0, every=85.0, start=model.displace([0.2]))
    assert run.report.error > 0.1
    assert not run.report.output_errors


@pytest.mark.parametrize(("damping", "pace"), [(0.05, 1.2), (0.15, 1.0), (0.2, 1.0)])
def test_a_run_is_right_until_it_says(damping, pace):
    """It said 41.9 s of the first, where it had been off by a tenth since 40.4 s: 16 instants were looked at."""
    model = sprung(damping, fc.LargeRotation())
    run = fc.simulate(model, Wells(pace), until=100.0, every=EVERY, start=model.displace([0.2]))
    told = [
        float(note.split("right to 3% until t = ")[1].split(" s")[0]) for note in run.report.notes if "right" in note
    ]
    off = far_off(run, damping, pace)[:, 0]
    assert run.t[off > 0.1][0] > told > 0.6 * run.t[off > 0.1][0]
