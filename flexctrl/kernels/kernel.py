"""One piece of physics run over index tables: ``r[scatter] += kernel(z[gather], params)``.

A structure is the same small function many times over. The function is written once in casadi SX;
the tables say which entries of the state vector z each item reads and where in r its result adds up.
Two backends give the same numbers to round-off: casadi's virtual machine, always there, and machine
code through LLVM (the extra ``fast``).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import field
from functools import cached_property
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from flexctrl.errors import KernelError, MissingExtraError
from flexctrl.frozen import frozen

if TYPE_CHECKING:
    import casadi as ca

    from flexctrl.kernels.llvm import CompiledRun

FLOAT = np.dtype(np.float64)
_INDEX_LIMIT = 2**31
_LARGE = 6000
_FEW, _MANY = 64, 1000
_OLDEST_LLVMLITE = (0, 45)


@frozen(eq=False)
class Kernel:
    """The physics of one item as a casadi expression.

    Attributes
    ----------
    name : str
        An identifier; used in messages only.
    inputs : casadi.SX, n_in × 1
        Symbols read from the state vector.
    params : casadi.SX, n_par × 1
        Symbols that belong to the item.
    outputs : casadi.SX, n_out × 1
        Expressions of both; structural zeros are allowed.
    replaces : bool
        Whether outputs replace what is in r, where no two items may write to one place, rather than being added to it.
    seldom : bool
        Whether little time is spent in it: for few items it is compiled in a hurry, without optimisation.

    Raises
    ------
    KernelError
        If a field is not a column, inputs or params are not symbols, or outputs need other symbols.
    """

    name: str
    inputs: ca.SX
    params: ca.SX
    outputs: ca.SX
    replaces: bool = False
    seldom: bool = False

    def __post_init__(self) -> None:
        if not self.name.isidentifier():
            raise KernelError(f"kernel name {self.name!r} is not an identifier")
        for label in ("inputs", "params", "outputs"):
            shape = getattr(self, label).shape
            if shape[1] != 1:
                raise KernelError(f"kernel {self.name!r}: {label} has shape {shape}, expected a column (n, 1)")
        self._check_symbols()
        free = self.function().get_free()
        if free:
            raise KernelError(f"kernel {self.name!r}: outputs use {', '.join(free)}, neither among inputs nor params")

    def _check_symbols(self) -> None:
        import casadi as ca

        for label in ("inputs", "params"):
            if not getattr(self, label).is_valid_input():
                raise KernelError(f"kernel {self.name!r}: {label} holds expressions, expected casadi symbols only")
        given, distinct = self.n_in + self.n_par, len(ca.symvar(ca.vertcat(self.inputs, self.params)))
        if distinct != given:
            raise KernelError(
                f"kernel {self.name!r}: {given} inputs and params are {distinct} different symbols; "
                "each must be a symbol of its own"
            )

    @cached_property
    def _function(self) -> ca.Function:
        import casadi as ca

        io = self.name, [self.inputs, self.params], [ca.densify(self.outputs)]
        plain = ca.Function(*io, {"allow_free": True})
        # in large ones, looking for what is common takes long and finds little
        return plain if plain.n_instructions() > _LARGE else ca.Function(*io, {"cse": True, "allow_free": True})

    def function(self) -> ca.Function:
        """Return the casadi function (inputs, params) → outputs, dense; built once."""
        return self._function

    @property
    def instructions(self) -> int:
        """Number of instructions of casadi's virtual machine, loads and stores included."""
        return self._function.n_instructions()

    @property
    def n_in(self) -> int:
        """Entries of z an item reads."""
        return self.inputs.shape[0]

    @property
    def n_par(self) -> int:
        """Parameters of an item."""
        return self.params.shape[0]

    @property
    def n_out(self) -> int:
        """Values an item adds into r."""
        return self.outputs.shape[0]


@frozen(eq=False)
class Tables:
    """Checked private copies of the index tables of a batch.

    Attributes
    ----------
    gather : ndarray of int32, (n, n_in)
    scatter : ndarray of int32, (n, n_out)
    z_size, r_size : int
        Least lengths of z and r that no index leaves.
    """

    gather: np.ndarray
    scatter: np.ndarray
    z_size: int
    r_size: int

    @classmethod
    def of(cls, kernel: Kernel, gather: np.ndarray, scatter: np.ndarray) -> Tables:
        """Check tables against a kernel and copy them.

        Raises
        ------
        KernelError
            If a shape does not fit the kernel, or an index is negative or no integer.
        """
        n = len(np.atleast_1d(gather))
        reads = _index_table(kernel, "gather", gather, (n, kernel.n_in))
        writes = _index_table(kernel, "scatter", scatter, (n, kernel.n_out))
        return cls(reads, writes, int(reads.max(initial=-1)) + 1, int(writes.max(initial=-1)) + 1)

    def check(self, z: np.ndarray, r: np.ndarray) -> None:
        """Refuse vectors that are too short, not float64 or not contiguous."""
        _check_vector(z, self.z_size, "z")
        _check_vector(r, self.r_size, "r")
        if not r.flags.writeable:
            raise KernelError("r is read-only, and results are added into it")


def parameter_table(kernel: Kernel, params: np.ndarray, n: int) -> np.ndarray:
    """Return ``params`` as float64 in C order, refused unless of shape (n, n_par)."""
    values = np.ascontiguousarray(params, dtype=FLOAT)
    if values.shape != (n, kernel.n_par):
        raise KernelError(
            f"kernel {kernel.name!r}: params has shape {values.shape}, expected {(n, kernel.n_par)} (items, n_par)"
        )
    return values


def _index_table(kernel: Kernel, label: str, table: np.ndarray, shape: tuple[int, int]) -> np.ndarray:
    table = np.asarray(table)
    name = f"kernel {kernel.name!r}: {label}"
    if table.shape != shape:
        raise KernelError(f"{name} has shape {table.shape}, expected {shape} (items, entries of the kernel)")
    if table.size == 0:
        return np.zeros(shape, np.int32)
    if not np.issubdtype(table.dtype, np.integer):
        raise KernelError(f"{name} has type {table.dtype}, expected integers")
    bad = (table < 0) | (table >= _INDEX_LIMIT)
    if bad.any():
        item, entry = np.argwhere(bad)[0]
        raise KernelError(
            f"{name}[{item}, {entry}] is {table[item, entry]}, expected 0 to 2³¹ − 1; "
            "a freedom that is held needs a dummy slot of its own at the end of the vector"
        )
    return np.array(table, dtype=np.int32, order="C")


def _check_vector(array: np.ndarray, size: int, label: str) -> None:
    if array.dtype != FLOAT or not array.flags.c_contiguous:
        raise KernelError(
            f"{label} is {array.dtype}{'' if array.flags.c_contiguous else ', not contiguous'}; "
            "expected a contiguous float64 vector, see numpy.ascontiguousarray"
        )
    if array.size < size:
        raise KernelError(f"{label} has {array.size} entries, the index table needs at least {size}")


class Run(Protocol):
    """A kernel bound to tables by a backend. z and r must not overlap; see the backend for threads."""

    def __call__(self, z: np.ndarray, r: np.ndarray) -> None:
        """Add the outputs of all items into r."""

    def with_params(self, params: np.ndarray) -> Run:
        """Return the same run with other parameters; index tables and code are shared."""

    def fixed(self, z: np.ndarray, r: np.ndarray) -> Callable[[], Any]:
        """Return the run on these two arrays, checked once; it keeps them alive and sees what is written to them."""

    def parts(self, ends: Sequence[int] | np.ndarray) -> tuple[Run, ...]:
        """Return runs of its items up to each of these numbers, the last of all that are left; tables are shared.

        Items that are computed at once stay together: such a part ends earlier.
        """


class Backend(Protocol):
    """How kernels are run."""

    def bind(self, kernel: Kernel, gather: np.ndarray, params: np.ndarray, scatter: np.ndarray) -> Run:
        """Check the tables and return the run over them."""


@frozen
class CasadiVM:
    """casadi's virtual machine: needs nothing else. A bound run has work arrays, so one thread at a time."""

    def bind(self, kernel: Kernel, gather: np.ndarray, params: np.ndarray, scatter: np.ndarray) -> Run:
        """Check the tables and return the run over them; raises KernelError."""
        from flexctrl.kernels.vm import VMRun

        return VMRun.of(kernel, Tables.of(kernel, gather, scatter), params)


def can_compile() -> bool:
    """Return whether llvmlite is installed, which makes machine code."""
    try:
        import llvmlite
    except ImportError:
        return False
    return tuple(map(int, llvmlite.__version__.split(".")[:2])) >= _OLDEST_LLVMLITE


@frozen
class Compiled:
    """Machine code through LLVM, several items at a time; bound runs may be called from several threads.

    Attributes
    ----------
    lanes : int
        Items computed at once: 1, 2, 4 or 8; 0 for what suits the processor and the number of items.
    optimize_up_to : int
        Kernels of more instructions are compiled without optimisation for fewer than a thousand items: many times
        faster to compile, up to 1.8 times slower to run.

    Raises
    ------
    MissingExtraError
        If llvmlite is not installed.
    """

    lanes: int = 0
    optimize_up_to: int = _LARGE

    def __post_init__(self) -> None:
        if not can_compile():
            oldest = ".".join(map(str, _OLDEST_LLVMLITE))
            raise MissingExtraError(
                f"compiled kernels need llvmlite {oldest} or later: pip install flexctrl[fast], or use CasadiVM()"
            )
        if self.lanes not in (0, 1, 2, 4, 8):
            raise KernelError(f"lanes is {self.lanes}, expected 1, 2, 4, 8, or 0 to leave the choice")

    def bind(self, kernel: Kernel, gather: np.ndarray, params: np.ndarray, scatter: np.ndarray) -> CompiledRun:
        """Check the tables, compile the kernel unless this process has done so, and return the run.

        Raises
        ------
        KernelError
            If a table does not fit, or the kernel has an operation that cannot be compiled.
        """
        from flexctrl.kernels.llvm import CompiledRun, best_lanes, compile_kernel
        from flexctrl.kernels.llvm_ir import chunks_of

        tables = Tables.of(kernel, gather, scatter)
        lanes = self.lanes or best_lanes(len(tables.gather))
        hurried = kernel.seldom and len(tables.gather) <= _FEW
        long = kernel.instructions > self.optimize_up_to and len(tables.gather) < _MANY
        level = 0 if hurried or long else 2
        chunks = chunks_of(tables.gather, lanes), chunks_of(tables.scatter, lanes) if kernel.replaces else ()
        return CompiledRun.of(kernel, compile_kernel(kernel, lanes, level, *chunks), tables, params)


def best_backend() -> Backend:
    """Return `Compiled` if llvmlite is installed, else `CasadiVM`."""
    return Compiled() if can_compile() else CasadiVM()


@frozen(eq=False)
class Batch:
    """A kernel with the tables of its items.

    Values common to all items that change in every step (a step length, say) are best kept in z and
    gathered by every item: they cost nothing to change.

    Attributes
    ----------
    kernel : Kernel
    gather : ndarray of int, (n, n_in)
        Entries of z each item reads.
    params : ndarray of float, (n, n_par)
    scatter : ndarray of int, (n, n_out)
        Entries of r each item adds to; repeats add up, in the order of the items. Results for held
        freedoms go to a dummy slot, by convention the last entry of r.
    backend : Backend
        By default the best there is.
    """

    kernel: Kernel
    gather: np.ndarray
    params: np.ndarray
    scatter: np.ndarray
    backend: Backend = field(default_factory=best_backend)

    @cached_property
    def run(self) -> Run:
        """The bound run; made when first asked for."""
        return self.backend.bind(self.kernel, self.gather, self.params, self.scatter)

    def with_params(self, params: np.ndarray) -> Batch:
        """Return the batch with other parameters, (n, n_par); code and index tables are shared."""
        other = Batch(self.kernel, self.gather, params, self.scatter, self.backend)
        other.__dict__["run"] = self.run.with_params(params)  # seeds the cached property
        return other
