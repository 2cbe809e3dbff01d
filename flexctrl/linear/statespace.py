"""First-order models for python-control, in forms that its routines stay accurate on."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp

from flexctrl.errors import LinearizationError, StructureError
from flexctrl.frozen import frozen
from flexctrl.linear.condense import condense
from flexctrl.linear.modal import ModalSystem, modal_system, proper
from flexctrl.linear.model import LinearModel
from flexctrl.linear.modes import Modes

if TYPE_CHECKING:
    import control

__all__ = ["FirstOrder", "Form", "ModalForm", "PhysicalForm", "first_order", "to_ss"]


@frozen
class ModalForm:
    """Real modal blocks in energy coordinates (ω η, η̇): xᵀx/2 is the energy of a flexible mode.

    A rigid-body mode is the exact double integrator (η, η̇), a growing mode (g η, η̇) with ω² = -g².
    """


@frozen
class PhysicalForm:
    """[q, q̇] in the coordinates kept by condensation.

    For state feedback on physical coordinates; accurate only for small models. The double poles at 0 of rigid-body
    motion come out at ± the root of rounding, 1e-5 … 1e-3 rad/s for a steel frame, some of them on the unstable side:
    no form in coordinates that hold both rigid and elastic motion can say 0 in floating point. An eigenvalue solver
    answers for a matrix ε‖A‖ away (N. J. Higham, Accuracy and Stability, 2002, § 1.18), and a double zero moves by the
    root of that: about √ε ω_max, however the states are scaled and even where A times the rigid motion is 0 to the
    last bit. Free chains of 5 to 60 equal masses with such an A give 1e-5 rad/s for ω_max = 2·10³ and 1e-3 for
    2.6·10⁵, scaled or not. `ModalForm` (the default) separates these poles exactly.
    """


Form = ModalForm | PhysicalForm


@frozen(eq=False)
class FirstOrder:
    """ẋ = A x + B u, y = C x + D u.

    Attributes
    ----------
    A, B, C, D : numpy.ndarray
    states : tuple of str
    blocks : tuple of slice
        Diagonal blocks of A that nothing couples.
    """

    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    D: np.ndarray
    states: tuple[str, ...]
    blocks: tuple[slice, ...]


def to_ss(linear: LinearModel, form: Form | None = None, modes: Modes | None = None) -> control.StateSpace:
    """State space with the names of inputs, outputs and states.

    Massless freedoms are condensed exactly (they may give feedthrough), massless but damped ones are
    first-order states, dampers that couple modes appear as a full damping block.

    Parameters
    ----------
    linear : LinearModel
    form : Form, optional
        ``ModalForm()`` if left out.
    modes : Modes, optional
        Keep these modes only, without correction for the others; modal form only.

    Returns
    -------
    control.StateSpace

    Raises
    ------
    LinearizationError
        If a velocity output sees the derivative of an input through a massless freedom, or modes are given
        for the physical form.
    """
    import control

    if form is not None and not isinstance(form, ModalForm | PhysicalForm):
        raise StructureError(f"to_ss: form = {form!r}; expected ModalForm() or PhysicalForm()")
    first = _physical(linear, modes) if isinstance(form, PhysicalForm) else modal_first_order(linear, modes)
    return control.ss(
        first.A,
        first.B,
        first.C,
        first.D,
        inputs=list(linear.inputs),
        outputs=list(linear.outputs),
        states=list(first.states),
        name=linear.name,
    )


def modal_first_order(linear: LinearModel, modes: Modes | None = None) -> FirstOrder:
    """The modal form as plain matrices.

    Parameters
    ----------
    linear : LinearModel
    modes : Modes, optional

    Returns
    -------
    FirstOrder
    """
    system = linear._modal if modes is None else modal_system(linear, modes)
    return first_order(proper(system, linear))


def first_order(system: ModalSystem) -> FirstOrder:
    """Blocks (ω η, η̇) mode by mode, then the relaxing states.

    Parameters
    ----------
    system : ModalSystem
        Proper.

    Returns
    -------
    FirstOrder
    """
    modes, relax = system.modes, system.relaxation
    k, d = len(modes), relax.rates.size
    size = np.sqrt(np.abs(modes.omega_squared))
    rate = np.where(size > 0, size, 1.0)
    q, v, a = np.arange(0, 2 * k, 2), np.arange(1, 2 * k, 2), np.arange(2 * k, 2 * k + d)
    A = np.zeros((2 * k + d, 2 * k + d))
    A[q, v] = rate
    A[v, q] = 0.0 - modes.omega_squared / rate
    A[np.ix_(v, q)] -= system.circulatory / rate
    A[np.ix_(v, v)] = relax.reaction @ relax.drag - system.damping
    A[np.ix_(v, a)] = relax.reaction * relax.rates
    A[np.ix_(a, v)] = -relax.drag
    A[a, a] = -relax.rates
    B = np.zeros((2 * k + d, modes.input_gain.shape[1]))
    B[v] = modes.input_gain - relax.reaction @ relax.input
    B[a] = relax.input
    C = np.zeros((modes.output_gain.shape[0], 2 * k + d))
    C[:, q] = modes.output_gain / rate
    C[:, v] = modes.output_rate_gain - relax.output_rate @ relax.drag
    C[:, a] = relax.output - relax.output_rate * relax.rates
    D = system.feedthrough + relax.output_rate @ relax.input
    return FirstOrder(A, B, C, D, _state_names(modes, d), _blocks(system, 2 * k, d))


def _blocks(system: ModalSystem, pairs: int, singles: int) -> tuple[slice, ...]:
    if not system.classical:
        return (slice(0, pairs + singles),)
    return tuple(slice(i, i + 2) for i in range(0, pairs, 2)) + tuple(
        slice(i, i + 1) for i in range(pairs, pairs + singles)
    )


def _state_names(modes: Modes, relaxing: int) -> tuple[str, ...]:
    names: list[str] = []
    for i, kind in enumerate(modes.kinds):
        word = "mode" if kind == "flexible" else kind
        names += [f"{word}{i + 1}_q", f"{word}{i + 1}_v"]
    return (*names, *(f"relaxing{i + 1}" for i in range(relaxing)))


def _physical(linear: LinearModel, modes: Modes | None) -> FirstOrder:
    if modes is not None:
        raise LinearizationError("modes can be chosen in the modal form only: to_ss(ModalForm(), modes=…)")
    model = condense(linear)
    M, C, K = (np.asarray(sp.csc_matrix(A).toarray()) for A in (model.M, model.C, model.K))
    n = len(M)
    try:
        inverse = la.cho_factor(M)
    except la.LinAlgError as error:
        raise LinearizationError(
            "the mass matrix is singular (massless but damped freedoms): use ModalForm()"
        ) from error
    A = np.block([[np.zeros((n, n)), np.eye(n)], [-la.cho_solve(inverse, K), -la.cho_solve(inverse, C)]])
    B = np.vstack([np.zeros_like(model.B), la.cho_solve(inverse, model.B)])
    names = (*model.coordinates, *(f"{name}_rate" for name in model.coordinates))
    return FirstOrder(A, B, np.hstack([model.Cq, model.Cv]), model.D, names, (slice(0, 2 * n),))
