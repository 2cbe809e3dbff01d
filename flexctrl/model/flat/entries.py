"""Matrices entry by entry: every stored entry of K, C and M is a piece of its own."""

from __future__ import annotations

from functools import cache

from flexctrl.kernels.kernel import Kernel

__all__ = ["entry", "entry_energy", "entry_slope"]


@cache
def entry() -> Kernel:
    """Load − (k (q + step) + c v + m a)."""
    import casadi as ca

    x, p = ca.SX.sym("x", 4), ca.SX.sym("p", 4)
    return Kernel("entry", x, p, p[3] - (p[0] * (x[0] + x[1]) + p[1] * x[2] + p[2] * x[3]))


@cache
def entry_slope() -> Kernel:
    """What an entry adds to the tangent."""
    import casadi as ca

    seeds, p = ca.SX.sym("seeds", 3), ca.SX.sym("p", 4)
    return Kernel("entry_slope", seeds, p, -ca.dot(seeds, p[:3]))


@cache
def entry_energy() -> Kernel:
    """½ v m v, ½ q k q − load q, and v c v of one entry: kinetic, stored, dissipated."""
    import casadi as ca

    x, p = ca.SX.sym("x", 4), ca.SX.sym("p", 4)
    stored = 0.5 * p[0] * x[0] * x[2] - p[3] * x[0]
    return Kernel("entry_energy", x, p, ca.vertcat(0.5 * p[2] * x[1] * x[3], stored, p[1] * x[1] * x[3]))
