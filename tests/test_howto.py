"""Pages with code: their blocks run in order and print what is shown after them."""

from __future__ import annotations

import contextlib
import io
import re
import sys
from pathlib import Path

import matplotlib as mpl
import pytest

mpl.use("Agg")

DOCS = Path(__file__).resolve().parents[1] / "docs"
PAGES = DOCS / "howto"
PAGES_RUN = (
    "bode",
    "root_locus",
    "reduction",
    "spillover",
    "validity_envelope",
    "python_control",
    "matlab",
    "sampling",
    "hoisting",
    "travelling",
    "long_runs",
    "integrators",
    "paths",
)
OTHER_PAGES = ("theory/linear", "scenes")
PAGES_OF_STUDIES = ("effects", "accuracy")
"""Pages that study the scenes shipped, here a small one in their place; what they print depends on the clock."""
SMALL = """
[sections.box]
EA = 1e8
EI_y = 1e6
EI_z = 1e6
GJ = 1e6
rhoA = 40.0
rhoJ = 1.0

[elements]
girder = { kind = "beam", start = [0, -2, 0], end = [0, 2, 0], section = "box", elements = 2 }
rope = { kind = "rope", start = "girder.1", end = [0, 0, -3], EA = 1e6 }
load = { kind = "point_mass", at = "rope.end", mass = 200.0 }

[[joints]]
kind = "support"
node = "girder.start"
held = "v w ry"

[[joints]]
kind = "support"
node = "girder.end"
held = "v w ry"

[[joints]]
kind = "pin"
first = "girder.1"
second = "rope.start"

[[joints]]
kind = "pin"
first = "rope.end"
second = "load"

[inputs]
push = { kind = "force", at = ["girder.start", "girder.end"], direction = "x" }

[outputs]
travel = { kind = "position", at = "girder.1", direction = "x" }
load_z = { kind = "position", at = "load", direction = "z" }

[effects]
gravity = true
flexible = true
large_rotation = true

[loads]
push = 20.0

[simulation]
until = 0.05
step = 5e-3
every = 0.01
start = "equilibrium"
"""
BLOCK = re.compile(r"^```python\n(?P<code>.*?)^```$(?:\n\n```text\n(?P<shown>.*?)^```$)?", re.DOTALL | re.MULTILINE)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::UserWarning")  # of python-control's layouts and unused signals
@pytest.mark.parametrize("name", [*(f"howto/{name}" for name in PAGES_RUN), *OTHER_PAGES])
def test_a_page_runs_and_prints_what_it_shows(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    text = (DOCS / f"{name}.md").read_text(encoding="utf-8")
    blocks = list(BLOCK.finditer(text))
    assert len(blocks) == text.count("```python\n")
    names: dict[str, object] = {"__name__": name}
    for block in blocks:
        printed = io.StringIO()
        with contextlib.redirect_stdout(printed):
            exec(compile(block["code"], f"{name}.md", "exec"), names)
        assert printed.getvalue() == (block["shown"] or "")
    pictures = re.findall(r'savefig\("(.*?)"\)', text)
    assert all((tmp_path / picture).stat().st_size > 5_000 for picture in pictures)


@pytest.mark.slow
@pytest.mark.parametrize("name", PAGES_OF_STUDIES)
def test_a_page_of_studies_runs_on_a_small_scene(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    text = (PAGES / f"{name}.md").read_text(encoding="utf-8")
    (tmp_path / "examples").mkdir()
    for scene in set(re.findall(r"examples/\w+\.toml", text)):
        assert (PAGES.parents[1] / scene).exists()
        (tmp_path / scene).write_text(SMALL, encoding="utf-8")
    monkeypatch.setitem(sys.modules, "joblib", None)  # processes take longer to start than these studies
    names: dict[str, object] = {"__name__": name}
    for block in BLOCK.finditer(text):
        printed = io.StringIO()
        with contextlib.redirect_stdout(printed):
            exec(compile(block["code"], f"{name}.md", "exec"), names)
        assert bool(printed.getvalue()) == ("print(" in block["code"])
    pictures = re.findall(r'savefig\("(.*?)"\)', text)
    assert pictures
    assert all((tmp_path / picture).stat().st_size > 5_000 for picture in pictures)


def test_every_page_with_code_is_run() -> None:
    pages = [
        p.relative_to(DOCS)
        for p in DOCS.rglob("*.md")
        if "_build" not in p.parts and BLOCK.search(p.read_text("utf-8"))
    ]
    run = {*(f"howto/{name}.md" for name in (*PAGES_RUN, *PAGES_OF_STUDIES)), *(f"{name}.md" for name in OTHER_PAGES)}
    assert {p.as_posix() for p in pages} == run


@pytest.mark.parametrize("name", [*PAGES_RUN, *PAGES_OF_STUDIES])
def test_pages_are_in_the_contents(name: str) -> None:
    assert f"\nhowto/{name}\n" in (PAGES.parent / "index.md").read_text(encoding="utf-8")
