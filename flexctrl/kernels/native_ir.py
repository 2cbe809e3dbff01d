"""From a function in a small part of Python to LLVM assembly.

The part: ``int`` (64 bits), ``float`` and ``bool`` values; vectors (`Reals`, `Wholes`) read and written by one
index, and their tails ``a[k:]``; `Singles`, eight at a time, also where a function says `Reals`; records, which are
dataclasses of such; lists of compiled runs (`Runs`); ``if``, ``while``, ``for … in range``, ``return``; arithmetic,
comparisons, ``and``/``or``/``not``, ``x if c else y``; ``min``, ``max``, ``abs``, ``int``, ``float``, functions of
`math`, eight floats at once (`eights`), and other functions of the same part. Every variable keeps the type of its
first value, ``//`` and ``%`` are for numbers ≥ 0, and vectors that one function is given must not overlap. What is
outside is refused with its line.
"""

from __future__ import annotations

import ast
import linecache
from functools import cache

from flexctrl.kernels.native_expressions import Expressions
from flexctrl.kernels.native_types import VECTORS, ZERO, Absent, Callee, Value, llvm_type, signature, symbol

_SHORT = 150
"""Lines of assembly without branches that are put where they are called."""


class Translation(Expressions):
    """A function and its statements."""

    def __init__(self, callee: Callee, absent: Absent = frozenset()) -> None:
        super().__init__(callee[0], absent)
        self.name, singles = symbol(callee), callee[1]
        self.loops: list[tuple[str, str]] = []
        parameters, self.result = signature(self.function)
        self.parameters = [(name, "Singles" if name in singles else kind) for name, kind in parameters]

    def assembly(self) -> str:
        """Return the definition in LLVM assembly."""
        code = self.function.__code__
        tree = _definitions(code.co_filename)[code.co_firstlineno]
        heads = []
        for name, kind in self.parameters:
            heads.append(f"{llvm_type(kind)}{' noalias' if kind in VECTORS else ''} %{name}.in")
            self._set(name, Value(kind, f"%{name}.in"))
        self._body(tree.body)
        self._put(f"ret {llvm_type(self.result)} {ZERO[llvm_type(self.result)]}")
        slots = [f"  {slot.text} = alloca {llvm_type(slot.type)}" for slot in self.slots.values()]
        top = f"define internal {llvm_type(self.result)} @{self.name}({', '.join(heads)}){self._hurry} {{"
        return "\n".join([top, *slots, *self.lines, "}"])

    @property
    def _hurry(self) -> str:
        """How the code is made: in no time where it runs seldom, in the place of its calls where it is short."""
        if hasattr(self.function, "seldom"):
            return " noinline optnone"
        straight = not any(line.startswith("  br ") for line in self.lines)
        return " alwaysinline" if straight and len(self.lines) <= _SHORT else ""

    def _go(self, label: str) -> None:
        """Jump, and go on in a block that nothing reaches."""
        self.lines += [f"  br label %{label}", f"{self._new('dead')}:"]

    def _body(self, statements: list[ast.stmt]) -> None:
        for statement in statements:
            self.line = statement.lineno
            action = getattr(self, f"_{type(statement).__name__.lower()}", None)
            if action is None:
                raise self._fail(f"{type(statement).__name__} is no statement it knows")
            action(statement)
            if self._leaves(statement):
                return

    def _leaves(self, statement: ast.stmt) -> bool:
        """Tell whether what follows is never reached: after a return, also in the branch that is known to be taken."""
        if isinstance(statement, ast.If) and (known := self._decided(statement.test)) is not None:
            return any(self._leaves(inner) for inner in (statement.body if known else statement.orelse))
        return isinstance(statement, ast.Return)

    def _expr(self, s: ast.Expr) -> None:
        if not isinstance(s.value, ast.Constant):
            self._eval(s.value)

    def _assign(self, s: ast.Assign) -> None:
        value = self._eval(s.value)
        for target in s.targets:
            self._store(target, value)

    def _augassign(self, s: ast.AugAssign) -> None:
        left = ast.copy_location(ast.BinOp(_loaded(s.target), s.op, s.value), s)
        self._store(s.target, self._eval(left))

    def _store(self, target: ast.expr, value: Value) -> None:
        if isinstance(target, ast.Name):
            self._set(target.id, value)
            return
        kind, place, _ = self._place(target)
        value = self._cast(value, kind)
        self._put(f"store {llvm_type(kind)} {value.text}, ptr {place}")

    def _return(self, s: ast.Return) -> None:
        if s.value is None:
            self._put("ret void")
        else:
            value = self._cast(self._eval(s.value), self.result)
            self._put(f"ret {llvm_type(self.result)} {value.text}")
        self.lines.append(f"{self._new('dead')}:")

    def _if(self, s: ast.If) -> None:
        known = self._decided(s.test)
        if known is not None:
            self._body(s.body if known else s.orelse)
            return
        truth, then, other, end = self._truth(s.test), self._new("then"), self._new("else"), self._new("end")
        self.lines += [f"  br i1 {truth}, label %{then}, label %{other}", f"{then}:"]
        self._body(s.body)
        self.lines += [f"  br label %{end}", f"{other}:"]
        self._body(s.orelse)
        self._label(end)

    def _while(self, s: ast.While) -> None:
        head, body, end = self._new("while"), self._new("do"), self._new("done")
        known = self._fetch(s)
        self._label(head)
        self.lines += [f"  br i1 {self._truth(s.test)}, label %{body}, label %{end}", f"{body}:"]
        self._looped(s.body, head, end)
        self.lines += [f"  br label %{head}", f"{end}:"]
        self.fetched = known

    def _fetch(self, loop: ast.For | ast.While) -> dict[tuple[str, str], Value]:
        """Load where vectors of records are before the loop that reads them; return what had been before.

        They stay where they are, and LLVM's passes would have to prove that nothing is written there.
        """
        before, inside = dict(self.fetched), list(ast.walk(loop))
        given = {node.id for node in inside if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)}
        fields = [e for e in inside if isinstance(e, ast.Attribute) and self._kind(e) in VECTORS]
        for e in fields:
            if isinstance(e.value, ast.Name) and e.value.id not in given and not self._is_absent(e):
                self.fetched[e.value.id, e.attr] = self._e_attribute(e)
        return before

    def _looped(self, body: list[ast.stmt], again: str, end: str) -> None:
        self.loops.append((again, end))
        self._body(body)
        self.loops.pop()

    def _for(self, s: ast.For) -> None:
        call = s.iter
        if not (isinstance(call, ast.Call) and isinstance(call.func, ast.Name) and call.func.id == "range"):
            raise self._fail("for goes over range only")
        assert isinstance(s.target, ast.Name)
        given = [self._cast(self._eval(a), "int") for a in call.args]
        first, last = (Value("int", "0"), given[0]) if len(given) == 1 else given[:2]
        step = given[2].text if len(given) == 3 else "1"
        head, body, more, end = (self._new(label) for label in ("for", "do", "next", "done"))
        hidden = f"{s.target.id}.{head}"
        self._set(hidden, first)
        known = self._fetch(s)
        self._label(head)
        now = self._value("int", f"load i64, ptr %{hidden}.slot")
        going = self._value("bool", f"icmp {'sgt' if step.startswith('-') else 'slt'} i64 {now.text}, {last.text}")
        self.lines += [f"  br i1 {going.text}, label %{body}, label %{end}", f"{body}:"]
        self._set(s.target.id, now)
        self._looped(s.body, more, end)
        self._label(more)
        self._set(hidden, self._value("int", f"add nsw i64 {now.text}, {step}"))
        self.lines += [f"  br label %{head}", f"{end}:"]
        self.fetched = known

    def _break(self, s: ast.Break) -> None:
        self._go(self.loops[-1][1])

    def _continue(self, s: ast.Continue) -> None:
        self._go(self.loops[-1][0])


@cache
def _definitions(file: str) -> dict[int, ast.FunctionDef]:
    """Return the functions of a file, none within others, by the lines in which they begin, decorators included."""
    tree = ast.parse("".join(linecache.getlines(file)))
    found = [node for node in tree.body if isinstance(node, ast.FunctionDef)]
    return {min([node.lineno, *(d.lineno for d in node.decorator_list)]): node for node in found}


def _loaded(target: ast.expr) -> ast.expr:
    """Return a target as an expression."""
    return ast.parse(ast.unparse(target), mode="eval").body
