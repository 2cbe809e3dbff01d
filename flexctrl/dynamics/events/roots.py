"""Where values known at some times within a step are zero."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

__all__ = ["comes_back", "nearly", "root"]

_HALVINGS = 20


def nearly(points: Sequence[tuple[float, float]], first: float) -> float:
    """Return where the parabola through three points is zero: two between which values change sign, and one beside."""
    i = [t for t, _ in points].index(first)
    (a, fa), (b, fb) = points[i : i + 2]
    c, fc = points[i + 2] if i + 2 < len(points) else points[i - 1]
    if a == b:  # so short is the step
        return a
    s = (c - a) / (b - a)
    bend = (fc - fa - (fb - fa) * s) / (s * (s - 1.0)) if c not in (a, b) else 0.0
    slope = fb - fa - bend
    q = -0.5 * (slope + math.copysign(math.sqrt(max(slope * slope - 4.0 * bend * fa, 0.0)), slope))
    roots = [r for r in (fa / q if q else 0.5, q / bend if bend else 0.5) if 0.0 <= r <= 1.0]
    return a + (b - a) * (roots[0] if roots else 0.5)


def comes_back(f: Callable[[float], float], a: float, b: float, fb: float, dust: float) -> float:
    """Return when what starts at zero comes back through it, having gone the other way than at b; a if it never does.

    A contact that has just broken loose may stick again within the step.
    """
    low = a
    for _ in range(_HALVINGS):
        t = 0.5 * (low + b)
        if (ft := f(t)) * fb < 0.0 and abs(ft) > dust:
            return root(f, (t, ft), (b, fb))
        if ft * fb > 0.0:
            b, fb = t, ft
        else:
            low = t
    return a


def root(f: Callable[[float], float], first: tuple[float, float], last: tuple[float, float]) -> float:
    """Return a root between two times to round-off; the values there hold: a curve meets them but for round-off."""
    from scipy.optimize import brentq

    known, (a, _), (b, _) = dict((first, last)), first, last
    smallest = 4e-16 * max(abs(a), abs(b)) + 1e-300
    return float(brentq(lambda t: known[t] if t in known else f(t), a, b, xtol=smallest, rtol=1e-15))
