"""Runs that go on from a sample: the law reads there what compiled loops have read, to the last digit."""

from __future__ import annotations

import numpy as np
import pytest

import flexctrl as fc

SAMPLE = 0.01


class Follows:
    """Drives both motors of the crane."""

    sample_time = SAMPLE
    inputs = ("drum", "drum_speed", "wheel", "wheel_speed")
    outputs = ("lift", "pull")

    def initial(self) -> np.ndarray:
        return np.zeros(0)

    def command(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        lift = -25.0 * 9.81 / 50.0 + 0.37 * (20.0 * np.sin(t) - y[0]) - 0.13 * y[1]
        return np.array([lift, 0.05 * (100.0 * min(t, 1.0) - y[2]) - 0.01 * y[3]])

    def update(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return x


def crane() -> fc.Model:
    """A load on a winch whose rope does not stretch, under a trolley on a soft drive."""
    trolley, load = fc.PointMass("trolley", (0, 0, 0), 7.0), fc.PointMass("load", (0.3, 0, -4), 25.0)
    winch = fc.Winch("hoist", load.node, trolley.node, EA=3e4, radius=0.1, ratio=5.0, inertia=0.016)
    shaft = {"radius": 0.05, "ratio": 3.0, "stiffness": 50.0, "inertia": 1e-3, "damping": 5e-3}
    drive = fc.LinearDrive("travel", trolley.node, direction="x", **shaft)
    plan = fc.Structure(
        [trolley, load],
        [fc.Support(trolley.node, "v w"), fc.Support(load.node, "v")],
        drives=[winch, drive],
        inputs=[fc.MotorTorque("lift", winch), fc.MotorTorque("pull", drive)],
        outputs=[
            fc.DriveAngle("drum", winch),
            fc.DriveSpeed("drum_speed", winch),
            fc.DriveAngle("wheel", drive),
            fc.DriveSpeed("wheel_speed", drive),
        ],
    )
    return fc.assemble(plan, [fc.Gravity(), fc.LargeRotation(), fc.ShaftElasticity()])


@pytest.mark.parametrize("method", [fc.AdaptiveAlpha(), fc.GeneralizedAlpha(4e-3)], ids=["adaptive", "fixed"])
def test_cut_at_any_sample_it_goes_on_with_the_same_bits(method, tmp_path):
    """Of such cuts one in seven led to other last digits: the drum's speed was read in another order of sums."""
    model, how = crane(), {"controller": Follows(), "method": fc.Unchecked(method)}
    whole = fc.simulate(model, until=1.0, **how)
    for k in range(1, 100, 2):
        first = fc.simulate(model, until=k * SAMPLE, **how)
        first.checkpoint.save(tmp_path / "cut")
        rest = fc.simulate(model, until=1.0, start=fc.load_checkpoint(tmp_path / "cut"), **how)
        begin = len(whole.t) - len(rest.t)
        assert np.array_equal(rest.final.v, whole.final.v), f"cut at {k} samples"
        assert np.array_equal(rest.final.x, whole.final.x)
        assert np.array_equal(rest.y, whole.y[begin:])
