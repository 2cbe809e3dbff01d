"""A point that travels along a bent beam: the cubic through the nodes of an element along their turned axes."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import casadi as ca

__all__ = ["travelled", "travelling"]


def travelled(s: ca.SX, places: Sequence[float], nodes: Sequence[tuple[ca.SX, ca.SX]]) -> ca.SX:
    """Return r(s), the place of a point that has travelled to s.

    r = h₀ x_a + h₁ L t_a + h₂ x_b + h₃ L t_b with Hermite's cubics h of ξ = (s − s_a)/L, in the element in which s
    is. With t_a and t_b the axes of the nodes' sections it has one tangent over all borders, and moves as the
    element's own cubic does to first order in its deformations.

    Parameters
    ----------
    s : casadi.SX
    places : sequence of float
        s of the nodes, rising.
    nodes : sequence of (casadi.SX, casadi.SX)
        Place x of each node, and the axis t of its section, in space axes.

    Returns
    -------
    casadi.SX, 3
    """
    import casadi as ca

    xi, length, inside = _within(s, places)
    h = (1.0 - xi * xi * (3.0 - 2.0 * xi), xi * (1.0 - xi) ** 2, xi * xi * (3.0 - 2.0 * xi), xi * xi * (xi - 1.0))
    a, b = _ends(inside, [ca.vertcat(x, t) for x, t in nodes])
    return h[0] * a[:3] + h[1] * length * a[3:] + h[2] * b[:3] + h[3] * length * b[3:]


def travelling(
    s: ca.SX, rate: ca.SX, places: Sequence[float], nodes: Sequence[tuple[ca.SX, ca.SX, ca.SX, ca.SX]]
) -> ca.SX:
    """Return the velocity of a point that travels at a rate: that of the beam under it, and r' ṡ.

    Parameters
    ----------
    s, rate : casadi.SX
    places : sequence of float
        s of the nodes, rising.
    nodes : sequence of 4 casadi.SX
        Of each node x, t and how fast they change.

    Returns
    -------
    casadi.SX, 3
    """
    import casadi as ca

    xi, length, inside = _within(s, places)
    h = (1.0 - xi * xi * (3.0 - 2.0 * xi), xi * (1.0 - xi) ** 2, xi * xi * (3.0 - 2.0 * xi), xi * xi * (xi - 1.0))
    d = (6.0 * xi * (xi - 1.0), (1.0 - xi) * (1.0 - 3.0 * xi), 6.0 * xi * (1.0 - xi), xi * (3.0 * xi - 2.0))
    a, b = _ends(inside, [ca.vertcat(*node) for node in nodes])
    along = (d[0] * a[:3] + d[2] * b[:3]) / length + d[1] * a[3:6] + d[3] * b[3:6]
    carried = h[0] * a[6:9] + h[1] * length * a[9:] + h[2] * b[6:9] + h[3] * length * b[9:]
    return carried + along * rate


def _within(s: ca.SX, places: Sequence[float]) -> tuple[ca.SX, ca.SX, list[ca.SX]]:
    """Return ξ in the element in which s is, its length, and of each element whether it is that one (1 or 0).

    Beyond the ends the first and the last element go on.
    """
    import casadi as ca

    passed = [ca.SX(1), *(s >= place for place in places[1:-1]), ca.SX(0)]
    inside = [before - after for before, after in pairwise(passed)]
    start = sum((w * a for w, a in zip(inside, places, strict=False)), ca.SX(0))
    length = sum((w * (b - a) for w, (a, b) in zip(inside, pairwise(places), strict=True)), ca.SX(0))
    return (s - start) / length, length, inside


def _ends(inside: Sequence[ca.SX], nodes: Sequence[ca.SX]) -> tuple[ca.SX, ca.SX]:
    """Return what belongs to both nodes of the element."""
    zero = 0.0 * nodes[0]
    first = sum((w * node for w, node in zip(inside, nodes, strict=False)), zero)
    second = sum((w * node for w, node in zip(inside, nodes[1:], strict=False)), zero)
    return first, second
