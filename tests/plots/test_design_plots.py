from __future__ import annotations

import matplotlib as mpl
import numpy as np
import pytest

mpl.use("Agg")

from matplotlib.figure import Figure

from flexctrl.design import MinimumJerk, Shaped, Step, TrapezoidalVelocity, zv, zvd
from flexctrl.plots.design import shaper_impulses, shaper_sensitivity, trajectory_curves, trajectory_panels


@pytest.fixture
def ax():
    return Figure().add_subplot()


def test_sensitivity_curves_are_the_residuals(ax):
    shapers = {"ZV": zv(3.0), "ZVD": zvd(3.0)}
    assert shaper_sensitivity(ax, shapers, 3.0, span=(0.6, 1.4)) is ax
    for line, (label, shaper) in zip(ax.lines, shapers.items(), strict=False):
        ratio, percent = line.get_data()
        assert line.get_label() == label
        np.testing.assert_allclose(percent, 100 * shaper.residual(3.0 * ratio))
    assert ax.lines[-1].get_ydata()[0] == 5.0
    assert "%" in ax.get_ylabel()


def test_impulses_stand_at_their_times(ax):
    shaper = zvd(2.0)
    assert shaper_impulses(ax, shaper) is ax
    np.testing.assert_allclose(ax.lines[0].get_data(), [shaper.times, shaper.amplitudes])


def test_a_jump_is_drawn_as_one(ax):
    assert trajectory_curves(ax, {"step": Step(2.0, at=0.5003)}, 1.0) is ax
    t, value = ax.lines[0].get_data()
    assert set(value) == {0.0, 2.0}
    edge = np.flatnonzero(np.diff(value))[0]
    assert t[edge + 1] - t[edge] < 1e-8
    assert t[edge + 1] == 0.5003


def test_panels_show_the_derivatives():
    axes = Figure().subplots(3)
    move = Shaped(TrapezoidalVelocity(5.0, 1.0, 0.5), zv(2.0))
    assert trajectory_panels(axes, {"shaped": move, "smooth": MinimumJerk(5.0, 8.0)}, 12.0) is axes
    t, speed = axes[1].lines[0].get_data()
    np.testing.assert_allclose(speed, [move.rate(s) for s in t])
    t, acceleration = axes[2].lines[0].get_data()
    np.testing.assert_allclose(acceleration, [move.derivative.rate(s) for s in t])
    assert [ax.get_ylabel() for ax in axes] == ["position", "speed", "acceleration"]
