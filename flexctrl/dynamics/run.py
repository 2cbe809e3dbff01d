"""What a simulation leaves behind: curves, final state, report."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field, replace
from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from flexctrl.errors import StructureError, did_you_mean, shortened
from flexctrl.frozen import frozen
from flexctrl.model.state import State
from flexctrl.structure.freedoms import check_finite, check_number, written

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from flexctrl.dynamics.checkpoint import Checkpoint
    from flexctrl.dynamics.events.event import Occurrence
    from flexctrl.dynamics.records.dense import Track

_SEEN = 1e-5
"""What is seen to move, however much steps may err by [rad, shares of the machine's size]."""


class Status(Enum):
    """How a run ended; ``STOPPED`` is by an event that ends it."""

    FINISHED = "finished"
    STOPPED = "stopped"
    FAILED = "failed"
    INTERRUPTED = "interrupted"


@frozen
class Tolerance:
    """Accuracy asked of an error-controlled run: of each of its steps.

    Their errors may all go one way and add up: a top that sways for 10 s in 1,200 steps under the default is 0.17 rad
    off. Each tenth of the tolerance leaves about a fifth of that; `Richardson` and `ExplicitRungeKutta` leave far less.
    The report's ``drift`` tells what they may have added up to.

    Parameters
    ----------
    relative : float
        Local error per step over the distance moved so far, that of the freedom that has moved most among those
        coupled to it; it counts as a radian or the size of the machine at most, or what spins or travels would
        excuse errors of all else.
    absolute : float
        Local error per step below which nothing is asked [rad, and m over the size of the machine; over one unit of
        length where nothing in it has any: a point that no drive moves].

    Raises
    ------
    StructureError
        For a negative ``relative`` or an ``absolute`` that is not positive.
    """

    relative: float = 1e-4
    absolute: float = 1e-7

    def __post_init__(self) -> None:
        check_number(self.relative, "relative", "Tolerance", least=0.0)
        check_number(self.absolute, "absolute", "Tolerance", above=0.0)

    def of(self, moved: np.ndarray) -> np.ndarray:
        """Return the errors allowed after a motion.

        Parameters
        ----------
        moved : numpy.ndarray, shape (n,)
            Largest distance of a freedom so far, for each freedom [rad, and m over the size of the machine].

        Returns
        -------
        numpy.ndarray, shape (n,)
        """
        return self.absolute + self.relative * moved

    @property
    def negligible(self) -> float:
        """The absolute tolerance, or what is seen to move even if steps may err by more [yardsticks]."""
        return min(self.absolute, _SEEN)


@frozen
class EnergyBalance:
    """Where the energy of a run went [J]: kinetic + stored = start + work − dissipated, but for the residual.

    Attributes
    ----------
    start : float
        Kinetic and stored at the start.
    work : float
        Done by the inputs.
    dissipated : float
    kinetic, stored : float
        At the end.
    """

    start: float
    work: float
    dissipated: float
    kinetic: float
    stored: float

    @property
    def gap(self) -> float:
        """What the integrator made (positive) or lost over the whole run [J]."""
        return self.kinetic + self.stored - self.start - self.work + self.dissipated


@frozen
class Report:
    """Numerical health of a run; ``print(run.report)`` shows it.

    Attributes
    ----------
    method : str
        The method of integration, with its parameters.
    order : int
        Of the method.
    damping : str
        What the method itself damps.
    steps, rejected_steps, newton_iterations, factorisations : int
    wall_s : float
        Time it took [s], without the runs laid beside it.
    dofs : int
    energy : EnergyBalance
    energy_residual : float
        Worst |energy − start − work in + dissipated| over the largest energy turned over: what the
        integrator lost or made. What may be booked as dissipated by rates that damping ends within steps, and never
        have been, is no part of it; a note tells of that.
    worst : str
        The degree of freedom that converged last.
    closure_error : float
        How far conditions that close rigid loops were violated [rad, or shares of what they span].
    drift : float
        What errors of steps may have added up to, over the largest motion (at most a radian or the machine's size); 0
        where `Exact` takes the steps, of which ``error`` alone tells what a law that it interpolates leaves.
    drifted : str
        The degree of freedom in which that is most.
    error : float
        By how much places and angles of the run are off, over the largest motion, growth of small differences
        included: by another run laid beside it (`Checked`), which sees what errors of steps add up to, so that it may
        be less than ``drift``; ``drift`` where there is none. Of a run that goes on from a part that was cut off: of
        what came after.
    output_errors : mapping of str to float
        By how much outputs may be off at an instant, each over the range of its own values (1: all of it): a
        deflection of millimetres beside a travel of metres. Forces and rates by other runs laid beside, by how they
        ring after loads that are put on at once, or by how large they get in a finer run (over their largest
        value), whichever tells more; where none of these is there, nothing is told of them. Of linear models all
        outputs are told of by a finer run under continuous laws that are not linear; empty for others. Places that
        move, and rates that are, no more than absolute tolerances are left out, and tensions that are no more than
        what the last digits of places make.
    command_errors : mapping of str to float
        The same of what a law that reads outputs commands, by other runs laid beside; empty where there are none. A
        command that jumps, as that of a relay, is off by all of the jump while it is late.
    message : str
        Why the run ended early; empty if it did not.
    notes : tuple of str
        Warnings: which numbers are off, by how much and what to do about it; what was held or released so that rigid
        loops close, what was changed in the start, and what the model leaves out.
    """

    method: str
    order: int
    damping: str
    steps: int
    rejected_steps: int
    newton_iterations: int
    factorisations: int
    wall_s: float
    dofs: int
    energy: EnergyBalance
    energy_residual: float
    worst: str
    closure_error: float
    drift: float
    drifted: str
    error: float
    output_errors: Mapping[str, float]
    message: str
    notes: tuple[str, ...]
    command_errors: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for errors in ("output_errors", "command_errors"):
            told = {name: float(off) for name, off in getattr(self, errors).items()}
            object.__setattr__(self, errors, told)

    def __str__(self) -> str:
        e = self.energy
        lines = [
            f"{self.method}, order {self.order}, {self.damping}",
            f"{self.steps} steps, {self.rejected_steps} rejected, {self.newton_iterations} Newton iterations, "
            f"{self.factorisations} factorisations, {self.dofs} degrees of freedom, {self.wall_s:.3g} s",
            f"energy [J]: start {e.start:.6g}, work {e.work:+.6g}, dissipated {-e.dissipated:+.6g}; at the end "
            f"{e.kinetic:.6g} kinetic, {e.stored:.6g} stored; gap {e.gap:.3g}; worst {self.energy_residual:.2g} of the "
            "turnover",
            f"converged last: {self.worst or 'none'}",
            *([f"loops of rigid parts closed to {self.closure_error:.2g}"] if self.closure_error else []),
            *([f"errors of steps add up to {self.drift:.2g} of the motion of {self.drifted}"] if self.drift else []),
            *([f"off by {self.error:.2g} of the motion, by another run"] if self.error != self.drift else []),
            *([worst_signal("outputs", self.output_errors)] if self.output_errors else []),
            *([worst_signal("commands", self.command_errors)] if self.command_errors else []),
            *([self.message] if self.message else []),
            *self.notes,
        ]
        return "\n".join(lines)


def worst_signal(kind: str, errors: Mapping[str, float]) -> str:
    """Return which signal is off by the largest share of what it goes through, in words.

    Parameters
    ----------
    kind : str
        What they are, in the plural.
    errors : mapping of str to float
        As a report has them; one at least.

    Returns
    -------
    str
    """
    name = max(errors, key=lambda signal: errors[signal])
    return f"of the {kind} {name} is off by the largest share of what it goes through, up to {errors[name]:.2g}"


@frozen
class Moment:
    """A run at one instant: ``moment["load_z"]`` gives a signal by name.

    Attributes
    ----------
    t : float
    state : State
    signals : mapping of str to float
        Outputs and inputs.
    """

    t: float
    state: State
    signals: Mapping[str, float]

    def __getitem__(self, signal: str) -> float:
        if signal not in self.signals:
            raise StructureError(f"the run has no signal {signal!r}{did_you_mean(signal, self.signals)}")
        return self.signals[signal]


@frozen
class Run:
    """Curves of a simulation; ``run["load_z"]`` gives a signal by name.

    Attributes
    ----------
    t : numpy.ndarray, shape (m,)
        Time [s].
    outputs, inputs : tuple of str
        Names of the plant's outputs and inputs.
    y : numpy.ndarray, shape (m, outputs)
    u : numpy.ndarray, shape (m, inputs)
        Inputs in force from each instant on.
    final : State
    frames : sequence of State
        Some states along the way, evenly spread, for drawing.
    status : Status
    report : Report
    name : str
    events : tuple of Occurrence
        What happened, in order: the events asked for, and switches of the machine's own laws of force.
    checkpoint : Checkpoint
        Where to go on from: the last instant at which nothing was yet cut to fit the end of the run.
    track : Track
        The steps, as far as they are kept; see `at`. They do not come along to another process: all else does.
    fault : BaseException or None
        What the controller, an event or ``progress`` raised, where it ended the run: ``raise run.fault`` shows it.
    """

    t: np.ndarray
    outputs: tuple[str, ...]
    inputs: tuple[str, ...]
    y: np.ndarray
    u: np.ndarray
    final: State
    frames: Sequence[State] = field(repr=False)
    status: Status
    report: Report
    name: str
    events: tuple[Occurrence, ...] = field(repr=False)
    checkpoint: Checkpoint = field(repr=False)
    track: Track = field(repr=False)
    fault: BaseException | None = field(default=None, repr=False)

    def __getitem__(self, signal: str) -> np.ndarray:
        if signal in self.outputs:
            return self.y[:, self.outputs.index(signal)]
        if signal in self.inputs:
            return self.u[:, self.inputs.index(signal)]
        known = (*self.outputs, *self.inputs)
        raise StructureError(f"the run has no signal {signal!r}{did_you_mean(signal, known)}")

    def at(self, t: float) -> Moment:
        """Return the run at any time of it, interpolated between steps to the order of the method.

        Rates between steps of `Richardson` are of the third order, its places of the fourth as they are at steps.

        Parameters
        ----------
        t : float
            [s]

        Returns
        -------
        Moment

        Raises
        ------
        StructureError
            For no time or one outside the run, if it took no step, if its steps took too much room to be kept, or if it
            was pickled.
        """
        if np.ndim(t):
            raise StructureError(f"run.at: t = {shortened(t)}; expected one time, [run.at(t) for t in …] gives several")
        t, track = check_finite(t, "t", "run.at"), self.track
        if track.empty:
            ended = f"the run ended before its first step ({self.status.value}: {self.report.message})"
            raise StructureError(f"run.at: {ended}; run.final is where it stood")
        if not track.stretches:
            raise StructureError(f"run.at: {track.missing}, or give every=… for rows at the instants wanted")
        first, last = track.starts[0], track.stretches[-1].after.state.t
        slack = 1e-12 * max(1.0, abs(last))
        if not first - slack <= t <= last + slack:
            raise StructureError(f"run.at({t}): expected a time from {first:.6g} to {last:.6g} s")
        state, outputs, u = track.moment(min(max(t, first), last))
        values = (*outputs.tolist(), *u.tolist())
        state = replace(state, freedoms=self.final.freedoms)
        return Moment(state.t, state, dict(zip((*self.outputs, *self.inputs), values, strict=True)))

    def plot(self, signals: str | tuple[str, ...] | None = None) -> Figure:
        """Draw curves over time, one axes a signal.

        Parameters
        ----------
        signals : str or tuple of str, optional
            Default: all outputs.

        Returns
        -------
        matplotlib.figure.Figure
        """
        from flexctrl.plots.run import run_figure

        return run_figure(self, signals)

    def save_csv(self, path: str | Path) -> None:
        """Write time, outputs and inputs as columns.

        Parameters
        ----------
        path : str or Path

        Raises
        ------
        StructureError
            If ``path`` names no file, its folder is not there, or it cannot be written.
        """
        header = ",".join(["t", *self.outputs, *self.inputs])
        with written(path, "run.save_csv"):
            np.savetxt(path, np.column_stack([self.t, self.y, self.u]), delimiter=",", header=header, comments="")


__all__ = ["EnergyBalance", "Moment", "Report", "Run", "Status", "Tolerance", "worst_signal"]
