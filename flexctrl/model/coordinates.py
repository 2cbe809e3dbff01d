"""Which degrees of freedom a machine has, and where they stand in raw vectors.

A raw vector holds six entries a node (displacement and spin in space axes), the last node being the ground, then the
drives' source angles. Inner freedoms of effects (a bristle, a motor's torque) come after them all.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import field
from functools import cached_property

import numpy as np

from flexctrl.effects.effect import Inner
from flexctrl.frozen import ByFields, frozen
from flexctrl.kernels.kernel import Backend
from flexctrl.model.linkages.levers import Levers
from flexctrl.model.linkages.linkage import Linkage
from flexctrl.model.linkages.twists import Twists
from flexctrl.model.state import State
from flexctrl.structure.drives import Drive, RotaryDrive
from flexctrl.structure.relations import Track

__all__ = ["Coordinates"]


@frozen
class Coordinates(ByFields):
    """The degrees of freedom of a machine, and what of it each of them moves.

    Attributes
    ----------
    names : tuple of str
        Names of the degrees of freedom: of the nodes, drives' source angles, inner ones.
    place : numpy.ndarray, shape (nodes + 1, 6)
        Number of each cell's degree of freedom; ``n`` stands for none (held, or computed by a follower).
    sources : numpy.ndarray, shape (drives,)
        Number of each source angle's degree of freedom; ``n`` behind a rigid shaft.
    drives : tuple of Drive
    backend : Backend
        How rotations are turned.
    linkage : Linkage
        The nodes that follow, lead or are driven.
    nodes : numpy.ndarray of int
        Their numbers.
    linked : numpy.ndarray of int
        Degrees of freedom of the linkage.
    rest : State
    notes : tuple of str
        How loops of rigid parts are closed.
    inner : numpy.ndarray of int
        Number of each inner freedom's degree of freedom; ``n`` for those that have only a phase.
    effects : tuple of Inner
        What the inner freedoms are.
    spare : tuple of str
        What the linkage only watches, in words.
    twists : Twists
        The angles that outputs show.
    """

    names: tuple[str, ...]
    place: np.ndarray
    sources: np.ndarray
    drives: tuple[Drive, ...]
    backend: Backend
    linkage: Linkage
    nodes: np.ndarray
    linked: np.ndarray
    rest: State
    notes: tuple[str, ...]
    twists: Twists
    inner: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=int))
    effects: tuple[Inner, ...] = ()
    spare: tuple[str, ...] = ()

    @property
    def n(self) -> int:
        """Number of degrees of freedom."""
        return len(self.names)

    @property
    def source_base(self) -> int:
        """Place of the first source angle in a raw vector, after the nodes."""
        return self.place.size

    @property
    def inner_base(self) -> int:
        """Place of the first inner freedom in a raw vector, after the source angles."""
        return self.place.size + self.sources.size

    @property
    def raw(self) -> int:
        """Length of a raw vector."""
        return self.inner_base + self.inner.size

    @property
    def scales(self) -> dict[str, float]:
        """What an error of 1 is in each inner degree of freedom."""
        return {i.name: i.scale for i in self.effects if i.name}

    @property
    def unjudged(self) -> dict[str, float]:
        """What one is in each inner degree of freedom in which no error is judged."""
        return {i.name: i.unit for i in self.effects if i.name and np.isinf(i.scale)}

    @cached_property
    def flows(self) -> np.ndarray:
        """Inner degrees of freedom of first order."""
        first = np.array([i.order == 1 for i in self.effects], dtype=bool)
        return self.inner[first & (self.inner < self.n)]

    @cached_property
    def settling(self) -> np.ndarray:
        """Those of them that settle by themselves, whatever moves."""
        return np.setdiff1d(self.flows, self.frozen)

    @property
    def frozen(self) -> tuple[int, ...]:
        """Inner degrees of freedom that stay as they are in equilibria and linear models."""
        return tuple(self.names.index(i.name) for i in self.effects if i.frozen)

    @cached_property
    def rigid(self) -> np.ndarray:
        """Which drives have a rigid shaft."""
        return self.sources >= self.n

    @cached_property
    def ratios(self) -> np.ndarray:
        """Motor angle per driven coordinate of each drive."""
        return np.array([d.effective_ratio for d in self.drives])

    @cached_property
    def rotary(self) -> np.ndarray:
        return np.array([isinstance(d, RotaryDrive) for d in self.drives], dtype=bool)

    @cached_property
    def plain(self) -> bool:
        """Whether every raw freedom is own, the same as another, or held."""
        return not self.linkage.follows and not self.linkage.lines and not self.rigid.any()

    @cached_property
    def cells(self) -> np.ndarray:
        """Number of each raw freedom's degree of freedom, ``n`` for none, shape (raw,)."""
        return np.concatenate([self.place.ravel(), self.sources, self.inner])

    @cached_property
    def owned(self) -> np.ndarray:
        """Number of the degree of freedom that each raw freedom is, whatever else moves; ``n`` for the others."""
        if self.plain:
            return self.cells
        found, linked = self.cells.copy(), np.append(self.linked, self.n)
        levers = self.linkage
        found[self.linked_cells] = linked[levers.owned] if isinstance(levers, Levers) else self.n
        return found

    @cached_property
    def said(self) -> np.ndarray:
        """Raw freedoms that the linkage works out; of a short one all that it has to do with."""
        levers = self.linkage
        if self.plain:
            return self.linked_cells[:0]
        return self.linked_cells[levers.said] if isinstance(levers, Levers) else self.linked_cells

    @cached_property
    def linked_cells(self) -> np.ndarray:
        """Raw places of the linkage: its nodes, then source angles behind rigid shafts."""
        cells = (6 * self.nodes[:, None] + np.arange(6)).ravel()
        return np.append(cells, self.source_base + np.flatnonzero(self.rigid))

    @cached_property
    def tracks(self) -> tuple[Track, ...]:
        """What travels along rails, in the numbers of the linkage's nodes."""
        return self.linkage.tracks

    @cached_property
    def gauges(self) -> np.ndarray:
        """Nodes that are nowhere in space: their x is how far something has travelled."""
        return self.nodes[[f.gauge for f in self.tracks]]

    def along_rails(self, step: np.ndarray) -> Iterator[np.ndarray]:
        """Yield a step as it is where nothing travels, else with all that travels brought to each element in turn."""
        own = self.place[self.gauges, 0]
        for k in range(max((len(f.places) - 1 for f in self.tracks), default=1)):
            moved = np.append(step, 0.0)
            for f, number in zip(self.tracks, own, strict=True):
                i = min(k, len(f.places) - 2)
                moved[number] = 0.5 * (f.places[i] + f.places[i + 1]) - f.start
            yield moved[:-1]
