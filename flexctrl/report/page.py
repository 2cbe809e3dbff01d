"""A page that holds everything it shows."""

from __future__ import annotations

import base64
import html
import json
from collections.abc import Mapping, Sequence
from importlib.resources import files
from pathlib import Path
from string import Template
from typing import Any

from flexctrl.frozen import frozen

__all__ = ["Section", "page"]

_SWING = (
    '<div class="controls"><label>mode <select id="mode"></select></label>'
    '<label>size <input id="size" type="range" min="0" max="2" step="0.05" value="1"></label>'
    '<button id="play" type="button">pause</button></div><canvas id="swing" width="1200" height="760"></canvas>'
)


@frozen
class Section:
    """One tab of the page.

    Attributes
    ----------
    name : str
        An identifier.
    title : str
    text : str
        Shown as it is, in columns.
    lead : str
        What is to be seen here, for who sees it for the first time.
    more : str
        All that was tried, shown when it is asked for.
    pictures : tuple of Path
        PNG files, taken into the page.
    moving : bool
        Whether the modes are animated here.
    failed : bool
        Whether ``text`` says why there is nothing to show.
    """

    name: str
    title: str
    text: str
    pictures: tuple[Path, ...] = ()
    moving: bool = False
    failed: bool = False
    lead: str = ""
    more: str = ""


def page(title: str, subtitle: str, sections: Sequence[Section], motion: Mapping[str, Any]) -> str:
    """Return a page of HTML that needs nothing else: pictures, data and script are in it.

    Parameters
    ----------
    title, subtitle : str
    sections : sequence of Section
    motion : mapping
        From `animation`; empty if no section moves.

    Returns
    -------
    str
    """
    here = files("flexctrl.report")
    tabs = "".join(
        f'<button type="button" role="tab" data-section="{s.name}">{html.escape(s.title)}</button>' for s in sections
    )
    return Template((here / "page.html").read_text(encoding="utf-8")).substitute(
        title=html.escape(title),
        subtitle=html.escape(subtitle),
        tabs=tabs,
        sections="".join(_section(s) for s in sections),
        motion=json.dumps(motion, allow_nan=False).replace("</", "<\\/"),
        script=(here / "page.js").read_text(encoding="utf-8"),
    )


def _section(s: Section) -> str:
    kind = ' class="failed"' if s.failed else ""
    swing = _SWING if s.moving else ""
    pictures = "".join(_picture(p) for p in s.pictures)
    lead = f'<p class="lead">{html.escape(s.lead)}</p>' if s.lead else ""
    more = f"<details><summary>all that was tried</summary><pre>{html.escape(s.more)}</pre></details>" if s.more else ""
    text = f"<pre{kind}>{html.escape(s.text)}</pre>{more}"
    return f'<section id="{s.name}" role="tabpanel">{lead}{swing}{pictures}{text}</section>'


def _picture(path: Path) -> str:
    data = base64.b64encode(path.read_bytes()).decode("ascii")
    return f'<img alt="{html.escape(path.stem.replace("_", " "))}" src="data:image/png;base64,{data}">'
