"""The repository: what lies on top, and that nothing in the package is unfinished."""

from __future__ import annotations

import ast
import re
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
MODULES = sorted((ROOT / "flexctrl").rglob("*.py"))
TOP = {"pyproject.toml", "flexctrl", "tests", "examples", "docs", "README.md"}
UNFINISHED = re.compile(r"\b(TO" r"DO|FIX" r"ME|XX" r"X|HA" r"CK)\b|NotImplementedError")


def name(module: Path) -> str:
    return str(module.relative_to(ROOT))


def test_the_top_level_holds_what_it_should():
    if not (ROOT / ".git").exists():
        pytest.skip("no git checkout")
    listed = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    assert {path.split("/")[0] for path in listed.split() if not path.startswith(".")} <= TOP


@pytest.mark.parametrize("module", MODULES, ids=name)
def test_nothing_is_left_to_do(module):
    found = UNFINISHED.search(module.read_text())
    assert found is None, found


@pytest.mark.parametrize("module", MODULES, ids=name)
def test_modules_say_what_they_are(module):
    tree = ast.parse(module.read_text())
    assert ast.get_docstring(tree)
    alone = all(isinstance(node, ast.Expr) for node in tree.body)
    futures = [n for n in tree.body if isinstance(n, ast.ImportFrom) and n.module == "__future__"]
    assert alone or "annotations" in [alias.name for n in futures for alias in n.names]


@pytest.mark.parametrize("module", MODULES, ids=name)
def test_no_function_is_a_stub(module):
    """A body of nothing belongs to a Protocol, an abstract method or an overload."""
    tree = ast.parse(module.read_text())
    protocols = [
        n for n in ast.walk(tree) if isinstance(n, ast.ClassDef) and any("Protocol" in ast.dump(b) for b in n.bases)
    ]
    declared = {f for p in protocols for f in ast.walk(p)}
    for node in ast.walk(tree):
        marks = " ".join(map(ast.dump, getattr(node, "decorator_list", [])))
        abstract = "abstractmethod" in marks or "overload" in marks
        if isinstance(node, ast.FunctionDef) and node not in declared and not abstract:
            body = [n for n in node.body if not (isinstance(n, ast.Expr) and isinstance(n.value, ast.Constant))]
            assert any(not isinstance(n, ast.Pass) for n in body), f"{node.name} does nothing"
