"""flexctrl against Exudyn in one run, on one thread, alternately.

    python tests/benchmarks/race.py [crane chains loop cold] [--quick] [--page]

Needs the extras ``[fast]`` and ``[bench]``. Times are CPU seconds of this process, the least of several runs, the two
codes in turns; what is told are ratios. With ``--page`` the run makes ``docs/benchmarks.md`` and its plot.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, partial
from typing import ClassVar

os.environ["OPENBLAS_NUM_THREADS"] = "1"

import control
import numpy as np
from exudyn_chain import AXIAL_STIFFNESS, BENDING_STIFFNESS, LENGTH, MASS_PER_LENGTH, exudyn_chain
from exudyn_crane import DATA, DURATION, PUSH, exu, exudyn_crane
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

import flexctrl as fc
from flexctrl.cranes import ceiling_crane
from flexctrl.model.flat.flattening import flatten

EFFECTS = (fc.Gravity(), fc.Flexible(), fc.LargeRotation())
TARGETS = (1e-3, 1e-4, 1e-5)
MESHES = {1e-3: (2, 3, 4), 1e-4: (6, 8, 10), 1e-5: (20, 24)}
STEPS = {1e-3: (1.2e-3, 1e-3, 8e-4, 6e-4, 5e-4, 4e-4), 1e-4: (2e-4, 1.5e-4, 1.25e-4, 1e-4), 1e-5: (3e-5, 2.5e-5, 2e-5)}
CHAINS = (10, 100, 1000, 3000)
LARGEST = 10_000
SWINGS = {"easy": 0.05, "full swing": 0.5 * np.pi}
CHAIN_STEP = 1e-3
STEPS_OF_LOOPS = fc.Unchecked(fc.GeneralizedAlpha(1e-4))
_FINALISTS = 4
_BRIEF = 0.3
_LONG = 6


@dataclass(frozen=True)
class Setting:
    """One way to compute the crane; ``run`` gives its times, x1 − x4 there, and the CPU time it took."""

    code: str
    elements: int
    step: float
    name: str
    run: Callable[[], tuple[NDArray[np.float64], NDArray[np.float64], float]]


@dataclass(frozen=True)
class Timed:
    """A setting with its error (m RMS) and least CPU time (s)."""

    code: str
    elements: int
    step: float
    name: str
    error: float
    seconds: float


@cache
def crane_model(elements: int) -> fc.Model:
    return fc.assemble(ceiling_crane(elements=elements), EFFECTS)


def our_crane(elements: int, method: fc.Unchecked) -> tuple[NDArray[np.float64], NDArray[np.float64], float]:
    model = crane_model(elements)
    started = time.process_time()
    run = fc.simulate(model, until=DURATION, inputs={"push": PUSH}, method=method)
    seconds = time.process_time() - started
    return run.t, run["x1_minus_x4"], seconds


def their_crane(elements: int, step: float, reduced: bool) -> tuple[NDArray[np.float64], NDArray[np.float64], float]:
    run = exudyn_crane(elements, step, reduced_integration=reduced)
    return run.t, run.x1_minus_x4, run.seconds


def settings_for(target: float, quick: bool) -> list[Setting]:
    """The settings that may reach a target."""
    found = []
    for n in MESHES[target][:: 2 if quick else 1]:
        for h in STEPS[target][:: 2 if quick else 1]:
            for rho in (0.9, 0.5):
                ours = partial(our_crane, n, fc.Unchecked(fc.GeneralizedAlpha(h, rho)))
                found.append(Setting("flexctrl", n, h, f"generalised alpha, ρ = {rho}", ours))
            for reduced in (False, True) if target > 1e-5 else (True,):
                rule = "reduced" if reduced else "full"
                found.append(Setting("Exudyn", n, h, f"cable, {rule} integration", partial(their_crane, n, h, reduced)))
    return found


def references() -> list[tuple[NDArray[np.float64], NDArray[np.float64]]]:
    """The two converged runs: Exudyn's, and our own with as fine a mesh and step."""
    theirs = np.genfromtxt(DATA, delimiter=",", names=True, skip_header=3)
    t, x, _ = our_crane(32, fc.Unchecked(fc.GeneralizedAlpha(5e-6)))
    return [(theirs["t"], theirs["x1_minus_x4"]), (theirs["t"], CubicSpline(t, x)(theirs["t"]))]


def apart(t: NDArray[np.float64], x: NDArray[np.float64], t_r: NDArray[np.float64], x_r: NDArray[np.float64]) -> float:
    return float(np.sqrt(np.mean((CubicSpline(t, x)(t_r) - x_r) ** 2)))


def surveyed(setting: Setting, references: list[tuple[NDArray[np.float64], NDArray[np.float64]]]) -> Timed | None:
    """Error against the nearer of the converged runs (each code's own is the nearer one), and a first time."""
    try:
        t, x, seconds = setting.run()
    except exu.SolverError:
        return None
    error = min(apart(t, x, *reference) for reference in references)
    return Timed(setting.code, setting.elements, setting.step, setting.name, error, seconds)


def crane_race(quick: bool) -> dict[str, object]:
    """All settings tried once; the quickest that reach a target, timed in turns, brief ones right after themselves."""
    known = references()
    points: list[Timed] = []
    best: dict[str, dict[str, Timed]] = {}
    for target in TARGETS:
        settings = settings_for(target, quick)
        tried = [(s, p) for s in settings if (p := surveyed(s, known)) is not None]
        tried = [
            (s, min(p, surveyed(s, known) or p, key=lambda q: q.seconds) if p.seconds < _BRIEF else p) for s, p in tried
        ]
        finalists = [
            pair
            for code in ("flexctrl", "Exudyn")
            for pair in sorted(
                ((s, p) for s, p in tried if s.code == code and p.error <= target), key=lambda pair: pair[1].seconds
            )[:_FINALISTS]
        ]
        times: dict[str, list[float]] = {}
        # runs of milliseconds are timed often: each is the least of its times
        for _ in range(3 if quick or target < 1e-4 else 10 if target < 1e-3 else 40):
            for s, p in finalists:
                if p.seconds < _BRIEF:
                    s.run()
                times.setdefault(repr(s), []).append(s.run()[2])
        final = [Timed(**{**vars(p), "seconds": min(times[repr(s)])}) for s, p in finalists]
        points += [p for _, p in tried]
        best[f"{target:g}"] = {
            code: min((p for p in final if p.code == code), key=lambda p: p.seconds) for code in ("flexctrl", "Exudyn")
        }
        ours, theirs = best[f"{target:g}"].values()
        print(f"crane to {target:g} m: {ours.seconds / theirs.seconds:.3f} of Exudyn's time\n  {ours}\n  {theirs}")
    gap = apart(*known[0], *known[1])
    print(f"converged runs apart: {gap:.1e} m RMS")
    return {
        "gap": gap,
        "points": [vars(p) for p in points],
        "best": {k: {c: vars(p) for c, p in v.items()} for k, v in best.items()},
    }


@cache
def chain_model(elements: int, angle: float) -> fc.Model:
    """The chain of `exudyn_chain`."""
    section = fc.Section(
        EA=AXIAL_STIFFNESS,
        EI_y=BENDING_STIFFNESS,
        EI_z=BENDING_STIFFNESS,
        GJ=BENDING_STIFFNESS,
        rhoA=MASS_PER_LENGTH,
        rhoJ=1e-4,
    )
    end = LENGTH * np.array([np.sin(angle), 0.0, -np.cos(angle)])
    beam = fc.Beam("chain", (0, 0, 0), tuple(end), section, elements=elements)
    outputs = [fc.Position(f"tip_{d}", at=beam.end, direction=d) for d in "xyz"]
    return fc.assemble(fc.Structure([beam], [fc.Support(beam.start, held="u v w")], [], [], outputs), EFFECTS)


def our_chain(elements: int, angle: float, steps: int) -> tuple[NDArray[np.float64], float, int]:
    model = chain_model(elements, angle)
    started = time.process_time()
    run = fc.simulate(model, until=steps * CHAIN_STEP, method=fc.Unchecked(fc.GeneralizedAlpha(CHAIN_STEP)))
    seconds = time.process_time() - started
    if run.status is not fc.Status.FINISHED:
        raise RuntimeError(run.report.message)
    return np.array([run[f"tip_{d}"][-1] for d in "xyz"]), seconds, run.report.newton_iterations


def chain_race(quick: bool) -> dict[str, object]:
    """Time per step; how ours grows up to 10,000 elements; the full swing of 3,000 to its end."""
    rows = []
    for name, angle in SWINGS.items():
        for n in CHAINS[: 3 if quick else None]:
            steps = max(100 if quick else 400, min(2000, 100_000 // n))
            ours, theirs, newton = [], [], (0, 0)
            for _ in range(3 if n > 1000 else 5):
                our_chain(n, angle, BRIEFLY)
                tip, seconds, k = our_chain(n, angle, steps)
                ours.append(seconds)
                exudyn_chain(n, angle, CHAIN_STEP, BRIEFLY)
                other = exudyn_chain(n, angle, CHAIN_STEP, steps)
                theirs.append(other.seconds)
                newton = (k, other.newton)
            row = {
                "swing": name,
                "elements": n,
                "steps": steps,
                "ours": min(ours) / steps,
                "theirs": min(theirs) / steps,
                "newton": [k / steps for k in newton],
                "apart": float(np.abs(tip - other.tip).max()),
            }
            rows.append(row)
            print(row, f"ratio {row['ours'] / row['theirs']:.3f}", flush=True)
    return {"rows": rows, "growth": growth(quick), "swings": [full_swing(quick)]}


BRIEFLY = 3
"""Steps right before those that are timed, of both codes: neither is to find its caches full of the other's."""

TRIES, FEW = 9, 4
"""Of which the fastest counts: what fits no cache of its own waits for what else the processor does, for seconds."""

WINDOW = (500, 2500)
"""Steps at whose ends runs of all sizes are compared: one motion, through the whip of the free end."""


def growth(quick: bool) -> dict[str, object]:
    """Exponents of our time per step up to 10,000 elements, from 10 and from 100 on; of long runs less short ones."""
    found = {}
    for name, angle in SWINGS.items():
        times, newton = {}, {}
        for n in (10, 100, 1000) if quick else (10, 100, 1000, LARGEST):
            tries = [[our_chain(n, angle, k)[1:] for k in WINDOW] for _ in range(TRIES if n <= 1000 else FEW)]
            first, both = (min(two[k][0] for two in tries) for k in (0, 1))
            times[n] = (both - first) / (WINDOW[1] - WINDOW[0])
            newton[n] = (tries[0][1][1] - tries[0][0][1]) / (WINDOW[1] - WINDOW[0])
        sizes, costs = np.log(list(times)), np.log(list(times.values()))
        every, large = (float(np.polyfit(sizes[k:], costs[k:], 1)[0]) for k in (0, 1))
        found[name] = {
            "exponent": every,
            "large": large,
            "elements": list(times),
            "steps": WINDOW,
            "times": list(times.values()),
            "newton": list(newton.values()),
            "bytes": bytes_an_element(LARGEST),
        }
        print(f"growth, {name}: exponents {every:.3f}, {large:.3f}", found[name], flush=True)
    return found


def bytes_an_element(elements: int) -> float:
    """What an iteration reads or writes for each element: workspace, factors, tables of the forces."""
    F = flatten(chain_model(elements, SWINGS["easy"]))
    f, fronts = F.flat, F.plan.fronts
    tables = sum(a.nbytes for run in f.forces for a in (run.gather, run.tables.scatter, run.blocks, run.places))
    return (tables + 8 * (f.z.size + f.padded + fronts.below + fronts.right)) / elements


def full_swing(quick: bool) -> dict[str, object]:
    """Two seconds of the full swing: past the lowest point and through the whip of the free end."""
    n, steps = (300, 500) if quick else (3000, 2000)
    _, seconds, _ = our_chain(n, SWINGS["full swing"], steps)
    started = time.process_time()
    try:
        ratio = seconds / exudyn_chain(n, SWINGS["full swing"], CHAIN_STEP, steps).seconds
        theirs = "finished"
    except exu.SolverError:
        ratio = seconds / (time.process_time() - started)
        theirs = "Newton failed"
    print(f"full swing of {n}, {steps} steps: ours finished, Exudyn {theirs}; time ratio {ratio:.3f}", flush=True)
    return {"elements": n, "steps": steps, "theirs": theirs, "ratio": ratio}


@dataclass(frozen=True)
class Law:
    """A proportional controller in Python, read at every step."""

    sample_time: float = 1e-4
    inputs: ClassVar[tuple[str, ...]] = ("x1_minus_x4",)
    outputs: ClassVar[tuple[str, ...]] = ("push",)

    def initial(self) -> NDArray[np.float64]:
        return np.zeros(0)

    def command(self, t: float, x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
        return PUSH - 200.0 * y


def loop_race(quick: bool) -> dict[str, object]:
    """A controller at every step of the crane, in Python or continuous, against the same crane without."""
    steps, model = 300, crane_model(1)
    gain = control.ss([], [], [], [[-200.0]], inputs=list(Law.inputs), outputs=list(Law.outputs))
    runs = ((None, {"push": PUSH}, 1), (Law(), None, 1), (gain, {"push": PUSH}, 1), (gain, {"push": PUSH}, _LONG))
    spans: list[list[float]] = [[] for _ in runs]
    for _ in range(20 if quick else 200):  # short and many: other work on the machine disturbs Python most
        for span, (controller, inputs, long) in zip(spans, runs, strict=True):
            started = time.process_time()
            fc.simulate(model, controller, inputs=inputs, until=long * steps * 1e-4, method=STEPS_OF_LOOPS)
            span.append(time.process_time() - started)
    still, closed, short, whole = (min(span) / steps for span in spans)
    smooth = (whole - short) / (_LONG - 1)
    ends = steps * (short - smooth) / still
    print(f"controller at every step: {1e6 * (closed - still):.1f} us over {1e6 * still:.1f} us open", flush=True)
    print(f"continuous controller: {smooth / still:.1f} times an open step, {ends:.0f} of them a run", flush=True)
    return {"over": closed - still, "open": still, "smooth": smooth, "ends": ends}


_FIRST = """
import time
start = time.perf_counter()
import numpy, casadi
libraries, before = time.perf_counter(), time.process_time()
import flexctrl as fc
imported = time.perf_counter()
import scipy.sparse, llvmlite.binding  # all that the rest loads of these
others = time.process_time() - before
model = fc.assemble(fc.cranes.ceiling_crane(), [fc.Gravity(), fc.Flexible(), fc.LargeRotation()])
run = fc.simulate(model, until=0.05, inputs={"push": 500.0}, method=fc.GeneralizedAlpha(1e-4))
float(run["x1_minus_x4"][-1])
print(imported - libraries, time.process_time(), before, others)
"""


def cold_race(quick: bool) -> dict[str, object]:
    """CPU seconds of a process from its start to the first result of the crane, without and with kept code."""
    empty, kept, told = [], [], []
    with tempfile.TemporaryDirectory() as bytecode:
        for round_ in range(2 if quick else 6):
            with tempfile.TemporaryDirectory() as cache_home:
                for spans in (empty, kept):
                    environment = {**os.environ, "XDG_CACHE_HOME": cache_home, "PYTHONPYCACHEPREFIX": bytecode}
                    environment.pop("PYTHONDONTWRITEBYTECODE", None)
                    run = subprocess.run(
                        [sys.executable, "-c", _FIRST], env=environment, capture_output=True, text=True, check=True
                    )
                    times = [float(word) for word in run.stdout.split()]
                    if round_:  # the first one writes bytecode, as an installation does
                        spans.append(times[1])
                        told.append(times)
    imported, _, libraries, others = (min(times) for times in zip(*told, strict=True))
    found = {"empty": min(empty), "kept": min(kept), "import": imported, "libraries": libraries, "others": others}
    print("cold process:", found, flush=True)
    return found


RACES: dict[str, Callable[[bool], dict[str, object]]] = {
    "crane": crane_race,
    "chains": chain_race,
    "loop": loop_race,
    "cold": cold_race,
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("races", nargs="*", choices=[*RACES, []], help="default: all")
    parser.add_argument("--quick", action="store_true", help="fewer settings and steps")
    parser.add_argument("--page", action="store_true", help="write docs/benchmarks.md and its plot")
    asked = parser.parse_args()
    found = {name: RACES[name](asked.quick) for name in asked.races or RACES}
    if asked.page:
        from race_page import write

        write(found)


if __name__ == "__main__":
    main()
