"""What is left of the forces in a state, scaled to the forces at work."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field, replace
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from flexctrl.effects.gravity import Gravity
from flexctrl.effects.rotating_frame import RotatingFrame
from flexctrl.errors import SingularMatrixError
from flexctrl.frozen import frozen
from flexctrl.model.mixed import Excess
from flexctrl.model.model import Model
from flexctrl.model.paths.pivots import holds, negative_pivots
from flexctrl.model.places import Places, places_of
from flexctrl.model.rounding import DIGITS, force_rounding, rounded, slope_terms
from flexctrl.model.solve import factorise
from flexctrl.model.state import State
from flexctrl.model.units import geared, turning, units

__all__ = ["Balance"]

_LASTING = (
    "free",
    "fixed",
    "still",
    "lever",
    "unit",
    "inertia",
    "felt",
    "heaviest",
    "_raw_lever",
    "_weights",
    "_led",
    "weighed",
    "_gravity",
)
_STILL, _UNFELT, _CARRIED = 4.0 * float(np.finfo(float).eps), 1e-7, 1e-9


@frozen(eq=False)
class Balance:
    """The conditions of one equilibrium.

    Attributes
    ----------
    model : Model
    u : numpy.ndarray, shape (inputs,)
    held : mapping of int to float
        Displacement from the drawn shape of each coordinate that is held.
    kept : numpy.ndarray
        Forces that the free coordinates are to keep, not to lose; empty for none.
    """

    model: Model
    u: np.ndarray
    held: Mapping[int, float] = field(default_factory=dict)
    kept: np.ndarray = field(default_factory=lambda: np.zeros(0))

    @cached_property
    def free(self) -> np.ndarray:
        """Numbers of the coordinates that are not held."""
        return np.array([i for i in range(self.model.n) if i not in self.held], dtype=int)

    @cached_property
    def fixed(self) -> np.ndarray:
        """Numbers of the coordinates that are held."""
        return np.array(list(self.held), dtype=int)

    @cached_property
    def still(self) -> np.ndarray:
        """No rates."""
        return np.zeros(self.model.n)

    @property
    def size(self) -> float:
        """Size of the machine [m]."""
        return self.model.structure.size

    @cached_property
    def unit(self) -> np.ndarray:
        """A displacement of one of each coordinate: a radian, the size of the machine, what a motor turns by it."""
        return units(self.model, self.size)

    @cached_property
    def lever(self) -> np.ndarray:
        """By what a force on each coordinate is divided to count as one in newtons."""
        return self.size / self.unit

    @cached_property
    def inertia(self) -> np.ndarray:
        """Masses of the coordinates, none of them zero."""
        mass = np.asarray(self.model.mass().diagonal())
        felt = mass / self.lever**2
        heaviest = felt[self.moving].max(initial=0.0) or felt.max(initial=0.0) or 1.0
        return np.maximum(mass, 1e-6 * heaviest * self.lever**2)

    @cached_property
    def felt(self) -> np.ndarray:
        """What masses at the ends of levers as long as the machine they are as heavy as [kg]."""
        return self.inertia / self.lever**2

    @cached_property
    def heaviest(self) -> float:
        """The largest mass that is moved, or felt where nothing is [kg]."""
        felt = self.felt[self.moving] if self.moving.any() else self.felt
        return float(felt.max(initial=1e-300))

    @cached_property
    def moving(self) -> np.ndarray:
        """Which coordinates are no angles."""
        return ~turning(self.model)

    def force(self, state: State) -> np.ndarray:
        """Return the unbalanced forces on the free coordinates."""
        return self.among(state, self.whole_force(state)) - (self.kept if self.kept.size else 0.0)

    def whole_force(self, state: State) -> np.ndarray:
        """Return the unbalanced forces on all coordinates."""
        return self.model.balance(state, self.still, self.still) + self.model.loads(state, self.u)

    def among(self, state: State, force: np.ndarray) -> np.ndarray:
        """Return what forces on all coordinates come to on the free ones."""
        return force[self.free] if self._plain else np.asarray(self._change(state).T @ force)[self.free]

    def whole(self, state: State, step: np.ndarray) -> np.ndarray:
        """Return the step of all coordinates in which the free ones and those that are held go theirs."""
        return step if self._plain else np.asarray(self._change(state) @ step)

    def basis(self, state: State) -> sp.csc_matrix:
        """Return the steps of all coordinates for one of each free one, shape (n, free)."""
        return self._change(state).tocsc()[:, self.free]

    def seen(self, state: State, A: sp.spmatrix) -> sp.csr_matrix:
        """Return what a matrix on all coordinates comes to on the free ones."""
        if self._plain:
            return self.among_free(A.tocsr())
        change = self._change(state)
        return self.among_free((change.T @ A @ change).tocsr())

    @property
    def _plain(self) -> bool:
        """Whether what is held takes no free coordinate along: steps are as they are."""
        return self._led is None

    def _change(self, state: State) -> sp.csr_matrix:
        """Steps of the coordinates from steps in which what is held keeps its place, beside its own."""
        if self._led is None:
            return sp.identity(self.model.n, format="csr")
        return self._led.change(state, self.fixed)

    def turning(self, state: State, force: np.ndarray) -> sp.csr_matrix:
        """Return how what holds against forces on all coordinates turns with their steps."""
        if self._led is None:
            return sp.csr_matrix((self.model.n, self.model.n))
        return self._led.turning(state, self.fixed, self._led.holding(state, self.fixed, force))

    def _bearing(self, state: State, force: np.ndarray) -> sp.csr_matrix:
        """The same, with what nothing else bears."""
        return self.turning(state, force)

    def gap(self, state: State) -> np.ndarray:
        """Return which steps of the held coordinates would bring them to their places."""
        away = np.array(list(self.held.values())) - self.places(state)[self.fixed]
        return self._led.steps(state, self.fixed, away) if self._led else away

    def places(self, state: State) -> np.ndarray:
        """Return where all coordinates are, as far as that matters to those that are held."""
        return self._led.at(state) if self._led else state.q

    def put_back(self, state: State) -> State:
        """Return the state in which what is held is in its place again, where axes have turned beside it."""
        if self._led is None:
            return state
        step = np.zeros(self.model.n)
        step[self.fixed] = self.gap(state)
        return self.model.advance(state, step, self.still, 0.0)

    @cached_property
    def _led(self) -> Places | None:
        """The places of those held coordinates which sums of steps do not tell; None if there are none."""
        if not (self.model.large and self.held):
            return None
        found = places_of(self.model).among(self.fixed.tolist())
        return found if found.led else None

    def astray(self, state: State) -> float:
        """Return the largest of these, in radians or sizes of the machine."""
        return float(np.abs(self.gap(state) / self.unit[self.fixed]).max(initial=0.0))

    def slope(self, state: State, excess: Excess | None = None) -> sp.csr_matrix:
        """Return K of all coordinates, geometric stiffness included; what holds turns with what it holds."""
        if excess is not None:
            return self._slope(state, excess)
        if self.__dict__.get("_last", (None,))[0] is not state:  # asked for time and again in one state
            self.__dict__["_last"] = state, self._slope(state, None)
        return self.__dict__["_last"][1]

    def _slope(self, state: State, excess: Excess | None) -> sp.csr_matrix:
        K = -self.model.slope(state, self.still, self.still, (1.0, 0.0, 0.0), self.u, excess)
        if self._plain:
            return K
        force = self.whole_force(state)
        if excess is not None:
            force = force + self.model.motion.collect(state, excess.raw)
        change = self._change(state)
        return (change.T @ (K - self._bearing(state, force)) @ change).tocsr()

    def among_free(self, K: sp.csr_matrix) -> sp.csr_matrix:
        """Return the rows and columns of the free coordinates."""
        return K[self.free][:, self.free] if self.held else K

    def scale(self, state: State) -> float:
        """Return the forces at work: all loads and weights together, or without any what holds a freedom [N]."""
        loads = np.abs(self.model.signals.loads_at(state) @ self.u / self._raw_lever).sum()
        weights = np.abs(self.model.balance(self.model.rest, self.still, self.still) / self.lever).sum()
        left = np.abs(self.force(state) / self.lever[self.free]).max(initial=0.0)
        return float(max(loads, weights, left, 0.0 if self.loaded else self._holding(state), 1e-300))

    def _holding(self, state: State) -> float:
        """The largest force that holds what is held, once it is in its place as far as stiffness tells [N]."""
        if not self.held:
            return 0.0
        reactions = self.whole_force(state)
        if self.astray(state):
            K = self.slope(state)
            try:
                reactions = reactions - K @ self.linear_step(state, K)
            except SingularMatrixError:  # what has no stiffness yet is moved by loads alone
                return 0.0
        return float(np.abs((reactions / self.lever)[self.fixed]).max(initial=0.0))

    def pull(self, state: State) -> float:
        """Return the ω² at which the machine would swing as a whole under the forces at work [(rad/s)²].

        Weights count whether the machine can give way to them or not.
        """
        mass = max(float(self.felt[self.moving].sum()), float(self.felt.max(initial=1e-300)))
        return max(self.scale(state), self._weights) / (mass * self.size)

    @cached_property
    def _weights(self) -> float:
        """All forces on the nodes of the machine as drawn [N]."""
        model = self.model
        nodes = model.forces.raw(model.rest, self.still, self.still)[: model.motion.source_base].reshape(-1, 2, 3)
        return float(np.abs(nodes[:, 0]).sum() + np.abs(nodes[:, 1]).sum() / self.size)

    @cached_property
    def _raw_lever(self) -> np.ndarray:
        """The same as `lever`, of raw forces."""
        motion, gears = self.model.motion, geared(self.model, self.size)
        lever = np.ones(motion.raw)
        lever[: motion.source_base].reshape(-1, 2, 3)[:, 1] = self.size
        lever[motion.source_base : motion.source_base + gears.size] = self.size / gears
        return lever

    def idle(self, state: State) -> bool:
        """Tell whether nothing is left to do: every force is round-off where it acts, and no load is at work beside.

        Under loads the round-off of stiff pieces may hide them, so that nothing may give way to it either.
        """
        force = self.force(state)
        if self.astray(state) or (np.abs(force) > self.round_off(state)).any():
            return False
        return not self.loaded or self._way(state, force) <= _STILL

    @property
    def loaded(self) -> bool:
        """Whether loads or weights are at work."""
        return bool(self.u.any()) or self.weighed

    @cached_property
    def weighed(self) -> bool:
        """Whether weights, or centrifugal forces, work on coordinates: what turns about the vertical has none."""
        weights = np.abs(self.model.balance(self.model.rest, self.still, self.still) / self.lever).sum()
        felt = self.heavy and bool(weights > _CARRIED * self._gravity * self.felt.sum())
        return felt or any(isinstance(e, RotatingFrame) for e in self.model.effects)

    @property
    def heavy(self) -> bool:
        """Whether masses have weights, felt by coordinates or not: what hangs straight down swings by them."""
        return self._gravity > 0.0

    @cached_property
    def _gravity(self) -> float:
        """[m/s²]."""
        return max((float(np.linalg.norm(e.g)) for e in self.model.effects if isinstance(e, Gravity)), default=0.0)

    def called_forth(self, state: State) -> float:
        """Return the largest force on a coordinate if what is held went to its place and all else stood still [N]."""
        step = np.zeros(self.model.n)
        step[self.fixed] = self.gap(state)
        return float(np.abs(self.slope(state) @ step / self.lever).max(initial=0.0))

    def round_off(self, state: State) -> np.ndarray:
        """Return the largest forces on the free coordinates that may be rounding alone."""
        return np.asarray(abs(self._change(state)).T @ force_rounding(self.model, state, self.u))[self.free]

    def holds(self, state: State, K: sp.csr_matrix) -> bool:
        """Tell whether a stiffness K of all coordinates resists every displacement of the free ones."""
        return holds(self.among_free(K), self.terms(state, K))

    def unstable(self, state: State) -> int:
        """Return in how many directions, at least, the free coordinates leave the state by themselves."""
        K = self.slope(state)
        return negative_pivots(self.among_free(K), self.terms(state, K))

    def terms(self, state: State, K: sp.csr_matrix) -> sp.csr_matrix:
        """Return the sizes of what entries of K are sums of, stresses included, of the free coordinates."""
        return self.entries(state, K) + self.among_free(self._stresses(state))

    def entries(self, state: State, K: sp.csr_matrix) -> sp.csr_matrix:
        """Return the sizes of what the entries of a stiffness K are sums of, of the free coordinates."""
        terms = slope_terms(self.model, state, self.u, K)
        if self._plain or not self.model.large or self.model.motion.plain:  # those of K as it is
            return self.among_free(terms)
        change = abs(self._change(state))
        return self.among_free((change.T @ terms @ change).tocsr())

    def strain(self, state: State, motions: np.ndarray) -> np.ndarray:
        """Return ΦᵀKΦ of motions Φ of the free coordinates, without the rounding of K's entries; shape (k, k)."""
        whole = self.basis(state) @ motions
        found = self.model.strain(state, self.u, whole)
        if self._plain:
            return found
        return found - whole.T @ (self._bearing(state, self.whole_force(state)) @ whole)

    @property
    def told_by_pieces(self) -> bool:
        """Whether `strain` has no rounding but that of the places: no levers' either."""
        return self.model.large and self.model.motion.plain and self._plain

    def _stresses(self, state: State) -> sp.csr_matrix:
        """What K has of stresses that are but the last digits of places, as terms that may be rounded."""
        if not self.model.large:
            return sp.csr_matrix((self.model.n, self.model.n))
        return abs(self.slope(rounded(state, 0)) - self.slope(state)) / DIGITS

    def linear_step(self, state: State, K: sp.csr_matrix) -> np.ndarray:
        """Return where the forces and the held coordinates would lead all coordinates, did K stay as it is."""
        step = np.zeros(self.model.n)
        step[self.fixed] = self.gap(state)
        force = self.force(state) - (K[self.free] @ step if self.held else 0.0)
        step[self.free] = factorise(self.among_free(K).tocsr())(force)
        return self.whole(state, step)

    def settled(self, state: State, tolerance: float) -> bool:
        """Tell whether a state is an equilibrium, as far as round-off lets that be told.

        The last digits of the places make forces in stiff pieces that may be far from nothing. What of them is left
        to the motions that are no stiffer than the forces at work is nothing at all.
        """
        force = self.force(state)
        scale = self.scale(state)
        if self.relative(force, scale) <= tolerance:
            return True
        if self.relative(self._beyond(state, force), scale) > tolerance:
            return False
        return not self.loaded or self._way(state, force) <= max(tolerance, _UNFELT)

    def _beyond(self, state: State, force: np.ndarray) -> np.ndarray:
        return np.asarray(force - np.clip(force, *np.outer((-1.0, 1.0), self.round_off(state))))

    def _way(self, state: State, force: np.ndarray) -> float:
        """How far forces move the machine were all masses held by what is at work: in radians or sizes of it."""
        ground = sp.diags(self.pull(state) * self.inertia[self.free])
        try:
            step = factorise((self.among_free(self.slope(state)) + ground).tocsr())(force)
        except SingularMatrixError:
            return np.inf
        return float(np.abs(step / self.unit[self.free]).max(initial=0.0))

    def relative(self, force: np.ndarray, scale: float) -> float:
        """Return the largest of some forces on the free coordinates over the forces at work; infinite for NaN."""
        worst = np.abs(force / self.lever[self.free]).max(initial=0.0) / scale
        return float(worst) if np.isfinite(worst) else np.inf

    def residual(self, state: State) -> float:
        """Return the largest unbalanced force over the forces at work."""
        return self.relative(self.force(state), self.scale(state))

    def beyond_noise(self, state: State) -> float:
        """Return the largest unbalanced force that is no round-off where it acts, over the forces at work."""
        return self.relative(self._beyond(state, self.force(state)), self.scale(state))

    def worst(self, state: State) -> str:
        """Return the coordinate that is pushed most."""
        force = np.abs(self.force(state) / self.lever[self.free])
        return self.model.coordinates[int(self.free[int(np.argmax(force))])] if force.size else "none"

    def moved(self, step: np.ndarray) -> float:
        """Return the largest of some displacements, in radians or sizes of the machine."""
        return float(np.abs(step / self.unit).max(initial=0.0))

    def moved_freely(self, step: np.ndarray) -> float:
        """Return the same of the free coordinates alone: what is held goes as far whatever else happens."""
        return float(np.abs(step[self.free] / self.unit[self.free]).max(initial=0.0))

    def part(self, start: State, holding: np.ndarray, done: float) -> Balance:
        """Return the way to this balance from a start that forces ``holding`` hold: 0 there, 1 here.

        Loads that turn with the machine come on in proportion: held back by fixed forces they would turn against them.
        """
        begun = self.places(start)
        held = {i: (1.0 - done) * float(begun[i]) + done * value for i, value in self.held.items()}
        u = np.where(self._following, done * self.u, self.u)
        return self._again(replace(self, u=u, held=held, kept=(1.0 - done) * holding))

    def held_as(self, state: State) -> Balance:
        """Return the same balance with what is held where it is in a state."""
        there = self.places(state)
        return self._again(replace(self, held={i: float(there[i]) for i in self.held}))

    @cached_property
    def _following(self) -> np.ndarray:
        turning = {f.input for f in self.model.signals.follows}
        return np.array([i in turning for i in range(len(self.u))], dtype=bool)

    def under(self, u: np.ndarray) -> Balance:
        """Return the same balance under other inputs."""
        return self._again(replace(self, u=u))

    def _again(self, other: Balance) -> Balance:
        """What does not depend on loads and places is not worked out anew."""
        other.__dict__.update({name: self.__dict__[name] for name in _LASTING if name in self.__dict__})
        return other
