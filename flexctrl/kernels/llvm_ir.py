"""From a casadi SX function to LLVM assembly that computes several items at once.

The assembly defines ``void run(tables, z, r)`` and ``void call(frame)``, described in `llvm`. A block
of items is gathered into a scratch matrix (entries by lanes), computed in straight-line vector code,
and added into r one item after the other. Entries that lie side by side in z, as many as there are lanes,
are a chunk: read as vectors, one an item, and turned into the matrix' rows in registers; likewise what is
written and not added. Idle lanes of the last block repeat the last item and are not added.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, partial
from typing import TYPE_CHECKING

import numpy as np

from flexctrl.errors import KernelError
from flexctrl.kernels import llvm_math
from flexctrl.kernels.llvm_writer import Writer

if TYPE_CHECKING:
    import casadi as ca

    from flexctrl.kernels.kernel import Kernel

_LIBRARY = (
    *("exp", "log", "pow", "asin", "acos", "sinh", "cosh", "tanh", "asinh", "acosh", "atanh"),
    *("expm1", "log1p", "hypot", "fmod", "remainder", "erf"),
)
LIBRARY = (*_LIBRARY, "sin", "cos", "tan", "atan2")
"""Functions of the C library the assembly may call."""

_MODULE = """\
{helpers}
define void @call(ptr %frame) {{
  %tables = load ptr, ptr %frame
  %frame.z = getelementptr ptr, ptr %frame, i64 1
  %z = load ptr, ptr %frame.z
  %frame.r = getelementptr ptr, ptr %frame, i64 2
  %r = load ptr, ptr %frame.r
  tail call void @run(ptr %tables, ptr %z, ptr %r)
  ret void
}}
define void @run(ptr %tables, ptr %z, ptr %r) {{
  %x = alloca [{n_in} x {real}], align 64
  %y = alloca [{n_out} x {real}], align 64
  %n = load i64, ptr %tables
  %tables.gather = getelementptr i64, ptr %tables, i64 1
  %gather = load ptr, ptr %tables.gather
  %tables.params = getelementptr i64, ptr %tables, i64 2
  %params = load ptr, ptr %tables.params
  %tables.scatter = getelementptr i64, ptr %tables, i64 3
  %scatter = load ptr, ptr %tables.scatter
  %tables.places = getelementptr i64, ptr %tables, i64 4
  %places = load ptr, ptr %tables.places
  %some = icmp sgt i64 %n, 0
  br i1 %some, label %block, label %done
block:
  %first = phi i64 [0, %0], [%following, %block.end]
  %number = phi i64 [0, %0], [%number.next, %block.end]
  %block.place = getelementptr i64, ptr %places, i64 %number
  %block.params = load i64, ptr %block.place
  %p = getelementptr double, ptr %params, i64 %block.params
  %block.table = mul i64 %number, {table}
  %g = getelementptr i32, ptr %gather, i64 %block.table
  %left = sub i64 %n, %first
  %partial = icmp slt i64 %left, {lanes}
  %busy = select i1 %partial, i64 %left, i64 {lanes}
{chunks}
  br label %read
read:
  %read.lane = phi i64 [0, %block], [%read.lane.next, %read.end]
  %gl = getelementptr i32, ptr %g, i64 %read.lane
  %xl = getelementptr double, ptr %x, i64 %read.lane
{read}
  %read.lane.next = add i64 %read.lane, 1
  %read.more = icmp slt i64 %read.lane.next, {lanes}
  br i1 %read.more, label %read, label %body
body:
{body}
{written}
  br label %add
add:
  %add.lane = phi i64 [0, %{end}], [%add.lane.next, %add.end]
  %add.item = add i64 %first, %add.lane
  %add.row = mul i64 %add.item, {targets}
  %s = getelementptr i32, ptr %scatter, i64 %add.row
  %yl = getelementptr double, ptr %y, i64 %add.lane
{put}
  br label %add.more.entries
add.more.entries:
{add}
  %add.lane.next = add i64 %add.lane, 1
  %add.more = icmp slt i64 %add.lane.next, %busy
  br i1 %add.more, label %add, label %block.end
block.end:
  %following = add i64 %first, {lanes}
  %number.next = add i64 %number, 1
  %more = icmp slt i64 %following, %n
  br i1 %more, label %block, label %done
done:
  ret void
}}
!0 = !{{!"branch_weights", i32 1, i32 1000000}}
"""

_READ = """\
  %gt{k} = add i64 %read.e{k}, {chunks}
  %ga{k} = mul i64 %gt{k}, {lanes}
  %gi{k} = getelementptr i32, ptr %gl, i64 %ga{k}
  %gs{k} = load i32, ptr %gi{k}
  %gw{k} = zext i32 %gs{k} to i64
  %gz{k} = getelementptr double, ptr %z, i64 %gw{k}
  %gv{k} = load double, ptr %gz{k}
  %gr{k} = add i64 %read.e{k}, {before}
  %gx{k} = mul i64 %gr{k}, {lanes}
  %gp{k} = getelementptr double, ptr %xl, i64 %gx{k}
  store double %gv{k}, ptr %gp{k}"""

_ADD = """\
  %st{k} = add i64 %add.e{k}, {chunks}
  %si{k} = getelementptr i32, ptr %s, i64 %st{k}
  %ss{k} = load i32, ptr %si{k}
  %sw{k} = zext i32 %ss{k} to i64
  %sr{k} = getelementptr double, ptr %r, i64 %sw{k}
  %sx{k} = add i64 %add.e{k}, {before}
  %sy{k} = mul i64 %sx{k}, {lanes}
  %sa{k} = getelementptr double, ptr %yl, i64 %sy{k}
  %sv{k} = load double, ptr %sa{k}
{sum}
  store double %{total}{k}, ptr %sr{k}"""

_SUM = """\
  %so{k} = load double, ptr %sr{k}
  %sn{k} = fadd double %so{k}, %sv{k}"""

_PUT = """\
  %pi{k} = getelementptr i32, ptr %s, i64 {k}
  %ps{k} = load i32, ptr %pi{k}
  %pw{k} = zext i32 %ps{k} to i64
  %pr{k} = getelementptr double, ptr %r, i64 %pw{k}
  %pl{k} = add i64 %add.lane, {row}
  %py{k} = getelementptr {real}, ptr %y, i64 %pl{k}
  %pv{k} = load {real}, ptr %py{k}, align 8
  store {real} %pv{k}, ptr %pr{k}, align 8"""


def chunks_of(gather: np.ndarray, lanes: int) -> tuple[int, ...]:
    """Return the first columns of the chunks of a table: as many columns as lanes that count on in every item."""
    joined = (np.diff(gather, axis=1) == 1).all(axis=0)
    found, k = [], 0
    while lanes > 1 and k + lanes <= gather.shape[1]:
        whole = bool(joined[k : k + lanes - 1].all())
        found += [k] * whole
        k += lanes if whole else 1
    return tuple(found)


def row_order(n_in: int, lanes: int, chunks: tuple[int, ...]) -> tuple[list[int], list[int]]:
    """Return the columns that index tables keep, and the entries of an item in the order of the scratch matrix.

    Chunks come first, and of each the first column only.
    """
    inside = [k + i for k in chunks for i in range(lanes)]
    alone = sorted(set(range(n_in)) - set(inside))
    return [*chunks, *alone], inside + alone


def translate(kernel: Kernel, lanes: int, chunks: tuple[int, ...] = (), written: tuple[int, ...] = ()) -> str:
    """Return the LLVM assembly of a kernel.

    Parameters
    ----------
    kernel : Kernel
    lanes : int
        Items computed at once.
    chunks, written : tuple of int
        First entries of its chunks, of inputs and of outputs; these only where it replaces what is there.

    Returns
    -------
    str
        It depends on what the kernel computes and not on its name.

    Raises
    ------
    KernelError
        If the kernel has an operation that is not supported; names it.
    """
    w = Writer(lanes, "body")
    kept, order = row_order(kernel.n_in, lanes, chunks)
    targets, results = row_order(kernel.n_out, lanes, written)
    _write_body(w, kernel, *({entry: row for row, entry in enumerate(rows)} for rows in (order, results)))
    entry = _ADD.replace("{sum}", "" if kernel.replaces else _SUM).replace("{total}", "sv" if kernel.replaces else "sn")
    single = {name: len(table) - len(found) for name, table, found in (("x", kept, chunks), ("y", targets, written))}
    return _MODULE.format(
        helpers="\n".join(w.helpers.values()),
        body="\n".join(w.lines),
        end=w.block,
        real=w.real,
        lanes=lanes,
        n_in=kernel.n_in,
        table=lanes * len(kept),
        n_out=kernel.n_out,
        targets=len(targets),
        chunks="\n".join(line for k in range(len(chunks)) for line in _chunk(k, lanes)),
        read=_rows("read", single["x"], _READ, lanes=lanes, chunks=len(chunks), before=lanes * len(chunks)),
        written="\n".join(line for k in range(len(written)) for line in _lanes_of(k, lanes)),
        put="\n".join(_PUT.format(k=k, row=lanes * k, real=w.real) for k in range(len(written))),
        add=_rows("add", single["y"], entry, lanes=lanes, chunks=len(written), before=lanes * len(written)),
    )


def _chunk(number: int, lanes: int) -> list[str]:
    """Assembly that reads a chunk: a vector for each lane, made into rows of x.

    It is read in halves, put together as the first exchange would put them: shuffles across halves are slow.
    """
    name, lines, half = f"%c{number}", [], lanes // 2
    part, mask = f"<{half} x double>", ", ".join(f"i32 {j}" for j in range(lanes))
    for i in range(lanes):
        at = f"{name}.{i}"
        lines += [
            f"  {at}.i = getelementptr i32, ptr %g, i64 {number * lanes + i}",
            f"  {at}.s = load i32, ptr {at}.i",
            f"  {at}.w = zext i32 {at}.s to i64",
            f"  {at}.z = getelementptr double, ptr %z, i64 {at}.w",
            f"  {at}.r = getelementptr double, ptr {at}.z, i64 {half}",
            f"  {at}.low = load {part}, ptr {at}.z, align 8",
            f"  {at}.high = load {part}, ptr {at}.r, align 8",
        ]
    for i in range(half):
        for row, side in ((i, "low"), (i + half, "high")):
            pair = f"{part} {name}.{i}.{side}, {part} {name}.{i + half}.{side}"
            lines.append(f"  {name}.{row}.1 = shufflevector {pair}, <{lanes} x i32> <{mask}>")
    return [*lines, *_exchanged(name, lanes, half), *_stored(name, number, lanes, half, "x")]


def _lanes_of(number: int, lanes: int) -> list[str]:
    """Assembly that makes rows of y, a chunk, into a vector for each lane in their place."""
    name, real, lines = f"%d{number}", f"<{lanes} x double>", []
    for i in range(lanes):
        lines += [
            f"  {name}.{i}.y = getelementptr {real}, ptr %y, i64 {number * lanes + i}",
            f"  {name}.{i}.1 = load {real}, ptr {name}.{i}.y, align 8",
        ]
    return [*lines, *_exchanged(name, lanes, lanes), *_stored(name, number, lanes, lanes, "y")]


def _exchanged(name: str, lanes: int, end: int) -> list[str]:
    """Assembly that exchanges rows and columns of a square of vectors: single ones, pairs, up to half the end."""
    real, lines, half = f"<{lanes} x double>", [], 1
    while half < end:
        for i in (i for i in range(lanes) if not i & half):
            pair = f"{real} {name}.{i}.{half}, {real} {name}.{i + half}.{half}"
            for row, shift in ((i, 0), (i + half, half)):
                picks = [j + shift if not j & half else lanes + j - half + shift for j in range(lanes)]
                mask = ", ".join(f"i32 {j}" for j in picks)
                lines.append(f"  {name}.{row}.{2 * half} = shufflevector {pair}, <{lanes} x i32> <{mask}>")
        half *= 2
    return lines


def _stored(name: str, number: int, lanes: int, end: int, matrix: str) -> list[str]:
    real, lines = f"<{lanes} x double>", []
    for i in range(lanes):
        lines += [
            f"  {name}.{i}.to = getelementptr {real}, ptr %{matrix}, i64 {number * lanes + i}",
            f"  store {real} {name}.{i}.{end}, ptr {name}.{i}.to, align 8",
        ]
    return lines


def _rows(name: str, count: int, entry: str, **numbers: int) -> str:
    """Assembly that does an entry's work for all entries of a table row, several in one turn of a loop."""
    if count == 0:
        return f"  br label %{name}.end\n{name}.end:"
    turn = max(k for k in range(1, min(count, 64) + 1) if count % k == 0)
    start = f"{name}.more.entries" if name == "add" else name
    lines = [
        f"  br label %{name}.entries\n{name}.entries:",
        f"  %{name}.e0 = phi i64 [0, %{start}], [%{name}.next, %{name}.entries]",
    ]
    for k in range(turn):
        lines += [f"  %{name}.e{k} = add i64 %{name}.e0, {k}"] if k else []
        lines.append(entry.format(k=k, **numbers))
    lines += [
        f"  %{name}.next = add i64 %{name}.e0, {turn}",
        f"  %{name}.again = icmp slt i64 %{name}.next, {count}",
        f"  br i1 %{name}.again, label %{name}.entries, label %{name}.end\n{name}.end:",
    ]
    return "\n".join(lines)


def _write_body(w: Writer, kernel: Kernel, x_rows: dict[int, int], y_rows: dict[int, int]) -> None:
    """Follow the virtual machine's instructions; its registers hold names of values. Rows: of entries in x and y."""
    f = kernel.function()
    special, operations = _special(x_rows, y_rows), _operations()
    registers: dict[int, str] = {}
    for k in range(f.n_instructions()):
        code = f.instruction_id(k)
        action = special.get(code)
        if action is not None:
            action(w, f, k, registers)
        elif code in operations:
            arguments = [registers[i] for i in f.instruction_input(k)]
            registers[f.instruction_output(k)[0]] = operations[code](w, *arguments)
        else:
            raise KernelError(
                f"kernel {kernel.name!r}: operation {_opcode_name(code)} cannot be compiled; "
                "write it with other functions, or run the kernel by CasadiVM()"
            )


def _input(rows: dict[int, int], w: Writer, f: ca.Function, k: int, registers: dict[int, str]) -> None:
    argument, entry = f.instruction_input(k)
    place = w.value(f"getelementptr {w.real}, ptr %{'xp'[argument]}, i64 {entry if argument else rows[entry]}")
    registers[f.instruction_output(k)[0]] = w.value(f"load {w.real}, ptr {place}, align 8")


def _output(rows: dict[int, int], w: Writer, f: ca.Function, k: int, registers: dict[int, str]) -> None:
    place = w.value(f"getelementptr {w.real}, ptr %y, i64 {rows[f.instruction_output(k)[1]]}")
    w.lines.append(f"  store {w.real} {registers[f.instruction_input(k)[0]]}, ptr {place}, align 8")


def _constant(w: Writer, f: ca.Function, k: int, registers: dict[int, str]) -> None:
    registers[f.instruction_output(k)[0]] = w.constant(f.instruction_constant(k))


def _special(x_rows: dict[int, int], y_rows: dict[int, int]) -> dict[int, Callable[..., None]]:
    import casadi as ca

    return {ca.OP_INPUT: partial(_input, x_rows), ca.OP_OUTPUT: partial(_output, y_rows), ca.OP_CONST: _constant}


def _not(w: Writer, a: str) -> str:
    return w.to_real(w.both("xor", w.to_truth(a), w.splat("i1", "true")))


def _sign(w: Writer, a: str) -> str:
    zero = w.constant(0.0)
    negative = w.select(w.compare("olt", a, zero), w.constant(-1.0), a)  # keeps 0 and NaN
    return w.select(w.compare("ogt", a, zero), w.constant(1.0), negative)


@cache
def _operations() -> dict[int, Callable[..., str]]:
    """What to write for an operation, by casadi's code."""
    import casadi as ca

    by_name: dict[str, Callable[..., str]] = {
        **dict.fromkeys(("ASSIGN", "LIFT"), lambda w, a, *_: a),
        **{name.upper(): getattr(Writer, name) for name in ("add", "sub", "mul", "div", "neg")},
        "SQ": lambda w, a: w.mul(a, a),
        "TWICE": lambda w, a: w.add(a, a),
        "INV": lambda w, a: w.div(w.constant(1.0), a),
        **{name.upper(): partial(_intrinsic, name) for name in ("sqrt", "fabs", "floor", "ceil", "copysign")},
        **{name: partial(_intrinsic, llvm) for name, llvm in (("FMIN", "minnum"), ("FMAX", "maxnum"))},
        **{name: partial(_compare, p) for name, p in (("LT", "olt"), ("LE", "ole"), ("EQ", "oeq"), ("NE", "une"))},
        **{name: partial(_logic, name.lower()) for name in ("AND", "OR")},
        "NOT": _not,
        "SIGN": _sign,
        "IF_ELSE_ZERO": lambda w, condition, a: w.select(w.to_truth(condition), a, w.constant(0.0)),
        **{name.upper(): partial(_library, name) for name in _LIBRARY},
        "CONSTPOW": partial(_library, "pow"),
        **{name.upper(): partial(_shared, name) for name in ("sin", "cos", "tan", "atan", "atan2")},
    }
    return {getattr(ca, f"OP_{name}"): write for name, write in by_name.items() if hasattr(ca, f"OP_{name}")}


def _intrinsic(name: str, w: Writer, *arguments: str) -> str:
    return w.intrinsic(name, *arguments)


def _compare(predicate: str, w: Writer, a: str, b: str) -> str:
    return w.to_real(w.compare(predicate, a, b))


def _logic(operation: str, w: Writer, a: str, b: str) -> str:
    return w.to_real(w.both(operation, w.to_truth(a), w.to_truth(b)))


def _library(name: str, w: Writer, *arguments: str) -> str:
    return w.per_lane(name, *arguments)


def _shared(name: str, w: Writer, *arguments: str) -> str:
    return w.shared(name, getattr(llvm_math, name), *arguments)


def _opcode_name(code: int) -> str:
    import casadi as ca

    return next((n for n in dir(ca) if n.startswith("OP_") and getattr(ca, n) == code), str(code))
