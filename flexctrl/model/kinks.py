"""Where laws of force have a corner: a rope goes slack or taut, a gap closes or opens.

Steps end there, or the corner would cost accuracy however small the step: the values' signs tell the sides.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from flexctrl.effects.backlash import gaps_of
from flexctrl.model.loose_kinds import loose_names
from flexctrl.model.motion import State
from flexctrl.structure.elements import Rope, Spring

if TYPE_CHECKING:
    from flexctrl.model.model import Model

__all__ = ["Kinks"]

_ROUND_OFF = 1e-12


@dataclass(frozen=True, eq=False)
class Kinks:
    """The corners of a model's laws of force: lengths of lines, then twists of shafts.

    Attributes
    ----------
    model : Model
    """

    model: Model

    @cached_property
    def _lines(self) -> tuple[tuple[Rope | Spring, float], ...]:
        """Ropes and springs with play, and the lengths at which they have corners."""
        parts, gaps = self.model.structure.elements, gaps_of(self.model.effects)
        ropes = [(p, p.length) for p in parts if isinstance(p, Rope) and self.model.bends(p)]
        loose = [p for p in parts if isinstance(p, Spring) and p.name in self._loose]
        return (*ropes, *((p, p.length + side * gaps[p.name]) for p in loose for side in (0.5, -0.5)))

    @cached_property
    def _twists(self) -> tuple[tuple[int, float], ...]:
        """Drives with play, and the twists at which they have corners."""
        drives, gaps = self.model.structure.drives, gaps_of(self.model.effects)
        loose = [(i, gaps[d.name]) for i, d in enumerate(drives) if d.name in self._loose]
        return tuple((i, side * gap) for i, gap in loose for side in (0.5, -0.5))

    @cached_property
    def _loose(self) -> frozenset[str]:
        return loose_names(self.model.structure, self.model.effects)

    @cached_property
    def names(self) -> tuple[str, ...]:
        """The parts, in the order of `values`; one with play has two flanks."""
        drives = self.model.structure.drives
        return (*(p.name for p, _ in self._lines), *(drives[i].name for i, _ in self._twists))

    @cached_property
    def lines(self) -> tuple[np.ndarray, np.ndarray]:
        """Nodes at the ends of the lines, shape (lines, 2); the lengths at which they have corners [m]."""
        number = self.model.structure.number
        ends = [(number(line.start), number(line.end)) for line, _ in self._lines]
        return np.array(ends, dtype=int).reshape(-1, 2), np.array([length for _, length in self._lines])

    @cached_property
    def shafts(self) -> tuple[np.ndarray, np.ndarray]:
        """Numbers of the drives; the twists at which they have corners [rad of the motor]."""
        return np.array([i for i, _ in self._twists], dtype=int), np.array([twist for _, twist in self._twists])

    @cached_property
    def dust(self) -> np.ndarray:
        """Values below these are zero but for round-off."""
        return _ROUND_OFF * np.append(self.lines[1], np.ones(len(self._twists)))

    def values(self, state: State) -> np.ndarray:
        """Return what changes its sign at the corners: stretch of ropes, strains from the flanks of gaps.

        Parameters
        ----------
        state : State

        Returns
        -------
        numpy.ndarray, shape (corners,)
            [m], or [rad] of a motor.
        """
        motion, (ends, lengths), (drives, twists) = self.model.motion, self.lines, self.shafts
        arms = state.x[ends[:, 1]] - state.x[ends[:, 0]]
        strains = np.sqrt(np.einsum("ij,ij->i", arms, arms)) - lengths
        turned = motion.ratios[drives] * state.driven[drives] - state.q[motion.sources[drives]]
        return np.append(strains, turned - twists)
