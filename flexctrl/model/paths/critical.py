"""Points of a path at which the machine gives way: the load turns back, or another path crosses."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress

import numpy as np
import scipy.sparse as sp

from flexctrl.errors import SingularMatrixError
from flexctrl.model.paths.course import Course, Direction, Station
from flexctrl.model.solve import factorise

__all__ = ["Gauge", "across", "branching_between", "limit_between", "reached", "softest"]

Gauge = Callable[[Station], float]


def limit_between(course: Course, start: Station, length: float) -> Station:
    """Return the station within a step at which the load factor stands still."""
    return reached(course, start, length, lambda s: s.tangent.factor / course.factor_scale)[0]


def branching_between(course: Course, start: Station, length: float) -> Station:
    """Return the station within a step at which the stiffness is singular though the load goes on."""
    border = softest(course, course.step(start, start.tangent, length) or start)

    def singular(station: Station) -> float:
        """What a force along the softest shape must be for that shape to be displaced by one: ∝ det K."""
        K = course.stiffness(station.state, station.factor)
        size = float(np.abs(K.diagonal()).max())
        column = sp.csr_matrix(size * border[:, None])
        system = sp.bmat([[K, column], [column.T, None]], "csr")
        return float(factorise(system)(np.append(np.zeros(len(border)), size))[-1])

    return reached(course, start, length, singular)[0]


def reached(course: Course, start: Station, length: float, gauge: Gauge) -> tuple[Station, float]:
    """Return where within a step a gauge, of opposite signs at both ends, is zero, and how far along the step."""
    known: dict[float, Station] = {0.0: start}

    def value(at: float) -> float:
        found = known.get(at) or course.step(start, start.tangent, at)
        if found is None:
            raise SingularMatrixError(0)
        known[at] = found
        return gauge(found)

    if value(0.0) * value(length) > 0.0:
        return known[length], length
    from scipy.optimize import brentq

    with suppress(SingularMatrixError):
        brentq(value, 0.0, length, xtol=1e-12 * max(length, 1e-6), rtol=8.9e-16, maxiter=60)
    best = min((at for at in known if at), key=lambda at: abs(gauge(known[at])))
    return known[best], best


def softest(course: Course, station: Station) -> np.ndarray:
    """Return the displacement of the free coordinates that the machine resists least, of length one."""
    from scipy.sparse.linalg import splu

    K = course.stiffness(station.state, station.factor)
    K = (0.5 * (K + K.T)).tocsc()
    scale = 1.0 / np.sqrt(course.weight)
    scaled = sp.diags(scale) @ K @ sp.diags(scale)
    scaled = (scaled + 1e-14 * float(np.abs(scaled.data).max()) * sp.identity(K.shape[0])).tocsc()
    solve = splu(scaled).solve
    shape = np.random.default_rng(0).standard_normal(K.shape[0])
    for _ in range(8):
        shape = solve(shape)
        shape /= np.linalg.norm(shape)
    return np.asarray(scale * shape)


def across(course: Course, station: Station, shape: np.ndarray) -> Direction:
    """Return the direction of a shape less its share of the path's own direction."""
    away = Direction(shape, 0.0)
    share = course.product(away, station.tangent)
    return course.unit(Direction(shape - share * station.tangent.place, -share * station.tangent.factor))
