"""The effect ledger: what leaving out each effect changes, what it saves, and the smallest set that will do."""

from __future__ import annotations

from dataclasses import field
from typing import TYPE_CHECKING

import numpy as np

from flexctrl.dynamics.linear_motion.exact import Exact
from flexctrl.effects.automatic import Within
from flexctrl.errors import StructureError, did_you_mean
from flexctrl.frozen import frozen
from flexctrl.study.accuracy import SHARE, Accuracy
from flexctrl.study.answers import Answer, Change
from flexctrl.study.subject import Subject

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["Entry", "Ledger", "Size"]

_SAME = "≈ 1"


@frozen
class Size:
    """What a model is made of and what running it took.

    Attributes
    ----------
    states : int
        Of plant and controller.
    nonzeros : int
        Of the assembled tangent.
    instructions : int
        Of all force kernels, once over the machine.
    steps, newton_iterations : int
    work : float
        Newton iterations (steps, of a method without them) × (instructions + nonzeros): a cost that does not depend
        on the clock.
    """

    states: int
    nonzeros: int
    instructions: int
    steps: int
    newton_iterations: int

    @property
    def work(self) -> float:
        return float(self.newton_iterations or self.steps) * (self.instructions + self.nonzeros)


@frozen
class Entry:
    """One effect.

    Attributes
    ----------
    name : str
    change : Change or None
        What the answer loses without it; None if the scene cannot be run without it.
    cost_ratio : float
        Processor time of the full scene over that without the effect, in the same process; NaN if it cannot be run.
    size : Size or None
        Of the scene without it.
    keep : bool
        Whether the minimal scene has it.
    failure : str
        Why the scene cannot do without it; empty if it can.
    first : tuple of str
        What cannot be without it (friction in a linear machine): left out before, and what the change is against.
    stays : str
        Why the minimal scene has it though the answer could do without; empty if it could not.
    """

    name: str
    change: Change | None
    cost_ratio: float
    size: Size | None
    keep: bool
    failure: str = ""
    first: tuple[str, ...] = ()
    stays: str = ""


@frozen(eq=False)
class Ledger:
    """Every effect of a scene, and the smallest set that keeps the answer.

    Attributes
    ----------
    name : str
        The scene's.
    within : Within
        Largest changes that are borne.
    entries : tuple of Entry
        In the scene's order.
    full : Answer
        From a run that is finer than the scene's own where that is not accurate enough to judge changes by.
    size : Size
        Of the full scene.
    minimal : Answer
        From the scene with the minimal set alone.
    minimal_change : Change
        Of the minimal set against the full one: interactions included.
    speedup : float
        Processor time of the full scene over that of the minimal set.
    minimal_size : Size
    noise : float
        How much longer than the shortest time of the full scene, run in several rounds, the longest is, over the
        shortest: smaller differences of times say nothing.
    accuracy : Accuracy
        How well the outputs of the full run are known.
    scene : Scene
        The scene with the minimal set.
    untried : tuple of str
        Effects that had not been left out when it was stopped; they are kept.
    complete : bool
        False if it was stopped: nothing is left out then.
    """

    name: str
    within: Within
    entries: tuple[Entry, ...]
    full: Answer
    size: Size
    minimal: Answer
    minimal_change: Change
    speedup: float
    minimal_size: Size
    noise: float
    accuracy: Accuracy
    scene: Subject = field(repr=False)
    untried: tuple[str, ...] = ()
    complete: bool = True

    @property
    def pace(self) -> str:
        """How fast the minimal set is, in words: faster or slower where that was measured beyond the noise."""
        factor = max(self.speedup, 1.0 / self.speedup)
        if factor <= 1.0 + self.noise:
            return "as fast"
        return f"{factor:.1f} × {'faster' if self.speedup > 1.0 else 'slower'}"

    def told_apart(self, entry: Entry) -> bool:
        """Tell whether leaving an effect out takes another time, beyond what the clock is known to.

        Parameters
        ----------
        entry : Entry

        Returns
        -------
        bool
        """
        return abs(np.log(entry.cost_ratio)) > np.log1p(self.noise)

    @property
    def modes(self) -> int | None:
        """How many vibrations the minimal set is run with; None if that is all there are."""
        method = self.scene.simulation.method
        return method.modes if isinstance(method, Exact) else None

    @property
    def _way(self) -> str:
        """How the minimal set is run, if that is not how the scene is."""
        if not isinstance(self.scene.simulation.method, Exact):
            return ""
        if self.modes is None:
            return "; linear: integrated exactly"
        return f"; linear: integrated exactly, free motion and {self.modes} vibration{'s' * (self.modes != 1)}"

    @property
    def notes(self) -> tuple[str, ...]:
        """What stands against the numbers."""
        return tuple(note for note in (self.accuracy.note or self._doubt, self._instability, self.stopped) if note)

    @property
    def stopped(self) -> str:
        """What is not known if it was stopped; empty if it was not."""
        if self.complete:
            return ""
        untried = f"{', '.join(self.untried)} not tried, and " if self.untried else ""
        return f"stopped: {untried}what may be left out together is not known, so all is kept"

    @property
    def _doubt(self) -> str:
        """What is known worse than it should be, if the full run is not."""
        told = {f"without {e.name}": e.change for e in self.entries if e.change is not None}
        told["of the minimal set"] = self.minimal_change
        unsure = [name for name, change in told.items() if not self._sure(change)]
        if not unsure:
            return ""
        return (
            f"changes of outputs {', '.join(unsure)} are not known to a third of them, or of what is asked; give a "
            "tighter tolerance or shorter steps"
        )

    def _sure(self, change: Change) -> bool:
        return change.outputs_known <= SHARE * max(change.outputs_worst, self.within.outputs)

    @property
    def _instability(self) -> str:
        pole = self.full.growing
        if not pole:
            return ""
        what, then = ("closed loop", ", so margins say nothing of it") if self.full.margins else ("machine", "")
        return f"the {what} of the full scene is unstable: its pole at {pole:.3g} 1/s grows{then}"

    @property
    def minimal_set(self) -> tuple[str, ...]:
        """Names of the effects that the minimal scene has."""
        return (*(e.name for e in self.entries if e.keep), *self.untried)

    def __getitem__(self, name: str) -> Entry:
        for entry in self.entries:
            if entry.name == name:
                return entry
        raise StructureError(f"the ledger has no effect {name!r}{did_you_mean(name, [e.name for e in self.entries])}")

    def plot(self) -> Figure:
        """Draw what each effect changes against what it costs.

        Returns
        -------
        matplotlib.figure.Figure
        """
        from flexctrl.plots.ledger import ledger_figure

        return ledger_figure(self)

    def __str__(self) -> str:
        wide = max([len(e.name) for e in self.entries], default=6)
        heads = ("outputs", "known to", "poles", "of pole", "margins", "time", "states", "nonzeros")
        lines = [f"{'without':<{wide}}" + "".join(f"  {head:>{_width(head)}}" for head in heads)]
        lines += [self._line(e, wide) for e in self.entries]
        lines.append(
            f"time: of a run without it over that of the full scene; {_SAME}: no difference that can be measured, to "
            f"within {_percent(self.noise)}"
        )
        lines.append(str(self.accuracy))
        kept = ", ".join(self.minimal_set) or "nothing"
        size = f"{self.minimal_size.states} of {self.size.states} states"
        lines += [
            f"kept: {kept}",
            f"left out: {self._left_out}",
            f"{self.changes} (asked: {self.within}), {self.pace}, {size}{self._way}",
        ]
        if self.complete and all(e.keep for e in self.entries):
            lines.append("the full set: no smaller one keeps the answer and is as fast")
        return "\n".join([*lines, *(f"note: {note}" for note in self.notes)])

    @property
    def _left_out(self) -> str:
        return ", ".join(e.name for e in self.entries if not e.keep) or "nothing"

    @property
    def summary(self) -> str:
        """What the minimal set leaves out of the full one, and what that changes, in a line."""
        return f"left out: {self._left_out}; {self.changes} (asked: {self.within}){self._way}"

    @property
    def changes(self) -> str:
        """How far the minimal set's answer is from the full one's, in words."""
        change = self.minimal_change
        found = {"outputs": change.outputs_worst, "poles": change.poles, "margins": change.margins}
        known = {"outputs": f" (known to {_known(change)})" if change.outputs_known else ""}
        told = [f"{name} {_percent(c)}{known.get(name, '')}" for name, c in found.items() if np.isfinite(c)]
        return f"within: {', '.join(told)}"

    def _line(self, e: Entry, wide: int) -> str:
        if e.change is None or e.size is None:
            return f"{e.name:<{wide}}  {'kept' if e.keep else 'gone with others'}: {e.failure}"
        outputs, poles, margins = (_percent(c) for c in (e.change.outputs_worst, e.change.poles, e.change.margins))
        known = _known(e.change)
        pole = f"{e.change.pole:.2g}" if e.change.poles > 0.0 else "–"
        time = f"{1.0 / e.cost_ratio:.2f}" if self.told_apart(e) else _SAME
        cells = [f"{c:>10}" for c in (margins, time, e.size.states, e.size.nonzeros)]
        places = [f"{outputs:>10}", f"{known:>10}", f"{poles:>10}", f"{pole:>{_width('of pole')}}"]
        line = "  ".join([f"{e.name:<{wide}}", *places, *cells])
        before = f"  (both without {', '.join(e.first)})" if e.first else ""
        keep = f"  keep{f' ({e.stays})' if e.stays else ''}" if e.keep else ""
        return line + keep + before


def _percent(value: float) -> str:
    return "–" if not np.isfinite(value) else f"{100.0 * value:.3g} %"  # at most 10 characters, of 1.23e-05 %


def _known(change: Change) -> str:
    return _percent(change.outputs_known) if np.isfinite(change.outputs_known) else "unknown"


def _width(head: str) -> int:
    return 17 if head == "of pole" else 10
