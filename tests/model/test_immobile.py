"""A machine whose supports hold all that no effect lets bend: it stands still, and says so."""

from __future__ import annotations

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.errors import LinearizationError


def cantilever() -> fc.Model:
    beam = fc.Beam("beam", (0, 0, 0), (1, 0, 0), fc.Section.tube(fc.STEEL, 0.03, 0.004), elements=2)
    machine = fc.Structure(
        [beam],
        [fc.Support(beam.start)],
        inputs=[fc.Force("push", beam.end, "z")],
        outputs=[fc.Position("height", beam.end, "z"), fc.Position("reach", beam.end, "x")],
    )
    return fc.assemble(machine, [fc.Gravity(), fc.Flexible(), fc.LargeRotation()])


def test_it_stands_still():
    twin = fc.rigid(cantilever())
    assert isinstance(twin, fc.Model)
    assert twin.n == 0
    run = fc.simulate(twin, until=0.05, inputs={"push": 10.0})
    assert run.status is fc.Status.FINISHED
    np.testing.assert_allclose(run.y, [[0.0, 1.0]] * len(run.t), atol=1e-15)
    assert fc.equilibrium(twin).outputs == {"height": 0.0, "reach": 1.0}


def test_it_has_no_linear_model():
    with pytest.raises(LinearizationError, match="no degrees of freedom"):
        fc.linearize(fc.rigid(cantilever()))


def test_static_correction_of_a_machine_that_is_free_but_for_its_mesh():
    """The sagged girder of the ceiling crane spins about its own axis: against a direct solve at 1.6 rad/s."""
    crane = fc.assemble(fc.cranes.ceiling_crane(), [fc.Gravity(), fc.Flexible(), fc.LargeRotation()])
    linear = fc.linearize(crane).select(["push"], ["travel"])
    reduced = linear.reduce(fc.ModalTruncation(16, static_correction=True))
    exact = (linear.Cq @ np.linalg.solve((linear.K - 1.6**2 * linear.M).toarray(), linear.B))[0, 0]
    assert reduced.frequency_response([1.6]).values[0, 0, 0] == pytest.approx(exact, rel=1e-4)
