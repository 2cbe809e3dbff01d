"""Writes LLVM assembly for vectors of doubles, giving every value one name however often it is asked for."""

from __future__ import annotations

import struct
from collections.abc import Callable


def double(number: float) -> str:
    """Return a double as LLVM writes it, exactly."""
    (pattern,) = struct.unpack(">Q", struct.pack(">d", number))
    return f"0x{pattern:016X}"


class Writer:
    """Straight-line vector code. Operands are strings: names (``%v7``) or constants.

    Attributes
    ----------
    lanes : int
        Length of the vectors.
    real, integer, truth : str
        LLVM types of a vector of doubles, 64-bit integers and truth values.
    lines : list of str
        The instructions so far.
    helpers : dict of str to str
        Definitions and declarations they need, by name.
    block : str
        Label of the block being written.
    """

    def __init__(self, lanes: int, block: str) -> None:
        self.lanes = lanes
        self.real, self.integer, self.truth = (f"<{lanes} x {t}>" for t in ("double", "i64", "i1"))
        self.lines: list[str] = []
        self.helpers: dict[str, str] = {}
        self.block = block
        self._values: dict[str, str] = {}
        self._truths: dict[str, str] = {}

    def value(self, instruction: str) -> str:
        """Return the name of an instruction's value, writing it the first time only."""
        name = self._values.get(instruction)
        if name is None:
            name = self._values[instruction] = f"%v{len(self._values)}"
            self.lines.append(f"  {name} = {instruction}")
        return name

    def splat(self, kind: str, text: str) -> str:
        """Return a constant with the same entry in every lane."""
        return "<" + ", ".join([f"{kind} {text}"] * self.lanes) + ">"

    def constant(self, number: float) -> str:
        """Return a double, exactly."""
        return self.splat("double", double(number))

    def integers(self, number: int) -> str:
        """Return a 64-bit integer."""
        return self.splat("i64", str(number))

    def add(self, a: str, b: str) -> str:
        """Return a + b."""
        a, b = sorted((a, b))
        return self.value(f"fadd contract {self.real} {a}, {b}")

    def sub(self, a: str, b: str) -> str:
        """Return a − b."""
        return self.value(f"fsub contract {self.real} {a}, {b}")

    def mul(self, a: str, b: str) -> str:
        """Return a b."""
        a, b = sorted((a, b))
        return self.value(f"fmul contract {self.real} {a}, {b}")

    def div(self, a: str, b: str) -> str:
        """Return a / b, to round-off: what divides several times is inverted once."""
        return self.value(f"fdiv contract arcp {self.real} {a}, {b}")

    def neg(self, a: str) -> str:
        """Return −a."""
        return self.value(f"fneg {self.real} {a}")

    def intrinsic(self, name: str, *arguments: str) -> str:
        """Return a function LLVM knows for vectors."""
        full = f"@llvm.{name}.v{self.lanes}f64"
        self.helpers[full] = f"declare {self.real} {full}({', '.join([self.real] * len(arguments))})"
        return self.value(f"call {self.real} {full}({', '.join(f'{self.real} {a}' for a in arguments)})")

    def compare(self, predicate: str, a: str, b: str) -> str:
        """Return the truth of an LLVM floating-point comparison."""
        return self.value(f"fcmp {predicate} {self.real} {a}, {b}")

    def select(self, truth: str, a: str, b: str) -> str:
        """Return a where true, else b."""
        return self.value(f"select {self.truth} {truth}, {self.real} {a}, {self.real} {b}")

    def both(self, operation: str, a: str, b: str) -> str:
        """Return ``and``, ``or`` or ``xor`` of truths."""
        return self.value(f"{operation} {self.truth} {a}, {b}")

    def to_real(self, truth: str) -> str:
        """Return 1 where true, else 0."""
        name = self.select(truth, self.constant(1.0), self.constant(0.0))
        self._truths[name] = truth
        return name

    def to_truth(self, a: str) -> str:
        """Return where a is not 0 (NaN counts as true, as in C)."""
        return self._truths.get(a) or self.compare("une", a, self.constant(0.0))

    def bits(self, a: str) -> str:
        """Return the bit pattern as integers."""
        return self.value(f"bitcast {self.real} {a} to {self.integer}")

    def from_bits(self, a: str) -> str:
        """Return the double of a bit pattern."""
        return self.value(f"bitcast {self.integer} {a} to {self.real}")

    def on_bits(self, operation: str, a: str, number: int) -> str:
        """Return an integer operation (``and``, ``add``, ``shl`` …) with a constant."""
        return self.value(f"{operation} {self.integer} {a}, {self.integers(number)}")

    def flip_sign(self, a: str, sign: str) -> str:
        """Return a with its sign bit changed where the integers ``sign`` have bit 63 set."""
        return self.from_bits(self.value(f"xor {self.integer} {self.bits(a)}, {sign}"))

    def per_lane(self, function: str, *arguments: str) -> str:
        """Return a function of the C library, called for one lane after the other."""
        return self.value(self._lane_call(function, *arguments))

    def shared(self, name: str, write: Callable[..., str], *arguments: str) -> str:
        """Return a function written once for all its calls: large kernels stay quick to compile."""
        full = f"@vector_{name}"
        if full not in self.helpers:
            inner = Writer(self.lanes, "0")
            names = [f"%a{i}" for i in range(len(arguments))]
            result = write(inner, *names)
            self.helpers |= inner.helpers
            heads = ", ".join(f"{self.real} {a}" for a in names)
            lines = [
                f"define internal {self.real} {full}({heads}) noinline {{",
                *inner.lines,
                f"  ret {self.real} {result}\n}}",
            ]
            self.helpers[full] = "\n".join(lines)
        return self.value(f"call {self.real} {full}({', '.join(f'{self.real} {a}' for a in arguments)})")

    def unless(self, rare: str, usual: str, function: str, *arguments: str) -> str:
        """Return ``usual``, or the C library's function for all lanes if ``rare`` is true in any."""
        mask = self.value(f"bitcast {self.truth} {rare} to i{self.lanes}")
        any_rare = self.value(f"icmp ne i{self.lanes} {mask}, 0")
        self.lines += [
            f"  br i1 {any_rare}, label %rare, label %on, !prof !0",
            "rare:",
            f"  %careful = {self._lane_call(function, *arguments)}",
            "  br label %on",
            "on:",
            f"  %either = phi {self.real} [{usual}, %{self.block}], [%careful, %rare]",
        ]
        self.block = "on"
        return "%either"

    def _lane_call(self, function: str, *arguments: str) -> str:
        self.helpers[f"@{function}"] = f"declare double @{function}({', '.join(['double'] * len(arguments))})"
        self.helpers[f"@lanes_{function}"] = self._lane_helper(function, len(arguments))
        return f"call {self.real} @lanes_{function}({', '.join(f'{self.real} {a}' for a in arguments)})"

    def _lane_helper(self, function: str, n: int) -> str:
        heads = ", ".join(f"{self.real} %a{i}" for i in range(n))
        lines = [f"define internal {self.real} @lanes_{function}({heads}) noinline {{"]
        result = "poison"
        for k in range(self.lanes):
            lines += [f"  %x{k}_{i} = extractelement {self.real} %a{i}, i32 {k}" for i in range(n)]
            arguments = ", ".join(f"double %x{k}_{i}" for i in range(n))
            lines.append(f"  %y{k} = call double @{function}({arguments})")
            lines.append(f"  %r{k} = insertelement {self.real} {result}, double %y{k}, i32 {k}")
            result = f"%r{k}"
        return "\n".join([*lines, f"  ret {self.real} {result}", "}"])
