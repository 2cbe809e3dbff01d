"""Kernels by casadi's virtual machine: one mapped function for all items, numpy for the tables."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cached_property, partial
from typing import Any

import numpy as np

from flexctrl.frozen import frozen
from flexctrl.kernels.kernel import Kernel, Tables, parameter_table


@frozen(eq=False)
class VMRun:
    """A kernel bound to tables, run by casadi; see `flexctrl.kernels.kernel.Run`.

    Attributes
    ----------
    kernel : Kernel
    tables : Tables
    gather : ndarray of intp, (n, n_in)
    scatter : ndarray of intp, (n · n_out,)
    params : ndarray, (n, n_par)
    """

    kernel: Kernel
    tables: Tables
    gather: np.ndarray
    scatter: np.ndarray
    params: np.ndarray

    @classmethod
    def of(cls, kernel: Kernel, tables: Tables, params: np.ndarray) -> VMRun:
        """Copy the tables as numpy indexes best."""
        values = parameter_table(kernel, params, len(tables.gather)).copy()
        return cls(kernel, tables, tables.gather.astype(np.intp), tables.scatter.astype(np.intp).ravel(), values)

    def __call__(self, z: np.ndarray, r: np.ndarray) -> None:
        """Add the outputs of all items into r."""
        self.tables.check(z, r)
        self._add(z.reshape(-1), r.reshape(-1))

    def with_params(self, params: np.ndarray) -> VMRun:
        """Return the same run with other parameters, (n, n_par)."""
        return replace(self, params=parameter_table(self.kernel, params, len(self.gather)).copy())

    def parts(self, ends: Sequence[int] | np.ndarray) -> tuple[VMRun, ...]:
        """Return runs of its items up to each of these numbers, the last of all that are left."""
        bounds = [0, *ends[:-1], len(self.gather)]
        return tuple(self._part(a, b) for a, b in itertools.pairwise(bounds))

    def _part(self, first: int, last: int) -> VMRun:
        table = self.tables
        some = replace(table, gather=table.gather[first:last], scatter=table.scatter[first:last])
        return VMRun.of(self.kernel, some, self.params[first:last])

    def fixed(self, z: np.ndarray, r: np.ndarray) -> Callable[[], Any]:
        """Return the run on these two arrays, checked once; it keeps them alive."""
        self.tables.check(z, r)
        return partial(self._add, z.reshape(-1), r.reshape(-1))

    @cached_property
    def _work(self) -> tuple[np.ndarray, np.ndarray, Callable[[], Any], Any]:
        """Inputs and outputs of all items, the call from one to the other, and what must outlive the call.

        casadi's call knows its buffer by address only: without the last item, Python frees it (segmentation fault).
        """
        # one item is one column for casadi, so its column-major matrices are our row-major tables
        inputs, outputs = np.zeros(self.gather.shape), np.zeros(self.scatter.size)
        if outputs.size == 0:
            return inputs, outputs, tuple, None
        function: Any = self.kernel.function().map(len(inputs))
        buffer, evaluate = function.buffer()
        for i, array in enumerate((inputs, self.params)):
            if array.size:
                buffer.set_arg(i, array.data)
        buffer.set_res(0, outputs.data)
        return inputs, outputs, evaluate, buffer

    def _add(self, z: np.ndarray, r: np.ndarray) -> None:
        inputs, outputs, evaluate, _ = self._work
        if inputs.size:
            z.take(self.gather, out=inputs, mode="clip")  # in range already; "raise" would copy
        evaluate()
        if self.kernel.replaces:
            r[self.scatter] = outputs
        else:
            np.add.at(r, self.scatter, outputs)
