"""The coordinates of `to_nlsys`: their rates move the machine exactly as its quasi-velocities do."""

from __future__ import annotations

import numpy as np
import pytest
from machines import machine

import flexctrl as fc
from flexctrl.model.nlsys import equations_of

STEP = 1e-5


@pytest.mark.parametrize("flexible", [False, True])
@pytest.mark.parametrize("seed", range(25))
def test_pose_moves_as_the_rates_say(seed, flexible):
    """d/dt pose(ξ) = T v for every node, by central differences of the pose along ξ̇."""
    effects = [fc.Flexible(), fc.LargeRotation()] if flexible else [fc.LargeRotation()]
    model = fc.assemble(machine(seed, parts=3), effects)
    chart, rng = equations_of(model).chart, np.random.default_rng(seed)
    xi, v = 0.6 * rng.normal(size=len(chart.names)), rng.normal(size=model.n)
    state = chart.state(xi, v)
    rate, _ = chart.rate(xi, state)
    ahead, behind = (chart.state(xi + s * STEP * rate, v) for s in (1.0, -1.0))
    moved, size = model.rates(state)[: 6 * len(state.x)].reshape(-1, 6), np.abs(v).max()
    velocity = (ahead.x - behind.x) / (2.0 * STEP)
    np.testing.assert_allclose(velocity, moved[:, :3], atol=1e-7 * size)
    turned = np.einsum("nij,nkj->nik", (ahead.R - behind.R) / (2.0 * STEP), state.R)
    spin = np.stack([turned[:, 2, 1], turned[:, 0, 2], turned[:, 1, 0]], axis=1)
    turning = [i for i, node in enumerate(model.structure.nodes) if len(node.freedoms) == 6]
    np.testing.assert_allclose(spin[turning], moved[turning, 3:], atol=1e-7 * size)
