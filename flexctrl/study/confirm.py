"""A spillover certificate checked by nonlinear simulation on both sides of the critical gain."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flexctrl.design.controller import LinearController
from flexctrl.dynamics.alpha.method import GeneralizedAlpha
from flexctrl.dynamics.methods.checked import Unchecked
from flexctrl.dynamics.run import Run, Status
from flexctrl.dynamics.simulate import simulate
from flexctrl.errors import StructureError
from flexctrl.frozen import frozen
from flexctrl.linear.model import LinearModel
from flexctrl.model.model import Model
from flexctrl.model.state import State
from flexctrl.study.critical_mode import CriticalMode, critical_mode
from flexctrl.study.gain_family import Crossing, gain_family
from flexctrl.study.spillover import Spillover
from flexctrl.study.unstopped import unstopped

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["Confirmation", "Growth", "confirm"]

_COARSEST, _FINEST, _POINTS = 48, 6144, 24
_AGREE = 0.05
"""Of the margin: how little halving the steps may still move the gain."""
_FEWEST, _MOST = 8.0, 24.0
_SMALL = 1e-4


@frozen(eq=False)
class Growth:
    """One nonlinear run near the critical gain, started in the critical mode.

    Attributes
    ----------
    gain : float
    predicted, measured : float
        Growth rate of the oscillation [1/s]: the eigenvalue's real part, and that of the run.
    times, amplitudes : numpy.ndarray
        Amplitude of the mode, period by period, over its first value.
    run : Run
    """

    gain: float
    predicted: float
    measured: float
    times: np.ndarray
    amplitudes: np.ndarray
    run: Run


@frozen(eq=False)
class Confirmation:
    """What nonlinear simulation says about a critical gain.

    Attributes
    ----------
    below, above : Growth
    gain : float
        Critical gain by simulation: where the measured growth rate, straight between the two runs, is zero.
    predicted : float
        By eigenvalues.
    confirmed : bool
        Whether the machine decays below and grows above.
    steps : int
        Time steps a period in the last pair of runs.
    change : float
        By how much of itself the gain by simulation moved when the steps were halved last.
    """

    below: Growth
    above: Growth
    gain: float
    predicted: float
    confirmed: bool
    steps: int
    change: float

    def plot(self) -> Figure:
        """Draw the amplitudes of the two runs, dots, and what the eigenvalues predict, lines.

        Returns
        -------
        matplotlib.figure.Figure
        """
        from flexctrl.plots.spillover import confirmation_figure

        return confirmation_figure(self)

    def __str__(self) -> str:
        verdict = "confirmed" if self.confirmed else "NOT confirmed"
        lines = [
            f"{verdict} by nonlinear simulation: critical gain {self.gain:.5g} ×, by eigenvalues {self.predicted:.5g} ×"
        ]
        for g in (self.below, self.above):
            lines.append(f"  at {g.gain:.5g} ×: growth {g.measured:+.4g} 1/s, predicted {g.predicted:+.4g} 1/s")
        return "\n".join(lines)


def confirm(certificate: Spillover, margin: float = 0.02) -> Confirmation:
    """Run the nonlinear machine a little below and above the critical gain, from a small motion in the critical mode.

    Machine and controller start in the eigenvector at that gain, a ten-thousandth of the machine's size large, so
    the oscillation is exponential from the start. Its amplitude is fitted period by period. The runs use
    generalised alpha without numerical damping, in steps that are halved, from 48 a period on, until that moves
    the gain by less than a twentieth of the margin: under a sampled controller the critical mode may be slower
    than the modes that ring between its samples, and these want the steps.

    Parameters
    ----------
    certificate : Spillover
        Of a `Model`, with a critical gain that is positive and finite.
    margin : float
        Relative distance from the critical gain, 0 … 0.5.

    Returns
    -------
    Confirmation

    Raises
    ------
    StructureError
        If there is nothing to confirm, or coordinates were held for the linear model.
    """
    model, at, mode = certificate.plant, certificate.at, certificate.mode
    if model is None or at is None:
        raise StructureError("confirm: the certificate is of a linear model; give spillover the Model itself")
    if mode is None or not 0.0 < certificate.gain < np.inf:
        raise StructureError(f"confirm: there is no critical gain to confirm ({certificate.gain})")
    if not 0.0 < margin < 0.5:
        raise StructureError(f"confirm: margin = {margin}; expected 0 … 0.5")
    if len(certificate.linear.coordinates) != model.n:
        raise StructureError(
            "confirm: the equilibrium holds coordinates, which a run does not, and no input of the model acts on them "
            "alone: give the model such inputs, or spillover an equilibrium that holds nothing"
        )
    steps, change = _COARSEST, np.inf
    below, above = _pair(certificate, model, at, margin, steps)
    while change > _AGREE * margin and steps < _FINEST:
        steps, coarse = 2 * steps, _balanced(below, above)
        below, above = _pair(certificate, model, at, margin, steps)
        change = abs(_balanced(below, above) - coarse) / certificate.gain
    confirmed = below.measured < 0.0 < above.measured
    return Confirmation(below, above, _balanced(below, above), certificate.gain, confirmed, steps, change)


def _pair(certificate: Spillover, model: Model, at: State, margin: float, steps: int) -> tuple[Growth, Growth]:
    """Runs below and above the critical gain."""
    gain = certificate.gain
    return (
        _grown(certificate, model, at, (1.0 - margin) * gain, steps),
        _grown(certificate, model, at, (1.0 + margin) * gain, steps),
    )


def _balanced(below: Growth, above: Growth) -> float:
    """Gain at which the growth, straight between two runs, is zero."""
    rise = above.measured - below.measured
    return below.gain - below.measured * (above.gain - below.gain) / rise if rise else np.inf


def _grown(certificate: Spillover, model: Model, at: State, gain: float, steps: int) -> Growth:
    linear, law = certificate.linear, certificate.law
    mode = _mode_at(certificate, gain)
    s = mode.pole
    period = 2.0 * np.pi / abs(s.imag) if mode.frequency_hz else 0.1 / max(abs(s.real), 1e-12)
    periods = float(np.clip(1.0 / max(abs(s.real) * period, 1e-12), _FEWEST, _MOST)) if mode.frequency_hz else 10.0
    scale = _SMALL / _size(model, at, linear, mode)
    start = _started(model, at, linear, mode, scale)
    about = _Scaled(law, gain, model.measure(at)[_places(model, law)], (scale * mode.controller_state).real)
    run = simulate(
        model,
        about,
        until=round(periods) * period,
        start=start,
        inputs=dict(zip(model.inputs, certificate.inputs.tolist(), strict=True)),
        method=Unchecked(GeneralizedAlpha(period / steps, rho=1.0)),
        every=period / _POINTS,
    )
    if unstopped(run).status is not Status.FINISHED:
        raise StructureError(f"confirm: the run at {gain:.4g} × ended early: {run.report.message}")
    times, amplitudes = _amplitudes(run, model.measure(at), _seen(linear, mode), mode)
    measured = float(np.polyfit(times, np.log(amplitudes), 1)[0])
    return Growth(gain, s.real, measured, times, amplitudes / amplitudes[0], run)


def _mode_at(certificate: Spillover, gain: float) -> CriticalMode:
    """The critical mode at a gain nearby."""
    family = gain_family(certificate.linear, certificate.law)
    assert certificate.mode is not None
    s = complex(np.interp(gain, certificate.gains, certificate.branch))
    guess = complex(np.exp(s * family.dt)) if family.dt else s
    spectrum, pole = family.near(gain, guess)
    return critical_mode(certificate.linear, certificate.law, family, Crossing(spectrum, pole), s)


def _size(model: Model, at: State, linear: LinearModel, mode: CriticalMode) -> float:
    """Largest displacement of the mode over the machine's size, or its largest rotation."""
    largest = 0.0
    for part in (mode.shape.real, mode.shape.imag):
        raw = model.rates(at.with_(v=_full(linear, part)))[: model.motion.source_base].reshape(-1, 6)
        largest = max(largest, np.abs(raw[:, :3]).max() / model.structure.size, np.abs(raw[:, 3:]).max())
    return largest or 1.0


def _full(linear: LinearModel, values: np.ndarray) -> np.ndarray:
    """Displacements of the machine's coordinates."""
    assert linear.place is not None
    return np.asarray(linear.place.basis @ values)


def _started(model: Model, at: State, linear: LinearModel, mode: CriticalMode, scale: float) -> State:
    step, v = (_full(linear, (scale * part).real) for part in (mode.shape, mode.rate))
    return model.advance(at, step, v, 0.0)


def _seen(linear: LinearModel, mode: CriticalMode) -> np.ndarray:
    """Outputs of the mode."""
    return np.asarray(linear.Cq @ mode.shape + linear.Cv @ mode.rate)


def _places(model: Model, law: LinearController) -> list[int]:
    return [model.outputs.index(name) for name in law.inputs]


def _amplitudes(run: Run, rest: np.ndarray, seen: np.ndarray, mode: CriticalMode) -> tuple[np.ndarray, np.ndarray]:
    """Fit y − y_rest = Re(c α e^{iωt}), period by period, c being the mode's outputs; (times, |α|)."""
    c = seen[: len(rest)]
    weight = np.where(np.abs(c) > 1e-9 * np.abs(c).max(), 1.0 / np.maximum(np.abs(c), 1e-300), 0.0)
    y = (run.y - rest) * weight
    omega = mode.pole.imag if mode.frequency_hz else 0.0
    waves = (c * weight)[None, :] * np.exp(1j * omega * run.t)[:, None]
    times, found = [], []
    for first in range(0, len(run.t) - _POINTS, _POINTS):
        rows = slice(first, first + _POINTS)
        wave = waves[rows].ravel()
        basis = np.stack([wave.real, -wave.imag], axis=1) if omega else wave.real[:, None]
        found.append(np.linalg.norm(np.linalg.lstsq(basis, y[rows].ravel(), rcond=None)[0]))
        times.append(run.t[rows].mean())
    return np.array(times), np.array(found)


@frozen(eq=False)
class _Scaled:
    """A linear law about an equilibrium, its gain scaled, from a state of its own."""

    law: LinearController
    gain: float
    rest: np.ndarray
    state: np.ndarray

    @property
    def inputs(self) -> tuple[str, ...]:
        return self.law.inputs

    @property
    def outputs(self) -> tuple[str, ...]:
        return self.law.outputs

    @property
    def sample_time(self) -> float:
        return self.law.sample_time

    def initial(self) -> np.ndarray:
        return self.state

    def command(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return self.gain * self.law.command(t, x, y - self.rest)

    def rate(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return self.law.rate(t, x, y - self.rest)

    def update(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return self.law.update(t, x, y - self.rest)
