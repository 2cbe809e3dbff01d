"""Loops cut open at one input, against python-control's interconnections."""

from __future__ import annotations

import control as ct
import numpy as np
import pytest
import scipy.sparse as sp

from flexctrl.design import (
    Commanded,
    ControllerError,
    Delayed,
    Noisy,
    OpenLoop,
    Quantised,
    Sampled,
    Saturated,
    Step,
    Together,
    Tracking,
    pd,
    pid,
)
from flexctrl.errors import StructureError
from flexctrl.linear.model import LinearModel
from flexctrl.study.broken_loop import broken_loop, linear_law
from flexctrl.study.frequency import margins

PAIR = LinearModel(
    M=sp.csc_matrix(np.diag([2.0, 1.0])),
    C=sp.csc_matrix(np.array([[0.3, -0.1], [-0.1, 0.2]])),
    K=sp.csc_matrix(np.array([[50.0, -30.0], [-30.0, 40.0]])),
    B=np.eye(2),
    Cq=np.vstack([np.eye(2), np.zeros((2, 2))]),
    Cv=np.vstack([np.zeros((2, 2)), np.eye(2)]),
    D=np.zeros((4, 2)),
    coordinates=("a", "b"),
    inputs=("push_a", "push_b"),
    outputs=("a", "b", "rate_a", "rate_b"),
    name="pair",
)
LAW_A = pid(30.0, 12.0, 4.0, measured="a", rate="rate_a", command="push_a")
LAW_B = pd(20.0, 3.0, measured="b", rate="rate_b", command="push_b")


def sorted_poles(poles):
    poles = np.asarray(poles, complex)
    return poles[np.lexsort((np.round(poles.imag, 8), np.round(poles.real, 8)))]


def test_closing_the_cut_loop_gives_the_poles_of_the_interconnection():
    loop = broken_loop(PAIR, Together(LAW_A, LAW_B), "push_a")
    whole = ct.interconnect([PAIR.to_ss(), LAW_A, LAW_B], inputs=["push_a"], outputs=["a"])
    np.testing.assert_allclose(sorted_poles(loop.closed_poles()), sorted_poles(whole.poles()), rtol=1e-8, atol=1e-8)


def test_the_cut_loop_is_minus_what_comes_back():
    loop = broken_loop(PAIR, Together(LAW_A, LAW_B), "push_a")
    inner = ct.interconnect([PAIR.to_ss(), LAW_B], inputs=["push_a"], outputs=["a", "rate_a"])
    omega = np.geomspace(0.1, 100.0, 60)
    expected = np.array([-(LAW_A(1j * w) @ inner(1j * w))[0, 0] for w in omega])
    np.testing.assert_allclose(loop.at(omega), expected, rtol=1e-9)


def test_a_sampled_loop_is_that_of_the_sampled_plant():
    T = 0.02
    loop = broken_loop(PAIR, Saturated(Sampled(LAW_B, T), {"push_b": 1.0}), "push_b")
    plant = ct.sample_system(PAIR.select(["push_b"], ["b", "rate_b"]).to_ss(), T)
    K = -LAW_B.D
    expected = np.linalg.eigvals(plant.A - plant.B @ K @ plant.C)
    np.testing.assert_allclose(sorted_poles(loop.closed_poles()), sorted_poles(expected), atol=1e-10)
    assert loop.dt == T


def test_every_sample_of_delay_turns_the_loop_back():
    T, omega = 0.02, np.geomspace(0.5, 100.0, 30)
    plain = broken_loop(PAIR, Sampled(LAW_B, T), "push_b").at(omega)
    late = broken_loop(PAIR, Delayed(Sampled(LAW_B, T), 3), "push_b").at(omega)
    np.testing.assert_allclose(late, plain * np.exp(-3j * omega * T), rtol=1e-9)


def test_the_gain_margin_is_where_the_closed_loop_turns_unstable():
    T = 0.05
    loop = broken_loop(PAIR, Delayed(Sampled(LAW_B, T), 1), "push_b")
    up = margins(loop).gain_up.margin
    assert np.abs(loop.closed_poles(up * (1 - 1e-6))).max() < 1.0 < np.abs(loop.closed_poles(up * (1 + 1e-6))).max()


def test_references_limits_and_rounding_do_not_change_the_law():
    law = Sampled(LAW_A, 0.01)
    wrapped = Quantised(Noisy(Saturated(Tracking(law, {"a": Step(1.0)}), {"push_a": 2.0}), {"a": 0.1}), {"a": 0.01})
    for name in ("A", "B", "C", "D"):
        np.testing.assert_array_equal(getattr(linear_law(wrapped), name), getattr(linear_law(law), name))


def test_reference_signals_are_no_measurements():
    law = ct.StateSpace([], [], [], [[-2.0, 2.0]], 0, inputs=["a", "wanted"], outputs=["push_a"])
    found = linear_law(Commanded(law, {"wanted": Step(1.0)}))
    assert found.inputs == ("a",)
    np.testing.assert_array_equal(found.D, [[-2.0]])


def test_loads_beside_a_law_do_not_change_its_loop():
    alone = broken_loop(PAIR, LAW_A, "push_a").at(np.array([3.0]))
    beside = broken_loop(PAIR, Together(LAW_A, OpenLoop({"push_b": Step(1.0)})), "push_a").at(np.array([3.0]))
    np.testing.assert_allclose(beside, alone, rtol=1e-12)


def test_what_cannot_be_cut_is_refused():
    with pytest.raises(StructureError, match="does not command 'push_c'; did you mean"):
        broken_loop(PAIR, Together(LAW_A, LAW_B), "push_c")

    class Own:
        inputs, outputs, sample_time = ("a",), ("push_a",), 0.0

        def initial(self):
            return np.zeros(0)

        def command(self, t, x, y):
            return -(y**3)

    with pytest.raises(ControllerError, match="no linear law"):
        broken_loop(PAIR, Own(), "push_a")
