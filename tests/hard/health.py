"""What every run must tell, whatever becomes of it."""

from __future__ import annotations

import numpy as np

import flexctrl as fc
from flexctrl.dynamics.run import Status


def check(run: fc.Run, until: float) -> None:
    """Assert that a run is finite, has its books, and says why if it ends early.

    Its report holds the energy balance, steps, rejected steps, Newton iterations and the freedom that converged last; a
    run that is called finished has reached its end and has not made energy from nothing.
    """
    report, energy = run.report, run.report.energy
    for values in (run.t, run.y, run.u, run.final.x, run.final.R, run.final.q, run.final.v):
        assert np.isfinite(values).all()
    assert (np.diff(run.t) >= 0.0).all()
    assert len(run.t) == len(run.y) >= 1
    numbers = (energy.start, energy.work, energy.dissipated, energy.kinetic, energy.stored, report.energy_residual)
    assert np.isfinite(numbers).all()
    counts = (report.steps, report.rejected_steps, report.newton_iterations, report.factorisations)
    assert all(isinstance(n, int) and n >= 0 for n in counts)
    assert report.steps > 0 or run.status is not Status.FINISHED
    assert report.worst or not report.dofs
    text = str(report)
    assert all(word in text for word in ("steps", "rejected", "Newton", "energy [J]", "gap", "converged last"))
    if run.status is Status.FINISHED:
        assert abs(run.t[-1] - until) <= 1e-9 * until
        assert report.message == ""
    else:
        assert "t = " in report.message
        assert run.t[-1] <= until * (1.0 + 1e-9)
