"""Large machines solve with tangents in single precision where that is as good, and with all digits where it is not."""

from __future__ import annotations

import math

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.dynamics.march import making
from flexctrl.dynamics.march.calling import Loops

pytest.importorskip("llvmlite")

EFFECTS = [fc.Gravity(), fc.Flexible(), fc.LargeRotation()]
METHOD = fc.Unchecked(fc.GeneralizedAlpha(1e-3))
SOFT, STIFF = 2e5 * math.pi, 2e13 * math.pi


def chain(EA: float, elements: int = 520) -> fc.Model:
    """The chain of the race: 10 m, 1 kg/m, let go at 0.05 rad."""
    section = fc.Section(EA=EA, EI_y=1.0, EI_z=1.0, GJ=1.0, rhoA=1.0, rhoJ=1e-4)
    beam = fc.Beam("chain", (0, 0, 0), (10 * math.sin(0.05), 0, -10 * math.cos(0.05)), section, elements=elements)
    outputs = [fc.Position(d, beam.end, d) for d in "xz"]
    return fc.assemble(fc.Structure([beam], [fc.Support(beam.start, held="u v w")], [], [], outputs), EFFECTS)


def dry() -> fc.Model:
    """Its end rubs on a wall."""
    free = chain(SOFT).structure
    beam = free.elements[0]
    mass = fc.PointMass("mass", beam.end.position, 0.1)
    joints = [*free.joints, fc.Pin(beam.end, mass.node)]
    drawn = fc.Structure([beam, mass], joints, [], [], free.outputs)
    return fc.assemble(drawn, [*EFFECTS, fc.CoulombFriction({"mass.u": fc.Coulomb(2.0)})])


@pytest.fixture
def halved(monkeypatch):
    """Whether the tangent was solved with in single precision, after each call of the loops."""
    seen, do = [], Loops._do

    def watched(loops: Loops, task: int) -> int:
        status = do(loops, task)
        seen.append(loops.march.halved)
        return status

    monkeypatch.setattr(Loops, "_do", watched)
    return seen


def run(model: fc.Model, until: float = 0.2) -> fc.Run:
    return fc.simulate(model, method=METHOD, until=until)


@pytest.mark.parametrize(("EA", "brief"), [(SOFT, True), (STIFF, False)])
def test_half_the_digits_are_taken_where_they_do(EA, brief, halved, monkeypatch):
    found = run(chain(EA))
    assert (1 in halved) == brief
    halved.clear()
    monkeypatch.setattr(making, "_brief", lambda F, groups: False)
    whole = run(chain(EA * (1.0 + 1e-15)))  # another model, so another march
    assert 1 not in halved
    assert found.report.factorisations == pytest.approx(whole.report.factorisations, rel=0.02)
    assert found.report.newton_iterations == pytest.approx(whole.report.newton_iterations, rel=0.02)
    np.testing.assert_allclose(found.y, whole.y, rtol=0, atol=1e-9)


def test_a_run_goes_on_with_the_same_bits(halved):
    model = chain(SOFT)
    whole, half = run(model), run(model, 0.1)
    rest = fc.simulate(model, method=METHOD, until=0.2, start=half.checkpoint)
    assert 1 in halved
    assert np.array_equal(rest.final.x, whole.final.x)
    assert np.array_equal(rest.final.v, whole.final.v)


@pytest.mark.parametrize(
    ("machine", "brief"),
    [
        (lambda: chain(SOFT, 490), 0),
        (lambda: chain(SOFT), 1),
        (dry, 0),
    ],
    ids=["few nodes", "many", "what sticks"],
)
def test_only_large_machines_keep_a_tangent_twice(machine, brief, monkeypatch):
    sizes, do = [], Loops._do

    def watched(loops: Loops, task: int) -> int:
        m = loops.march
        sizes.append((m.brief, m.tangent.brief_down.size > 0, m.mass.brief_down.size))
        return do(loops, task)

    monkeypatch.setattr(Loops, "_do", watched)
    run(machine(), 2e-3)
    assert set(sizes) == {(brief, bool(brief), 0)}
