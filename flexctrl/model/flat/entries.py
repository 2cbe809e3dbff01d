"""Matrices entry by entry: every stored entry of K, C and M is a piece of its own."""

from __future__ import annotations

from functools import cache

from flexctrl.kernels.kernel import Kernel

__all__ = ["entry", "entry_energy", "entry_slope"]


@cache
def entry(parts: int) -> Kernel:
    """Load − (k q + c v + m a), q being the sum of some parts."""
    import casadi as ca

    x, p = ca.SX.sym("x", parts + 2), ca.SX.sym("p", 4)
    return Kernel("entry", x, p, p[3] - (p[0] * ca.sum1(x[:parts]) + p[1] * x[parts] + p[2] * x[parts + 1]))


@cache
def entry_slope() -> Kernel:
    """What an entry adds to the tangent."""
    import casadi as ca

    seeds, p = ca.SX.sym("seeds", 3), ca.SX.sym("p", 4)
    return Kernel("entry_slope", seeds, p, -ca.dot(seeds, p[:3]))


@cache
def entry_energy(parts: int) -> Kernel:
    """½ v m v, ½ q k q − load q, and v c v of one entry: kinetic, stored, dissipated; q is the sum of some parts."""
    import casadi as ca

    x, p = ca.SX.sym("x", 2 * (parts + 1)), ca.SX.sym("p", 4)
    v, other = x[parts], x[2 * parts + 1]
    q, across = ca.sum1(x[:parts]), ca.sum1(x[parts + 1 : 2 * parts + 1])
    stored = 0.5 * p[0] * q * across - p[3] * q
    return Kernel("entry_energy", x, p, ca.vertcat(0.5 * p[2] * v * other, stored, p[1] * v * other))
