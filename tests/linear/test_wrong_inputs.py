"""Wrong inputs of linear models are answered by name, with what was expected."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp

import flexctrl as fc
from flexctrl.errors import FlexctrlError


@pytest.fixture(scope="module")
def model() -> fc.Model:
    rod = fc.Beam("rod", (0, 0, 0), (0, 0, -1), fc.Section.circular(fc.STEEL, 0.01), elements=2)
    signals = {"inputs": [fc.Force("push", rod.end, "x")], "outputs": [fc.Position("x", rod.end, "x")]}
    structure = fc.Structure([rod], [fc.Support(rod.start)], **signals)
    return fc.assemble(structure, [fc.Flexible(), fc.RayleighDamping(0.1, 1e-5)])


@pytest.fixture(scope="module")
def linear(model):
    return fc.linearize(model)


WRONG = {
    "modes of no whole number": (lambda l: l.modes(2.5), r"count = 2\.5.*whole number"),
    "no modes": (lambda l: l.modes(0), r"count = 0.*from 1"),
    "half a mode": (lambda l: l.reduce(fc.ModalTruncation(2.5)), r"keep = 2\.5.*whole number"),
    "a number for a method": (lambda l: l.reduce(5), "5 is no method.*ModalTruncation"),
    "a method for a function": (
        lambda l: l.reduce(fc.RelativeError(0.1), using=fc.BalancedTruncation(4)),
        "using = BalancedTruncation.*function of its order",
    ),
    "a number for an interface": (lambda l: fc.CraigBampton(999), r"interface = 999; expected names.*modes=10"),
    "a word for an interface": (lambda l: fc.CraigBampton("tip"), "interface = 'tip'; expected names"),
    "fewer than no modes": (lambda l: fc.CraigBampton((l.coordinates[0],), -2), "modes = -2"),
    "a band below zero": (lambda l: l.reduce(fc.ModalTruncation(4)).error_up_to(-1.0), r"hz = -1\.0"),
    "a band up to nothing": (lambda l: l.reduce(fc.ModalTruncation(4)).error_up_to(np.nan), "hz = nan"),
    "words for a time": (lambda l: l.discretize("a"), "dt = 'a'"),
    "words for a hold": (lambda l: l.discretize(0.1, "zoh"), "hold = 'zoh'.*ZeroOrderHold"),
    "a delay of a year": (lambda l: l.discretize(1e-6, fc.ZeroOrderHold(delay=3e7)), "samples.*sample less often"),
    "frequencies on the imaginary axis": (lambda l: l.frequency_response([1j]), r"omega = \[0\.\+1\.j\].*real"),
    "words for frequencies": (lambda l: l.frequency_response("abc"), "omega = .*abc"),
    "a span of three": (lambda l: l.frequency_response(span=(1, 2, 3)), r"span = \(1, 2, 3\).*two limits"),
    "a word for a form": (lambda l: l.to_ss("modal"), "form = 'modal'.*ModalForm"),
    "a word for units": (lambda l: l.save_mat("never_written.mat", "mm"), "units = 'mm'.*Units"),
    "names twice": (lambda l: replace(l, outputs=("x", "x")), "outputs name 'x' more than once"),
    "complex damping": (lambda l: replace(l, C=sp.csc_matrix(1j * l.C)), "C is complex"),
}


@pytest.mark.parametrize("what", WRONG)
def test_it_is_refused_by_name(what, linear):
    act, said = WRONG[what]
    with pytest.raises(FlexctrlError, match=said):
        act(linear)


def test_places_and_structures_are_told_from_models(model):
    for act, said in (
        (lambda: fc.linearize(model, at=3), "at = 3; expected a Rest"),
        (lambda: model.to_nlsys(at=3), "at = 3; expected a Rest"),
        (lambda: fc.linearize(model.structure), "no Model; give what flexctrl.assemble"),
    ):
        with pytest.raises(FlexctrlError, match=said):
            act()


def test_one_response_is_drawn_without_a_label(linear):
    response = linear.frequency_response([1.0, 2.0])
    assert len(fc.plot_bode(response)[0].lines) == len(fc.plot_bode({"one": response})[0].lines) > 0
    with pytest.raises(FlexctrlError, match="mapping of label to response"):
        fc.plot_bode([response])


def test_a_first_order_hold_starts_from_rest_at_minus_h_u(linear):
    """The sampled model from z = −H u₀ is the continuous one from rest under a constant u₀, which a step shows too."""
    dt, steps = 1e-3, 20
    ramp, step = linear.discretize(dt, fc.FirstOrderHold()), linear.discretize(dt)
    H = np.linalg.solve(ramp.A - np.eye(ramp.nstates), ramp.B - step.B)
    z, x = -H[:, 0], np.zeros(step.nstates)
    for _ in range(steps):
        assert ramp.C @ z + ramp.D[:, 0] == pytest.approx(step.C @ x + step.D[:, 0], rel=1e-9, abs=1e-15)
        z, x = ramp.A @ z + ramp.B[:, 0], step.A @ x + step.B[:, 0]
