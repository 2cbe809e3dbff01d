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


@pytest.mark.parametrize("name", PAGES_RUN)
def test_pages_are_in_the_contents(name: str) -> None:
    assert f"\nhowto/{name}\n" in (PAGES.parent / "index.md").read_text(encoding="utf-8")
