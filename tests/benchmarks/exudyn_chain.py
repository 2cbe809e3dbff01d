"""A hanging or swinging chain by Exudyn: cable elements in a row, held at one end."""

from __future__ import annotations

import math
import time
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from exudyn_crane import FAST, _dynamic_settings, _hold, _position_sensor, exu, item
from numpy.typing import NDArray

GRAVITY, MASS_PER_LENGTH, AXIAL_STIFFNESS, BENDING_STIFFNESS, LENGTH = 9.81, 1.0, 2e5 * math.pi, 1.0, 10.0


class ChainRun(NamedTuple):
    """Place of the free end at the end (m), CPU seconds of the solver alone, Newton iterations."""

    tip: NDArray[np.float64]
    seconds: float
    newton: int


def exudyn_chain(elements: int, angle: float, step: float, steps: int) -> ChainRun:
    """A chain released from rest, straight and without tension, at an angle from the vertical (rad).

    Raises
    ------
    exudyn.SolverError
        Newton's method did not converge.
    """
    container = exu.SystemContainer()  # owns the system: must outlive it
    mbs = container.AddSystem()
    last = _add_chain(mbs, elements, np.array([math.sin(angle), 0.0, -math.cos(angle)]))
    sensor = _position_sensor(mbs, last)
    mbs.Assemble()
    settings = _dynamic_settings(step, FAST)
    settings.timeIntegration.endTime, settings.timeIntegration.numberOfSteps = step * steps, steps
    settings.solution.sensors.writePeriod = step
    started = time.process_time()
    mbs.SolveDynamic(settings)
    seconds = time.process_time() - started
    return ChainRun(
        np.asarray(mbs.GetSensorStoredData(sensor))[-1, 1:], seconds, mbs.sys["dynamicSolver"].it.newtonStepsCount
    )


def _add_chain(mbs: Any, elements: int, along: NDArray[np.float64]) -> int:
    """Add the chain, held at its first node; return the last node."""
    length = LENGTH / elements
    nodes = [
        mbs.AddNode(item.NodePointSlope1(referenceCoordinates=[*(i * length * along), *along]))
        for i in range(elements + 1)
    ]
    for pair in pairwise(nodes):
        cable = item.ObjectANCFCable(
            length=length,
            massPerLength=MASS_PER_LENGTH,
            bendingStiffness=BENDING_STIFFNESS,
            axialStiffness=AXIAL_STIFFNESS,
            nodeNumbers=list(pair),
            useReducedOrderIntegration=1,
        )
        marker = mbs.AddMarker(item.MarkerBodyMass(bodyNumber=mbs.AddObject(cable)))
        mbs.AddLoad(item.LoadMassProportional(markerNumber=marker, loadVector=[0, 0, -GRAVITY]))
    _hold(mbs, nodes[0], "xyz")
    return nodes[-1]
