"""The closed-loop mode that goes unstable: its frequency, its shape, and the parts it lives in."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from flexctrl.design.controller import LinearController
from flexctrl.frozen import frozen
from flexctrl.linear.model import LinearModel
from flexctrl.linear.parts import energies_by_part
from flexctrl.study.gain_family import Crossing, GainFamily

__all__ = ["CriticalMode", "Origin", "critical_mode"]

_STILL = 1e-9
_INSTANTS = 8
_EQUAL = 9
"""Digits to which shares must differ to be put in order."""


@frozen
class Origin:
    """The undamped mode of the machine that holds most of a closed-loop mode's energy.

    Attributes
    ----------
    number : int
        As in ``linear.modes()``, from 1.
    frequency_hz : float
    damping : float
        Open loop.
    share : float
        Of the energy of all of the machine's modes.
    """

    number: int
    frequency_hz: float
    damping: float
    share: float


@frozen(eq=False)
class CriticalMode:
    """The closed-loop mode that goes unstable.

    Attributes
    ----------
    pole : complex
        s, or log(z)/dt under a sampled controller [1/s].
    frequency_hz : float
        0 if it leaves without oscillating. Under a sampled controller a mode above half the sampling rate is
        told from its alias by its origin.
    damping : float
        −Re s/|s|: 0 at the critical gain, to rounding.
    own_frequency_hz, own_damping : float
        Of the same mode at the controller's own gain.
    shape, rate : numpy.ndarray of complex, shape (n,)
        Displacement and velocity of the linear model's coordinates; the motion is the real part.
    controller_state : numpy.ndarray of complex
        Of the controller in the same motion.
    strain_shares, kinetic_shares : mapping of str to float
        Share of each part in the strain (kinetic) energy, largest first; empty if the model does not know
        its parts.
    origin : Origin
    """

    pole: complex
    frequency_hz: float
    damping: float
    own_frequency_hz: float
    own_damping: float
    shape: np.ndarray
    rate: np.ndarray
    controller_state: np.ndarray
    strain_shares: Mapping[str, float]
    kinetic_shares: Mapping[str, float]
    origin: Origin

    @property
    def lives_in(self) -> str:
        """The part with most of the strain energy; of the kinetic energy where nothing is strained."""
        shares = self.strain_shares if any(self.strain_shares.values()) else self.kinetic_shares
        return next(iter(shares), "")


def critical_mode(
    linear: LinearModel, law: LinearController, family: GainFamily, crossing: Crossing, own: complex
) -> CriticalMode:
    """Describe one closed-loop mode.

    Parameters
    ----------
    linear : LinearModel
    law : LinearController
    family : GainFamily
        Of the two.
    crossing : Crossing
        Gain and pole.
    own : complex
        The same pole s at the controller's own gain.

    Returns
    -------
    CriticalMode
    """
    modes, dt = linear._modal.modes, family.dt
    states, commands = family.motion(crossing.spectrum, crossing.pole)
    size = np.sqrt(np.abs(modes.omega_squared))
    energy = np.abs(states[0 : 2 * len(modes) : 2]) ** 2 * (size > 0.0) + np.abs(states[1 : 2 * len(modes) : 2]) ** 2
    best = int(np.argmax(energy))
    origin = Origin(
        best + 1, float(modes.frequencies[best]), float(modes.damping[best]), float(energy[best] / energy.sum())
    )
    pole = crossing.spectrum.poles[crossing.pole]
    s, own = (_unfolded(value, modes.omega[best], dt) for value in (family.continuous(pole), own))
    shape, rate = _moved(linear, states)
    along = [(shape, rate)] if not dt else _within_sample(linear, law, dt, states, commands)
    strain = energies_by_part(linear.parts, np.column_stack([q for q, _ in along]))[0].sum(axis=1)
    kinetic = energies_by_part(linear.parts, np.column_stack([v for _, v in along]))[1].sum(axis=1)
    return CriticalMode(
        pole=s,
        frequency_hz=_frequency(s),
        damping=-s.real / abs(s) if s else 0.0,
        own_frequency_hz=_frequency(own),
        own_damping=-own.real / abs(own) if own else 0.0,
        shape=shape,
        rate=rate,
        controller_state=crossing.spectrum.shapes[len(family.states) :, crossing.pole],
        strain_shares=_shares(dict(zip(linear.parts, strain.tolist(), strict=True))),
        kinetic_shares=_shares(dict(zip(linear.parts, kinetic.tolist(), strict=True))),
        origin=origin,
    )


def _moved(linear: LinearModel, states: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Displacement and velocity of the coordinates from modal states (ω η, η̇)."""
    modes = linear._modal.modes
    size = np.sqrt(np.abs(modes.omega_squared))
    q, v = states[0 : 2 * len(modes) : 2], states[1 : 2 * len(modes) : 2]
    return modes.shapes @ (q / np.where(size > 0.0, size, 1.0)), modes.shapes @ v


def _within_sample(
    linear: LinearModel, law: LinearController, dt: float, states: np.ndarray, commands: np.ndarray
) -> list[tuple[np.ndarray, np.ndarray]]:
    """The motion at instants spread over a sample, the commands held: energies are means over time."""
    chosen = linear.select(law.outputs, law.inputs)
    found = []
    for k in range(_INSTANTS):
        part = chosen.discretize((k + 0.5) / _INSTANTS * dt)
        found.append(_moved(linear, part.A @ states + part.B @ commands))
    return found


def _frequency(s: complex) -> float:
    return abs(s.imag) / (2.0 * np.pi) if abs(s.imag) > _STILL * abs(s) else 0.0


def _unfolded(s: complex, near: float, dt: float) -> complex:
    """The exponent among those with the same samples whose frequency is nearest to a mode's."""
    if not dt:
        return s
    turn = 2.0 * np.pi / dt
    folds = [sign * s.imag + k * turn for k in range(int(near / turn) + 2) for sign in (1.0, -1.0)]
    best = min(folds, key=lambda w: abs(w - near))
    return complex(s.real, best)


def _shares(energy: dict[str, float]) -> dict[str, float]:
    """Shares of the sum, largest first; rounding below 1e-12 of the largest is nothing."""
    total, most = sum(energy.values()), max((abs(e) for e in energy.values()), default=0.0)
    if total <= 0.0 or most == 0.0:
        return dict.fromkeys(energy, 0.0)
    ordered = sorted(energy.items(), key=lambda item: -round(item[1] / total, _EQUAL))
    return {name: e / total if abs(e) > 1e-12 * most else 0.0 for name, e in ordered}
