"""A minimal set as a whole: what it leaves out would not make it cheaper; a looser demand makes it no dearer."""

import tomllib
from functools import cache

import pytest
from scenes import TROLLEY

import flexctrl as fc
import flexctrl.study.trials as trials_module
from flexctrl.scene.files import scene_from
from flexctrl.scene.reading import Place
from flexctrl.study.answers import answer_of, change_between
from flexctrl.study.omissions import omissions
from flexctrl.study.subject import prepared
from flexctrl.study.trials import Trial, timed

CLEARLY, COUNTED = 1.7, 1.08
"""By what factors runs are apart that are told apart here, somewhat more than for the ledger: by the clock, counted."""

ARM = """
name = "arm"
planar = "z"
[sections.link]
shape = "tube"
material = "steel"
radius = 0.03
thickness = 0.002
[elements]
arm = { kind = "beam", start = [0,0,0], end = [1.5,0,0], section = "link", elements = 2 }
tip = { kind = "point_mass", at = "arm.end", mass = 5.0 }
[[joints]]
kind = "support"
node = "arm.start"
held = "u v"
[[joints]]
kind = "pin"
first = "arm.end"
second = "tip"
[drives]
motor = { kind = "rotary", node = "arm.start", axis = "z", stiffness = 1, ratio = 80, inertia = 2e-3, damping = 1e-3 }
[inputs]
torque = { kind = "motor_torque", drive = "motor" }
[outputs]
angle = { kind = "drive_angle", drive = "motor" }
speed = { kind = "drive_speed", drive = "motor" }
tip_y = { kind = "position", at = "tip", direction = "y" }
[effects]
flexible = true
large_rotation = true
rayleigh_damping = { alpha = 0.0, beta = 5e-4 }
backlash = { motor = 0.05 }
coulomb_friction = { motor = 0.05 }
viscous_friction = { motor = 1e-3 }
motor_lag = { motor = 2e-3 }
[moves]
go = { kind = "minimum_jerk", distance = 1.0, duration = 1.0, at = 0.1 }
[[controllers]]
kind = "pid"
measured = "angle"
rate = "speed"
command = "torque"
kp = 3.0
kd = 0.15
reference = { move = "go", through = "motor" }
[hardware]
sample_time = 0.002
limits = { torque = 5.0 }
[simulation]
until = 0.4
tolerance = { relative = 1e-4, absolute = 1e-6 }
every = 0.01
start = "equilibrium"
"""

ROUGH = """
coulomb_friction = { travel_drive = 1e-3 }
backlash = { travel_drive = 1e-4 }
"""

SCENES = {"arm": ARM, "trolley": TROLLEY, "rubbing": TROLLEY.replace("[effects]", "[effects]" + ROUGH)}
DEMANDS = {"strict": 0.01, "curves": fc.Within(outputs=0.01), "loose": fc.Within(outputs=0.05)}


@cache
def scene(name):
    """Under a sampled law that saturates; the arm and the rubbing trolley with friction and play."""
    content = tomllib.loads(SCENES[name])
    content["simulation"]["until"] = 0.4
    return prepared(scene_from(content, Place(f"{name}.toml"), name), 0.01, "ledger")


@cache
def drawn_up(name, demand):
    return fc.ledger(scene(name), DEMANDS[demand])


def cheaper(first, second):
    """Whether a scene is clearly quicker than another, or counts less and is not clearly slower."""
    models = [one.model for one in (first, second)]
    rounds = [[timed(*each) for each in zip((first, second), models, strict=True)] for _ in range(8)]
    times = [min(taken for _, taken in runs) for runs in zip(*rounds, strict=True)]
    pace = times[1] / times[0]
    exact = [isinstance(one.simulation.method, fc.Exact) for one in (first, second)]
    sampled = [bool(getattr(one.law, "sample_time", 0.0)) for one in (first, second)]
    if any(exact) or sampled[0] != sampled[1]:
        return pace > CLEARLY  # their steps do not count alike
    works = [
        Trial(s, run, [t], m, run).size.work for s, (run, t), m in zip((first, second), rounds[0], models, strict=True)
    ]
    return pace > CLEARLY or (pace > 1.0 / CLEARLY and works[1] > COUNTED * works[0])


def keeps(answer, other, within):
    """Whether an answer changes by no more than is borne."""
    change = change_between(answer, answer_of(other, other.run()))
    return change.outputs_worst <= within.outputs and not (
        change.poles > within.poles or change.margins > within.margins
    )


@pytest.mark.long
@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize("demand", DEMANDS)
def test_what_is_left_out_would_not_make_the_run_cheaper(name, demand):
    """One by one, with what cannot be beside it left out still; unless the answer would change by too much."""
    found, items = drawn_up(name, demand), omissions(scene(name))
    gone = [o for o in items if not found[o.name].keep]
    for one in gone:
        less = scene(name)
        for other in gone:
            if other is not one and one.name not in other.first:
                less = other.without(less)
        if one.is_in(less) and keeps(found.full, less, found.within):
            assert not cheaper(less, found.scene), one.name


@pytest.mark.long
@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize(("strict", "loose"), [("strict", "curves"), ("curves", "loose"), ("strict", "loose")])
def test_a_looser_demand_is_met_no_dearer(name, strict, loose):
    assert not cheaper(drawn_up(name, strict).scene, drawn_up(name, loose).scene)


@pytest.mark.long
def test_what_costs_more_than_it_saves_does_not_go_with_others(monkeypatch):
    """Without the limit a run takes a tenth, without samples three times as long: without both, less than with both."""

    def taking(scene, model):
        limited, sampled = isinstance(scene.law, fc.Saturated), bool(scene.law.sample_time)
        return timed(scene, model)[0], (1e3 if limited else 1e2) * (1.0 if sampled else 3.0)

    monkeypatch.setattr(trials_module, "timed", taking)
    found = fc.ledger(scene("trolley"), fc.Within(outputs=0.9))
    assert found["sampled"].change.outputs_worst < 0.9
    assert found["sampled"].stays == "dearer without it"
    assert not found["saturated"].keep
