"""Simeon's slider crank with an elastic rod in a floating frame, written independently of the package, by SUNDIALS.

The crank turns at a constant rate; the rod's points are p = l₁ (cos φ₁, sin φ₁) + R(φ₂)(x + u, w) with u and w sums of
a few shapes along it; its end slides on the x axis, which gives φ₂. Lagrange's equations of what is left, by automatic
differentiation. ``bowing`` 0 leaves the strain at u′, as the IVP Test Set does; 1 adds w′²/2.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np

CRANK, ROD, SPEED, SLIDER = 0.15, 0.30, 150.0, 0.075552
DENSITY, YOUNG, WIDTH = 7870.0, 2e11, 8e-3
AREA, INERTIA = WIDTH**2, WIDTH**4 / 12
BENDS, BEND_RATES = (0.0, 0.0), (0.444896112581599, 4.63433931923867e-3)
STRETCH, STRETCH_RATES = (1.03339863e-5, 1.69327969e-5), (-1.78591076000055e-6, -2.68938671997904e-6)
"""Where the motion starts without ringing: amplitudes of sin πs and sin 2πs, stretch at the middle and at the end."""


@dataclass(frozen=True)
class Shapes:
    """Values and slopes of the shapes along the rod at s = x/l, and curvatures of the first ``bends``."""

    bends: int
    stretches: int

    def at(self, s: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        k, m = np.pi * np.arange(1, self.bends + 1), 2.0 * np.pi * np.arange(1, self.stretches + 1)
        along = np.concatenate([[4 * s * (1 - s), s * (2 * s - 1)], np.sin(m * s)])
        strain = np.concatenate([[4 - 8 * s, 4 * s - 1], m * np.cos(m * s)]) / ROD
        return np.sin(k * s), k * np.cos(k * s) / ROD, -((k / ROD) ** 2) * np.sin(k * s), along, strain


def ends(bends: int, stretches: int, bowing: float, until: float, tolerance: float) -> tuple[float, float, np.ndarray]:
    """φ₂, the place of the slider and the amplitudes (bending; stretch at middle and end; more stretch) at a time."""
    n = bends + 2 + stretches
    q, v, t = ca.SX.sym("q", n), ca.SX.sym("v", n), ca.SX.sym("t")
    pin = CRANK * ca.vertcat(ca.cos(SPEED * t), ca.sin(SPEED * t))
    phi = ca.asin(-pin[1] / (ROD + q[bends + 1]))
    e = ca.vertcat(ca.cos(phi), ca.sin(phi))

    def rate(of: ca.SX) -> ca.SX:
        return ca.jacobian(of, t) + ca.jacobian(of, q) @ v

    action = 0.5 * SLIDER * rate((pin + (ROD + q[bends + 1]) * e)[0]) ** 2
    for point, weight in zip(*np.polynomial.legendre.leggauss(8), strict=True):
        s, piece = 0.5 * (point + 1.0), 0.5 * ROD * weight
        bend, slope, curvature, along, strain = Shapes(bends, stretches).at(s)
        w, u = ca.dot(bend, q[:bends]), ca.dot(along, q[bends:])
        moving = rate(pin + (s * ROD + u) * e + w * ca.vertcat(-e[1], e[0]))
        pulled = ca.dot(strain, q[bends:]) + 0.5 * bowing * ca.dot(slope, q[:bends]) ** 2
        stored = YOUNG * AREA * pulled**2 + YOUNG * INERTIA * ca.dot(curvature, q[:bends]) ** 2
        action += 0.5 * piece * (DENSITY * AREA * ca.dot(moving, moving) - stored)
    momentum = ca.jacobian(action, v).T
    forces = ca.jacobian(action, q).T - ca.jacobian(momentum, q) @ v - ca.jacobian(momentum, t)
    ode = ca.vertcat(v, ca.solve(ca.jacobian(momentum, v), forces))
    how = {"reltol": tolerance, "abstol": 1e-3 * tolerance, "max_num_steps": 10**6}
    march = ca.integrator("march", "cvodes", {"x": ca.vertcat(q, v), "t": t, "ode": ode}, 0.0, [until], how)
    still, more = [0.0] * (bends - 2), [0.0] * stretches
    start = [*BENDS, *still, *STRETCH, *more, *BEND_RATES, *still, *STRETCH_RATES, *more]
    found = march(x0=start)["xf"][:n]
    place = ca.Function("place", [t, q], [phi, pin[0] + (ROD + q[bends + 1]) * e[0]])(until, found)
    return float(place[0]), float(place[1]), found.full().ravel()
