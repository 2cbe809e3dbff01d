"""Kernels in extended precision (80 bits where the processor has them): for what double precision drowns."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from flexctrl.errors import KernelError
from flexctrl.kernels.kernel import Kernel

__all__ = ["EXTENDED", "evaluate"]

EXTENDED = np.longdouble
_BINARY: dict[str, Callable[..., Any]] = {
    "ADD": np.add,
    "SUB": np.subtract,
    "MUL": np.multiply,
    "DIV": np.divide,
    "LT": np.less,
    "LE": np.less_equal,
    "EQ": np.equal,
    "NE": np.not_equal,
    "AND": np.logical_and,
    "OR": np.logical_or,
    "FMIN": np.fmin,
    "FMAX": np.fmax,
    "ATAN2": np.arctan2,
    "POW": np.power,
    "CONSTPOW": np.power,
    "IF_ELSE_ZERO": lambda condition, value: np.where(condition != 0, value, 0),
}
_UNARY: dict[str, Callable[..., Any]] = {
    "ASSIGN": np.positive,
    "NEG": np.negative,
    "SQ": np.square,
    "TWICE": lambda x: x + x,
    "INV": np.reciprocal,
    "SQRT": np.sqrt,
    "SIN": np.sin,
    "COS": np.cos,
    "TAN": np.tan,
    "ATAN": np.arctan,
    "ASIN": np.arcsin,
    "ACOS": np.arccos,
    "TANH": np.tanh,
    "EXP": np.exp,
    "LOG": np.log,
    "FABS": np.abs,
    "SIGN": np.sign,
    "NOT": np.logical_not,
}


def evaluate(kernel: Kernel, z: np.ndarray, params: np.ndarray) -> np.ndarray:
    """Return the outputs of all items, every operation rounded to extended precision.

    Parameters
    ----------
    kernel : Kernel
    z : numpy.ndarray, shape (items, n_in)
        What each item reads.
    params : numpy.ndarray, shape (items, n_par)

    Returns
    -------
    numpy.ndarray of longdouble, shape (items, n_out)

    Raises
    ------
    KernelError
        If the kernel has an operation that is not known here.
    """
    f, inputs = kernel.function(), (np.asarray(z, EXTENDED), np.asarray(params, EXTENDED))
    out = np.zeros((len(z), kernel.n_out), EXTENDED)
    work: dict[int, Any] = {}
    for k in range(f.n_instructions()):
        _step(f, k, inputs, work, out)
    return out


def _step(f: Any, k: int, inputs: tuple[np.ndarray, ...], work: dict[int, Any], out: np.ndarray) -> None:
    import casadi as ca

    code, to, of = f.instruction_id(k), f.instruction_output(k), f.instruction_input(k)
    if code == ca.OP_CONST:
        work[to[0]] = EXTENDED(f.instruction_constant(k))
    elif code == ca.OP_INPUT:
        work[to[0]] = inputs[of[0]][:, of[1]]
    elif code == ca.OP_OUTPUT:
        out[:, to[1]] = work[of[0]]
    else:
        result = _operation(code)(*(work[i] for i in of))
        work[to[0]] = result.astype(EXTENDED) if result.dtype == bool else result


def _operation(code: int) -> Callable[..., Any]:
    import casadi as ca

    for table in (_BINARY, _UNARY):
        for name, operation in table.items():
            if getattr(ca, f"OP_{name}", None) == code:
                return operation
    raise KernelError(f"operation {code} of casadi is not known in extended precision")
