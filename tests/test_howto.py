"""How-to pages: their blocks run in order and print what is shown after them."""

from __future__ import annotations

import contextlib
import io
import re
from pathlib import Path

import matplotlib as mpl
import pytest

mpl.use("Agg")

PAGES = Path(__file__).resolve().parents[1] / "docs" / "howto"
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
)
PAGES_OF_STUDIES = {"effects": 0.3}
"""Pages that study the scenes shipped, and how long their runs are here [s]; what they print depends on the clock."""
BLOCK = re.compile(r"^```python\n(?P<code>.*?)^```$(?:\n\n```text\n(?P<shown>.*?)^```$)?", re.DOTALL | re.MULTILINE)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::UserWarning")  # of python-control's layouts and unused signals
@pytest.mark.parametrize("name", PAGES_RUN)
def test_a_page_runs_and_prints_what_it_shows(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    text = (PAGES / f"{name}.md").read_text(encoding="utf-8")
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
def test_a_page_of_studies_runs_on_short_scenes(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    text = (PAGES / f"{name}.md").read_text(encoding="utf-8")
    (tmp_path / "examples").mkdir()
    for scene in set(re.findall(r"examples/\w+\.toml", text)):
        content = (PAGES.parents[1] / scene).read_text(encoding="utf-8")
        short, found = re.subn(r"^until = .*$", f"until = {PAGES_OF_STUDIES[name]}", content, flags=re.MULTILINE)
        assert found == 1
        (tmp_path / scene).write_text(short, encoding="utf-8")
    names: dict[str, object] = {"__name__": name}
    for block in BLOCK.finditer(text):
        printed = io.StringIO()
        with contextlib.redirect_stdout(printed):
            exec(compile(block["code"], f"{name}.md", "exec"), names)
        assert bool(printed.getvalue()) == ("print(" in block["code"])
    pictures = re.findall(r'savefig\("(.*?)"\)', text)
    assert pictures
    assert all((tmp_path / picture).stat().st_size > 5_000 for picture in pictures)


@pytest.mark.parametrize("name", [*PAGES_RUN, *PAGES_OF_STUDIES])
def test_pages_are_in_the_contents(name: str) -> None:
    assert f"\nhowto/{name}\n" in (PAGES.parent / "index.md").read_text(encoding="utf-8")
