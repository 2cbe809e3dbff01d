"""A geometrically exact rod of one spectral element, written independently of the package: BeamDyn's equations.

Displacements and Wiener–Milenković parameters c = 4 tan(φ/4) n are polynomials through the nodes (Gauss–Lobatto),
strains are Reissner's, integrals are Gauss's. In time: generalised alpha on these coordinates.
"""

from __future__ import annotations

import casadi as ca
import numpy as np
from numpy.polynomial import legendre

Functions = tuple[ca.Function, ca.Function, int]


def rotation(c: ca.SX) -> ca.SX:
    squared = ca.dot(c, c)
    first = 2.0 - squared / 8.0
    turned = (first**2 - squared) * ca.SX.eye(3) + 2.0 * first * ca.skew(c) + 2.0 * c @ c.T
    return turned / (4.0 - first) ** 2


def shapes(order: int, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Values and slopes of the polynomials through the nodes, on −1 … 1."""
    last = np.zeros(order + 1)
    last[order] = 1.0
    nodes = np.concatenate([[-1.0], np.sort(legendre.legroots(legendre.legder(last))), [1.0]])
    powers = np.linalg.inv(np.vander(nodes, increasing=True))
    slopes = np.array([[k * g ** max(k - 1, 0) for k in range(order + 1)] for g in points])
    return np.vander(points, order + 1, increasing=True) @ powers, slopes @ powers


def cantilever(nodes: int, length: float, law: np.ndarray, mass: float, inertia: np.ndarray, load: float) -> Functions:
    """Residual of the equations of motion and its three slopes as functions of (q, v, a); clamped at the first node."""
    order, n = nodes - 1, 6 * (nodes - 1)
    points, weights = legendre.leggauss(nodes)
    N, D = shapes(order, points)
    q, v, a, c = (ca.SX.sym(name, size) for name, size in (("q", n), ("v", n), ("a", n), ("c", 3)))
    spread = ca.jacobian(ca.vec(rotation(c)), c)
    stored, kinetic = ca.SX(0), ca.SX(0)

    def field(values: ca.SX, row: np.ndarray) -> ca.SX:
        return ca.horzcat(ca.SX(6, 1), ca.reshape(values, 6, order)) @ ca.DM(row)

    def axial(R: ca.SX, at: ca.SX, rate: ca.SX) -> ca.SX:
        S = R.T @ ca.reshape(ca.substitute(spread, c, at) @ rate, 3, 3)
        return ca.vertcat(S[2, 1], S[0, 2], S[1, 0])

    for i, weight in enumerate(0.5 * length * weights):
        place, slope, rate = field(q, N[i]), field(q, D[i]) * 2.0 / length, field(v, N[i])
        R, along = rotation(place[3:]), ca.DM([1.0, 0.0, 0.0])
        strain = ca.vertcat(R.T @ (along + slope[:3]) - along, axial(R, place[3:], slope[3:]))
        spin = axial(R, place[3:], rate[3:])
        stored += 0.5 * weight * ca.dot(strain, ca.DM(law) @ strain)
        kinetic += 0.5 * weight * (mass * ca.dot(rate[:3], rate[:3]) + ca.dot(spin, ca.DM(inertia) @ spin))
    momenta, push = ca.gradient(kinetic, v), ca.SX(n, 1)
    push[n - 4] = load
    inert = ca.jtimes(momenta, q, v) + ca.jtimes(momenta, v, a) - ca.gradient(kinetic, q)
    residual = ca.cse(inert + ca.gradient(stored, q) - push)
    slopes = [ca.jacobian(residual, x) for x in (q, v, a)]
    return ca.Function("residual", [q, v, a], [residual]), ca.Function("slopes", [q, v, a], slopes), n


def tip(rod: Functions, step: float, rho: float, until: float) -> tuple[np.ndarray, np.ndarray]:
    """Times and the tip's displacement along the load, from rest under the load."""
    residual, slopes, n = rod
    alpha_m, alpha_f = (2.0 * rho - 1.0) / (rho + 1.0), rho / (rho + 1.0)
    gamma = 0.5 + alpha_f - alpha_m
    beta, share = 0.25 * (gamma + 0.5) ** 2, (1.0 - alpha_f) / (1.0 - alpha_m)
    q, v = np.zeros((2, n))
    a = np.linalg.solve(slopes(q, v, q)[2].full(), -residual(q, v, q).full().ravel())
    own, found = a.copy(), [0.0]
    for _ in range(round(until / step)):
        new = a.copy()
        for _ in range(30):
            last = ((1.0 - alpha_f) * new + alpha_f * a - alpha_m * own) / (1.0 - alpha_m)
            moved = q + step * v + step**2 * ((0.5 - beta) * own + beta * last)
            rates = v + step * ((1.0 - gamma) * own + gamma * last)
            K, C, M = (s.full() for s in slopes(moved, rates, new))
            tangent = M + share * (gamma * step * C + beta * step**2 * K)
            correction = np.linalg.solve(tangent, -residual(moved, rates, new).full().ravel())
            new = new + correction
            if np.abs(correction).max() * beta * step**2 < 1e-11:
                break
        else:
            raise RuntimeError("the spectral rod did not converge")
        last = ((1.0 - alpha_f) * new + alpha_f * a - alpha_m * own) / (1.0 - alpha_m)
        q = q + step * v + step**2 * ((0.5 - beta) * own + beta * last)
        v = v + step * ((1.0 - gamma) * own + gamma * last)
        a, own = new, last
        found.append(q[n - 4])
    return step * np.arange(len(found)), np.array(found)
