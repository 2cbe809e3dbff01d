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


class Slews:
    """Turns the jib as a position loop would."""

    sample_time = SAMPLE
    inputs = ("angle", "speed")
    outputs = ("slew",)

    def initial(self) -> np.ndarray:
        return np.zeros(0)

    def command(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.array([4e4 * (0.3 * t - y[0]) - 2e4 * y[1]])

    def update(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return x


def slewing_crane() -> tuple[fc.Model, fc.State]:
    """A load that is thrown up, so that its rope goes slack, under a jib that turns, in the wind."""
    jib = fc.RigidBody("jib", (0, 0, 20), 1e3, (1e5, 1e5, 1e5), points={"tip": (6, 0, 20)})
    load = fc.PointMass("load", (6, 0.2, 5), 2e3)
    rope = fc.Rope("rope", (6, 0, 20), (6, 0.2, 5), EA=3e6, length=14.99)
    joints = [fc.Support(jib.node, "u v w rx ry"), fc.Pin(rope.start, jib.point("tip")), fc.Pin(rope.end, load.node)]
    outputs = [fc.Rotation("angle", jib.node, "z"), fc.AngularVelocity("speed", jib.node, "z"), fc.Tension("T", rope)]
    inputs = [fc.Torque("slew", jib.node, "z")]
    plan = fc.Structure([jib, load, rope], joints, inputs=inputs, outputs=outputs)
    effects = [fc.Gravity(), fc.LargeRotation(), fc.RopeStretch(), fc.Wind({"load": 6.0}, speed=(9.0, -8.0, 0.0))]
    model = fc.assemble(plan, effects)
    v = np.zeros(model.n)
    v[next(i for i, name in enumerate(model.coordinates) if str(name).endswith("_w"))] = 4.0
    return model, model.rest.with_(v=v)


def test_what_a_slack_rope_lets_go_goes_on_with_the_same_bits():
    """All such cuts led to other last digits beyond the next corner: the impact was felt beside an earlier torque."""
    model, start = slewing_crane()
    how = {"controller": Slews(), "method": fc.Unchecked(fc.AdaptiveAlpha())}
    whole = fc.simulate(model, start=start, until=2.0, **how)
    assert len(whole.events) > 2
    for cut in np.arange(0.1, 1.95, 0.15):
        first = fc.simulate(model, start=start, until=cut, **how)
        rest = fc.simulate(model, start=first.checkpoint, until=2.0, **how)
        begin = len(whole.t) - len(rest.t)
        assert np.array_equal(rest.final.v, whole.final.v), f"cut at {cut:.2f} s"
        assert np.array_equal(rest.y, whole.y[begin:])
