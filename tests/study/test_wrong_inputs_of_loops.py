"""Wrong inputs of linear analysis are told in words: what was given, what is expected, what to do."""

from __future__ import annotations

import control as ct
import numpy as np
import pytest
from plants import crane

import flexctrl as fc
from flexctrl.errors import LinearizationError, ReductionError, StructureError
from flexctrl.linear.matfile import Units


def loop() -> fc.Loop:
    return fc.open_loop(crane(1.0, 0.5, 2.0), ct.tf([1.0], [1.0, 1.0]), "force", "trolley")


@pytest.mark.parametrize("gains", [[1j], ["much"], [[1.0, 2.0]], [np.nan], [2.0, 1.0]])
def test_gains_that_are_no_ascending_numbers(gains):
    with pytest.raises(StructureError, match="gains"):
        fc.root_locus(loop(), gains)


@pytest.mark.parametrize("controller", [None, "pd", np.nan, [1.0]])
def test_controllers_that_are_none(controller):
    with pytest.raises(StructureError, match="expected a transfer function or state space"):
        fc.open_loop(crane(1.0, 0.5, 2.0), controller, "force", "trolley")


def test_a_sample_time_left_open():
    sampled = ct.tf([1.0], [1.0, 0.5], True)
    with pytest.raises(StructureError, match=r"controller is sampled .* for example dt=0.01"):
        fc.open_loop(crane(1.0, 0.5, 2.0), sampled, "force", "trolley")
    with pytest.raises(StructureError, match="plant is sampled"):
        fc.open_loop(sampled, 1.0)


def test_a_locus_that_is_none():
    with pytest.raises(StructureError, match="root_locus"):
        fc.critical_gains(loop(), [1.0, 2.0])


@pytest.mark.parametrize("below", [np.nan, -1.0, "all"])
def test_frequencies_that_are_none(below):
    with pytest.raises(StructureError, match="positive angular frequency"):
        fc.sensor_choices(crane(1.0, 0.5, 2.0), below)


@pytest.mark.parametrize("draw", [fc.plot_nyquist, fc.plot_nichols, fc.plot_sensitivities, fc.plot_root_locus])
@pytest.mark.parametrize("given", [{}, [], None, {"one": 3}, 3])
def test_pictures_of_nothing(draw, given):
    with pytest.raises(StructureError, match="expected"):
        draw(given)


@pytest.mark.parametrize("draw", [fc.plot_reduction, fc.plot_envelope])
@pytest.mark.parametrize("given", [{}, [3], {"one": 3}])
def test_pictures_of_no_reduction_and_no_envelope(draw, given):
    with pytest.raises(StructureError, match=r"expected|give one from"):
        draw(given)


def test_moments_of_a_model_without_signals():
    with pytest.raises(ReductionError, match="neither inputs nor outputs"):
        crane(1.0, 0.5, 2.0).select([], []).reduce(fc.MomentMatching((0.0,), 2))


@pytest.mark.parametrize(
    ("names", "said"),
    [
        (("parsec", "t", "s", "N"), "length = 'parsec'"),
        (("mm", "ton", "s", "N"), "mass = 'ton'"),
        (("mm", "kg", "s", "N"), "N is not kg·mm/s²"),
        (("m", "kg", "ms", "N"), "give consistent units"),
        (("m", "kg", "s", "N", "deg"), "angle = 'deg'"),
        ((1.0,), "length = 1.0"),
    ],
)
def test_units_that_are_none_or_do_not_belong_together(names, said):
    with pytest.raises(StructureError, match=said):
        Units(*names)


@pytest.mark.parametrize(
    "names", [("mm", "t", "s", "N"), ("mm", "kg", "ms", "kN"), ("cm", "g", "s", "dyn"), ("in", "slinch", "s", "lbf")]
)
def test_units_that_belong_together(names):
    """1 N = 1 t mm/s², 1 kN = 1 kg mm/ms², 1 dyn = 1 g cm/s², 1 lbf = 1 slinch in/s²."""
    assert str(Units(*names)).startswith(f"length {names[0]}, mass {names[1]}")


def test_a_folder_that_is_not_there(tmp_path):
    with pytest.raises(LinearizationError, match="folder that exists"):
        crane(1.0, 0.5, 2.0).save_mat(tmp_path / "none" / "crane.mat")


@pytest.mark.parametrize(
    ("wrong", "told"),
    [
        (lambda plant: fc.margins(plant), "open_loop"),
        (lambda plant: fc.root_locus("x"), "open_loop"),
        (lambda plant: fc.peak_gain(3), "linearize or reduce"),
        (lambda plant: plant.reduce(fc.RelativeError(0.01, 20.0), using=lambda order: 7), "gave 7, no method"),
        (lambda plant: plant.reduce(fc.RelativeError(0.01, 20.0), using=lambda order: fc.Lowest), "no method"),
        (lambda plant: fc.RelativeError("a"), "'a'.*positive numbers"),
        (lambda plant: fc.RelativeError(0.01, None), "positive numbers"),
        (lambda plant: plant.reduce(fc.ModalTruncation(2)).error_up_to("x"), "hz = 'x'"),
        (lambda plant: loop().frd("a"), "list of angular frequencies"),
        (lambda plant: plant.modes().dominant_part(99), "mode = 99"),
        (lambda plant: plant.modes().dominant_coordinate("a"), "mode = 'a'"),
        (lambda plant: fc.ZeroOrderHold(delay=-1), "delay = -1 s"),
        (lambda plant: fc.FirstOrderHold(delay="a"), "delay = 'a' s"),
    ],
)
def test_what_is_of_another_kind_is_told_in_words(wrong, told):
    with pytest.raises((StructureError, ReductionError), match=told):
        wrong(crane(1.0, 0.5, 2.0))


def test_exact_motion_of_a_machine_that_cannot_move():
    post = fc.Beam("post", (0, 0, 0), (0, 0, 2), fc.Section.tube(fc.STEEL, 0.03, 0.002))
    model = fc.rigid(fc.assemble(fc.Structure([post], [fc.Support(post.start)]), [fc.Flexible()]))
    with pytest.raises(StructureError, match="no degrees of freedom"):
        fc.simulate(model, until=1.0, method=fc.Exact(0.1))
