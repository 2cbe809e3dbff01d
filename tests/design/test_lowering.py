"""A law in machine code says what it says in Python."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import control as ct
import numpy as np
import pytest

import flexctrl as fc
from flexctrl.design import (
    AntiWindup,
    Commanded,
    Constant,
    Delayed,
    FeedForward,
    FilteredRate,
    Held,
    MinimumJerk,
    Noisy,
    OpenLoop,
    Quantised,
    Ramp,
    RateLimited,
    Sampled,
    Saturated,
    Shaped,
    Spline,
    Sum,
    Table,
    Together,
    Tracking,
    TrapezoidalVelocity,
    as_controller,
    pd,
    pi,
    pid,
    zvd,
)
from flexctrl.design.lowering import lowered
from flexctrl.kernels.kernel import CasadiVM, best_backend
from flexctrl.study.held_out import Times

H = 0.01
PID = pid(30.0, 12.0, 4.0, measured="angle", rate=FilteredRate(0.02), command="torque")
FIRST = pd(3.0, 0.4, measured="angle", rate="speed", command="torque")
SECOND = pi(5.0, 2.0, measured="travel", command="push")
MOVE = Shaped(TrapezoidalVelocity(5.0, 1.0, 0.25, at=0.2), zvd(2.0, 0.02))
FOLLOW = {"angle": MOVE, "speed": MOVE.derivative}


def observer() -> Any:
    rng = np.random.default_rng(4)
    A, B, C, D = rng.normal(0.0, 0.2, (5, 5)), rng.normal(size=(5, 2)), rng.normal(size=(2, 5)), np.zeros((2, 2))
    return ct.ss(A, B, C, D, H, inputs=["angle", "travel"], outputs=["torque", "push"])


LAWS = {
    "pid": Sampled(PID, H),
    "two rates": Together(Held(Noisy(Sampled(PID, 3 * H), {"angle": 0.01}), H), Sampled(SECOND, H)),
    "observer": as_controller(observer()),
    "tracking": Sampled(Tracking(FIRST, FOLLOW), H),
    "saturated": Saturated(Sampled(Tracking(FIRST, FOLLOW), H), {"torque": (-0.4, 0.3)}),
    "held": Tracking(Sampled(AntiWindup(PID, {"torque": 6.0}), H), {"angle": MOVE}),
    "rate limited": RateLimited(Sampled(PID, H), {"torque": (-40.0, 25.0)}, {"torque": 1.0}),
    "delayed": Delayed(Sampled(PID, H), 3, {"torque": -2.0}),
    "quantised": Quantised(Sampled(PID, H), {"angle": 2**-7, "torque": 0.125}),
    "noisy": Noisy(Sampled(PID, H), {"angle": 0.1, "torque": 0.3}, seed=7),
    "together": Together(Sampled(FIRST, H), Sampled(SECOND, H), Sampled(PID, H)),
    "open": OpenLoop({"torque": Spline((0.0, 0.5, 1.0), (0.0, 2.0, 1.0)), "push": np.cos}, H),
    "fed forward": FeedForward(Sampled(FIRST, H), {"torque": Sum((Ramp(1.0, 0.4), Table((0.1, 0.9), (0.0, 2.0))))}),
    "commanded": Commanded(as_controller(observer()), {"travel": MinimumJerk(1.0, 0.7, at=0.1)}),
    "all of it": Delayed(
        Saturated(
            RateLimited(
                Quantised(
                    Noisy(Sampled(Together(Tracking(PID, {"angle": MOVE}), SECOND), H), {"angle": 0.01}),
                    {"angle": 1e-3, "travel": 1e-2},
                ),
                {"torque": 500.0},
            ),
            {"torque": 80.0, "push": 3.0},
        ),
        2,
    ),
}


@pytest.mark.parametrize("backend", [CasadiVM(), best_backend()], ids=["vm", "best"])
@pytest.mark.parametrize("name", LAWS)
def test_a_lowered_law_says_the_same(name, backend):
    """To the last digits, over 200 samples in which it goes its own way."""
    law, rng = LAWS[name], np.random.default_rng(1)
    found = lowered(law)
    run = backend.bind(
        found.kernel, np.arange(found.kernel.n_in)[None], found.values[None], np.arange(found.kernel.n_out)[None]
    )
    x = z = law.initial()
    times = H * np.arange(200)
    readings = np.cumsum(rng.normal(0.0, 0.1, (200, len(law.inputs))), axis=0)
    table, width = found.table(times), len(law.outputs)
    for t, row, y in zip(times.tolist(), table, readings, strict=True):
        answer = np.zeros(found.kernel.n_out)
        run(np.concatenate([y, z, row]), answer)
        assert np.allclose(answer[:width], law.command(t, x, y), rtol=1e-11, atol=1e-12)
        assert np.array_equal(row, found.now(t))
        x, z = law.update(t, x, y), answer[width:]
        assert np.allclose(z, x, rtol=1e-11, atol=1e-12)


def test_halves_are_rounded_as_by_numpy():
    law = Quantised(as_controller(ct.ss([], [], [], [[1.0]], H, inputs=["y"], outputs=["u"])), {"y": 1.0})
    found = lowered(law)
    for y in (0.5, 1.5, 2.5, -0.5, -1.5, 0.49999999999999994, 3e9 + 0.5, -7.4):
        answer = np.asarray(found.kernel.function()(np.array([y]), found.values)).ravel()
        assert answer[0] == np.rint(y)


@pytest.mark.parametrize(
    "signal",
    [MOVE, MOVE.derivative, Constant(2.0), Times(MOVE, 0.6), Sum((MOVE, Ramp(0.3))), MinimumJerk(1.0, 0.5, at=0.3)],
)
def test_signals_are_the_same_all_at_once(signal):
    times = np.concatenate([[-1.0], 0.01 * np.arange(900), signal.breaks])
    assert np.array_equal(signal.along(times), [signal(t) for t in times.tolist()])


@dataclass(frozen=True)
class Own:
    """u = −g y³."""

    gain: float = 2.0
    sample_time: float = H
    inputs: ClassVar[tuple[str, ...]] = ("angle",)
    outputs: ClassVar[tuple[str, ...]] = ("torque",)

    def initial(self) -> np.ndarray:
        return np.zeros(0)

    def command(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return -self.gain * y**3

    def rate(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return x

    update = rate


@dataclass(frozen=True)
class Telling(Own):
    """The same, which can be written down."""

    def lowered(self, tracer: Any, x: Any, y: Any) -> tuple[Any, Any]:
        return -tracer.number([self.gain]) * y**3, x


class Kinder(Saturated):
    """Has a say of its own."""

    def command(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return 0.5 * super().command(t, x, y)


def test_laws_of_ones_own_are_asked_or_left_alone():
    assert lowered(Own()) is None
    assert lowered(Saturated(Own(), {"torque": 1.0})) is None
    assert lowered(Kinder(Sampled(PID, H), {"torque": 1.0})) is None
    assert lowered(as_controller(FIRST)) is None  # continuous
    found = lowered(Saturated(Telling(3.0), {"torque": 1.0}))
    for y in (0.3, 0.9, -2.0):
        expected = np.clip(-3.0 * y**3, -1.0, 1.0)
        assert float(found.kernel.function()(y, found.values)) == pytest.approx(expected)


def test_laws_of_one_form_share_their_code():
    kernels = [
        lowered(Saturated(Sampled(pd(k, 1.0, measured="a", rate="b", command="u"), H), {"u": k})) for k in (1, 2)
    ]
    assert str(kernels[0].kernel.outputs) == str(kernels[1].kernel.outputs)
    assert not np.array_equal(kernels[0].values, kernels[1].values)


def test_a_large_law_stays_with_numpy():
    n = 80
    large = ct.ss(-np.eye(n), np.ones((n, 1)), np.ones((1, n)), 0.0, H, inputs=["angle"], outputs=["torque"])
    assert lowered(as_controller(large)) is None
    assert fc.Saturated(large, {"torque": 1.0}).command(0.0, np.ones(n), np.zeros(1)) == 1.0
