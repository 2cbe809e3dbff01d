"""Kernels over index tables: both backends against casadi called item by item and against numpy."""

from __future__ import annotations

import ctypes
import operator
import sys
from concurrent.futures import ThreadPoolExecutor
from functools import reduce
from types import SimpleNamespace

import casadi as ca
import numpy as np
import pytest

from flexctrl.errors import KernelError, MissingExtraError
from flexctrl.kernels.kernel import Batch, CasadiVM, Compiled, Kernel, best_backend

pytest.importorskip("llvmlite")
from flexctrl.kernels.llvm import compile_kernel
from flexctrl.kernels.llvm_cache import cache_directory, stored
from flexctrl.kernels.llvm_ir import translate

BACKENDS = [CasadiVM(), *(Compiled(lanes) for lanes in (1, 2, 4, 8)), Compiled(4, optimize_up_to=0)]
COMPILED = [*BACKENDS[1:], Compiled()]
EPS = np.finfo(float).eps

PLAIN = (
    "sin",
    "cos",
    "tan",
    "atan",
    "exp",
    "fabs",
    "sign",
    "floor",
    "ceil",
    "sinh",
    "cosh",
    "tanh",
    "asinh",
    "erf",
    "expm1",
)
PAIRS = ("fmin", "fmax", "atan2", "logic_and", "logic_or", "hypot", "fmod", "remainder", "copysign")


def on(argument, *names):
    """casadi functions of an argument brought into their range."""
    return {name: lambda a, f=getattr(ca, name): f(argument(a)) for name in names}  # noqa: B008


UNARY = {
    "neg": operator.neg,
    "sq": lambda a: a**2,
    "twice": lambda a: a + a,
    "inv": lambda a: 1 / a,
    "logic_not": ca.logic_not,
    "cube": lambda a: a**3,
    "constpow": lambda a: ca.fabs(a) ** 2.3,
    **on(lambda a: a, *PLAIN),
    **on(ca.fabs, "sqrt", "log", "log1p"),
    **on(lambda a: a / 8, "asin", "acos", "atanh"),
    **on(lambda a: 1 + ca.fabs(a), "acosh"),
}
BINARY = {
    **{name: getattr(operator, name) for name in ("add", "sub", "mul", "truediv", "lt", "le", "eq", "ne")},
    **{name: getattr(ca, name) for name in PAIRS},
    "if_else_zero": lambda a, b: ca.if_else(a > 0, b, 0),
    "if_else": lambda a, b: ca.if_else(a < b, a * b, b - a),
    "pow": lambda a, b: ca.fabs(a) ** b,
}
SAMPLES = np.array([-7.5, -2.0, -1.0, -0.3, -1e-9, 0.0, 1e-3, 0.5, 1.0, 2.0, 3.1, 7.9])


@pytest.fixture(autouse=True)
def own_cache(tmp_path_factory, monkeypatch):
    for variable in ("XDG_CACHE_HOME", "LOCALAPPDATA"):
        monkeypatch.setenv(variable, str(tmp_path_factory.getbasetemp() / "cache"))


def kernel_of(write, n_in=2, n_par=1, name="piece"):
    x, p = ca.SX.sym("x", n_in), ca.SX.sym("p", n_par)
    return Kernel(name, x, p, write(x, p))


def columns(kernel, backend, z, params):
    """Every item reads its own row of z and writes a row of its own."""
    n = len(z)
    r = np.zeros(n * kernel.n_out)
    rows = np.arange(z.size).reshape(z.shape), np.arange(r.size).reshape(n, kernel.n_out)
    backend.bind(kernel, rows[0], params, rows[1])(z.ravel(), r)
    return r.reshape(n, kernel.n_out)


def by_item(kernel, gather, params, scatter, z, r):
    """The definition, one casadi call after the other."""
    r = r.copy()
    for reads, values, writes in zip(gather, params, scatter, strict=True):
        for place, value in zip(writes, kernel.function()(z[reads], values).full().ravel(), strict=True):
            r[place] += value
    return r


def swing(x, p):
    """A kernel with a bit of everything a beam needs."""
    d = x[3:6] - x[:3]
    length = ca.sqrt(ca.dot(d, d))
    angle = ca.atan2(d[1], d[0])
    small = length < p[0]
    stretch = ca.if_else(small, length - p[0], p[1] * (length / p[0] - 1))
    turn = ca.vertcat(ca.cos(angle), ca.sin(angle), ca.tan(angle / 2))
    return ca.vertcat(-stretch * turn, stretch * turn, ca.SX(2, 1), length)


@pytest.mark.parametrize("backend", COMPILED, ids=repr)
def test_every_operation_equals_the_virtual_machine(backend):
    a, b = (m.ravel() for m in np.meshgrid(SAMPLES, SAMPLES))
    z, none = np.column_stack([a, b]), np.zeros((a.size, 0))
    writes = [(name, lambda x, f=f: f(x[0])) for name, f in UNARY.items()]
    writes += [(name, lambda x, f=f: f(x[0], x[1])) for name, f in BINARY.items()]
    kernel = kernel_of(lambda x, p: ca.vertcat(*[write(x) for _, write in writes]), n_par=0)
    expected, found = columns(kernel, CasadiVM(), z, none), columns(kernel, backend, z, none)
    for k, (name, _) in enumerate(writes):
        np.testing.assert_allclose(found[:, k], expected[:, k], rtol=3 * EPS, atol=0, err_msg=name)


def test_operations_cover_casadi():
    """Every scalar operation casadi has is among those tested above."""
    writes = [f(ca.SX.sym("a")) for f in UNARY.values()]
    writes += [f(ca.SX.sym("a"), ca.SX.sym("b")) for f in BINARY.values()]
    used = set()
    for expression in writes:
        f = ca.Function("f", ca.symvar(expression), [expression])
        used |= {f.instruction_id(k) for k in range(f.n_instructions())}
    scalar = {code for name, code in vars(ca).items() if name.startswith("OP_") and code <= ca.OP_OUTPUT}
    scalar |= {ca.OP_LOG1P, ca.OP_EXPM1, ca.OP_HYPOT, ca.OP_REMAINDER}
    assert scalar - used <= {ca.OP_ASSIGN, ca.OP_TWICE}  # casadi 3.6 writes a + a as it stands


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("backend", COMPILED[2:4], ids=repr)
def test_random_expressions_equal_the_virtual_machine(backend, seed):
    rng = np.random.default_rng(seed)
    bounded = [ca.sin, ca.cos, ca.atan, ca.tanh, lambda a: ca.sqrt(1 + a**2) / 3, lambda a: a / (2 + a**2)]
    pairs = [operator.add, operator.mul, operator.sub, ca.atan2, ca.fmin, ca.fmax]
    x, p = ca.SX.sym("x", 5), ca.SX.sym("p", 3)
    pool = [*ca.vertsplit(x), *ca.vertsplit(p)]
    for _ in range(300):
        i, j, k = rng.integers(max(0, len(pool) - 40), len(pool), 3)
        mixed = pairs[rng.integers(len(pairs))](bounded[rng.integers(len(bounded))](pool[i]), 1.5 + ca.sin(pool[j]))
        pool.append(ca.if_else(x[k % 5] < p[0], mixed, pool[k]) if rng.random() < 0.1 else mixed)
    kernel = Kernel("random", x, p, ca.vertcat(*pool[-20:]))
    z, params = rng.standard_normal((23, 5)), rng.standard_normal((23, 3))
    found, expected = columns(kernel, backend, z, params), columns(kernel, CasadiVM(), z, params)
    nudged = columns(kernel, CasadiVM(), z * (1 + 4 * EPS), params * (1 - 4 * EPS))
    # as close as the expression's own sensitivity to a few ulp at its inputs allows
    tolerance = 200 * np.abs(nudged - expected) + 1e-13 * (1 + np.abs(expected))
    assert (np.abs(found - expected) <= tolerance).all()


@pytest.mark.parametrize("n", [*range(10), 17, 33])
@pytest.mark.parametrize("backend", BACKENDS, ids=repr)
def test_tables_with_tails_shared_freedoms_and_a_dummy_slot(backend, n):
    rng = np.random.default_rng(n)
    kernel = kernel_of(swing, n_in=6, n_par=2)
    z, r = rng.uniform(-1, 1, 20), rng.standard_normal(9)
    gather, scatter = rng.integers(0, 20, (n, 6)), rng.integers(0, 9, (n, 9))
    gather[:, 3:] = (gather[:, :3] + 1 + rng.integers(0, 10, (n, 3))) % 20
    scatter[::2, 2:] = 8
    params = rng.uniform(0.5, 2.0, (n, 2))
    expected = by_item(kernel, gather, params, scatter, z, r)
    backend.bind(kernel, gather, params, scatter)(z, r)
    np.testing.assert_allclose(r, expected, rtol=1e-13, atol=1e-13)


@pytest.mark.parametrize("backend", BACKENDS, ids=repr)
def test_nothing_outside_the_table_is_touched(backend):
    kernel = kernel_of(lambda x, p: x * p)
    z, r = np.ones(30), np.full(30, 7.0)
    backend.bind(kernel, np.array([[3, 4], [5, 6], [7, 8]]), np.ones((3, 1)), np.array([[10, 11], [11, 12], [12, 13]]))(
        z, r
    )
    assert r[10:14].tolist() == [8.0, 9.0, 9.0, 8.0]
    assert (np.delete(r, range(10, 14)) == 7.0).all()


@pytest.mark.parametrize("backend", BACKENDS, ids=repr)
def test_nan_shows_in_its_own_item_only(backend):
    kernel = kernel_of(swing, n_in=6, n_par=2)
    z = np.random.default_rng(0).uniform(-1, 1, (9, 6))
    z[4, 1] = np.nan
    r = columns(kernel, backend, z, np.ones((9, 2)))
    others = np.delete(r, 4, axis=0)
    assert np.isnan(r[4, [0, 1, 2, 8]]).all()
    assert np.isfinite(others).all()
    z[4, 1], params = 0.0, np.ones((9, 2))
    params[8, 1] = np.nan
    assert np.isnan(columns(kernel, backend, z, params)[8, 0])


@pytest.mark.parametrize("backend", BACKENDS, ids=repr)
def test_special_values(backend):
    """Zeros with their signs, infinities, NaN and numbers at both ends of the range, against numpy."""
    special = np.array([0.0, -0.0, 1.0, -1.0, np.inf, -np.inf, np.nan, 1e308, -1.7e308, 1e-320, -1e-320, 1e22])
    a, b = (m.ravel() for m in np.meshgrid(special, special))
    one = {"sin": "sin", "cos": "cos", "tan": "tan", "sqrt": "sqrt", "fabs": "fabs", "sign": "sign", "atan": "arctan"}
    two = {"atan2": "arctan2", "fmin": "fmin", "fmax": "fmax", "rdivide": "divide"}
    two |= {"lt": "less", "le": "less_equal", "eq": "equal", "ne": "not_equal", "logic_and": "logical_and"}
    two |= {"logic_or": "logical_or", "if_else_zero": "where"}
    kernel = kernel_of(
        lambda x, p: ca.vertcat(
            *(getattr(ca, name)(x[0]) for name in one),
            *(getattr(ca, name)(x[0], x[1]) for name in two if name != "if_else_zero"),
            ca.if_else(x[0], x[1], 0),
        ),
        n_par=0,
    )
    found = columns(kernel, backend, np.column_stack([a, b]), np.zeros((a.size, 0)))
    with np.errstate(all="ignore"):
        expected = [getattr(np, name)(a) for name in one.values()]
        expected += [getattr(np, name)(a, b) for name in two.values() if name != "where"] + [np.where(a != 0, b, 0)]
    for name, ours, theirs in zip([*one, *two], found.T, expected, strict=True):
        np.testing.assert_allclose(ours, theirs, rtol=3 * EPS, err_msg=name)


@pytest.mark.skipif(np.finfo(np.longdouble).eps == EPS, reason="needs a longer float as reference")
@pytest.mark.parametrize(
    ("name", "reference", "ulps"), [("sin", "sin", 1), ("cos", "cos", 1), ("tan", "tan", 3), ("atan", "arctan", 2)]
)
def test_vector_functions_are_accurate(name, reference, ulps):
    """Units in the last place against 80-bit arithmetic, hard cases (next to multiples of π/2) included."""
    rng = np.random.default_rng(1)
    multiples = np.arange(1, 63_662) * (np.pi / 2)
    x = np.concatenate(
        [rng.uniform(-s, s, 20_000) for s in (1, 10, 1e5)]
        + [multiples, np.nextafter(multiples, 0), 10.0 ** rng.uniform(-300, 300, 2_000)]
    )
    kernel = kernel_of(lambda x, p: getattr(ca, name)(x), n_in=1, n_par=0)
    found = columns(kernel, Compiled(), x[:, None], np.zeros((x.size, 0)))[:, 0]
    exact = getattr(np, reference)(x.astype(np.longdouble))
    assert (np.abs(found - exact) <= ulps * np.spacing(np.abs(exact).astype(float))).all()


@pytest.mark.skipif(np.finfo(np.longdouble).eps == EPS, reason="needs a longer float as reference")
def test_arctangent_of_two_is_accurate():
    rng = np.random.default_rng(2)
    sides = rng.standard_normal((50_000, 2)) * 10.0 ** rng.uniform(-200, 200, (50_000, 1)) * [1, 1]
    sides[::2, 0] *= 10.0 ** rng.uniform(-20, 20, 25_000)
    kernel = kernel_of(lambda x, p: ca.atan2(x[0], x[1]), n_par=0)
    found = columns(kernel, Compiled(), sides, np.zeros((len(sides), 0)))[:, 0]
    exact = np.arctan2(*sides.T.astype(np.longdouble))
    assert (np.abs(found - exact) <= 2 * np.spacing(np.abs(exact).astype(float))).all()


def test_a_kernel_knows_its_size():
    kernel = kernel_of(lambda x, p: ca.vertcat(x[0] * p, ca.SX(2, 1)), n_in=3, n_par=1)
    assert (kernel.n_in, kernel.n_par, kernel.n_out) == (3, 1, 3)
    assert kernel.instructions == kernel.function().n_instructions()
    assert kernel.function() is kernel.function()
    assert kernel.function().nnz_out() == 3


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"name": "9 lives"}, "not an identifier"),
        ({"inputs": ca.SX.sym("a", 2, 2)}, r"inputs has shape \(2, 2\)"),
        ({"params": ca.sin(ca.SX.sym("a"))}, "params holds expressions"),
        ({"inputs": ca.SX(3, 1)}, "4 inputs and params are 1 different symbols"),
        ({"outputs": ca.SX.sym("stranger")}, "outputs use stranger"),
    ],
)
def test_a_kernel_that_cannot_be_is_refused(fields, message):
    x, p = ca.SX.sym("x"), ca.SX.sym("p")
    with pytest.raises(KernelError, match=message):
        Kernel(**{"name": "k", "inputs": x, "params": p, "outputs": x * p, **fields})


@pytest.mark.parametrize("backend", [CasadiVM(), Compiled(4)], ids=repr)
@pytest.mark.parametrize(
    ("tables", "message"),
    [
        ({"gather": np.zeros((3, 3), int)}, r"gather has shape \(3, 3\), expected \(3, 2\)"),
        ({"gather": np.zeros((3, 2))}, "gather has type float64"),
        ({"gather": np.array([[0, 1], [1, -1], [0, 0]])}, r"gather\[1, 1\] is -1"),
        ({"gather": np.array([[0, 2**31]] * 3)}, "is 2147483648"),
        ({"scatter": np.zeros((2, 2), int)}, r"scatter has shape \(2, 2\), expected \(3, 2\)"),
        ({"params": np.zeros((3, 2))}, r"params has shape \(3, 2\), expected \(3, 1\)"),
        ({"params": np.zeros(3)}, r"params has shape \(3,\)"),
    ],
)
def test_tables_that_do_not_fit_are_refused(backend, tables, message):
    index = np.zeros((3, 2), int)
    given = {"gather": index, "params": np.zeros((3, 1)), "scatter": index, **tables}
    with pytest.raises(KernelError, match=f"kernel 'piece': .*{message}"):
        backend.bind(kernel_of(lambda x, p: x * p), **given)


@pytest.mark.parametrize("backend", [CasadiVM(), Compiled(4)], ids=repr)
def test_vectors_that_do_not_fit_are_refused(backend):
    run = backend.bind(kernel_of(lambda x, p: x * p), np.array([[0, 4]]), np.ones((1, 1)), np.array([[0, 2]]))
    z, r = np.ones(5), np.zeros(3)
    frozen = np.zeros(3)
    frozen.flags.writeable = False
    run(z, r)
    for bad, message in [
        ((z[:4], r), "z has 4 entries, the index table needs at least 5"),
        ((z, r[:2]), "r has 2 entries"),
        ((z.astype(np.float32), r), "z is float32"),
        ((z, r.astype(int)), "r is int64"),
        ((np.ones(10)[::2], r), "z is float64, not contiguous"),
        ((z, np.zeros(6)[::2]), "r is float64, not contiguous"),
        ((z, frozen), "r is read-only"),
    ]:
        with pytest.raises(KernelError, match=message):
            run(*bad)
        with pytest.raises(KernelError, match=message):
            run.fixed(*bad)
    still = z.copy()
    still.flags.writeable = False
    run(still, r)
    assert r.tolist() == [2.0, 0.0, 2.0]


@pytest.mark.parametrize("backend", BACKENDS, ids=repr)
@pytest.mark.parametrize(("n_in", "n_par", "n_out"), [(0, 2, 3), (2, 0, 3), (2, 1, 0), (130, 1, 131)])
def test_kernels_of_any_shape(backend, n_in, n_par, n_out):
    symbols = [ca.SX.sym("x", n_in), ca.SX.sym("p", n_par)]
    total = reduce(operator.add, ca.vertsplit(ca.vertcat(*symbols)))
    kernel = Kernel("any", *symbols, ca.vertcat(*[k * total for k in range(n_out)]) if n_out else ca.SX(0, 1))
    rng = np.random.default_rng(3)
    z, params = rng.standard_normal((5, n_in)), rng.standard_normal((5, n_par))
    expected = np.outer(z.sum(1) + params.sum(1), np.arange(n_out))
    np.testing.assert_allclose(columns(kernel, backend, z, params), expected, rtol=1e-13, atol=1e-12)


@pytest.mark.parametrize("backend", [CasadiVM(), Compiled(4)], ids=repr)
def test_tables_are_copied_and_fixed_runs_follow_their_arrays(backend):
    kernel = kernel_of(lambda x, p: x * p)
    gather, params, scatter = np.array([[0, 1], [1, 2]]), np.array([[2.0], [3.0]]), np.array([[0, 1], [1, 2]])
    run = backend.bind(kernel, gather, params, scatter)
    gather[:], params[:], scatter[:] = 0, 0.0, 0
    z, r = np.array([1.0, 2.0, 4.0]), np.zeros(3)
    again = run.fixed(z, r)
    again()
    assert r.tolist() == [2.0, 10.0, 12.0]
    z *= 10.0
    again()
    assert r.tolist() == [22.0, 110.0, 132.0]


@pytest.mark.parametrize("backend", [CasadiVM(), Compiled(4)], ids=repr)
def test_parameters_can_be_replaced(backend):
    kernel = kernel_of(lambda x, p: x * p[0] + p[1], n_par=2)
    index, z = np.arange(10).reshape(5, 2), np.arange(10.0)
    first, second = (np.random.default_rng(s).standard_normal((5, 2)) for s in (0, 1))
    batch = Batch(kernel, index, first, index, backend)
    other = batch.with_params(second)
    for bound, params in ((other, second), (batch, first)):
        r = np.zeros(10)
        bound.run(z, r)
        np.testing.assert_allclose(r.reshape(5, 2), z.reshape(5, 2) * params[:, :1] + params[:, 1:], rtol=1e-15)
        assert bound.params is params
    with pytest.raises(KernelError, match="params has shape"):
        batch.with_params(second[:4])


@pytest.mark.parametrize("backend", BACKENDS, ids=repr)
@pytest.mark.parametrize("ends", [(37,), (16, 37), (3, 9, 9, 30, 37)], ids=repr)
def test_parts_of_a_run_are_the_run(backend, ends):
    """Each of the parts goes no further than it is to."""
    kernel, rng = kernel_of(lambda x, p: x * p, n_in=2, n_par=1), np.random.default_rng(5)
    table = np.arange(74).reshape(37, 2)
    z, params = rng.standard_normal(74), rng.standard_normal((37, 1))
    run = backend.bind(kernel, table, params, table)
    whole, summed = np.zeros(74), np.zeros(74)
    run(z, whole)
    for end, part in zip(ends, run.parts(ends), strict=True):
        part(z, summed)
        assert not summed[2 * end :].any()
    assert summed.tobytes() == whole.tobytes()


def test_code_is_shared_by_content_never_by_name():
    first, same = (kernel_of(lambda x, p: ca.sin(x) * p, name=name) for name in ("one", "two"))
    other = kernel_of(lambda x, p: ca.sin(x) * p * (1 + EPS), name="one")
    assert compile_kernel(first, 4, 2) is compile_kernel(same, 4, 2)
    assert compile_kernel(first, 4, 2) is not compile_kernel(other, 4, 2)
    assert translate(first, 4) == translate(same, 4) != translate(other, 4)


def test_stored_code_is_checked(tmp_path, monkeypatch):
    for variable in ("XDG_CACHE_HOME", "LOCALAPPDATA", "HOME"):
        monkeypatch.setenv(variable, str(tmp_path))
    made = []

    def make():
        made.append(b"code")
        return b"code"

    assert [stored("a", make), stored("a", make), len(made)] == [b"code", b"code", 1]
    (file,) = cache_directory().iterdir()
    file.write_bytes(file.read_bytes()[:-1] + b"!")
    assert [stored("a", make), len(made)] == [b"code", 2]
    stored("b", make)
    assert len(made) == 3
    file.unlink()
    file.mkdir()  # neither readable nor to be replaced
    assert [stored("a", make), len(made)] == [b"code", 4]


def test_unsupported_operations_are_named():
    kernel = kernel_of(lambda x, p: ca.erfinv(x))
    with pytest.raises(KernelError, match=r"kernel 'piece': operation OP_ERFINV .*CasadiVM"):
        Compiled().bind(kernel, np.zeros((1, 2), int), np.zeros((1, 1)), np.zeros((1, 2), int))


def test_without_llvmlite(monkeypatch):
    assert best_backend() == Compiled()
    for missing in (None, SimpleNamespace(__version__="0.44.0")):
        monkeypatch.setitem(sys.modules, "llvmlite", missing)
        assert best_backend() == CasadiVM()
        with pytest.raises(MissingExtraError, match=r"llvmlite 0\.45 or later: pip install flexctrl\[fast\]"):
            Compiled()


def test_lanes_are_powers_of_two():
    with pytest.raises(KernelError, match="lanes is 3"):
        Compiled(3)


def test_compiled_drivers_can_call_the_code():
    kernel = kernel_of(lambda x, p: x * p)
    run = Compiled(2).bind(kernel, np.array([[0, 1]] * 3), np.array([[1.0], [2.0], [4.0]]), np.array([[1, 0]] * 3))
    z, r = np.array([1.0, 10.0]), np.zeros(2)
    code = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_void_p)(run.address)
    code(run.arguments, z.ctypes.data, r.ctypes.data)
    assert r.tolist() == [70.0, 7.0]


def test_threads_may_share_a_compiled_run():
    kernel = kernel_of(swing, n_in=6, n_par=2)
    n = 400
    index = np.arange(6 * n).reshape(n, 6)
    run = Compiled().bind(kernel, index, np.ones((n, 2)), np.arange(9 * n).reshape(n, 9))

    def repeated(seed):
        z, r = np.random.default_rng(seed).standard_normal(6 * n), np.zeros(9 * n)
        for _ in range(50):
            r[:] = 0.0
            run(z, r)
        return r

    with ThreadPoolExecutor(4) as pool:
        together = list(pool.map(repeated, range(8)))
    for seed, r in enumerate(together):
        np.testing.assert_array_equal(r, repeated(seed))
