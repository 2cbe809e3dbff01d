"""Books where they are hard to keep: of damping that steps do not resolve, of machines at rest and of small motion."""

from __future__ import annotations

import numpy as np
import pytest

import flexctrl as fc

TUBE = fc.Section.tube(fc.STEEL, radius=0.03, thickness=0.002)


@pytest.mark.parametrize(("beta", "share"), [(1e-5, 0.1), (1e-4, 0.2)])
def test_dissipation_of_steps_at_the_edge_of_stability(beta, share):
    beam = fc.Beam("b", (0, 0, 0), (1, 0, 0), TUBE, elements=2)
    structure = fc.Structure(
        [beam],
        [fc.Support(beam.start)],
        inputs=[fc.Force("f", beam.end, "z")],
        outputs=[fc.Position("z", beam.end, "z")],
    )
    model = fc.assemble(structure, [fc.Flexible(), fc.LargeRotation(), fc.RayleighDamping(beta=beta)])
    coarse, fine = (
        fc.simulate(model, until=0.005, inputs={"f": 500.0}, method=fc.ExplicitRungeKutta(), tolerance=tolerance)
        for tolerance in (fc.Tolerance(), fc.Tolerance(1e-8, 1e-10))
    )
    assert coarse.status is fc.Status.FINISHED
    assert coarse["z"][-1] == pytest.approx(fine["z"][-1], rel=1e-6)
    lost, known = coarse.report.energy.dissipated, fine.report.energy.dissipated
    assert np.abs(lost - known) < share * known
    assert fine.report.energy_residual < 1e-8


@pytest.mark.parametrize(
    "method",
    [fc.AdaptiveAlpha(), fc.GeneralizedAlpha(1e-3), fc.ConservingMidpoint(1e-3)],
    ids=lambda m: type(m).__name__,
)
def test_a_machine_at_rest_misses_nothing(method):
    """No more than rounding is turned over: its share that is missed says nothing."""
    arm = fc.Beam("arm", (0, 0, 0), (2, 0, 0), TUBE, elements=2)
    model = fc.assemble(fc.Structure([arm], [fc.Support(arm.start)]), [fc.Gravity(), fc.Flexible(), fc.LargeRotation()])
    run = fc.simulate(model, until=0.1, start=fc.equilibrium(model), method=method)
    assert (run.status, run.report.energy_residual) == (fc.Status.FINISHED, 0.0)
    pushed = fc.simulate(model, until=0.1, start=model.rest, method=method)
    assert 0.0 < pushed.report.energy_residual < 1e-2


@pytest.mark.parametrize("backend", [fc.CasadiVM(), None], ids=["plain", "compiled"])
def test_small_motion_that_is_not_resolved_is_told(backend):
    """A kilogram on 1e8 N/m swings between 0 and 2 F/k; in steps of sixteen periods it stands between the two."""

    def pushed(force: float, step: float) -> fc.Run:
        method = fc.GeneralizedAlpha(step, rho=1.0)
        return fc.simulate(model, until=400 * step, inputs={"push": force}, method=method)

    mass = fc.PointMass("mass", (1, 0, 0), 1.0)
    spring = fc.Spring("spring", (0, 0, 0), mass.node, stiffness=1e8)
    joints = [fc.Support(spring.start), fc.Pin(spring.end, mass.node), fc.Support(mass.node, "v w")]
    push, x = fc.Force("push", mass.node, "x"), fc.Position("x", mass.node, "x")
    model = fc.assemble(fc.Structure([spring, mass], joints, inputs=[push], outputs=[x]), [fc.LargeRotation()], backend)
    coarse, fine, dust = pushed(1e4, 1e-2), pushed(1e4, 2e-6), pushed(1.0, 1e-2)
    assert coarse.report.energy_residual > 0.2
    told, *_ = coarse.report.notes
    assert "less than a thousandth of the machine's size, and is not resolved" in told
    assert np.ptp(fine["x"]) == pytest.approx(2e-4, rel=1e-2)
    assert fine.report.notes == dust.report.notes == ()
    assert {run.status for run in (coarse, fine, dust)} == {fc.Status.FINISHED}


def _hung(light: float, drag: float, backend: str, stiffness: float = 1e3) -> tuple[fc.Model, fc.State]:
    """A block, free to slide, and a light part with a rate of 2.5 m/s behind a damper on it."""
    block, part = fc.PointMass("block", (0, 0, 0), 0.016), fc.PointMass("part", (1, 0, 0), light)
    line = fc.Spring("line", (0, 0, 0), (1, 0, 0), stiffness=stiffness, damping=drag)
    joints = [fc.Pin(line.start, block.node), fc.Pin(line.end, part.node)]
    joints += [fc.Support(one.node, "v w") for one in (block, part)]
    place = fc.Position("block", block.node, "x")
    structure = fc.Structure([line, block, part], joints, outputs=[place])
    model = fc.assemble(structure, [fc.LargeRotation()], {"compiled": None, "plain": fc.CasadiVM()}[backend])
    return model, model.rest.with_(v=np.array([0.0, 2.5]))


SWIFT = {
    "alpha": fc.GeneralizedAlpha(1e-3),
    "trapezoid": fc.GeneralizedAlpha(1e-3, rho=1.0),
    "midpoint": fc.ConservingMidpoint(1e-3),
    "extrapolated": fc.Richardson(fc.GeneralizedAlpha(1e-3)),
}


@pytest.mark.parametrize("light", [5e-4, 2e-3])
@pytest.mark.parametrize("name", SWIFT)
def test_rates_that_damping_ends_within_a_step_lose_the_energy_they_had(name, light):
    """Quadrature over c h/m = 10 and 2.5 books up to 27 times as much; momentum says where the block is at last."""
    model, start = _hung(light, 5.0, "compiled")
    run = fc.simulate(model, until=0.2, start=start, method=SWIFT[name])
    shared, whole = light * 2.5 / (light + 0.016), 0.5 * light * 2.5**2
    assert run.status is fc.Status.FINISHED
    assert run["block"][-1] == pytest.approx(0.2 * shared, rel=1e-3)
    assert run.report.energy.dissipated == pytest.approx(whole - 0.5 * light * 2.5 * shared, rel=0.2)
    assert run.report.energy_residual < (1e-5 if name in ("trapezoid", "midpoint") else 0.2)


def test_such_books_are_the_same_in_loops():
    hung = [_hung(5e-4, 5.0, backend) for backend in ("compiled", "plain")]
    runs = [fc.simulate(model, until=0.05, start=start, method=SWIFT["alpha"]) for model, start in hung]
    marched, plain = (run.report.energy for run in runs)
    assert marched.dissipated == pytest.approx(plain.dissipated, rel=1e-9)
    assert runs[0].report.notes == runs[1].report.notes
    assert "faster than steps see" in runs[0].report.notes[0]


@pytest.mark.parametrize("backend", ["compiled", "plain"])
def test_what_a_step_loses_too_much_is_not_forgiven_where_damping_is_slower(backend):
    """c h/m = 0.15, but the spring's six radians a step are no motion that steps follow."""
    model, start = _hung(5e-4, 0.075, backend, stiffness=18e3)
    run = fc.simulate(model, until=0.2, start=start, method=SWIFT["trapezoid"])
    assert run.status is fc.Status.FAILED
    assert "the motion is not resolved" in run.report.message
