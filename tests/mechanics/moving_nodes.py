"""Nodes in motion: symbols for kernels, numbers for tests, and Lagrange's equations by differentiation."""

from __future__ import annotations

import casadi as ca
import numpy as np
from scipy.spatial.transform import Rotation

from flexctrl.mechanics.corotation import NodeMotion

SLOT = 24


def node(z: ca.SX) -> NodeMotion:
    """x, R row by row, v, w, a, b."""
    return NodeMotion(z[:3], ca.reshape(z[3:12], 3, 3).T, z[12:15], z[15:18], z[18:21], z[21:24])


def slot(x, R, v=(0, 0, 0), w=(0, 0, 0), a=(0, 0, 0), b=(0, 0, 0)) -> np.ndarray:
    return np.concatenate([x, np.asarray(R).ravel(), v, w, a, b]).astype(float)


def moved(z: ca.SX, d: ca.SX, rate: ca.SX) -> NodeMotion:
    """A node at exp(δθ) R, x + δx whose coordinates δ change at ``rate``; right to first order in δ."""
    n = node(z)
    spin = rate[3:] + 0.5 * ca.cross(d[3:], rate[3:])
    return NodeMotion(n.x + d[:3], n.R + ca.skew(d[3:]) @ n.R, rate[:3], spin, n.a, n.b)


def turned(slots: np.ndarray, Q: np.ndarray) -> np.ndarray:
    """The same motion seen after a turn of everything by Q."""
    blocks = slots.reshape(-1, SLOT).copy()
    for row in blocks:
        R = row[3:12].reshape(3, 3)
        row[:] = slot(Q @ row[:3], Q @ R, *(Q @ row[k : k + 3] for k in (12, 15, 18, 21)))
    return blocks.ravel()


def gradient(energy, count: int):
    """Function of the slots: gradient over spatial increments (δx, δθ) of each node, 6 count."""
    z, d = ca.SX.sym("z", SLOT * count), ca.SX.sym("d", 6 * count)
    at = [moved(z[SLOT * i : SLOT * (i + 1)], d[6 * i : 6 * i + 6], ca.SX(6, 1)) for i in range(count)]
    slope = ca.substitute(ca.gradient(energy(*at), d), d, ca.SX.zeros(6 * count))
    return numeric(slope, z)


def lagrange(kinetic, count: int):
    """Function of the slots: d/dt ∂T/∂δ̇ − ∂T/∂δ at δ = 0, where spins are δ̇ and their rates δ̈."""
    z = ca.SX.sym("z", SLOT * count)
    d, rate = ca.SX.sym("d", 6 * count), ca.SX.sym("rate", 6 * count)
    parts = [z[SLOT * i : SLOT * (i + 1)] for i in range(count)]
    T = kinetic(*(moved(p, d[6 * i : 6 * i + 6], rate[6 * i : 6 * i + 6]) for i, p in enumerate(parts)))
    momentum = ca.gradient(T, rate)
    second = ca.vertcat(*[p[18:24] for p in parts])
    left = ca.jtimes(momentum, d, rate) + ca.jtimes(momentum, rate, second) - ca.gradient(T, d)
    now = ca.vertcat(*[p[12:18] for p in parts])
    return numeric(ca.substitute(left, ca.vertcat(d, rate), ca.vertcat(ca.SX.zeros(6 * count), now)), z)


def kernel(make, count: int):
    """Function of the slots from an expression of the node motions."""
    z = ca.SX.sym("z", SLOT * count)
    return numeric(make(*(node(z[SLOT * i : SLOT * (i + 1)]) for i in range(count))), z)


def slopes(make, count: int):
    """Functions of the slots: ∂/∂(δ), ∂/∂(velocities), ∂/∂(accelerations) of an expression of the node motions."""
    z, d = ca.SX.sym("z", SLOT * count), ca.SX.sym("d", 6 * count)
    at = []
    for i in range(count):
        n, e = node(z[SLOT * i : SLOT * (i + 1)]), d[6 * i : 6 * i + 6]
        at.append(NodeMotion(n.x + e[:3], n.R + ca.skew(e[3:]) @ n.R, n.v, n.w, n.a, n.b))
    place = ca.substitute(ca.jacobian(make(*at), d), d, ca.SX.zeros(6 * count))
    force = make(*(node(z[SLOT * i : SLOT * (i + 1)]) for i in range(count)))
    by = [ca.vertcat(*[z[SLOT * i + k : SLOT * i + k + 6] for i in range(count)]) for k in (12, 18)]
    return numeric(place, z), *(numeric(ca.jacobian(force, v), z) for v in by)


def numeric(expression: ca.SX, z: ca.SX):
    function = ca.Function("f", [z], [expression])
    return lambda slots: np.array(function(slots)).squeeze()


def random_slots(seed: int, ends: np.ndarray, turn: float, push: float, speed: float) -> np.ndarray:
    """Nodes near ``ends``, all turned together at random, then each turned by ``turn`` and pushed, in motion."""
    rng = np.random.default_rng(seed)
    Q = Rotation.random(random_state=seed).as_matrix()
    rows = []
    for end in ends:
        own = Rotation.from_rotvec(turn * rng.normal(size=3)).as_matrix()
        rates = speed * rng.normal(size=(4, 3))
        rows.append(slot(Q @ (end + push * rng.normal(size=3)), Q @ own, *rates))
    return np.concatenate(rows)
