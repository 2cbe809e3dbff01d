"""Linear analysis against Exudyn and plain python-control, in one run: ratios, not seconds.

``OPENBLAS_NUM_THREADS=1 python tests/benchmarks/bench_linear.py`` prints the tables; ``--json FILE`` writes the
numbers, ``--page`` the page ``docs/benchmarks/linear.md``. Needs the extras ``[bench]`` and, for the rows that name
it, SLICOT. Large models run in processes of their own, so that their peak memory can be read (on Linux).
"""

from __future__ import annotations

import argparse
import json
import platform
import subprocess
import sys
import time
import warnings
from collections.abc import Callable
from contextlib import contextmanager
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

import control
import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as sla

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent / "linear")]

from bench_page import linear_page  # noqa: E402
from fixtures import structures as s  # noqa: E402
from lattice import girder  # noqa: E402

from flexctrl.linear.condense import scaled  # noqa: E402
from flexctrl.linear.direct import direct_transfer  # noqa: E402
from flexctrl.linear.model import LinearModel  # noqa: E402
from flexctrl.study.loop import open_loop  # noqa: E402
from flexctrl.study.root_locus import root_locus  # noqa: E402

LARGE = (62, 125, 250)
PAGE = HERE.parents[1] / "docs" / "benchmarks" / "linear.md"


def best_of(times: int, job: Callable[[], object]) -> float:
    """Shortest processor time of several runs, s: other work on the machine counts less than in wall time."""
    spans = []
    for _ in range(times):
        start = time.process_time()
        job()
        spans.append(time.process_time() - start)
    return min(spans)


def fresh(linear: LinearModel) -> LinearModel:
    """The same model with nothing remembered from earlier calls."""
    return replace(linear)


def linearised(linear: LinearModel) -> LinearModel:
    """The same model as `linearize` leaves one: its modes are known from its certificate."""
    model = fresh(linear)
    model.modes()
    return model


def dragged(linear: LinearModel, rate: float) -> LinearModel:
    """The model with two dashpots to ground: its modes are coupled."""
    n = len(linear.coordinates)
    drag = np.zeros(n)
    drag[[n // 3, n // 2]] = rate, 2 * rate
    return replace(linear, C=sp.csc_matrix(linear.C + sp.diags(drag)))


def responses() -> list[dict[str, Any]]:
    """1000 points at 130 states against control.frequency_response, with and without SLICOT."""
    plain = s.beam(32, ("w0",), EI=1e5, rhoA=8.0, length=10.0, beta=1e-6)
    omega = np.geomspace(0.1, 1e5, 1000)
    rows = []
    for damping, linear in (("proportional", plain), ("with dashpots", dragged(plain, 5.0))):
        system = linear.to_ss()
        warm = best_of(100, lambda linear=linear: linear.frequency_response(omega))
        cold = best_of(100, lambda linear=linear: fresh(linear).frequency_response(omega))
        models = iter([linearised(linear) for _ in range(100)])
        first = best_of(100, lambda models=models: next(models).frequency_response(omega))
        for slicot in (True, False):
            with _slicot(slicot):
                theirs = best_of(3, lambda system=system: control.frequency_response(system, omega))
                data = control.frequency_response(system, omega).frdata
            gap = float(np.abs(linear.frequency_response(omega).values / data - 1).max())
            rows.append(
                {
                    "states": system.nstates,
                    "damping": damping,
                    "slicot": slicot,
                    "ratio": theirs / warm,
                    "ratio_first": theirs / first,
                    "ratio_from_scratch": theirs / cold,
                    "difference": gap,
                }
            )
    return rows


@contextmanager
def _slicot(wanted: bool):
    laub = control.StateSpace.slycot_laub

    def missing(self: control.StateSpace, x: np.ndarray) -> np.ndarray:
        raise ImportError("slycot switched off for this comparison")

    control.StateSpace.slycot_laub = laub if wanted else missing
    try:
        yield
    finally:
        control.StateSpace.slycot_laub = laub


def eigenmodes() -> list[dict[str, Any]]:
    """Modes of a lattice girder of about 1,000 freedoms through both routes of Exudyn and by plain scipy."""
    linear = girder(41)
    rows = []
    for count in (10, 20):
        ours = best_of(100, lambda count=count: fresh(linear).modes(count))
        known = linear.modes(count).omega_squared
        for route, job in _others(linear, count).items():
            theirs, values = best_of(3, job), np.sort(job())[:count]
            gap = float(np.abs(values / known - 1).max())
            rows.append(
                {
                    "freedoms": len(linear.coordinates),
                    "modes": count,
                    "route": route,
                    "ratio": theirs / ours,
                    "difference": gap,
                }
            )
    return rows


def _others(linear: LinearModel, count: int) -> dict[str, Callable[[], np.ndarray]]:
    system = _exudyn_system(linear)
    return {
        "Exudyn, defaults (dense)": lambda: system.ComputeODE2Eigenvalues(numberOfEigenvalues=count)[0],
        "Exudyn, useSparseSolver": lambda: system.ComputeODE2Eigenvalues(
            useSparseSolver=True, numberOfEigenvalues=count
        )[0],
        "scipy eigsh, sigma = 0": lambda: sla.eigsh(linear.K, count, M=linear.M, sigma=0.0)[0],
    }


def _exudyn_system(linear: LinearModel) -> Any:
    """The same matrices as an ObjectGenericODE2, given sparse."""
    import exudyn
    from exudyn.itemInterface import NodeGenericODE2, ObjectGenericODE2

    n = len(linear.coordinates)
    container = exudyn.SystemContainer()
    system = container.AddSystem()
    system.variables["container"] = container  # owns the system: must outlive it
    zero = [0.0] * n
    node = system.AddNode(
        NodeGenericODE2(
            referenceCoordinates=zero, initialCoordinates=zero, initialCoordinates_t=zero, numberOfODE2Coordinates=n
        )
    )
    mass, stiffness = (_sparse(exudyn, A) for A in (linear.M, linear.K))
    system.AddObject(ObjectGenericODE2(nodeNumbers=[node], massMatrix=mass, stiffnessMatrix=stiffness))
    system.Assemble()
    return system


def _sparse(exudyn: Any, A: sp.spmatrix) -> Any:
    full = sp.coo_matrix(A)
    matrix = exudyn.MatrixContainer()
    matrix.SetWithSparseMatrix(
        np.column_stack([full.row, full.col, full.data]), numberOfRows=A.shape[0], numberOfColumns=A.shape[1]
    )
    return matrix


def loci() -> list[dict[str, Any]]:
    """Root loci of a cantilever under rate feedback: what Newton's method finds wrong, and what python-control does."""
    rows = []
    gains = np.geomspace(0.1, 30.0, 20)
    for elements in (15, 24, 32):
        linear = s.cantilever(elements, EI=1e3, rhoA=2.0, length=2.0, beta=1e-5)
        loop = open_loop(linear, control.tf([1, 0], [1 / 300**2, 2 / 300, 1]), *linear.inputs, *linear.outputs)
        ours = best_of(1, lambda loop=loop: root_locus(loop, gains))
        mine = root_locus(loop, gains)
        at = [int(np.argmin(np.abs(mine.gains - k))) for k in gains]
        system = control.ss(loop.A, loop.B, loop.C, loop.D)
        row: dict[str, Any] = {"states": len(loop.A), "own": _newton(loop, gains[-1], mine.loci[at[-1]])}
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                theirs = best_of(1, lambda system=system: control.root_locus_map(system, gains=gains))
                other = control.root_locus_map(system, gains=gains).loci
            low = [(a[np.abs(a) < 1e3], b) for a, b in zip(mine.loci[at], other, strict=True)]
            gap = max(float(np.abs(b - pole).min() / abs(pole)) for a, b in low for pole in a if abs(pole) > 0)
            row |= {"ratio": theirs / ours, "difference": gap, "refused": ""}
        except (np.linalg.LinAlgError, ValueError) as error:
            row |= {"ratio": None, "difference": None, "refused": type(error).__name__}
        rows.append(row)
    return rows


def _newton(loop: Any, gain: float, poles: np.ndarray) -> float:
    """Largest relative step of Newton's method on 1 + k L(s) at the poles under 1000 rad/s."""
    low = poles[(np.abs(poles) < 1e3) & (np.abs(poles) > 0)]
    h = 1e-6 * low
    slope = (loop.curve(low + h) - loop.curve(low - h)) / (2 * h)
    return float(np.abs((1 + gain * loop.curve(low)) / (gain * slope * low)).max())


def large() -> list[dict[str, Any]]:
    """The largest models, each in a process of its own."""
    command = [sys.executable, str(Path(__file__).resolve()), "--worker"]
    return [json.loads(subprocess.check_output([*command, str(bays)], text=True)) for bays in LARGE]


def worker(bays: int) -> dict[str, Any]:
    """Linearise, 20 modes, 1000 points with Rayleigh damping, 1000 points with dashpots: times and peak memory."""
    small = girder(6)
    small.frequency_response(np.geomspace(1.0, 100.0, 50))
    _forget_peak()
    before = _memory("VmRSS")
    start = time.process_time()
    linear = girder(bays)
    result: dict[str, Any] = {"freedoms": len(linear.coordinates), "linearise": time.process_time() - start}
    result["modes"] = best_of(2, lambda: fresh(linear).modes(20))
    omega = linear.modes(20).omega
    points = np.geomspace(0.1 * omega[0], omega[-1], 1000)
    result["response"] = best_of(2, lambda: fresh(linear).frequency_response(points))
    rough = dragged(linear, 200.0)
    result["response_dashpots"] = best_of(1, lambda: fresh(rough).frequency_response(points))
    some = points[::67]
    result["one_by_one"] = 1000 / some.size * best_of(1, lambda: direct_transfer(scaled(rough))(1j * some))
    exact = direct_transfer(scaled(rough))(1j * some)
    values = rough.frequency_response(points).values[..., ::67]
    result["difference"] = float(np.abs(values / exact - 1).max())
    return result | {"memory": _memory("VmHWM") - before}


def _memory(kind: str) -> float:
    """Memory of this process, MB: "VmRSS" now, or "VmHWM" at its peak since `_forget_peak`."""
    lines = Path("/proc/self/status").read_text(encoding="ascii").splitlines()
    return next(float(line.split()[1]) for line in lines if line.startswith(kind)) / 1e3


def _forget_peak() -> None:
    Path("/proc/self/clear_refs").write_text("5", encoding="ascii")


def setting() -> dict[str, str]:
    """What it ran on, in general terms."""
    names = ("numpy", "scipy", "control", "slycot", "exudyn")
    return {"machine": platform.machine(), "python": platform.python_version()} | {n: version(n) for n in names}


def main() -> None:
    """Run what is asked for."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--worker", type=int, help=argparse.SUPPRESS)
    parser.add_argument("--json", type=Path, help="write the numbers here")
    parser.add_argument("--page", action="store_true", help="write docs/benchmarks/linear.md")
    options = parser.parse_args()
    if options.worker:
        print(json.dumps(worker(options.worker)))
        return
    found = {
        "setting": setting(),
        "modes": eigenmodes(),
        "responses": responses(),
        "loci": loci(),
        "large": large(),
    }
    if options.json:
        options.json.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
    text = linear_page(found)
    if options.page:
        PAGE.write_text(text, encoding="utf-8")
    else:
        print(text)


if __name__ == "__main__":
    main()
