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
    coarse, fine, dust = pushed(1e4, 1e-2), pushed(1e4, 2e-5), pushed(1.0, 1e-2)
    assert coarse.report.energy_residual > 0.2
    [told] = coarse.report.notes
    assert "less than a thousandth of the machine's size, and is not resolved" in told
    assert np.ptp(fine["x"]) == pytest.approx(2e-4, rel=1e-2)
    assert fine.report.notes == dust.report.notes == ()
    assert {run.status for run in (coarse, fine, dust)} == {fc.Status.FINISHED}
