"""Rigid against flexible: what leaving out all flexibility changes."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import asdict, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, overload

import numpy as np

from flexctrl.dynamics.run import Run, Status, Tolerance
from flexctrl.dynamics.simulate import simulate
from flexctrl.dynamics.steps import Integrator
from flexctrl.errors import StructureError, shortened
from flexctrl.frozen import frozen
from flexctrl.model.assemble import rigid
from flexctrl.model.equilibrium import Rest, equilibrium
from flexctrl.model.model import Model
from flexctrl.model.state import State
from flexctrl.structure.freedoms import check_seconds, written
from flexctrl.study.rounding import beyond, of_signal
from flexctrl.study.unstopped import unstopped

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Progress = Callable[[float], None]


@frozen
class Numbers:
    """One signal of a run in three numbers, SI units.

    Attributes
    ----------
    final : float
        Last value.
    max_abs : float
        Largest magnitude.
    rms : float
        √(1/T ∫ y² dt).
    """

    final: float
    max_abs: float
    rms: float


def numbers(t: np.ndarray, y: np.ndarray) -> Numbers:
    """Return the numbers of a curve.

    Parameters
    ----------
    t : numpy.ndarray, shape (m,)
        Time [s], ascending; need not be even.
    y : numpy.ndarray, shape (m,)

    Returns
    -------
    Numbers
    """
    span = float(t[-1] - t[0])
    square = float(np.trapezoid(y**2, t)) / span if span > 0 else float(y[-1] ** 2)
    return Numbers(float(y[-1]), float(np.abs(y).max()), float(np.sqrt(square)))


def dominant_frequency(t: np.ndarray, y: np.ndarray) -> float:
    """Return the frequency [Hz] that carries most of a curve's oscillation about its mean slope.

    The peak of a Hann-windowed spectrum, refined by a parabola; frequencies of less than a period and a half in
    the record are not told apart from drift.

    Parameters
    ----------
    t : numpy.ndarray, shape (m,)
        Time [s], ascending; need not be even.
    y : numpy.ndarray, shape (m,)

    Returns
    -------
    float
        0 if the curve does not oscillate.
    """
    span = float(t[-1] - t[0]) if len(t) > 3 else 0.0
    if span <= 0.0:
        return 0.0
    count = max(256, len(t))
    even = np.linspace(t[0], t[-1], count)
    curve = np.interp(even, t, y)
    curve = curve - np.polyval(np.polyfit(even - t[0], curve, 1), even - t[0])
    if np.abs(curve).max() <= 1e-9 * np.abs(y).max(initial=0.0):
        return 0.0
    power = np.log(np.abs(np.fft.rfft(curve * np.hanning(count), 8 * count)) ** 2 + 1e-300)
    first = int(np.ceil(1.5 * 8 * (count - 1) / count))
    k = first + int(np.argmax(power[first:-1]))
    if k == first and power[k - 1] > power[k]:
        return 0.0
    left, here, right = power[k - 1 : k + 2]
    bend = left - 2.0 * here + right
    shift = 0.5 * (left - right) / bend if bend else 0.0
    return float((k + shift) / (8 * count) * (count - 1) / span)


@frozen
class Difference:
    """One signal, flexible and rigid.

    Attributes
    ----------
    name : str
    flexible, rigid : Numbers
    max_difference, rms_difference : float
        Of flexible less rigid, over the time both ran.
    frequency_hz, rigid_frequency_hz : float
        Dominant frequencies; 0 for a curve that does not oscillate.
    """

    name: str
    flexible: Numbers
    rigid: Numbers
    max_difference: float
    rms_difference: float
    frequency_hz: float
    rigid_frequency_hz: float


@frozen(eq=False)
class Comparison:
    """Two runs side by side.

    Attributes
    ----------
    flexible, rigid : Run
    signals : tuple of Difference
        All outputs that both have, then the inputs.
    known : mapping of str to float
        To what the rms difference of each signal is known; empty if nothing tells, see `held_against`.
    """

    flexible: Run
    rigid: Run
    signals: tuple[Difference, ...]
    known: Mapping[str, float] = field(default_factory=dict)

    @classmethod
    def between(cls, flexible: Run, rigid: Run) -> Comparison:
        """Compare two runs signal by signal; at different instants by straight lines between them.

        Parameters
        ----------
        flexible, rigid : Run
            With the same signals; what only the flexible one has (the tension of a rope) is left out.

        Returns
        -------
        Comparison

        Raises
        ------
        StructureError
            If their signals differ, or there are none.
        """
        known = (*rigid.outputs, *rigid.inputs)
        if not known and not flexible.outputs:
            raise StructureError(
                "compare: the machine has no outputs and no inputs, and nothing to compare; give some, as "
                "outputs=[Position('tip_z', beam.end, 'z')]"
            )
        names = [name for name in (*flexible.outputs, *flexible.inputs) if name in known]
        seen = bool(rigid.outputs) or not flexible.outputs
        if flexible.inputs != rigid.inputs or set(names) != set(known) or not seen:
            raise StructureError("compare: the runs have different signals; give two runs of the same machine")
        return cls(flexible, rigid, tuple(_difference(flexible, rigid, name) for name in names))

    def held_against(self, finer: Comparison) -> Comparison:
        """Return this comparison, knowing how much of the differences the integrators made.

        Parameters
        ----------
        finer : Comparison
            Of the same machine, both runs integrated more finely.

        Returns
        -------
        Comparison
            Its ``known`` is the rms of what both comparisons' differences are apart by.
        """
        t, apart = self.flexible.t, {}
        for name in (s.name for s in self.signals):
            own = self.flexible[name] - np.interp(t, self.rigid.t, self.rigid[name])
            other = np.interp(t, finer.flexible.t, finer.flexible[name]) - np.interp(
                t, finer.rigid.t, finer.rigid[name]
            )
            apart[name] = numbers(t, other - own).rms
        return replace(self, known=apart)

    def __getitem__(self, signal: str) -> Difference:
        _ = self.flexible[signal]  # names the signals there are
        return next(s for s in self.signals if s.name == signal)

    @property
    def finished(self) -> bool:
        """Whether both runs went to their end."""
        return self.flexible.status is Status.FINISHED and self.rigid.status is Status.FINISHED

    def plot(self, signals: str | tuple[str, ...] | None = None) -> Figure:
        """Draw both runs over time: flexible as lines, rigid dashed.

        Parameters
        ----------
        signals : str or tuple of str, optional
            Default: all outputs.

        Returns
        -------
        matplotlib.figure.Figure
        """
        from flexctrl.plots.run import comparison_figure

        return comparison_figure(self, signals)

    def save_csv(self, path: str | Path) -> None:
        """Write time and every signal of both runs as columns ``signal`` and ``signal_rigid``.

        Parameters
        ----------
        path : str or Path

        Raises
        ------
        StructureError
            If ``path`` names no file, its folder is not there, or it cannot be written.
        """
        names = [s.name for s in self.signals]
        t, columns = self.flexible.t, [self.flexible[name] for name in names]
        columns += [np.interp(t, self.rigid.t, self.rigid[name]) for name in names]
        header = ",".join(["t", *names, *(f"{name}_rigid" for name in names)])
        with written(path, "comparison.save_csv"):
            np.savetxt(path, np.column_stack([t, *columns]), delimiter=",", header=header, comments="")

    def save_json(self, path: str | Path) -> None:
        """Write the numbers.

        Parameters
        ----------
        path : str or Path

        Raises
        ------
        StructureError
            As `save_csv` does.
        """
        with written(path, "comparison.save_json"):
            Path(path).write_text(json.dumps([asdict(s) for s in self.signals], indent=1), encoding="utf-8")

    def __str__(self) -> str:
        heads = ("final", "rigid", "largest", "rigid", "rms diff", *(["known to"] if self.known else []), "Hz")
        wide = max(len(s.name) for s in self.signals)
        lines = [" " * wide + "".join(f"{head:>12}" for head in heads)]
        for s in self.signals:
            values = (s.flexible.final, s.rigid.final, s.flexible.max_abs, s.rigid.max_abs, s.rms_difference)
            rounding = of_signal(s.name, [self.flexible, self.rigid])
            swings = s.frequency_hz and s.flexible.max_abs >= rounding
            cells = [f"{beyond(rounding, value):12.5g}" for value in values]
            cells += [f"{beyond(rounding, self.known[s.name]):12.2g}"] if self.known else []
            cells.append(f"{s.frequency_hz:12.4g}" if swings else f"{'–':>12}")
            lines.append(f"{s.name:<{wide}}" + "".join(cells))
        return "\n".join(lines)


def _difference(flexible: Run, stiff: Run, name: str) -> Difference:
    end = min(flexible.t[-1], stiff.t[-1])
    t = flexible.t[flexible.t <= end * (1 + 1e-12)]
    y = flexible[name][: len(t)]
    gap = y - np.interp(t, stiff.t, stiff[name])
    apart = numbers(t, gap)
    return Difference(
        name=name,
        flexible=numbers(flexible.t, flexible[name]),
        rigid=numbers(stiff.t, stiff[name]),
        max_difference=apart.max_abs,
        rms_difference=apart.rms,
        frequency_hz=dominant_frequency(flexible.t, flexible[name]),
        rigid_frequency_hz=dominant_frequency(stiff.t, stiff[name]),
    )


class Case(Protocol):
    """Something that can be run flexible and rigid: a `Scene`."""

    @property
    def model(self) -> Model: ...

    @property
    def twin(self) -> Model: ...

    def run(self, model: Model | None = None, progress: Progress | None = None) -> Run:
        """Simulate one of the two."""


@overload
def compare(subject: Case, *, progress: Progress | None = ...) -> Comparison: ...
@overload
def compare(
    subject: Model,
    controller: Any = ...,
    *,
    until: float,
    start: State | Rest | None = ...,
    method: Integrator | None = ...,
    tolerance: Tolerance | None = ...,
    every: float | None = ...,
    progress: Progress | None = ...,
) -> Comparison: ...
def compare(
    subject: Case | Model,
    controller: Any = None,
    *,
    until: float = 0.0,
    start: State | Rest | None = None,
    method: Integrator | None = None,
    tolerance: Tolerance | None = None,
    every: float | None = None,
    progress: Progress | None = None,
) -> Comparison:
    """Run a scene, or a model and its rigid twin, and compare them.

    Parameters
    ----------
    subject : Scene or Model
        A scene says everything else itself.
    controller : Controller or python-control system, optional
        For both.
    until : float
        End [s].
    start : State or Rest, optional
        Of the flexible model; default: the shape as drawn. The twin starts at its own equilibrium under
        the same inputs if a `Rest` is given, as drawn otherwise.
    method : Integrator, optional
    tolerance : Tolerance, optional
    every : float, optional
        Spacing of the results [s]; default: a thousandth of ``until``.
    progress : callable, optional
        Called with the fraction done.

    Returns
    -------
    Comparison
    """
    first, second = _halves(progress)
    if not isinstance(subject, Model):
        if isinstance(subject, type) or not hasattr(subject, "twin"):
            raise StructureError(f"compare: {shortened(subject)} is neither a Scene nor a Model (from assemble)")
        flexible = unstopped(subject.run(subject.model, first))
        return Comparison.between(flexible, subject.run(subject.twin, second))
    check_seconds(until, "until", "compare")
    twin = rigid(subject)
    assert isinstance(twin, Model)

    def run(model: Model, begin: State | Rest | None, tell: Progress | None) -> Run:
        return simulate(
            model,
            controller,
            until=until,
            start=begin,
            method=method,
            tolerance=tolerance,
            every=every or until / 1000,
            progress=tell,
        )

    flexible = unstopped(run(subject, start, first))
    return Comparison.between(flexible, run(twin, _twin_start(twin, start), second))


def _twin_start(twin: Model, start: State | Rest | None) -> Rest | None:
    if not isinstance(start, Rest):
        return None
    return equilibrium(twin, inputs=dict(zip(twin.inputs, start.inputs.tolist(), strict=True)))


def _halves(progress: Progress | None) -> tuple[Progress | None, Progress | None]:
    if progress is None:
        return None, None
    tell = progress
    return (lambda done: tell(0.5 * done)), (lambda done: tell(0.5 + 0.5 * done))


__all__ = ["Case", "Comparison", "Difference", "Numbers", "compare", "dominant_frequency", "numbers"]
