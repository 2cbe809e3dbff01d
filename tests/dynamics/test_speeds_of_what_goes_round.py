"""A rigid pendulum that goes round, in default steps, against DOP853: its speeds are told as late as its places are."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import flexctrl as fc

GRAVITY = 9.81


def pendulum(length: float) -> fc.Model:
    top, load = fc.PointMass("top", (0, 0, 0), 1.0), fc.PointMass("load", (0, 0, -length), 1.0)
    rope = fc.Rope("rope", (0, 0, 0), (0, 0, -length), EA=1e6)
    plan = fc.Structure(
        [top, load, rope],
        [
            *(fc.Support(top.node, "u v w"), fc.Pin(top.node, rope.start)),
            *(fc.Pin(rope.end, load.node), fc.Support(load.node, "v")),
        ],
        outputs=[
            *(fc.Position("x", load.node, "x"), fc.Velocity("vx", load.node, "x")),
            fc.Velocity("vz", load.node, "z"),
        ],
    )
    return fc.assemble(plan, [fc.Gravity(), fc.LargeRotation()])


@pytest.mark.parametrize(
    ("length", "rate", "until"),
    [(2.923562934, 5.950561518, 12.4936), (2.326070805, 6.029813791, 10.4073), (1.568907877, 7.396745131, 10.5177)],
)
def test_speeds_are_told_as_late_as_places(length, rate, until):
    """They were 2 to 4 % off, told a seventh of that, where x was told 11 to 17 % and is 3 % off."""
    model = pendulum(length)
    spin = np.zeros(model.n)
    spin[list(model.coordinates).index("rope_0_ry")] = -rate
    run = fc.simulate(model, until=until, every=0.02, start=model.rest.with_(v=spin))
    true = solve_ivp(
        lambda t, y: [y[1], -GRAVITY / length * np.sin(y[0])],
        *((0.0, until), [0.0, rate]),
        method="DOP853",
        rtol=1e-12,
        atol=1e-12,
        t_eval=run.t,
    ).y
    speeds = {"vx": length * np.cos(true[0]) * true[1], "vz": length * np.sin(true[0]) * true[1]}
    for name, speed in speeds.items():
        off = np.abs(run[name] - speed).max() / np.ptp(speed)
        assert 0.01 < off < 0.05
        assert 0.5 * off < run.report.output_errors[name] < 10.0 * off
