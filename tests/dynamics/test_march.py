"""Marched steps are the plain ones: fixed and controlled, under samples, on every kind of machine."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.cranes.ceiling_crane import MEMBER
from flexctrl.dynamics.alpha.point import Coefficients
from flexctrl.dynamics.alpha.steps import Stepper
from flexctrl.dynamics.feed import feed_of
from flexctrl.dynamics.march.loops import run as tasks
from flexctrl.dynamics.march.making import Method
from flexctrl.dynamics.march.marching import Marcher
from flexctrl.dynamics.march.record import DONE, FIXED, SETTLE
from flexctrl.dynamics.march.stepper import MarchingStepper
from flexctrl.errors import ControllerError

sys.path.insert(0, str(Path(__file__).parents[1] / "laws"))
from machines import bridle, double_girder, four_bar, machine

pytest.importorskip("llvmlite")

EFFECTS = (fc.Gravity(), fc.LargeRotation(), fc.RayleighDamping(0.1, 0.002))
TIGHT = fc.Tolerance(relative=1e-3, absolute=1e-10)
FIXED_STEPS = fc.GeneralizedAlpha(2e-3)
PACES = {"fixed": FIXED_STEPS, "controlled": fc.AdaptiveAlpha(first_step=1e-3)}
TREES = {f"tree{seed}": machine(seed, 5) for seed in (1, 3, 7, 10)}


def crane() -> fc.Model:
    return fc.assemble(fc.cranes.ceiling_crane(), [fc.Gravity(), fc.Flexible(), fc.LargeRotation()])


def both(model: fc.Model, monkeypatch: pytest.MonkeyPatch, **how) -> tuple[fc.dynamics.run.Run, fc.dynamics.run.Run]:
    """A run by compiled marches, and one by plain steps."""
    marched = fc.simulate(model, **how)
    with monkeypatch.context() as patch:
        patch.setattr("flexctrl.dynamics.alpha.method._quickest", lambda plain: plain)
        return marched, fc.simulate(model, **how)


def alike(a, b, tolerance: float = 1e-7) -> None:
    assert a.status is b.status
    assert (a.report.steps, a.report.rejected_steps) == (b.report.steps, b.report.rejected_steps)
    assert np.allclose(a.t, b.t, rtol=1e-6, atol=0.0)  # where steps are controlled they feel Newton's last digits
    scale = np.abs(b.y).max(axis=0, initial=1.0)
    assert (np.abs(a.y - b.y) < tolerance * scale).all()
    assert np.allclose(a.u, b.u, rtol=1e-7, atol=1e-7)
    for part in ("x", "R", "q"):
        assert np.allclose(getattr(a.final, part), getattr(b.final, part), rtol=0.0, atol=tolerance)
    assert len(a.frames) == len(b.frames)
    assert a.report.energy.work == pytest.approx(b.report.energy.work, rel=1e-6, abs=1e-9)
    assert a.report.energy.dissipated == pytest.approx(b.report.energy.dissipated, rel=1e-6, abs=1e-9)


@pytest.mark.parametrize("pace", PACES)
@pytest.mark.parametrize("name", TREES)
def test_marched_runs_are_plain_runs(name, pace, monkeypatch):
    """Hinges, slides, pins, drives, bodies, ropes and springs, bending beams, damping; inputs from the start on."""
    model = fc.assemble(TREES[name], [*EFFECTS, fc.Flexible()])
    how = {"until": 0.1, "inputs": {"force": 2.0, "torque": 0.5}, "method": PACES[pace], "tolerance": TIGHT}
    alike(*both(model, monkeypatch, **how))


def test_rigid_machines_march(monkeypatch):
    model = fc.assemble(TREES["tree7"], EFFECTS)
    alike(*both(model, monkeypatch, until=0.2, inputs={"force": 2.0}, method=FIXED_STEPS, tolerance=TIGHT))


@pytest.mark.parametrize("pace", PACES)
@pytest.mark.parametrize("machine", [four_bar, bridle, double_girder])
def test_rigid_loops_march(machine, pace, monkeypatch):
    """One loop and several, with drives behind rigid shafts; steps are marched but near dead points."""
    model, taken = fc.assemble(machine(), [fc.Gravity(), fc.LargeRotation()]), []
    how = {"until": 0.2, "inputs": {"push": 1.0}, "method": PACES[pace], "tolerance": TIGHT}
    with monkeypatch.context() as patch:
        plain = Stepper.step
        patch.setattr(Stepper, "step", lambda self, point, h: taken.append(h) or plain(self, point, h))
        fc.simulate(model, **how)
    a, b = both(model, monkeypatch, **how)
    assert len(taken) < 0.1 * a.report.steps
    alike(a, b)
    assert a.report.closure_error < 1e-10


def test_follower_loads_march(monkeypatch):
    beam = fc.Beam("arm", (0, 0, 0), (1, 0, 0), MEMBER, elements=3)
    push = fc.FollowerForce("push", beam.end, (0.0, 0.2, 1.0))
    tip = fc.Position("tip", beam.end, "z")
    model = fc.assemble(fc.Structure([beam], [fc.Support(beam.start)], [], [push], [tip]), [fc.Flexible(), *EFFECTS])
    alike(*both(model, monkeypatch, until=0.1, inputs={"push": 300.0}, method=FIXED_STEPS, tolerance=TIGHT))


@pytest.mark.parametrize("pace", PACES)
@pytest.mark.parametrize("every", [4e-3, 3.1e-3])
def test_rows_between_steps_are_the_same(every, pace, monkeypatch):
    how = {"until": 0.05, "inputs": {"push": 500.0}, "method": PACES[pace], "tolerance": TIGHT, "every": every}
    a, b = both(crane(), monkeypatch, **how)
    assert np.allclose(np.diff(a.t[:-1]), every)
    alike(a, b)


@pytest.mark.parametrize("pace", PACES)
def test_states_within_a_run_are_the_same(pace, monkeypatch):
    """They are not kept but made again."""
    how = {"until": 0.05, "inputs": {"push": 500.0}, "method": PACES[pace], "tolerance": TIGHT}
    a, b = both(crane(), monkeypatch, **how)
    for t in (0.0, 0.01234, 0.02, 0.0499, 0.05):
        assert np.allclose(a.at(t).state.x, b.at(t).state.x, rtol=0.0, atol=1e-9)


def test_a_start_elsewhere_has_the_accelerations_of_its_own_state():
    """A stepper that has been on the way starts anew in another state under the same inputs."""
    model = fc.assemble(TREES["tree3"], EFFECTS)
    feed = feed_of(model, None, np.ones(len(model.inputs)))
    stepper = fc.GeneralizedAlpha(1e-3).stepper(model, feed, fc.Tolerance())
    assert isinstance(stepper, MarchingStepper)
    supply = feed.first(model.rest)
    point = stepper.start(model.rest, supply, 1e-3)
    for _ in range(20):
        point = stepper.step(point, 1e-3)
    thrown = model.rest.with_(v=np.random.default_rng(2).normal(size=model.n))
    for state in (thrown, point.state, model.rest):
        found, right = (s.start(state, supply, 1e-3).rate for s in (stepper, stepper.plain))
        assert np.abs(found - right).max() < 1e-6 * np.abs(right).max()


@dataclass(frozen=True)
class Brake:
    """Pushes against the travel, sampled; its state counts the samples, its command stops at times."""

    sample_time: float = 4e-3
    inputs: ClassVar[tuple[str, ...]] = ("travel",)
    outputs: ClassVar[tuple[str, ...]] = ("push",)

    def initial(self) -> np.ndarray:
        return np.zeros(1)

    def command(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.array([100.0 - 900.0 * y[0] if x[0] % 3 else 50.0])

    def update(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return x + 1.0


@pytest.mark.parametrize("pace", PACES)
@pytest.mark.parametrize("every", [None, 5e-3])
def test_sampled_controllers_are_ridden_with(pace, every, monkeypatch):
    how = {"controller": Brake(), "until": 0.06, "method": PACES[pace], "tolerance": TIGHT, "every": every}
    a, b = both(crane(), monkeypatch, **how)
    alike(a, b)
    for t in (0.004, 0.011, 0.0123, 0.05):
        assert np.allclose(a.at(t).state.x, b.at(t).state.x, rtol=0.0, atol=1e-8)
        assert a.at(t)["push"] == pytest.approx(b.at(t)["push"], rel=1e-5)


def test_runs_go_on_bit_for_bit():
    """As if they had not been stopped, whatever tangents were in use."""
    for method in PACES.values():
        how = {"method": method, "tolerance": TIGHT}
        for model, inputs in ((crane(), {"push": 500.0}), (fc.assemble(TREES["tree3"], EFFECTS), {"force": 3.0})):
            whole = fc.simulate(model, until=0.06, inputs=inputs, **how)
            half = fc.simulate(model, until=0.03, inputs=inputs, **how)
            rest = fc.simulate(model, until=0.06, start=half.checkpoint, inputs=inputs, **how)
            assert np.array_equal(rest.final.q, whole.final.q)
            assert np.array_equal(rest.final.R, whole.final.R)
            assert rest.report.steps == whole.report.steps


def test_a_step_that_cannot_be_solved_fails_as_plain_ones_do(monkeypatch):
    model = crane()
    start = model.rest.with_(v=1e7 * np.cos(np.arange(model.n)))
    a, b = both(model, monkeypatch, until=0.1, start=start, method=fc.GeneralizedAlpha(0.05))
    assert a.status is b.status is fc.Status.FAILED
    assert np.isfinite(a.y).all()


def test_marches_start_where_plain_steps_do():
    model = fc.assemble(TREES["tree10"], [*EFFECTS, fc.Flexible()])
    rng = np.random.default_rng(1)
    state = model.displace(0.2 * rng.normal(size=model.n)).with_(v=rng.normal(size=model.n))
    feed = feed_of(model, None, rng.normal(size=len(model.inputs)))
    plain = Stepper(model, feed, Coefficients.of(0.9), 1e-12)
    first = feed.first(state)
    a, b = MarchingStepper(plain).start(state, first, 1e-3), plain.start(state, first, 1e-3)
    assert np.allclose(a.rate, b.rate, rtol=0.0, atol=1e-9 * np.abs(b.rate).max())
    assert np.array_equal(a.rate, a.algorithmic)


def test_the_march_runs_uncompiled():
    """The same functions by Python on plain records."""
    model = crane()
    feed = feed_of(model, None, model.input_vector({"push": 500.0}))
    plain = Stepper(model, feed, Coefficients.of(0.9), 1e-10)
    method = Method(plain.coefficients, plain.tolerance, plain.weight, plain.turning)
    stepper = MarchingStepper(plain)
    point = stepper.start(model.rest, feed.first(model.rest), 1e-4)
    compiled, slow = Marcher(model, method), Marcher(model, method)
    record = slow.march._record
    assert compiled.entered(point).fixed(1e-4, 6) == DONE
    slow.entered(point)
    record.t, record.h, record.wanted, record.lean = 0.0, 1e-4, 6, point.lean
    for record.task in (SETTLE, FIXED):
        assert tasks(record) == DONE
    m = compiled.march
    assert (record.newton, record.factorisations, record.done) == (m.newton, m.factorisations, 6)
    for name in ("v", "rate", "algorithmic", "reach", "rows"):
        ours, theirs = getattr(record, name), getattr(m, name)
        assert np.allclose(ours, theirs, rtol=0.0, atol=1e-12 * max(1.0, np.abs(theirs).max()))
    assert record.gained == pytest.approx(m.gained, rel=1e-12)


@pytest.mark.parametrize(
    "effects",
    [
        [fc.Flexible(), fc.LargeRotation()],
        [fc.Flexible()],
        [fc.Flexible(), fc.LargeRotation(), fc.ModalDamping(0.01)],
    ],
)
def test_models_march_where_kernels_are_compiled_only(effects):
    arm = fc.Beam("arm", (0, 0, 0), (1, 0, 0), MEMBER)
    model = fc.assemble(fc.Structure([arm], [fc.Support(arm.start)]), effects)
    stepper = FIXED_STEPS.stepper(model, feed_of(model, None, np.zeros(0)), TIGHT)
    assert isinstance(stepper, MarchingStepper)
    plain = FIXED_STEPS.stepper(model.with_(backend=fc.CasadiVM()), feed_of(model, None, np.zeros(0)), TIGHT)
    assert not isinstance(plain, MarchingStepper)


@pytest.mark.parametrize("every", [None, 4e-3])
def test_controllers_read_at_every_step_are_ridden_with(every, monkeypatch, tmp_path):
    """Inputs that jump at every step: rows, states within, books, what a stream writes."""
    brake = Brake(sample_time=FIXED_STEPS.step)
    how = {"controller": brake, "until": 0.06, "method": FIXED_STEPS, "tolerance": TIGHT, "every": every}
    a, b = both(crane(), monkeypatch, **how)
    alike(a, b)
    for t in (0.004, 0.011, 0.0123, 0.05):
        assert np.allclose(a.at(t).state.x, b.at(t).state.x, rtol=0.0, atol=1e-8)
    fc.simulate(crane(), **how, record=fc.CsvStream(tmp_path / "rows.csv"))
    written = np.genfromtxt(tmp_path / "rows.csv", delimiter=",", skip_header=1)
    assert np.allclose(written, np.column_stack([a.t, a.y, a.u]), rtol=1e-9, atol=1e-12)


def test_samples_go_on_bit_for_bit():
    """A run stopped between two samples and resumed, with inputs that jump at every second step."""
    how = {"controller": Brake(), "method": FIXED_STEPS, "tolerance": TIGHT}
    whole = fc.simulate(crane(), until=0.06, **how)
    half = fc.simulate(crane(), until=0.03, **how)
    rest = fc.simulate(crane(), until=0.06, start=half.checkpoint, **how)
    assert np.array_equal(rest.final.q, whole.final.q)
    assert np.array_equal(rest.final.R, whole.final.R)


def test_states_for_drawing_stay_within_their_room(monkeypatch):
    """Large machines have room for a few states in one call only."""
    how = {"until": 0.05, "inputs": {"push": 500.0}, "method": FIXED_STEPS, "tolerance": TIGHT}
    ample = fc.simulate(crane(), **how)
    monkeypatch.setattr("flexctrl.dynamics.march.making._BYTES", 3 * 8 * 400)
    tight = fc.simulate(crane(), **how)
    assert np.array_equal(ample.y, tight.y)
    assert [state.t for state in ample.frames] == [state.t for state in tight.frames]


def test_runs_leave_nothing_to_the_next_one():
    """Runs of a model share a workspace, one after the other."""
    model, how = crane(), {"until": 0.03, "inputs": {"push": 500.0}, "method": FIXED_STEPS}
    first = fc.simulate(model, **how)
    fc.simulate(model, until=0.02, inputs={"push": -300.0}, method=FIXED_STEPS)
    again = fc.simulate(model, **how)
    assert np.array_equal(first.y, again.y)
    assert first.report.newton_iterations == again.report.newton_iterations
    assert np.array_equal(first.at(0.0123).state.R, again.at(0.0123).state.R)


def test_a_command_of_the_wrong_length_is_refused():
    class Two(Brake):
        def command(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
            return np.zeros(2)

    with pytest.raises(ControllerError, match="2 values"):
        fc.simulate(crane(), Two(), until=0.01, method=FIXED_STEPS)
