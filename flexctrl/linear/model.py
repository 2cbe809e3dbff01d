"""The linear model, second order in its coordinates: the truth that every export comes from."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import field, replace
from functools import cache, cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.sparse as sp

from flexctrl.errors import LinearizationError, StructureError, did_you_mean
from flexctrl.frozen import ByFields, frozen
from flexctrl.linear.parts import PartMatrices, projected_parts
from flexctrl.linear.place import Place
from flexctrl.structure.freedoms import listed

if TYPE_CHECKING:
    import control
    from matplotlib.figure import Figure

    from flexctrl.linear.certificate import Certificate
    from flexctrl.linear.condense import Audit, Scaled
    from flexctrl.linear.discrete import Hold
    from flexctrl.linear.matfile import Units
    from flexctrl.linear.modal import ModalSystem
    from flexctrl.linear.modes import Modes
    from flexctrl.linear.reduction import Method, Reduced, RelativeError
    from flexctrl.linear.response import FrequencyResponse
    from flexctrl.linear.statespace import Form

__all__ = ["LinearModel"]


@frozen(eq=False)
class LinearModel(ByFields):
    """M q̈ + C q̇ + K q = B u,  y = Cq q + Cv q̇ + D u, with names.

    Attributes
    ----------
    M, C, K : scipy.sparse.csc_matrix, shape (n, n)
        Mass, damping and stiffness (geometric stiffness included); SI units. M may be singular.
    B : numpy.ndarray, shape (n, n_inputs)
        Input distribution.
    Cq, Cv : numpy.ndarray, shape (n_outputs, n)
        Output rows on displacement and velocity.
    D : numpy.ndarray, shape (n_outputs, n_inputs)
        Feedthrough.
    coordinates, inputs, outputs : tuple of str
        Names, legal for python-control.
    name : str
        Name of the machine.
    parts : mapping of str to PartMatrices
        Each part's share of K and M; empty where unknown.
    certificate : Certificate, optional
        What `linearize` checked; absent in models made from matrices.
    place : Place, optional
        The machine; absent in models made from matrices.
    """

    M: sp.csc_matrix
    C: sp.csc_matrix
    K: sp.csc_matrix
    B: np.ndarray
    Cq: np.ndarray
    Cv: np.ndarray
    D: np.ndarray
    coordinates: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    name: str = "linear"
    parts: Mapping[str, PartMatrices] = field(default_factory=dict)
    certificate: Certificate | None = None
    place: Place | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        for kind in ("coordinates", "inputs", "outputs"):
            names = getattr(self, kind)
            if len(set(names)) < len(names):
                twice = sorted(name for name, count in Counter(names).items() if count > 1)
                raise LinearizationError(
                    f"{kind} name {', '.join(map(repr, twice))} more than once; give each its own name"
                )
        n, m, p = len(self.coordinates), len(self.inputs), len(self.outputs)
        shapes = {"M": (n, n), "C": (n, n), "K": (n, n), "B": (n, m), "Cq": (p, n), "Cv": (p, n), "D": (p, m)}
        for name, shape in shapes.items():
            _check_matrix(name, getattr(self, name), shape)

    def __str__(self) -> str:
        signals = f"{', '.join(self.inputs) or 'nothing'} → {', '.join(self.outputs) or 'nothing'}"
        size = f"{self.name}: {len(self.coordinates)} degrees of freedom, {signals}"
        return f"{size}\n{self.certificate}" if self.certificate else size

    # -- views and transformations

    def select(self, inputs: Sequence[str] | None = None, outputs: Sequence[str] | None = None) -> LinearModel:
        """The same dynamics seen through some of the signals only.

        Parameters
        ----------
        inputs, outputs : sequence of str, optional
            Names to keep, in the order wanted; all of them if left out.

        Returns
        -------
        LinearModel

        Raises
        ------
        StructureError
            For a name that is not a signal of this model.
        """
        u = _indices(self.inputs if inputs is None else inputs, self.inputs, "input")
        y = _indices(self.outputs if outputs is None else outputs, self.outputs, "output")
        kept = tuple(self.inputs[i] for i in u)
        return replace(
            self,
            B=self.B[:, u],
            Cq=self.Cq[y],
            Cv=self.Cv[y],
            D=self.D[np.ix_(y, u)],
            inputs=kept,
            outputs=tuple(self.outputs[i] for i in y),
            certificate=self.certificate and self.certificate.heard(kept),
        )

    def projected(
        self,
        basis: np.ndarray | sp.spmatrix,
        coordinates: Sequence[str],
        left: np.ndarray | sp.spmatrix | None = None,
    ) -> LinearModel:
        """Galerkin projection q = T b: Tᵀ M T, …; names of signals and parts are kept.

        Parameters
        ----------
        basis : array or sparse matrix, shape (n, k)
            Columns T.
        coordinates : sequence of k str
            Names of the new coordinates b.
        left : array or sparse matrix, shape (n, k), optional
            Test functions, if they are not T (Petrov–Galerkin).

        Returns
        -------
        LinearModel
        """
        T = sp.csc_matrix(basis)
        L = (T if left is None else sp.csc_matrix(left)).T

        def congruent(A: sp.csc_matrix) -> sp.csc_matrix:
            return sp.csc_matrix(L @ A @ T)

        return replace(
            self,
            M=congruent(self.M),
            C=congruent(self.C),
            K=congruent(self.K),
            B=L @ self.B,
            Cq=(T.T @ self.Cq.T).T,
            Cv=(T.T @ self.Cv.T).T,
            coordinates=tuple(coordinates),
            parts=projected_parts(self.parts, T),
            place=self.place and self.place.projected(T),
        )

    def _rescaled(self, scales: np.ndarray, M: sp.csc_matrix, C: sp.csc_matrix, K: sp.csc_matrix) -> LinearModel:
        """In scaled coordinates, with matrices that are scaled already; not checked again. No parts and no place."""
        result = object.__new__(LinearModel)
        signals = {"B": scales[:, None] * self.B, "Cq": self.Cq * scales, "Cv": self.Cv * scales, "D": self.D}
        names = {name: getattr(self, name) for name in ("coordinates", "inputs", "outputs", "name", "certificate")}
        result.__dict__.update(M=M, C=C, K=K, parts={}, place=None, **signals, **names)
        return result

    # -- analysis

    def audit(self) -> Audit:
        """Label every coordinate dynamic, static (massless but stiff), relaxing or mechanism.

        See :func:`flexctrl.linear.condense.audit`.
        """
        from flexctrl.linear.condense import audit

        return audit(self)

    def condense(self) -> LinearModel:
        """Eliminate the massless, undamped freedoms exactly; see :func:`flexctrl.linear.condense.condense`."""
        from flexctrl.linear.condense import condense

        return condense(self)

    def modes(self, count: int | None = None) -> Modes:
        """Undamped modes, lowest first; see :func:`flexctrl.linear.undamped.modes`.

        Parameters
        ----------
        count : int, optional
            How many; left out: all of them up to 1000 coordinates, the 20 lowest beyond.
        """
        from flexctrl.linear.undamped import modes

        return modes(self, count)

    def damped_poles(self, count: int | None = None) -> np.ndarray:
        """Roots s of det(s² M + s C + K) = 0; see :func:`flexctrl.linear.poles.damped_poles`."""
        from flexctrl.linear.poles import damped_poles

        return damped_poles(self, count)

    def frequency_response(
        self, omega: np.ndarray | Sequence[float] | None = None, span: tuple[float, float] | None = None
    ) -> FrequencyResponse:
        """Response y(iω)/u(iω); see :func:`flexctrl.linear.response.frequency_response`.

        Parameters
        ----------
        omega : array_like, optional
            Angular frequencies, rad/s; left out: an adaptive grid with every peak and anti-resonance.
        span : tuple of two floats, optional
            Limits of the adaptive grid, rad/s.
        """
        from flexctrl.linear.response import frequency_response

        return frequency_response(self, omega, span)

    def reduce(self, to: Method | RelativeError, using: Callable[[int], Method] | None = None) -> Reduced:
        """Fewer coordinates, same signals; see :func:`flexctrl.linear.reduction.reduce`.

        Parameters
        ----------
        to : Method or RelativeError
            ``ModalTruncation``, ``CraigBampton``, ``BalancedTruncation``, ``MomentMatching``, or an error.
        using : callable, optional
            For an error: the method as a function of its order; ``ModalTruncation`` if left out.
        """
        from flexctrl.linear.reduction import ModalTruncation, reduce

        return reduce(self, to, using or ModalTruncation)

    def plot(self) -> Figure:
        """Draw the poles and the frequency response of every channel.

        Returns
        -------
        matplotlib.figure.Figure
        """
        from flexctrl.plots.frequency import linear_figure

        return linear_figure(self)

    # -- export

    def to_ss(self, form: Form | None = None, modes: Modes | None = None) -> control.StateSpace:
        """First-order model for python-control; see :func:`flexctrl.linear.statespace.to_ss`.

        Parameters
        ----------
        form : Form, optional
            ``ModalForm()`` (default) or ``PhysicalForm()``.
        modes : Modes, optional
            Keep these modes only (modal form).
        """
        from flexctrl.linear.statespace import to_ss

        return to_ss(self, form, modes)

    def discretize(self, dt: float, hold: Hold | None = None) -> control.StateSpace:
        """Exact sampled model; see :func:`flexctrl.linear.discrete.discretize`.

        Parameters
        ----------
        dt : float
            Sampling time, s.
        hold : Hold, optional
            ``ZeroOrderHold(delay=…)`` (default) or ``FirstOrderHold(delay=…)``.
        """
        from flexctrl.linear.discrete import discretize

        return discretize(self, dt, hold)

    def save_mat(self, path: str | Path, units: Units | None = None) -> None:
        """Write a MATLAB/Scilab file; see :func:`flexctrl.linear.matfile.save_mat`.

        Parameters
        ----------
        path : str or pathlib.Path
        units : Units, optional
            Default: SI.
        """
        from flexctrl.linear.matfile import SI, save_mat

        save_mat(self, path, units or SI)

    @classmethod
    def load_mat(cls, path: str | Path) -> LinearModel:
        """Read what :meth:`save_mat` wrote."""
        from flexctrl.linear.matfile import load_mat

        return load_mat(path)

    @cached_property
    def _scaled(self) -> Scaled:
        from flexctrl.linear.condense import scaled_any

        return scaled_any(self)

    @cached_property
    def _every_mode(self) -> Modes:
        from flexctrl.linear.condense import scaled
        from flexctrl.linear.undamped import modes_of

        return modes_of(self, scaled(self), None)

    def certified(self, certificate: Certificate) -> LinearModel:
        """Return the model with a certificate; scales and modes that have been worked out are kept.

        Parameters
        ----------
        certificate : Certificate

        Returns
        -------
        LinearModel
        """
        known: dict[str, Any] = {
            name: self.__dict__[name] for name in ("_scaled", "_every_mode") if name in self.__dict__
        }
        result = replace(self, certificate=certificate)
        result.__dict__.update(known)
        return result

    @cached_property
    def _modal(self) -> ModalSystem:
        from flexctrl.linear.modal import modal_system

        return modal_system(self)

    @cached_property
    def _coupled(self) -> Callable[[np.ndarray], np.ndarray]:
        from flexctrl.linear.coupled import coupled_transfer
        from flexctrl.linear.dashpots import dashpots_of
        from flexctrl.linear.refined import modal_state, refined_transfer, refinement

        system = self._modal
        if self._scaled.massless.every.shape[1]:
            return coupled_transfer(system)
        dashpots = dashpots_of(self, system)
        plain = cache(lambda: coupled_transfer(system))
        fine = refinement(self, system, modal_state(system) if dashpots is None else dashpots.state, plain)
        rough = plain() if dashpots is None else dashpots.transfer(plain, fine)
        return rough if fine is None else refined_transfer(system, rough, fine)


def _check_matrix(name: str, value: np.ndarray | sp.spmatrix, shape: tuple[int, int]) -> None:
    if value.shape != shape:
        raise LinearizationError(f"{name} has shape {value.shape}; the names ask for {shape}")
    data = value if isinstance(value, np.ndarray) else value.data
    if data.dtype.kind == "c":
        raise LinearizationError(f"{name} is complex; expected real numbers")
    if not np.isfinite(data).all():
        raise LinearizationError(f"{name} holds a value that is not finite; check the parameters it came from")


def _indices(wanted: Sequence[str], known: tuple[str, ...], kind: str) -> list[int]:
    if isinstance(wanted, str):
        raise StructureError(f"{kind}s = {wanted!r}; expected a list, [{wanted!r}]")
    for name in (wanted := listed(wanted, f"{kind}s")):
        if name not in known:
            raise StructureError(f"{kind} {name!r} is not a signal of this model{did_you_mean(name, known)}")
    return [known.index(name) for name in wanted]
