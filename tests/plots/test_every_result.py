"""Every result can be plotted in one call, and the picture holds the result."""

from __future__ import annotations

import dataclasses
import inspect

import control as ct
import numpy as np
import pytest
from matplotlib.figure import Figure

import flexctrl as fc
from flexctrl.cranes import bridge_crane
from flexctrl.design import MinimumJerk, Shaper, Trajectory, convolve, zv, zvd

EFFECTS = (fc.Gravity(), fc.Flexible(), fc.LargeRotation(), fc.RayleighDamping(alpha=0.01, beta=1.5e-3))
NOT_RESULTS = {"State", "BranchPoint", "LimitPoint", "ErrorReport", "Checkpoint", "Projection"}
"""Public classes with arrays that are parts of a result that draws itself."""


@pytest.fixture(scope="module")
def model() -> fc.Model:
    return fc.assemble(bridge_crane(elements=2), EFFECTS)


@pytest.fixture(scope="module")
def linear(model) -> fc.LinearModel:
    return fc.linearize(model)


@pytest.fixture(scope="module")
def loop(linear) -> fc.Loop:
    return fc.open_loop(linear, ct.tf([200.0, 100.0], [0.05, 1.0]), "left_torque", "travel")


def written(figure: Figure) -> str:
    texts = [t for ax in figure.axes for t in (ax.title, *ax.texts)] + figure.texts + [figure._suptitle]
    return " ".join(t.get_text() for t in texts if t is not None)


@pytest.mark.parametrize("name", sorted(fc.__all__))
def test_public_results_have_plot(name):
    """A result is a frozen value with attributes that users do not make themselves."""
    cls = getattr(fc, name)
    found = inspect.isclass(cls) and dataclasses.is_dataclass(cls) and name not in NOT_RESULTS
    holds_arrays = found and any("ndarray" in str(f.type) for f in dataclasses.fields(cls))
    if holds_arrays and "Attributes\n" in (cls.__doc__ or ""):
        assert hasattr(cls, "plot"), "every result draws itself: give it plot(), see docs/api/plots.md"
        assert inspect.signature(cls.plot).return_annotation == "Figure"


@pytest.mark.parametrize("cls", [fc.Structure, fc.JoinTable, fc.Model, fc.Reduced, fc.Margins, Shaper, Trajectory])
def test_and_so_have_these(cls):
    assert inspect.signature(cls.plot).return_annotation == "Figure"


def test_structure_shows_its_drives(model):
    assert "left_drive" in written(model.structure.plot())


def test_join_table_has_a_colour_for_each_tied_freedom(model):
    ax = model.structure.join_table.plot().axes[0]
    numbers = [int(t.get_text().rstrip("~")) for t in ax.texts]
    rows = model.structure.join_table.rows
    assert numbers[: 6 * len(rows)] == [n for row in rows for n in row]
    faces = {n: p.get_facecolor() for n, p in zip(numbers, ax.patches, strict=False)}
    assert faces[1] == ax.patches[18].get_facecolor()  # girder and left carriage travel together
    assert faces[1] != faces[0]


def test_model_shows_what_bends(model):
    blue, rigid = (m.plot().axes[0].lines[0].get_color() for m in (model, fc.rigid(model)))
    assert (blue, rigid) == ("#1d4ed8", "#1f2937")


def test_rest_enlarges_small_displacements(model):
    rest = fc.equilibrium(model)
    figure = rest.plot()
    sag = -min(0.0, (rest.state.x - model.rest.x)[:, 2].min())
    assert f"{sag:.3g} m" in written(figure)
    assert "× 10" in written(figure)


def test_modes_are_drawn_on_the_machine(linear):
    modes = linear.modes()
    titles = [ax.get_title() for ax in modes.plot(4).axes]
    assert [t.split(":")[0] for t in titles] == ["3", "4", "5", "6"]  # the two rigid-body modes are left out


def test_modes_of_a_reduced_model_are_drawn_on_the_machine(linear):
    full = linear.modes()
    reduced = linear.reduce(fc.ModalTruncation(6)).modes()
    for k in range(2, 6):
        shape, mine = full.place.basis @ full.shapes[:, k], reduced.place.basis @ reduced.shapes[:, k]
        np.testing.assert_allclose(abs(mine), abs(shape), atol=1e-7 * abs(shape).max())


def test_modes_without_a_machine_are_a_chart(linear):
    bare = dataclasses.replace(linear, place=None)
    frequencies, shares = bare.modes().plot().axes
    np.testing.assert_allclose(frequencies.lines[0].get_ydata(), bare.modes().frequencies[2:])
    heights = sum(p.get_height() for p in shares.patches)
    assert heights == pytest.approx(100.0 * len(bare.modes()))


def test_linear_model_and_response(linear):
    assert len([ax for ax in linear.plot().axes if ax.get_visible()]) == len(linear.outputs)
    gain, phase = linear.select(["left_torque"], ["load_x"]).frequency_response().plot().axes
    assert (gain.get_ylabel(), phase.get_ylabel()) == ("magnitude (dB)", "phase (°)")
    assert linear.select([], []).plot().axes


def test_margins_and_loop_show_the_same(loop):
    found = fc.margins(loop)
    assert written(found.plot()) == written(loop.plot())
    assert f"Ms = {found.sensitivity.value:.3g}" in written(found.plot())


def test_root_locus_marks_the_critical_gain(loop):
    locus = fc.root_locus(loop)
    ax = locus.plot().axes[0]
    assert f"k = {locus.critical[0].gain:.3g}" in written(ax.figure)
    assert ax.get_ylim()[1] > locus.critical[0].omega


def test_sampled_root_locus_is_drawn_in_s(linear):
    dt = 0.02
    sampled = fc.open_loop(linear, ct.tf([200.0], [1.0], dt), "left_torque", "left_speed")
    ax = fc.root_locus(sampled).plot(top=60.0).axes[0]
    assert "ln(z)/T" in ax.get_xlabel()
    heights = np.concatenate([line.get_ydata() for line in ax.lines[: len(sampled.A)]])
    assert np.nanmax(abs(heights)) <= np.pi / dt * (1 + 1e-9)


def test_zeros_beyond_the_axis_are_marked(linear):
    zeros = fc.zeros(linear, ["left_torque"], ["travel"])
    right = zeros.plot().axes[0].lines[1].get_xdata()
    np.testing.assert_allclose(np.sort(right), np.sort(zeros.nonminimum_phase.real))


def test_reduction_tells_its_error(linear):
    reduced = linear.select(["left_torque"], ["load_x", "travel"]).reduce(fc.ModalTruncation(4))
    figure = reduced.plot()
    assert f"{reduced.error.worst:.2g}" in written(figure)
    assert len(figure.axes) == 2


def test_shapers_and_trajectories():
    impulses, left = convolve(zv(3.0), zvd(8.0)).plot().axes
    assert len(impulses.collections[0].get_segments()) == 6
    assert left.lines[0].get_ydata().min() < 1e-2
    value, _, acceleration = MinimumJerk(2.0, 4.0).plot().axes
    assert value.lines[0].get_ydata()[-1] == pytest.approx(2.0)
    assert abs(acceleration.lines[0].get_ydata()).max() == pytest.approx(5.7735 * 2.0 / 16.0, rel=1e-3)
