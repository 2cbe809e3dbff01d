"""How far single outputs are off, over their own motion: what moves little beside the machine."""

from __future__ import annotations

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.design import MinimumJerk, pd
from flexctrl.kernels.kernel import CasadiVM

OF_THAT = "of that"


def trolley(backend=None, more: int = 0):
    """A trolley of 50 kg under a sampled law on a girder of 8 m that bends by a centimetre, with a load on a rope."""
    tube = fc.Section.tube(fc.STEEL, 0.08, 0.004)
    girder = fc.Beam("girder", (0, 0, 0), (8, 0, 0), tube, elements=6)
    cart = fc.Trolley("cart", girder, at=1.0, mass=50.0)
    rope = fc.Rope("rope", cart.node, (1, 0, -2), EA=1e6, damping=100.0)
    load = fc.PointMass("load", rope.end, 100.0)
    joints = [fc.Support(girder.start, "u v w rx"), fc.Support(girder.end, "v w")]
    joints += [fc.Pin(cart.node, rope.start), fc.Pin(rope.end, load.node)]
    outputs = [fc.Position("s", cart.travel, "x"), fc.Velocity("rate", cart.travel, "x")]
    outputs += [fc.Position("bend", cart.node, "z"), fc.Position("load", load.node, "x")]
    outputs += [fc.Position(f"z{i}", girder.node(i + 1), "z") for i in range(more)]
    parts, inputs = [girder, cart, rope, load], [fc.Force("force", cart.travel, "x")]
    structure = fc.planar(fc.Structure(parts, joints, inputs=inputs, outputs=outputs), "y")
    effects = [fc.Gravity(), fc.Flexible(), fc.LargeRotation(), fc.RayleighDamping(beta=1e-4)]
    model = fc.assemble(structure, effects, backend)
    gains = pd(kp=400.0, kd=300.0, measured="s", rate="rate", command="force")
    return model, fc.Sampled(fc.Tracking(gains, {"s": MinimumJerk(5.0, 3.0, start=1.0)}), 0.02)


@pytest.fixture(scope="module")
def truth():
    model, law = trolley()
    return fc.simulate(model, law, until=5.0, every=0.05, method=fc.GeneralizedAlpha(5e-5))


@pytest.mark.parametrize(
    ("method", "tolerance"),
    [
        (None, None),
        (None, fc.Tolerance(1e-5, 1e-8)),
        (None, fc.Tolerance(2e-7, 2e-10)),
        (fc.GeneralizedAlpha(1e-3), None),
        (fc.GeneralizedAlpha(5e-3), None),
    ],
)
def test_a_deflection_of_millimetres_is_told_by_how_much_it_is_off_itself(truth, method, tolerance):
    model, law = trolley()
    run = fc.simulate(model, law, until=5.0, every=0.05, method=method, tolerance=tolerance)
    off = float(np.abs(run["bend"] - truth["bend"]).max() / np.ptp(truth["bend"]))
    told = run.report.output_errors["bend"]
    assert run.report.error < 0.005
    assert 0.7 * off < told < 3.0 * off
    notes = [note for note in run.report.notes if OF_THAT in note]
    assert bool(notes) == (told > 0.05)
    assert all(note.startswith("bend has moved by 0.026") for note in notes)
    assert run.report.output_errors["s"] < 1e-3
    assert set(run.report.output_errors) - {"rate"} == {"s", "bend", "load"}
    assert f"bend is off by the largest share of what it goes through, up to {told:.2g}" in str(run.report)


def test_the_tolerance_that_a_note_names_leaves_a_hundredth_or_so(truth):
    model, law = trolley()
    asked = fc.simulate(model, law, until=5.0, every=0.05)
    (note,) = [note for note in asked.report.notes if OF_THAT in note]
    relative, absolute = (float(part) for part in note.split("Tolerance(")[1].split(")")[0].split(","))
    run = fc.simulate(model, law, until=5.0, every=0.05, tolerance=fc.Tolerance(relative, absolute))
    assert not [note for note in run.report.notes if OF_THAT in note]
    assert np.abs(run["bend"] - truth["bend"]).max() < 0.02 * np.ptp(truth["bend"])


def test_it_is_told_uncompiled_too():
    told = []
    for backend in (None, CasadiVM()):
        model, law = trolley(backend=backend)
        run = fc.simulate(model, law, until=0.6, every=0.05, method=fc.GeneralizedAlpha(5e-3))
        told.append(run.report.output_errors)
    assert told[0] == pytest.approx(told[1], rel=0.5)  # what Newton leaves of accelerations counts as error


def test_what_stands_still_and_linear_models_tell_nothing():
    model, _ = trolley()
    still = fc.simulate(model, until=0.5, start=fc.equilibrium(model))
    assert "load" not in still.report.output_errors
    linear = fc.linearize(model, fc.equilibrium(model))
    assert not fc.simulate(linear, until=0.5).report.output_errors


def test_one_note_names_the_worst_of_many():
    model, law = trolley(more=4)
    run = fc.simulate(model, law, until=2.0, every=0.05, method=fc.Unchecked(fc.GeneralizedAlpha(0.01)))
    (note,) = [note for note in run.report.notes if OF_THAT in note]
    shares = sorted(run.report.output_errors, key=run.report.output_errors.__getitem__)
    assert note.startswith(f"{shares[-1]} has moved")
    assert f"beside it {shares[-2]} " in note
    assert note.endswith("and 1 more")
