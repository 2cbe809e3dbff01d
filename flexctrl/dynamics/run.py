"""What a simulation leaves behind: curves, final state, report."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from pathlib import Path

import numpy as np

from flexctrl.errors import StructureError, did_you_mean
from flexctrl.model.motion import State


class Status(Enum):
    """How a run ended."""

    FINISHED = "finished"
    FAILED = "failed"
    INTERRUPTED = "interrupted"


@dataclass(frozen=True)
class Tolerance:
    """Accuracy asked of an error-controlled run.

    Parameters
    ----------
    relative : float
        Local error per step over the distance moved so far.
    absolute : float
        Local error per step below which nothing is asked [rad, and m over the size of the machine].

    Raises
    ------
    StructureError
        If neither is positive.
    """

    relative: float = 1e-4
    absolute: float = 1e-7

    def __post_init__(self) -> None:
        if not (self.relative >= 0.0 and self.absolute > 0.0):
            raise StructureError(
                f"Tolerance: relative = {self.relative}, absolute = {self.absolute}; expected relative ≥ 0 and "
                "absolute > 0"
            )


@dataclass(frozen=True)
class Report:
    """Numerical health of a run.

    Attributes
    ----------
    steps, rejected_steps, newton_iterations, factorisations : int
    wall_s : float
        Time it took [s].
    dofs : int
    energy_residual : float
        Worst |energy − start − work in + dissipated| over the largest energy turned over: what the
        integrator lost or made.
    worst : str
        The degree of freedom that converged last.
    closure_error : float
        How far conditions that close rigid loops were violated [m].
    message : str
        Why the run ended early; empty if it did not.
    notes : tuple of str
        What was held or released so that rigid loops close.
    """

    steps: int
    rejected_steps: int
    newton_iterations: int
    factorisations: int
    wall_s: float
    dofs: int
    energy_residual: float
    worst: str
    closure_error: float
    message: str
    notes: tuple[str, ...]


@dataclass(frozen=True)
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
    frames : tuple of State
        Some states along the way, evenly spread, for drawing.
    status : Status
    report : Report
    name : str
    """

    t: np.ndarray
    outputs: tuple[str, ...]
    inputs: tuple[str, ...]
    y: np.ndarray
    u: np.ndarray
    final: State
    frames: tuple[State, ...]
    status: Status
    report: Report
    name: str = "run"

    def __getitem__(self, signal: str) -> np.ndarray:
        if signal in self.outputs:
            return self.y[:, self.outputs.index(signal)]
        if signal in self.inputs:
            return self.u[:, self.inputs.index(signal)]
        known = (*self.outputs, *self.inputs)
        raise StructureError(f"the run has no signal {signal!r}{did_you_mean(signal, known)}")

    def plot(self, signals: tuple[str, ...] | None = None) -> np.ndarray:
        """Draw curves over time, one axes a signal.

        Parameters
        ----------
        signals : tuple of str, optional
            Default: all outputs.

        Returns
        -------
        numpy.ndarray of matplotlib.axes.Axes
        """
        import importlib

        return importlib.import_module("flexctrl.plots.run").plot_run(self, signals)

    def save_csv(self, path: str | Path) -> None:
        """Write time, outputs and inputs as columns.

        Parameters
        ----------
        path : str or Path
        """
        header = ",".join(["t", *self.outputs, *self.inputs])
        np.savetxt(path, np.column_stack([self.t, self.y, self.u]), delimiter=",", header=header, comments="")


__all__ = ["Report", "Run", "Status", "Tolerance"]
