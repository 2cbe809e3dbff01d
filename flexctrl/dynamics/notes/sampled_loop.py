"""A machine under a sampled law from sample to sample: as it moves, and as steps have it move."""

from __future__ import annotations

from functools import cached_property, reduce
from typing import NamedTuple

import numpy as np
import scipy.linalg as la

from flexctrl.dynamics.alpha.point import Coefficients
from flexctrl.dynamics.notes.heavy import without_light
from flexctrl.dynamics.swift.easing import eased_change, eased_rate, felt_rate, unresolved
from flexctrl.frozen import frozen

__all__ = ["Answers", "SampledLoop"]

_SURE = 0.1
_BEYOND = "it has gone beyond what numbers can tell"


class Answers(NamedTuple):
    """How a law's commands u and its next state x⁺ change with what it reads and with its state."""

    u_y: np.ndarray
    u_x: np.ndarray
    x_y: np.ndarray
    x_x: np.ndarray


@frozen(eq=False)
class SampledLoop:
    """A machine, linear about a state, under a sampled law.

    Attributes
    ----------
    M, C, K : numpy.ndarray, shape (n, n)
        M q̈ + C q̇ + K q = B u.
    B : numpy.ndarray, shape (n, inputs)
    reads, reads_rate : numpy.ndarray, shape (read, n)
        What the law reads of q and of q̇.
    law : Answers
    sample : float
        [s]
    heavy : numpy.ndarray of bool, shape (n,)
        What has mass.
    flows, settling : numpy.ndarray of int
        Inner freedoms of first order; those of them that settle by themselves.
    later : tuple of Answers
        Of the samples that follow, where the law counts them, until it does the same again.
    """

    M: np.ndarray
    C: np.ndarray
    K: np.ndarray
    B: np.ndarray
    reads: np.ndarray
    reads_rate: np.ndarray
    law: Answers
    sample: float
    heavy: np.ndarray
    flows: np.ndarray
    settling: np.ndarray
    later: tuple[Answers, ...] = ()

    @cached_property
    def _between(self) -> tuple[np.ndarray, ...]:
        if not all(np.isfinite(part).all() for part in (self.M, self.C, self.K, self.B, *self.law)):
            raise ArithmeticError(_BEYOND)
        machine = without_light(self.M, self.C, self.K, self.B, (self.reads, self.reads_rate), self.heavy, self.sample)
        return machine.in_modes()

    def poles(self, least: float) -> np.ndarray:
        """Return the loop's own poles, from sample to sample; the machine moves exactly between.

        Parameters
        ----------
        least : float
            Those farther out than this, at least 1.

        Returns
        -------
        numpy.ndarray of complex
        """
        A, B, C, D = self._between
        return self._turned(least, *_over(A, B, self.sample), C, D)

    def stepped(self, rho: float, count: int, least: float) -> np.ndarray:
        """Return the poles of the loop as steps of generalised alpha have it.

        Parameters
        ----------
        rho : float
            Their spectral radius at infinite frequency.
        count : int
            Steps in a sample.
        least : float
            As for `poles`.

        Returns
        -------
        numpy.ndarray of complex
        """
        n, m, h = len(self.M), self.B.shape[1], self.sample / count
        step, pushed = self._step(rho, h)
        fresh, leap = self._renewed(Coefficients.of(rho), h)
        total, force = np.eye(4 * n), np.zeros((4 * n, m))
        for _ in range(count):
            total, force = step @ total, step @ force + pushed
        reads = np.hstack([self.reads, self.reads_rate / h, np.zeros((len(self.reads), 2 * n))])
        return self._turned(least, total @ fresh, force, reads, np.zeros((len(reads), m)), total @ leap)

    def _renewed(self, c: Coefficients, h: float) -> tuple[np.ndarray, np.ndarray]:
        """What becomes of (q, h q̇, h² a, h² q̈) as inputs jump, and what their change adds; see `alpha.outset`.

        Rates of first order jump with them, and how these change begins anew; all others feel what they jump by.
        """
        n, m, heavy, first = len(self.M), self.B.shape[1], self.heavy, self.flows
        place, rate, own, true = np.eye(4 * n, 4 * n + m).reshape(4, n, 4 * n + m)
        drag = self.C[first, first][:, None]
        jump = np.zeros((n, 4 * n + m))
        jump[first, 4 * n :] = h * self.B[first] / drag
        change, rate = true.copy(), rate + jump
        change[first] = -h * self.K[first] @ rate / drag
        for i in self._over(h):
            z = h * self.K[i, i] / self.C[i, i]
            jump[i] += (felt_rate(1.0, -z, 1.0, c.beta, c.gamma) - 1.0) * rate[i]
            change[i] = eased_change(1.0, -z, 1.0, c.beta, c.gamma) * rate[i]
            rate[i] *= eased_rate(1.0, -z, 1.0, c.beta, c.gamma)
            own[i] = true[i]
        force = -h * self.C @ jump
        force[:, 4 * n :] += h**2 * self.B
        change[heavy] += np.linalg.solve(self.M[np.ix_(heavy, heavy)], force[heavy])
        whole = np.vstack([place, rate, own + change - true, change])
        return whole[:, : 4 * n], whole[:, 4 * n :]

    def _over(self, h: float) -> list[int]:
        """What settles within a step."""
        return [i for i in self.settling if unresolved(1.0, -h * self.K[i, i] / self.C[i, i], 1.0)]

    def _step(self, rho: float, h: float) -> tuple[np.ndarray, np.ndarray]:
        """One step of (q, h q̇, h² a, h² q̈), and what held inputs do over it."""
        c, n = Coefficients.of(rho), len(self.M)
        eye, zero, share = np.eye(n), np.zeros((n, n)), 1.0 / (1.0 - c.alpha_f)
        place = np.hstack([eye, eye, (0.5 - c.beta) * eye, zero])
        rate = np.hstack([zero, eye, (1.0 - c.gamma) * eye, zero])
        lag = np.hstack([zero, zero, c.alpha_m * eye, -c.alpha_f * eye])
        mass, drag, stiff = self.M, h * self.C, h**2 * self.K
        tangent = la.lu_factor(share * (1.0 - c.alpha_m) * mass + c.gamma * drag + c.beta * stiff)
        own = la.lu_solve(tangent, -stiff @ place - drag @ rate - share * mass @ lag)
        own_u = la.lu_solve(tangent, h**2 * self.B)
        true, true_u = share * ((1.0 - c.alpha_m) * own + lag), share * (1.0 - c.alpha_m) * own_u
        whole = np.vstack([place + c.beta * own, rate + c.gamma * own, own, true])
        return whole, np.vstack([c.beta * own_u, c.gamma * own_u, own_u, true_u])

    def _turned(self, least: float, *machine: np.ndarray) -> np.ndarray:
        """The poles of the loop; a sample's share of them where the law counts samples."""
        if not self.later:
            return _firm(_closed(self.law, *machine), least)
        turn = [_closed(law, *machine) for law in (self.law, *self.later)]
        return _firm(reduce(lambda done, one: one @ done, turn), least ** len(turn)) ** (1.0 / len(turn))


def _closed(
    law: Answers, moved: np.ndarray, force: np.ndarray, C: np.ndarray, D: np.ndarray, leap: np.ndarray | None = None
) -> np.ndarray:
    """From sample to sample: (machine, inputs in force, law); ``leap`` is what a change of inputs does at once."""
    m = len(force[0])
    u = np.hstack([law.u_y @ C, law.u_y @ D, law.u_x])
    jump = np.zeros((m, u.shape[1]))
    jump[:, len(moved) : len(moved) + m] = np.eye(m)
    machine = np.hstack([moved, np.zeros((len(moved), m + law.u_x.shape[1]))]) + force @ u
    if leap is not None:
        machine += leap @ (u - jump)
    return np.vstack([machine, u, np.hstack([law.x_y @ C, law.x_y @ D, law.x_x])])


def _over(A: np.ndarray, B: np.ndarray, span: float) -> tuple[np.ndarray, np.ndarray]:
    """Where ẋ = A x + B u goes over a time, and what held inputs do over it."""
    n, m = B.shape
    moved = la.expm(span * np.block([[A, B], [np.zeros((m, n + m))]]))
    return moved[:n, :n], moved[:n, n:]


def _firm(loop: np.ndarray, least: float) -> np.ndarray:
    """The poles farther out that round-off does not move by much of how far outside the unit circle they are."""
    if not np.isfinite(loop).all():
        raise ArithmeticError(_BEYOND)
    poles = la.eigvals(loop)
    poles = poles[abs(poles) > least]
    if not poles.size:
        return poles
    scale = 2.0 ** np.random.default_rng(0).integers(-4, 5, len(loop))
    again = la.eigvals(loop * scale / scale[:, None])
    return np.array([z for z in poles if abs(again - z).min() <= _SURE * (abs(z) - 1.0)], dtype=complex)
