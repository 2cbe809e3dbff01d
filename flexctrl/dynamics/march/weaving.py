"""Rows between the steps of a march: from what it has kept to rows and states for drawing."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial

import numpy as np

from flexctrl.dynamics.march.shelf import row_of, states_of, width_of
from flexctrl.dynamics.march.weave import Weave, weave
from flexctrl.dynamics.records.frames import Later
from flexctrl.kernels.native import Packed
from flexctrl.model.flat.flattened import Flattened
from flexctrl.model.flat.widened import widened
from flexctrl.model.linkages.chart import Chart, Follower
from flexctrl.model.linkages.charting import chart_of
from flexctrl.model.model import Model
from flexctrl.model.state import State

__all__ = ["Weaver"]

_ROOM, _FRAMES = 512, 130
_PAIR = 24


class Weaver:
    """Finds rows between steps, as `flexctrl.dynamics.records.dense.Hermite` does, many at once.

    Parameters
    ----------
    model : Model
    kept : numpy.ndarray
        Where a march writes down the states after its steps.
    """

    def __init__(self, model: Model, kept: np.ndarray) -> None:
        chart = chart_of(model, model.rest) if model.large else None
        self.flattened, spare, places = widened(model, chart)
        self.flattened.enter(model.rest)
        self.dry = model.rest.dry
        self.width = width_of(self.flattened)
        self.columns = 1 + len(model.outputs)
        self.weave = Packed(_woven(self.flattened, chart, spare, places, kept, self.width))
        self._run = self.weave.bound(weave)
        self._wanted = self.weave.cell("wanted")

    def set_out(self, state: State) -> None:
        """Take up the state that the next steps start from."""
        self.weave.first[:], self.dry = row_of(self.flattened, state), state.dry

    @property
    def t(self) -> float:
        """When the next steps start."""
        return float(self.weave.first[-1])

    @property
    def last(self) -> Later:
        """The state that the next steps start from, to be made when it is looked at."""
        return Later(self.weave.first.copy()[None], partial(states_of, self.flattened, dry=self.dry))

    def rows(
        self, steps: np.ndarray, times: np.ndarray, ends: np.ndarray, due: float, spacing: float
    ) -> tuple[np.ndarray, Sequence[Sequence[State]]]:
        """Find rows within steps, and the states among them that are due for drawing.

        Parameters
        ----------
        steps : numpy.ndarray of int, shape (rows,)
            In which step each is.
        times : numpy.ndarray, shape (rows,)
        ends : numpy.ndarray of bool, shape (rows,)
            Which are states after a step; their outputs are left out.
        due, spacing : float
            When the next state for drawing is due, and their spacing.

        Returns
        -------
        rows : numpy.ndarray, shape (rows, 1 + outputs)
        states : list of sequences of State
        """
        w, found, drawn = self.weave, np.zeros((len(times), self.columns)), []
        w.due, w.spacing = due, spacing
        few = len(times) > 0 and times[-1] - times[0] < (_FRAMES - 2) * spacing
        room = _ROOM if few else _FRAMES  # in a step far beyond the end of a run, each row may be due for drawing
        for start in range(0, len(times), room):
            part = slice(start, start + room)
            count = w.wanted = len(times[part])
            w.steps[:count], w.times[:count], w.ends[:count] = steps[part], times[part], ends[part]
            self._run()
            found[part] = w.rows[: count * self.columns].reshape(count, -1)
            if w.kept:
                table = w.drawn[: w.kept * self.width].reshape(w.kept, -1).copy()
                drawn.append(Later(table, partial(states_of, self.flattened, dry=self.dry)))
        return found, drawn

    def reading(self, step: int, t: float) -> list[float]:
        """Return the outputs at an instant within a step; no state is due for drawing."""
        w = self.weave
        w.steps[0], w.times[0], w.ends[0], self._wanted[0] = step, t, 0, 1
        w.due = math.inf
        self._run()
        return w.rows[1 : self.columns].tolist()

    def rates(self, count: int) -> np.ndarray:
        """Return the rates of the degrees of freedom after so many steps, in the order of elimination."""
        f, states = self.flattened.flat, self.weave.states[: self.width * count].reshape(count, self.width)
        first = 12 * f.nodes + f.padded
        return states[:, first : first + f.padded]

    def times(self, times: np.ndarray) -> None:
        """Put right when the steps of the last call end, where a clock has been set."""
        self.weave.states[: self.width * len(times)].reshape(-1, self.width)[:, -1] = times

    def go_on(self, count: int) -> None:
        """Take the state after so many steps as the one that the next ones start from."""
        self.weave.first[:] = self.weave.states[self.width * (count - 1) : self.width * count]

    def at(self, t: float) -> None:
        """Set the clock of that state."""
        self.weave.first[-1] = t


def _woven(
    F: Flattened, chart: Chart | None, spare: np.ndarray, places: np.ndarray, kept: np.ndarray, width: int
) -> Weave:
    wide = F.flat.padded + spare.size
    turns = [(r.node, *(-1 if c < 0 else places[c] for c in r.coordinates)) for r in chart.rotations] if chart else []
    lines = chart.lines if chart else ()
    coordinates, onward, arriving = np.zeros((3, wide))
    place0, turning = np.zeros((2, F.flat.padded))
    hinges, slides = (_followed(f, places) for f in ((chart.hinges, chart.slides) if chart else ((), ())))
    return Weave(
        flat=F.flat,
        gauges=F.gauges,
        wide=wide,
        spare=spare,
        turned=len(turns),
        turns=np.array(turns, dtype=int).ravel(),
        leaning=len(lines),
        leans=np.array([(k.node, *places[list(k.freedoms)]) for k in lines], dtype=int).ravel(),
        lean_axes=np.array([k.axes[:, [k.main, *_others(k.main)]].T for k in lines], dtype=float).ravel(),
        hinged=len(hinges[0]) // 2,
        hinges=hinges[0],
        hinge_axes=hinges[1],
        slid=len(slides[0]) // 2,
        slides=slides[0],
        slide_axes=slides[1],
        first=np.zeros(width),
        states=kept,
        steps=np.zeros(_ROOM, dtype=int),
        times=np.zeros(_ROOM),
        ends=np.zeros(_ROOM, dtype=int),
        rows=np.zeros(_ROOM * (1 + F.gauges.outputs)),
        drawn=np.zeros(_FRAMES * width),
        place0=place0,
        coordinates=coordinates,
        onward=onward,
        arriving=arriving,
        turning=turning,
        pair=np.zeros(_PAIR),
        width=width,
        nodes=F.flat.nodes,
    )


def _others(main: int) -> list[int]:
    return [k for k in range(3) if k != main]


def _followed(follows: Sequence[Follower], places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Masters and coordinates; axes."""
    numbers = np.array([(f.master, places[f.freedom]) for f in follows], dtype=int).ravel()
    return numbers, np.array([f.axis for f in follows], dtype=float).ravel()
