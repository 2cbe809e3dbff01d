"""Sphinx settings, and the API pages made from the public names."""

from __future__ import annotations

import inspect
from collections.abc import Iterator
from typing import Any

from docutils import nodes
from docutils.statemachine import StringList
from sphinx.util import logging
from sphinx.util.docutils import SphinxDirective
from sphinx.util.nodes import nested_parse_with_titles

import flexctrl
import flexctrl as fc

logger = logging.getLogger(__name__)
project = "flexctrl"
author = "the flexctrl authors"
version = release = flexctrl.__version__
extensions = ["sphinx.ext.autodoc", "sphinx.ext.mathjax", "sphinx.ext.viewcode", "numpydoc", "myst_parser"]
myst_enable_extensions = ["dollarmath", "amsmath", "deflist", "colon_fence"]
myst_heading_anchors = 3
numpydoc_show_class_members = False
autodoc_typehints = "none"
autodoc_member_order = "bysource"
toc_object_entries_show_parents = "hide"
exclude_patterns = ["_build"]
html_theme = "furo"
html_title = "flexctrl"
html_static_path = ["_static"]


def _names(level: str) -> Iterator[tuple[str, str]]:
    """Module and name of what is public at a level of the house, in reading order."""
    for module, names in fc._HOMES.items():
        if module.split(".")[1] == level:
            yield from ((module, name) for name in names)


def _rows(module: str, name: str) -> list[str]:
    value = getattr(fc, name)
    kind = "class" if inspect.isclass(value) else "function" if callable(value) else "data"
    members = ["   :members:"] if kind == "class" else ["   :no-value:"] if kind == "data" else []
    return [f".. auto{kind}:: {module}.{name}", *members, ""]


class PublicNames(SphinxDirective):
    """``{public-names} structure``: the public names of one level of the house."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        """Return their documentation."""
        rows = [row for module, name in _names(self.arguments[0]) for row in _rows(module, name)]
        if not rows:
            raise self.error(f"flexctrl has no public names at level {self.arguments[0]!r}")
        rows = ["```{eval-rst}", *rows, "```"]  # the page around is Markdown
        node = nodes.section()
        node.document = self.state.document
        nested_parse_with_titles(self.state, StringList(rows, source="flexctrl"), node)
        return node.children


def _magnitudes(app: Any, what: str, name: str, value: Any, options: Any, lines: list[str]) -> None:
    """Let bars stand for magnitudes, as in |K|, but in code and in what it prints."""
    printed = False
    for i, line in enumerate(lines):
        printed = bool(line.strip()) and (printed or line.lstrip().startswith(">>>"))
        if not printed:
            lines[i] = "``".join(s if k % 2 else s.replace("|", "\\|") for k, s in enumerate(line.split("``")))


def _complete(app: Any, env: Any) -> None:
    """Warn of public names that no page documents."""
    documented = env.domains["py"].objects
    for module, names in fc._HOMES.items():
        for name in names:
            if f"{module}.{name}" not in documented:
                logger.warning("no page documents flexctrl.%s", name)


def setup(app: Any) -> None:
    """Register the directive and what it needs."""
    app.add_directive("public-names", PublicNames)
    app.connect("autodoc-process-docstring", _magnitudes, priority=900)
    app.connect("env-check-consistency", _complete)
