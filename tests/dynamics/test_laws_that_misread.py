"""Sampled laws that jump: whether what they say hangs on less than steps err by is told, by a law that misreads."""

from __future__ import annotations

import numpy as np
import pytest
from shafts import machine, speeds

import flexctrl as fc
from flexctrl.design import Quantised, Sampled, pd
from flexctrl.design.lowering import lowered
from flexctrl.design.wrapping import Wrapper
from flexctrl.dynamics.misreading import Misreading

UNTIL = 3.0


class Relay:
    """Full torque one way or the other, by where the switching line is; none within a dead zone."""

    inputs, outputs = ("angle", "speed"), ("torque",)

    def __init__(self, dead: float, sample_time: float) -> None:
        self.dead, self.sample_time = dead, sample_time

    def initial(self) -> np.ndarray:
        return np.zeros(0)

    def command(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        error = 1.0 - y[:1] - 0.8 * y[1:]
        return np.sign(error) * (np.abs(error) > self.dead)

    def update(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return x


SILENT = [
    (20.85941201, 0.01622704008, 0.02, 0.0),
    (33.51551818, 0.01637658514, 0.01, 0.05),
    (12.91242488, 0.005859076047, 0.02, 0.0),
    (22.21480709, 0.01443298006, 0.02, 0.05),
    (40.8737962, 0.02541360055, 0.005, 0.0),
]


def draws() -> list[tuple[float, float, float, float]]:
    r = np.random.default_rng(1)
    return [
        (10 ** r.uniform(1.0, 2.7), 10 ** r.uniform(-2.3, -1.0), r.choice([5e-3, 0.01, 0.02]), r.choice([0.0, 0.05]))
        for _ in range(20)
    ]


WAYS = {"default": None, "tighter": fc.Tolerance(1e-5, 1e-8), "steps of one length": None}


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize(("frequency", "ratio", "sample", "dead"), [*SILENT, *draws()])
def test_no_relay_is_silently_wrong(frequency, ratio, sample, dead, way):
    """Speeds of 1 in 100 runs were 4 to 16 % off, told 0.03 to 0.7, without a note."""
    law = Relay(dead, sample)
    method = fc.GeneralizedAlpha(0.25 * sample) if way == "steps of one length" else None
    run = fc.simulate(machine(frequency, ratio), law, until=UNTIL, every=sample, method=method, tolerance=WAYS[way])
    true = speeds(frequency, ratio, lambda y: law.command(0.0, np.zeros(0), y), sample, UNTIL)
    off = np.abs(run["speed"] - true).max() / np.ptp(true)
    assert run.status is fc.Status.FINISHED
    assert run.report.output_errors["speed"] > 0.33 * off or off < 0.02 or run.report.notes


def test_where_nothing_hangs_on_it_nothing_is_said():
    """A load that is heavy for its motor, slowly: the relay stays on one side."""
    run = fc.simulate(machine(30.0, 0.1), Relay(0.0, 0.01), until=0.5, every=0.01)
    assert not any("hangs on" in note for note in run.report.notes)


def test_a_resumed_run_goes_on_with_the_same_bits():
    law, kwargs = Relay(0.0, 0.02), {"every": 0.02, "tolerance": fc.Tolerance(1e-6, 1e-9)}
    model = machine(21.0, 0.016)
    whole = fc.simulate(model, law, until=UNTIL, **kwargs)
    begun = fc.simulate(model, law, until=1.31, **kwargs)
    went_on = fc.simulate(model, law, until=UNTIL, start=begun.checkpoint, **kwargs)
    assert np.array_equal(whole.y[-20:], went_on.y[-20:])
    assert all(run.report.notes for run in (whole, went_on))


def test_a_law_that_misreads_by_nothing_is_the_law():
    law, model = Relay(0.05, 0.01), machine(30.0, 0.05)
    runs = [fc.simulate(model, c, until=1.0, every=0.01) for c in (law, Misreading(law, np.zeros(2)))]
    assert np.array_equal(runs[0].y, runs[1].y)


class Passing(Wrapper):
    """Of a kind that cannot be written down: it is asked in Python."""


def test_loops_ask_it_as_python_does():
    motion = Sampled(pd(3.0, 2.0, measured="angle", rate="speed", command="torque"), 0.01)
    law, model = Misreading(Quantised(motion, {"angle": 0.01}), np.array([0.3, -0.2])), machine(30.0, 0.05)
    assert lowered(law) is not None
    assert lowered(Passing(law)) is None
    runs = [fc.simulate(model, c, until=0.5, every=0.01) for c in (law, Passing(law), law.controller)]
    assert np.allclose(runs[0].y, runs[1].y, rtol=0.0, atol=1e-9)
    assert not np.allclose(runs[0].y, runs[2].y, rtol=0.0, atol=1e-2)
