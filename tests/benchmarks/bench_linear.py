"""Linear analysis against plain python-control and dense scipy, in one run: ratios, not seconds.

Run with one BLAS thread: ``OPENBLAS_NUM_THREADS=1 python tests/benchmarks/bench_linear.py``.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import control
import numpy as np
import scipy.linalg as la

sys.path.insert(0, str(Path(__file__).parents[1] / "linear"))

from fixtures import structures as s

from flexctrl.linear.model import LinearModel


def best_of(times: int, job: Callable[[], object]) -> float:
    """Shortest wall time of several runs, s."""
    spans = []
    for _ in range(times):
        start = time.perf_counter()
        job()
        spans.append(time.perf_counter() - start)
    return min(spans)


def fresh(linear: LinearModel) -> LinearModel:
    """The same model with nothing remembered from earlier calls."""
    return replace(linear)


def response_ratio(slycot: bool) -> dict[str, float]:
    """1000 points at 130 states: python-control's time over ours, warm and from scratch; largest difference."""
    linear = s.beam(32, ("w0",), EI=1e5, rhoA=8.0, length=10.0, beta=1e-6)
    system = linear.to_ss()
    omega = np.geomspace(0.1, 1e5, 1000)
    laub = control.StateSpace.slycot_laub
    if not slycot:
        control.StateSpace.slycot_laub = _no_slycot
    try:
        theirs = best_of(3, lambda: control.frequency_response(system, omega))
        data = control.frequency_response(system, omega).frdata
    finally:
        control.StateSpace.slycot_laub = laub
    warm = best_of(9, lambda: linear.frequency_response(omega))
    cold = best_of(5, lambda: fresh(linear).frequency_response(omega))
    ours = linear.frequency_response(omega).values
    return {
        "states": system.nstates,
        "control_s": theirs,
        "ours_s": warm,
        "ratio": theirs / warm,
        "ratio_from_scratch": theirs / cold,
        "difference": float(np.abs(ours / data - 1).max()),
    }


def _no_slycot(self: control.StateSpace, x: np.ndarray) -> np.ndarray:
    raise ImportError("slycot switched off for this comparison")


def modes_ratio() -> dict[str, float]:
    """10 modes of 1,008 freedoms: dense scipy's time over ours."""
    linear = s.grid_frame(11, 28)
    dense = best_of(1, lambda: la.eigh(linear.K.toarray(), linear.M.toarray()))
    ours = best_of(3, lambda: fresh(linear).modes(10))
    return {"freedoms": len(linear.coordinates), "dense_s": dense, "ours_s": ours, "ratio": dense / ours}


def exudyn_ratio() -> dict[str, float]:
    """10 modes of the same matrices through Exudyn's ComputeODE2Eigenvalues, dense (its faster way here)."""
    import exudyn
    from exudyn.itemInterface import NodeGenericODE2, ObjectGenericODE2

    linear = s.grid_frame(11, 28)
    n = len(linear.coordinates)
    system = exudyn.SystemContainer().AddSystem()
    zero = [0.0] * n
    node = system.AddNode(
        NodeGenericODE2(
            referenceCoordinates=zero,
            initialCoordinates=zero,
            initialCoordinates_t=zero,
            numberOfODE2Coordinates=n,
        )
    )
    system.AddObject(
        ObjectGenericODE2(nodeNumbers=[node], massMatrix=linear.M.toarray(), stiffnessMatrix=linear.K.toarray())
    )
    system.Assemble()
    theirs = best_of(2, lambda: system.ComputeODE2Eigenvalues(numberOfEigenvalues=10))
    ours = best_of(5, lambda: fresh(linear).modes(10))
    return {"freedoms": n, "exudyn_s": theirs, "ours_s": ours, "ratio": theirs / ours}


def large(bays: int, storeys: int) -> dict[str, float]:
    """20 modes and a 1000-point response of a Rayleigh-damped frame."""
    linear = s.grid_frame(bays, storeys, alpha=0.01, beta=1e-5)
    modes = linear.modes(20)
    omega = np.geomspace(0.1 * modes.omega[0], modes.omega[-1], 1000)
    return {
        "freedoms": len(linear.coordinates),
        "modes_s": best_of(2, lambda: fresh(linear).modes(20)),
        "response_s": best_of(2, lambda: fresh(linear).frequency_response(omega)),
    }


def main() -> None:
    """Print every comparison."""
    print("response, control with slycot   ", response_ratio(slycot=True))
    print("response, control without slycot", response_ratio(slycot=False))
    print("modes, dense scipy              ", modes_ratio())
    print("modes, Exudyn                   ", exudyn_ratio())
    for storeys in (50, 100, 200):
        print("large                           ", large(9, storeys))


if __name__ == "__main__":
    main()
