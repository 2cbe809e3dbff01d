"""The pages of docs/validation, made from the tests of tests/validation and tests/hard.

A test of a case asks for the fixture ``record`` and calls it once for each line of the page::

    PAGE = "linear"  # docs/validation/linear.md

    def test_cantilever(record):
        record("Cantilever, mode 1", ours=3.51602, reference=3.5160153, source="Blevins 1979", tolerance=1e-5)

which asserts that ours is within the tolerance of the reference and puts the line on the page. A float is a
relative tolerance; ``Absolute(1e-9)`` is absolute (needed where the reference is 0); numbers may be sequences of
equal length, of which the worst counts. The first line of the module's docstring is the heading of its section, the
rest is the section's text. What stands above the mark in a page is written by hand and kept.

    pytest tests/validation/test_linear_beams.py --validation-pages

rewrites the sections of the modules that ran (whole modules, no ``-k``, no long case left out, no ``-n``). Without the
option every case must be on its page already, with the same reference, source and tolerance, and every line on a page
must still be made by its test.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
PAGES = HERE.parent / "docs" / "validation"
FOLDERS = (HERE / "validation", HERE / "hard")
COMMAND = 'pytest -m "" tests/validation tests/hard --validation-pages'
MARK = f"<!-- What follows is made by `{COMMAND}` -->"
HEAD = "| case | reference | source | ours | difference | tolerance |\n|---|---|---|---|---|---|"
_ROW = re.compile(r"^\| (.*) <!-- (\S+)::(.+) --> \| (.*) \| (.*) \| (.*) \| (.*) \| (.*) \|$", re.MULTILINE)
_SECTION = re.compile(r"^<!-- (\S+\.py) -->\n(.*?)(?=^<!-- \S+\.py -->\n|\Z)", re.DOTALL | re.MULTILINE)

Numbers = float | Sequence[float] | np.ndarray


@dataclass(frozen=True)
class Absolute:
    """A tolerance on the difference itself."""

    size: float

    def __str__(self) -> str:
        return f"{self.size:.4g} abs."


@dataclass(frozen=True)
class Row:
    """One line of a page, as printed; ``module`` and ``test`` made it."""

    case: str
    module: str
    test: str
    reference: str
    source: str
    ours: str
    difference: str
    tolerance: str

    def __str__(self) -> str:
        cells = (self.reference, self.source, self.ours, self.difference, self.tolerance)
        return f"| {self.case} <!-- {self.module}::{self.test} --> | {' | '.join(cells)} |"

    @property
    def promise(self) -> tuple[str, ...]:
        """What does not depend on the machine it ran on."""
        return self.case, self.module, self.test, self.reference, self.source, self.tolerance

    @property
    def within(self) -> bool:
        """Whether the printed difference is within the printed tolerance, both rounded."""
        return float(self.difference) <= 1.05 * float(self.tolerance.split()[0])


def compared(
    case: str, module: str, test: str, ours: Numbers, reference: Numbers, source: str, tolerance: float | Absolute
) -> Row:
    """Return the line of a comparison; asserts that it is within the tolerance."""
    found, expected = np.atleast_1d(np.asarray(ours, float)), np.atleast_1d(np.asarray(reference, float))
    assert found.shape == expected.shape, f"{case}: {found.shape} numbers against {expected.shape}"
    assert np.isfinite(found).all(), f"{case}: ours is {found}"
    texts = (case, source, test)
    assert not any(sign in text for text in texts for sign in ("|", "\n", "-->")), f"{texts} breaks the table"
    gap = np.abs(found - expected)
    if not isinstance(tolerance, Absolute):
        assert expected.all(), f"{case}: the reference holds a 0; give the tolerance as Absolute(…)"
        gap = gap / np.abs(expected)
    limit = tolerance.size if isinstance(tolerance, Absolute) else tolerance
    worst = float(gap.max())
    assert worst <= limit, f"{case}: {found} against {expected}, off by {worst:.2e}, tolerance {tolerance}"
    shown = str(tolerance) if isinstance(tolerance, Absolute) else f"{tolerance:.4g}"
    return Row(case, module, test, _shown(expected), source, _shown(found), f"{worst:.1e}" if worst else "0", shown)


def _shown(values: np.ndarray) -> str:
    return ", ".join(f"{v:.10g}" for v in values)


def home(module: str) -> Path | None:
    """Return the file of a module of cases, if there is one."""
    return next((folder / module for folder in FOLDERS if (folder / module).exists()), None)


def page_of(name: str) -> Path:
    """Return the file of a page."""
    return PAGES / f"{name}.md"


def rows_of(page: Path) -> list[Row]:
    """Return the lines on a page, in order."""
    if not page.exists():
        return []
    found = [m.groups() for m in _ROW.finditer(page.read_text(encoding="utf-8"))]
    return [Row(*cells) for cells in found]


def heading(docstring: str) -> str:
    """Return a section's heading and text from a module's docstring."""
    title, _, text = docstring.strip().partition("\n")
    return f"## {title.rstrip('.')}\n\n{text.strip()}".rstrip()


def rewrite(page: Path, sections: dict[str, str]) -> None:
    """Put sections in place of those of the same module; hand-written text and other sections stay."""
    text = page.read_text(encoding="utf-8") if page.exists() else f"# {page.stem.capitalize()}\n\n{MARK}\n"
    assert MARK in text, f"{page} lacks the line {MARK!r}, under which the sections go"
    head, _, made = text.partition(MARK)
    kept = {m[1]: m[2].strip() for m in _SECTION.finditer(made)}
    there = {name: body for name, body in {**kept, **sections}.items() if home(name)}
    body = "\n\n".join(f"<!-- {name} -->\n{there[name]}" for name in sorted(there))
    page.write_text(f"{head}{MARK}\n\n{body}\n", encoding="utf-8")


def section(docstring: str, rows: Sequence[Row]) -> str:
    """Return the text of a module's section."""
    return "\n".join([heading(docstring), "", HEAD, *map(str, rows)])
