"""Kernels as machine code: compiled with llvmlite, called through ctypes.

The code of a kernel is ``void run(const int64 *tables, const double *z, double *r)`` with
``tables`` = {number of items, address of gather (int32), of the parameters, of scatter (int32), of the places of
each block's parameters (int64)}, and ``void call(const int64 *frame)`` with ``frame`` = {tables, z, r}. It keeps
no state: threads may share it. Parameters are stored by blocks of items, lane next to lane: (n_par, lanes) each, and
once where blocks have the same; so is gather: (blocks, chunks and single entries, lanes).
"""

from __future__ import annotations

import ctypes
import itertools
import sys
import threading
from collections.abc import Callable, Sequence
from ctypes import addressof
from dataclasses import replace
from functools import cache, cached_property, partial
from typing import Any, ClassVar
from weakref import WeakKeyDictionary

import llvmlite
import llvmlite.binding as binding
import numpy as np

from flexctrl.frozen import frozen
from flexctrl.kernels.kernel import FLOAT, Kernel, Tables, parameter_table
from flexctrl.kernels.llvm_cache import stored
from flexctrl.kernels.llvm_ir import LIBRARY, row_order, translate

_lock = threading.Lock()
_codes: dict[str, Code] = {}
_numbers = itertools.count()
_PASSES = (
    *("always_inliner", "sroa", "instruction_combine", "simplify_cfg", "new_gvn", "loop_rotate", "simplify_cfg"),
    "dead_code_elimination",
)
"""What loops need that are written with vectors already: a tenth of the time that LLVM's own choice takes."""
_Chunks = tuple[int, ...]
_known: WeakKeyDictionary[Kernel, dict[tuple[int, int, _Chunks, _Chunks], Code]] = WeakKeyDictionary()
_RUN = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_void_p)
_start: Callable[[Any], ctypes.c_char] = ctypes.c_char.from_buffer
_CALL = ctypes.CFUNCTYPE(None, ctypes.c_void_p)


@frozen(eq=False)
class Code:
    """Machine code in memory.

    Attributes
    ----------
    lanes : int
        Items computed at once.
    chunks, written : tuple of int
        First entries of what it reads and of what it writes as vectors.
    run_address, call_address : int
        Where the two functions start; valid while this object lives.
    library : object
        Owner of the memory.
    """

    lanes: int
    chunks: tuple[int, ...]
    written: tuple[int, ...]
    run_address: int
    call_address: int
    library: object

    @cached_property
    def run(self) -> Callable[..., None]:
        """``run`` for Python."""
        return _RUN(self.run_address)

    @cached_property
    def call(self) -> Callable[..., None]:
        """``call`` for Python."""
        return _CALL(self.call_address)


def best_lanes(n: int) -> int:
    """Return how many items at once are quickest for n items on this processor.

    A block of 8 (AVX-512) takes as long as 1.75 blocks of 4, measured on a beam element: divisions and
    the moves of gathered entries take their time for each item.
    """
    if n == 1:
        return 1
    features = _host_features()
    if features.get("avx512vl") and 1.75 * -(-n // 8) < -(-n // 4):
        return 8
    return 4 if features.get("avx") else 2


def compile_kernel(kernel: Kernel, lanes: int, level: int, chunks: _Chunks = (), written: _Chunks = ()) -> Code:
    """Return the machine code of a kernel, compiled once per process for equal content.

    Parameters
    ----------
    kernel : Kernel
    lanes : int
    level : int
        LLVM's optimisation of the code it generates, 0 to 3.
    chunks, written : tuple of int
        First entries of what is read and written as vectors; see `chunks_of`.

    Raises
    ------
    KernelError
        If an operation of the kernel is not supported.
    """
    with _lock:
        known = _known.setdefault(kernel, {})
        kind = (lanes, level, chunks, written)
        if kind not in known:
            known[kind] = _load(translate(kernel, lanes, chunks, written), *kind)
        return known[kind]


def _load(assembly: str, lanes: int, level: int, chunks: _Chunks, written: _Chunks) -> Code:
    """Link the object code of an assembly text, unless the same text has been."""
    key = f"{level} {chunks} {written} {assembly}"
    if key not in _codes:
        library = link(assembly, level, ("run", "call"))
        _codes[key] = Code(lanes, chunks, written, library["run"], library["call"], library)
    return _codes[key]


def link(assembly: str, level: int, exported: tuple[str, ...], passes: bool = False) -> binding.ResourceTracker:
    """Return a library in memory, compiled from LLVM assembly or taken from the cache.

    Parameters
    ----------
    assembly : str
    level : int
        LLVM's optimisation of the code it generates, 0 to 3.
    exported : tuple of str
        Functions wanted; ``library[name]`` is their address.
    passes : bool
        Whether the assembly is to be simplified first.
    """
    key = "\n".join((_host(), str(level), str(passes), assembly))
    image = stored(key, lambda: _object_code(assembly, level, passes))
    builder = binding.JITLibraryBuilder().add_object_img(image).add_current_process()
    for name, address in _library_addresses().items():
        builder.import_symbol(name, address)
    for name in exported:
        builder.export_symbol(name)
    return builder.link(_linker(), f"library{next(_numbers)}")


def _object_code(assembly: str, level: int, passes: bool) -> bytes:
    module = binding.parse_assembly(assembly)
    machine = _machine(level)
    if passes:
        builder = binding.create_pass_builder(machine, binding.create_pipeline_tuning_options(speed_level=2))
        manager = binding.create_new_module_pass_manager()
        for name in _PASSES:
            getattr(manager, f"add_{name}_pass")()
        manager.run(module, builder)
    return machine.emit_object(module)


@cache
def _linker() -> binding.LLJIT:
    _machine(0)
    return binding.create_lljit_compiler()


@cache
def _machine(level: int) -> binding.TargetMachine:
    binding.initialize_native_target()
    binding.initialize_native_asmprinter()
    return binding.Target.from_default_triple().create_target_machine(
        cpu=binding.get_host_cpu_name(),
        features=_host_features().flatten(),
        opt=level,
        reloc="pic",
        codemodel="small",
    )


@cache
def _host_features() -> binding.FeatureMap:
    return binding.get_host_cpu_features()


@cache
def _host() -> str:
    """Everything but the assembly that machine code depends on."""
    return " ".join(
        (
            *(llvmlite.__version__, ".".join(map(str, binding.llvm_version_info)), binding.get_default_triple()),
            *(binding.get_host_cpu_name(), _host_features().flatten()),
        )
    )


@cache
def _library_addresses() -> dict[str, int]:
    library = ctypes.CDLL("ucrtbase" if sys.platform == "win32" else None)
    found = {name: ctypes.cast(getattr(library, name), ctypes.c_void_p).value for name in LIBRARY}
    return {name: address for name, address in found.items() if address is not None}


@frozen(eq=False)
class CompiledRun:
    """A compiled kernel bound to tables; see `flexctrl.kernels.kernel.Run`.

    Attributes
    ----------
    kernel : Kernel
    code : Code
    tables : Tables
    gather, scatter : ndarray of int32, (blocks, chunks and single entries, lanes) and (n, chunks and single entries)
        What the code reads of the tables.
    blocks, places : ndarray, (different blocks, n_par, lanes) and int64 (blocks,)
        The parameters as the code reads them.
    block : ndarray of int64, (5,)
        The ``tables`` argument of the code.
    """

    kernel: Kernel
    code: Code
    tables: Tables
    gather: np.ndarray
    scatter: np.ndarray
    blocks: np.ndarray
    places: np.ndarray
    block: np.ndarray
    _last: ClassVar[tuple[Any, Any, int, int]] = (None, None, 0, 0)

    @classmethod
    def of(cls, kernel: Kernel, code: Code, tables: Tables, params: np.ndarray) -> CompiledRun:
        """Lay out the tables for the code."""
        n, lanes = len(tables.gather), code.lanes
        order = np.minimum(np.arange(-(-n // lanes) * lanes).reshape(-1, lanes), n - 1)
        gather = _blocked(tables.gather[:, row_order(kernel.n_in, lanes, code.chunks)[0]], order)
        scatter = np.ascontiguousarray(tables.scatter[:, row_order(kernel.n_out, lanes, code.written)[0]])
        blocks, places = _shared(_blocked(parameter_table(kernel, params, n), order))
        block = _block(n, gather, blocks, scatter, places)
        return cls(kernel, code, tables, gather, scatter, blocks, places, block)

    @property
    def address(self) -> int:
        """Address of ``run(tables, z, r)``, for compiled drivers; valid while this object lives."""
        return self.code.run_address

    @cached_property
    def arguments(self) -> int:
        """Address of the ``tables`` argument; valid while this object lives."""
        return self.block.ctypes.data

    @cached_property
    def _run(self) -> Callable[[int, int], None]:
        return partial(self.code.run, ctypes.c_void_p(self.arguments))

    def __call__(self, z: np.ndarray, r: np.ndarray) -> None:
        """Add the outputs of all items into r. The last z and r are kept, so that they are checked once."""
        last_z, last_r, z_address, r_address = self._last
        if z is not last_z or r is not last_r:
            z_address, r_address = self._addresses(z, r)
            self.__dict__["_last"] = z, r, z_address, r_address
        self._run(z_address, r_address)

    def _addresses(self, z: np.ndarray, r: np.ndarray) -> tuple[int, int]:
        tables = self.tables
        if z.dtype == r.dtype == FLOAT and z.size >= tables.z_size and r.size >= tables.r_size:
            try:  # three times quicker than array.ctypes
                return addressof(_start(z)), addressof(_start(r))
            except (TypeError, ValueError):  # not contiguous; or z read-only or empty, which is fine
                pass
        tables.check(z, r)
        return z.ctypes.data, r.ctypes.data

    def with_params(self, params: np.ndarray) -> CompiledRun:
        """Return the same run with other parameters, (n, n_par)."""
        return CompiledRun.of(self.kernel, self.code, self.tables, params)

    def parts(self, ends: Sequence[int] | np.ndarray) -> tuple[CompiledRun, ...]:
        """Return runs of its items up to each of these numbers, whole blocks of them; the last of all that are left."""
        lanes = self.code.lanes
        bounds = [0, *(int(end) // lanes for end in ends[:-1]), len(self.places)]
        return tuple(self._part(a, b) for a, b in itertools.pairwise(bounds))

    def _part(self, first: int, last: int) -> CompiledRun:
        """Blocks of it."""
        known, items = self.tables, slice(first * self.code.lanes, last * self.code.lanes)
        tables = replace(known, gather=known.gather[items], scatter=known.scatter[items])
        gather, scatter, places = self.gather[first:last], self.scatter[items], self.places[first:last]
        block = _block(len(tables.gather), gather, self.blocks, scatter, places)
        return replace(self, tables=tables, gather=gather, scatter=scatter, places=places, block=block)

    def fixed(self, z: np.ndarray, r: np.ndarray) -> Callable[[], Any]:
        """Return the run on these two arrays, checked once; it keeps them alive."""
        frame = np.array([self.arguments, *self._addresses(z, r)], dtype=np.int64)
        fixed = _Fixed(self.code.call, ctypes.c_void_p(frame.ctypes.data))
        fixed.owners = (self, frame, z, r)
        return fixed


class _Fixed(partial):
    """A call on raw addresses, and who owns the memory there."""

    owners: tuple[object, ...]


def _block(n: int, *tables: np.ndarray) -> np.ndarray:
    """The ``tables`` argument of the code."""
    return np.array([n, *(table.ctypes.data for table in tables)], dtype=np.int64)


def _blocked(rows: np.ndarray, order: np.ndarray) -> np.ndarray:
    """Rows of items by blocks, lane next to lane."""
    return np.ascontiguousarray(rows.take(order, axis=0).transpose(0, 2, 1))


def _shared(blocks: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Different blocks only, and where that of each block begins."""
    known: dict[bytes, int] = {}
    numbers = [known.setdefault(block.tobytes(), len(known)) for block in blocks]
    first = np.unique(np.array(numbers, dtype=np.int64), return_index=True)[1]
    return blocks[first], np.array(numbers, dtype=np.int64) * (blocks[0].size if len(blocks) else 0)
