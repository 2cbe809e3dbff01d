"""Inputs on the way of many steps."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from flexctrl.frozen import frozen

__all__ = ["Inputs", "Stepwise"]


class Inputs(Protocol):
    """Inputs in force over many steps."""

    def at(self, steps: np.ndarray, ends: np.ndarray, rows: np.ndarray) -> np.ndarray:
        """Return the inputs of rows, shape (n, inputs).

        Parameters
        ----------
        steps : numpy.ndarray of int, shape (n,)
            In which step each is.
        ends : numpy.ndarray of bool, shape (n,)
            Which are at its end.
        rows : numpy.ndarray, shape (n, 1 + outputs)
            Time and outputs.
        """


@frozen(eq=False)
class Stepwise:
    """Inputs that are constant over each step.

    Attributes
    ----------
    table : numpy.ndarray, shape (steps + 1, inputs)
        In force over each step, and after the last one.
    """

    table: np.ndarray

    def at(self, steps: np.ndarray, ends: np.ndarray, rows: np.ndarray) -> np.ndarray:
        """Return the inputs of rows, shape (n, inputs); those at the end of a step are in force from there on."""
        found: np.ndarray = self.table[steps + ends]
        return found
