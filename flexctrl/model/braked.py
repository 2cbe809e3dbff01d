"""Equilibria that hold freedoms by name, also those that in this model follow from others.

The motor behind a rigid shaft turns with the joint that it drives, that of a rope which does not stretch with the
rope's length: neither is a coordinate. Such a freedom is held by a force of its own, as a brake's torque on the motor,
and by nothing else: f + Gᵀ τ = 0, θ(q) = θ₀, with its slope G. It takes the place of one coordinate, which then
follows: with steps δq = B δy, where δy has G δq / G_p in place of δq_p, the search for equilibria is the usual one.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field, replace
from functools import cached_property

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp

from flexctrl.errors import EquilibriumError, StructureError
from flexctrl.frozen import frozen
from flexctrl.mechanics.rotation import logarithm
from flexctrl.model.balance import Balance
from flexctrl.model.eased import told
from flexctrl.model.equilibrium import Rest, equilibrium, motors_bearing, settled
from flexctrl.model.holding import own_coordinate, raw_place
from flexctrl.model.linkages.chart import inverse_tangents
from flexctrl.model.model import Model
from flexctrl.model.places import Places, places_of, standing
from flexctrl.model.state import State
from flexctrl.model.units import geared, units
from flexctrl.structure.freedoms import check_finite

__all__ = ["balance_of", "bearing", "borne", "places_held", "rest_held"]

_INDEPENDENT, _CLOSE, _LEANING = 1e-9, 1e-9, 1e-3


@frozen(eq=False)
class Braked(Balance):
    """A balance in which freedoms that follow from others are held too.

    Attributes
    ----------
    cells : numpy.ndarray of int, shape (k,)
        Their places in raw vectors.
    wanted : numpy.ndarray, shape (k,)
        Where they are held, from the drawn shape [m or rad].
    pivots : numpy.ndarray of int, shape (k,)
        The coordinates whose places they take; ``held`` has them too, at no matter which value.
    """

    cells: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=int))
    wanted: np.ndarray = field(default_factory=lambda: np.zeros(0))
    pivots: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=int))

    def gap(self, state: State) -> np.ndarray:
        """Return how far what is held is from its place, in displacements of the coordinates that give way to it."""
        away = np.zeros(self.model.n)
        where = self.places(state)
        away[self.fixed] = np.array(list(self.held.values())) - where[self.fixed]
        off = np.concatenate([self.wanted - stands(self.model, self.cells, state), away[self._turning]])
        away[self._given] = la.solve(self._rows(state)[:, self._given], off)
        return away[self.fixed]

    def places(self, state: State) -> np.ndarray:
        """Return where all coordinates are, as far as that matters to those that are held."""
        return self._own.at(state) if self.model.large else state.q

    @cached_property
    def _own(self) -> Places:
        """The places of coordinates that are held by themselves."""
        return places_of(self.model).among(np.setdiff1d(self.fixed, self.pivots).tolist())

    @cached_property
    def _turning(self) -> np.ndarray:
        """Those of them which sums of steps do not tell."""
        own = np.setdiff1d(self.fixed, self.pivots)
        return np.array([i for i in own if self.model.large and int(i) in self._own.led], dtype=int)

    @cached_property
    def _given(self) -> np.ndarray:
        """The coordinates that give way to what is held."""
        return np.concatenate([self.pivots, self._turning])

    def _rows(self, state: State) -> np.ndarray:
        """How what is held follows the coordinates, shape (held, n)."""
        G = _slope(self.model, self.cells, state)
        return np.vstack([G, self._own.rates(state, self._turning)]) if self._turning.size else G

    def _pulls(self, state: State, force: np.ndarray) -> np.ndarray:
        """The forces on what is held that hold it against forces on all coordinates."""
        return np.asarray(-la.solve(self._rows(state)[:, self._given].T, force[self._given]))

    def turning(self, state: State, force: np.ndarray) -> sp.csr_matrix:
        """Return how what holds coordinates against forces on all of them turns with their steps."""
        if not self._turning.size:
            return sp.csr_matrix((self.model.n, self.model.n))
        return self._own.turning(state, self._turning, self._pulls(state, force)[len(self.pivots) :])

    @property
    def _plain(self) -> bool:
        return False

    def _bearing(self, state: State, force: np.ndarray) -> sp.csr_matrix:
        """How all that holds turns: brakes with their levers, too."""
        turning, motion = self.turning(state, force), self.model.motion
        if not self.model.large or motion.plain:
            return turning
        return turning + sp.csr_matrix(motion.stiffening(state, self.brakes(state, force)))

    def brakes(self, state: State, force: np.ndarray) -> np.ndarray:
        """Return the raw forces that hold against forces on all coordinates."""
        raw = np.zeros(self.model.motion.raw)
        raw[self.cells] = self._pulls(state, force)[: len(self.pivots)]
        return raw

    def part(self, start: State, holding: np.ndarray, done: float) -> Braked:
        """Return the way to this balance from a start that forces ``holding`` hold: 0 there, 1 here."""
        found = super().part(start, holding, done)
        assert isinstance(found, Braked)
        wanted = (1.0 - done) * stands(self.model, self.cells, start) + done * self.wanted
        return self._again(replace(found, wanted=wanted))  # type: ignore[return-value]

    def _change(self, state: State) -> sp.csr_matrix:
        """Steps of the coordinates from steps in which what is held stands in for those that give way: B."""
        given, rows = self._given, self._rows(state)
        follow = -la.solve(rows[:, given], rows)
        follow[:, given] = 0.0
        at = sp.csr_matrix((np.ones(given.size), (given, np.arange(given.size))), (self.model.n, given.size))
        return (sp.identity(self.model.n, format="csr") + at @ sp.csr_matrix(follow)).tocsr()


def rest_held(model: Model, hold: Mapping[str, float], inputs: Mapping[str, float]) -> Rest:
    """Return the equilibrium of a model with freedoms held by name.

    Parameters
    ----------
    model : Model
    hold : mapping of str to float
        ``"girder.start.u"`` or a coordinate's name, and where; also those that rigid parts, shafts and ropes take away.
    inputs : mapping of str to float

    Returns
    -------
    Rest
        ``brakes`` tells the forces that hold what is no coordinate.

    Raises
    ------
    EquilibriumError, StructureError
        As `equilibrium`; for what the joints do not leave free, and for what cannot be held where it is asked to be.
    """
    own, lost = _told(model, hold)
    if not lost:
        return equilibrium(model, hold={model.coordinates[i]: at for i, at in own.items()}, inputs=inputs)
    wanted = {raw_place(model, name): at for name, at in lost.items()}
    own |= {i: float(model.rest.q[i]) for i in model.motion.frozen if i not in own}
    balance = _balance(model, model.input_vector(inputs), own, wanted, model.rest)
    found = settled(balance, model.rest.loose)
    _check_places(model, lost, found.state)
    held = (*(model.coordinates[i] for i in own), *lost)
    at_work, there = told(balance, found.state)
    forces = at_work.brakes(there, at_work.whole_force(there)) if isinstance(at_work, Braked) else None
    brakes = tuple((name, 0.0 if forces is None else float(forces[i])) for name, i in zip(lost, wanted, strict=True))
    return motors_bearing(replace(found, held=held, brakes=brakes))


def bearing(rest: Rest) -> Model:
    """Return the model of an equilibrium under the forces that hold what is no coordinate of it.

    Parameters
    ----------
    rest : Rest

    Returns
    -------
    Model
    """
    return rest.model.carrying(borne(rest)) if rest.brakes else rest.model


def borne(rest: Rest) -> np.ndarray:
    """Return the raw forces that hold what is no coordinate.

    Parameters
    ----------
    rest : Rest

    Returns
    -------
    numpy.ndarray, shape (raw,)
    """
    raw = np.zeros(rest.model.motion.raw)
    for name, force in rest.brakes:
        raw[raw_place(rest.model, name)] = force
    return raw


def balance_of(rest: Rest) -> Balance:
    """Return the conditions of an equilibrium, with all held that it holds.

    Parameters
    ----------
    rest : Rest

    Returns
    -------
    Balance
    """
    model, state = rest.model, rest.state
    numbers = {model.coordinate(name) for name in rest.held if name in model.coordinates}
    own = standing(model, state, sorted(numbers | set(model.motion.frozen)))
    if not rest.brakes:
        return Balance(model, rest.inputs, own)
    cells = [raw_place(model, name) for name, _ in rest.brakes]
    wanted = dict(zip(cells, stands(model, np.array(cells), state).tolist(), strict=True))
    return _balance(bearing(rest), rest.inputs, own, wanted, state)


def places_held(rest: Rest, names: Sequence[str]) -> dict[str, float]:
    """Return where freedoms are in an equilibrium, from where they are drawn.

    Parameters
    ----------
    rest : Rest
    names : sequence of str
        Of coordinates, and of what follows from others.

    Returns
    -------
    dict of str to float
    """
    model, state = rest.model, rest.state
    own = {name: model.coordinate(name) for name in names if name in model.coordinates}
    at = standing(model, state, sorted(own.values()))
    cells = {name: raw_place(model, name) for name in names if name not in own}
    there = stands(model, np.array(list(cells.values()), dtype=int), state)
    return {name: at[i] for name, i in own.items()} | dict(zip(cells, there.tolist(), strict=True))


def stands(model: Model, cells: np.ndarray, state: State) -> np.ndarray:
    """Return how far raw freedoms are from where they are drawn.

    Parameters
    ----------
    model : Model
    cells : numpy.ndarray of int, shape (k,)
        Places in raw vectors: of nodes, and of motors.
    state : State

    Returns
    -------
    numpy.ndarray, shape (k,)
        Displacements [m], turns (of rotations, their rotation vectors) and motor angles [rad].
    """
    if model.large:
        return _posed(model, cells, state)
    away = state.q - model.rest.q
    return _posed(model, cells, model.rest) + _slope(model, cells, model.rest) @ away


def _posed(model: Model, cells: np.ndarray, state: State) -> np.ndarray:
    motion = model.motion
    drawn, driven = model.rest.x, model.rest.driven
    if model.about:  # whose rest is no drawn shape
        drawn = np.array([*(n.position for n in model.structure.nodes), (0.0, 0.0, 0.0)])
        driven = motion.unwound(drawn, np.tile(np.eye(3), (len(drawn), 1, 1)), 0.0 * driven)
    turned = logarithm(state.R)
    nodes = np.hstack([state.x - drawn, turned]).ravel()
    return np.asarray(np.concatenate([nodes, motion.ratios * (state.driven - driven)])[cells])


def _told(model: Model, hold: Mapping[str, float]) -> tuple[dict[int, float], dict[str, float]]:
    """Where coordinates are held, by their numbers, and what is held beside, by its name."""
    own: dict[int, float] = {}
    lost: dict[str, float] = {}
    for name, at in hold.items():
        place = check_finite(at, f"hold {name!r}", "equilibrium")
        if not (coordinate := own_coordinate(model, name)):
            lost[name] = place
        elif own.setdefault(model.coordinate(coordinate), place) != place:
            raise StructureError(f"hold {name!r}: {coordinate} is held in two places, at {place:g} too; name one")
    return own, lost


def _slope(model: Model, cells: np.ndarray, state: State) -> np.ndarray:
    """How raw freedoms follow the coordinates, shape (k, n)."""
    return np.asarray(model.motion.jacobian(model.place(state))[cells].toarray())


def _balance(
    model: Model, u: np.ndarray, own: Mapping[int, float], wanted: Mapping[int, float], start: State
) -> Balance:
    """The balance that holds coordinates and, of raw freedoms, all that can move and do not follow from others."""
    cells, places = np.array(list(wanted), dtype=int), np.array(list(wanted.values()))
    reach = _slope(model, cells, start) * units(model, model.structure.size)
    reach[:, list(own)] = 0.0
    sizes = np.linalg.norm(reach, axis=1)
    moving = np.flatnonzero(sizes > _INDEPENDENT * _yardsticks(model)[cells])
    moving = moving[_leading((reach[moving] / sizes[moving, None]).T)]
    if not moving.size:
        return Balance(model, u, own)
    pivots = _leading(reach[moving])
    held = dict(own) | {int(i): float(start.q[i]) for i in pivots}
    return Braked(model, u, held, cells=cells[moving], wanted=places[moving], pivots=pivots)


def _leading(A: np.ndarray) -> np.ndarray:
    """Numbers of columns that make up the space of all, the largest first."""
    if not A.size:
        return np.zeros(0, dtype=int)
    R, order = la.qr(A, mode="r", pivoting=True)
    sizes = np.abs(np.diag(R))
    return np.asarray(order[: int((sizes > _INDEPENDENT * sizes[0]).sum())])


def _yardsticks(model: Model) -> np.ndarray:
    """What a displacement of one is in each raw freedom of nodes and motors."""
    size = model.structure.size
    nodes = np.tile(np.repeat([size, 1.0], 3), len(model.motion.place))
    return np.concatenate([nodes, geared(model, size)])


def _check_places(model: Model, lost: Mapping[str, float], state: State) -> None:
    """Refuse an equilibrium in which something is not where it is to be held."""
    cells = np.array([raw_place(model, name) for name in lost])
    reached, units_there = stands(model, cells, state), _yardsticks(model)[cells]
    for (name, at), place, unit in zip(lost.items(), reached, units_there, strict=True):
        if abs(place - at) > _CLOSE * max(unit, abs(at)):
            raise EquilibriumError(
                f"no equilibrium found with {name} held at {at:g}: it stays at {place:.6g}, as in this model it does "
                "not move, or only with what is held elsewhere; hold it there, or let bend what is between",
                state,
                0.0,
            )
    for name, cell in zip(lost, cells.tolist(), strict=True):
        if model.large and cell < model.motion.source_base and cell % 6 > 2 and _leaning(model, cells, state, cell):
            raise EquilibriumError(
                f"no equilibrium found with {name} held: it turns about other axes, too, and is no coordinate, so that "
                "a moment about an axis of space would hold a spin, no angle; hold all its rotations, or those of the "
                "node that carries it and the hinge's turn",
                state,
                0.0,
            )


def _leaning(model: Model, cells: np.ndarray, state: State, cell: int) -> bool:
    """Whether a spin is not the rate of the component of a rotation vector, some of which are free."""
    first = cell - cell % 6 + 3
    if {first, first + 1, first + 2} <= set(cells.tolist()):
        return False
    theta = logarithm(state.R[[cell // 6]])[0]
    rates = inverse_tangents(np.tile(theta, (3, 1)), np.eye(3)).T[cell % 6 - 3]
    rates[cell % 6 - 3] -= 1.0
    return bool(np.abs(rates).max() > _LEANING)
