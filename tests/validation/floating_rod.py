"""Simeon's slider crank with an elastic rod in a floating frame, written independently of the package, by SUNDIALS.

The crank turns at a constant rate; the rod's points are p = l₁ (cos φ₁, sin φ₁) + R(φ₂)(x + u, w) with u and w sums of
a few shapes along it; its end slides on the x axis, which gives φ₂ and the place of the slider. Lagrange's equations of
what is left, by automatic differentiation; those of all coordinates then give the forces of the joints.
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


@dataclass(frozen=True)
class Rod:
    """How the rod is modelled.

    ``bowing`` 0 leaves its strain at u′, 1 adds w′²/2; ``heavy`` is a factor on the mass that stretching moves, and
    ``rotary`` the rotary inertia of a section, over ρA, that turns as the rod's chord does.
    """

    bends: int
    stretches: int
    bowing: float
    heavy: float = 1.0
    rotary: float = 0.0


TEST_SET = Rod(2, 0, 0.0, 15.0, WIDTH**2 / 12)
"""As in the program of the Test Set (crank.f), whose mass matrix of the stretches, 8, 1, 2, lacks a 1/15."""


def action(rod: Rod, places: ca.SX, rates: ca.SX) -> ca.SX:
    """T − V of rod and slider; coordinates φ₁, φ₂, place of the slider, bends, stretches."""
    crank = CRANK * ca.vertcat(ca.cos(places[0]), ca.sin(places[0]))
    e = ca.vertcat(ca.cos(places[1]), ca.sin(places[1]))
    bends, stretches = places[3 : 3 + rod.bends], places[3 + rod.bends :]
    total = 0.5 * SLIDER * rates[2] ** 2 + 0.5 * DENSITY * AREA * ROD * rod.rotary * rates[1] ** 2
    for point, weight in zip(*np.polynomial.legendre.leggauss(12), strict=True):
        s, piece = 0.5 * (point + 1.0), 0.5 * ROD * weight
        bend, slope, curvature, along, strain = Shapes(rod.bends, rod.stretches).at(s)
        w, u = ca.dot(bend, bends), ca.dot(along, stretches)
        moving = ca.jtimes(crank + (s * ROD + u) * e + w * ca.vertcat(-e[1], e[0]), places, rates)
        swollen = (rod.heavy - 1.0) * (ca.dot(along, rates[3 + rod.bends :]) ** 2 + (u * rates[1]) ** 2)
        pulled = ca.dot(strain, stretches) + 0.5 * rod.bowing * ca.dot(slope, bends) ** 2
        stored = YOUNG * AREA * pulled**2 + YOUNG * INERTIA * ca.dot(curvature, bends) ** 2
        total += 0.5 * piece * (DENSITY * AREA * (ca.dot(moving, moving) + swollen) - stored)
    return total


def equations(rod: Rod, places: ca.SX, rates: ca.SX) -> tuple[ca.SX, ca.SX]:
    """M and f of Lagrange's equations M a = f in all coordinates, the joints' forces left out."""
    total = action(rod, places, rates)
    momentum = ca.jacobian(total, rates).T
    return ca.jacobian(momentum, rates), ca.jacobian(total, places).T - ca.jacobian(momentum, places) @ rates


def motion(rod: Rod, times: list[float], tolerance: float) -> tuple[np.ndarray, np.ndarray]:
    """All coordinates and their rates at some times, shape (coordinates, times)."""
    n = rod.bends + 2 + rod.stretches
    q, v, t = ca.SX.sym("q", n), ca.SX.sym("v", n), ca.SX.sym("t")
    length = ROD + q[rod.bends + 1]
    phi = ca.asin(-CRANK * ca.sin(SPEED * t) / length)
    places = ca.vertcat(SPEED * t, phi, CRANK * ca.cos(SPEED * t) + length * ca.cos(phi), q)
    hang, drive = ca.jacobian(places, q), ca.jacobian(places, t)
    rates = hang @ v + drive
    own = ca.jacobian(rates, q) @ v + ca.jacobian(rates, t)
    P, V = ca.SX.sym("P", 3 + n), ca.SX.sym("V", 3 + n)
    M, f = ca.substitute(list(equations(rod, P, V)), [P, V], [places, rates])
    ode = ca.vertcat(v, ca.solve(hang.T @ M @ hang, hang.T @ (f - M @ own)))
    how = {"reltol": tolerance, "abstol": 1e-3 * tolerance, "max_num_steps": 10**6}
    march = ca.integrator("march", "cvodes", {"x": ca.vertcat(q, v), "t": t, "ode": ode}, 0.0, times, how)
    still, more = [0.0] * (rod.bends - 2), [0.0] * rod.stretches
    start = [*BENDS, *still, *STRETCH, *more, *BEND_RATES, *still, *STRETCH_RATES, *more]
    found = march(x0=start)["xf"]
    seen = ca.Function("seen", [t, ca.vertcat(q, v)], [places, rates]).map(len(times))(times, found)
    return seen[0].full(), seen[1].full()


def multipliers(rod: Rod, places: np.ndarray, rates: np.ndarray) -> np.ndarray:
    """λ in M a + Gᵀλ = f of the conditions: end on the axis, slider at the end, crank at its rate."""
    P, V = ca.SX.sym("P", places.size), ca.SX.sym("V", places.size)
    M, f = equations(rod, P, V)
    length = ROD + P[4 + rod.bends]
    across = CRANK * ca.sin(P[0]) + length * ca.sin(P[1])
    along = P[2] - CRANK * ca.cos(P[0]) - length * ca.cos(P[1])
    G = ca.jacobian(ca.vertcat(across, along, P[0]), P)
    M, f, G, gamma = (x.full() for x in ca.Function("all", [P, V], [M, f, G, ca.jtimes(G @ V, P, V)])(places, rates))
    held = np.linalg.solve(np.block([[M, G.T], [G, np.zeros((3, 3))]]), np.concatenate([f, -gamma]))
    return np.asarray(held[-3:, 0])
