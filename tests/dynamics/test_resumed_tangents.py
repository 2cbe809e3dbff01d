"""Runs resumed while a tangent is kept that hangs on more than where things are: a trolley's is made by trials."""

from __future__ import annotations

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.design import OpenLoop, Table

BOX = fc.Section.box(fc.STEEL, width=0.3, height=0.5, web=0.006, flange=0.01)


def crane(hung: str, elements: int) -> fc.Model:
    girder = fc.Beam("girder", (0, -5, 8), (0, 5, 8), BOX, elements=elements)
    trolley = fc.Trolley("trolley", girder, at=4.0, mass=500.0)
    parts, drives = [girder, trolley], []
    joints = [fc.Support(girder.start, "u v w ry"), fc.Support(girder.end, "u w")]
    if hung:
        load = fc.PointMass("load", (0, -1, 3), 5e3)
        parts.append(load)
    if hung == "rope":
        rope = fc.Rope("rope", trolley.node, (0, -1, 3), EA=2e7)
        parts.append(rope)
        joints += [fc.Pin(trolley.node, rope.start), fc.Pin(rope.end, load.node)]
    if hung == "winch":
        drives.append(fc.Winch("hoist", load.node, trolley.node, EA=2e7, radius=0.2, ratio=40.0, inertia=0.5))
    push = fc.Force("push", trolley.travel, "x")
    structure = fc.Structure(parts, joints, drives, inputs=[push], outputs=[fc.Position("s", trolley.travel, "x")])
    return fc.assemble(fc.planar(structure, "x"), [fc.Gravity(), fc.LargeRotation(), fc.Flexible()])


@pytest.mark.parametrize("stop", [0.01, 0.1, 0.374])
@pytest.mark.parametrize(("hung", "elements"), [("", 2), ("rope", 2), ("winch", 2), ("winch", 3)])
def test_a_trolley_goes_on_with_the_same_bits(hung, elements, stop, tmp_path):
    model = crane(hung, elements)
    how = {"method": fc.GeneralizedAlpha(2e-3), "every": 0.01, "inputs": {"push": 300.0}}
    whole = fc.simulate(model, until=0.6, **how)
    fc.simulate(model, until=stop, **how).checkpoint.save(tmp_path / "stopped")
    rest = fc.simulate(model, until=0.6, start=fc.load_checkpoint(tmp_path / "stopped"), **how)
    assert np.array_equal(rest.final.q, whole.final.q)
    assert np.array_equal(rest.final.v, whole.final.v)
    assert rest.report.newton_iterations == whole.report.newton_iterations
    assert rest.report.factorisations == whole.report.factorisations


@pytest.mark.parametrize("method", [fc.ConservingMidpoint(5e-3), fc.GeneralizedAlpha(5e-3)], ids=type)
@pytest.mark.parametrize("stop", [0.1, 0.12, 0.1234])
def test_a_chain_goes_on_over_a_knot_with_the_same_bits(method, stop):
    """Factors made anew at a start as drawn are of a matrix that has zeros there, and their order was another one."""
    section = fc.Section(EA=1e5, EI_y=10.0, EI_z=20.0, GJ=5.0, rhoA=1.0, rhoJ=1e-3)
    chain = fc.Beam("chain", (0, 0, 0), (3, 0, -4), section, elements=100)
    support, push = fc.Support(chain.start, "u v w"), fc.Force("push", chain.end, "y")
    model = fc.assemble(fc.Structure([chain], [support], [], [push]), [fc.Gravity(), fc.Flexible(), fc.LargeRotation()])
    law = OpenLoop({"push": Table((0.0, 0.1, 0.3), (0.0, 1.0, 0.0))})
    how = {"method": fc.Unchecked(method), "every": 0.01}
    whole = fc.simulate(model, law, until=0.15, **how)
    rest = fc.simulate(model, law, until=0.15, start=fc.simulate(model, law, until=stop, **how).checkpoint, **how)
    assert np.array_equal(rest.final.q, whole.final.q)
    assert np.array_equal(rest.final.v, whole.final.v)


@pytest.mark.parametrize(("elements", "push", "step"), [(10, 100.0, 5e-3), (20, 300.0, 1e-2), (5, 300.0, 1e-2)])
def test_a_damped_chain_goes_on_at_samples_with_the_same_bits(elements, push, step):
    """Where a step was looked at halfway nodes were left a last digit off, where masses were made at a sample."""
    section = fc.Section(EA=1e5, EI_y=10.0, EI_z=20.0, GJ=5.0, rhoA=1.0, rhoJ=1e-3)
    chain = fc.Beam("chain", (0, 0, 0), (3, 0, -4), section, elements=elements)
    support, pushed = fc.Support(chain.start, "u v w"), fc.Force("push", chain.end, "y")
    effects = [fc.Gravity(), fc.Flexible(), fc.LargeRotation(), fc.RayleighDamping(0.1, 1e-2)]
    model = fc.assemble(fc.Structure([chain], [support], [], [pushed]), effects)
    law = fc.Sampled(OpenLoop({"push": Table((0.0, 10 * step, 30 * step), (0.0, push, 0.0))}), step)
    how = {"method": fc.Unchecked(fc.GeneralizedAlpha(step)), "every": step}
    whole = fc.simulate(model, law, until=15 * step, **how)
    for count in (6, 9, 12):
        part = fc.simulate(model, law, until=count * step, **how)
        rest = fc.simulate(model, law, until=15 * step, start=part.checkpoint, **how)
        assert np.array_equal(rest.final.q, whole.final.q)
        assert np.array_equal(rest.final.v, whole.final.v)
