"""A model on flat vectors, and how states come there and back."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from flexctrl.frozen import frozen
from flexctrl.model.flat.axes import Axes
from flexctrl.model.flat.entire import Entire
from flexctrl.model.flat.fronts import Plan
from flexctrl.model.flat.workspace import Flat
from flexctrl.model.gauges import Gauges
from flexctrl.model.model import Model
from flexctrl.model.state import Dry, State

__all__ = ["Flattened"]

_ROUND_OFF = 1e-12


@frozen(eq=False)
class Flattened:
    """A model on flat vectors, and how to bring states there and back.

    Attributes
    ----------
    model : Model
    flat : Flat
    gauges : Gauges
        Its outputs.
    axes : Axes
        Of its tangents.
    plan : Plan
        How its tangents are eliminated; degrees of freedom stand in that order.
    pattern : tuple of numpy.ndarray
        Rows and columns of their entries (with repeats).
    constants : tuple of int and numpy.ndarray
        What the workspace holds from some place on that never changes.
    entire : Entire
        Kernels of the whole machine, where it has few freedoms.
    """

    model: Model
    flat: Flat
    gauges: Gauges
    axes: Axes
    plan: Plan
    pattern: tuple[np.ndarray, np.ndarray]
    constants: tuple[int, np.ndarray]
    entire: Entire

    def ordered(self, x: np.ndarray) -> np.ndarray:
        """Return values of the degrees of freedom in the order of elimination, padded with zeros."""
        out = np.zeros(self.flat.padded)
        out[: self.flat.n] = x[self.plan.order]
        return out

    def own(self, x: np.ndarray) -> np.ndarray:
        """Return values of the degrees of freedom in the model's order."""
        out = np.empty(self.flat.n)
        out[self.plan.order] = x[: self.flat.n]
        return out

    def enter(self, state: State) -> None:
        """Put a state at the start of a step."""
        f, forces, (first, values) = self.flat, self.model.forces, self.constants
        still = np.zeros(f.n)
        f.z[first : first + values.size] = values
        f.z[: forces.slot_count] = forces.slots(state, state.v, still)
        f.pose.reshape(-1, 12)[:] = np.hstack([state.x, state.R.reshape(-1, 9)])
        f.q[:], f.driven[:] = self.ordered(state.q), state.driven
        if self.gauges.turning:
            self.gauges.shown[:], self.gauges.summed[:] = state.shown, self.model.motion.winding @ state.q
            self.gauges.faced[:] = np.ravel(self.model.motion.twists.quaternions(state.R))
        f.step[:], f.v[:], f.rate[:] = 0.0, self.ordered(state.v), 0.0

    @property
    def keeps_shape(self) -> bool:
        """Whether what never changes in poses is as the kernels of the whole machine take it to be."""
        return bool((abs(self.flat.z[self.entire.cells] - self.entire.values) <= _ROUND_OFF).all())

    def state(self, v: np.ndarray, t: float, dry: Dry) -> State:
        """Return the state at the start of the step, with rates ``v`` in the order of elimination.

        Its outputs have been read.
        """
        found = self.pose_state(self.flat.pose, self.flat.q, v, self.flat.driven, t, dry)
        return replace(found, shown=self.gauges.shown.copy())

    def pose_state(
        self, pose: np.ndarray, q: np.ndarray, v: np.ndarray, driven: np.ndarray, t: float, dry: Dry
    ) -> State:
        """Return the state of a pose (12 a node) and values in the order of elimination."""
        rows = pose.reshape(-1, 12)
        x, R = rows[:, :3].copy(), rows[:, 3:].reshape(-1, 3, 3).copy()
        return State(x, R, self.own(q), self.own(v), driven.copy(), t, dry)
