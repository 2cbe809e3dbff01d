"""Imports go one way through the house, and heavy libraries are loaded only where they are used."""

from __future__ import annotations

import ast
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[2] / "flexctrl"
HOUSE = (
    "errors",
    "frozen",
    "structure",
    "kernels",
    "mechanics",
    "effects",
    "linear",
    "model",
    "design",
    "dynamics",
    "cranes",
    "study",
    "plots",
    "scene",
    "report",
    "cli",
)
"""Each may import from itself and from those before it."""

MODULES = sorted(PACKAGE.rglob("*.py"))
WRITES_FIGURES = "cli/answer.py"
"""Saves the figures that plots makes, and names their type."""

HEAVY = ("matplotlib", "control", "scipy", "casadi", "llvmlite")


def name(module: Path) -> str:
    return ".".join(module.relative_to(PACKAGE.parent).with_suffix("").parts)


def imported(tree: ast.AST) -> Iterator[str]:
    """Every module imported anywhere in a file, also inside functions, by name or by text."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and ast.unparse(node.func).endswith("import_module"):
            yield from (a.value for a in node.args if isinstance(a, ast.Constant) and isinstance(a.value, str))
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, "imports are absolute"
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


def without_plot_methods(tree: ast.Module) -> ast.Module:
    """A file without its ``plot`` methods: they alone look up to the pictures, so that a result draws itself."""

    class Undrawn(ast.NodeTransformer):
        def visit_FunctionDef(self, node: ast.FunctionDef) -> ast.AST | None:
            return None if node.name == "plot" else self.generic_visit(node)

    return Undrawn().visit(tree)


def at_run_time(tree: ast.Module) -> ast.Module:
    """A file without what only type checkers read."""

    class Untyped(ast.NodeTransformer):
        def visit_If(self, node: ast.If) -> ast.AST | None:
            return None if isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING" else node

    return Untyped().visit(tree)


def test_every_room_is_in_the_house():
    rooms = {p.stem for p in PACKAGE.iterdir() if p.suffix == ".py" or (p / "__init__.py").exists()}
    assert rooms - {"__init__", "__main__"} <= set(HOUSE)


@pytest.mark.parametrize("module", MODULES, ids=name)
def test_imports_go_one_way(module):
    room = module.relative_to(PACKAGE).with_suffix("").parts[0]
    if room in ("__init__", "__main__"):
        return
    allowed = HOUSE[: HOUSE.index(room) + 1]
    tree = without_plot_methods(ast.parse(module.read_text()))
    used = {path.split(".")[1] for path in imported(tree) if path.startswith("flexctrl.")}
    assert used - {"__version__"} <= set(allowed), f"{room} comes before {sorted(used - set(allowed))}"


@pytest.mark.parametrize("module", MODULES, ids=name)
def test_plot_methods_import_pictures_only(module):
    for node in ast.walk(ast.parse(module.read_text())):
        if isinstance(node, ast.FunctionDef) and node.name == "plot":
            assert all(path.startswith("flexctrl.plots.") for path in imported(node))


@pytest.mark.parametrize("module", MODULES, ids=name)
def test_only_plots_imports_matplotlib(module):
    found = any(path.split(".")[0] == "matplotlib" for path in imported(at_run_time(ast.parse(module.read_text()))))
    assert not found or module.is_relative_to(PACKAGE / "plots") or module == PACKAGE / WRITES_FIGURES


@pytest.mark.parametrize("module", MODULES, ids=name)
def test_control_is_imported_only_inside_functions(module):
    """It takes more than a second to load."""
    tree = at_run_time(ast.parse(module.read_text()))
    top = [node for node in tree.body if isinstance(node, ast.Import | ast.ImportFrom)]
    assert not any(path.split(".")[0] == "control" for node in top for path in imported(node))


def loaded_by(statements: str, heavy: tuple[str, ...] = HEAVY) -> list[str]:
    code = f"import sys\n{statements}\nprint(*[m for m in {heavy!r} if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return done.stdout.split()


def test_importing_flexctrl_loads_nothing_heavy():
    assert loaded_by("import flexctrl") == []


def test_a_structure_needs_no_numerics():
    """Not even scipy: parts, joints and the join table are plain data."""
    assert (
        loaded_by(
            "import flexctrl as fc\n"
            "s = fc.Section(EA=1, EI_y=1, EI_z=1, GJ=1, rhoA=1, rhoJ=1)\n"
            "b = fc.Beam('b', (0, 0, 0), (1, 0, 0), s)\n"
            "str(fc.Structure([b], [fc.Support(b.start)]).join_table)"
        )
        == []
    )


def test_a_simulation_loads_of_scipy_what_it_needs():
    """A fifth of the time to a first result went to parts of it that most runs do without."""
    spared = ("scipy.optimize", "scipy.spatial", "scipy.signal", "scipy.special", "scipy.integrate", "control")
    run = (
        "import flexctrl as fc\n"
        "model = fc.assemble(fc.cranes.ceiling_crane(), [fc.Gravity(), fc.Flexible(), fc.LargeRotation()])\n"
        "fc.simulate(model, until=0.005, inputs={'push': 500.0}, method=fc.GeneralizedAlpha(1e-4))"
    )
    assert loaded_by(run, spared) == []
