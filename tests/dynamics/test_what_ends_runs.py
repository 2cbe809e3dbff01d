"""What ends a run early keeps what was computed, and says why."""

from __future__ import annotations

import os
import re
import signal

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.dynamics.interrupt import Interruption
from flexctrl.errors import ControllerError, StructureError


def swing() -> fc.Model:
    spring, mass = fc.Spring("spring", (0, 0, 0), (1, 0, 0), stiffness=100.0), fc.PointMass("mass", (1, 0, 0), 1.0)
    structure = fc.Structure(
        [spring, mass],
        [fc.Support(spring.start), fc.Pin(spring.end, mass.node), fc.Support(mass.node, "v w")],
        inputs=[fc.Force("push", mass.node, "x")],
        outputs=[fc.Position("x", mass.node, "x")],
    )
    return fc.assemble(structure, [fc.LargeRotation()])


class Faulty:
    """A controller with a bug that shows after a while."""

    inputs, outputs = ("x",), ("push",)

    def __init__(self, sample_time: float, after: float, states: int = 0) -> None:
        self.sample_time, self.after, self.states = sample_time, after, states

    def initial(self) -> np.ndarray:
        return np.zeros(self.states)

    def command(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.array([{}["gain"] if not self.states and t >= self.after else 0.0])

    def rate(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return x * (1 // int(t < self.after))

    update = rate


@pytest.mark.parametrize("method", [None, fc.GeneralizedAlpha(1e-2), fc.ConservingMidpoint(1e-2)], ids=str)
@pytest.mark.parametrize("sample_time", [0.0, 0.1])
@pytest.mark.parametrize("states", [0, 1])
def test_a_controller_that_raises_ends_the_run_and_nothing_is_lost(method, sample_time, states):
    model = swing()
    start = model.displace([0.3])
    run = fc.simulate(model, Faulty(sample_time, 0.45, states), until=1.0, start=start, method=method, every=0.01)
    assert run.status is fc.Status.FAILED
    raised = "ZeroDivisionError" if states else "KeyError: 'gain'"
    assert f"the controller raised {raised}" in run.report.message
    assert "t = 0." in run.report.message
    assert isinstance(run.fault, ZeroDivisionError if states else KeyError)
    assert run.fault.__traceback__ is not None
    assert 0.35 < run.t[-1] <= 0.5
    assert run["x"] == pytest.approx(1.0 + 0.3 * np.cos(10.0 * run.t), abs=5e-3)


class Imaginary(Faulty):
    """A controller that forgot to take the real part."""

    def command(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.exp(1j * y) if t >= self.after else np.zeros(1)


@pytest.mark.parametrize("sample_time", [0.0, 0.1])
def test_complex_commands_end_a_run_by_name(sample_time):
    run = fc.simulate(swing(), Imaginary(sample_time, 0.25), until=1.0, method=fc.GeneralizedAlpha(1e-2))
    assert run.status is fc.Status.FAILED
    assert "the controller's command is complex" in run.report.message
    assert 0.2 <= run.t[-1] <= 0.31


def test_a_run_that_finishes_has_no_fault():
    assert fc.simulate(swing(), until=0.1).fault is None


def test_a_controller_that_raises_at_once_is_told_with_its_cause():
    with pytest.raises(ControllerError, match="raised KeyError") as told:
        fc.simulate(swing(), Faulty(0.1, 0.0), until=1.0)
    assert isinstance(told.value.__cause__, KeyError)


@pytest.mark.parametrize("until", [1e-300, 5e-324, 9e-51])
@pytest.mark.parametrize("method", [None, fc.GeneralizedAlpha(1e-3), fc.ExplicitRungeKutta()], ids=str)
def test_an_end_at_once_is_refused(until, method):
    with pytest.raises(StructureError, match="expected 1e-50 s at least"):
        fc.simulate(swing(), until=until, method=method)


class Odd(Faulty):
    """A controller whose commands are odd after a while."""

    def __init__(self, sample_time: float, late: object) -> None:
        super().__init__(sample_time, 0.45)
        self.late = late

    def command(self, t: float, x: np.ndarray, y: np.ndarray) -> object:
        return np.zeros(1) if t < self.after else self.late


@pytest.mark.parametrize("sample_time", [0.0, 0.1])
@pytest.mark.parametrize(("late", "said"), [(np.zeros(2), "has 2 values"), ("up", "a text"), (None, "command is None")])
def test_a_command_of_another_kind_ends_the_run_and_nothing_is_lost(late, said, sample_time):
    model = swing()
    run = fc.simulate(model, Odd(sample_time, late), until=1.0, start=model.displace([0.3]), every=0.01)
    assert run.status is fc.Status.FAILED
    assert said in run.report.message
    assert 0.35 < run.t[-1] <= 0.5
    assert run["x"] == pytest.approx(1.0 + 0.3 * np.cos(10.0 * run.t), abs=5e-3)


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
@pytest.mark.parametrize("method", [None, fc.GeneralizedAlpha(1e-2)], ids=str)
def test_a_command_beyond_all_numbers_fails_the_run(method):
    run = fc.simulate(swing(), Odd(0.1, np.array([1e300])), until=1.0, method=method)
    assert run.status is fc.Status.FAILED
    assert run.t[-1] >= 0.45


@pytest.mark.parametrize("method", [fc.AdaptiveAlpha(), fc.GeneralizedAlpha(1e-3)], ids=["adaptive", "fixed"])
def test_a_run_that_an_event_ended_goes_on_past_it_to_the_next(method):
    """From rest at 1 under a push the mass swings by 0.1 cos 10 t about 1.1: through 1.1 at π/20, 3π/20, …"""
    how = {"inputs": {"push": 10.0}, "method": method, "events": [fc.Event("middle", "x", at=1.1, terminal=True)]}
    run = fc.simulate(swing(), until=1.0, **how)
    for count in range(3):
        assert run.status is fc.Status.STOPPED
        assert [event.t for event in run.events] == [pytest.approx((2 * count + 1) * np.pi / 20, rel=2e-3)]
        run = fc.simulate(swing(), until=1.0, start=run.checkpoint, method=method, events=how["events"])
    assert run.status is fc.Status.FINISHED


def test_ctrl_c_is_kept_for_whoever_asks_and_a_second_one_is_not():
    """What is within knows what is kept around it."""
    with Interruption() as kept:
        with Interruption() as within:
            os.kill(os.getpid(), signal.SIGINT)
            assert kept.asked
            with pytest.raises(KeyboardInterrupt):
                within.check()
        with pytest.raises(KeyboardInterrupt):
            os.kill(os.getpid(), signal.SIGINT)
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def light(mass: float) -> fc.Model:
    """So light that the spring is all there is to hold it, and that only along itself."""
    spring = fc.Spring("spring", (0, 0, 0), (1, 0, 0), stiffness=1e3)
    body = fc.PointMass("mass", spring.end, mass)
    structure = fc.Structure([spring, body], [fc.Support(spring.start), fc.Pin(spring.end, body.node)])
    return fc.assemble(structure, [fc.LargeRotation(), fc.Gravity()])


@pytest.mark.parametrize("method", [fc.AdaptiveAlpha(), fc.GeneralizedAlpha(1e-3)], ids=str)
def test_a_singular_tangent_tells_its_time(method):
    run = fc.simulate(light(1e-200), until=1.0, method=method)
    assert run.status is fc.Status.FAILED
    assert re.search("(the tangent is singular|the motion is not resolved) at t = ", run.report.message)


def test_a_run_without_steps_has_nothing_between_them():
    run = fc.simulate(light(1e-200), until=1.0)
    assert run.report.steps == 0
    with pytest.raises(StructureError, match=r"ended before its first step \(failed: .* singular at t = "):
        run.at(0.0)
    for room in (0.0, 1e3):
        kept = fc.simulate(swing(), until=1.0, record=fc.InMemory(states=room))
        with pytest.raises(StructureError, match="steps of this run were not kept"):
            kept.at(0.0)


def test_a_beam_pressed_beyond_all_bounds_is_told_where_to_look():
    beam = fc.Beam(
        "b", (0, 0, 0), (1, 0, 0), fc.Section(EA=1e6, EI_y=10, EI_z=10, GJ=10, rhoA=1, rhoJ=1e-3), elements=8
    )
    structure = fc.Structure([beam], [fc.Support(beam.start)], inputs=[fc.Force("press", beam.end, "-x")])
    model = fc.assemble(structure, [fc.Flexible(), fc.LargeRotation(), fc.Gravity()])
    run = fc.simulate(model, until=1.0, inputs={"press": 1e9})
    assert re.search("the tangent is singular at t = .*; look at the loads and commands", run.report.message)
