"""Exact steps in compiled loops are the exact steps: states, commands, rows and books."""

from __future__ import annotations

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.design import FilteredRate, MinimumJerk, OpenLoop, Ramp, pid

pytest.importorskip("llvmlite")

H = 4e-3


def crane(*more: fc.effects.effect.Effect) -> fc.Model:
    return fc.assemble(fc.cranes.ceiling_crane(), [fc.Gravity(), fc.Flexible(), fc.GeometricStiffness(), *more])


def law() -> fc.Saturated:
    inner = pid(900.0, 200.0, 30.0, measured="travel", rate=FilteredRate(0.01), command="push")
    follow = fc.Tracking(inner, {"travel": MinimumJerk(0.3, 0.2, at=0.02)})
    return fc.Saturated(fc.Sampled(follow, H), {"push": 120.0})


def both(model: fc.Model, monkeypatch: pytest.MonkeyPatch, **how) -> tuple[fc.dynamics.run.Run, fc.dynamics.run.Run]:
    leapt = fc.simulate(model, **how)
    with monkeypatch.context() as patch:
        patch.setattr("flexctrl.dynamics.march.marching.can_march", lambda model: False)
        return leapt, fc.simulate(model, **how)


@pytest.mark.parametrize("damped", [False, True])
@pytest.mark.parametrize("every", [None, 2 * H, 3.1e-3])
def test_leaps_are_exact_steps(every, damped, monkeypatch):
    model = crane(*([fc.RayleighDamping(0.1, 1e-3)] if damped else []))
    how = {"controller": law(), "until": 0.1, "method": fc.Exact(H / 2), "every": every}
    a, b = both(model, monkeypatch, **how)
    assert a.report.steps == b.report.steps
    assert np.allclose(a.t, b.t, rtol=1e-12)
    assert np.allclose(a.y, b.y, rtol=1e-9, atol=1e-10)
    assert np.allclose(a.u, b.u, rtol=1e-8, atol=1e-8)
    assert a.report.energy.work == pytest.approx(b.report.energy.work, rel=1e-7)
    assert a.report.energy.dissipated == pytest.approx(b.report.energy.dissipated, rel=1e-6, abs=1e-12)
    for t in (0.0, 0.0123, 0.05, 0.1):
        assert np.allclose(a.at(t).state.x, b.at(t).state.x, rtol=0.0, atol=1e-9)


def test_the_books_balance():
    run = fc.simulate(crane(fc.RayleighDamping(0.1, 1e-3)), law(), until=0.2, method=fc.Exact(H))
    assert run.report.energy.dissipated > 0.1
    assert run.report.energy_residual < 1e-6


def test_the_length_of_steps_makes_no_difference():
    runs = [fc.simulate(crane(), inputs={"push": 300.0}, until=0.1, method=fc.Exact(h)) for h in (1e-3, 2.5e-2)]
    assert np.allclose(runs[0].final.q, runs[1].final.q, rtol=0.0, atol=1e-9)


def test_leaps_go_on_bit_for_bit():
    how = {"method": fc.Exact(H / 2), "controller": OpenLoop({"push": Ramp(300.0)}, H)}
    whole = fc.simulate(crane(), until=0.1, **how)
    half = fc.simulate(crane(), until=0.05, **how)
    rest = fc.simulate(crane(), until=0.1, start=half.checkpoint, **how)
    assert np.allclose(rest.final.q, whole.final.q, rtol=0.0, atol=1e-13)
    assert rest.report.steps == whole.report.steps


def test_few_modes_are_a_reduced_linear_model():
    """Exact steps of some modes against modal truncation of the linear model; what is left out keeps its place."""
    model = crane(fc.RayleighDamping(0.1, 1e-3))
    rest = fc.equilibrium(model)
    linear = fc.linearize(model, at=rest)
    for count in (0, 5, 11):
        few = fc.simulate(model, until=0.1, start=rest, inputs={"push": 300.0}, method=fc.Exact(H, modes=count))
        reduced = linear.reduce(fc.ModalTruncation(linear.modes().rigid + count)).linear
        told = fc.simulate(reduced, until=0.1, inputs={"push": 300.0}, method=fc.Exact(H))
        moved = few.y - np.array([rest.outputs[name] for name in few.outputs])
        assert np.allclose(moved, told.y, rtol=0.0, atol=1e-9)
        assert few.report.energy_residual < 1e-6


def test_all_modes_are_the_whole_model_and_few_march_as_they_step(monkeypatch):
    model, how = crane(fc.RayleighDamping(0.1, 1e-3)), {"inputs": {"push": 300.0}, "until": 0.05}
    whole = fc.simulate(model, method=fc.Exact(H), **how)
    assert np.array_equal(fc.simulate(model, method=fc.Exact(H, modes=1000), **how).y, whole.y)
    a, b = both(model, monkeypatch, method=fc.Exact(H, modes=4), controller=law(), until=0.05)
    assert np.allclose(a.y, b.y, rtol=1e-9, atol=1e-10)
    for wrong in (-1, 2.5):
        with pytest.raises(fc.errors.StructureError, match="modes"):
            fc.Exact(H, modes=wrong)
