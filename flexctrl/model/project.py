"""From a wish to a state that the machine can be in: the nearest one, and what it changes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp

from flexctrl.errors import StructureError, check_kind
from flexctrl.frozen import frozen
from flexctrl.mechanics.rotation import logarithm
from flexctrl.model.consistent import extent, same_freedoms
from flexctrl.model.state import State
from flexctrl.structure.freedoms import parse_point
from flexctrl.structure.nodes import Node

if TYPE_CHECKING:
    from flexctrl.model.model import Model

__all__ = ["Projection", "project"]

_ROUNDS = 200
_SETTLED = 1e-14
_TURN = 0.5
_SHORTEST = 1e-3


@frozen
class Projection:
    """The state nearest to what was wished, and by how much it differs.

    Attributes
    ----------
    state : State
    nodes : tuple of Node
        Those that something was wished of.
    moved : numpy.ndarray, shape (nodes, 3)
        Place less the wished one [m].
    turned : numpy.ndarray, shape (nodes, 3)
        Rotation vector from the wished rotation [rad]; zero where none was wished.
    changed : numpy.ndarray, shape (nodes, 3)
        Velocity less the wished one [m/s]; zero where none was wished.
    """

    state: State
    nodes: tuple[Node, ...]
    moved: np.ndarray
    turned: np.ndarray
    changed: np.ndarray

    def __str__(self) -> str:
        changes = (
            ("moved", self.moved, "m"),
            ("turned", self.turned, "rad"),
            ("velocity changed", self.changed, "m/s"),
        )
        return "; ".join(self._worst(*change) for change in changes)

    def _worst(self, what: str, change: np.ndarray, unit: str) -> str:
        sizes = np.sqrt((change**2).sum(axis=1))
        worst = int(np.argmax(sizes))
        return f"{what} by at most {sizes[worst]:.3g} {unit}" + (f" ({self.nodes[worst]})" if sizes[worst] else "")


@frozen
class _Wish:
    """Where some nodes shall be, and values of degrees of freedom that no node shows.

    ``reach`` makes radians of rotations into metres; 0 where only places are wished.
    """

    model: Model
    numbers: np.ndarray
    x: np.ndarray
    R: np.ndarray
    own: np.ndarray
    values: np.ndarray
    reach: float

    @property
    def size(self) -> float:
        """What counts as far [m]."""
        return max(self.model.structure.size, float(np.abs(self.x).max(initial=0.0)))

    def gap(self, state: State) -> np.ndarray:
        """What is wanting, in metres."""
        turns = logarithm(self.R @ state.R[self.numbers].swapaxes(1, 2))
        nodes = np.hstack([self.x - state.x[self.numbers], self.reach * turns])
        return np.append(nodes, self.reach * (self.values - state.q[self.own])) if self.reach else nodes.ravel()

    def slope(self, state: State) -> sp.csr_matrix:
        """How the nodes move with the degrees of freedom."""
        scale = np.tile([1.0, 1.0, 1.0, *[self.reach] * 3], len(self.numbers))
        rows = sp.diags(scale) @ _rows(self.model, state, self.numbers, 6)
        if not self.reach:
            return rows
        own = sp.eye(self.model.n, format="csr")[self.own]
        return sp.vstack([rows, self.reach * own]).tocsr()


def project(
    model: Model,
    wish: State | Mapping[Node, Sequence[float]],
    velocities: Mapping[Node, Sequence[float]] | None = None,
) -> Projection:
    """Return the state nearest to a wish that a machine can be in.

    Joints, supports, rigid parts and loops leave a machine fewer places than its nodes could be given. Places are
    those with the least sum of squares of the nodes' distances from the wished ones (and of their turns times the
    machine's size, where a whole state is wished); velocities then those with the least sum of squares of what they
    differ by. What no wish tells stays as drawn, or at rest. Accelerations follow from the equations of motion.

    Parameters
    ----------
    model : Model
    wish : State or mapping of Node to 3 floats
        A state, all of whose nodes count, or places of some nodes [m].
    velocities : mapping of Node to 3 floats, optional
        Wished velocities of nodes [m/s]; a state brings its rates along, which they replace.

    Returns
    -------
    Projection

    Raises
    ------
    StructureError
        For a node that the machine does not have, or what is no place or velocity.

    Examples
    --------
    >>> import flexctrl as fc
    >>> rod = fc.Rope("rod", (0, 0, 0), (0, 0, -1), EA=1.0)
    >>> load = fc.PointMass("load", rod.end, 1.0)
    >>> pendulum = fc.Structure([rod, load], [fc.Support(rod.start), fc.Pin(rod.end, load.node)])
    >>> model = fc.assemble(pendulum, [fc.LargeRotation(), fc.Gravity()])
    >>> found = fc.project(model, {load.node: (0.6, 0.0, -0.8008)})
    >>> float(round(abs(found.moved[0][2]), 3))
    0.001
    """
    from flexctrl.model.model import Model  # which makes projections

    check_kind(model, Model, "project: model", "a Model, as flexctrl.assemble(structure, effects) gives")
    asked = _asked(model, wish)
    state = _nearest(asked, _first(model, wish))
    state, wanted = _moving(model, state, wish, velocities or {})
    state = model.motion.counted(replace(state, shown=wish.shown)) if isinstance(wish, State) else state
    shown = np.unique(np.append(asked.numbers, list(wanted))).astype(int)
    moved, turned, changed = (np.zeros((len(model.structure.nodes), 3)) for _ in range(3))
    moved[asked.numbers] = state.x[asked.numbers] - asked.x
    if asked.reach:
        turned[asked.numbers] = logarithm(state.R[asked.numbers] @ asked.R.swapaxes(1, 2))
    rates = model.rates(state)[: model.motion.source_base].reshape(-1, 6)
    for number, velocity in wanted.items():
        changed[number] = rates[number, :3] - velocity
    nodes = tuple(model.structure.nodes[i] for i in shown)
    return Projection(state, nodes, moved[shown], turned[shown], changed[shown])


def _points(model: Model, wish: Mapping[Node, Sequence[float]], what: str) -> dict[int, tuple[float, float, float]]:
    if not isinstance(wish, Mapping) or not all(isinstance(node, Node) for node in wish):
        raise StructureError(f"project: {what} = {wish!r}; expected a State, or a mapping of nodes to (x, y, z)")
    return {model.structure.number(node): parse_point(at, f"project: {node}") for node, at in wish.items()}


def _asked(model: Model, wish: State | Mapping[Node, Sequence[float]]) -> _Wish:
    if isinstance(wish, State):
        if np.shape(wish.x) != model.rest.x.shape or np.shape(wish.q) != (model.n,):
            raise StructureError(
                f"project: the state has {len(np.atleast_1d(wish.x))} nodes and {np.size(wish.q)} degrees of freedom, "
                f"the machine {len(model.rest.x)} and {model.n}"
            )
        same_freedoms(model, wish, "project")
        numbers = np.arange(len(model.structure.nodes))
        own = np.unique(model.motion.cells[model.motion.source_base :])
        own = own[own < model.n]
        return _Wish(model, numbers, wish.x[:-1], _square(wish.R[:-1]), own, wish.q[own], extent(model, wish))
    places = _points(model, wish, "wish")
    numbers = np.array(list(places), dtype=int)
    x = np.array(list(places.values())).reshape(-1, 3)
    return _Wish(
        model, numbers, x, np.broadcast_to(np.eye(3), (len(x), 3, 3)), np.zeros(0, dtype=int), np.zeros(0), 0.0
    )


def _square(R: np.ndarray) -> np.ndarray:
    """The rotations nearest to some matrices."""
    U, _, V = np.linalg.svd(R)
    U[:, :, 2] *= np.linalg.det(U @ V)[:, None]
    return np.asarray(U @ V)


def _first(model: Model, wish: State | Mapping[Node, Sequence[float]]) -> State:
    """A state to search from: as drawn, moved as far as the sums of a wished state say."""
    if not isinstance(wish, State):
        return model.rest
    return replace(model.rest, t=wish.t, dry=wish.dry, driven=wish.driven)


def _nearest(wish: _Wish, state: State) -> State:
    """Gauss and Newton's method from a state, with steps as long as they help."""
    model, size = wish.model, wish.size
    gap = wish.gap(state)
    for _ in range(_ROUNDS):
        step = _least(wish.slope(state), gap)
        step = step * min(1.0, _TURN * size / max(np.abs(wish.slope(state) @ step).max(initial=0.0), 1e-300))
        length = float(np.abs(step).max(initial=0.0))
        if length <= _SETTLED * max(1.0, size):
            return state
        share = 1.0
        while share > _SHORTEST:
            new = model.advance(state, share * step, state.v, state.t)
            left = wish.gap(new)
            if left @ left <= gap @ gap * (1.0 + 1e-12):
                break
            share *= 0.5
        else:
            return state
        state, gap = new, left
    return state


def _least(A: sp.csr_matrix, b: np.ndarray) -> np.ndarray:
    """The shortest solution of least squares."""
    if not A.nnz:
        return np.zeros(A.shape[1])
    from scipy.sparse.linalg import lsmr

    return np.asarray(lsmr(A, b, atol=1e-15, btol=1e-15, conlim=0.0, maxiter=20 * min(A.shape))[0])


def _moving(
    model: Model, state: State, wish: State | Mapping[Node, Sequence[float]], velocities: Mapping[Node, Sequence[float]]
) -> tuple[State, dict[int, tuple[float, float, float]]]:
    """A state with the rates nearest to wished velocities."""
    v = np.array(wish.v, float) if isinstance(wish, State) else np.zeros(model.n)
    wanted = _points(model, velocities, "velocities")
    if wanted:
        rows = _rows(model, state, np.array(list(wanted)), 3)
        v = v + _least(rows, np.array(list(wanted.values())).ravel() - rows @ v)
    return state.with_(v=v), wanted


def _rows(model: Model, state: State, numbers: np.ndarray, count: int) -> sp.csr_matrix:
    """The first rows of each node in T."""
    T = model.motion.jacobian(model.place(state))
    return T[(6 * numbers[:, None] + np.arange(count)).ravel()]
