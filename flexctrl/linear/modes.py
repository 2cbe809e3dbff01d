"""Undamped modes with what a control engineer asks of them: frequency, damping, who moves, who drives, who sees."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field, replace
from typing import TYPE_CHECKING

import numpy as np

from flexctrl.errors import StructureError
from flexctrl.frozen import frozen
from flexctrl.linear.place import Place
from flexctrl.structure.freedoms import check_whole

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["Modes", "shares_of"]


@frozen(eq=False)
class Modes:
    """Modes of K φ = ω² M φ, in ascending order of ω²: unstable, rigid-body, flexible.

    C takes no part in them: where it is gyroscopic (`RotatingFrame`), the damped poles of the model oscillate at
    other frequencies, and may be stable though a mode here is not.

    Attributes
    ----------
    omega_squared : numpy.ndarray, shape (k,)
        (rad/s)²; exactly 0 for rigid-body modes, negative for unstable ones.
    shapes : numpy.ndarray, shape (n, k)
        Mass-normalised, φᵀ M φ = 1; largest entry positive; repeated modes in one deterministic basis.
    rigid : int
        How many rigid-body modes.
    unstable : int
        How many modes with ω² < 0 (they grow as exp(growth · t) when undamped).
    massless : int
        How many infinite eigenvalues the pencil has (freedoms without mass); they are not listed.
    decay : numpy.ndarray, shape (k,)
        φᵀ C φ, 1/s: twice ζω.
    input_gain : numpy.ndarray, shape (k, n_inputs)
        φᵀ B.
    output_gain, output_rate_gain : numpy.ndarray, shape (n_outputs, k)
        Cq φ and Cv φ.
    coordinates, inputs, outputs : tuple of str
    strain_shares, kinetic_shares : mapping of part name to numpy.ndarray, shape (k,)
        Part of the mode's strain (kinetic) energy that lives in the part; 0 strain in rigid-body modes.
    place : Place, optional
        The machine they are modes of; absent in models made from matrices.
    """

    omega_squared: np.ndarray
    shapes: np.ndarray
    rigid: int
    unstable: int
    massless: int
    decay: np.ndarray
    input_gain: np.ndarray
    output_gain: np.ndarray
    output_rate_gain: np.ndarray
    coordinates: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    strain_shares: Mapping[str, np.ndarray] = field(default_factory=dict)
    kinetic_shares: Mapping[str, np.ndarray] = field(default_factory=dict)
    place: Place | None = field(default=None, repr=False)

    def __len__(self) -> int:
        return self.omega_squared.size

    def lowest(self, count: int) -> Modes:
        """Return the first of them.

        Parameters
        ----------
        count : int

        Returns
        -------
        Modes
        """
        return self if count >= len(self) else self._some(slice(count))

    def _some(self, which: slice | np.ndarray) -> Modes:
        kinds = np.array(self.kinds)[which].tolist()
        return replace(
            self,
            omega_squared=self.omega_squared[which],
            shapes=self.shapes[:, which],
            rigid=kinds.count("rigid"),
            unstable=kinds.count("unstable"),
            decay=self.decay[which],
            input_gain=self.input_gain[which],
            output_gain=self.output_gain[:, which],
            output_rate_gain=self.output_rate_gain[:, which],
            strain_shares={part: shares[which] for part, shares in self.strain_shares.items()},
            kinetic_shares={part: shares[which] for part, shares in self.kinetic_shares.items()},
        )

    @property
    def omega(self) -> np.ndarray:
        """Undamped angular frequency, rad/s; 0 for rigid-body and unstable modes. Shape (k,)."""
        return np.sqrt(np.maximum(self.omega_squared, 0.0))

    @property
    def frequencies(self) -> np.ndarray:
        """Undamped frequency, Hz. Shape (k,)."""
        return self.omega / (2.0 * np.pi)

    @property
    def growth(self) -> np.ndarray:
        """Undamped growth rate sqrt(-ω²), 1/s; 0 where ω² ≥ 0. Shape (k,)."""
        return np.sqrt(np.maximum(-self.omega_squared, 0.0))

    @property
    def damping(self) -> np.ndarray:
        """Damping ratio ζ = φᵀ C φ / 2ω; 0 where ω = 0 (see `decay` there). Shape (k,)."""
        omega = self.omega
        return np.where(omega > 0, self.decay / (2.0 * np.where(omega > 0, omega, 1.0)), 0.0)

    @property
    def flexible(self) -> slice:
        """The modes with ω² > 0."""
        return slice(self.unstable + self.rigid, len(self))

    @property
    def kinds(self) -> tuple[str, ...]:
        """``"unstable"``, ``"rigid"`` or ``"flexible"`` for each mode."""
        rest = len(self) - self.unstable - self.rigid
        return ("unstable",) * self.unstable + ("rigid",) * self.rigid + ("flexible",) * rest

    @property
    def input_participation(self) -> np.ndarray:
        """(φᵀ b)² as a share of its sum over these modes: share of the input's immediate acceleration.

        Shape (k, n_inputs); columns add to 1 (or are 0 for an input that moves none of them).
        """
        return shares_of(self.input_gain**2, axis=0)

    @property
    def output_participation(self) -> np.ndarray:
        """(Cq φ)² as a share of its sum over these modes. Shape (n_outputs, k); rows add to 1 (or 0)."""
        return shares_of(self.output_gain**2, axis=1)

    def select(self, keep: np.ndarray | list[int]) -> Modes:
        """Some of the modes, in ascending order.

        Parameters
        ----------
        keep : array_like of int
            Mode numbers, from 0.

        Returns
        -------
        Modes
        """
        index = np.unique(np.asarray(keep, dtype=int))
        if index.size and (index[0] < 0 or index[-1] >= len(self)):
            raise StructureError(f"mode numbers run from 0 to {len(self) - 1}; got {index.tolist()}")
        return self._some(index)

    def part_shares(self, mode: int) -> dict[str, float]:
        """What each part holds of a mode's strain energy; of its kinetic energy where nothing strains.

        Parameters
        ----------
        mode : int
            Mode number, from 0.

        Returns
        -------
        dict of str to float
            Kinetic energy for rigid-body modes and for machines that swing without bending; empty if the model does
            not know its parts.
        """
        mode = check_whole(mode, "mode", "part_shares", least=0, most=len(self) - 1)
        strains = self.kinds[mode] != "rigid" and any(share[mode] for share in self.strain_shares.values())
        shares = self.strain_shares if strains else self.kinetic_shares
        return {part: float(share[mode]) for part, share in shares.items()}

    def dominant_part(self, mode: int) -> str:
        """The part that holds most of a mode, as `part_shares` tells.

        Parameters
        ----------
        mode : int
            Mode number, from 0.

        Returns
        -------
        str
            Empty if the model does not know its parts.
        """
        mode = check_whole(mode, "mode", "dominant_part", least=0, most=len(self) - 1)
        shares = self.part_shares(mode)
        return max(shares, key=lambda name: shares[name]) if shares else ""

    def dominant_coordinate(self, mode: int) -> str:
        """The coordinate with the largest entry of the shape.

        Parameters
        ----------
        mode : int
            Mode number, from 0.

        Returns
        -------
        str
        """
        mode = check_whole(mode, "mode", "dominant_coordinate", least=0, most=len(self) - 1)
        return self.coordinates[int(np.argmax(np.abs(self.shapes[:, mode])))]

    def plot(self, count: int = 6) -> Figure:
        """Draw the lowest flexible mode shapes on the machine; frequencies and energy shares where there is none.

        Parameters
        ----------
        count : int
            How many shapes; unstable modes come first, rigid-body modes fill up what is left.

        Returns
        -------
        matplotlib.figure.Figure
        """
        from flexctrl.plots.modes import modes_picture

        return modes_picture(self, count)

    def __str__(self) -> str:
        return _table(self)


def shares_of(values: np.ndarray, axis: int) -> np.ndarray:
    """Return values as shares of their sum along an axis; 0 where that is 0."""
    total = values.sum(axis=axis, keepdims=True)
    return values / np.where(total != 0, total, 1.0)


def _table(modes: Modes) -> str:
    head = "mode  kind        frequency Hz     omega rad/s     damping  moves most"
    lines = [head + ("   lives in" if modes.strain_shares else "")]
    for i, kind in enumerate(modes.kinds):
        rate = f"grows {modes.growth[i]:.6g}/s" if kind == "unstable" else f"{modes.omega[i]:.8g}"
        line = f"{i + 1:4d}  {kind:8s} {modes.frequencies[i]:15.8g} {rate:>15s} {modes.damping[i]:11.4g}"
        line += f"  {modes.dominant_coordinate(i)}"
        lines.append(line + (f"   {modes.dominant_part(i)}" if modes.strain_shares else ""))
    if modes.massless:
        lines.append(f"{modes.massless} massless freedoms (infinite frequency) are not listed")
    return "\n".join(lines)
