"""The page of a race: docs/benchmarks.md and its plot, made of what `race` found."""

from __future__ import annotations

import platform
from importlib.metadata import version
from pathlib import Path
from typing import Any

DOCS = Path(__file__).resolve().parents[2] / "docs"
_HEAD = """\
# Benchmarks

<!-- Made by `python tests/benchmarks/race.py --page` -->

Against another code in one run with it, as ratios: seconds belong to a machine, ratios much less so. This page is
dynamics against [Exudyn](https://github.com/jgerstmayr/EXUDYN), a multibody code in C++. Each page is made by a script
in `tests/benchmarks/`; the others are:

```{toctree}
:maxdepth: 1
benchmarks/linear
benchmarks/ladder
benchmarks/effects
```

In every comparison both codes take turns in one run, on one thread; the least CPU time of several tries counts. Ratios
are told; where there are seconds, they are those of a host with other work to do. All sections are of one run.

Exudyn has its fastest settings: `sys.exudynFast`, generalised alpha with spectral radius 0.9, `EigenSparse`,
modified Newton with rtol 1e-5 and atol 1e-7, no files, internal sensors; its `ANCFCable` is its quickest element here
(no torsion; its beams with torsion take several times as long). Building the model is left out
for both, everything that `simulate` and `SolveDynamic` do is in, but for the coarser runs that tell how far ours are
off (`Unchecked`). These are made where much moves far, as in the full swing after a second, and take half the time of a
run, or 1.2 times where there is something to be told; several times as long where a law in Python samples a machine
that rings, with forces among its outputs.
"""
_CRANE = """\
## The paper's crane, 50 ms

Least time in which $x_1 - x_4$ is right to a given error (RMS, against the converged run of either code: 32 elements a
member, 5 µs; these two are {gap:.1e} m apart), over meshes, steps and methods of each code.

| error | flexctrl | Exudyn | time ratio | goal |
|---|---|---|---|---|
{rows}

```{{image}} _static/race_2.png
:alt: Error of x1 - x4 against CPU time for all settings tried, both codes
:width: 70%
```

Time is relative to the quickest setting of Exudyn that reaches 1e-3 m. A point is one mesh, step and method.
"""
_CHAINS = """\
## Chains

A chain of {length} m (1 kg/m, EA = 2π·10⁵ N, EI = 1 N m²) of cable elements, held at its upper end and let go without
tension at 0.05 rad from the vertical (easy) or from the horizontal (full swing); steps of 1 ms. Our elements have
torsion, Exudyn's cable has none.

| chain | elements | steps | Newton iterations a step, flexctrl / Exudyn | time per step, ratio | goal |
|---|---|---|---|---|---|
{rows}

{missed}

Our time per step grows with an exponent of {growth} over chains of 10 to {largest} elements (goal: 1.05, {verdict}).
From 100 on, where what a step costs by itself counts no more, it is {large} (so the goal is {beyond}). Both are of
steps {first} to {last}, one motion for all sizes, through the whip of the free end. {told}
From 500 elements on nodes are eliminated one by one, not two at once: that is a third more work in solving, and a
quarter fewer numbers; and they are placed, turned and pushed 64 at a time, while they are near. 10,000 go through 16
MB an iteration, in a cache that processors share.

Each run is timed right after three steps of the same code, as the crane's are right after themselves. Right after a
run of the other, with caches full of what that needs, 1,000 steps of 100 elements took us a third longer, 400 of 3,000
a sixth: setting out is Python. So it was timed until 30 November 2026. Within one hour of that day easy chains of 100,
1,000 and 3,000 elements came out at 0.22, 0.21 and 0.22 so and at 0.16, 0.16 and 0.18 as now, full swings at 0.14, 0.13
and 0.13 and at 0.08, 0.09 and 0.11, the first crane at 0.31 and at 0.30.

Ratios belong to a machine less than seconds do, and do all the same. On a host (AMD, AVX-512, a far cache of 32 MB)
where nodes were eliminated one by one from 4,000 elements on, the crane came out at 0.27, 0.13 and 0.08, easy chains
of 100 to 3,000 elements at 0.18 to 0.16, full swings at 0.08 to 0.09, growth, here and below from 100 elements on, at
0.98 and 1.00 (up to 1.05, and 1.08 beside other work), a controller at 6.5 µs, a cold start at 1.1 s. On another
(Intel, AVX-512, its far cache slower) easy chains came out at 0.18 to 0.32 within three hours, full swings at 0.11 to
0.16, growth at 1.03 to 1.05 (easy) and 1.09 to 1.13 (full swing), the crane at 0.29 to 0.32, 0.13 to 0.15 and 0.09 to
0.10. Forces take an eighth less since, a step of 100 elements 8 % less, one of 1,000 4 %: ratios gained what they had
missed, and growth lost as much. Tiles took 8 to 9 % off a step of 10,000, reading less another 8, and tangents that
fine beams keep longer 20 % through the whip. All these exponents were of steps 100 to 400 of 10,000 elements beside
steps 500 to 2,500 of fewer: 1.07 in the full swing was 1.14 over one motion. Tangents in single precision took 5 to
12 % off steps of 3,000 elements and more since.
"""
_SWING = """\
The full swing of {elements} elements over {steps} steps, through the lowest point and the whip of the
free end: flexctrl finishes; Exudyn: {theirs}. Ratio of the times: {ratio:.2f}.
"""
_LOOP = """\
## A controller in Python at every step

The crane with one element a member and steps of 0.1 ms, under a proportional controller that is read at every
step: {over:.1f} µs a step over open loop (goal: 15 µs, {verdict}), where an open-loop step takes {open:.1f} µs on this
host. The same law as a continuous `control.StateSpace`, solved together with the step, takes {smooth:.1f} times the
open-loop step. Looking for growth at both ends of a run under it takes as long as {ends:.0f} open-loop steps, once.

A *continuous* controller together with `MotorLag`, `LuGreFriction`, `CoulombFriction` or `Backlash` takes its steps in
Python: 70 to 250 times as long a step as without that effect. A sampled law is some 140 times quicker there with lag or
bristles, and about ten to twenty times with dry friction or play, whose corners cost it time as well.
"""
_COLD = """\
## From a cold process to the first result

CPU time of a new process until the crane's first 500 steps are done, imports included: {empty:.2f} s with an empty
cache, compiling everything (goal: 1.5 s, {verdict}), {kept:.2f} s with code kept by an earlier process. Python, numpy
and casadi take {libraries:.2f} s of that, scipy and llvmlite {others:.2f} s, and the compiler {compiler:.2f} s.
`import flexctrl` takes {imported:.0f} ms beyond numpy and casadi (goal: 150 ms, {imports}); its parts, and scipy, when
first used. Python's bytecode is there, as after an installation.
"""


def write(found: dict[str, Any]) -> None:
    """Write the page and the plot."""
    parts = [_HEAD, versions()]
    makers = {"crane": crane, "chains": chains, "loop": loop, "cold": cold}
    parts += [makers[name](result) for name, result in found.items()]
    page = DOCS / "benchmarks.md"
    page.parent.mkdir(exist_ok=True)
    page.write_text("\n".join(parts), encoding="utf-8")
    if "crane" in found:
        plot(found["crane"], DOCS / "_static" / "race_2.png")


def versions() -> str:
    names = ("exudyn", "numpy", "casadi", "llvmlite")
    told = ", ".join(f"{name} {version(name)}" for name in names)
    return f"Python {platform.python_version()}, {told}; {platform.machine()}, {platform.system()}.\n"


def crane(found: dict[str, Any]) -> str:
    rows = []
    for target, best in found["best"].items():
        ours, theirs = best["flexctrl"], best["Exudyn"]
        ratio = ours["seconds"] / theirs["seconds"]
        rows.append(f"| {target} m | {_setting(ours)} | {_setting(theirs)} | **{ratio:.2f}** | 0.33 |")
    return _CRANE.format(gap=found["gap"], rows="\n".join(rows))


def _setting(p: dict[str, Any]) -> str:
    return f"{p['elements']} elements a member, {1e3 * p['step']:g} ms, {p['name']}: {p['error']:.1e} m"


def chains(found: dict[str, Any]) -> str:
    from exudyn_chain import LENGTH

    rows = []
    for row in found["rows"]:
        goal = "0.20" if row["elements"] >= 100 else "–"
        newton = " / ".join(f"{k:.1f}" for k in row["newton"])
        ratio = row["ours"] / row["theirs"]
        rows.append(f"| {row['swing']} | {row['elements']} | {row['steps']} | {newton} | **{ratio:.2f}** | {goal} |")
    growths = found["growth"]
    above = [
        r for r in found["rows"] if r["elements"] >= 100 and r["ours"] / r["theirs"] > 0.205
    ]  # as told, to two digits
    missed = ", ".join(f"{r['elements']} elements, {r['swing']} ({r['ours'] / r['theirs']:.2f})" for r in above)
    text = _CHAINS.format(
        length=LENGTH,
        rows="\n".join(rows),
        missed=f"The goal is missed at {missed}." if above else "The goal is reached in all rows.",
        largest=max(growths["easy"]["elements"]),
        first=f"{growths['easy']['steps'][0]:,}",
        last=f"{growths['easy']['steps'][1]:,}",
        told=_why(growths),
        verdict=_verdict(all(g["exponent"] <= 1.055 for g in growths.values())),
        growth=", ".join(f"{g['exponent']:.2f} ({name})" for name, g in growths.items()),
        beyond=_verdict(all(g["large"] <= 1.055 for g in growths.values())),
        large=", ".join(f"{g['large']:.2f} ({name})" for name, g in growths.items()),
    )
    return "\n".join([text, *(_SWING.format(**swing) for swing in found["swings"])])


def _why(growths: dict[str, Any]) -> str:
    """What grows beside the number of elements, in numbers."""
    parts = []
    for name, g in growths.items():
        times = " / ".join(f"{1e9 * t / n:.0f}" for t, n in zip(g["times"], g["elements"], strict=True))
        newton = " / ".join(f"{k:.2f}" for k in g["newton"])
        parts.append(f"{times} ns an element and step, {newton} iterations a step ({name})")
    sizes = " / ".join(f"{n:,}" for n in growths["easy"]["elements"])
    size, largest = growths["easy"]["bytes"], growths["easy"]["elements"][-1]
    return (
        f"At {sizes} elements a step takes {'; '.join(parts)}. What grows is the way to memory: an "
        f"iteration goes through {size / 1e3:.1f} kB an element, {1e-6 * size * 100:.1f} MB at 100 elements, which "
        f"stay in the processor's own cache, and {1e-6 * size * largest:.0f} MB at {largest:,}, which do not."
    )


def _verdict(reached: bool) -> str:
    return "reached" if reached else "missed"


def loop(found: dict[str, Any]) -> str:
    verdict = _verdict(found["over"] <= 15e-6)
    smooth = found["smooth"] / found["open"]
    over, still, ends = 1e6 * found["over"], 1e6 * found["open"], found["ends"]
    return _LOOP.format(over=over, open=still, smooth=smooth, ends=ends, verdict=verdict)


def cold(found: dict[str, Any]) -> str:
    return _COLD.format(
        empty=found["empty"],
        kept=found["kept"],
        imported=1e3 * found["import"],
        libraries=found["libraries"],
        others=found["others"],
        compiler=found["empty"] - found["kept"],
        verdict=_verdict(found["empty"] <= 1.5),
        imports=_verdict(found["import"] <= 0.15),
    )


def plot(found: dict[str, Any], path: Path) -> None:
    """Error against time, both codes."""
    import matplotlib.pyplot as plt

    unit = found["best"]["0.001"]["Exudyn"]["seconds"]
    figure, ax = plt.subplots(figsize=(6.0, 4.0), layout="constrained")
    for code, style in (("flexctrl", "o"), ("Exudyn", "^")):
        points = sorted((p["seconds"] / unit, p["error"]) for p in found["points"] if p["code"] == code)
        front, least = [], float("inf")
        for seconds, error in points:
            if error < least:
                front.append((seconds, error))
                least = error
        (line,) = ax.loglog(*zip(*front, strict=True), "-", lw=1.5)
        ax.loglog(*zip(*points, strict=True), style, ms=4, color=line.get_color(), label=code)
    ax.set(xlabel="CPU time (1: Exudyn's quickest to 1e-3 m)", ylabel="error of x₁ − x₄ [m RMS]")
    ax.legend()
    ax.grid(alpha=0.3)
    figure.savefig(path, dpi=100)
