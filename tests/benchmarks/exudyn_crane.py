"""The paper's ceiling crane by Exudyn: an independent reference and a fair race.

Needs the extra ``[bench]``. Run as a script it writes ``tests/data/ceiling_crane_exudyn.csv`` (a minute or two)
or, with ``--times``, prints how long Exudyn takes for coarse meshes.

The model is Exudyn's ``ANCFCable``: r(s) is cubic on an element, the energy is
``EA (|r'| - 1)^2 / 2 + EI |r' x r''|^2 / (2 |r'|^4)`` per length, and sections have no rotary inertia and no
torsion. Members that a pin joins have nodes of their own, tied by spherical joints at position level.
"""

from __future__ import annotations

import argparse
import sys
import time
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

sys.exudynFast = True  # type: ignore[attr-defined]  # Exudyn reads this on import: no range checks

import exudyn as exu  # noqa: E402
import exudyn.itemInterface as item  # noqa: E402

GRAVITY = 9.81
PUSH = 500.0
MASS_PER_LENGTH = 1.0
AXIAL_STIFFNESS = 2e5 * np.pi
BENDING_STIFFNESS = 157.0
GIRDER_MEMBERS, CHAIN_LINKS = 6, 3
DURATION = 0.05
SAMPLING = 1e-4
DATA = Path(__file__).resolve().parents[1] / "data" / "ceiling_crane_exudyn.csv"


@dataclass(frozen=True)
class Newton:
    """Newton's stopping criterion: residual below ``relative`` times the step's first one plus ``absolute``."""

    relative: float
    absolute: float


FAST = Newton(relative=1e-5, absolute=1e-7)
TIGHT = Newton(relative=1e-8, absolute=1e-8)  # 1e-9 changes the curves by 1e-11 m; 1e-11 is below round-off


class CraneRun(NamedTuple):
    """Time (s), x1 - x4 (m), z13 (m), each of shape (samples,); CPU time of the solver alone (s)."""

    t: NDArray[np.float64]
    x1_minus_x4: NDArray[np.float64]
    z13: NDArray[np.float64]
    seconds: float


class _Nodes(NamedTuple):
    girder: list[int]
    links: list[list[int]]


def exudyn_crane(
    elements_per_member: int, step: float, newton: Newton = FAST, *, reduced_integration: bool = False
) -> CraneRun:
    """The crane's first 50 ms after the push, from the straight undeformed state at rest.

    Parameters
    ----------
    elements_per_member : int
        Cable elements on each 1 m member (six in the girder, three in the chain).
    step : float
        Time step of generalised alpha with spectral radius 0.9 (s); a divisor of 0.1 ms samples exactly.
    newton : Newton
        ``FAST`` to race, ``TIGHT`` for a reference.
    reduced_integration : bool
        Exudyn's cheaper Gauss rules (order 7 axial, 3 bending, instead of 9 and 5).

    Returns
    -------
    CraneRun
        Sampled every 0.1 ms (or every step, if longer) from t = 0.

    Raises
    ------
    exudyn.SolverError
        Newton's method did not converge.
    """
    container = exu.SystemContainer()  # owns the system: must outlive it
    mbs = container.AddSystem()
    nodes = _add_crane(mbs, elements_per_member, reduced_integration)
    for end in (nodes.girder[0], nodes.girder[-1]):
        _hold(mbs, end, "yz")
        mbs.AddLoad(item.LoadCoordinate(markerNumber=_coordinate(mbs, end, "x"), load=PUSH))
    watched = (nodes.girder[0], _middle(nodes), nodes.links[-1][-1])
    sensors = [_position_sensor(mbs, node) for node in watched]
    mbs.Assemble()
    settings = _dynamic_settings(step, newton)
    started = time.process_time()
    mbs.SolveDynamic(settings)
    seconds = time.process_time() - started
    outer, centre, load = (np.asarray(mbs.GetSensorStoredData(sensor)) for sensor in sensors)
    return CraneRun(outer[:, 0], outer[:, 1] - centre[:, 1], load[:, 3], seconds)


def exudyn_gravity_sag(elements_per_member: int) -> float:
    """z4 at rest under gravity (m), the girder's ends held in x, y and z and free to turn.

    The chain is kept on the vertical through node 4: without tension yet it is a mechanism, and at rest it hangs
    there in any case.
    """
    container = exu.SystemContainer()  # owns the system: must outlive it
    mbs = container.AddSystem()
    nodes = _add_crane(mbs, elements_per_member, reduced_integration=False)
    for end in (nodes.girder[0], nodes.girder[-1]):
        _hold(mbs, end, "xyz")
    for link in nodes.links:
        _hold(mbs, link[-1], "xy")
    mbs.Assemble()
    settings = exu.SimulationSettings()
    settings.staticSolver.numberOfLoadSteps = 20
    settings.staticSolver.verboseMode = 0
    settings.solution.file.write = False
    settings.linearSolver.solverType = exu.LinearSolverType.EigenSparse
    mbs.SolveStatic(settings)
    return float(np.asarray(mbs.GetNodeOutput(_middle(nodes), exu.OutputVariableType.Position))[2])


def write_reference(path: Path, elements_per_member: int = 32, step: float = 5e-6) -> None:
    """Run the converged crane and store it as comma-separated t, x1_minus_x4, z13."""
    run = exudyn_crane(elements_per_member, step, TIGHT)
    header = (
        f"Ceiling crane of the paper by Exudyn {exu.config.Version()}, ANCFCable, "
        f"{elements_per_member} elements per member\n"
        f"generalised alpha, spectral radius 0.9, step {step:g} s; Newton: relative tolerance {TIGHT.relative:g}, "
        f"absolute {TIGHT.absolute:g}\n"
        "t in s, x1_minus_x4 and z13 in m; made by tests/benchmarks/exudyn_crane.py\n"
        "t,x1_minus_x4,z13"
    )
    table = np.column_stack(run[:3])
    np.savetxt(path, table, fmt=("%.4f", "%.12e", "%.12e"), delimiter=",", header=header)


def _add_crane(mbs: Any, elements_per_member: int, reduced_integration: bool) -> _Nodes:
    """Girder along y with node 4 at the origin, chain down -z, pins between, gravity; nothing held yet."""

    def line(start: tuple[float, ...], direction: tuple[float, ...], members: int) -> list[int]:
        return _add_line(mbs, start, direction, members, elements_per_member, reduced_integration)

    girder = line((0, -GIRDER_MEMBERS / 2, 0), (0, 1, 0), GIRDER_MEMBERS)
    links = [line((0, 0, -top), (0, 0, -1), 1) for top in range(CHAIN_LINKS)]
    nodes = _Nodes(girder, links)
    above = [_middle(nodes), *(link[-1] for link in links[:-1])]
    for upper, link in zip(above, links, strict=True):
        markers = [mbs.AddMarker(item.MarkerNodePosition(nodeNumber=node)) for node in (upper, link[0])]
        mbs.AddObject(item.ObjectJointSpherical(markerNumbers=markers))
    return nodes


def _add_line(
    mbs: Any,
    start: tuple[float, ...],
    direction: tuple[float, ...],
    members: int,
    elements_per_member: int,
    reduced_integration: bool,
) -> list[int]:
    length = 1.0 / elements_per_member
    origin, along = np.asarray(start, float), np.asarray(direction, float)
    nodes = [
        mbs.AddNode(item.NodePointSlope1(referenceCoordinates=[*(origin + i * length * along), *along]))
        for i in range(members * elements_per_member + 1)
    ]
    for pair in pairwise(nodes):
        cable = item.ObjectANCFCable(
            length=length,
            massPerLength=MASS_PER_LENGTH,
            bendingStiffness=BENDING_STIFFNESS,
            axialStiffness=AXIAL_STIFFNESS,
            nodeNumbers=list(pair),
            useReducedOrderIntegration=int(reduced_integration),
        )
        marker = mbs.AddMarker(item.MarkerBodyMass(bodyNumber=mbs.AddObject(cable)))
        mbs.AddLoad(item.LoadMassProportional(markerNumber=marker, loadVector=[0, 0, -GRAVITY]))
    return nodes


def _middle(nodes: _Nodes) -> int:
    return nodes.girder[len(nodes.girder) // 2]


def _coordinate(mbs: Any, node: int, axis: str) -> Any:
    return mbs.AddMarker(item.MarkerNodeCoordinate(nodeNumber=node, coordinate="xyz".index(axis)))


def _hold(mbs: Any, node: int, axes: str) -> None:
    ground = mbs.AddNode(item.NodePointGround())
    for axis in axes:
        markers = [_coordinate(mbs, ground, "x"), _coordinate(mbs, node, axis)]
        mbs.AddObject(item.ObjectConnectorCoordinate(markerNumbers=markers))


def _position_sensor(mbs: Any, node: int) -> Any:
    position = exu.OutputVariableType.Position
    return mbs.AddSensor(
        item.SensorNode(nodeNumber=node, outputVariableType=position, storeInternal=True, writeToFile=False)
    )


def _dynamic_settings(step: float, newton: Newton) -> Any:
    settings = exu.SimulationSettings()
    integration = settings.timeIntegration
    integration.endTime = DURATION
    integration.numberOfSteps = round(DURATION / step)
    integration.adaptiveStep = False
    integration.verboseMode = 0
    integration.generalizedAlpha.spectralRadius = 0.9
    integration.newton.useModifiedNewton = True
    integration.newton.relativeTolerance = newton.relative
    integration.newton.absoluteTolerance = newton.absolute
    settings.linearSolver.solverType = exu.LinearSolverType.EigenSparse
    settings.linearSolver.reuseAnalyzedPattern = True
    settings.parallel.numberOfThreads = 1
    settings.solution.file.write = False
    settings.solution.sensors.writePeriod = max(step, SAMPLING)
    return settings


def _print_times(repeats: int = 7) -> None:
    print("elements per member   best time of 500 steps of 0.1 ms, ms (full / reduced integration)")
    for elements in (1, 2, 4, 8, 16):
        best = [
            min(exudyn_crane(elements, 1e-4, reduced_integration=reduced).seconds for _ in range(repeats))
            for reduced in (False, True)
        ]
        print(f"{elements:19d}   {1e3 * best[0]:.1f} / {1e3 * best[1]:.1f}")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--times", action="store_true", help="only print run times of coarse meshes")
    if parser.parse_args().times:
        _print_times()
    else:
        write_reference(DATA)
