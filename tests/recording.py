"""A plugin of pytest: the fixture ``record`` and what writes the pages; see `recorder`."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import pytest
from recorder import COMMAND, Row, compared, page_of, rewrite, rows_of, section


@dataclass
class Session:
    """What a run has seen: lines by module, modules that did not run whole, all tests collected."""

    rows: dict[str, list[Row]] = field(default_factory=dict)
    texts: dict[str, tuple[str, str]] = field(default_factory=dict)
    partial: set[str] = field(default_factory=set)
    collected: set[tuple[str, str]] = field(default_factory=set)


SESSION = Session()


@pytest.fixture
def record(request: pytest.FixtureRequest) -> Iterator[Callable[..., Row]]:
    """Assert a comparison and put it on the page of the module's ``PAGE``."""
    module, test = request.path.name, request.node.name
    page = page_of(request.module.PAGE)
    writing = request.config.getoption("--validation-pages")
    on_page = [row for row in rows_of(page) if (row.module, row.test) == (module, test)]
    made: list[Row] = []
    failed = request.session.testsfailed

    def add(case: str, **numbers: object) -> Row:
        row = compared(case, module, test, **numbers)  # type: ignore[arg-type]
        made.append(row)
        if not writing:
            promised = [known.promise for known in on_page]
            assert row.promise in promised, f"{page.name} does not show {row}; run {COMMAND}"
        return row

    yield add
    if request.session.testsfailed > failed:
        return
    assert made, "a test that asks for `record` has a case to record"
    assert writing or len(made) == len(on_page), f"{page.name} shows more of {test} than it makes; run {COMMAND}"
    SESSION.rows.setdefault(module, []).extend(made)
    SESSION.texts[module] = (request.module.PAGE, request.module.__doc__)


def pytest_configure(config: pytest.Config) -> None:
    """Refuse to write pages from several processes: each would write the sections of its own tests."""
    if config.getoption("--validation-pages") and config.getoption("numprocesses", None):
        raise pytest.UsageError("--validation-pages takes one process: leave out -n")


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Remember every test collected, before some are left out."""
    SESSION.collected.update((item.path.name, item.name) for item in items)
    SESSION.partial.update(item.path.name for item in items if any("::" in arg for arg in config.args))


def pytest_deselected(items: list[pytest.Item]) -> None:
    """Remember the modules that do not run whole."""
    SESSION.partial.update(item.path.name for item in items)


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    """Count a module in which a test fails as not run whole."""
    if report.failed:
        SESSION.partial.add(report.nodeid.split("::")[0].rsplit("/", 1)[-1])


def pytest_sessionfinish(session: pytest.Session) -> None:
    """Write the sections of the modules that ran whole."""
    if not session.config.getoption("--validation-pages"):
        return
    pages: dict[str, dict[str, str]] = {}
    for module in sorted(set(SESSION.rows) - SESSION.partial):
        name, text = SESSION.texts[module]
        pages.setdefault(name, {})[module] = section(text, SESSION.rows[module])
    for name, sections in pages.items():
        rewrite(page_of(name), sections)


@pytest.fixture
def collected() -> set[tuple[str, str]]:
    """Module and name of every test of this run, chosen or not."""
    return SESSION.collected
