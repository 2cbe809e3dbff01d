"""What the ledger leaves out has the names that scenes give it; what needs it goes first, and it has what it keeps."""

from __future__ import annotations

from itertools import permutations

import pytest

import flexctrl as fc
from flexctrl.design import pd
from flexctrl.errors import ControllerError
from flexctrl.scene.physics import EFFECTS
from flexctrl.study.omissions import omissions, snake

HARDWARE = {
    "sampled": lambda law: fc.Sampled(law, 0.01),
    "delayed": lambda law: fc.Delayed(law, 1),
    "rate_limited": lambda law: fc.RateLimited(law, {"torque": 30.0}),
    "noisy": lambda law: fc.Noisy(law, {"angle": 1e-2}, 3),
    "saturated": lambda law: fc.Saturated(law, {"torque": 2.0}),
    "quantised": lambda law: fc.Quantised(law, {"angle": 1e-3}),
}


def cart(*hardware: str) -> fc.Scene:
    """A cart on an elastic drive that a servo sends to one radian, with hardware from the inside out."""
    mass = fc.PointMass("cart", (0, 0, 0), 20.0)
    drive = fc.LinearDrive(
        "travel", mass.node, direction="x", radius=0.1, ratio=10.0, stiffness=50.0, inertia=1e-2, damping=0.02
    )
    structure = fc.Structure(
        [mass],
        [fc.Support(mass.node, "v w")],
        [drive],
        [fc.MotorTorque("torque", drive)],
        [fc.DriveAngle("angle", drive), fc.DriveSpeed("speed", drive), fc.Position("x", mass.node, "x")],
    )
    law = fc.Tracking(pd(3.0, 0.5, measured="angle", rate="speed", command="torque"), {"angle": lambda t: 1.0})
    for name in hardware:
        law = HARDWARE[name](law)
    effects = [fc.Flexible(), fc.LargeRotation()]
    return fc.Scene(structure, effects, law, simulation=fc.Simulation(until=0.2, every=0.02))


@pytest.mark.parametrize("name", EFFECTS)
def test_effects_have_one_name(name):
    assert snake(EFFECTS[name].make) == name


def test_hardware_goes_alone_or_after_what_needs_it_in_every_order():
    """From any nesting each kind goes by itself, or after what counts samples; the law itself is left at the end."""
    tried = 0
    for names in (p for count in (1, 2, 3, 4) for p in permutations(HARDWARE, count)):
        try:
            scene = cart(*names)
        except ControllerError:  # a delay of the samples of a continuous law
            continue
        tried += 1
        items = {o.name: o for o in omissions(scene)}
        for order in (names, names[::-1]):
            less = scene
            for name in order:
                assert items[name].is_in(scene)
                for each in (*items[name].first, name):
                    less = items[each].without(less)
                assert not items[name].is_in(less)
            assert type(less.law) is fc.Tracking
            assert less.law.sample_time == 0.0
    assert tried > 100


@pytest.mark.parametrize("hardware", ["delayed", "rate_limited", "noisy"])
def test_sampling_is_kept_under_what_counts_samples(hardware):
    scene = cart("sampled", "saturated", hardware)
    found = fc.ledger(scene, 1e-6)
    assert {hardware, "sampled"} <= set(found.minimal_set)
    assert found["sampled"].first == (hardware,)
    assert next(o for o in omissions(scene) if o.name == "sampled").is_in(found.scene)
    chosen = scene.with_(effects=[*scene.effects, fc.Automatic(1e-6)]).settled
    assert chosen.law.sample_time == 0.01
