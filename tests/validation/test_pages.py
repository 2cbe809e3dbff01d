"""The pages of docs/validation say what the tests say."""

from __future__ import annotations

import ast
from functools import cache
from pathlib import Path

import pytest
from recorder import PAGES, Absolute, compared, home, rewrite, rows_of, section

ROWS = [row for page in sorted(PAGES.glob("*.md")) for row in rows_of(page)]


@cache
def functions(module: str) -> set[str]:
    path = home(module)
    tree = ast.parse(path.read_text(encoding="utf-8") if path else "")
    return {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}


def test_every_line_is_made_by_a_test(collected: set[tuple[str, str]], request: pytest.FixtureRequest) -> None:
    """By its function; and by its parameters, where this run has collected the function's."""
    if request.config.getoption("--validation-pages"):
        pytest.skip("the pages are rewritten at the end of this run")
    seen = {(module, test.split("[")[0]) for module, test in collected}
    gone = [row for row in ROWS if row.test.split("[")[0] not in functions(row.module)]
    gone += [r for r in ROWS if (r.module, r.test.split("[")[0]) in seen and (r.module, r.test) not in collected]
    assert gone == []


def test_every_line_is_within_its_tolerance() -> None:
    assert [str(row) for row in ROWS if not row.within] == []


def test_a_line_is_refused_beyond_its_tolerance() -> None:
    args = ("case", "m.py", "test", [1.0, 2.02], [1.0, 2.0], "source")
    assert compared(*args, 0.0101).difference == "1.0e-02"
    assert compared(*args, Absolute(0.021)).tolerance == "0.021 abs."
    for tight in (0.0099, Absolute(0.019)):
        with pytest.raises(AssertionError, match="off by"):
            compared(*args, tight)
    for broken in (float("nan"), [1.0]):
        with pytest.raises(AssertionError):
            compared(
                "case", "m.py", "test", [1.0, broken] if isinstance(broken, float) else broken, [1.0, 2.0], "s", 1.0
            )


def test_a_page_keeps_what_is_written_by_hand_and_what_did_not_run(tmp_path: Path) -> None:
    page = tmp_path / "linear.md"
    row = compared("a case", "test_pages.py", "test_x[1]", 1.0, 1.0, "by hand", 1e-3)
    rewrite(page, {"test_pages.py": section("One.\n\nText of one.", [row])})
    page.write_text("# By hand\n\n" + page.read_text(encoding="utf-8"), encoding="utf-8")
    rewrite(page, {"test_a12_von_mises.py": section("Two.", [])})
    text = page.read_text(encoding="utf-8")
    assert text.startswith("# By hand\n")
    assert "## One\n\nText of one.\n" in text
    assert rows_of(page) == [row]
    again = page.read_text(encoding="utf-8")
    rewrite(page, {"test_a12_von_mises.py": section("Two.", [])})
    assert page.read_text(encoding="utf-8") == again
