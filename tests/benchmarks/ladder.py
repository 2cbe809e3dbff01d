"""The fidelity ladder of every scene shipped: docs/benchmarks/ladder.md and its picture.

OPENBLAS_NUM_THREADS=1 python tests/benchmarks/ladder.py --page
"""

from __future__ import annotations

import platform
import sys
from importlib.metadata import version
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import flexctrl as fc
from flexctrl.plots.ladder import rungs_chart

ROOT = Path(__file__).resolve().parents[2]
SCENES = sorted((ROOT / "examples").glob("*.toml"))
PAGE = """# The fidelity ladder

<!-- Made by `python tests/benchmarks/ladder.py --page` -->

One scene under ever more physics: rigid, with elastic shafts, linear (integrated exactly), beams as a few modes in
moving frames, full, refined (twice the elements, half the steps). Errors are against a certified reference, finer than
all of them: the largest $|Δy|$ of any output over its largest magnitude, so that an output that only flexibility makes
(`bend`) is wrong by 100 % on the rigid rungs. Times are processor time over that of a fixed calculation in the same
process, the shortest of several runs in turn; all that `simulate` does is in. A scene has no rung that changes nothing
of it (no shafts: no rung of shafts).

```{{image}} ../_static/fidelity_ladder.png
:alt: Error against time of every rung, one panel a scene
```

{tables}

Made with {versions}.

## What is to be seen

The goal, that every rung is several times faster than the next, is not reached on machines of this size, because the
full model has become as quick as the cheap ones:

- A run has a fixed cost of some milliseconds (equilibrium, books, tables of references, records) whatever its physics.
- A step costs 4 to 6 µs on every rung: the beams of the full model are computed four or eight at a time, while the
  rigid bodies that follow one another have to be placed one after the other (about 1,100 instructions on the bridge
  crane, 2,700 on the ceiling crane, whose rigid girder closes a loop).
- Where nodes are placed by others (rigid parts, the arm's drives), tangents are still made outside the compiled loops,
  at about a millisecond each; the arm makes some sixty of them.
- The linear rung costs products with matrices a step, whatever the frequencies in it. Where motion stays small (the
  bridge crane: 0.3 %) it is all that is needed.
- Component modes take away freedoms that a mesh of four elements a beam hardly has. They pay against a fine mesh, not
  against a coarse one.
"""


def main() -> None:
    found = [fc.ladder(fc.load_scene(str(path)), tolerance=0.02) for path in SCENES]
    for ladder in found:
        print(f"{ladder.name}\n{ladder}\n")
    if "--page" not in sys.argv[1:]:
        return
    figure = Figure(figsize=(5.0 * len(found), 4.4), layout="constrained")
    for ax, ladder in zip(np.atleast_1d(figure.subplots(1, len(found))), found, strict=True):
        rungs_chart(ax, ladder)
    figure.savefig(ROOT / "docs" / "_static" / "fidelity_ladder.png", dpi=100)
    versions = ", ".join(f"{name} {version(name)}" for name in ("numpy", "casadi", "llvmlite"))
    text = PAGE.format(
        tables="\n\n".join(table(ladder) for ladder in found),
        versions=f"Python {platform.python_version()}, {versions}; {platform.machine()}, {platform.system()}",
    )
    (ROOT / "docs" / "benchmarks" / "ladder.md").write_text(text, encoding="utf-8")


def table(ladder: fc.Ladder) -> str:
    rows = [
        f"## {ladder.name}",
        "",
        "| rung | freedoms | steps | error | time | next takes |",
        "|---|---|---|---|---|---|",
    ]
    for rung, gain in zip(ladder.rungs, (*ladder.gains, np.nan), strict=True):
        beyond = f"{gain:.1f} ×" if np.isfinite(gain) else ""
        told = f"{rung.error:.1e} | {rung.time_ratio:.2f}" if not rung.failure else f"{rung.failure} |"
        rows.append(f"| {rung.name} | {rung.freedoms} | {rung.steps} | {told} | {beyond} |")
    agreed = ladder.reference.uncertainty
    return "\n".join([*rows, "", f"Reference: {ladder.reference.setting}; known to {agreed:.1e}."])


if __name__ == "__main__":
    main()
