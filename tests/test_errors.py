"""What error messages are made of."""

from __future__ import annotations

import pytest

import flexctrl as fc
from flexctrl.design import pd, zvd
from flexctrl.errors import FlexctrlError, did_you_mean, shortened

NODES = [f"arm_{i}_u" for i in range(30)]


@pytest.mark.parametrize(
    ("name", "known", "phrase"),
    [
        ("torqe", ["torque", "push"], "; did you mean 'torque'?"),
        ("Kp", ["kp", "ki", "kd", "measured"], "; did you mean 'kp'?"),
        ("motor", ["arm_0_rz", "motor_source"], "; did you mean 'motor_source'?"),
        ("q", ["u", "v"], "; known: u, v"),
        ("load", [], ""),
        ("load", NODES, f"; known: {', '.join(NODES[:20])} … (30 in all)"),
    ],
)
def test_the_closest_name_is_offered_or_some_that_there_are(name, known, phrase):
    assert did_you_mean(name, known) == phrase


def test_values_are_shown_on_one_short_line():
    assert shortened("10 kg") == "'10 kg'"
    assert shortened([0] * 100).endswith("…")
    assert len(shortened([0] * 100)) == 78
    beam = fc.Beam("arm", (0, 0, 0), (1, 0, 0), fc.Section.tube(fc.STEEL, 0.03, 0.002))
    assert "\n" not in shortened([beam, {"a": [1, 2]}])


def test_a_public_name_with_a_slip_is_offered():
    with pytest.raises(AttributeError, match="no attribute 'Beem'; did you mean 'Beam'"):
        _ = fc.Beem
    with pytest.raises(AttributeError, match="no attribute 'lqrr'; did you mean 'lqr'"):
        _ = fc.design.lqrr
    with pytest.raises(AttributeError, match=r"no attribute 'Table'; it is flexctrl\.design\.Table"):
        _ = fc.Table


@pytest.mark.parametrize("study", [fc.ledger, fc.work_precision, fc.ladder])
def test_studies_want_a_scene(study):
    with pytest.raises(FlexctrlError, match=f"{study.__name__}: 'crane' is no Scene; give flexctrl.Scene"):
        study("crane")


def test_comparing_wants_a_scene_or_a_model():
    with pytest.raises(FlexctrlError, match="compare: 'crane' is neither a Scene nor a Model"):
        fc.compare("crane")


SECTION = fc.Section.tube(fc.STEEL, 0.03, 0.002)
BAR = fc.Beam("bar", (0, 0, 0), (1, 0, 0), SECTION)
MACHINE = fc.Structure([BAR], [fc.Support(BAR.start)])
MODEL = fc.assemble(MACHINE, [fc.Flexible()], fc.CasadiVM())
PD = {"measured": "angle", "rate": "speed", "command": "torque"}


@pytest.mark.parametrize(
    ("mistake", "message"),
    [
        (lambda: fc.equilibrium(MODEL, hold=["bar_1_u"]), "hold = .'bar_1_u'.; expected displacements by name"),
        (lambda: fc.equilibrium(MODEL, hold={"bar_1_u": "far"}), "hold 'bar_1_u' = 'far'; expected a number"),
        (lambda: fc.equilibrium(MODEL, start="rest"), "start = 'rest'; expected a State"),
        (lambda: fc.equilibrium(MODEL, tolerance=-1.0), "tolerance = -1.0; expected a number > 0"),
        (lambda: fc.zeros(MODEL), "zeros: Model.* is no linear model; give what linearize returns"),
        (lambda: fc.open_loop(MODEL), "open_loop: Model.* is no linear model"),
        (lambda: fc.refine(MODEL, 2), "refine: Model.* is no Structure"),
        (lambda: fc.Scene(BAR), "Scene: structure = Beam.*; expected a Structure"),
        (lambda: fc.Scene(MACHINE, simulation=3), "Scene: simulation = 3; expected a Simulation"),
        (lambda: pd("8", 1.0, **PD), "gain: '8' is not a finite number"),
        (lambda: pd(float("nan"), 1.0, **PD), "gain: nan is not a finite number"),
        (lambda: fc.Sampled(pd(1.0, 1.0, **PD), "0.01"), "the sample time '0.01' must be 0 or more seconds"),
        (lambda: zvd("1"), "the frequency '1' rad/s must be > 0"),
    ],
)
def test_what_is_of_another_kind_is_told_by_name(mistake, message):
    with pytest.raises(FlexctrlError, match=message):
        mistake()
