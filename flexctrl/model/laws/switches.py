"""Laws of force that switch: dry friction sticks, breaks loose, slides, and stops.

What sticks is held without a multiplier: the equations of motion lose their components along the slip
directions W of the contacts that stick (`holds`), and s̈ + κ ṡ + ¼ κ² (s − s₀) = 0 takes their place, with s the angle
or travel of a contact and s₀ where it stuck. The force that holds is read off the components lost. Phases belong to
the state; where they end is told by gaps, which are positive while they last. Speeds, forces and κ are measured by
what the contacts themselves do (`slip_scales`), so that nothing hangs on the units of a machine.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import field
from functools import cached_property
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
import scipy.sparse as sp

from flexctrl.effects.coulomb_friction import CoulombFriction
from flexctrl.errors import StructureError
from flexctrl.frozen import frozen
from flexctrl.model.flows import flowing
from flexctrl.model.laws.friction_kinds import STUCK
from flexctrl.model.laws.holds import Hold, easiness, hold
from flexctrl.model.laws.sharing import evened, led, spare, tied
from flexctrl.model.laws.slip_scales import SlipScales, slip_scales
from flexctrl.model.laws.slips import Slips
from flexctrl.model.solve import factorise
from flexctrl.model.state import Dry, State

if TYPE_CHECKING:
    from flexctrl.model.model import Model

__all__ = ["Switches"]

Force = TypeVar("Force", np.ndarray, sp.csr_matrix)
T = TypeVar("T")

_FADING = 1e4
_KEPT = 4
_STILL = 1e-10
_MOST, _ALIKE, _OVERCOME = 1.0 + 1e-10, 1e-9, 0.5


@frozen(eq=False)
class Switches:
    """The dry contacts of a model.

    Attributes
    ----------
    model : Model
    """

    model: Model
    _kept: dict[str, tuple[tuple[State, bytes, Any], ...]] = field(default_factory=dict, repr=False)

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Places of the contacts, in the order of `gaps`."""
        structure, effects = self.model.structure, self.model.effects
        at = next((i for i, e in enumerate(effects) if isinstance(e, CoulombFriction)), len(effects))
        first = sum(len(e.inner(structure)) for e in effects[:at])
        laws = [where for e in effects[at:] if isinstance(e, CoulombFriction) for where, _ in e.acting]
        return tuple(laws[int(i) - first] for i in self.slips.order)

    @cached_property
    def slips(self) -> Slips:
        """How the contacts slip."""
        forces = self.model.forces
        return Slips(forces, tuple(f for f in forces.families if f.kernels.kind.name.startswith("dry_")))

    @cached_property
    def static(self) -> np.ndarray:
        """What each contact bears before it breaks loose [N or N m]."""
        return np.concatenate([np.zeros(0), *(f.parameters[:, 4] for f in self.slips.families)])

    @cached_property
    def scales(self) -> SlipScales:
        """What small and large speeds and times are to the contacts."""
        return slip_scales(self.model, self.slips.rows(self.model.rest), self.static)

    @cached_property
    def ease(self) -> np.ndarray:
        """How easily each degree of freedom moves [1/kg or 1/(kg m²)]."""
        return easiness(self.model)

    @cached_property
    def fading(self) -> float:
        """κ: how fast what is astray of a contact that sticks fades [1/s]."""
        return _FADING * self.scales.rate

    def phases(self, state: State) -> np.ndarray:
        """Return the phase of each contact."""
        return state.dry.phase[self.slips.order]

    def sticks(self, state: State) -> bool:
        """Tell whether any contact sticks."""
        return bool((state.dry.phase == STUCK).any())

    # -- equations of motion while something sticks

    def held(self, state: State, v: np.ndarray, a: np.ndarray, force: np.ndarray) -> np.ndarray:
        """Return the balance of forces with the contacts that stick held.

        Parameters
        ----------
        state : State
        v, a : numpy.ndarray, shape (n,)
        force : numpy.ndarray, shape (n,)
            The balance without.

        Returns
        -------
        numpy.ndarray, shape (n,)
        """
        hold = self._hold(state)
        speeds, rates, places = self.slips.at(state, v, a)
        astray = places - state.dry.anchor[self.slips.order]
        astray -= 2.0 * np.pi * np.rint(astray / (2.0 * np.pi))
        slip = rates + self.fading * speeds + 0.25 * self.fading**2 * astray
        return hold.freed(force) - hold.against(slip[self.phases(state) == STUCK])

    def freed(self, state: State, force: Force) -> Force:
        """Return forces, or their slopes, without their components along the slips that stick."""
        return self._hold(state).freed(force)

    def unheld(self, state: State) -> State:
        """Return a state in which what sticks is taken to be without friction, and what slides is not."""
        phase = state.dry.phase
        return state.with_(dry=Dry(np.where(phase == STUCK, 0.0, phase), state.dry.anchor))

    def held_slope(self, state: State, slope: sp.csr_matrix, seeds: tuple[float, float, float]) -> sp.csr_matrix:
        """Return the slope of `held` from that of the balance without."""
        firmness = seeds[2] + self.fading * seeds[1] + 0.25 * self.fading**2 * seeds[0]
        return self._hold(state).firm(slope, firmness)

    def still(self, state: State, motion: np.ndarray) -> np.ndarray:
        """Return what is left of a motion of the degrees of freedom when what sticks does not move."""
        if not self.sticks(state):
            return motion
        return self._hold(state).still(motion)

    def at_rest(self, state: State) -> State:
        """Return a state in which what sticks does not move and is held where it is: nothing of it is to fade.

        Parameters
        ----------
        state : State

        Returns
        -------
        State
        """
        if not self.sticks(state):
            return state
        order, (_, _, places) = self.slips.order, self.slips.at(state, state.v, state.v)
        anchor = state.dry.anchor.copy()
        anchor[order] = np.where(self.phases(state) == STUCK, places, anchor[order])
        return state.with_(v=self.still(state, state.v), dry=Dry(state.dry.phase, anchor))

    def _hold(self, state: State) -> Hold:
        """Return what holds the contacts that stick."""
        return self._once("hold", state, b"", lambda: hold(self._stuck_rows(state), self.ease))

    def spare(self, state: State) -> np.ndarray:
        """Tell which contacts that stick hold nothing that stronger ones do not, shape (contacts,)."""
        stuck = self.phases(state) == STUCK
        found = np.zeros(stuck.size, dtype=bool)
        if stuck.sum() > 1:
            found[stuck] = spare(self._stuck_rows(state) * np.sqrt(self.ease), self.static[stuck])
        return found

    def _stuck_rows(self, state: State) -> np.ndarray:
        return self.slips.rows(state)[self.phases(state) == STUCK]

    def _once(self, what: str, state: State, given: bytes, make: Callable[[], T]) -> T:
        """Return what is made of a state and what else is given, once while little else is asked for."""
        kept = self._kept.get(what, ())
        found = next((made for s, g, made in kept if s is state and g == given), None)
        if found is None:
            found = make()
            self._kept[what] = ((state, given, found), *kept[: _KEPT - 1])
        return found

    # -- where phases end, and what comes then

    def gaps(self, state: State, u: np.ndarray) -> np.ndarray:
        """Return how far each contact is from the end of its phase: positive while it lasts.

        Parameters
        ----------
        state : State
        u : numpy.ndarray, shape (inputs,)

        Returns
        -------
        numpy.ndarray, shape (contacts,)
            Sliding: the slip speed in its direction, in `scales`; sticking: the share of the force it bears that is
            left before it breaks loose. What it can just bear it does, whatever the last digits are.
        """
        phases = self.phases(state)
        gaps = np.where(phases == 0.0, 1.0, phases * self.slips.speeds(state) / self.scales.speeds)
        stuck = phases == STUCK
        if stuck.any():
            gaps[stuck] = _MOST - np.abs(self._holding(state, u)[0]) / self.static[stuck]
        return gaps

    def gap(self, state: State, u: np.ndarray, contact: int) -> float:
        """Return one of the `gaps`.

        Parameters
        ----------
        state : State
        u : numpy.ndarray, shape (inputs,)
        contact : int

        Returns
        -------
        float
        """
        phase = float(self.phases(state)[contact])
        if phase in (0.0, STUCK):
            return float(self.gaps(state, u)[contact])
        return phase * float(self.slips.speeds(state)[contact] / self.scales.speeds[contact])

    def _holding(self, state: State, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the forces that hold what sticks, and the accelerations of what has mass."""
        return self._once("holding", state, u.tobytes(), lambda: self._held_by(state, u))

    def accelerations(self, state: State, u: np.ndarray) -> np.ndarray:
        """Return the accelerations of what has mass, with what sticks held.

        Parameters
        ----------
        state : State
        u : numpy.ndarray, shape (inputs,)

        Returns
        -------
        numpy.ndarray, shape (n,)
        """
        return self._holding(state, u)[1]

    def _held_by(self, state: State, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        model, a = self.model, np.zeros(self.model.n)
        stuck = self.phases(state) == STUCK
        loose = self.unheld(state)
        force = model.balance(loose, state.v, a) + model.loads(loose, u)
        M = -model.slope(loose, state.v, a, (0.0, 0.0, 1.0), u)
        heavy = np.flatnonzero(M.diagonal() > model.dust)
        M = M if heavy.size == model.n else M[heavy][:, heavy]
        held = hold(self._stuck_rows(state)[:, heavy], self.ease[heavy])
        _, turning, _ = self.slips.at(state, state.v, a)
        solve = factorise(held.firm(M, -1.0))
        a[heavy] = solve(held.freed(force[heavy]) - held.against(turning[stuck]))
        borne, felt = held.borne(M @ a[heavy] - force[heavy]), held.W * np.sqrt(self.ease[heavy])
        return evened(felt, borne, self.static[stuck]), a

    def begin(self, state: State, u: np.ndarray) -> State:
        """Return a state with the phases it must have: what stands still sticks if it can.

        Parameters
        ----------
        state : State
        u : numpy.ndarray, shape (inputs,)

        Returns
        -------
        State

        Raises
        ------
        StructureError
            For a dry contact whose sides have no mass to be accelerated.
        """
        if not self.names:
            return state
        self._check_mass(state, u)
        speeds = self.slips.speeds(state)
        phases = np.where(np.abs(speeds) <= _STILL * self.scales.speeds, STUCK, np.sign(speeds))
        return self._settled_under(state, u, phases)

    def under(self, state: State, u: np.ndarray) -> State:
        """Return a state under inputs that have jumped: what they overcome breaks loose.

        Parameters
        ----------
        state : State
        u : numpy.ndarray, shape (inputs,)

        Returns
        -------
        State
        """
        return self._settled_under(state, u, self.phases(state).copy()) if self.sticks(state) else state

    def like(self, state: State, other: State) -> State:
        """Return a state whose contacts do what those of another, nearby state do.

        Parameters
        ----------
        state, other : State

        Returns
        -------
        State
        """
        if np.array_equal(state.dry.phase, other.dry.phase):
            return state
        state = self._with(state, self.phases(other))
        return state.with_(v=self.still(state, state.v))

    def after(self, state: State, u: np.ndarray, contact: int) -> State:
        """Return the state after a contact's gap has closed: what slid may stick, what stuck slides.

        Parameters
        ----------
        state : State
        u : numpy.ndarray, shape (inputs,)
        contact : int

        Returns
        -------
        State
        """
        phases = self.phases(state).copy()
        if phases[contact] == STUCK:
            torn, held = self._torn(state, u, contact)
            phases[torn] = -np.sign(held)
        else:
            speed, W = self.slips.speeds(state), self.slips.rows(state)
            state = state.with_(v=state.v - hold(W[[contact]], self.ease).back @ speed[[contact]])
            phases = self._stopped(state, contact)
        return self._settled(state, u, phases)

    def _torn(self, state: State, u: np.ndarray, contact: int) -> tuple[np.ndarray, np.ndarray]:
        """What breaks loose with a contact, as it has shared what it bore; and what that bore."""
        stuck, held = np.flatnonzero(self.phases(state) == STUCK), self._holding(state, u)[0]
        used, own = np.abs(held) / self.static[stuck], stuck.tolist().index(contact)
        if used[own] <= _OVERCOME:  # a force that jumps will tear it loose, not yet
            return stuck[:0], held[:0]
        group = tied(self._stuck_rows(state) * np.sqrt(self.ease))
        torn = (group == group[own]) & (used >= (1.0 - _ALIKE) * used[own])
        return stuck[torn], held[torn]

    def _stopped(self, state: State, contact: int) -> np.ndarray:
        """Return the phases once a contact sticks, and with it what cannot slip any more."""
        phases, felt = self.phases(state).copy(), self.slips.rows(state) * np.sqrt(self.ease)
        phases[contact] = STUCK
        phases[(phases != 0.0) & led(felt[phases == STUCK], felt)] = STUCK
        return phases

    def withheld(self, state: State, contact: int) -> State:
        """Return a state in which a contact sticks, however large the force on it is.

        Parameters
        ----------
        state : State
        contact : int

        Returns
        -------
        State
        """
        state = self._with(state, self._stopped(state, contact))
        return state.with_(v=self.still(state, state.v))

    def _settled_under(self, state: State, u: np.ndarray, phases: np.ndarray) -> State:
        """Settle under inputs that may have jumped: freedoms of first order follow them before anything is moved."""
        return state.with_(dry=self._settled(flowing(self.model, state, u), u, phases).dry)

    def _settled(self, state: State, u: np.ndarray, phases: np.ndarray) -> State:
        """Break loose what cannot be held, the worst first, each once; what would then slide back is held after all."""
        loosened: set[int] = set()
        while True:
            state = self._with(state, phases)
            stuck = np.flatnonzero(phases == STUCK)
            held, a = self._holding(state, u)
            _, rates, _ = self.slips.at(state, state.v, a)
            back = [i for i in loosened if phases[i] != STUCK and phases[i] * rates[i] < 0.0]
            excess = np.abs(held) / self.static[stuck] - _MOST
            fresh = [k for k in np.argsort(-excess) if excess[k] > 0.0 and int(stuck[k]) not in loosened]
            if back:
                phases[back] = STUCK
            elif fresh:
                i = int(stuck[fresh[0]])
                phases[i] = -np.sign(held[fresh[0]])
                loosened.add(i)
            else:
                return state

    def _with(self, state: State, phases: np.ndarray) -> State:
        """Return a state with other phases; what sticks from now on is held where it is."""
        order, (_, _, places) = self.slips.order, self.slips.at(state, state.v, state.v)
        phase, anchor = state.dry.phase.copy(), state.dry.anchor.copy()
        fresh = (phases == STUCK) & (phase[order] != STUCK)
        anchor[order] = np.where(fresh, places, anchor[order])
        phase[order] = phases
        return state.with_(dry=Dry(phase, anchor))

    def _check_mass(self, state: State, u: np.ndarray) -> None:
        still = np.zeros(self.model.n)
        M = -self.model.slope(state.loose, still, still, (0.0, 0.0, 1.0), u)
        light = M.diagonal() <= self.model.dust
        W = self.slips.rows(state)
        bad = np.flatnonzero(np.abs(W[:, ~light]).max(axis=1, initial=0.0) == 0.0)
        if bad.size:
            raise StructureError(
                f"CoulombFriction: nothing with mass moves at {self.names[bad[0]]!r}; give the motor its inertia, or "
                "the part mass"
            )
