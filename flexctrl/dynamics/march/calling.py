"""Calls of the compiled loops, with the matrices that they ask for, and what they remember."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from flexctrl.dynamics.march.contacts import contacts_of
from flexctrl.dynamics.march.loops import run
from flexctrl.dynamics.march.making import Method, march_of
from flexctrl.dynamics.march.record import (
    CONTROLLED,
    DONE,
    FRESH,
    REFACTOR,
    REMADE,
    SAMPLED,
    SINGULAR,
    WANTS_MASS,
    WANTS_TANGENT,
    WEIGH,
    WEIGHED,
)
from flexctrl.errors import KernelError
from flexctrl.frozen import frozen
from flexctrl.kernels.native import Packed
from flexctrl.model.flat.flattening import flatten
from flexctrl.model.laws.kinds import NODE_SLOT
from flexctrl.model.model import Model

__all__ = ["Loops", "Remembered"]

_HABITS = ("habit", "trusted", "tolerance", "served", "spent", "lately", "missed", "believed", "swift", "halved")
_PACED = (CONTROLLED, SAMPLED)
_NOTHING: tuple[tuple[int, int], np.ndarray, np.ndarray] = ((-1, -1), np.zeros(0), np.zeros(0))


@frozen(eq=False)
class Remembered:
    """What later steps of a march depend on beside the point they start from.

    Attributes
    ----------
    tangent, mass : numpy.ndarray
        What they are made again from, or they themselves; see `_parts`. Empty if they have not been made.
    made_for : float
        Step of the tangent [s].
    numbers : tuple of float
        What the march has learned: of Newton's habit, of the tangent's worth, of what the mass misses.
    """

    tangent: np.ndarray
    mass: np.ndarray
    made_for: float
    numbers: tuple[float, ...]


class Loops:
    """The compiled loops of a model, and the record that they work on.

    Parameters
    ----------
    model : Model
        One that can be marched.
    method : Method
    """

    leaping: ClassVar[int] = 0
    answering: ClassVar[int] = 0

    def __init__(self, model: Model, method: Method) -> None:
        self.model, self.method = model, method
        self.flattened = flatten(model)
        self.contacts: Any = Packed(contacts_of(self.flattened))
        self.march = Packed(march_of(self.flattened, self.contacts, method, self.leaping, self.answering))
        self.dry = model.rest.dry
        self._run = self.march.bound(run, without=("paced",))
        self._task = self.march.cell("task")
        self._kept = _NOTHING

    def forget(self) -> None:
        """Be as good as new."""
        self.march.reset()
        self.flattened.flat.z[:] = 0.0
        self._kept = _NOTHING

    @cached_property
    def _run_paced(self) -> Callable[[], int]:
        """The loops with the tasks that most runs do without."""
        return self.march.bound(run)

    def _do(self, task: int) -> int:
        self._task[0] = task
        return self._run_paced() if task in _PACED else self._run()

    def _through(self, task: int) -> int:
        """Do a task, with the matrices it asks for."""
        return self._answered(self._do(task), task)

    def _answered(self, status: int, task: int) -> int:
        """Go on with a task as long as it asks for matrices."""
        while status in (WANTS_TANGENT, WANTS_MASS):
            seeds, made = (self._seeds, REFACTOR) if status == WANTS_TANGENT else ((0.0, 0.0, 1.0), WEIGH)
            if self._made(seeds, made) != DONE:
                self.march.phase = FRESH
                return SINGULAR
            status = self._do(task)
        return status

    @property
    def _seeds(self) -> tuple[float, float, float]:
        c, h = self.method.coefficients, self.march.h
        return 1.0, c.gamma / (h * c.beta), (1.0 - c.alpha_m) / (h * h * c.beta * (1.0 - c.alpha_f))

    def _made(self, seeds: tuple[float, float, float], task: int) -> int:
        """Fill in a matrix that the loops do not make themselves, and factorise it."""
        F, f, m = self.flattened, self.flattened.flat, self.march
        poses = f.z[: self.model.forces.drive_base].reshape(-1, NODE_SLOT)[:, :12]
        state = F.pose_state(poses.ravel(), f.q + f.step, f.v, f.found, m.t, self.dry)
        state = self.model.switches.unheld(state)
        slope = self.model.slope(state, state.v, F.own(f.rate), seeds, f.u).tocoo()
        m.entries[:] = 0.0
        try:
            m.entries[F.plan.places(slope.row, slope.col)] = slope.data
        except KernelError:
            return SINGULAR
        return self._do(task)

    def remembered(self) -> Remembered:
        """Return what another march needs to go on with the same bits."""
        m, kept = self.march, self._kept
        if (m.factorisations, m.weighings) != kept[0]:
            tangent = np.concatenate(self._parts(False)) if m.made_for > 0.0 else np.zeros(0)
            mass = np.concatenate(self._parts(True)) if m.mass_for == 1.0 else np.zeros(0)
            self._kept = kept = ((m.factorisations, m.weighings), tangent, mass)
        return Remembered(kept[1], kept[2], m.made_for, tuple(getattr(m, name) for name in _HABITS))

    def recall(self, memory: Remembered) -> None:
        """Go on as the march whose memory this is."""
        m, f = self.march, self.flattened.flat
        made = m.factorisations
        for kept, mass in ((memory.tangent, False), (memory.mass, True)):
            if kept.size and not self._whole:
                f.z[: f.posed], m.h = kept[: f.posed], memory.made_for
                self._make(mass)
            if kept.size:
                parts = self._parts(mass)
                for part, old in zip(parts, np.split(kept, np.cumsum([p.size for p in parts])[:-1]), strict=True):
                    part[:] = old
        m.factorisations, m.made_for = made, memory.made_for
        m.mass_for = 1.0 if memory.mass.size else 0.0
        self._kept = (made, m.weighings), memory.tangent, memory.mass
        for name, number in zip(_HABITS, memory.numbers, strict=True):
            setattr(m, name, number)

    @property
    def _whole(self) -> bool:
        """Whether matrices hang on more than the workspace: motions tried out, or loads; they are kept themselves."""
        m = self.march
        return bool(m.probes.groups > 0 or m.asking or m.fronts.beyond > 0)

    def _parts(self, mass: bool) -> list[np.ndarray]:
        """What is remembered of a matrix: where it was made, on which side of jumps, and itself where that is kept."""
        m = self.march
        f = m.mass if mass else m.tangent
        whole = [f.down, f.up, f.diagonal, f.made, f.bends] if self._whole else []
        return [f.place, f.angles, *([] if mass else [m.corners.made]), *whole]

    def _make(self, mass: bool) -> None:
        if self.march.asking:
            self._made((0.0, 0.0, 1.0) if mass else self._seeds, WEIGH if mass else REFACTOR)
        else:
            self._do(WEIGHED if mass else REMADE)
