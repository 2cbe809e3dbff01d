"""What a command answers, and how it is written down."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import field
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from flexctrl.frozen import frozen


@frozen
class Answer:
    """What a command gives back.

    Attributes
    ----------
    text : str
        A short table for people.
    data : dict
        The same for programs, ready for JSON.
    problem : str
        Why the command failed although it has results; empty if it did not.
    interrupted : bool
        Whether it was stopped, and nothing is to be done after it.
    """

    text: str
    data: dict[str, Any] = field(default_factory=dict)
    problem: str = ""
    interrupted: bool = False


def plain(value: Any) -> Any:
    """Return a value as JSON knows it: numpy's numbers as Python's, what is not finite as null.

    Parameters
    ----------
    value : object
        Mappings, sequences, arrays, numbers, texts; complex numbers become [re, im].

    Returns
    -------
    object
    """
    if isinstance(value, Mapping):
        return {str(k): plain(v) for k, v in value.items()}
    if isinstance(value, np.ndarray):
        return [plain(v) for v in value.tolist()]
    if isinstance(value, list | tuple | set | frozenset):
        return [plain(v) for v in value]
    if isinstance(value, complex | np.complexfloating):
        return [plain(value.real), plain(value.imag)]
    if isinstance(value, bool | np.bool_):
        return bool(value)
    if isinstance(value, int | np.integer):
        return int(value)
    if isinstance(value, float | np.floating):
        return float(value) if math.isfinite(value) else None
    return value


def grid(heads: Sequence[str], rows: Iterable[Sequence[object]], left: int = 1) -> str:
    """Return a table in plain text.

    Parameters
    ----------
    heads : sequence of str
    rows : iterable of sequence
        Numbers are shown with five digits.
    left : int
        How many columns, from the first, are set to the left.

    Returns
    -------
    str
    """
    cells = [list(heads), *([_cell(v) for v in row] for row in rows)]
    wide = [max(len(row[i]) for row in cells) for i in range(len(heads))]
    lines = [
        "  ".join(f"{c:<{w}}" if i < left else f"{c:>{w}}" for i, (c, w) in enumerate(zip(row, wide, strict=True)))
        for row in cells
    ]
    return "\n".join(line.rstrip() for line in lines)


def _cell(value: object) -> str:
    if isinstance(value, float | np.floating):
        return f"{value:.5g}" if math.isfinite(value) else "–"
    return str(value)


def write_json(out: Path | None, name: str, data: Any) -> None:
    """Write an answer's data beside its pictures."""
    if out is not None:
        text = json.dumps(data, indent=1, allow_nan=False, ensure_ascii=False)
        (out / name).write_text(text + "\n", encoding="utf-8")


def write_csv(out: Path | None, name: str, columns: Mapping[str, Sequence[Any] | np.ndarray]) -> None:
    """Write columns with a line of names."""
    if out is not None:
        rows = zip(*columns.values(), strict=True)
        lines = [",".join(columns), *(",".join(_exact(v) for v in row) for row in rows)]
        (out / name).write_text("\n".join(lines) + "\n", encoding="utf-8")


def _exact(value: Any) -> str:
    return repr(float(value)) if isinstance(value, float | np.floating) else str(value)


def write_picture(out: Path | None, name: str, draw: Callable[[Figure], object], size: tuple[float, float]) -> None:
    """Draw into a new figure and write it as a PNG file; nothing is shown on a screen."""
    if out is not None:
        figure = Figure(figsize=size)
        draw(figure)
        figure.savefig(out / name, dpi=150, bbox_inches="tight", pad_inches=0.15)


__all__ = ["Answer", "grid", "plain", "write_csv", "write_json", "write_picture"]
