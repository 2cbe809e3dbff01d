"""The tables of exact steps of linear equations, and what outputs are read from."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from flexctrl.dynamics.march.pairs import pairs_of
from flexctrl.dynamics.march.record import Leap
from flexctrl.frozen import frozen
from flexctrl.model.flat.flattened import Flattened

if TYPE_CHECKING:
    from flexctrl.dynamics.linear_motion.modal_equations import ModalEquations
    from flexctrl.dynamics.linear_motion.propagator import Propagator
    from flexctrl.dynamics.linear_motion.quadratic import Turnover

__all__ = ["Leaps", "Tables"]

_DUST = 1e-12
_TURN, _FLAT = 0.5, 1e-14
"""What turns by less in a step, its ends show [rad]. Vectors of critical damping are nearly
one: what is of them may come out large, and steps are looked at then."""


@frozen(eq=False)
class Tables:
    """What steps of one length need.

    Attributes
    ----------
    h : float
        [s]
    transition : numpy.ndarray, shape (modes, size)
        To the modal state at the end, from that at the start, the inputs and 1.
    losses : numpy.ndarray, shape (size, size)
        The energy dissipated, a quadratic form in these.
    """

    h: float
    transition: np.ndarray
    losses: np.ndarray

    @classmethod
    def of(cls, h: float, propagator: Propagator, turnover: Turnover) -> Tables:
        """Work them out."""
        return cls(h, _over(propagator, h, h), turnover.forms(h)[1])


def _over(propagator: Propagator, t: float, h: float) -> np.ndarray:
    transition, powers = propagator.over(t, h)
    return np.hstack([transition.toarray(), powers[0]])


class Leaps:
    """The leaps of a model, as loops know them.

    Parameters
    ----------
    F : Flattened
    equations : ModalEquations

    Attributes
    ----------
    record : Leap
    """

    def __init__(self, F: Flattened, equations: ModalEquations) -> None:
        first, n, padded, ways = equations.first, F.model.n, F.flat.padded, _ways(F)
        self._filled: tuple[Tables, tuple[bool, bool]] | None = None
        self._first, self._outputs = first, _sums(F, first.C)
        self.pairs = pairs_of(first)
        self.modes, few = 2 * self.pairs.half, first.B.shape[1]
        self.size = self.modes + few
        self.wide = -(-self.size // 8) * 8
        self.places = np.append(self.pairs.where, self.modes + np.arange(few))
        both = np.hstack([first.C @ self.pairs.basis, first.D])
        gliding, seen = _seen(F, _from_rest(F, both), ways)
        sights = -(-len(seen) // 8) * 8
        self.record = Leap(
            modes=self.modes,
            size=self.size,
            wide=self.wide,
            paired=0,
            parted=0,
            sights=sights,
            gliding=int(gliding),
            transition=np.zeros(self.size * self.wide),
            state=np.zeros(self.wide),
            before=np.zeros(self.wide),
            after=np.zeros(self.wide),
            places=self._columns(both[:n][F.plan.order], padded),
            rates=self._columns(both[n:][F.plan.order], padded),
            losses=np.zeros(self.size * self.wide),
            seen=self._columns(seen, sights),
            sight=np.zeros(sights),
            ways=np.array([F.ordered(row) for row in ways]).ravel(),
        )

    @property
    def modal(self) -> np.ndarray:
        """The modal state."""
        return self.pairs.basis @ self.record.state[self.pairs.where]

    @modal.setter
    def modal(self, state: np.ndarray) -> None:
        self.record.state[:] = 0.0
        self.record.state[self.pairs.where] = self.pairs.inverse @ state

    def within(self, modal: np.ndarray, w: np.ndarray, h: float) -> np.ndarray:
        """Return the largest sums of vibrations that turn by more than half a radian in a step, in each output.

        Parameters
        ----------
        modal : numpy.ndarray, shape (states,)
        w : numpy.ndarray, shape (inputs + 1,)
            Held from there on.
        h : float
            Of the steps [s].

        Returns
        -------
        numpy.ndarray, shape (outputs,)
        """
        poles, inverse, seen = self._vibrations
        fast = abs(poles) * h > _TURN
        sizes = inverse[fast] @ modal + (inverse[fast] @ self._first.B @ w) / poles[fast]
        return np.asarray(seen[:, fast] @ abs(sizes))

    @cached_property
    def _vibrations(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Poles, what is of each in a modal state, and by how much the outputs see it; none of what drifts."""
        A = self._first.A
        poles, inverse, vectors = np.zeros(len(A), complex), *np.zeros((2, *A.shape), complex)
        for block in self._first.blocks:
            poles[block], vectors[block, block] = np.linalg.eig(A[block, block])
            if poles[block].any():
                inverse[block, block] = np.linalg.pinv(vectors[block, block], rcond=_FLAT)
        return poles, inverse, abs(self._outputs @ vectors)

    def _columns(self, rows: np.ndarray, padded: int) -> np.ndarray:
        """A matrix on the state, as loops read it: column by column."""
        found = np.zeros((self.size, padded))
        found[self.places, : len(rows)] = rows.T
        return found.ravel()

    def fill(self, tables: Tables) -> tuple[bool, bool]:
        """Put tables where loops read them; tell whether they go pair by pair: steps, and what is lost."""
        if self._filled is None or self._filled[0] is not tables:
            self._filled = tables, self._written(tables)
        return self._filled[1]

    def _written(self, tables: Tables) -> tuple[bool, bool]:
        leap, modes, turned = self.record, self.modes, np.eye(len(self.places))
        turned[: len(self.pairs.basis), : len(self.pairs.basis)] = self.pairs.basis
        transition, losses = np.zeros((modes, self.size)), np.zeros((self.size, self.size))
        transition[np.ix_(self.pairs.where, self.places)] = self.pairs.inverse @ tables.transition @ turned
        losses[np.ix_(self.places, self.places)] = turned.T @ tables.losses @ turned
        paired, parted = self.pairs.apart and _apart(transition), self.pairs.apart and _parted(losses[:modes, :modes])
        put = (_by_columns, _by_pairs)
        steps = put[paired](transition, self.wide)
        lost = _lost_by_pairs(losses, modes) if parted else _lost(losses, self.wide)
        leap.transition[: steps.size], leap.losses[: lost.size] = steps, lost
        return paired, parted


def _by_columns(transition: np.ndarray, wide: int) -> np.ndarray:
    found = np.zeros((transition.shape[1], wide))
    found[:, : len(transition)] = transition.T
    return found.ravel()


def _by_pairs(transition: np.ndarray, wide: int) -> np.ndarray:
    modes = len(transition)
    one, two = np.arange(modes // 2), np.arange(modes // 2, modes)
    own = [transition[rows, columns] for rows in (one, two) for columns in (one, two)]
    return np.concatenate([*own, transition[:, modes:].T.ravel()])


def _lost(losses: np.ndarray, wide: int) -> np.ndarray:
    """The form of losses by rows, as far as the eight of the diagonal; what is before that stands for both sides."""
    found = np.zeros((len(losses), wide))
    found[:, : len(losses)] = losses
    eight = np.arange(wide) // 8
    found[eight[: len(losses), None] > eight[None]] *= 2.0
    found[eight[: len(losses), None] < eight[None]] = 0.0
    return found.ravel()


def _lost_by_pairs(losses: np.ndarray, modes: int) -> np.ndarray:
    one, two = np.arange(modes // 2), np.arange(modes // 2, modes)
    own = [losses[one, one], 2.0 * losses[one, two], losses[two, two]]
    return np.concatenate([*own, 2.0 * losses[:modes, modes:].T.ravel(), losses[modes:, modes:].ravel()])


def _apart(transition: np.ndarray) -> bool:
    """Tell whether no pair moves another one."""
    left = _mixed(transition[:, : len(transition)])
    return bool(left.max(initial=0.0) <= _DUST * np.abs(transition).max(initial=0.0))


def _parted(losses: np.ndarray) -> bool:
    """Tell whether no pair's motion changes what another one loses."""
    scale = np.sqrt(np.maximum(np.diag(losses), 0.0))
    return bool((_mixed(losses) <= _DUST * np.outer(scale, scale)).all())


def _mixed(matrix: np.ndarray) -> np.ndarray:
    """Sizes of the entries between pairs."""
    found, k = np.abs(matrix), np.arange(len(matrix) // 2)
    for rows in (k, k + len(k)):
        found[rows, k] = found[rows, k + len(k)] = 0.0
    return found


def _from_rest(F: Flattened, both: np.ndarray) -> np.ndarray:
    """Coordinates and rates, these counted from where the machine rests."""
    found = both.copy()
    found[: F.model.n, -1] -= F.model.rest.q
    return found


def _ways(F: Flattened) -> np.ndarray:
    """What the inputs' work is done along, on the degrees of freedom, shape (inputs, n)."""
    model = F.model
    units = np.eye(len(model.inputs))
    return np.array([model.loads(model.rest, unit) for unit in units]).reshape(-1, model.n)


def _seen(F: Flattened, both: np.ndarray, ways: np.ndarray) -> tuple[bool, np.ndarray]:
    """Whether corners can be told from arms; and outputs, ways and arms, on modal states, inputs and 1."""
    arms = _arms(F, both)
    if arms is None:
        return False, np.zeros((0, both.shape[1]))
    along = ways @ both[: F.model.n]
    along[:, -1] += ways @ F.model.rest.q
    sums = _sums(F, both)
    sums[:, -1] += F.gauges.levels
    return True, np.vstack([sums, along, arms])


def _sums(F: Flattened, both: np.ndarray) -> np.ndarray:
    """The outputs, likewise, but for where they rest."""
    model, n = F.model, F.model.n
    T, still = model.motion.jacobian(model.rest), np.zeros(model.motion.raw)
    on_places, on_rates = model.signals.slopes(model.rest, still, still.size)
    return np.asarray((on_places @ T) @ both[:n] + (on_rates @ T) @ both[n:])


def _arms(F: Flattened, both: np.ndarray) -> np.ndarray | None:
    """The arms of lines that have corners, likewise; None where other laws of force have some."""
    kinks, motion, n = F.model.kinks.met, F.model.motion, F.model.n
    (ends, lengths), (drives, _), (travels, _) = kinks.lines, kinks.shafts, kinks.rails
    if len(drives) or len(travels) or kinks.sheaves or (6 * ends >= motion.source_base).any():
        return None
    on_places = np.asarray(motion.jacobian(F.model.rest) @ both[:n])
    found = np.zeros((3 * len(lengths), both.shape[1]))
    for k, (start, end) in enumerate(ends.reshape(-1, 2).tolist()):
        found[3 * k : 3 * k + 3] = on_places[6 * end : 6 * end + 3] - on_places[6 * start : 6 * start + 3]
        found[3 * k : 3 * k + 3, -1] += F.model.rest.x[end] - F.model.rest.x[start]
    return found
