"""The model: a structure under some effects, ready to be balanced, linearised and run."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import field, replace
from functools import cached_property
from itertools import chain
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp

from flexctrl.effects.effect import Effect
from flexctrl.effects.large_rotation import LargeRotation
from flexctrl.errors import StructureError, check_kind, did_you_mean
from flexctrl.frozen import ByFields, frozen
from flexctrl.kernels.kernel import Backend
from flexctrl.model.assembly import assembled, mass_blocks, modal_blocks, stiffness_blocks
from flexctrl.model.equations import Equations, LargeMotion, Small, SmallMotion
from flexctrl.model.forces import Forces
from flexctrl.model.laws.families import families_of
from flexctrl.model.laws.frictions import friction_families, lag_blocks
from flexctrl.model.laws.gusts import Gusts, gusts_of
from flexctrl.model.laws.kinks import Kinks
from flexctrl.model.laws.loose_kinds import loose_families, loose_names
from flexctrl.model.laws.switches import Switches
from flexctrl.model.laws.wind_kinds import wind_families
from flexctrl.model.mixed import Excess
from flexctrl.model.motion import Motion
from flexctrl.model.overturned import displaced_beyond, overturned
from flexctrl.model.signals import Signals, signals_of
from flexctrl.model.small_signals import small_signals
from flexctrl.model.state import State
from flexctrl.structure.drives import Drive
from flexctrl.structure.elements import Part
from flexctrl.structure.freedoms import check_finite, numbers
from flexctrl.structure.lines import Spring
from flexctrl.structure.structure import Structure

if TYPE_CHECKING:
    import control
    from matplotlib.figure import Figure

    from flexctrl.model.equilibrium import Rest

_LASTING = ("inputs", "outputs", "large", "signals", "gusts", "forces", "dust", "_mass", "_stiffness")
"""What does not depend on the forces that a model carries."""


@frozen
class Model(ByFields):
    """The equations of motion of a structure under some effects: Tᵀ (f(x, v, a) + loads) = 0.

    Made by `assemble`. ``coordinates`` names the degrees of freedom in the order of every vector and matrix.

    Attributes
    ----------
    structure : Structure
    effects : tuple of Effect
        Composites taken apart.
    motion : Motion
    backend : Backend
        How the kernels run.
    viscous : scipy.sparse.csr_matrix, shape (n, n)
        Damping that acts on the degrees of freedom themselves (modal damping); empty without.
    about : Small or None
        Matrices of small motion about another place than the drawn shape (geometric stiffness).
    carried : numpy.ndarray, shape (raw,), or 0.0
        Constant raw forces beside those of the inputs: what holds a motor in an equilibrium.
    modal_about : State or None
        The equilibrium whose modes ``viscous`` is of.
    """

    structure: Structure
    effects: tuple[Effect, ...]
    motion: Motion
    backend: Backend
    viscous: sp.csr_matrix = field(repr=False)
    about: Small | None = field(default=None, repr=False)
    carried: np.ndarray | float = field(default=0.0, repr=False)
    modal_about: State | None = field(default=None, repr=False)

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Names of the degrees of freedom."""
        return self.motion.names

    @property
    def n(self) -> int:
        """Number of degrees of freedom."""
        return self.motion.n

    @cached_property
    def inputs(self) -> tuple[str, ...]:
        """Names of the inputs."""
        return tuple(i.name for i in self.structure.inputs)

    @cached_property
    def outputs(self) -> tuple[str, ...]:
        """Names of the outputs."""
        return tuple(o.name for o in self.structure.outputs)

    @cached_property
    def large(self) -> bool:
        """Whether parts may move as far as they like."""
        return any(isinstance(e, LargeRotation) for e in self.effects)

    @cached_property
    def equations(self) -> Equations:
        """The equations of motion: those of small motion unless parts may move as far as they like."""
        return LargeMotion(self) if self.large else SmallMotion(self)

    @property
    def notes(self) -> tuple[str, ...]:
        """What was held or released so that rigid loops close."""
        return self.motion.notes

    @property
    def rest(self) -> State:
        """The machine at rest: as drawn, or in the equilibrium that small motion is about (`GeometricStiffness`)."""
        return self.motion.rest

    @cached_property
    def drawn(self) -> State:
        """The machine as drawn, at rest; where small motion is about an equilibrium, displaced from that."""
        away = self.rest.q
        return self.advance(self.rest, -away, np.zeros(self.n), self.rest.t) if away.any() else self.rest

    @cached_property
    def signals(self) -> Signals:
        """Inputs and outputs, ready to be evaluated."""
        found = signals_of(self.structure, self.effects, self.motion)
        return found if self.large else small_signals(found, self.motion)

    @cached_property
    def gusts(self) -> Gusts:
        """What the wind's inputs add to the mean wind."""
        return gusts_of(self.structure, self.effects, self.forces.families)

    def pushes(self, state: State, u: np.ndarray) -> np.ndarray:
        """Return the raw forces of the inputs in a state, gusts among them.

        Parameters
        ----------
        state : State
        u : numpy.ndarray, shape (inputs,)

        Returns
        -------
        numpy.ndarray, shape (raw,)
        """
        steady = self.signals.loads_at(state) @ u + self.carried
        if not self.gusts:
            return steady
        return steady + self.gusts.force(self.slots(state), u, self.motion.raw)

    def carrying(self, raw: np.ndarray) -> Model:
        """Return the model with constant raw forces beside those of its inputs, to be balanced and linearised.

        Parameters
        ----------
        raw : numpy.ndarray, shape (raw,)

        Returns
        -------
        Model
        """
        found = replace(self, carried=raw)
        found.__dict__.update({name: self.__dict__[name] for name in _LASTING if name in self.__dict__})
        return found

    def reach(self, state: State, u: np.ndarray) -> sp.csr_matrix:
        """Return ∂(raw forces of the inputs)/∂u where the equations take it, about inputs u, shape (raw, inputs).

        Parameters
        ----------
        state : State
        u : numpy.ndarray, shape (inputs,)

        Returns
        -------
        scipy.sparse.csr_matrix
        """
        place = self.place(state)
        about = u if self.large else self.about.inputs if self.about else np.zeros_like(u)
        steady = self.signals.loads_at(place)
        if not self.gusts:
            return steady
        return steady + sp.csr_matrix(self.gusts.reach(self.slots(place), about, self.motion.raw))

    def slots(self, state: State) -> np.ndarray:
        """Return the flat vector that kernels read in a state, without accelerations.

        Parameters
        ----------
        state : State

        Returns
        -------
        numpy.ndarray
        """
        return self.forces.slots(state, state.v, np.zeros(self.n))

    @cached_property
    def forces(self) -> Forces:
        """All kernels of the model, bound to their tables."""
        rigid = frozenset(p.name for p in self.structure.elements if not self.bends(p))
        machine, effects = self.structure, self.effects
        families = families_of(machine, effects, rigid, loose_names(machine, effects))
        more = loose_families(machine, effects) + friction_families(machine, effects) + wind_families(machine, effects)
        return Forces(self.motion, families + more, self.backend)

    @cached_property
    def switches(self) -> Switches:
        """Laws of force that switch while the machine runs."""
        return Switches(self)

    @cached_property
    def kinks(self) -> Kinks:
        """Where laws of force have corners."""
        return Kinks(self)

    @cached_property
    def dust(self) -> np.ndarray:
        """Mass of each degree of freedom that is but rounding of the terms it is the sum of, at most, shape (n,)."""
        return self.forces.rounding((0.0, 0.0, 1.0))

    @property
    def numbers(self) -> tuple[np.ndarray, ...]:
        """What tells the model from others with the same names and effects."""
        return (self.rest.x, *(f.parameters for f in self.forces.families))

    def bends(self, part: Part | Drive) -> bool:
        """Tell whether some effect lets a part deform.

        Parameters
        ----------
        part : Part or Drive

        Returns
        -------
        bool
        """
        return any(e.bends(part) for e in self.effects)

    def mass(self) -> sp.csc_matrix:
        """Return M at rest from the consistent element matrices, shape (n, n), in the order of `coordinates`."""
        return self.about.M if self.about else self._mass

    def strain(self, state: State, u: np.ndarray, motions: np.ndarray) -> np.ndarray:
        """Return ΦᵀKΦ of some motions in a state at rest, where that can be had without the rounding of K's entries.

        Parameters
        ----------
        state : State
        u : numpy.ndarray, shape (inputs,)
        motions : numpy.ndarray, shape (n, k)

        Returns
        -------
        numpy.ndarray, shape (k, k)
        """
        return self.equations.strain(state, u, motions)

    def stiffness(self) -> sp.csc_matrix:
        """Return K at rest from the element matrices, shape (n, n); it may be singular.

        Without prestress, unless the model has `GeometricStiffness`.
        """
        return self.about.K if self.about else self._stiffness

    @cached_property
    def _mass(self) -> sp.csc_matrix:
        modal = modal_blocks(self.structure, self.effects, self.motion)
        own = ((name, (places, mass)) for name, (places, mass, _) in modal)
        return assembled(self.motion, chain(mass_blocks(self.structure, self.motion), own))

    @cached_property
    def _stiffness(self) -> sp.csc_matrix:
        return self.stiffness_but(frozenset())

    def stiffness_but(self, without: frozenset[str]) -> sp.csc_matrix:
        """Return K of small motion about the drawn shape without some parts.

        Parameters
        ----------
        without : frozenset of str
            Their names.

        Returns
        -------
        scipy.sparse.csc_matrix, shape (n, n)
        """
        loose = loose_names(self.structure, self.effects) | without
        parts = stiffness_blocks(self.structure, self.motion, self._stiff_but(loose))
        modal = modal_blocks(self.structure, self.effects, self.motion)
        own = ((name, (places, stiffness)) for name, (places, _, stiffness) in modal)
        return assembled(self.motion, chain(parts, own, lag_blocks(self.structure, self.effects, self.motion)))

    def _stiff_but(self, loose: frozenset[str]) -> Callable[[Part | Drive], bool]:
        """Which parts resist deformation at rest."""
        return lambda part: (isinstance(part, Spring) or self.bends(part)) and part.name not in loose

    def input_vector(self, inputs: Mapping[str, float]) -> np.ndarray:
        """Return input values in order; what is not named is zero.

        Parameters
        ----------
        inputs : mapping of str to float

        Returns
        -------
        numpy.ndarray, shape (inputs,)

        Raises
        ------
        StructureError
            For an unknown name.
        """
        check_kind(inputs, Mapping, "model: inputs", "a mapping of input names to values")
        u = np.zeros(len(self.inputs))
        for name, value in inputs.items():
            if name not in self.inputs:
                raise StructureError(f"model has no input {name!r}{did_you_mean(name, self.inputs)}")
            if callable(value):
                raise StructureError(
                    f"model: input {name!r} is a function; expected a number: functions of time are a controller, "
                    f"OpenLoop({{{name!r}: …}})"
                )
            u[self.inputs.index(name)] = check_finite(value, f"input {name!r}", "model")
        return u

    def place(self, state: State) -> State:
        """Return where levers and directions of forces are taken: the state, or the shape at rest in small motion.

        Parameters
        ----------
        state : State

        Returns
        -------
        State
        """
        return self.equations.place(state)

    def loads(self, state: State, u: np.ndarray) -> np.ndarray:
        """Return Tᵀ B u, the generalised forces of the inputs.

        Parameters
        ----------
        state : State
        u : numpy.ndarray, shape (inputs,)

        Returns
        -------
        numpy.ndarray, shape (n,)
        """
        return self.equations.loads(state, u)

    def balance(self, state: State, v: np.ndarray, a: np.ndarray) -> np.ndarray:
        """Return the sum of all forces on the degrees of freedom except the inputs; zero when they obey.

        Parameters
        ----------
        state : State
        v, a : numpy.ndarray, shape (n,)
            Rates and accelerations of the degrees of freedom.

        Returns
        -------
        numpy.ndarray, shape (n,)
        """
        return self.equations.balance(state, v, a)

    def slope(
        self,
        state: State,
        v: np.ndarray,
        a: np.ndarray,
        seeds: tuple[float, float, float],
        u: np.ndarray,
        excess: Excess | None = None,
    ) -> sp.csr_matrix:
        """Return ∂(balance + loads)/∂(own motion) for a motion that adds ``seeds`` × increment to (place, v, a).

        Parameters
        ----------
        state : State
        v, a : numpy.ndarray, shape (n,)
            Rates and accelerations of the degrees of freedom.
        seeds : tuple of 3 floats
            (1, 0, 0) gives −K, (0, 1, 0) gives −C, (0, 0, 1) gives −M; an integrator mixes them.
        u : numpy.ndarray, shape (inputs,)
        excess : Excess, optional
            Stresses borne beside those of the state; see `flexctrl.model.mixed`.

        Returns
        -------
        scipy.sparse.csr_matrix, shape (n, n)
        """
        return self.equations.slope(state, v, a, seeds, u, excess)

    def advance(self, state: State, step: np.ndarray, v: np.ndarray, t: float) -> State:
        """Return the state after a step of the degrees of freedom.

        Parameters
        ----------
        state : State
        step : numpy.ndarray, shape (n,)
            Displacements; rotation vectors in space axes for rotations.
        v : numpy.ndarray, shape (n,)
            New rates.
        t : float
            New time.

        Returns
        -------
        State
        """
        return self.equations.advance(state, step, v, t)

    def apart(self, state: State) -> str:
        """Say which joint of rigid parts has come apart, as one in line does where they move far.

        Parameters
        ----------
        state : State

        Returns
        -------
        str
            By how much, and what helps; empty if none has.
        """
        return self.motion.apart(state) if self.large else ""

    def rates(self, state: State) -> np.ndarray:
        """Return the raw rates of a state: velocities and spins of all nodes, then the speeds of the motors.

        Parameters
        ----------
        state : State

        Returns
        -------
        numpy.ndarray, shape (raw,)
        """
        return self.motion.rates(self.place(state), state.v)

    def measure(self, state: State) -> np.ndarray:
        """Return the outputs of a state.

        Parameters
        ----------
        state : State

        Returns
        -------
        numpy.ndarray, shape (outputs,)
        """
        return self.signals.outputs(state, self.rates(state))

    def energy(self, state: State) -> tuple[float, float, float]:
        """Return kinetic energy [J], stored energy [J] and dissipated power [W] of a state.

        Parameters
        ----------
        state : State

        Returns
        -------
        tuple of 3 floats
        """
        return self.equations.energy(state)

    def displace(self, q: Mapping[str, float] | np.ndarray) -> State:
        """Return the machine at rest after a displacement of the degrees of freedom from the drawn shape.

        Parameters
        ----------
        q : mapping of coordinate name to float, or numpy.ndarray of shape (n,)
            Displacements [m], rotations [rad] (rotation vectors in space axes).

        Returns
        -------
        State

        Raises
        ------
        StructureError
            For an unknown coordinate, what is no finite number, or a shape whose forces are not defined.
        """
        step = np.zeros(self.n)
        if isinstance(q, Mapping):
            for name, value in q.items():
                step[self.coordinate(name)] = check_finite(value, f"coordinate {name!r}", "model")
        elif len(values := numbers(q)) == self.n and np.isfinite(values).all():
            step[:] = values
        else:
            raise StructureError(f"displace: expected {self.n} finite numbers, one a coordinate, got {q!r}")
        state = self.advance(self.rest, step, np.zeros(self.n), 0.0)
        beyond = displaced_beyond(self, step)
        if beyond or not np.isfinite(self.energy(state)).all():
            why = beyond or overturned(self, state) or "an element has no length left: its forces are not defined there"
            raise StructureError(f"displace: {why}. Or displace it a little less")
        return state

    def coordinate(self, name: str) -> int:
        """Return the place of a degree of freedom by name.

        Parameters
        ----------
        name : str

        Returns
        -------
        int

        Raises
        ------
        StructureError
            If there is none of that name.
        """
        if name not in self.coordinates:
            raise StructureError(f"model has no coordinate {name!r}{did_you_mean(name, self.coordinates)}")
        return self.coordinates.index(name)

    def plot(self) -> Figure:
        """Draw the machine: what some effect bends in blue, what is rigid in black.

        Returns
        -------
        matplotlib.figure.Figure
        """
        from flexctrl.plots.overview import model_figure

        return model_figure(self)

    def to_nlsys(self, at: Rest | State | None = None) -> control.NonlinearIOSystem:
        """Return the model as a state space for python-control; see :func:`flexctrl.model.nlsys.to_nlsys`.

        Parameters
        ----------
        at : Rest or State, optional
            Where the coordinates are zero; default: the shape as drawn.
        """
        from flexctrl.model.nlsys import to_nlsys

        return to_nlsys(self, at)

    def with_(self, *, backend: Backend) -> Model:
        """Return the same model on another backend.

        Parameters
        ----------
        backend : Backend

        Returns
        -------
        Model
        """
        return replace(self, backend=backend, motion=replace(self.motion, backend=backend))
