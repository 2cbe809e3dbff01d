"""Inertia of motors that rigid shafts and ropes tie to the machine: what a step in momenta makes of it.

A drum on a rigid rope turns as its load moves along the rope. Its inertia may be a million times the load's, and the
direction of the rope turns within a step: taken in the middle of the step, a share of the drum's momentum, h² times
the square of how fast the rope turns, would push the load across the rope. So drums have momenta of their own,
J (θ₁ − θ₀)/h over a step from the angles at its ends, and what changes them pulls along the rope as it points where
two steps meet: the discrete Lagrangian of a drum is ½ J (θ₁ − θ₀)²/h (Marsden & West 2001). However large J is, it
pushes nothing across the rope.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from flexctrl.frozen import frozen
from flexctrl.mechanics.pieces import DRIVE_PARAMETERS
from flexctrl.mechanics.winch import WINCH_PARAMETERS
from flexctrl.model.forces import Forces
from flexctrl.model.laws.families import Family
from flexctrl.model.laws.kinds import kernels_of
from flexctrl.model.laws.part_kinds import LINEAR_DRIVE, ROTARY_DRIVE, WINCH
from flexctrl.model.model import Model
from flexctrl.model.plant import Plant
from flexctrl.model.state import State

__all__ = ["Motors"]

_INERTIA = {
    WINCH: WINCH_PARAMETERS.index("inertia"),
    **dict.fromkeys((ROTARY_DRIVE, LINEAR_DRIVE), DRIVE_PARAMETERS.index("inertia")),
}


@frozen
class Motors:
    """Motors behind rigid shafts and ropes, where these may turn.

    Attributes
    ----------
    model : Plant
    """

    model: Plant

    @cached_property
    def numbers(self) -> np.ndarray:
        """Numbers of the drives, shape (motors,)."""
        if not (isinstance(self.model, Model) and self.model.large):
            return np.zeros(0, dtype=int)
        heavy = np.array([d.inertia > 0.0 for d in self.model.structure.drives], dtype=bool)
        return np.flatnonzero(self.model.motion.rigid & heavy)

    @cached_property
    def inertias(self) -> np.ndarray:
        """Their inertias [kg m²]."""
        return np.array([self.model.structure.drives[i].inertia for i in self.numbers])

    @cached_property
    def others(self) -> Plant:
        """The model without the inertia of these motors."""
        model = self.model
        if not (self.numbers.size and isinstance(model, Model)):
            return model
        return _Unmoved(model.structure, model.effects, model.motion, model.backend, model.viscous, model.about)

    @cached_property
    def _turning(self) -> np.ndarray:
        """Their momenta per rate of what they drive."""
        drives = self.model.structure.drives
        return np.array([drives[i].inertia * drives[i].effective_ratio for i in self.numbers])

    def momenta(self, state: State) -> np.ndarray:
        """Return the momenta of the motors in a state [kg m²/s]."""
        return self.inertias * (self.levers(state) @ state.v) if self.numbers.size else np.zeros(0)

    def between(self, before: State, after: State, h: float) -> np.ndarray:
        """Return their momenta over a step of length h from one state to another."""
        return self._turning * (after.driven - before.driven)[self.numbers] / h

    def levers(self, state: State) -> sp.csr_matrix:
        """Return how far each degree of freedom turns them, shape (motors, n)."""
        assert isinstance(self.model, Model)
        motion = self.model.motion
        return sp.csr_matrix(motion.jacobian(state)[motion.source_base + self.numbers])

    def along(self, state: State, momenta: np.ndarray) -> np.ndarray:
        """Return the part of some momenta of the machine that such motors take, shape (n,)."""
        if not self.numbers.size:
            return np.zeros_like(momenta)
        turned = self.levers(state).toarray().T
        return turned @ np.linalg.lstsq(turned, momenta, rcond=None)[0]

    def slope(self, middle: State, h: float) -> sp.csr_matrix:
        """Return ∂(momenta over a step, as the machine feels them at its start)/∂step, shape (n, n)."""
        half = 0.5 * h * middle.v
        first, last = (self.levers(self.model.advance(middle, s * half, middle.v, middle.t)) for s in (-1.0, 1.0))
        return sp.csr_matrix(first.T @ sp.diags(self.inertias / h) @ last)


class _Unmoved(Model):
    """A model whose motors behind rigid shafts and ropes have no inertia, but what else comes of it: their damping."""

    @cached_property
    def forces(self) -> Forces:
        whole = super().forces
        drives = [f for f in whole.families if f.kernels.kind in _INERTIA]
        return replace(whole, families=whole.families + tuple(self._taken_off(f) for f in drives))

    def _taken_off(self, family: Family) -> Family:
        """Drives with nothing but the opposite of their inertia."""
        column = _INERTIA[family.kernels.kind]
        parameters = family.parameters.copy()
        parameters[:, column] *= np.where(self.motion.rigid[family.drives[:, 0]], -1.0, 0.0)
        return replace(family, kernels=kernels_of(family.kernels.kind, ()), parameters=parameters)
