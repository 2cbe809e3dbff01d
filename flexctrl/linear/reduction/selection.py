"""Which modes to keep."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from flexctrl.errors import ReductionError, did_you_mean
from flexctrl.frozen import frozen
from flexctrl.linear.modes import Modes

__all__ = ["BelowFrequency", "DCGain", "Lowest", "Participation", "Selection", "dc_gains", "peak_gains"]


class Selection(Protocol):
    """A rule that picks flexible modes."""

    def choose(self, modes: Modes, room: int) -> np.ndarray:
        """Pick modes.

        Parameters
        ----------
        modes : Modes
            Flexible ones only.
        room : int
            How many at most, where the rule counts modes.

        Returns
        -------
        numpy.ndarray of int
            Their numbers, ascending.
        """
        ...


@frozen
class Lowest:
    """The lowest modes.

    Attributes
    ----------
    order : int
        Number of modes, rigid-body modes included.
    """

    order: int

    def choose(self, modes: Modes, room: int) -> np.ndarray:
        """The first ``room`` modes."""
        return np.arange(min(room, len(modes.omega)))


@frozen
class BelowFrequency:
    """All modes below a frequency.

    Attributes
    ----------
    hz : float
    """

    hz: float

    def choose(self, modes: Modes, room: int) -> np.ndarray:
        """The modes below the limit."""
        return np.flatnonzero(modes.omega < 2 * np.pi * self.hz)


@frozen
class Participation:
    """The modes with the highest resonance peaks between the chosen inputs and outputs.

    Every channel is measured against its own largest peak, so that metres and radians compare.

    Attributes
    ----------
    order : int
        Number of modes, rigid-body modes included.
    inputs, outputs : tuple of str
        Signals that matter; all of them if empty.
    """

    order: int
    inputs: tuple[str, ...] = ()
    outputs: tuple[str, ...] = ()

    def choose(self, modes: Modes, room: int) -> np.ndarray:
        """The ``room`` largest peaks."""
        return _largest(peak_gains(modes), modes, self.inputs, self.outputs, room)


@frozen
class DCGain:
    """The modes with the largest share in the static response of the chosen inputs and outputs.

    Attributes
    ----------
    order : int
        Number of modes, rigid-body modes included.
    inputs, outputs : tuple of str
        Signals that matter; all of them if empty.
    """

    order: int
    inputs: tuple[str, ...] = ()
    outputs: tuple[str, ...] = ()

    def choose(self, modes: Modes, room: int) -> np.ndarray:
        """The ``room`` largest static shares."""
        return _largest(dc_gains(modes), modes, self.inputs, self.outputs, room)


def dc_gains(modes: Modes) -> np.ndarray:
    """|c b|/ω² of every flexible mode and channel.

    Parameters
    ----------
    modes : Modes
        Flexible modes only.

    Returns
    -------
    numpy.ndarray, shape (k, n_outputs, n_inputs)
    """
    share = np.einsum("pk,km->kpm", modes.output_gain, modes.input_gain)
    return abs(share) / modes.omega_squared[:, None, None]


def peak_gains(modes: Modes) -> np.ndarray:
    """|(c + iω c_v) b|/(2 ζ ω²) of every flexible mode and channel.

    Half of it is the mode's Hankel singular value when damping is light (C. Z. Gregory, J. Guidance
    7 (1984) 725–732). Without damping the factor 1/(2ζ) is left out.

    Parameters
    ----------
    modes : Modes
        Flexible modes only.

    Returns
    -------
    numpy.ndarray, shape (k, n_outputs, n_inputs)
    """
    seen = np.hypot(abs(modes.output_gain), modes.omega * abs(modes.output_rate_gain))
    share = np.einsum("pk,km->kpm", seen, abs(modes.input_gain)) / modes.omega_squared[:, None, None]
    zeta = modes.damping if (modes.damping > 0).all() else np.full_like(modes.omega, 0.5)
    return share / (2.0 * zeta[:, None, None])


def _largest(
    gain: np.ndarray, modes: Modes, inputs: tuple[str, ...], outputs: tuple[str, ...], room: int
) -> np.ndarray:
    rows = _positions(outputs, modes.outputs, "output")
    cols = _positions(inputs, modes.inputs, "input")
    chosen = gain[:, rows][:, :, cols]
    top = chosen.max(axis=0, initial=0.0)
    relative = np.divide(chosen, top, out=np.zeros_like(chosen), where=top > 0)
    rank = np.argsort(-relative.max(axis=(1, 2), initial=0.0), kind="stable")
    return np.sort(rank[:room])


def _positions(wanted: tuple[str, ...], known: tuple[str, ...], kind: str) -> list[int]:
    for name in wanted:
        if name not in known:
            raise ReductionError(f"{kind} {name!r} does not exist{did_you_mean(name, known)}")
    return [known.index(name) for name in (wanted or known)]
