"""Dry contacts beside what rings: what sticks is held, and what slides to and fro rubs."""

from __future__ import annotations

from collections.abc import Iterable
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import null_space

from flexctrl.frozen import frozen
from flexctrl.model.laws.friction_kinds import STUCK
from flexctrl.model.state import State

if TYPE_CHECKING:
    from flexctrl.model.model import Model

__all__ = ["Contacts"]

_KINETIC = 3
"""Column of the parameters of a dry contact."""


@frozen(eq=False)
class Contacts:
    """The dry contacts of a model in a state.

    Attributes
    ----------
    model : Model
    state : State
    slips : numpy.ndarray, shape (contacts,)
        How fast each slips, beside what rings [m/s or rad/s].
    """

    model: Model
    state: State
    slips: np.ndarray

    @classmethod
    def of(cls, model: Model, state: State, later: Iterable[State]) -> Contacts:
        """Return those that slip as fast as they do in the middle of some later states."""
        speeds = [np.abs(model.switches.slips.speeds(s)) for s in (state, *later)] if model.switches.names else []
        return cls(model, state, np.median(speeds, axis=0) if speeds else np.zeros(0))

    @cached_property
    def loose(self) -> State:
        """The state with nothing that sticks."""
        return self.model.switches.unheld(self.state) if self.slips.size else self.state

    def accelerations(self, u: np.ndarray) -> np.ndarray:
        """Return those of all that has mass under inputs, shape (n,)."""
        return self.model.switches.accelerations(self.state, u)

    def still(self, motion: np.ndarray) -> np.ndarray:
        """Return what is left of a motion of the degrees of freedom when what sticks does not move."""
        return self.model.switches.still(self.state, motion) if self.slips.size else motion

    def free(self, among: np.ndarray) -> np.ndarray:
        """Return motions of some degrees of freedom (n,) by which nothing slips that sticks, (count, motions)."""
        held = self._rows[self._stuck][:, among]
        return null_space(held) if len(held) else np.eye(int(np.count_nonzero(among)))

    def rubbed(self, rates: np.ndarray) -> float:
        """Return what a vibration of given rates loses where it slides to and fro, (2/π) F_k |W q̇| each [W]."""
        speeds = np.abs(self._rows @ rates)
        both_ways = ~self._stuck & (speeds > self.slips)
        kinetic = [f.parameters[:, _KINETIC] for f in self.model.switches.slips.families]
        return float(2.0 / np.pi * (np.concatenate([np.zeros(0), *kinetic]) * speeds)[both_ways].sum())

    @cached_property
    def _rows(self) -> np.ndarray:
        return self.model.switches.slips.rows(self.state) if self.slips.size else np.zeros((0, self.model.n))

    @cached_property
    def _stuck(self) -> np.ndarray:
        return self.model.switches.phases(self.state) == STUCK
