"""What the documentation says is so: its code runs and prints what is shown, and it builds."""

from __future__ import annotations

import contextlib
import doctest
import importlib
import io
import pkgutil
import re
import runpy
import string
import subprocess
import sys
from pathlib import Path

import pytest

import flexctrl
from flexctrl.cli.program import COMMANDS

ROOT = Path(__file__).resolve().parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
MODULES = sorted(m.name for m in pkgutil.walk_packages(flexctrl.__path__, "flexctrl."))
DOCUMENTS = sorted(p for p in [ROOT / "README.md", *(ROOT / "docs").rglob("*.md")] if "_build" not in p.parts)


def _blocks(text: str, language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```$", text, re.DOTALL | re.MULTILINE)


def _printed_by(path: Path) -> str:
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        runpy.run_path(str(path))
    return printed.getvalue()


def _pieces(template: str) -> list[str]:
    """What stands between the numbers of a page that a script makes."""
    return [text for text, *_ in string.Formatter().parse(template) if text.strip()]


@pytest.mark.parametrize(
    ("script", "name", "page"), [("effects", "PAGE", "benchmarks/effects.md"), ("race_page", "_LOOP", "benchmarks.md")]
)
def test_a_page_says_what_its_script_writes(script: str, name: str, page: str) -> None:
    written = (ROOT / "docs" / page).read_text(encoding="utf-8")
    template = runpy.run_path(str(ROOT / "tests" / "benchmarks" / f"{script}.py"))[name]
    assert "continuous" in template
    assert [text for text in _pieces(template) if text not in written] == []


@pytest.mark.parametrize("name", [m for m in MODULES if not m.endswith("__main__")])
def test_doctests_of_a_module(name: str) -> None:
    try:
        module = importlib.import_module(name)
    except ImportError as error:
        pytest.skip(f"{error.name} is not installed")
    assert doctest.testmod(module).failed == 0


@pytest.mark.slow
def test_the_readmes_tour_prints_what_it_says(tmp_path: Path) -> None:
    (code,), (shown, *_) = _blocks(README, "python"), _blocks(README, "text")
    script = tmp_path / "tour.py"
    script.write_text(code, encoding="utf-8")
    assert _printed_by(script) == shown


@pytest.mark.parametrize("page", ["README.md", "docs/command_line.md"])
def test_the_commands_are_listed_where_they_are_described(page: str) -> None:
    text = (ROOT / page).read_text(encoding="utf-8")
    assert re.findall(r"^\| `flexctrl (\w+) SCENE`", text, re.MULTILINE) == list(COMMANDS)


def test_the_readme_begins_with_both_commands() -> None:
    run, test = _blocks(README, "sh")
    assert run.endswith("flexctrl run examples/ceiling_crane.toml --out out\n")
    assert "[test,fast]" in test
    assert "pytest" in test


@pytest.mark.parametrize("page", DOCUMENTS, ids=lambda p: str(p.relative_to(ROOT)))
def test_relative_links_lead_somewhere(page: Path) -> None:
    targets = re.findall(r"\]\((?!https?:)([^)#]+)", page.read_text(encoding="utf-8"))
    assert [t for t in targets if not (page.parent / t).exists()] == []


def test_the_gallery_shows_every_example() -> None:
    text = (ROOT / "docs" / "gallery.md").read_text(encoding="utf-8")
    shown = set(re.findall(r"examples/(\w+\.(?:py|toml))", text))
    assert shown == {p.name for p in (ROOT / "examples").iterdir() if p.suffix in (".py", ".toml")}
    assert all((ROOT / "docs" / p).is_file() for p in re.findall(r"{image} (\S+)", text))


def test_every_level_with_public_names_has_a_page() -> None:
    levels = {module.split(".")[1] for module in flexctrl._HOMES}
    pages = "".join(p.read_text(encoding="utf-8") for p in (ROOT / "docs" / "api").glob("*.md"))
    assert levels == set(re.findall(r"\{public-names\} (\w+)", pages))


@pytest.mark.long
def test_the_documentation_builds_without_warnings(tmp_path: Path) -> None:
    for package in ("sphinx", "furo", "myst_parser", "numpydoc"):
        pytest.importorskip(package, reason="the documentation is built with the extra [docs] only")
    command = [sys.executable, "-m", "sphinx", "-W", "--keep-going", "-q", str(ROOT / "docs"), str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "public-names" not in (tmp_path / "api" / "structure.html").read_text(encoding="utf-8")
