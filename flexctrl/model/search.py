"""Newton's method for equilibria: stresses predicted beside the displacements, a shift where nothing is stiff yet."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from flexctrl.errors import SingularMatrixError
from flexctrl.frozen import frozen
from flexctrl.model.balance import Balance
from flexctrl.model.mixed import Excess
from flexctrl.model.solve import Plan, factorise, plan
from flexctrl.model.state import State

_TARGET, _SETTLED = 1e-12, 1e-9
_REACH = 1.0
_CONTRACTION = 0.6
SMALLEST_PART, _FINER, _JUMP = 1e-4, 1e-2, 30.0
_FREE_MOTIONS, _DUST, _TOO_FAR, _DUST_OF = 6, 8.0, 0.1, 1e-12
_SPREAD, _FASTEST = 100.0, 1e12


@frozen
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
    stiff the stiffest part is. It ends where the step is lost in round-off or the true residual is. ``downhill`` adds
    masses until no way is one that the machine leaves by itself: against the forces it would go to and fro for ever.
    """

    def __init__(self, balance: Balance, tolerance: float, reach: float = _REACH, downhill: bool = False) -> None:
        self.balance, self.tolerance, self.reach, self.downhill = balance, tolerance, reach, downhill
        self.mixed = balance.model.forces.mixed if balance.model.large else None
        self._plan: Plan | None = None

    def run(self, start: State, most: int, shift: float = 0.0, watch: bool = False) -> Found:
        """Search from a start; a positive ``shift`` (1/s²) adds masses to K and fades as the forces do.

        ``watch`` ends it at the first tangent that does not resist every displacement.
        """
        search = _Search(self, start, shift, watch)
        while not search.small and search.iterations < most and search.iterate(watch):
            pass
        return search.found()

    def step(self, K: sp.csr_matrix, here: _Iterate, shift: float) -> tuple[np.ndarray, np.ndarray]:
        """Return the whole step of all coordinates, held ones to their places, and the forces on the free ones.

        Where there is a shift, the forces are less what only drives free motions by round-off.
        """
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
        found, left = self._without_drift(matrix, solve, force, here, shift) if shift else (solve(force), force)
        step[balance.free] = found
        return balance.whole(here.state, step), left

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
            if not free.any():  # nothing pushes
                return step, force
            if free @ (matrix @ free) > 2.0 * shift * (held @ free):
                return step, force
            unsure = self.balance.round_off(here.state) if unsure is None else unsure
            work = float(force @ free)
            if abs(work) > _DUST * (unsure @ np.abs(free)):
                return step, force
            force = force - held * (work / float(held @ free))
            step = solve(force)
        return step, force

    def after(self, here: _Iterate, step: np.ndarray, share: float, scale: float) -> _Iterate:
        """Return the next iterate after a share of a step: stresses go the same share of their way."""
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
        left = force + balance.among(state, model.motion.collect(state, excess.raw))
        return _Iterate(state, excess, force, balance.relative(left, scale))


class _Search:
    """A search under way: the iterate, the best state met, and how the steps went."""

    def __init__(self, newton: Newton, start: State, shift: float, watched: bool) -> None:
        balance = newton.balance
        force, there = balance.force(start), balance.astray(start) == 0.0
        called = 0.0 if there else balance.called_forth(start)
        self.scale = max(balance.scale(start), _DUST_OF * called)
        self.newton, self.balance = newton, balance
        self.shift, self.floor, self.most = shift, 1e-7 * shift, _FASTEST * shift
        # what is not yet in its place calls forth what no force at the start tells of
        left = balance.relative(force, self.scale)
        untold = watched or not balance.loaded or left <= newton.tolerance
        self.best, self.least = start, max(left, untold * called / self.scale)
        self.here = _Iterate(start, None, force, self.least)
        self.before, self.iterations, self.stalled = np.inf, 0, 0
        self.steady = self.contracting = True
        self.small = there and self.least <= _TARGET

    def iterate(self, watch: bool) -> bool:
        """Go one step, or hold faster where it would go astray; return whether another one may help."""
        newton, here = self.newton, self.here
        self.iterations += 1
        K = self.balance.slope(here.state, here.excess)
        if watch and not self.balance.holds(here.state, K):
            self.steady = False
            return False
        if newton.downhill:
            self._hold_uphill(K)
        try:
            step, _ = newton.step(K, here, self.shift)
        except SingularMatrixError:
            return self._held_faster()
        size = self.balance.moved(step)
        share = min(1.0, newton.reach / size) if size > 0.0 else 1.0
        if self.shift and self.newton.reach < _TOO_FAR * self.balance.moved_freely(step):
            return self._held_faster()
        there = newton.after(here, step, share, self.scale)
        if not there.left <= 1e3 * max(here.left, newton.tolerance):
            return self._held_faster()
        return self._moved(there, size, share)

    def _hold_uphill(self, K: sp.csr_matrix) -> None:
        """Add masses until they and K resist every displacement."""
        inertia = sp.diags(self.balance.inertia)
        while self.shift < self.most and not self.balance.holds(self.here.state, (K + self.shift * inertia).tocsr()):
            self._held_faster()

    def _held_faster(self) -> bool:
        self.shift = 10.0 * max(self.shift, self.floor)
        return 0.0 < self.shift < self.most

    def _moved(self, there: _Iterate, size: float, share: float) -> bool:
        """Take stock after a step; return whether another one may help."""
        before, self.here = self.here, there
        self.contracting = self.contracting and share == 1.0 and size <= max(_CONTRACTION * self.before, 1e-6)
        fading = 0.1 if there.left < before.left else 0.3 if there.left < 10.0 * before.left else 3.0
        self.shift, self.before = max(self.shift * fading, self.floor), size
        true = self.balance.relative(there.force, self.scale)
        self.stalled = 0 if true < 0.7 * self.least else self.stalled + 1
        if true < self.least or share < 1.0 or self.iterations == 1:
            self.best, self.least = there.state, true
        closed = self.balance.astray(there.state) <= _TARGET
        self.small = closed and share == 1.0 and (true <= _TARGET or (size <= _SETTLED and self.shift <= self.floor))
        return not (self.stalled > 8 and size < 1e-6 and self.balance.settled(self.best, self.newton.tolerance))

    def found(self) -> Found:
        """Return where it ended: at the best state, or the last where round-off alone makes that look worse."""
        best, least, last = self.best, self.least, self.here.state
        done = self._in_balance(best)
        if not done and ((last is not best and self._in_balance(last)) or self._in_balance_but_for_drift()):
            best, least, done = last, self.balance.residual(last), True
        return Found(best, least, self.iterations, done, self.steady, self.contracting)

    def _in_balance(self, state: State) -> bool:
        balance = self.balance
        if balance.astray(state) > _TARGET:
            return False
        # where a pendulum hangs nothing is at work any more; what was at the start measures what is left
        return (
            balance.settled(state, self.newton.tolerance)
            or balance.relative(balance.force(state), self.scale) <= _TARGET
        )

    def _in_balance_but_for_drift(self) -> bool:
        """Whether free motions have carried what is left from where it is round-off to heavier places."""
        last, tolerance = self.here.state, self.newton.tolerance
        if not self.small or not self.shift or self.balance.residual(last) > _SPREAD * tolerance:
            return False
        _, left = self.newton.step(self.balance.slope(last), self.here, self.shift)
        return self.balance.relative(left, self.scale) <= tolerance


def follow(balance: Balance, start: State, tolerance: float, strict: bool, watch: bool = False) -> tuple[Found, float]:
    """Let go of what holds a start in equilibrium, part by part, and stay with it.

    Parameters
    ----------
    balance : Balance
    start : State
    tolerance : float
    strict : bool
        Whether each part must lead to a neighbour of the state before, or just anywhere.
    watch : bool
        Whether all on the way must resist every displacement.

    Returns
    -------
    Found, float
        The state reached, and the share of the way that it is at.
    """
    bare = balance.part(start, np.zeros(0), 0.0)
    holding = bare.force(start)
    state, done, part, total, rate = start, 0.0, 0.25, 0, 0.0
    least = (_FINER if watch else 1.0) * SMALLEST_PART
    while done < 1.0 and part >= least:
        goal = min(1.0, done + part)
        found = Newton(balance.part(start, holding, goal), tolerance).run(state, 15 if strict else 120, watch=watch)
        total += found.iterations
        moved = balance.moved(found.state.q - state.q)
        near = found.contracting or (part < 2.0 * least and moved <= _JUMP * rate * part)
        if found.done and (near or not strict) and (found.steady or not watch):
            rate = moved / (goal - done) if rate == 0.0 else 0.5 * (rate + moved / (goal - done))
            state, done, part = found.state, goal, (2.0 if found.iterations < 8 else 1.2) * part
        else:
            part *= 0.4
    residual = balance.residual(state)
    ended = done >= 1.0 and balance.settled(state, tolerance)
    return Found(state, residual, total, ended, strict, strict), done
