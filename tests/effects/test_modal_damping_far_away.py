"""Modal damping is that of modes about one equilibrium: what leaves it is told, or refused, and not braked silently."""

from __future__ import annotations

import numpy as np
import pytest

import flexctrl as fc

SAID = "whose modes ModalDamping is of"


def jib(damping: fc.effects.Effect) -> fc.Model:
    """A jib that slews freely about z."""
    section = fc.Section(EA=1e7, EI_y=2000.0, EI_z=1000.0, GJ=800.0, rhoA=1.0, rhoJ=0.01)
    beam = fc.Beam("jib", (0, 0, 0), (1, 0, 0), section, elements=4)
    structure = fc.Structure(
        [beam],
        [fc.Support(beam.start, held="u v w rx ry")],
        inputs=[fc.Torque("slew", beam.start, "z")],
        outputs=[fc.Position("x", beam.end, "x"), fc.Position("y", beam.end, "y")],
    )
    return fc.assemble(structure, [fc.Flexible(), fc.LargeRotation(), damping])


def slewing(model: fc.Model, speed: float) -> fc.State:
    rate = np.zeros(model.n)
    for i, name in enumerate(model.coordinates):
        if name.endswith("_rz"):
            rate[i] = speed
        elif name.endswith("_v"):
            rate[i] = speed * int(name.split("_")[1]) / 4.0
    return model.rest.with_(v=rate)


def test_a_jib_that_slews_is_told():
    """It stops after 0.3 rad, braked as if it were stretched."""
    model = jib(fc.ModalDamping(0.02))
    run = fc.simulate(model, until=2.0, start=slewing(model, 2.0))
    assert run.report.energy.kinetic < 1e-3 * run.report.energy.start
    assert any(SAID in note and "RayleighDamping" in note for note in run.report.notes)
    free = jib(fc.RayleighDamping(beta=1e-4))
    run = fc.simulate(free, until=2.0, start=slewing(free, 2.0))
    assert run.report.energy.kinetic == pytest.approx(run.report.energy.start, rel=1e-3)
    assert not any(SAID in note for note in run.report.notes)


def test_there_and_back_is_told_too():
    model = jib(fc.ModalDamping([0.02]))
    there = fc.OpenLoop({"slew": lambda t: 2.0 * np.cos(2.0 * np.pi * t)})
    run = fc.simulate(model, there, until=1.0, method=fc.GeneralizedAlpha(5e-3))
    assert abs(run["y"][-1]) < 0.05
    assert any(SAID in note for note in run.report.notes)


def test_small_vibrations_are_not():
    model = jib(fc.ModalDamping(0.02))
    run = fc.simulate(model, until=0.2, inputs={"slew": 1e-2})
    assert not any(SAID in note for note in run.report.notes)


def test_a_linear_model_elsewhere_is_refused():
    model = jib(fc.ModalDamping(0.02))
    turned = fc.equilibrium(model, hold={"jib_0_rz": 0.5})
    with pytest.raises(fc.errors.LinearizationError, match=SAID):
        fc.linearize(model, at=turned)
    there = jib(fc.ModalDamping(0.02, hold={"jib_0_rz": 0.5}))
    linear = fc.linearize(there, at=fc.equilibrium(there, hold={"jib_0_rz": 0.5}))
    assert linear.modes().omega.min() > 1.0


def test_a_load_on_a_rope_is_told_when_it_swings_far():
    rope = fc.Rope("rope", (0, 0, 0), (0, 0, -5), EA=1e6)
    load = fc.PointMass("load", rope.end, 500.0)
    joints = [fc.Support(rope.start, "u v w"), fc.Pin(rope.end, load.node)]
    outputs = [fc.Position("x", load.node, "x")]
    structure = fc.Structure([rope, load], joints, outputs=outputs)
    model = fc.assemble(structure, [fc.Flexible(), fc.LargeRotation(), fc.Gravity(), fc.ModalDamping(0.02)])
    rest = fc.equilibrium(model).state
    for angle, told in ((0.05, False), (0.3, True)):
        away = {"u": 5.0 * np.sin(angle), "w": 5.0 * (1.0 - np.cos(angle))}
        step = np.array([away.get(name.rpartition("_")[2], 0.0) for name in model.coordinates])
        run = fc.simulate(model, until=0.5, start=model.advance(rest, step, np.zeros(model.n), 0.0))
        assert any(SAID in note for note in run.report.notes) == told
