"""What tells a value from others, whatever it is made of: numbers, parts, functions with what they enclose, objects."""

from __future__ import annotations

import copyreg
import dis
import functools
import hashlib
import importlib
import sys
import sysconfig
import types
from collections.abc import Callable, Iterable
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np

import flexctrl
from flexctrl.errors import StructureError, shortened

__all__ = ["Untold", "digest_of"]

_SCALARS = (type(None), bool, int, float, complex, str, bytes, type(Ellipsis), type(NotImplemented))
_DESCRIPTORS = (types.MemberDescriptorType, types.GetSetDescriptorType, types.WrapperDescriptorType)
_WRAPPERS = {classmethod: "__func__", staticmethod: "__func__", functools.cached_property: "func"}
_OF_NO_ACCOUNT = (
    *(
        "__dict__",
        "__weakref__",
        "__module__",
        "__doc__",
        "__qualname__",
        "__abstractmethods__",
        "_abc_impl",
        "__hash__",
    ),
    *("__annotations__", "__slots__", "__dataclass_fields__", "__dataclass_params__", "__match_args__"),
    *("__parameters__", "__orig_bases__", "__firstlineno__", "__static_attributes__", "__annotate_func__"),
)
_MAKING = frozenset({"__init__", "__new__", "__post_init__"})
# What a function that uses these answers is not settled by what it is made of.
_OUTWARD = frozenset({"eval", "exec", "open", "input", "compile", "globals", "__import__"})
_OUTWARD_MODULES = frozenset({"os", "io", "pathlib", "random", "time", "datetime", "secrets", "socket", "subprocess"})
_OUTWARD_CALLS = frozenset({"loadtxt", "genfromtxt", "fromfile", "memmap", "loadmat", "read_csv"})
_SEEDED = frozenset({"default_rng", "RandomState", "Generator", "SeedSequence"})


class Untold(StructureError):
    """A value cannot be told from others."""


def digest_of(value: Any) -> str:
    """Return a digest of all that a value's behaviour depends on: the same in another process, and only then.

    Functions count with their code, their defaults, what they enclose and the globals they name; objects with their
    fields and, if their class is the user's own, its methods; what comes with Python, with flexctrl or is installed,
    by its name and version. Properties that are kept once they are computed do not count.

    Parameters
    ----------
    value : object

    Returns
    -------
    str

    Raises
    ------
    Untold
        If something in it cannot be told from others: a file, a stream, a function that reads files or the clock.
    """
    return _Digest().of(value).hex()


class _Digest:
    """A digest under way: what is done, and what is being looked at (a value may lead back to itself)."""

    def __init__(self) -> None:
        self.done: dict[int, tuple[Any, bytes]] = {}  # the value is kept, lest another gets its address
        self.open: list[int] = []

    def of(self, value: Any) -> bytes:
        if type(value) in _SCALARS:
            return _hash(type(value).__name__, repr(value))
        if id(value) in self.open:
            return _hash("back", str(len(self.open) - self.open.index(id(value))))
        if id(value) not in self.done:
            self.open.append(id(value))
            try:
                self.done[id(value)] = value, self._made(value)
            except RecursionError:
                raise _untold(value) from None
            finally:
                self.open.pop()
        return self.done[id(value)][1]

    def _made(self, value: Any) -> bytes:
        kind = type(value)
        if kind is np.ndarray and not value.dtype.hasobject:
            return _hash("array", value.dtype.str, repr(value.shape), np.ascontiguousarray(value).tobytes())
        if kind is tuple or kind is list:
            return self._all(kind.__name__, value)
        if kind in (dict, types.MappingProxyType):
            return self._all("dict", (part for item in value.items() for part in item))
        if kind in (set, frozenset):
            return _hash(kind.__name__, *sorted(map(self.of, value)))
        if kind in _WRAPPERS:
            return self._all(kind.__name__, [getattr(value, _WRAPPERS[kind])])
        ways: dict[type, Callable[[Any], bytes]] = {
            types.FunctionType: self._function,
            types.CodeType: self._code,
            types.ModuleType: self._module,
            types.MethodType: lambda m: self._all("method", [m.__func__, m.__self__]),
            types.BuiltinFunctionType: self._builtin,
            types.CellType: lambda cell: self._all("cell", _inside(cell)),
            property: lambda p: self._all("property", [p.fget, p.fset]),
            functools.partial: lambda p: self._all("partial", [p.func, p.args, p.keywords]),
            np.ufunc: lambda u: _hash("ufunc", u.__name__, np.__version__),
        }
        if kind in ways:
            return ways[kind](value)
        if isinstance(value, type):
            return self._class(value)
        if hasattr(value, "cache_info") and hasattr(value, "__wrapped__"):
            return self._all("cached", [value.__wrapped__])
        return self._object(value)

    def _all(self, tag: str, parts: Iterable[Any]) -> bytes:
        return _hash(tag, *(self.of(part) for part in parts))

    def _object(self, value: Any) -> bytes:
        """By its fields if it is all Python's; else by how it would be copied."""
        kind = type(value)
        try:
            copied = value.__reduce_ex__(2)
        except Exception:  # whatever an object raises that does not want to be copied
            raise _untold(value) from None
        own = kind.__reduce__ is object.__reduce__ and kind.__reduce_ex__ is object.__reduce_ex__
        if own and not isinstance(value, (*_SCALARS[1:7], tuple, list, dict, set, frozenset)):
            return _hash("object", self.of(kind), self.of(_fields(value)))
        if isinstance(copied, str):
            return _hash("known as", kind.__module__, copied)
        return self._all("copied", [part if i < 3 else list(part or ()) for i, part in enumerate(copied)])

    def _class(self, kind: type) -> bytes:
        library = _library(kind.__module__)
        if library:
            return _hash("class", library, kind.__module__, kind.__qualname__)
        own = {name: member for name, member in vars(kind).items() if name not in _OF_NO_ACCOUNT}
        members = [
            _hash(name, self._function(m, made=True) if name in _MAKING and _plain(m) else self.of(m))
            for name, m in sorted(own.items())
            if not isinstance(m, _DESCRIPTORS)
        ]
        return _hash("class", kind.__qualname__, self.of(kind.__bases__), *members)

    def _builtin(self, function: Any) -> bytes:
        owner = function.__self__
        if owner is None or isinstance(owner, types.ModuleType):
            return _hash("builtin", str(function.__module__), function.__qualname__)
        return _hash("builtin of", function.__name__, self.of(owner))

    def _function(self, function: types.FunctionType, made: bool = False) -> bytes:
        """Code, defaults, what is enclosed, and the globals that are named; those of a library by its version."""
        rest = [function.__defaults__, function.__kwdefaults__, function.__closure__, function.__dict__]
        library = _library(function.__module__ or "")
        if library:
            return _hash("function", library, function.__module__, function.__qualname__, self.of(rest))
        codes = list(_nested(function.__code__))
        names, looked_up = {n for c in codes for n in c.co_names}, {n for c in codes for n in _globals(c)}
        given = {n: function.__globals__[n] for n in sorted(looked_up) if n in function.__globals__}
        given |= {name: _imported(name, level, function) for c in codes for name, level in _imports(c)}
        closed = [value for cell in function.__closure__ or () for value in _inside(cell)]
        modules = [m for m in (*given.values(), *closed) if isinstance(m, types.ModuleType)]
        if not made and ((looked_up - given.keys()) & _OUTWARD or _looks_outward(modules, names)):
            raise _untold(function, "looks at what is not its own")
        if "getattr" in looked_up and not all(_library(m.__name__) for m in modules):
            raise _untold(function, "takes from a module what it names only as it runs")
        found = [_hash(n, self._global(v, names)) for n, v in given.items()]
        return _hash("function", self.of(function.__code__), self.of(rest), *found)

    def _code(self, code: types.CodeType) -> bytes:
        """What is done, not where it is written."""
        names = [code.co_names, code.co_varnames, code.co_cellvars, code.co_freevars]
        counts = [code.co_argcount, code.co_posonlyargcount, code.co_kwonlyargcount, code.co_flags]
        return _hash("code", code.co_code, code.co_exceptiontable, self.of([code.co_consts, names, counts]))

    def _module(self, module: types.ModuleType, names: set[str] | None = None) -> bytes:
        """A library by its version; the user's own by what is used of it."""
        library = _library(module.__name__)
        if library:
            return _hash("module", library, module.__name__)
        if -id(module) in self.open:
            return _hash("module", module.__name__)
        used = {n: v for n, v in sorted(vars(module).items()) if (n in names if names else not n.startswith("__"))}
        self.open.append(-id(module))
        found = [_hash(n, self._global(value, names)) for n, value in used.items()]
        self.open.pop()
        return _hash("module", module.__name__, *found)

    def _global(self, value: Any, names: set[str] | None) -> bytes:
        return self._module(value, names) if isinstance(value, types.ModuleType) else self.of(value)


def _hash(*parts: str | bytes) -> bytes:
    digest = hashlib.sha256()
    for part in parts:
        content = part.encode() if isinstance(part, str) else part
        digest.update(len(content).to_bytes(8, "big") + content)
    return digest.digest()


def _untold(value: Any, why: str = "cannot be told from others of its kind") -> Untold:
    what = value.__qualname__ if isinstance(value, types.FunctionType) else shortened(value)
    return Untold(f"{what} {why}")


def _inside(cell: types.CellType) -> list[Any]:
    try:
        return [cell.cell_contents]
    except ValueError:  # nothing is in it yet
        return []


def _fields(value: Any) -> dict[str, Any]:
    """What an object holds; of flexctrl's own values the fields alone, the rest follows from them."""
    if is_dataclass(value) and type(value).__module__.startswith("flexctrl."):
        return {f.name: getattr(value, f.name) for f in fields(value)}
    kind, own = type(value), dict(getattr(value, "__dict__", {}))
    own |= {name: getattr(value, name) for name in copyreg._slotnames(kind) if hasattr(value, name)}  # type: ignore[attr-defined]
    untelling = (
        {"name"} if kind.__module__.partition(".")[0] == "control" else set()
    )  # python-control counts its systems
    kept = (n for n in own if isinstance(getattr(kind, n, None), functools.cached_property))
    return {name: own[name] for name in sorted(own.keys() - untelling - set(kept))}


def _plain(member: Any) -> bool:
    return isinstance(member, types.FunctionType)


def _nested(code: types.CodeType) -> Iterable[types.CodeType]:
    yield code
    for constant in code.co_consts:
        if isinstance(constant, types.CodeType):
            yield from _nested(constant)


def _globals(code: types.CodeType) -> set[str]:
    return {i.argval for i in dis.get_instructions(code) if i.opname in ("LOAD_GLOBAL", "LOAD_NAME")}


def _imports(code: types.CodeType) -> list[tuple[str, int]]:
    """Modules that a function imports itself, and how many packages up."""
    listing = list(dis.get_instructions(code))
    return [(i.argval, int(listing[k - 2].argval)) for k, i in enumerate(listing) if i.opname == "IMPORT_NAME"]


def _imported(name: str, level: int, function: types.FunctionType) -> types.ModuleType:
    try:
        if level == 0:
            return importlib.import_module(name)
    except ImportError:
        pass
    raise _untold(function, f"imports {'.' * level}{name} as it runs")


def _looks_outward(modules: Iterable[types.ModuleType], names: set[str]) -> bool:
    """Whether files, clocks, or chance without a seed may have a say."""
    found = {m.__name__.partition(".")[0] for m in modules}
    chance = "random" in names and not names & _SEEDED
    return bool(found & _OUTWARD_MODULES) or (bool(found) and (chance or bool(names & _OUTWARD_CALLS)))


@functools.lru_cache(maxsize=256)
def _library(name: str) -> str:
    """Which library of which version a module belongs to; empty for the user's own."""
    top = name.partition(".")[0]
    if top == "flexctrl":
        return f"flexctrl {flexctrl.__version__}"
    if top in sys.stdlib_module_names:
        return f"python {sys.version_info.major}.{sys.version_info.minor}"
    module = sys.modules.get(top)
    file, version = getattr(module, "__file__", None), getattr(module, "__version__", None)
    places = {Path(sysconfig.get_path(key)) for key in ("purelib", "platlib")}
    installed = file is not None and any(part in places for part in Path(file).parents)
    return f"{top} {version}" if installed and version else ""
