"""Pictures of frequency responses hold the data they are given, in the axes they are given."""

from __future__ import annotations

import control as ct
import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
import pytest
import scipy.sparse as sp

from flexctrl.errors import StructureError
from flexctrl.linear.model import LinearModel
from flexctrl.linear.reduction import ModalTruncation
from flexctrl.plots.frequency import plot_bode
from flexctrl.plots.loops import mark_margins, plot_nichols, plot_nyquist, plot_sensitivities
from flexctrl.plots.reduction import plot_reduction
from flexctrl.plots.root_locus import close_up, draw_root_locus, plot_root_locus
from flexctrl.study.frequency import loop_grid, margins
from flexctrl.study.loop import open_loop
from flexctrl.study.root_locus import root_locus

mpl.use("Agg")


@pytest.fixture(autouse=True)
def _closed():
    yield
    plt.close("all")


@pytest.fixture
def machine() -> LinearModel:
    """Three masses on springs, free to move; force on the first, first and last position out."""
    K = 9.0 * np.array([[1.0, -1.0, 0.0], [-1.0, 2.0, -1.0], [0.0, -1.0, 1.0]])
    M, C = (sp.csc_matrix(A) for A in (np.eye(3), 0.01 * K))
    outputs = np.eye(3)[[0, 2]]
    return LinearModel(
        M,
        C,
        sp.csc_matrix(K),
        np.eye(3)[:, :1],
        outputs,
        0 * outputs,
        np.zeros((2, 1)),
        ("a", "b", "c"),
        ("f",),
        ("x", "z"),
    )


def test_bode_of_rigid_and_flexible_lines_up_in_the_same_axes(machine):
    flexible = machine.frequency_response(span=(0.1, 20.0))
    rigid = machine.reduce(ModalTruncation(1)).linear.frequency_response(flexible.omega)
    axes = plt.subplots(2, 1)[1]
    drawn = plot_bode({"flexible": flexible, "rigid": rigid}, axes, channel=("x", "f"))
    assert drawn[0] is axes[0]
    assert drawn[1] is axes[1]
    for line, response in zip(axes[0].lines, (flexible, rigid), strict=True):
        np.testing.assert_allclose(line.get_xdata(), flexible.omega / (2 * np.pi))
        np.testing.assert_allclose(line.get_ydata(), 20 * np.log10(abs(response.channel("x", "f"))))
    # both start as a free mass: -180 degrees, not one at +180
    assert [round(line.get_ydata()[0]) for line in axes[1].lines] == [-180, -180]
    assert [text.get_text() for text in axes[0].get_legend().get_texts()] == ["flexible", "rigid"]


def test_bode_takes_python_control_data_and_asks_for_a_channel(machine):
    response = machine.frequency_response(span=(0.1, 20.0))
    gain, _ = plot_bode({"": response.to_control()}, channel=("z", "f"), decibel=False)
    np.testing.assert_allclose(gain.lines[0].get_ydata(), abs(response.channel("z", "f")))
    assert gain.get_yscale() == "log"
    with pytest.raises(StructureError, match=r"give \(output, input\)"):
        plot_bode({"": response})


def test_margins_are_marked_where_they_are(machine):
    loop = open_loop(machine, ct.tf([2.0, 1.0], [0.01, 1]), output="x")
    found = margins(loop)
    axes = mark_margins(plot_bode({"L": loop.frd(loop_grid(loop)[0])}), found)
    marked = axes[1].lines[-1]
    np.testing.assert_allclose(marked.get_xdata(), found.phase.omega / (2 * np.pi))
    np.testing.assert_allclose(np.ptp(marked.get_ydata()), abs(np.degrees(found.phase.margin)))


def test_nyquist_touches_the_modulus_circle(machine):
    loop = open_loop(machine, ct.tf([2.0, 1.0], [0.01, 1]), output="x")
    found = margins(loop)
    ax = plot_nyquist({"L": loop}, margins=found)
    curve = ax.lines[0].get_xydata()
    nearest = np.hypot(curve[:, 0] + 1, curve[:, 1]).min()
    np.testing.assert_allclose(nearest, ax.patches[1].get_radius(), rtol=1e-2)


def test_root_locus_draws_every_branch_and_the_critical_gain(machine):
    loop = open_loop(machine, ct.tf([1.0, 0.5], [0.1, 1]), output="z")
    locus = root_locus(loop)
    critical = locus.critical
    ax = plot_root_locus({"flexible": locus}, critical=critical)
    branches = [line for line in ax.lines if len(line.get_xdata()) == len(locus.gains)]
    assert len(branches) == len(loop.A)
    labels = {text.get_text() for text in ax.texts}
    shown = [c for c in critical if c.unstable_above and c.omega <= ax.get_ylim()[1]]
    assert labels == {f"k = {c.gain:.3g}" for c in shown}


def slow_and_fast(fast: float, unit: float = 1.0) -> dict:
    """An integrator and a swing at about 1 rad/s beside a vibration at a multiple of that, in some unit of time."""

    def pair(omega, zeta):
        return [1.0, 2.0 * zeta * omega * unit, (omega * unit) ** 2]

    plant = ct.tf(pair(0.8, 0.05), pair(1.0, 0.05)) * ct.tf(pair(0.8 * fast, 0.05), pair(fast, 0.05))
    plant = plant * ct.tf([0.5 * unit, 0.3 * unit**2], [1.0, 0.0, 0.0])
    return {"loop": root_locus(open_loop(plant), np.geomspace(1e-3, 30.0, 100))}


@pytest.mark.parametrize("fast", [50.0, 300.0, 2000.0])
def test_slow_poles_beside_fast_ones_are_drawn_large_enough_to_be_told_apart(fast):
    """In one of the views the swing is well inside, and farther from the origin than a tenth of its height."""
    figure = plt.figure(figsize=(9.0, 6.5))
    draw_root_locus(figure, slow_and_fast(fast), "loop")
    whole, near = figure.axes
    assert whole.get_ylim()[1] > fast
    assert 0.1 < 1.0 / near.get_ylim()[1] < 0.95
    left, right = near.get_xlim()
    assert left < -0.05 < 0.0 < right
    assert whole.patches[0].get_bbox().bounds[2:] == pytest.approx((right - left, 2.0 * near.get_ylim()[1]))


def test_what_is_about_as_fast_is_drawn_once():
    figure = plt.figure(figsize=(9.0, 6.5))
    draw_root_locus(figure, slow_and_fast(2.0), "loop")
    assert len(figure.axes) == 1
    assert close_up(slow_and_fast(2.0)) is None


@pytest.mark.parametrize("fast", [3.0, 30.0, 1000.0])
def test_where_stability_ends_is_shown_however_far_above_the_poles(fast):
    """1 rad/s of swing under two lags at a multiple of that: unstable near the lags' own rate."""
    plant = ct.ss(ct.tf([1.0, 0.5], [1.0, 0.1, 1.0])) * ct.ss(ct.tf([1.0], [1.0 / fast, 1.0])) ** 2
    locus = root_locus(open_loop(plant))
    (end,) = (c for c in locus.critical if c.unstable_above)
    assert end.omega > 0.8 * fast
    figure = plt.figure(figsize=(9.0, 6.5))
    draw_root_locus(figure, {"flexible": locus}, "loop", locus.critical)
    assert end.omega < 0.9 * figure.axes[0].get_ylim()[1]
    assert {text.get_text() for text in figure.axes[0].texts} == {f"k = {end.gain:.3g}"}
    assert any(0.05 < 1.0 / ax.get_ylim()[1] < 0.95 for ax in figure.axes)


@pytest.mark.parametrize("unit", [1e-3, 60.0])
def test_the_view_does_not_depend_on_the_unit_of_time(unit):
    assert close_up(slow_and_fast(300.0, unit)) == pytest.approx(unit * close_up(slow_and_fast(300.0)), rel=1e-3)


def test_nichols_passes_the_critical_point_at_the_margins(machine):
    loop = open_loop(machine, ct.tf([2.0, 1.0], [0.01, 1]), output="x")
    found = margins(loop)
    ax = plot_nichols({"L": loop})
    angle, size = ax.lines[0].get_data()
    crossed = np.flatnonzero(np.diff(np.sign(size)))
    share = size[crossed] / (size[crossed] - size[crossed + 1])
    margin = angle[crossed] + share * (angle[crossed + 1] - angle[crossed]) + 180.0
    expected = [np.degrees(g.margin) for g in found.gain_crossings]
    np.testing.assert_allclose((margin - expected + 180.0) % 360.0 - 180.0, 0.0, atol=0.5)
    assert ax.get_ylim() == (-40.0, 40.0)


def test_sensitivities_peak_at_ms_and_mt(machine):
    loop = open_loop(machine, ct.tf([2.0, 1.0], [0.01, 1]), output="x")
    found = margins(loop)
    ax = plot_sensitivities({"L": loop}, margins=found)
    for line, peak in zip(ax.lines, (found.sensitivity, found.complementary), strict=False):
        np.testing.assert_allclose(10 ** (line.get_ydata().max() / 20), peak.value, rtol=1e-3)


def test_reduction_shows_full_reduced_and_difference(machine):
    reduced = machine.reduce(ModalTruncation(2, static_correction=True))
    ax = plot_reduction(reduced, channel=("z", "f"))
    full, small, gap = (line.get_ydata() for line in ax.lines)
    assert len(full) == len(small) == len(gap)
    np.testing.assert_allclose(gap.max(), reduced.error.absolute[1, 0], rtol=0.05)
