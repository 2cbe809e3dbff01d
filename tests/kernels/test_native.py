"""Loops as machine code give what Python gives; what cannot be compiled is refused."""

from __future__ import annotations

import gc
import math
import weakref
from dataclasses import dataclass, field

import casadi as ca
import numpy as np
import pytest

from flexctrl.errors import KernelError
from flexctrl.kernels.eights import Eight, add_six, ahead, eight, larger, largest, lost, put, put_six, rounded, total
from flexctrl.kernels.kernel import CasadiVM, Compiled, Kernel
from flexctrl.kernels.native import Packed, Reals, Runs, Singles, Wholes, assembly, lasting_zeros
from flexctrl.model.flat.flat import clear as cleared

pytest.importorskip("llvmlite")

SCALE = 2.5
_SIZE = 40


@dataclass
class Inner:
    weight: float
    table: Wholes


@dataclass
class Record:
    n: int
    h: float
    flag: int
    x: Reals
    y: Reals
    places: Wholes
    inner: Inner
    runs: Runs = ()


def record(backend=None) -> Record:
    rng = np.random.default_rng(3)
    x, y = rng.normal(size=(2, _SIZE))
    inner = Inner(0.75, rng.integers(0, _SIZE, 10))
    runs = (spring(backend, 3), spring(backend, 5)) if backend else ()
    return Record(_SIZE, 0.5, 0, x, y, rng.permutation(_SIZE), inner, runs)


def spring(backend, n):
    z, p = ca.SX.sym("z", 2), ca.SX.sym("p", 1)
    kernel = Kernel("spring", z, p, ca.vertcat(p * ca.sin(z[1] - z[0]), z[0]))
    pairs = np.arange(n)[:, None] + np.arange(2)
    return backend.bind(kernel, pairs, np.arange(n)[:, None] + 1.0, pairs + 7)


def sums(m: Record) -> int:
    found = 0.0
    for i in range(m.n):
        if m.x[i] > 0.5 and not (i == 2 or i % 2 == 0):
            found += m.x[i]
        elif m.x[i] < 0.1 or i == 3:
            continue
        else:
            found -= math.sqrt(m.x[i]) if i < 30 else SCALE
        found = min(found, 50)
    m.h = found * m.inner.weight
    return int(found) + m.inner.table[2]


def turns(m: Record) -> int:
    steps = 0
    while True:
        steps += 1
        if steps > 5:
            break
    for j in range(9, 2, -2):
        m.y[m.places[j]] -= float(j) / 3 + abs(-m.h) + abs(2 - j) + j // 2
    for j in range(2, 5):
        m.x[j] = math.atan2(m.y[j], m.x[j]) + math.copysign(m.h, m.y[j]) + math.pi
        m.flag += 1 if math.isfinite(m.x[j] / 0.5) else 100
    return max(steps, 3) - min(1, 2)


def shares(m: Record) -> int:
    add(m.n - 8, factor(m.h, True), m.x, m.y[8:])
    return 1 if is_small(m.y[8]) else 0


def add(n: int, a: float, x: Reals, y: Reals) -> None:
    if n < 0:
        return
    for i in range(n):
        y[i] += a * x[i]


def factor(h: float, twice: bool) -> float:
    return 2 * h if twice else h


def is_small(x: float) -> bool:
    return x >= -1e-3 and x <= 1e-3


def eights(m: Record) -> int:
    most = 0.0 * eight(m.x)
    for i in range(0, m.n, 8):
        ahead(m.x[i + 8 :])  # in the end beyond all that there is
        ahead(m.x[i - 80 :])
        here = 2 * eight(m.x[i:]) - eight(m.y[i:]) / SCALE
        put(m.y[i:], -here)
        most = larger(most, abs(here))
    m.h = largest(most) + total(most) * scaled(most)
    return 0


def products(m: Record) -> int:
    whole = 0.0 * eight(m.x)
    part = whole
    for i in range(0, m.n, 8):
        whole = whole + rounded(m.h, eight(m.x[i:]))
        part = part + lost(eight(m.x[i:]), eight(m.y[i:]))
    put(m.x, whole)
    put(m.y, part)
    return 0


def moves(m: Record) -> int:
    inner = m.inner
    for i in range(3):
        put_six(m.y[8 * i :], m.x[6 * i :])
        for j in range(2):
            m.x[j] += m.y[inner.table[j]]
    while inner.table[1] != m.flag:
        put_six(m.x[2:], m.x)
        add_six(m.y[3:], m.y)
        add_six(m.y[20:], 3.0 * eight(m.x) + eight(m.y[1:]))
        put_six(m.y[30:], 0.5 * eight(m.x[3:]))
        m.flag = inner.table[1]
    return inner.table[0] if inner.weight > 0.5 else 0


def scaled(a: Eight) -> float:
    return largest(a * 0.5)


def kernels(m: Record) -> int:
    for k in range(2):
        m.runs[k](m.x, m.y)
    return len_of(m.x)


def len_of(x: Reals) -> int:
    return 2


@pytest.mark.parametrize("function", [sums, turns, shares, eights, products, moves])
def test_compiled_functions_do_what_python_does(function):
    plain, packed = record(), Packed(record())
    assert packed.bound(function)() == function(plain)
    for name in ("x", "y"):
        assert np.allclose(
            getattr(packed, name), getattr(plain, name), rtol=1e-14, atol=1e-14 * np.abs(getattr(plain, name)).max()
        )
    assert packed.h == pytest.approx(plain.h, rel=1e-14)
    assert packed.flag == plain.flag


@dataclass
class Parts:
    LASTING = ("springs", "dampers")

    springs: int
    dampers: int
    x: Reals


@dataclass
class Two:
    one: Parts
    other: Parts
    rounds: int = 3


def springy(x: Reals) -> float:
    return 2.0 * x[0]


def damped(x: Reals) -> float:
    return 3.0 * x[1]


def force(p: Parts, rounds: int) -> int:
    found = 10.0 if p.springs == 0 or rounds < 0 else 20.0
    if p.springs > 0:
        found += springy(p.x)
    if p.dampers > 0 and rounds > 1:
        found += damped(p.x)
    else:
        found += 100.0
    return int(found) + p.dampers


def forces_of_both(m: Two) -> int:
    return 1000 * force(m.one, m.rounds) + force(m.other, m.rounds)


@pytest.mark.parametrize("counts", [(0, 0, 0, 0), (2, 0, 3, 0), (0, 1, 0, 2), (0, 1, 2, 0), (1, 1, 1, 1)])
def test_no_code_is_made_for_what_is_absent(counts):
    record = Two(Parts(*counts[:2], np.array([1.0, 2.0])), Parts(*counts[2:], np.array([3.0, 4.0])))
    absent = lasting_zeros(record)
    assert absent == {(Parts, n) for n, k in zip(("springs", "dampers"), (0, 1), strict=True) if not any(counts[k::2])}
    code = assembly(forces_of_both, absent)
    assert ("@springy(" in code) == any(counts[0::2])
    assert ("@damped(" in code) == any(counts[1::2])
    assert Packed(record).bound(forces_of_both)() == forces_of_both(record)


def guarded(m: Two) -> int:
    if m.one.springs == 0 or m.rounds < 0:
        if m.one.dampers == 0:
            return 7
        return 8
    return int(springy(m.one.x))


@pytest.mark.parametrize(("counts", "expected"), [((0, 0), 7), ((0, 1), 8), ((1, 0), 2)])
def test_no_code_is_made_for_what_is_behind_a_return_for_good(counts, expected):
    record = Two(*(Parts(*counts, np.array([1.0, 2.0])) for _ in range(2)))
    assert ("@springy(" in assembly(guarded, lasting_zeros(record))) == (counts[0] > 0)
    assert Packed(record).bound(guarded)() == guarded(record) == expected


def test_a_number_said_to_be_zero_is_left_out():
    record = Two(*(Parts(0, 1, np.array([1.0, 2.0])) for _ in range(2)), rounds=0)
    assert Packed(record).bound(forces_of_both, without=("rounds",))() == forces_of_both(record)
    assert len(assembly(forces_of_both, frozenset({(Two, "rounds")}))) < len(assembly(forces_of_both))


def test_compiled_functions_run_compiled_kernels():
    plain, packed = record(CasadiVM()), Packed(record(Compiled()))
    assert packed.bound(kernels)() == kernels(plain)
    assert np.allclose(packed.y, plain.y, rtol=1e-14)


@dataclass
class Mixed:
    x: Reals
    y: Reals
    brief: Singles


def doubled_on(a: Reals, b: Reals) -> None:
    put(b, 2.0 * eight(a[3:]))


def both_precisions(m: Mixed) -> int:
    put(m.brief[1:], eight(m.x))
    doubled_on(m.brief, m.y)
    doubled_on(m.x, m.y[8:])
    doubled_on(m.y, m.brief[8:])
    return 0


def test_vectors_of_single_precision_stand_where_functions_say_reals():
    plain, packed = (Mixed(np.arange(16) / 3.0, np.zeros(16), np.zeros(16, np.float32)) for _ in range(2))
    assert Packed(packed).bound(both_precisions)() == both_precisions(plain) == 0
    assert np.array_equal(packed.brief, plain.brief)
    assert np.array_equal(packed.y, plain.y)
    assert packed.y[0] == 2.0 * np.float32(packed.x[2]) != 2.0 * packed.x[2]
    assert packed.y[8] == 2.0 * packed.x[3]


def test_entries_of_single_precision_are_refused_where_others_are_expected():
    with pytest.raises(KernelError, match="'brief' is no contiguous vector of float32"):
        Packed(Mixed(np.zeros(8), np.zeros(8), np.zeros(8)))


def test_numbers_of_a_packed_record_are_read_and_written_as_attributes():
    packed = Packed(record())
    packed.h, packed.flag = -2.25, -7
    assert (packed.h, packed.flag, packed.n) == (-2.25, -7, _SIZE)
    packed.bound(turns)()
    assert packed.flag == -4


def test_nan_compared_counts_as_less_but_stays_in_sums():
    packed = Packed(record())
    packed.x[13] = math.nan
    packed.bound(eights)()
    assert math.isfinite(packed.h)
    assert math.isnan(packed.y[13])


def test_vectors_of_another_type_are_refused():
    wrong = record()
    wrong.x = np.zeros(_SIZE, dtype=np.float32)
    with pytest.raises(KernelError, match="'x' is no contiguous vector of float64"):
        Packed(wrong)
    wrong.x = np.zeros(2 * _SIZE)[::2]
    with pytest.raises(KernelError, match="'x'"):
        Packed(wrong)


@dataclass
class Small:
    x: Reals = field(default_factory=lambda: np.zeros(8))
    n: int = 3


def with_a_list(m: Small) -> int:
    return [m.n][0]


def with_try(m: Small) -> int:
    try:
        m.n += 1
    finally:
        m.n -= 1
    return 0


def with_two_types(m: Small) -> int:
    a = 1
    a = 2.5
    return a


def without_field(m: Small) -> int:
    return m.missing


def with_a_stranger(m: Small) -> int:
    return strange(m.n)


def with_a_middle(m: Small) -> int:
    add(1, 1.0, m.x[:3], m.x)
    return 0


strange = math.factorial


@pytest.mark.parametrize(
    ("function", "what"),
    [
        (with_a_list, "no expression it knows"),
        (with_try, "Try is no statement"),
        (with_two_types, "type float where int is expected"),
        (without_field, "has no field missing"),
        (with_a_stranger, "strange is no function"),
        (with_a_middle, "only tails"),
    ],
)
def test_what_cannot_be_compiled_is_refused_with_its_line(function, what):
    with pytest.raises(KernelError, match=what) as error:
        assembly(function)
    assert "test_native.py:" in str(error.value)


def clear(n: int, x: Reals) -> None:
    for i in range(n):
        x[i] = 1.0


def with_two_of_a_name(m: Small) -> int:
    clear(m.n, m.x)
    cleared(m.n, m.x)
    return 0


def with_one_further_down(m: Small) -> int:
    clear(m.n, m.x)
    return passed_on(m)


def passed_on(m: Small) -> int:
    cleared(m.n, m.x)
    return 0


@pytest.mark.parametrize("function", [with_two_of_a_name, with_one_further_down])
def test_two_functions_of_one_name_are_refused(function):
    """Machine code has no modules: one would do for both without a word."""
    with pytest.raises(KernelError, match=r"flexctrl\.model\.flat\.flat\.clear") as error:
        assembly(function)
    assert f"{__name__}.clear" in str(error.value)


def test_a_bound_function_keeps_its_record_alive():
    """Else the memory it works on is somebody else's by the time it is called."""
    packed = Packed(record())
    kept = weakref.ref(packed)
    bound = packed.bound(sums)
    del packed
    gc.collect()
    assert kept() is not None
    assert isinstance(bound(), int)
