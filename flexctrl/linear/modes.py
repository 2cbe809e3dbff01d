"""Undamped modes with what a control engineer asks of them: frequency, damping, who moves, who drives, who sees."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp

from flexctrl.errors import LinearizationError, StructureError
from flexctrl.linear.basis import canonical, clusters
from flexctrl.linear.columns import energies
from flexctrl.linear.condense import Scaled, scaled, static_map
from flexctrl.linear.eigen import EPS, RIGID_NOISE, Eigenpairs, complete_pairs, lowest_pairs
from flexctrl.linear.massless import STIFFNESS_RANK, null_split
from flexctrl.linear.model import LinearModel, Place
from flexctrl.linear.parts import energies_by_part
from flexctrl.structure.freedoms import check_whole

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["Modes", "modes"]

DENSE = 300
COMPLETE = 1000
DEFAULT_COUNT = 20
BLURRED = 1e-13
ROUND_OFF = 2e-13
UNSURE, UNSEEN = 1e-7, 1e-2
STRESS_NOISE = 5.0
EXTENDED_EPS = float(np.finfo(np.longdouble).eps)


@dataclass(frozen=True, eq=False)
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
        if count >= len(self):
            return self
        first = slice(count)
        return replace(
            self,
            omega_squared=self.omega_squared[first],
            shapes=self.shapes[:, first],
            rigid=min(max(count - self.unstable, 0), self.rigid),
            unstable=min(count, self.unstable),
            decay=self.decay[first],
            input_gain=self.input_gain[first],
            output_gain=self.output_gain[:, first],
            output_rate_gain=self.output_rate_gain[:, first],
            strain_shares={part: shares[first] for part, shares in self.strain_shares.items()},
            kinetic_shares={part: shares[first] for part, shares in self.kinetic_shares.items()},
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
        return _shares(self.input_gain**2, axis=0)

    @property
    def output_participation(self) -> np.ndarray:
        """(Cq φ)² as a share of its sum over these modes. Shape (n_outputs, k); rows add to 1 (or 0)."""
        return _shares(self.output_gain**2, axis=1)

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
        kinds = [self.kinds[i] for i in index]
        return replace(
            self,
            omega_squared=self.omega_squared[index],
            shapes=self.shapes[:, index],
            rigid=kinds.count("rigid"),
            unstable=kinds.count("unstable"),
            decay=self.decay[index],
            input_gain=self.input_gain[index],
            output_gain=self.output_gain[:, index],
            output_rate_gain=self.output_rate_gain[:, index],
            strain_shares={k: v[index] for k, v in self.strain_shares.items()},
            kinetic_shares={k: v[index] for k, v in self.kinetic_shares.items()},
        )

    def dominant_part(self, mode: int) -> str:
        """The part that holds most of the mode's strain energy (kinetic energy for a rigid-body mode).

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
        shares = self.kinetic_shares if self.kinds[mode] == "rigid" else self.strain_shares
        return max(shares, key=lambda name: shares[name][mode]) if shares else ""

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


def modes(linear: LinearModel, count: int | None = None) -> Modes:
    """Undamped modes: shift-invert Lanczos for a few of many, dense for all.

    A mode counts as rigid-body when φᵀKφ is indistinguishable from the rounding of K's entries, or is both
    under 1e-8 of the first flexible ω² and within 1e6 of that rounding: a slow pendulum on a stiff structure
    stays a pendulum. No mode is missed: the number found is checked by a Sturm count.

    Parameters
    ----------
    linear : LinearModel
        K symmetric.
    count : int, optional
        How many; left out: all of them up to 1000 coordinates, the 20 lowest beyond.

    Returns
    -------
    Modes

    Raises
    ------
    LinearizationError
        If K is not symmetric (use ``damped_poles``), M not positive semidefinite.
    MechanismError
        For a motion with neither mass nor stiffness.
    """
    base = scaled(linear)
    if linear.certificate is not None and linear.certificate.loads:
        refuse_unsymmetric(base, ROUND_OFF)
    if len(linear.coordinates) > DENSE:
        return modes_of(linear, base, count)
    _check_count(count)
    return linear._every_mode if count is None else linear._every_mode.lowest(count)


def modes_of(linear: LinearModel, base: Scaled, count: int | None) -> Modes:
    """As :func:`modes`, with the scaling and the massless freedoms already known.

    Parameters
    ----------
    linear : LinearModel
    base : Scaled
        Of the same model.
    count : int or None

    Returns
    -------
    Modes
    """
    n = len(linear.coordinates)
    _check_count(count)
    refuse_unsymmetric(base)
    K, M = base.stiffness[0], base.mass
    null = base.massless.every
    finite = n - null.shape[1]
    wanted = min(finite, count or (finite if n <= COMPLETE else DEFAULT_COUNT))
    if base.massless.relaxing.shape[1]:
        K = sp.csc_matrix(K + _grounded(base))
    dense = n <= DENSE or wanted + 30 > finite // 2
    pairs = _complete(K, M, null) if dense else lowest_pairs(K, M, wanted, base.band)
    known = _recalculated(linear, base, _sharpened(K, M, pairs))
    return _described(linear, base, _settled_basis(base, known), wanted)


def _recalculated(linear: LinearModel, base: Scaled, pairs: Eigenpairs) -> Eigenpairs:
    """Soft modes whose λ is unsure by the rounding of K, by Rayleigh–Ritz with the stiffness of the machine itself."""
    faint = np.where(pairs.rigid, RIGID_NOISE * pairs.noise > UNSEEN, pairs.noise > UNSURE * np.abs(pairs.values))
    unsure = np.flatnonzero(faint)
    if linear.place is None or not unsure.size:
        return pairs
    exact = linear.place.strain(base.scales[:, None] * pairs.shapes[:, unsure])
    if (np.abs(exact.diagonal() - pairs.values[unsure]) > 100.0 * pairs.noise[unsure]).any():
        return pairs  # the machine has another K by now
    values, shapes, noise, rigid = (a.copy() for a in (pairs.values, pairs.shapes, pairs.noise, pairs.rigid))
    values[unsure], turned = np.linalg.eigh(0.5 * (exact + exact.T))
    shapes[:, unsure] = shapes[:, unsure] @ turned
    spread = (turned**2).T @ noise[unsure]
    rigid[unsure] = (np.abs(values[unsure]) <= STRESS_NOISE * spread) & rigid[unsure].any()
    values[rigid], noise[unsure] = 0.0, spread * EXTENDED_EPS / EPS
    order = np.argsort(values, kind="stable")
    return Eigenpairs(values[order], shapes[:, order], rigid[order], noise[order])


def _complete(K: sp.csc_matrix, M: sp.csc_matrix, null: sp.csc_matrix) -> Eigenpairs:
    """All pairs, the massless freedoms eliminated first."""
    if not null.shape[1]:
        return complete_pairs(K.toarray(), M.toarray())
    T, _ = static_map(K, null)
    pairs = complete_pairs((T.T @ K @ T).toarray(), (T.T @ M @ T).toarray(), origin=(K, T))
    return Eigenpairs(pairs.values, T @ pairs.shapes, pairs.rigid, pairs.noise)


def refuse_unsymmetric(base: Scaled, limit: float = 1e-9) -> None:
    """Raise LinearizationError if K is not symmetric to a share of its largest entry.

    Parameters
    ----------
    base : Scaled
    limit : float
    """
    skew = base.stiffness[1]
    if skew > limit:
        raise LinearizationError(
            f"K is not symmetric (relative difference {skew:.1e}; follower loads?): undamped modes do not "
            "exist as real shapes; use damped_poles()"
        )


def _check_count(count: int | None) -> None:
    if count is not None:
        check_whole(count, "count", "modes", least=1)


def _grounded(base: Scaled) -> sp.csc_matrix:
    """Unit stiffness on massless motions that only a damper holds; no mode moves them."""
    relaxing, K = base.massless.relaxing, base.model.K
    creeping = relaxing @ null_split(relaxing.T @ K @ relaxing, STIFFNESS_RANK)[0]
    return sp.csc_matrix(creeping @ creeping.T)


def _sharpened(K: sp.csc_matrix, M: sp.csc_matrix, pairs: Eigenpairs) -> Eigenpairs:
    """Soft λ, which the rounding of φᵀ K φ blurs, as Rayleigh quotients with that in extended precision.

    The error of the vectors, which have an M-length of one, is in them squared (B. N. Parlett, The Symmetric
    Eigenvalue Problem, 1998, § 4.6). In φᵀ M φ little cancels: the double sum has fourteen digits on meshes where
    that of φᵀ K φ has none.
    """
    soft = ~pairs.rigid & (pairs.noise > BLURRED * np.abs(pairs.values))
    if not soft.any():
        return pairs
    phi = pairs.shapes[:, soft]
    values = pairs.values.copy()
    values[soft] = energies(K, phi) / _energy(M, phi)
    return replace(pairs, values=values)


def _settled_basis(base: Scaled, pairs: Eigenpairs) -> Eigenpairs:
    """Equal eigenvalues made equal, their vectors turned to the canonical basis."""
    groups = clusters(pairs.values, pairs.rigid, 30.0 * pairs.noise)
    values = pairs.values.copy()
    for group in groups:
        if group.stop - group.start > 1:
            values[group] = values[group].mean()
    weight = np.sqrt(np.abs(base.model.M.diagonal()))
    shapes = canonical(pairs.shapes, weight, base.model.C, groups)
    rigid = shapes[:, pairs.rigid]
    rigid[np.abs(rigid) < 8.0 * EPS * np.abs(rigid).max(axis=0, initial=0.0)] = 0.0
    shapes[:, pairs.rigid] = rigid
    return replace(pairs, values=values, shapes=shapes)


def _described(linear: LinearModel, base: Scaled, pairs: Eigenpairs, count: int) -> Modes:
    values, rigid = pairs.values[:count], pairs.rigid[:count]
    shapes = base.scales[:, None] * pairs.shapes[:, :count]
    strain, kinetic = energies_by_part(linear.parts, shapes)
    return Modes(
        omega_squared=values,
        shapes=shapes,
        rigid=int(np.count_nonzero(rigid)),
        unstable=int(np.count_nonzero(values < 0)),
        massless=base.massless.every.shape[1],
        decay=_energy(linear.C, shapes),
        input_gain=shapes.T @ linear.B,
        output_gain=linear.Cq @ shapes,
        output_rate_gain=linear.Cv @ shapes,
        coordinates=linear.coordinates,
        inputs=linear.inputs,
        outputs=linear.outputs,
        strain_shares=dict(zip(linear.parts, _shares(np.where(rigid, 0.0, strain), axis=0), strict=True)),
        kinetic_shares=dict(zip(linear.parts, _shares(kinetic, axis=0), strict=True)),
        place=linear.place,
    )


def _energy(A: sp.spmatrix, shapes: np.ndarray) -> np.ndarray:
    return np.einsum("ij,ij->j", shapes, A @ shapes)


def _shares(values: np.ndarray, axis: int) -> np.ndarray:
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
