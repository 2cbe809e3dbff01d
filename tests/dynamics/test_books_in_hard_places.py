"""Books where they are hard to keep: of damping that explicit steps do not resolve, and of machines at rest."""

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
