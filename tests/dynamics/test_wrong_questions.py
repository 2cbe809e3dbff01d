"""What a run cannot be asked: the message names the argument, its value and what was expected."""

from __future__ import annotations

import functools
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from long_running import Servo, arm

import flexctrl as fc
from flexctrl.design import pd
from flexctrl.errors import MechanismError, StructureError


@pytest.fixture(scope="module")
def model() -> fc.Model:
    bob = fc.RigidBody("bob", (0, 0, -1), 1.0, (1e-3,) * 3, points={"top": (0, 0, 0)})
    structure = fc.Structure(
        [bob],
        [fc.Support(bob.point("top"), "u v w rx rz")],
        inputs=[fc.Force("push", bob.node, "x")],
        outputs=[fc.Rotation("swing", bob.node, "y")],
    )
    return fc.assemble(structure, [fc.Gravity(), fc.LargeRotation()], fc.CasadiVM())


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"until": "x"}, "until = 'x'; expected seconds > 0"),
        ({"until": True}, "until = True; expected seconds > 0"),
        ({"every": "a"}, "every = 'a'; expected seconds > 0"),
        ({"start": "a"}, "start = 'a'; expected a State"),
        ({"start": np.zeros(3)}, "start = array([0., 0., 0.]); expected a State"),
        ({"method": "x"}, "method = 'x'; expected a method with its parameters, as GeneralizedAlpha(1e-3)"),
        ({"method": fc.GeneralizedAlpha}, "GeneralizedAlpha'>; expected a method with its parameters"),
        ({"tolerance": 1e-4}, "tolerance = 0.0001; expected a Tolerance, as Tolerance(relative=1e-5)"),
        ({"events": fc.Event("top", "swing")}, "expected a list: events=[Event(…)]"),
        ({"events": 3}, "events = 3; expected a list"),
        ({"events": "a"}, "events = 'a'; expected a list"),
        ({"record": "x.csv"}, "record = 'x.csv'; expected InMemory() or CsvStream('run.csv')"),
        ({"autosave": "x"}, "autosave = 'x'; expected an Autosave, as Autosave('run.checkpoint')"),
        ({"progress": 1}, "progress = 1; expected a function"),
        ({"events": [fc.Event("top", lambda signals: np.nan)]}, "event 'top': its function gives nan"),
        ({"events": [fc.Event("top", lambda signals: signals["x"])]}, "event 'top': its function raised KeyError: 'x'"),
        ({"events": [fc.Event("late", "t", 0.5)]}, "no signal 't'; the time is no signal: until=… ends a run at one"),
        ({"events": [fc.Event("late", lambda y: y["t"])]}, "KeyError: 't'; the time is no signal: until=… ends a run"),
        ({"events": [fc.Event("top", lambda y: y["swing"] > 0.5)]}, "event 'top': its function gives False; expected"),
        ({"events": [fc.Event("top", lambda y: np.array(True))]}, "that goes through 0 where it happens: write lambda"),
        ({"events": [fc.Event("top", lambda y: "1")]}, "event 'top': its function gives '1'; expected a number"),
    ],
    ids=lambda v: next(iter(v)) if isinstance(v, dict) else "",
)
def test_arguments_of_another_kind_are_refused(model, wrong, message):
    with pytest.raises(StructureError, match=re.escape(message)):
        fc.simulate(model, **{"until": 0.01, **wrong})


def test_several_times_are_asked_one_by_one(model):
    run = fc.simulate(model, until=0.02)
    with pytest.raises(StructureError, match=r"at: t = array\(.*\); expected one time, \[run.at\(t\) for t in …\]"):
        run.at(np.array([0.0, 0.01]))
    assert [run.at(t).t for t in (0.0, np.float64(0.01))] == [0.0, 0.01]


def test_a_rest_of_another_machine_is_refused(model):
    bar = fc.Beam("bar", (0, 0, 0), (1, 0, 0), fc.Section.tube(fc.STEEL, 0.03, 0.002))
    other = fc.assemble(fc.Structure([bar], [fc.Support(bar.start)]), [fc.Flexible()], fc.CasadiVM())
    with pytest.raises(StructureError, match=r"start: the state.s q has the shape .6,., .* another machine"):
        fc.simulate(model, until=0.01, start=fc.equilibrium(other))


def test_a_rest_is_no_start_of_a_linear_model(model):
    """Its state counts from that place: the sag would be counted twice."""
    rest = fc.equilibrium(model)
    with pytest.raises(StructureError, match="a linear model's state counts from where it was made"):
        fc.simulate(fc.linearize(model, rest), until=0.01, start=rest)


def test_what_is_no_model_is_refused():
    with pytest.raises(StructureError, match="model = 'crane'; expected a Model"):
        fc.simulate("crane", until=1.0)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: fc.GeneralizedAlpha("1e-3"), "GeneralizedAlpha: step = '1e-3'; expected seconds > 0"),
        (lambda: fc.GeneralizedAlpha(1e-3, "high"), "generalised alpha: rho = 'high'; expected a number"),
        (lambda: fc.AdaptiveAlpha(first_step="a"), "AdaptiveAlpha: first_step = 'a'; expected seconds > 0"),
        (lambda: fc.ExplicitRungeKutta("a"), "ExplicitRungeKutta: step = 'a'; expected seconds > 0"),
        (lambda: fc.ExplicitRungeKutta(largest_step=0), "ExplicitRungeKutta: largest_step = 0; expected seconds > 0"),
        (lambda: fc.Tolerance("a"), "Tolerance: relative = 'a'; expected a number ≥ 0"),
        (lambda: fc.Tolerance(absolute=0.0), "Tolerance: absolute = 0.0; expected a number > 0"),
        (lambda: fc.InMemory("a"), "InMemory: bytes of states = 'a'; expected a number ≥ 0"),
        (lambda: fc.CsvStream(3), "CsvStream: path = 3; expected the name of a file"),
        (lambda: fc.Autosave("x", "a"), "Autosave: seconds = 'a'; expected seconds > 0"),
        (lambda: fc.Autosave(None), "Autosave: path = None; expected the name of a file"),
        (lambda: fc.Event("top", 3), "event 'top': of = 3; expected the name of a signal or a function"),
        (lambda: fc.Event("top", "swing", direction="up"), "direction = 'up'; expected one of Direction.RISING"),
        (lambda: fc.Event("top", lambda t, y: t), "event 'top': its function is called with one argument, a mapping"),
        (lambda: fc.Event("top", lambda: 1.0), "is called with one argument"),
        (lambda: fc.Event(3, "swing"), "event 3: expected a name"),
        (lambda: fc.Event("", "swing"), "event '': expected a name"),
    ],
)
def test_values_that_cannot_be_are_refused_where_they_are_made(make, message):
    with pytest.raises(StructureError, match=re.escape(message)):
        make()


def beyond(least, signals):
    return signals["swing"] - least


@functools.wraps(beyond)
def decorated(signals):
    return beyond(0.1, signals)


@pytest.mark.parametrize(
    "of", [max, np.sum, len, lambda *y: 1.0, lambda y, k=2: k, decorated, fc.Event("top", "swing").value]
)
def test_any_function_of_one_argument_may_be_an_event(of):
    assert fc.Event("top", of).of is of


def test_an_event_that_is_no_number_later_ends_the_run(model):
    """What was computed until then is kept."""
    start = model.rest.with_(v=np.array([1.0]))
    event = fc.Event("deep", lambda signals: np.sqrt(0.1 - signals["swing"]) if signals["swing"] < 0.1 else np.nan)
    run = fc.simulate(model, until=1.0, start=start, events=[event], method=fc.GeneralizedAlpha(1e-2))
    assert run.status is fc.Status.FAILED
    assert "event 'deep': its function gives nan" in run.report.message
    assert 0.05 < run.t[-1] < 0.12


BROKEN = {"empty": b"", "text": b"hello", "zip": b"PK\x03\x04" + 100 * b"x", "half": None}


@pytest.mark.parametrize("content", BROKEN.values(), ids=BROKEN)
def test_files_that_are_no_checkpoints(model, tmp_path: Path, content):
    path = tmp_path / "run.checkpoint"
    fc.simulate(model, until=0.01).checkpoint.save(path)
    path.write_bytes(path.read_bytes()[:3000] if content is None else content)
    with pytest.raises(StructureError, match=r"is no checkpoint: .*give a file that Checkpoint.save wrote") as told:
        fc.load_checkpoint(path)
    assert "pickle" not in str(told.value)


def test_a_run_goes_on_as_it_was_asked_for_and_not_backwards(model):
    stopped = fc.simulate(model, until=0.1).checkpoint
    with pytest.raises(StructureError, match=rf"until = .* s is before the checkpoint, which is at {stopped.t:.9g} s"):
        fc.simulate(model, until=0.5 * stopped.t, start=stopped)
    with pytest.raises(StructureError, match="the checkpoint is of another tolerance"):
        fc.simulate(model, until=0.2, start=stopped, tolerance=fc.Tolerance(1e-6))
    with pytest.raises(StructureError, match=r"another spacing of rows \(every\) \(None there, 0.05 here\)"):
        fc.simulate(model, until=0.2, start=stopped, every=0.05)
    assert fc.simulate(model, until=0.2, start=stopped).status is fc.Status.FINISHED


EVENT = fc.Event("e", "swing", 0.1)


@pytest.mark.parametrize(
    ("events", "message"),
    [
        ([], r"another number of events \(1 there, 0 here\)"),
        ([fc.Event("other", "swing", 0.1)], r"another event \('e': swing through 0.1 there, 'other': swing .* here\)"),
        ([fc.Event("e", "push", 0.1)], "another event .* 'e': push through 0.1 here"),
        ([fc.Event("e", "swing", 0.3, terminal=True)], "another event .* 'e': swing through 0.3 here"),
        ([fc.Event("e", "swing", 0.1, fc.Direction.FALLING)], "another event .* 'e': swing falling through 0.1 here"),
        ([fc.Event("e", lambda y: y["swing"], 0.1)], "another event .* 'e': a function through 0.1 here"),
    ],
    ids=["none", "name", "signal", "value", "direction", "function"],
)
def test_a_run_goes_on_with_the_events_that_it_had(model, events, message):
    """Which side of its value a signal is on was noted for these."""
    stopped = fc.simulate(model, until=0.1, events=[EVENT]).checkpoint
    with pytest.raises(StructureError, match=f"simulate: the checkpoint is of {message}.*give what the run had"):
        fc.simulate(model, until=0.2, start=stopped, events=events)


def test_whether_an_event_ends_a_run_may_change_where_it_goes_on(model, tmp_path: Path):
    """It ends where a run ends that had it so all the time."""
    start, path = model.rest.with_(v=np.array([1.0])), tmp_path / "run.checkpoint"
    fc.simulate(model, until=0.05, start=start, events=[EVENT]).checkpoint.save(path)
    starts, ending = (start, fc.load_checkpoint(path)), [replace(EVENT, terminal=True)]
    once, ended = (fc.simulate(model, until=0.3, start=begun, events=ending) for begun in starts)
    assert ended.status is once.status is fc.Status.STOPPED
    assert np.array_equal(ended.final.q, once.final.q)
    assert ended["swing"][-1] == pytest.approx(0.1, abs=1e-9)


def test_a_checkpoint_of_another_version_is_told(model, tmp_path: Path, monkeypatch):
    path = tmp_path / "run.checkpoint"
    fc.simulate(model, until=0.01).checkpoint.save(path)
    monkeypatch.setattr("flexctrl.dynamics.checkpoint._FORMAT", 0)
    with pytest.raises(StructureError, match=r"^\S+ is a checkpoint of another version of flexctrl .*the run anew$"):
        fc.load_checkpoint(path)


def test_a_run_goes_on_under_the_law_and_the_inputs_that_it_had():
    """Told by where the run stops: what it commands is not looked at."""
    spring, mass = fc.Spring("spring", (0, 0, 0), (1, 0, 0), stiffness=100.0), fc.PointMass("mass", (1, 0, 0), 1.0)
    structure = fc.Structure(
        [spring, mass],
        [fc.Support(spring.start), fc.Pin(spring.end, mass.node), fc.Support(mass.node, "v w")],
        inputs=[fc.Force("force", mass.node, "x"), fc.Force("load", mass.node, "x")],
        outputs=[fc.Position("x", mass.node, "x"), fc.Velocity("v", mass.node, "x")],
    )
    model = fc.assemble(structure, [fc.LargeRotation()])
    law = pd(kp=5.0, kd=1.0, measured="x", rate="v", command="force")
    laws = [None, fc.Sampled(law, 0.01), fc.Sampled(law, 0.02), law]
    for controller in laws:
        half = fc.simulate(model, controller, until=0.1, inputs={"load": 1.0}).checkpoint
        runs = [fc.simulate(model, controller, until=0.2, start=half, inputs=u) for u in (None, {}, {"load": 1.0})]
        assert all(np.array_equal(run.y, runs[0].y) for run in runs)
        assert runs[0]["load"][-1] == 1.0
        with pytest.raises(StructureError, match=r"the checkpoint is of another set of inputs .*50.0"):
            fc.simulate(model, controller, until=0.2, start=half, inputs={"load": 50.0})
        for other in laws:
            if other is not controller:
                with pytest.raises(StructureError, match="the checkpoint is of another controller"):
                    fc.simulate(model, other, until=0.2, start=half)


class Unasked(Servo):
    """A law that must not be asked."""

    def initial(self):
        raise AssertionError("asked")

    def command(self, t, x, y):
        raise AssertionError("asked")


INNER = [fc.MotorLag({"motor": 0.05}), fc.LuGreFriction({"motor": fc.LuGre(1e3, 0.2)})]


@pytest.mark.parametrize("effect", INNER, ids=lambda e: type(e).__name__)
@pytest.mark.parametrize("method", [fc.AdaptiveAlpha(), fc.GeneralizedAlpha(1e-3)], ids=lambda m: type(m).__name__)
def test_a_checkpoint_of_another_model_is_told_before_anything_is_asked_or_written(tmp_path, effect, method):
    """Models with and without freedoms of an effect's own, the law and its signals the same; so is what is written."""
    models, stream = (arm(effect), arm()), fc.CsvStream(tmp_path / "rows.csv")
    for one, other in (models, models[::-1]):
        how = {"method": method, "record": stream}
        half = fc.simulate(one, Servo(), until=0.01, **how)
        written = stream.path.read_bytes()
        with pytest.raises(StructureError, match="the checkpoint is of another model"):
            fc.simulate(other, Unasked(), until=0.02, start=half.checkpoint, **how)
        assert stream.path.read_bytes() == written


@pytest.mark.parametrize("speed", [1e200, -1e60, 1e49, 1e20])
def test_a_start_beyond_all_numbers_is_blamed(model, speed):
    with pytest.raises(StructureError, match=r"the state's v holds .*, outside any sensible range: .* below 1e\+15"):
        fc.simulate(model, until=1.0, start=model.rest.with_(v=np.array([speed])))


def test_steps_longer_than_the_motion_do_not_finish(model):
    """A pendulum of 2 s in steps of 10 s reaches its end and is none: it fails; in steps of 10 ms there is no word."""
    start = model.rest.with_(v=np.array([2.0]))
    coarse, fine = (
        fc.simulate(model, until=until, start=start, method=fc.GeneralizedAlpha(step))
        for step, until in ((10.0, 100.0), (1e-2, 1.0))
    )
    assert coarse.report.energy_residual > 0.5
    assert coarse.status is fc.Status.FAILED
    assert coarse.t[-1] == pytest.approx(100.0)
    assert "the motion is not resolved" in coarse.report.message
    assert "take steps smaller than 10 s" in str(coarse.report)
    assert fine.status is fc.Status.FINISHED
    assert fine.report.notes == model.notes


def test_what_the_methods_own_damping_takes_is_noted(model):
    """The same in steps of 0.4 s with ρ = 0, until it hangs still: all its energy is gone, none was made."""
    start = model.rest.with_(v=np.array([2.0]))
    run = fc.simulate(model, until=400.0, start=start, method=fc.GeneralizedAlpha(0.4, rho=0.0))
    assert run.report.energy_residual > 0.5
    assert run.report.energy.gap < 0.0
    assert run.status is fc.Status.FINISHED
    assert any("the motion is not resolved" in note for note in run.report.notes)


@pytest.mark.parametrize("backend", [fc.CasadiVM(), None], ids=["plain", "compiled"])
def test_what_a_method_without_damping_loses_is_not_resolved(backend):
    """A pendulum that swings wide in steps of 0.6 s with ρ = 1 loses a quarter: no damping of its own took that."""
    bob = fc.RigidBody("bob", (0, 0, -1), 1.0, (1e-3,) * 3, points={"top": (0, 0, 0)})
    structure = fc.Structure([bob], [fc.Support(bob.point("top"), "u v w rx rz")])
    model = fc.assemble(structure, [fc.Gravity(), fc.LargeRotation()], backend)
    start = model.rest.with_(v=np.array([4.0]))
    coarse, fine = (
        fc.simulate(model, until=20.0, start=start, method=fc.GeneralizedAlpha(step, rho=1.0)) for step in (0.6, 0.01)
    )
    assert coarse.report.energy.gap < -0.2 * coarse.report.energy.start
    assert coarse.status is fc.Status.FAILED
    assert "the motion is not resolved" in coarse.report.message
    assert fine.status is fc.Status.FINISHED
    assert not fine.report.notes


def test_what_midpoints_lose_is_not_resolved_either():
    """Two links that whirl by 5 rad in each step, in the middle of which forces say little."""
    upper = fc.RigidBody("upper", (0, 0, -0.5), 1.0, (0.1,) * 3, points={"top": (0, 0, 0), "end": (0, 0, -1)})
    lower = fc.RigidBody("lower", (0, 0, -1.5), 1.0, (0.1,) * 3, points={"top": (0, 0, -1)})
    joints = [fc.Support(upper.point("top"), "u v w rx rz"), fc.Hinge(upper.point("end"), lower.point("top"), "y")]
    model = fc.assemble(fc.Structure([upper, lower], joints), [fc.Gravity(), fc.LargeRotation()])
    start = model.rest.with_(v=np.array([8.0, 0.0]))
    run = fc.simulate(model, until=6.0, start=start, method=fc.ConservingMidpoint(0.6))
    assert run.report.energy.gap < 0.0
    assert run.report.energy_residual > 0.2
    assert run.status is fc.Status.FAILED
    assert "take steps smaller than 0.6 s" in run.report.message


def test_states_of_effects_are_not_asked_for_mass():
    wheel = fc.RigidBody("wheel", (0, 0, 0), 1.0, (0.1, 0.1, 0.1))
    drive = fc.RotaryDrive("drive", wheel.node, axis="z", stiffness=5.0, ratio=3.0, inertia=0.02)
    structure = fc.Structure(
        [wheel], [fc.Support(wheel.node, "u v w rx ry")], [drive], [fc.MotorTorque("torque", drive)]
    )
    lagging = fc.assemble(structure, [fc.LargeRotation(), fc.ShaftElasticity(), fc.MotorLag({"drive": 0.05})])
    with pytest.raises(MechanismError, match=r"drive_lag is no motion but a state of an effect .* implicit method"):
        fc.simulate(lagging, until=0.1, method=fc.ExplicitRungeKutta())


def test_a_checkpoint_knows_its_tolerance(model, tmp_path: Path):
    tolerance = fc.Tolerance(1e-6, 1e-9)
    stopped = fc.simulate(model, until=0.01, tolerance=tolerance).checkpoint
    stopped.save(tmp_path / "run.checkpoint")
    read = fc.load_checkpoint(tmp_path / "run.checkpoint")
    assert read.tolerance == tolerance


def test_events_of_one_name_cannot_be_told_apart(model):
    pair = [fc.Event("up", lambda y: 1.0, 0.5), fc.Event("up", lambda y: 1.0, 0.7)]
    with pytest.raises(StructureError, match="two events are named 'up'"):
        fc.simulate(model, until=1.0, events=pair)
