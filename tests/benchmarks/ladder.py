"""The fidelity ladder of every scene shipped: docs/benchmarks/ladder.md and its picture.

OPENBLAS_NUM_THREADS=1 python tests/benchmarks/ladder.py --page
"""

from __future__ import annotations

import platform
import sys
import time
from dataclasses import replace
from importlib.metadata import version
from itertools import pairwise
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
moving frames, full, refined (four times the elements, half the steps, none longer than half a sample). Where a scene's
steps are fixed, rigid parts and component modes take one for four. Errors are against a certified reference, finer
than all of them: the largest $|Δy|$ of any output over its largest magnitude, so that an output that only flexibility
makes (`bend`) is wrong by 100 % on the rigid rungs. Times are processor time over that of a fixed calculation in the
same process, the shortest of several runs in turn; all that `simulate` does is in. What of it belongs to steps and
what to the run, however long, follows from a run four times as long. A scene has no rung that changes nothing of it
(no shafts: no rung of shafts). Worth standing on are, from the last one downwards, the most accurate of the rungs at
least twice as fast: the line in the picture.

```{{image}} ../_static/fidelity_ladder_3.png
:alt: Error against time of every rung, one panel a scene
```

{tables}

{saved}

Made with {versions}.

## What is to be seen

The goal, that every rung is several times faster than the next, is reached from the linear rung to those that bend and
from the full one to the refined one. It is not between the first three, nor always below the full one:

- The rigid rungs take a third to a quarter of the full model's time. A machine of a dozen freedoms or less marches on
  kernels of all of it: one gives the accelerations, eliminated in place, one puts nodes and drives at the end of a
  step. On the bridge crane that is 600 instructions where its pieces and levers, one by one, took 2,300. The mass does
  for a tangent, so nothing is factorised; where shafts are stiff for the step, tangents take over.
- Elastic shafts cost rigid machines nearly nothing: a few instructions and no shorter steps. Rigid, shafts and linear
  are within a microsecond a step of each other, half of which any step takes (controller, outputs, books): they cannot
  be several times apart.
- The linear rung is a product with a matrix a sample, on modal states that nothing couples; nodes are placed only for
  pictures. It costs as little as the rigid rungs and bends: where motion stays small (the bridge crane: 0.3 %) it is
  all that is needed, and the ledger takes it, with the few modes that matter.
- Component modes save most where beams need no nodes within: the arm has two elements and 20 freedoms instead of six
  and 40, and one kernel for all its forces. The trolley of the bridge crane keeps a node with six freedoms amid the
  girder: two elements instead of four, 22 freedoms instead of 30. To push two elements with modes takes as long as four
  plain ones (371 and 359 ns, side by side), so little is gained there; a girder of one element whose inner node
  followed its modes would be about half as quick again. Of the 45 freedoms of the ceiling crane 27 are the chain's, and
  three of five elements, which stay as they are; its girder's long elements bend so far that nearly every step takes a
  tangent of its own. Its rung is the quicker one by its longer steps.
- The refined rung is what one would take to be sure: four times the elements and half the steps. It takes three to
  four times as long as the full one.
- A run has a fixed cost of about a millisecond (start, books, records, checkpoint), whatever its physics: it is
  a good part of the cheap rungs of short runs, and why these are less apart there than their steps are. What else is
  told beside the steps is motion at the beginning, whose steps take more iterations than those of the rest after it.
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
    figure.savefig(ROOT / "docs" / "_static" / "fidelity_ladder_3.png", dpi=100)
    versions = ", ".join(f"{name} {version(name)}" for name in ("numpy", "casadi", "llvmlite"))
    text = PAGE.format(
        tables="\n\n".join(table(fc.load_scene(str(p)), ladder) for p, ladder in zip(SCENES, found, strict=True)),
        saved=saved(),
        versions=f"Python {platform.python_version()}, {versions}; {platform.machine()}, {platform.system()}",
    )
    (ROOT / "docs" / "benchmarks" / "ladder.md").write_text(text, encoding="utf-8")


def table(scene: fc.Scene, ladder: fc.Ladder) -> str:
    rows = [
        f"## {ladder.name}",
        "",
        f"{scene.simulation.until:g} s.",
        "",
        "| rung | freedoms | steps | error | time | next takes | µs a step | ms a run beside |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for rung, gain in zip(ladder.rungs, (*ladder.gains, np.nan), strict=True):
        beyond = f"{gain:.1f} ×" if np.isfinite(gain) else ""
        error = f"{rung.error:.1e}" if rung.error > ladder.reference.uncertainty else "as the reference"
        told = f"{error} | {rung.time_ratio:.2f}" if not rung.failure else f"{rung.failure} |"
        step, rest = (np.nan, np.nan) if rung.failure else shares(scene, rung)
        cost = f"{1e6 * step:.2f} | {1e3 * rest:.1f}"
        rows.append(f"| {rung.name} | {rung.freedoms} | {rung.steps} | {told} | {beyond} | {cost} |")
    agreed = ladder.reference.uncertainty
    climb = ladder.climb
    steps = [f"{b.time_ratio / a.time_ratio:.1f} ×" for a, b in pairwise(climb)]
    worth = f"Worth standing on: {', '.join(r.name for r in climb)} ({', '.join(steps)} apart)."
    return "\n".join([*rows, "", worth, "", f"Reference: {ladder.reference.setting}; known to {agreed:.1e}."])


def saved() -> str:
    """What the minimal set of the effect ledger saves on the bridge crane, by the length of the run."""
    scene = fc.load_scene(str(ROOT / "examples" / "bridge_crane.toml"))
    found, rows = fc.ledger(scene, fc.Within(outputs=0.01)), []
    answer = fc.ledger(scene, 0.01)
    for until in (30.0, 60.0, 120.0):
        full, least = (timed(lasting(one, until))[0] for one in (scene, found.scene))
        rows.append(f"| {until:g} s | {1e3 * full:.1f} | {1e3 * least:.1f} | {full / least:.1f} × |")
    return "\n".join(
        [
            "## What the effect ledger saves",
            "",
            f"The bridge crane's minimal set for outputs within 1 % keeps {', '.join(found.minimal_set)}: within "
            f"{100.0 * found.minimal_change.outputs_worst:.2f} %. It is linear and integrated exactly, "
            f"with {found.modes} vibrations. `fc.ledger` itself, which times every set a few times, says "
            f"{found.speedup:.1f} × for the scene as it is shipped, {scene.simulation.until:g} s (there, held, and "
            "back). Where poles and margins are to be within 1 % too, it keeps "
            f"{', '.join(n for n in answer.minimal_set if n not in found.minimal_set) or 'nothing'} beside: "
            f"{answer.speedup:.1f} ×. Shorter and longer runs tell what a second costs beside what a run costs.",
            "",
            "| run | full [ms] | minimal [ms] | faster |",
            "|---|---|---|---|",
            *rows,
        ]
    )


def lasting(scene: fc.Scene, until: float) -> fc.Scene:
    """A scene of another length."""
    return scene.with_(controller=scene.law, simulation=replace(scene.simulation, until=until, rigid_twin=False))


def shares(scene: fc.Scene, rung: fc.Rung) -> tuple[float, float]:
    """Processor time of a step, and of what a run needs beside its steps [s]."""
    plan = replace(scene.simulation, every=scene.simulation.every or scene.simulation.until / 1000, rigid_twin=False)
    base = scene.with_(controller=scene.law)
    once, more = (timed(rung.setting.of(base.with_(simulation=replace(plan, until=f * plan.until)))) for f in (1, 4))
    step = (more[0] - once[0]) / (more[1] - once[1])
    return step, once[0] - step * once[1]


def timed(scene: fc.Scene) -> tuple[float, int]:
    """The shortest processor time of several runs, and their steps."""
    steps, times = scene.run().report.steps, []
    for _ in range(20):
        began = time.process_time()
        scene.run()
        times.append(time.process_time() - began)
    return min(times), steps


if __name__ == "__main__":
    main()
