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
    there = course.step(start, start.tangent, length) or start
    scale = _evening(course.stiffness(there.state, there.factor))
    border = softest(course, there) / scale
    column = sp.csr_matrix((border / np.linalg.norm(border))[:, None])

    def singular(station: Station) -> float:
        """What a force along the softest shape must be for that shape to be displaced by one: ∝ det K."""
        K = sp.diags(scale) @ course.stiffness(station.state, station.factor) @ sp.diags(scale)
        system = sp.bmat([[K, column], [column.T, None]], "csr")
        force = abs(float(factorise(system)(np.append(np.zeros(len(border)), 1.0))[-1]))
        return force if station.turned == start.turned else -force

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
    scale = _evening(K)
    scaled = sp.diags(scale) @ (0.5 * (K + K.T)) @ sp.diags(scale)
    solve = splu((scaled + 1e-14 * sp.identity(K.shape[0])).tocsc()).solve
    shape = np.random.default_rng(0).standard_normal(K.shape[0])
    for _ in range(8):
        shape = solve(shape)
        shape /= np.linalg.norm(shape)
    shape = scale * shape
    return np.asarray(shape / np.sqrt(shape @ (course.weight * shape)))


def _evening(K: sp.csr_matrix) -> np.ndarray:
    """Return what rows and columns times that have a diagonal of ones, however stiff and soft freedoms are."""
    size = np.sqrt(np.abs(K.diagonal()))
    return 1.0 / np.where(size > 0.0, size, 1.0)


def across(course: Course, station: Station, shape: np.ndarray) -> Direction:
    """Return the direction of a shape less its share of the path's own direction."""
    away = Direction(shape, 0.0)
    share = course.product(away, station.tangent)
    return course.unit(Direction(shape - share * station.tangent.place, -share * station.tangent.factor))
