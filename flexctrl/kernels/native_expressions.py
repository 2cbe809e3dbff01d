"""Expressions of compiled loops as LLVM assembly; see `native_ir`."""

from __future__ import annotations

import ast
import inspect
import math
import operator
from collections.abc import Callable
from typing import Any

from flexctrl.errors import KernelError
from flexctrl.kernels import eights
from flexctrl.kernels.llvm_writer import double
from flexctrl.kernels.native_types import (
    EIGHT,
    INTRINSICS,
    LIBRARY,
    RUNS,
    SCALARS,
    SHORT,
    VECTORS,
    Absent,
    Callee,
    Value,
    llvm_type,
    record_fields,
    signature,
    symbol,
)

_ARITHMETIC = {ast.Add: "add", ast.Sub: "sub", ast.Mult: "mul"}
_ORDER = {ast.Lt: "lt", ast.LtE: "le", ast.Gt: "gt", ast.GtE: "ge", ast.Eq: "eq", ast.NotEq: "ne"}
_EIGHTS = {getattr(eights, name): name for name in eights.__all__ if name != "Eight"}
_BUILT_IN = ("float", "int", "abs", "min", "max")


class Expressions:
    """A function on its way: its lines, its variables, and how expressions are written.

    Attributes
    ----------
    callees : list of (callable, frozenset of str)
        The functions it needs, each once for every choice of parameters that are `Singles`.
    libraries : set of str
        Declarations of functions of the C library it needs.
    """

    def __init__(self, function: Callable[..., Any], absent: Absent = frozenset()) -> None:
        self.function, self.absent = function, absent
        self.names = function.__globals__
        self.callees: list[Callee] = []
        self.libraries: set[str] = set()
        self.lines: list[str] = []
        self.slots: dict[str, Value] = {}
        self.fetched: dict[tuple[str, str], Value] = {}
        self.count = 0
        self.line = 0

    def _fail(self, what: str) -> KernelError:
        code = self.function.__code__
        place = f"{code.co_filename}:{self.line}"
        return KernelError(f"{self.function.__name__} cannot be compiled: {what} ({place})")

    def _new(self, hint: str = "v") -> str:
        self.count += 1
        return f"{hint}{self.count}"

    def _put(self, text: str) -> None:
        self.lines.append(f"  {text}")

    def _value(self, kind: Any, text: str) -> Value:
        name = f"%{self._new()}"
        self._put(f"{name} = {text}")
        return Value(kind, name)

    def _label(self, name: str) -> None:
        self.lines += [f"  br label %{name}", f"{name}:"]

    def _cast(self, value: Value, kind: Any) -> Value:
        if value.type == kind:
            return value
        if (value.type, kind) == ("int", "float"):
            return self._value("float", f"sitofp i64 {value.text} to double")
        if kind == "Eight" and value.type in ("int", "float"):
            one = self._cast(value, "float").text
            single = self._value("Eight", f"insertelement {EIGHT} poison, double {one}, i32 0").text
            return self._value("Eight", f"shufflevector {EIGHT} {single}, {EIGHT} poison, <8 x i32> zeroinitializer")
        raise self._fail(f"a value of type {value.type} where {kind} is expected")

    def _place(self, target: ast.expr) -> tuple[Any, str, str]:
        """Type, address and load attributes of an entry of a vector or a field of a record."""
        if isinstance(target, ast.Subscript):
            vector = self._eval(target.value)
            if vector.type not in VECTORS:
                raise self._fail(f"{vector.type} has no entries")
            kind = VECTORS[vector.type]
            index = self._cast(self._eval(target.slice), "int")
            return (
                kind,
                self._value("ptr", f"getelementptr {llvm_type(kind)}, ptr {vector.text}, i64 {index.text}").text,
                "",
            )
        if isinstance(target, ast.Attribute):
            record = self._eval(target.value)
            known = record_fields(record.type) if isinstance(record.type, type) else {}
            if target.attr not in known:
                raise self._fail(f"{record.type} has no field {target.attr}")
            number, kind = list(known).index(target.attr), known[target.attr]
            place = self._value("ptr", f"getelementptr i64, ptr {record.text}, i64 {number}").text
            return kind, place, "" if kind in SCALARS else ", !invariant.load !0"
        raise self._fail(f"{ast.unparse(target)} is nowhere to store")

    def _set(self, name: str, value: Value) -> None:
        slot = self.slots.setdefault(name, Value(value.type, f"%{name}.slot"))
        value = self._cast(value, slot.type)
        self._put(f"store {llvm_type(slot.type)} {value.text}, ptr {slot.text}")

    def _kind(self, e: ast.expr) -> Any:
        """Type of a variable or of a field of a record; nothing of other expressions."""
        if isinstance(e, ast.Name):
            return self.slots[e.id].type if e.id in self.slots else None
        if not isinstance(e, ast.Attribute):
            return None
        owner = self._kind(e.value)
        return record_fields(owner).get(e.attr) if isinstance(owner, type) else None

    def _is_absent(self, e: ast.expr) -> bool:
        return isinstance(e, ast.Attribute) and (self._kind(e.value), e.attr) in self.absent

    def _decided(self, e: ast.expr) -> bool | None:
        """Tell what a condition comes to where that hangs on what is absent alone."""
        if isinstance(e, ast.BoolOp):
            known = [self._decided(value) for value in e.values]
            ends = isinstance(e.op, ast.Or)  # one operand like this settles it
            return ends if ends in known else None if None in known else not ends
        if isinstance(e, ast.Compare) and type(e.ops[0]) in _ORDER and self._is_absent(e.left):
            other = e.comparators[0]
            value = self.names.get(other.id) if isinstance(other, ast.Name) else getattr(other, "value", None)
            return bool(getattr(operator, _ORDER[type(e.ops[0])])(0, value)) if isinstance(value, int) else None
        return None

    def _truth(self, e: ast.expr) -> str:
        return self._cast(self._eval(e), "bool").text

    def _eval(self, e: ast.expr) -> Value:
        action = getattr(self, f"_e_{type(e).__name__.lower()}", None)
        if action is None:
            raise self._fail(f"{ast.unparse(e)} is no expression it knows")
        found: Value = action(e)
        return found

    def _e_constant(self, e: ast.Constant) -> Value:
        return self._constant(e.value)

    def _constant(self, value: object) -> Value:
        if isinstance(value, bool):
            return Value("bool", str(value).lower())
        if isinstance(value, int):
            return Value("int", str(value))
        if isinstance(value, float):
            return Value("float", double(value))
        raise self._fail(f"{value!r} is no number")

    def _e_name(self, e: ast.Name) -> Value:
        if e.id in self.slots:
            slot = self.slots[e.id]
            return self._value(slot.type, f"load {llvm_type(slot.type)}, ptr {slot.text}")
        if e.id in self.names:
            return self._constant(self.names[e.id])
        raise self._fail(f"{e.id} has no value")

    def _e_attribute(self, e: ast.Attribute) -> Value:
        if isinstance(e.value, ast.Name) and self.names.get(e.value.id) is math:
            return self._constant(getattr(math, e.attr))
        if self._is_absent(e):
            return Value("int", "0")
        if isinstance(e.value, ast.Name) and (e.value.id, e.attr) in self.fetched:
            return self.fetched[e.value.id, e.attr]
        kind, place, attributes = self._place(e)
        return self._value(kind, f"load {llvm_type(kind)}, ptr {place}{attributes}")

    def _e_subscript(self, e: ast.Subscript) -> Value:
        if not isinstance(e.slice, ast.Slice):
            kind, place, _ = self._place(e)
            return self._value(kind, f"load {llvm_type(kind)}, ptr {place}")
        if e.slice.lower is None or e.slice.upper or e.slice.step:
            raise self._fail("only tails a[k:] of vectors")
        vector, start = self._eval(e.value), self._cast(self._eval(e.slice.lower), "int")
        entry = llvm_type(VECTORS[vector.type])
        return self._value(vector.type, f"getelementptr {entry}, ptr {vector.text}, i64 {start.text}")

    def _e_unaryop(self, e: ast.UnaryOp) -> Value:
        a = self._eval(e.operand)
        if isinstance(e.op, ast.Not):
            return self._value("bool", f"xor i1 {self._cast(a, 'bool').text}, true")
        if not isinstance(e.op, ast.USub):
            raise self._fail(f"no operation {ast.unparse(e)}")
        if isinstance(e.operand, ast.Constant):
            return self._constant(-e.operand.value)  # type: ignore[operator]
        return self._value(
            a.type, f"sub nsw i64 0, {a.text}" if a.type == "int" else f"fneg {llvm_type(a.type)} {a.text}"
        )

    def _e_binop(self, e: ast.BinOp) -> Value:
        a, b = self._eval(e.left), self._eval(e.right)
        whole = a.type == b.type == "int"
        if isinstance(e.op, ast.FloorDiv | ast.Mod) and whole:
            return self._value("int", f"{'udiv' if isinstance(e.op, ast.FloorDiv) else 'urem'} i64 {a.text}, {b.text}")
        if type(e.op) in _ARITHMETIC and whole:
            return self._value("int", f"{_ARITHMETIC[type(e.op)]} nsw i64 {a.text}, {b.text}")
        if type(e.op) not in _ARITHMETIC and not isinstance(e.op, ast.Div):
            raise self._fail(f"no operation {ast.unparse(e)}")
        name = _ARITHMETIC.get(type(e.op), "div")
        kind = "Eight" if "Eight" in (a.type, b.type) else "float"
        a, b = self._cast(a, kind), self._cast(b, kind)
        return self._value(kind, f"f{name} contract {llvm_type(kind)} {a.text}, {b.text}")

    def _e_compare(self, e: ast.Compare) -> Value:
        if len(e.ops) != 1:
            raise self._fail("one comparison at a time")
        a, b = self._eval(e.left), self._eval(e.comparators[0])
        order = _ORDER[type(e.ops[0])]
        if a.type == b.type != "float":
            signed = order if order in ("eq", "ne") else f"s{order}"
            return self._value("bool", f"icmp {signed} {llvm_type(a.type)} {a.text}, {b.text}")
        a, b = self._cast(a, "float"), self._cast(b, "float")
        return self._value("bool", f"fcmp {'u' if order == 'ne' else 'o'}{order} double {a.text}, {b.text}")

    def _e_boolop(self, e: ast.BoolOp) -> Value:
        """Later operands are evaluated only where they matter."""
        name, end = f"truth.{self._new()}", self._new("end")
        whole = self._decided(e)
        if whole is not None:
            return self._constant(whole)
        open_ones = [operand for operand in e.values if self._decided(operand) is None]
        for i, operand in enumerate(open_ones):
            value = Value("bool", self._truth(operand))
            self._set(name, value)
            if i + 1 < len(open_ones):
                more = self._new("more")
                ways = (more, end) if isinstance(e.op, ast.And) else (end, more)
                self.lines += [f"  br i1 {value.text}, label %{ways[0]}, label %{ways[1]}", f"{more}:"]
        self._label(end)
        return self._value("bool", f"load i1, ptr %{name}.slot")

    def _e_ifexp(self, e: ast.IfExp) -> Value:
        known = self._decided(e.test)
        if known is not None:
            return self._eval(e.body if known else e.orelse)
        name, then, other, end = f"choice.{self._new()}", self._new("then"), self._new("else"), self._new("end")
        self.lines += [f"  br i1 {self._truth(e.test)}, label %{then}, label %{other}", f"{then}:"]
        self._set(name, self._eval(e.body))
        self.lines += [f"  br label %{end}", f"{other}:"]
        self._set(name, self._eval(e.orelse))
        self._label(end)
        kind = self.slots[name].type
        return self._value(kind, f"load {llvm_type(kind)}, ptr %{name}.slot")

    def _e_call(self, e: ast.Call) -> Value:
        if isinstance(e.func, ast.Subscript):
            return self._run(e.func, e.args)
        arguments = [self._eval(a) for a in e.args]
        if isinstance(e.func, ast.Attribute):
            return self._math(e.func, arguments)
        assert isinstance(e.func, ast.Name)
        if e.func.id in _BUILT_IN:
            return self._built_in(e.func.id, arguments)
        callee = self.names.get(e.func.id)
        if callee in _EIGHTS:
            return self._eights(_EIGHTS[callee], arguments)
        if not inspect.isfunction(callee):
            raise self._fail(f"{e.func.id} is no function it knows")
        return self._calling(callee, arguments)

    def _eights(self, name: str, arguments: list[Value]) -> Value:
        a = arguments[0].text
        if arguments[0].type == "Singles" and name in ("eight", "put"):
            return self._singles(a, arguments[1:])
        if name == "eight":
            return self._value("Eight", f"load {EIGHT}, ptr {a}, align 8")
        if name == "ahead":
            self._put(f"call void @llvm.prefetch.p0(ptr {a}, i32 0, i32 3, i32 1)")  # to be read, kept in all caches
            return Value(None, "")
        if name == "put":
            self._put(f"store {EIGHT} {self._cast(arguments[1], 'Eight').text}, ptr {a}, align 8")
            return Value(None, "")
        if name in ("put_six", "add_six"):
            self._six(a, arguments[1], name == "add_six")
            return Value(None, "")
        if name in ("rounded", "lost"):
            kind = "Eight" if name == "lost" or "Eight" in (arguments[0].type, arguments[1].type) else "float"
            one, other = (self._cast(value, kind).text for value in arguments)
            product = self._value(kind, f"fmul {llvm_type(kind)} {one}, {other}")  # without "contract"
            if name == "rounded":
                return product
            less = self._value("Eight", f"fneg {EIGHT} {product.text}").text
            return self._value("Eight", f"call {EIGHT} @llvm.fma.v8f64({EIGHT} {one}, {EIGHT} {other}, {EIGHT} {less})")
        if name == "larger":
            b = arguments[1].text
            more = self._value("bool", f"fcmp ogt {EIGHT} {b}, {a}").text  # one instruction with what follows
            return self._value("Eight", f"select <8 x i1> {more}, {EIGHT} {b}, {EIGHT} {a}")
        if name == "largest":
            return self._value("float", f"call double @llvm.vector.reduce.fmax.v8f64({EIGHT} {a})")
        return self._value("float", f"call reassoc double @llvm.vector.reduce.fadd.v8f64(double 0.0, {EIGHT} {a})")

    def _singles(self, place: str, written: list[Value]) -> Value:
        """Read eight floats of single precision, or write these."""
        if not written:
            short = self._value("single", f"load {SHORT}, ptr {place}, align 4").text
            return self._value("Eight", f"fpext {SHORT} {short} to {EIGHT}")
        short = self._value("single", f"fptrunc {EIGHT} {self._cast(written[0], 'Eight').text} to {SHORT}").text
        self._put(f"store {SHORT} {short}, ptr {place}, align 4")
        return Value(None, "")

    def _six(self, goal: str, source: Value, added: bool) -> None:
        """Read all of it before any is written, which LLVM may not do by itself: goal and source might overlap."""
        moves = (("<4 x double>", goal), ("<2 x double>", self._beyond_four(goal)))
        values = self._first_six(source)
        if added:
            others = [self._value("Eight", f"load {kind}, ptr {to}, align 8").text for kind, to in moves]
            values = [
                self._value("Eight", f"fadd {kind} {one}, {other}").text
                for (kind, _), one, other in zip(moves, values, others, strict=True)
            ]
        for (kind, to), value in zip(moves, values, strict=True):
            self._put(f"store {kind} {value}, ptr {to}, align 8")

    def _first_six(self, source: Value) -> list[str]:
        """Four and two of a vector's first entries, or of a register's."""
        if source.type == "Eight":
            lanes = ("i32 0, i32 1, i32 2, i32 3", "i32 4, i32 5")
            kinds = [f"<{some.count('i32')} x i32> <{some}>" for some in lanes]
            cut = f"shufflevector {EIGHT} {source.text}, {EIGHT} poison"
            return [self._value("Eight", f"{cut}, {kind}").text for kind in kinds]
        starts = (("<4 x double>", source.text), ("<2 x double>", self._beyond_four(source.text)))
        return [self._value("Eight", f"load {kind}, ptr {start}, align 8").text for kind, start in starts]

    def _beyond_four(self, place: str) -> str:
        return self._value("ptr", f"getelementptr double, ptr {place}, i64 4").text

    def _calling(self, callee: Callable[..., Any], arguments: list[Value]) -> Value:
        parameters, result = signature(callee)
        if len(parameters) != len(arguments):
            raise self._fail(f"{callee.__name__} takes {len(parameters)} arguments")
        pairs = list(zip(arguments, parameters, strict=True))
        singles = frozenset(name for a, (name, kind) in pairs if (a.type, kind) == ("Singles", "Reals"))
        given = [a if name in singles else self._cast(a, kind) for a, (name, kind) in pairs]
        text = ", ".join(f"{llvm_type(a.type)} {a.text}" for a in given)
        if (callee, singles) not in self.callees:
            self.callees.append((callee, singles))
        call = f"call {llvm_type(result)} @{symbol((callee, singles))}({text})"
        if result is not None:
            return self._value(result, call)
        self._put(call)
        return Value(None, "")

    def _run(self, which: ast.Subscript, given: list[ast.expr]) -> Value:
        runs, index = self._eval(which.value), self._cast(self._eval(which.slice), "int")
        if runs.type != RUNS:
            raise self._fail(f"{ast.unparse(which)} is no run")
        z, r = (self._cast(self._eval(a), "Reals") for a in given)
        pair = self._value("ptr", f"getelementptr [2 x i64], ptr {runs.text}, i64 {index.text}")
        code = self._value("ptr", f"load ptr, ptr {pair.text}")
        second = self._value("ptr", f"getelementptr i64, ptr {pair.text}, i64 1")
        tables = self._value("ptr", f"load ptr, ptr {second.text}")
        self._put(f"call void {code.text}(ptr {tables.text}, ptr {z.text}, ptr {r.text})")
        return Value(None, "")

    def _math(self, f: ast.Attribute, arguments: list[Value]) -> Value:
        given = [self._cast(a, "float") for a in arguments]
        if f.attr == "isfinite":
            size = self._value("float", f"call double @llvm.fabs.f64(double {given[0].text})")
            return self._value("bool", f"fcmp olt double {size.text}, {double(math.inf)}")
        if f.attr in LIBRARY:
            self.libraries.add(f"declare double @{f.attr}({', '.join(['double'] * len(given))})")
            name = f.attr
        elif f.attr in INTRINSICS:
            name = f"llvm.{f.attr}.f64"
        else:
            raise self._fail(f"math.{f.attr} is no function it knows")
        return self._value("float", f"call double @{name}({', '.join(f'double {a.text}' for a in given)})")

    def _built_in(self, name: str, arguments: list[Value]) -> Value:
        a = arguments[0]
        if name == "float":
            return self._cast(a, "float")
        if name == "int":
            return self._value("int", f"fptosi double {a.text} to i64") if a.type == "float" else a
        if name == "abs" and a.type != "int":
            kind = llvm_type(a.type)
            return self._value(
                a.type, f"call {kind} @llvm.fabs.{'f64' if a.type == 'float' else 'v8f64'}({kind} {a.text})"
            )
        b = self._value("int", f"sub nsw i64 0, {a.text}") if name == "abs" else arguments[1]
        kind = "int" if a.type == b.type == "int" else "float"
        a, b = self._cast(a, kind), self._cast(b, kind)
        less, more = (b, a) if name == "min" else (a, b)  # as in Python the first of equals is kept
        compare = "icmp slt" if kind == "int" else "fcmp olt"
        truth = self._value("bool", f"{compare} {llvm_type(kind)} {less.text}, {more.text}")
        return self._value(kind, f"select i1 {truth.text}, {llvm_type(kind)} {b.text}, {llvm_type(kind)} {a.text}")
