"""From a casadi SX function to LLVM assembly that computes several items at once.

The assembly defines ``void run(tables, z, r)`` and ``void call(frame)``, described in `llvm`. A block
of items is gathered into a scratch matrix (entries by lanes), computed in straight-line vector code,
and added into r one item after the other. Idle lanes of the last block repeat the last item and are
not added.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, partial
from typing import TYPE_CHECKING

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
  %last = sub i64 %n, 1
  %some = icmp sgt i64 %n, 0
  br i1 %some, label %block, label %done
block:
  %first = phi i64 [0, %0], [%following, %block.end]
  %block.params = mul i64 %first, {n_par}
  %p = getelementptr double, ptr %params, i64 %block.params
  %left = sub i64 %n, %first
  %partial = icmp slt i64 %left, {lanes}
  %busy = select i1 %partial, i64 %left, i64 {lanes}
  br label %read
read:
  %read.lane = phi i64 [0, %block], [%read.lane.next, %read.end]
  %read.wanted = add i64 %first, %read.lane
  %read.idle = icmp sgt i64 %read.wanted, %last
  %read.item = select i1 %read.idle, i64 %last, i64 %read.wanted
  %read.row = mul i64 %read.item, {n_in}
  %g = getelementptr i32, ptr %gather, i64 %read.row
  %xl = getelementptr double, ptr %x, i64 %read.lane
{read}
  %read.lane.next = add i64 %read.lane, 1
  %read.more = icmp slt i64 %read.lane.next, {lanes}
  br i1 %read.more, label %read, label %body
body:
{body}
  br label %add
add:
  %add.lane = phi i64 [0, %{end}], [%add.lane.next, %add.end]
  %add.item = add i64 %first, %add.lane
  %add.row = mul i64 %add.item, {n_out}
  %s = getelementptr i32, ptr %scatter, i64 %add.row
  %yl = getelementptr double, ptr %y, i64 %add.lane
{add}
  %add.lane.next = add i64 %add.lane, 1
  %add.more = icmp slt i64 %add.lane.next, %busy
  br i1 %add.more, label %add, label %block.end
block.end:
  %following = add i64 %first, {lanes}
  %more = icmp slt i64 %following, %n
  br i1 %more, label %block, label %done
done:
  ret void
}}
!0 = !{{!"branch_weights", i32 1, i32 1000000}}
"""

_READ = """\
  %gi{k} = getelementptr i32, ptr %g, i64 %read.e{k}
  %gs{k} = load i32, ptr %gi{k}
  %gw{k} = zext i32 %gs{k} to i64
  %gz{k} = getelementptr double, ptr %z, i64 %gw{k}
  %gv{k} = load double, ptr %gz{k}
  %gx{k} = mul i64 %read.e{k}, {lanes}
  %ga{k} = getelementptr double, ptr %xl, i64 %gx{k}
  store double %gv{k}, ptr %ga{k}"""

_ADD = """\
  %si{k} = getelementptr i32, ptr %s, i64 %add.e{k}
  %ss{k} = load i32, ptr %si{k}
  %sw{k} = zext i32 %ss{k} to i64
  %sr{k} = getelementptr double, ptr %r, i64 %sw{k}
  %so{k} = load double, ptr %sr{k}
  %sy{k} = mul i64 %add.e{k}, {lanes}
  %sa{k} = getelementptr double, ptr %yl, i64 %sy{k}
  %sv{k} = load double, ptr %sa{k}
  %sn{k} = fadd double %so{k}, %sv{k}
  store double %sn{k}, ptr %sr{k}"""


def translate(kernel: Kernel, lanes: int) -> str:
    """Return the LLVM assembly of a kernel.

    Parameters
    ----------
    kernel : Kernel
    lanes : int
        Items computed at once.

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
    _write_body(w, kernel)
    return _MODULE.format(
        helpers="\n".join(w.helpers.values()),
        body="\n".join(w.lines),
        end=w.block,
        real=w.real,
        lanes=lanes,
        n_in=kernel.n_in,
        n_par=kernel.n_par,
        n_out=kernel.n_out,
        read=_rows("read", kernel.n_in, lanes, _READ),
        add=_rows("add", kernel.n_out, lanes, _ADD),
    )


def _rows(name: str, count: int, lanes: int, entry: str) -> str:
    """Assembly that does an entry's work for all entries of a table row, several in one turn of a loop."""
    if count == 0:
        return f"  br label %{name}.end\n{name}.end:"
    turn = max(k for k in range(1, min(count, 64) + 1) if count % k == 0)
    lines = [
        f"  br label %{name}.entries\n{name}.entries:",
        f"  %{name}.e0 = phi i64 [0, %{name}], [%{name}.next, %{name}.entries]",
    ]
    for k in range(turn):
        lines += [f"  %{name}.e{k} = add i64 %{name}.e0, {k}"] if k else []
        lines.append(entry.format(k=k, lanes=lanes))
    lines += [
        f"  %{name}.next = add i64 %{name}.e0, {turn}",
        f"  %{name}.again = icmp slt i64 %{name}.next, {count}",
        f"  br i1 %{name}.again, label %{name}.entries, label %{name}.end\n{name}.end:",
    ]
    return "\n".join(lines)


def _write_body(w: Writer, kernel: Kernel) -> None:
    """Follow the virtual machine's instructions; its registers hold names of values."""
    f = kernel.function()
    special, operations = _special(), _operations()
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


def _input(w: Writer, f: ca.Function, k: int, registers: dict[int, str]) -> None:
    argument, entry = f.instruction_input(k)
    place = w.value(f"getelementptr {w.real}, ptr %{'xp'[argument]}, i64 {entry}")
    registers[f.instruction_output(k)[0]] = w.value(f"load {w.real}, ptr {place}, align 8")


def _output(w: Writer, f: ca.Function, k: int, registers: dict[int, str]) -> None:
    place = w.value(f"getelementptr {w.real}, ptr %y, i64 {f.instruction_output(k)[1]}")
    w.lines.append(f"  store {w.real} {registers[f.instruction_input(k)[0]]}, ptr {place}, align 8")


def _constant(w: Writer, f: ca.Function, k: int, registers: dict[int, str]) -> None:
    registers[f.instruction_output(k)[0]] = w.constant(f.instruction_constant(k))


@cache
def _special() -> dict[int, Callable[[Writer, ca.Function, int, dict[int, str]], None]]:
    import casadi as ca

    return {ca.OP_INPUT: _input, ca.OP_OUTPUT: _output, ca.OP_CONST: _constant}


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
