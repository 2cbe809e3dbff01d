"""The page of the linear benchmark from its numbers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

__all__ = ["exponent", "linear_page", "table"]

INTRO = """# Linear analysis

Made by `OPENBLAS_NUM_THREADS=1 python tests/benchmarks/bench_linear.py --page`; everything on this page comes from one
run on one core, ours and theirs in turn. The ratios are their processor time over ours: above 1, flexctrl is faster.

Run with Python {python} on {machine}, numpy {numpy}, scipy {scipy}, python-control {control}, slycot {slycot},
Exudyn {exudyn}.
"""

MODES = """## Modes of a lattice girder

A crane girder of welded tubes on supports every 20 m; Exudyn is given the same matrices, sparse, as an
`ObjectGenericODE2`. By default its `ComputeODE2Eigenvalues` solves for all modes, dense; with `useSparseSolver` it
calls scipy's `eigsh` on the matrices it has exported dense. flexctrl's time holds the audit of the freedoms, the Sturm
count that no mode is missed, and gains of inputs and outputs; the others' hold none of these. The factors, the count
and Lanczos' recurrence run in compiled loops (extra `[fast]`).
The goal for 10 modes, {goal} times Exudyn as it comes, is {verdict}: {ratio}.
"""

RESPONSES = """## A response of 1000 points at 130 states

A beam of 65 freedoms against `control.frequency_response` of its scaled modal state space, which is made for it
beforehand. "First call" is on a model as `linearize` gives it, whose certificate knows its modes; "warm" is a second
call; "from scratch" starts at the matrices M, C, K and holds the search of all modes, which takes most of it. A few
dashpots are a correction of low rank to the sum over undamped modes; the first call compares it at a dozen frequencies
with solutions refined in extended precision. The goal, {goal} times python-control with SLICOT, is {warm} warm. At the
first call it is {first} with proportional damping and {first_dashpots} with dashpots, from scratch {proportional} and
{dashpots}.
"""

MODES_GOAL, RESPONSE_GOAL = 50, 20

LOCI = """## Root locus

Rate feedback at the tip of a cantilever, 20 gains. "Ours" is the largest relative step that Newton's method on
1 + k L(s) = 0 would still take from the poles found; "python-control" the largest relative distance of its poles from
these (poles under 1000 rad/s). flexctrl adds gains until the branches are smooth, and follows them.
"""

LARGE = """## Large models

The same girder, longer; every size in a process of its own. Times relative to the smallest, and the exponent p of
size^p over all sizes. "One by one" is a sparse factorisation at each of the 1000 frequencies, for the model with
dashpots; "difference" is to these. Memory is what the process took at its peak beyond a girder of six bays, for all
columns together.
"""


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Markdown; the first column to the left, the others to the right.

    Parameters
    ----------
    head : sequence of str
    rows : sequence of sequence of str

    Returns
    -------
    str
    """
    rule = ["---"] + ["---:"] * (len(head) - 1)
    return "\n".join("| " + " | ".join(row) + " |" for row in (head, rule, *rows)) + "\n"


def exponent(sizes: Sequence[float], values: Sequence[float]) -> float:
    """p of the best fit value ~ size^p.

    Parameters
    ----------
    sizes, values : sequence of float

    Returns
    -------
    float
    """
    return float(np.polyfit(np.log(sizes), np.log(values), 1)[0])


def linear_page(found: Mapping[str, Any]) -> str:
    """The page.

    Parameters
    ----------
    found : mapping
        What the benchmark measured.

    Returns
    -------
    str
        Markdown.
    """
    pieces = [
        INTRO.format(**found["setting"]),
        MODES.format(**_modes_verdict(found["modes"])),
        _modes(found["modes"]),
        RESPONSES.format(**_responses_verdict(found["responses"])),
        _responses(found["responses"]),
        LOCI,
        _loci(found["loci"]),
        LARGE,
        _large(found["large"]),
    ]
    return "\n".join(pieces)


def _modes_verdict(rows: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    own = next(row["ratio"] for row in rows if row["modes"] == 10 and "default" in row["route"])
    return {"goal": MODES_GOAL, "verdict": _verdict([own], MODES_GOAL), "ratio": _times(own)}


def _responses_verdict(rows: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    with_slicot = [row for row in rows if row["slicot"]]
    found, first = (
        {row["damping"]: _verdict([row[which]], RESPONSE_GOAL) for row in with_slicot}
        for which in ("ratio_from_scratch", "ratio_first")
    )
    warm = _verdict([row["ratio"] for row in with_slicot], RESPONSE_GOAL)
    return {
        "goal": RESPONSE_GOAL,
        "warm": warm,
        "first": first["proportional"],
        "first_dashpots": first["with dashpots"],
        "proportional": found["proportional"],
        "dashpots": found["with dashpots"],
    }


def _verdict(ratios: Sequence[float], goal: float) -> str:
    return "reached" if min(ratios) >= goal else "not reached"


def _modes(rows: Sequence[Mapping[str, Any]]) -> str:
    lines = [
        [row["route"], str(row["freedoms"]), str(row["modes"]), _times(row["ratio"]), f"{row['difference']:.0e}"]
        for row in rows
    ]
    return table(["against", "freedoms", "modes", "ratio", "difference of ω²"], lines)


def _responses(rows: Sequence[Mapping[str, Any]]) -> str:
    lines = [
        [
            f"{row['damping']}, control {'with' if row['slicot'] else 'without'} SLICOT",
            str(row["states"]),
            _times(row["ratio"]),
            _times(row["ratio_first"]),
            _times(row["ratio_from_scratch"]),
            f"{row['difference']:.0e}",
        ]
        for row in rows
    ]
    return table(["damping", "states", "warm", "first call", "from scratch", "relative difference"], lines)


def _loci(rows: Sequence[Mapping[str, Any]]) -> str:
    lines = [
        [
            str(row["states"]),
            f"{row['own']:.0e}",
            row["refused"] or f"{row['difference']:.0e}",
            "" if row["refused"] else _times(row["ratio"]),
        ]
        for row in rows
    ]
    return table(["states", "ours", "python-control", "ratio"], lines)


def _large(rows: Sequence[Mapping[str, Any]]) -> str:
    keys = ("linearise", "modes", "response", "response_dashpots", "memory")
    sizes = [row["freedoms"] for row in rows]
    lines = [
        [
            f"{row['freedoms']:,}",
            *(_times(row[key] / rows[0][key]) for key in keys),
            _times(row["one_by_one"] / row["response_dashpots"]),
            f"{row['difference']:.0e}",
        ]
        for row in rows
    ]
    fits = [f"{exponent(sizes, [row[key] for row in rows]):.2f}" for key in keys]
    lines.append(["exponent p", *fits, "", ""])
    head = [
        "freedoms",
        "linearise",
        "20 modes",
        "1000 points, Rayleigh",
        "1000 points, dashpots",
        "memory",
        "one by one",
        "difference",
    ]
    return table(head, lines)


def _times(ratio: float) -> str:
    return f"{ratio:.0f} ×" if ratio >= 10 else f"{ratio:.1f} ×"
