"""Newton's method for equilibria: stresses predicted beside the displacements, a shift where nothing is stiff yet."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from flexctrl.errors import SingularMatrixError
from flexctrl.model.balance import Balance
from flexctrl.model.mixed import Excess
from flexctrl.model.solve import Plan, factorise, plan
from flexctrl.model.state import State

_TARGET, _SETTLED = 1e-12, 1e-9
_REACH = 1.0
_CONTRACTION = 0.6
_SMALLEST_PART, _JUMP = 1e-4, 30.0
_FREE_MOTIONS, _DUST, _TOO_FAR = 6, 8.0, 0.1
_SPREAD = 100.0


@dataclass(frozen=True)
class Found:
    """Where a search ended.

    Attributes
    ----------
    state : State
        The best state met.
    residual : float
    iterations : int
    done : bool
        Whether it is an equilibrium.
    steady : bool
        Whether every tangent on the way resisted every displacement: no other equilibrium was passed.
    contracting : bool
        Whether every step was whole, and well below the one before.
    """

    state: State
    residual: float
    iterations: int
    done: bool
    steady: bool
    contracting: bool


@dataclass
class _Iterate:
    """A state on the way: the stresses it is taken to bear beside its own, its forces, and what is left of them."""

    state: State
    excess: Excess | None
    force: np.ndarray
    left: float


class Newton:
    """Newton's method on one balance.

    The residual that steers it is that with the predicted stresses (`mixed`): the true one is ruled by how
    stiff the stiffest part is. It ends where the step is lost in round-off or the true residual is.
    """

    def __init__(self, balance: Balance, tolerance: float, reach: float = _REACH) -> None:
        self.balance, self.tolerance, self.reach = balance, tolerance, reach
        self.mixed = balance.model.forces.mixed if balance.model.large else None
        self._plan: Plan | None = None
        self._left = np.zeros(0)

    def run(self, start: State, most: int, shift: float = 0.0, watch: bool = False) -> Found:
        """Search from a start; a positive ``shift`` (1/s²) adds masses to K and fades as the forces do.

        ``watch`` ends it at the first tangent that does not resist every displacement.
        """
        balance = self.balance
        scale = balance.scale(start)
        here = _Iterate(start, None, balance.force(start), 0.0)
        here.left = least = balance.relative(here.force, scale)
        best, floor, before, iteration = start, 1e-7 * shift, np.inf, 0
        steady = contracting = True
        stalled, small = 0, balance.astray(start) == 0.0 and here.left <= _TARGET
        while not small and iteration < most:
            iteration += 1
            K = balance.slope(here.state, here.excess)
            if watch and not balance.holds(here.state, K):
                steady = False
                break
            try:
                step = self._step(K, here, shift)
            except SingularMatrixError:
                if not shift:
                    break
                shift = 10.0 * max(shift, floor)
                continue
            size = balance.moved(step)
            share = min(1.0, self.reach / size) if size > 0.0 else 1.0
            if shift and share < _TOO_FAR:
                shift = 10.0 * max(shift, floor)
                continue
            there = self._after(here, step, share, scale)
            if not there.left <= 1e3 * max(here.left, self.tolerance):
                if not shift:
                    break
                shift = 10.0 * max(shift, floor)
                continue
            contracting = contracting and share == 1.0 and size <= max(_CONTRACTION * before, 1e-6)
            shift = max(
                shift * (0.1 if there.left < here.left else 0.3 if there.left < 10.0 * here.left else 3.0), floor
            )
            before, here = size, there
            true = balance.relative(here.force, scale)
            stalled = 0 if true < 0.7 * least else stalled + 1
            if true < least or share < 1.0 or iteration == 1:
                best, least = here.state, true
            small = share == 1.0 and (true <= _TARGET or (size <= _SETTLED and shift <= floor))
            if stalled > 8 and size < 1e-6 and balance.settled(best, self.tolerance):
                break
        done = balance.astray(best) <= 1e-12 and balance.settled(best, self.tolerance)
        if not done and here.state is not best and balance.astray(here.state) <= 1e-12:
            # round-off in stiff pieces may hide how much nearer the last state is
            done = balance.settled(here.state, self.tolerance)
            best, least = (here.state, balance.residual(here.state)) if done else (best, least)
        if not done and small and shift and balance.residual(here.state) <= _SPREAD * self.tolerance:
            # free motions may have carried what is left from where it is round-off to heavier places
            self._step(balance.slope(here.state), here, shift)
            done = balance.relative(self._left, scale) <= self.tolerance
            best, least = (here.state, balance.residual(here.state)) if done else (best, least)
        return Found(best, least, iteration, done, steady, contracting)

    def _step(self, K: sp.csr_matrix, here: _Iterate, shift: float) -> np.ndarray:
        """The whole step of all coordinates; held ones go to their places."""
        balance = self.balance
        step = np.zeros(balance.model.n)
        step[balance.fixed] = balance.gap(here.state)
        force = here.force - (K[balance.free] @ step if balance.held else 0.0)
        matrix = balance.among_free(K)
        if shift:
            matrix = matrix + sp.diags(shift * balance.inertia[balance.free])
        matrix = matrix.tocsr()
        if self._plan is None or not self._plan.fits(matrix):
            self._plan = plan(matrix)
        solve = factorise(matrix, self._plan)
        found, self._left = self._without_drift(matrix, solve, force, here, shift) if shift else (solve(force), force)
        step[balance.free] = found
        return step

    def _without_drift(
        self,
        matrix: sp.csr_matrix,
        solve: Callable[[np.ndarray], np.ndarray],
        force: np.ndarray,
        here: _Iterate,
        shift: float,
    ) -> tuple[np.ndarray, np.ndarray]:
        """The step and the force less free motions that only the rounding of the forces pushes, one after the other.

        The smaller the shift that alone holds them, the farther they would go: a slewing crane turns for ever.
        """
        inertia = self.balance.inertia[self.balance.free]
        step, unsure = solve(force), None
        for _ in range(_FREE_MOTIONS):
            free = step
            for _ in range(2):
                free = solve(inertia * free)
                free = free / max(np.abs(free).max(initial=0.0), 1e-300)
            held = inertia * free
            if free @ (matrix @ free) > 2.0 * shift * (held @ free):
                return step, force
            unsure = self.balance.round_off(here.state) if unsure is None else unsure
            work = float(force @ free)
            if abs(work) > _DUST * (unsure @ np.abs(free)):
                return step, force
            force = force - held * (work / float(held @ free))
            step = solve(force)
        return step, force

    def _after(self, here: _Iterate, step: np.ndarray, share: float, scale: float) -> _Iterate:
        """The next iterate after a share of a step: stresses go the same share of their way."""
        balance, model = self.balance, self.balance.model
        state = model.advance(here.state, share * step, balance.still, 0.0)
        force = balance.force(state)
        if self.mixed is None or not self.mixed.count:
            return _Iterate(state, None, force, balance.relative(force, scale))
        own, target = self.mixed.stress(here.state, step)
        borne = own + (here.excess.stress if here.excess else 0.0)
        borne = borne + share * (target - borne)
        now, _ = self.mixed.stress(state, balance.still)
        excess = self.mixed.excess(state, borne - now)
        left = force + model.motion.collect(state, excess.raw)[balance.free]
        return _Iterate(state, excess, force, balance.relative(left, scale))


def follow(balance: Balance, start: State, tolerance: float, strict: bool) -> tuple[Found, float]:
    """Let go of what holds a start in equilibrium, part by part, and stay with it.

    Parameters
    ----------
    balance : Balance
    start : State
    tolerance : float
    strict : bool
        Whether each part must lead to a neighbour of the state before, or just anywhere.

    Returns
    -------
    Found, float
        The state reached, and the share of the way that it is at.
    """
    bare = balance.part(start, np.zeros(0), 0.0)
    holding = bare.force(start)
    state, done, part, total, rate = start, 0.0, 0.25, 0, 0.0
    while done < 1.0 and part >= _SMALLEST_PART:
        goal = min(1.0, done + part)
        found = Newton(balance.part(start, holding, goal), tolerance).run(state, 15 if strict else 120)
        total += found.iterations
        moved = balance.moved(found.state.q - state.q)
        near = found.contracting or (part < 2.0 * _SMALLEST_PART and moved <= _JUMP * rate * part)
        if found.done and (near or not strict):
            rate = moved / (goal - done) if rate == 0.0 else 0.5 * (rate + moved / (goal - done))
            state, done, part = found.state, goal, (2.0 if found.iterations < 8 else 1.2) * part
        else:
            part *= 0.4
    residual = balance.residual(state)
    ended = done >= 1.0 and balance.settled(state, tolerance)
    return Found(state, residual, total, ended, strict, strict), done
