"""What a controller says of its own state is looked at as its commands are."""

from __future__ import annotations

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.errors import ControllerError, StructureError

METHODS = [
    fc.AdaptiveAlpha(),
    fc.GeneralizedAlpha(1e-2),
    fc.Richardson(fc.GeneralizedAlpha(1e-2)),
    fc.ConservingMidpoint(1e-2),
    fc.ExplicitRungeKutta(),
]
ODD = [
    (np.array([0.0, np.nan]), "nan"),
    (None, "None; .* missing return"),
    (np.zeros(3), "3 values"),
    (np.zeros(1), "1 values"),
    ("abc", "'abc'"),
    (["1", "2"], "\\['1', '2'\\]"),
    (np.array([1j, 0.0]), "complex"),
    ([[0.0], [np.inf]], "inf"),
]


def swing() -> fc.Model:
    mass = fc.PointMass("mass", (0, 0, 0), 1.0)
    spring = fc.Spring("spring", (-1, 0, 0), mass.node, stiffness=40.0)
    joints = [fc.Support(spring.start), fc.Pin(spring.end, mass.node), fc.Support(mass.node, "v w")]
    outputs = [fc.Position("x", mass.node, "x")]
    return fc.assemble(
        fc.Structure([spring, mass], joints, [], [fc.Force("push", mass.node, "x")], outputs), [fc.LargeRotation()]
    )


class Forgetful:
    """A law whose command does not hang on its state, which is odd from some time on."""

    inputs, outputs = ("x",), ("push",)

    def __init__(self, sample_time: float, odd: object, after: float = 0.0, first: object = (0.0, 0.0)) -> None:
        self.sample_time, self.odd, self.after, self.first = sample_time, odd, after, first

    def initial(self) -> object:
        return self.first

    def command(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.ones(1)

    def update(self, t: float, x: np.ndarray, y: np.ndarray) -> object:
        return self.odd if t >= self.after else np.zeros(2)

    rate = update


@pytest.mark.parametrize("sample_time", [0.0, 0.1])
@pytest.mark.parametrize(("odd", "said"), ODD, ids=str)
def test_a_state_that_is_none_is_an_error_at_once(odd, said, sample_time):
    what = "update" if sample_time else "rate"
    with pytest.raises(ControllerError, match=said) as told:
        fc.simulate(swing(), Forgetful(sample_time, odd), until=1.0)
    assert f"{what} is" in str(told.value)


@pytest.mark.parametrize("method", METHODS, ids=str)
@pytest.mark.parametrize("odd", [np.array([0.0, np.nan]), None, np.zeros(3)], ids=str)
def test_later_it_ends_the_run_by_name(odd, method):
    run = fc.simulate(swing(), Forgetful(0.1, odd, 0.45), until=1.0, method=method)
    assert run.status is fc.Status.FAILED
    assert "controller Forgetful: its update is" in run.report.message
    assert "the 2 that its initial state has" in run.report.message
    assert 0.4 <= run.t[-1] <= 0.51
    assert np.isfinite(run.y).all()


def test_linear_models_look_too():
    linear = fc.linearize(swing())
    run = fc.simulate(linear, Forgetful(0.1, None, 0.45), until=1.0)
    assert run.status is fc.Status.FAILED
    assert "its update is None" in run.report.message


@pytest.mark.parametrize("sample_time", [0.0, 0.1])
@pytest.mark.parametrize(
    ("first", "said"), [(None, "None"), ([0.0, np.nan], "nan"), ("two", "'two'")], ids=["none", "nan", "text"]
)
def test_so_does_a_state_at_the_start(first, said, sample_time):
    with pytest.raises(ControllerError, match=f"controller Forgetful: its initial state is .*{said}"):
        fc.simulate(swing(), Forgetful(sample_time, np.zeros(2), 0.0, first), until=1.0)


@pytest.mark.parametrize("sample_time", [0.0, 0.1])
@pytest.mark.parametrize("said", ["1", b"1", ["1"], np.array("1")], ids=repr)
def test_a_text_is_no_command_though_a_number_can_be_read_out_of_it(said, sample_time):
    law = Forgetful(sample_time, np.zeros(2))
    law.command = lambda t, x, y: said
    with pytest.raises(ControllerError, match=r"the controller's command is .*1.*, a text; give real numbers"):
        fc.simulate(swing(), law, until=1.0)


def test_a_checkpoint_of_a_law_with_another_number_of_states_tells_that_these_are_meant():
    half = fc.simulate(swing(), Forgetful(0.1, np.zeros(2)), until=0.5).checkpoint
    with pytest.raises(StructureError, match=r"another controller, by how many states it has \(2 there, 1 here\)"):
        fc.simulate(swing(), Forgetful(0.1, np.zeros(1), first=[0.0]), until=1.0, start=half)


@pytest.mark.parametrize("shape", [(2,), (2, 1), (1, 2)])
def test_any_shape_of_as_many_numbers_will_do(shape):
    law = Forgetful(0.1, np.zeros(shape), 0.0, np.zeros(shape).tolist())
    assert fc.simulate(swing(), law, until=0.5).status is fc.Status.FINISHED


@pytest.mark.parametrize("every", [1e-12, 1e-300])
def test_rows_beyond_any_memory_are_refused(every):
    with pytest.raises(StructureError, match=r"every = 1e-.* rows of 3 numbers .* give every = 3e-11 s or more"):
        fc.simulate(swing(), until=0.01, every=every)
    with pytest.raises(StructureError, match=r"every = 1e-.* rows"):
        fc.simulate(fc.linearize(swing()), until=0.01, every=every)
