"""Margins and peaks against closed forms and python-control, where that is right."""

from __future__ import annotations

import control as ct
import matplotlib as mpl
import numpy as np
import pytest
from plants import cantilever, chain, crane, plant

from flexctrl.errors import StructureError
from flexctrl.linear.reduction import BalancedTruncation, ModalTruncation
from flexctrl.study.frequency import loop_grid, margins, peak_gain
from flexctrl.study.loop import open_loop

mpl.use("Agg")


def mass() -> object:
    return plant([[1.0]], [[0.0]], [[1.0]], [[1.0]])


def test_double_integrator_with_a_derivative():
    """Reference case C11: kp = 1, kd = sqrt 2."""
    found = margins(open_loop(mass(), ct.tf([np.sqrt(2), 1], [1])))
    assert found.stable
    np.testing.assert_allclose(found.phase.omega, 1.553774, rtol=1e-6)
    np.testing.assert_allclose(found.phase.margin, 1.143718, rtol=1e-6)
    np.testing.assert_allclose(np.degrees(found.phase.margin), 65.53020, rtol=1e-6)
    np.testing.assert_allclose(found.delay.margin, 0.736090, rtol=1e-6)
    assert found.gain_up.margin == np.inf
    assert found.gain_down.margin == 0.0
    # 1/(1 + L) = s²/(s² + sqrt2 s + 1) is Butterworth: never above 1
    np.testing.assert_allclose(found.sensitivity.value, 1.0, rtol=1e-3)


def test_third_order_loop_in_closed_form():
    """6k/(s (s+1) (s+2)): phase crossing at sqrt 2, gain margin 6/6k."""
    for k in (0.25, 0.5):
        found = margins(open_loop(ct.ss(ct.tf([6 * k], [1, 3, 2, 0]))))
        np.testing.assert_allclose(found.gain_up.margin, 1 / k, rtol=1e-10)
        np.testing.assert_allclose(found.gain_up.omega, np.sqrt(2), rtol=1e-10)
        assert found.stable
    assert not margins(open_loop(ct.tf([6 * 1.01], [1, 3, 2, 0]))).stable


def test_a_crossing_far_beyond_all_resonances_is_a_margin():
    """(s + 0.1)/((s + 1)³ (s/100 + 1)) is small where it crosses, beyond the slow poles: python-control agrees."""
    plant, law = ct.tf([1.0], [1, 3, 3, 1]), ct.tf([1, 0.1], [0.01, 1])
    found = margins(open_loop(ct.ss(plant), law))
    np.testing.assert_allclose(found.gain_up.margin, ct.margin(plant * law)[0], rtol=1e-8)


@pytest.mark.parametrize("lag", [0.1, 1e-2, 1e-3, 1e-4])
def test_fast_roll_off_poles_bound_the_gain(lag):
    """(10 s + 5)/(5 s² (lag s + 1)²): stable below k = 1/lag − 1, by Routh."""
    loop = open_loop(plant([[5.0]], [[0.0]], [[1.0]], [[1.0]]), ct.tf([10.0, 5.0], [lag**2, 2 * lag, 1]))
    # 5 lag² s⁴ + 10 lag s³ + 5 s² + 10 k s + 5 k: Routh: (50 lag − 50 lag² k) 10 k = 500 lag² k
    np.testing.assert_allclose(margins(loop).gain_up.margin, 1 / lag - 1, rtol=1e-9)


@pytest.mark.parametrize("gain", [0.05, 0.4])
def test_small_loops_agree_with_python_control(gain):
    """A crane with drag: few states, where python-control's polynomials still hold."""
    linear = crane(1.0, 0.5, 2.0, drag=0.8)
    controller = ct.tf([gain], [0.2, 1])
    found = margins(open_loop(linear, controller, "force", "trolley"))
    loop = linear.select(outputs=["trolley"]).to_ss() * controller
    gm, pm, sm, wpc, wgc, wms = ct.stability_margins(loop)
    np.testing.assert_allclose(found.gain_up.margin, gm, rtol=1e-6)
    np.testing.assert_allclose(found.gain_up.omega, wpc, rtol=1e-6)
    np.testing.assert_allclose(np.degrees(found.phase.margin), pm, rtol=1e-6)
    np.testing.assert_allclose(found.phase.omega, wgc, rtol=1e-6)
    np.testing.assert_allclose(found.modulus.value, sm, rtol=1e-5)
    np.testing.assert_allclose(found.modulus.omega, wms, rtol=1e-2)
    np.testing.assert_allclose(found.sensitivity.value * found.modulus.value, 1.0, rtol=1e-12)


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_flexible_loop_of_a_hundred_and_thirty_states_where_python_control_gives_up():
    linear = cantilever(32, beta=1e-5)
    controller = ct.tf([0.02, 0], [1 / 300**2, 2 / 300, 1])
    loop = open_loop(linear, controller, "force", "tip")
    assert len(loop.A) == 130
    found = margins(loop)
    assert found.stable
    for crossing in found.phase_crossings:
        np.testing.assert_allclose(loop.at(np.array([crossing.omega]))[0], -1 / crossing.margin, rtol=1e-7)
    for crossing in found.gain_crossings:
        np.testing.assert_allclose(abs(loop.at(np.array([crossing.omega]))[0]), 1.0, rtol=1e-9)
    # the gain margin is where eigenvalues, an independent route, cross
    k = found.gain_up.margin
    assert loop.is_stable(k * (1 - 1e-6))
    assert not loop.is_stable(k * (1 + 1e-6))
    with pytest.raises((np.linalg.LinAlgError, ValueError)):
        ct.stability_margins(linear.select(outputs=["tip"]).to_ss() * controller)


def test_free_motion_that_the_loop_does_not_touch_does_not_count():
    """Sway feedback of a crane: the trolley's double integrator is outside the loop, not an instability."""
    loop = open_loop(crane(1.0, 0.5, 2.0), ct.tf([-0.3, 0], [1]), "force", "sway")
    assert len(loop.A) == 2
    assert margins(loop).stable
    assert not margins(open_loop(crane(1.0, 0.5, 2.0), ct.tf([0.3, 0], [1]), "force", "sway")).stable
    # the same through python-control, where the integrators stay in the states
    states = crane(1.0, 0.5, 2.0).select(outputs=["sway"]).to_ss() * ct.tf([-0.3, 0], [0.01, 1])
    assert open_loop(states).is_stable()


def test_delay_margin_is_where_a_delayed_loop_turns_unstable():
    """A third-order loop with a high-order Padé delay on either side of the margin."""
    plant_ = ct.tf([2.0], [1, 3, 2, 0])
    delay = margins(open_loop(plant_)).delay.margin
    for factor, stable in ((0.99, True), (1.01, False)):
        late = ct.ss(ct.tf(*ct.pade(factor * delay, 6)))
        assert open_loop(plant_, late).is_stable() is stable


def test_sampled_loop_stops_where_the_integrator_does():
    """Integrator, u = −K x with one sample of delay: stable below K h = 1 (case C11)."""
    h, gain = 0.1, 0.5
    body = ct.ss([[1.0, h], [0.0, 0.0]], [[0.0], [1.0]], [[1.0, 0.0]], [[0.0]], h)
    found = margins(open_loop(body, gain))
    np.testing.assert_allclose(found.gain_up.margin * gain * h, 1.0, rtol=1e-9)
    np.testing.assert_allclose(found.gain_up.omega, 2 * np.pi / (6 * h), rtol=1e-9)
    assert found.stable


def test_sampled_controller_samples_the_plant_exactly():
    """Double integrator with a sampled PD: L(z) = k h²/2 (z + 1)/(z − 1)² (1 + kd (z − 1)/(z h))."""
    h = 0.05
    controller = ct.tf([1 + 1.0 / h, -1.0 / h], [1, 0], h)
    loop = open_loop(mass(), controller)
    omega = np.array([0.3, 2.0, 20.0])
    z = np.exp(1j * omega * h)
    exact = h**2 / 2 * (z + 1) / (z - 1) ** 2 * (1 + (z - 1) / (z * h))
    np.testing.assert_allclose(loop.at(omega), exact, rtol=1e-9)
    assert loop.dt == h
    assert margins(loop).stable


def test_peak_gain_of_one_oscillator():
    """1/(2 ζ sqrt(1 − ζ²) ω²) at ω sqrt(1 − 2ζ²)."""
    zeta, omega = 0.05, 3.0
    linear = plant([[1.0]], [[omega**2]], [[1.0]], [[1.0]], C=[[2 * zeta * omega]])
    found = peak_gain(linear)
    np.testing.assert_allclose(found.value, 1 / (2 * zeta * np.sqrt(1 - zeta**2) * omega**2), rtol=1e-10)
    np.testing.assert_allclose(found.omega, omega * np.sqrt(1 - 2 * zeta**2), rtol=1e-6)


def test_peak_gain_of_an_integrator_is_infinite():
    """Reference case D25."""
    force_model = crane(59008.0, 65000.0, 25.0)
    for output in ("trolley", "load"):
        found = peak_gain(force_model.select(outputs=[output]))
        assert found.value == np.inf
        assert found.omega == 0.0
    sway = peak_gain(force_model.select(outputs=["sway"]))
    assert sway.value == np.inf
    np.testing.assert_allclose(sway.omega, 0.908100, rtol=1e-6)


def test_peak_gain_of_several_channels_is_the_largest_singular_value():
    linear = chain(4, beta=0.05)
    found = peak_gain(linear)
    w = np.sort(np.concatenate([np.geomspace(0.05, 5, 2000), [found.omega]]))
    H = np.moveaxis(linear.frequency_response(w).values, -1, 0)
    np.testing.assert_allclose(found.value, np.linalg.norm(H, 2, axis=(1, 2)).max(), rtol=1e-12)


def test_reduced_plants_close_loops_too():
    linear = cantilever(8, beta=1e-4).select(outputs=["tip"])
    controller = ct.tf([0.5, 0], [1e-4, 0.02, 1])
    full = margins(open_loop(linear, controller))
    for method in (ModalTruncation(9, static_correction=True), BalancedTruncation(18)):
        found = margins(open_loop(linear.reduce(method), controller))
        np.testing.assert_allclose(found.gain_up.margin, full.gain_up.margin, rtol=1e-2)
        np.testing.assert_allclose(found.phase.margin, full.phase.margin, rtol=1e-2)


def test_nyquist_and_nichols_of_python_control_take_the_data():
    loop = open_loop(chain(3, beta=0.05), 0.2, "force", "x1")
    omega, L = loop_grid(loop)
    data = loop.frd(omega)
    np.testing.assert_array_equal(data.frdata[0, 0], L)
    ct.nyquist_plot(data, warn_encirclements=False)
    ct.nichols_plot(data)
    mpl.pyplot.close("all")


def test_what_cannot_be_a_loop_is_refused():
    linear = chain(3)
    with pytest.raises(StructureError, match=r"which output of the plant\? Give output=, one of: x1, "):
        open_loop(linear, 1.0)
    with pytest.raises(StructureError, match=r"which input and output .* input=, one of: f, g and output=, one of"):
        open_loop(ct.ss([], [], [], np.ones((2, 2)), inputs=["f", "g"], outputs=["x", "v"]), 1.0)
    with pytest.raises(StructureError, match="'x9' is not a signal of the plant"):
        open_loop(linear, 1.0, output="x9")
    with pytest.raises(StructureError, match="2 degrees above"):
        open_loop(linear, ct.tf([1, 0, 0], [1]), output="x1")
    two = ct.ss([], [], [], [[1.0, 1.0]], inputs=["x", "v"], outputs=["f"])
    with pytest.raises(StructureError, match=r"has inputs x, v and outputs f; .* one input and one output"):
        open_loop(linear, two, output="x1")


@pytest.mark.parametrize("of", [lambda m: m, lambda m: m.reduce(BalancedTruncation(6)), lambda m: m.to_ss()])
def test_a_name_that_is_none_is_told_before_what_is_wrong_with_the_controller(of):
    wide = ct.ss([], [], [], [[1.0, 1.0]])
    model = of(chain(3))
    with pytest.raises(StructureError, match="'x9' is not a signal of the plant"):
        open_loop(model, wide, output="x9")
    with pytest.raises(StructureError, match="input 'force9' is not a signal of the plant"):
        open_loop(model, wide, "force9", "x1")


def test_a_loop_through_which_nothing_comes_back_has_no_crossing():
    """A push that does not move what is measured: all margins are without end, and no warning says so instead."""
    found = margins(open_loop(plant([[1.0]], [[0.0]], [[1.0]], [[0.0]]), ct.tf([np.sqrt(2), 1], [1])))
    assert found.gain_up.margin == np.inf
    assert found.phase.margin == np.inf
