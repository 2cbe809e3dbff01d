from __future__ import annotations

import pickle
import subprocess
import sys

import control as ct
import numpy as np
import pytest
from scipy.signal import cont2discrete

from flexctrl.design import Controller, ControllerError, Sampled, Saturated, Tracking, as_controller
from flexctrl.design.controller import LinearController

A = np.array([[-1.0, 2.0], [-3.0, -0.5]])
B = np.array([[1.0, 0.0], [0.5, 2.0]])
C = np.array([[1.0, -1.0]])
D = np.array([[0.25, -4.0]])


def system(dt: object = 0) -> ct.StateSpace:
    return ct.StateSpace(A, B, C, D, dt, inputs=["angle", "rate"], outputs=["torque"])


class Integrating:
    """An own controller: leaves out what it need not have."""

    inputs = ("angle",)
    outputs = ("torque",)

    def initial(self):
        return np.zeros(1)

    def command(self, t, x, y):
        return -x

    def rate(self, t, x, y):
        return y


def test_state_space_is_connected_by_name_with_its_own_signs():
    law = as_controller(system())
    x, y = np.array([0.3, -0.2]), np.array([1.0, 2.0])
    assert (law.inputs, law.outputs, law.sample_time) == (("angle", "rate"), ("torque",), 0.0)
    np.testing.assert_allclose(law.command(0.0, x, y), [0.3 + 0.2 + 0.25 - 8.0])
    np.testing.assert_allclose(law.rate(0.0, x, y), [-0.3 - 0.4 + 1.0, -0.9 + 0.1 + 0.5 + 4.0])


def test_transfer_function_has_the_poles_and_gain_of_its_polynomials():
    law = as_controller(ct.tf([2.0, 3.0], [1.0, 4.0, 5.0], inputs="angle", outputs="torque"))
    assert isinstance(law, LinearController)
    assert sorted(np.linalg.eigvals(law.A), key=np.imag) == pytest.approx([-2 - 1j, -2 + 1j])
    assert (law.D - law.C @ np.linalg.solve(law.A, law.B)).item() == pytest.approx(3 / 5)


@pytest.mark.parametrize("dt", [0, 0.01])
def test_time_base_is_kept(dt):
    assert as_controller(system(dt)).sample_time == dt


def test_static_gain_without_time_base_is_continuous():
    gain = ct.ss([], [], [], [[-2.0]], inputs=["angle"], outputs=["torque"])
    assert gain.dt is None
    assert as_controller(gain).sample_time == 0.0
    assert as_controller(ct.tf([3], [2], None, inputs="angle", outputs="torque")).sample_time == 0.0


@pytest.mark.parametrize(
    ("broken", "message"),
    [
        (lambda: system(True), "unspecified sample time"),
        (lambda: system(None), "no time base"),
        (lambda: ct.ss(A, B, C, D), "has the signal 'u\\[0\\]': give it inputs"),
        (lambda: ct.tf([1.0, 0.0], [1.0], inputs="angle", outputs="torque"), "improper.*filter the derivative"),
        (lambda: ct.frd([1.0, 2.0], [1.0, 2.0], inputs="angle", outputs="torque"), "cannot be run in time"),
        (lambda: object(), "it has no inputs, outputs, initial, command"),
        (lambda: ct.StateSpace(A * np.nan, B, C, D, 0, inputs=["a", "b"], outputs=["c"]), "A has entries"),
    ],
)
def test_what_cannot_be_run_is_refused_with_the_remedy(broken, message):
    with pytest.raises(ControllerError, match=message):
        as_controller(broken())


def test_several_channels_without_slicot_ask_for_a_state_space(monkeypatch):
    transfer = ct.tf([[[1.0], [2.0]]], [[[1.0, 1.0], [1.0, 2.0]]], inputs=["angle", "rate"], outputs=["torque"])

    def without_slicot(*_):
        raise ct.ControlMIMONotImplemented("needs slycot")

    monkeypatch.setattr(ct, "ss", without_slicot)
    with pytest.raises(ControllerError, match="StateSpace"):
        as_controller(transfer)


def test_a_class_is_told_to_be_made_first():
    with pytest.raises(ControllerError, match=r"Integrating is a class.*make one, as Integrating\(…\)"):
        as_controller(Integrating)


@pytest.mark.parametrize("what", ["inputs", "outputs"])
@pytest.mark.parametrize(
    ("given", "message"),
    [
        ("torque", r"'torque'; expected a tuple of names, as \('torque',\)"),
        (3, r"3; expected a tuple of names, as \('angle',\)"),
        (None, "None; expected a tuple"),
    ],
)
def test_a_name_alone_is_no_tuple_of_names(what, given, message):
    """Its letters were looked for."""
    law = Integrating()
    setattr(law, what, given)
    with pytest.raises(ControllerError, match=f"controller Integrating: {what} = {message}"):
        as_controller(law, ["torque"], ["angle"])


def test_unknown_names_are_answered_with_the_nearest():
    with pytest.raises(ControllerError, match=r"reads 'angle'.*did you mean 'angles'.*Commanded"):
        as_controller(system(), ["torque"], ["angles", "rate"])
    with pytest.raises(ControllerError, match=r"commands 'torque'.*did you mean 'torques'"):
        as_controller(system(), ["torques"], ["angle", "rate"])
    assert as_controller(system(), ["torque"], ["rate", "angle", "x"]).inputs == ("angle", "rate")


def test_nonlinear_io_system_runs_its_own_functions():
    law = as_controller(
        ct.nlsys(
            lambda t, x, u, p: -(x**3) + u,
            lambda t, x, u, p: 2 * x,
            inputs=["angle"],
            outputs=["torque"],
            states=1,
            dt=0,
        )
    )
    np.testing.assert_allclose(law.rate(0.0, np.array([2.0]), np.array([1.0])), [-7.0])
    np.testing.assert_allclose(law.command(0.0, np.array([2.0]), np.array([1.0])), [4.0])


def test_own_controllers_are_completed():
    law = as_controller(Integrating())
    assert isinstance(law, Controller)
    assert law.sample_time == 0.0
    np.testing.assert_allclose(law.rate(0.0, np.zeros(1), np.array([3.0])), [3.0])

    class Proportional(Integrating):
        initial = staticmethod(lambda: np.zeros(0))
        sample_time = 0.1

    assert as_controller(Proportional()).update(0.0, np.zeros(0), np.zeros(1)).size == 0


def test_own_controller_lacking_the_method_its_time_base_needs():
    class Clocked(Integrating):
        sample_time = 0.1

    with pytest.raises(ControllerError, match=r"sampled \(0.1 s\) and has states: it needs update"):
        as_controller(Clocked())

    class Unset(Clocked):
        update = None

    with pytest.raises(ControllerError, match=r"controller Unset is sampled .* it needs update"):
        as_controller(Unset())


@pytest.mark.parametrize(
    ("name", "given", "message"),
    [
        (
            "initial",
            np.zeros(2),
            r"Integrating: its initial is array\(.*no method; .*: def initial\(self\): return np.z",
        ),
        ("command", 3.0, r"its command is 3.0, no method; write it as one: def command\(self, t, x, y\)"),
    ],
)
def test_a_value_where_a_method_is_asked_for_is_told(name, given, message):
    law = Integrating()
    setattr(law, name, given)
    with pytest.raises(ControllerError, match=message):
        as_controller(law)


def test_a_method_that_is_not_needed_may_be_none():
    class Unset(Integrating):
        sample_time, update = 0.0, None

    assert as_controller(Unset()).rate(0.0, np.zeros(1), np.ones(1)) == 1.0


@pytest.mark.parametrize("h", [1e-3, 0.1, 2.0])
def test_sampling_a_linear_law_is_exact_for_held_measurements(h):
    law = Sampled(system(), h).controller
    reference = cont2discrete((A, B, C, D), h, method="zoh")
    for ours, theirs in zip((law.A, law.B, law.C, law.D), reference[:4], strict=True):
        np.testing.assert_allclose(ours, theirs, atol=1e-13)


def test_matrices_that_do_not_fit_the_names_are_refused():
    with pytest.raises(ControllerError, match=r"B must have the shape \(2, 2\), not \(2, 1\)"):
        LinearController(A, B[:, :1], C, D, ("angle", "rate"), ("torque",))


def test_importing_the_protocol_is_light():
    heavy = "('control', 'scipy', 'matplotlib', 'casadi')"
    code = f"import sys, flexctrl.design.controller; print([m for m in {heavy} if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_a_wrapped_controller_survives_pickling():
    law = Saturated(Sampled(Tracking(system(), {"angle": np.sin}), 0.01), {"torque": 0.5})
    copy = pickle.loads(pickle.dumps(law))
    x, y = np.array([0.1, 0.2]), np.array([0.05, 0.01])
    np.testing.assert_array_equal(copy.command(0.3, x, y), law.command(0.3, x, y))
    np.testing.assert_array_equal(copy.update(0.3, x, y), law.update(0.3, x, y))
