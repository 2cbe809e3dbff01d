"""D15: a sampled loop with delay at its stability boundary: no hidden extra sample.

A mass whose speed is held at zero by a sampled force that arrives d samples late: an integrator under u = −K x, stable
below K h = 2 sin(π/(2(2d + 1))). The loop runs in time; growth and period are those of the speed's own recurrence.
"""

from __future__ import annotations

import numpy as np
import pytest
from recorder import Absolute

import flexctrl as fc

PAGE = "hard"
SAMPLE, MASS = 0.01, 2.0
LIMITS = {0: 2.0, 1: 1.0, 2: 0.6180339887, 3: 0.4450418679, 4: 0.3472963554}
SOURCE = "roots of z^(d+1) − z^d + K h"


def speeds(gain: float, delay: int, samples: int = 3000) -> np.ndarray:
    """Speed at the samples of a closed loop in time, from 1 m/s."""
    import control

    body = fc.PointMass("body", (0, 0, 0), MASS)
    structure = fc.Structure(
        [body],
        [fc.Support(body.node, "v w")],
        inputs=[fc.Force("push", body.node, "x")],
        outputs=[fc.Velocity("speed", body.node, "x")],
    )
    model = fc.assemble(structure, [fc.LargeRotation()])
    law = control.ss([], [], [], [[-gain * MASS / SAMPLE]], SAMPLE, inputs=["speed"], outputs=["push"])
    start = model.rest.with_(v=np.ones(1))
    method = fc.GeneralizedAlpha(SAMPLE)
    run = fc.simulate(model, fc.Delayed(law, delay), until=samples * SAMPLE, start=start, method=method, every=SAMPLE)
    return run["speed"]


def dominant(x: np.ndarray) -> tuple[float, float]:
    """Modulus and period in samples of the oscillation that is left at the end: x₂ = 2 Re z x₁ − z z̄ x₀."""
    x = x[len(x) // 2 :]
    twice, square = np.linalg.lstsq(np.column_stack([x[1:-1], -x[:-2]]), x[2:], rcond=None)[0]
    size = float(np.sqrt(square))
    return size, float(2.0 * np.pi / np.arccos(np.clip(0.5 * twice / size, -1.0, 1.0)))


def exact(gain: float, delay: int) -> float:
    return float(np.abs(np.roots([1.0, -1.0, *[0.0] * (delay - 1), gain])).max())


@pytest.mark.parametrize("delay", [1, 2, 3, 4])
def test_it_decays_below_the_limit_and_grows_above(record, delay):
    limit = LIMITS[delay]
    below, above = (speeds(limit * share, delay) for share in (0.999, 1.001))
    record(
        f"D15 sampled loop, delay of {delay}: growth a sample at −0.1 %, +0.1 % of the limit",
        ours=[dominant(below)[0], dominant(above)[0]],
        reference=[exact(limit * share, delay) for share in (0.999, 1.001)],
        source=SOURCE,
        tolerance=1e-7,
    )
    assert np.abs(below[-100:]).max() < 0.8 * np.abs(below[:100]).max()
    assert np.abs(above[-100:]).max() > 1.2 * np.abs(above[:100]).max()


@pytest.mark.parametrize("delay", [1, 2])
def test_period_at_the_limit(record, delay):
    record(
        f"D15 sampled loop, delay of {delay}: period at the limit [samples]",
        ours=dominant(speeds(LIMITS[delay], delay, 600))[1],
        reference=2 * (2 * delay + 1),
        source="2(2d + 1)",
        tolerance=1e-6,
    )


def test_without_delay(record):
    """Beyond 2 the speed changes its sign every sample and grows; at 1 it is zero after one sample."""
    x = speeds(2.001, 0, 1000)
    record(
        "D15 sampled loop without delay: growth a sample at K h = 2.001",
        ours=-x[-1] / x[-2],
        reference=1.001,
        source="1 − K h",
        tolerance=1e-9,
    )
    record(
        "D15 sampled loop without delay: speed a sample after K h = 1",
        ours=speeds(1.0, 0, 5)[1],
        reference=0,
        source="1 − K h",
        tolerance=Absolute(1e-14),
    )
