"""What each effect costs a bare model: docs/benchmarks/effects.md.

OPENBLAS_NUM_THREADS=1 python tests/benchmarks/effects.py --page
"""

from __future__ import annotations

import platform
import sys
import time
from importlib.metadata import version
from pathlib import Path

import numpy as np

import flexctrl as fc
from flexctrl.effects.effect import Effect

ROOT = Path(__file__).resolve().parents[2]
STEP, STEPS, REPEATS = 1e-3, (1000, 15_000), 11
PAGE = """# What each effect costs

<!-- Made by `python tests/benchmarks/effects.py --page` -->

A boom of two elements on a slewing drive, with 5 kg on a rope of three elements at its end and beside it a load on a
winch: rigid, with nothing but `LargeRotation`, and with one effect more each time ("on" tells where another is needed
beside it; what is counted is then against both). Counted are states (two a freedom, one a lag or bristle), nonzeros of
the tangent and instructions of all force kernels; measured is the processor time of a step of `GeneralizedAlpha(1e-3)`,
what a run of {long} steps takes beyond one of {short}, each the shortest of {repeats} in turn, as a ratio to that of
the bare model in the same process; and what a run takes beside its steps, in steps of the bare model.
An effect that is left out, or that finds nothing to act on, adds nothing to any column: the architecture tests hold the
counts (`tests/laws/test_absent_costs_nothing.py`).

{table}

Between 0.9 and 1.1 a ratio says nothing. A beam that rings takes two Newton iterations a step, a damped one that has
come to rest takes one: so damping saves time. Steps in which dry friction sticks or breaks loose are
taken in Python; one in which play closes or opens is taken again until it ends there, and the next one starts anew:
some hundred microseconds each. That counts instead of the few instructions these laws add. The counts do not show it.

A *continuous* controller together with `MotorLag`, `LuGreFriction`, `CoulombFriction` or `Backlash` takes its steps in
Python: 70 to 250 times as long a step as without that effect. A sampled law is some 140 times quicker there with lag or
bristles, and about ten to twenty times with dry friction or play, whose corners cost it time as well.

Made with {versions}.
"""


def machine() -> fc.Structure:
    """A boom on a slewing drive with a load on a rope; a load on a winch."""
    tube = fc.Section.tube(fc.STEEL, radius=0.05, thickness=0.004)
    boom = fc.Beam("boom", (0, 0, 0), (2, 0, 0), tube, elements=2)
    rope = fc.Rope("rope", boom.end, (2, 0, -1), EA=1e5, rhoA=0.5, elements=3)
    load, crab, hook = (
        fc.PointMass("load", (2, 0, -1), 5.0),
        fc.PointMass("crab", (0, 1, 5), 10.0),
        fc.PointMass("hook", (0, 1, 3), 4.0),
    )
    motor = fc.RotaryDrive("motor", boom.start, axis="z", stiffness=50.0, ratio=20.0, inertia=1e-3)
    winch = fc.Winch("winch", hook.node, crab.node, EA=1e5, radius=0.1, ratio=2.0, inertia=0.02)
    return fc.Structure(
        [boom, rope, load, crab, hook],
        [
            fc.Support(boom.start, held="u v w rx ry"),
            fc.Pin(boom.end, rope.start),
            fc.Pin(rope.end, load.node),
            fc.Support(crab.node),
        ],
        [motor, winch],
        [fc.MotorTorque("torque", motor), fc.MotorTorque("hoist", winch)],
    )


Key = tuple[str, ...]
ADDED: list[tuple[str, list[Effect], list[Effect]]] = [
    ("Gravity", [fc.Gravity()], []),
    ("BeamFlexibility", [fc.BeamFlexibility()], []),
    ("ComponentModes(2)", [fc.ComponentModes(2)], []),
    ("ShaftElasticity", [fc.ShaftElasticity()], []),
    ("RopeStretch", [fc.RopeStretch()], []),
    ("RopeMass", [fc.RopeMass()], []),
    ("RayleighDamping", [fc.RayleighDamping(0.1, 1e-3)], [fc.BeamFlexibility()]),
    ("ModalDamping", [fc.ModalDamping(0.01)], [fc.BeamFlexibility()]),
    ("ViscousFriction", [fc.ViscousFriction({"motor": 0.05})], []),
    ("CoulombFriction", [fc.CoulombFriction({"motor": 0.05})], []),
    ("LuGreFriction", [fc.LuGreFriction({"motor": fc.LuGre(1e3, 0.05)})], []),
    ("Backlash", [fc.Backlash({"motor": 2e-3})], [fc.ShaftElasticity()]),
    ("MotorLag", [fc.MotorLag({"motor": 0.05})], []),
    ("Wind", [fc.Wind({"load": 0.5}, (5, 0, 0))], []),
    ("RotatingFrame", [fc.RotatingFrame((0.0, 0.0, 0.5))], []),
]


def size(model: fc.Model) -> tuple[int, int, int]:
    """States, nonzeros of the tangent, instructions."""
    still = np.zeros(model.n)
    slope = np.abs(model.slope(model.rest, still, still, (1.0, 1.0, 1.0), np.zeros(len(model.inputs))).toarray())
    orders = 2 * model.n - len(model.motion.flows)
    count = sum(f.count * f.kernels.force.instructions for f in model.forces.families)
    return orders, int((slope > 1e-12 * slope.max(initial=0.0)).sum()), count


def taken(model: fc.Model, steps: int) -> float:
    """Processor time of a run [s]."""
    began = time.process_time()
    method, until = fc.Unchecked(fc.GeneralizedAlpha(STEP, rho=0.8)), STEP * steps
    fc.simulate(model, until=until, inputs={"torque": 0.1, "hoist": 1.0}, method=method, every=until)
    return time.process_time() - began


def timed(models: dict[Key, fc.Model]) -> tuple[dict[Key, float], dict[Key, float]]:
    """Processor time of a step, and of a run beside its steps [s]."""
    short, long = STEPS
    times = dict.fromkeys(models, (np.inf, np.inf))
    for _ in range(REPEATS):
        for key, model in models.items():
            times[key] = (min(times[key][0], taken(model, short)), min(times[key][1], taken(model, long)))
    per_step = {key: (last - first) / (long - short) for key, (first, last) in times.items()}
    return per_step, {key: first - short * per_step[key] for key, (first, _) in times.items()}


def table() -> str:
    """One row an effect."""
    bare, plan = [fc.LargeRotation()], machine()
    models = {(): fc.assemble(plan, bare)}
    for name, effects, beside in ADDED:
        key = tuple(type(e).__name__ for e in beside)
        models.setdefault(key, fc.assemble(plan, [*bare, *beside]))
        models[(name,)] = fc.assemble(plan, [*bare, *beside, *effects])
    per_step, beside_steps = timed(models)
    lines = ["| effect | on | states | nonzeros | instructions | a step | over the bare model | a run beside |"]
    lines += ["|:--|:--|--:|--:|--:|--:|--:|--:|"]
    own, unit = size(models[()]), per_step[()]
    lines.append(f"| LargeRotation alone | | {own[0]} | {own[1]} | {own[2]} | 1 | | {beside_steps[()] / unit:.0f} |")
    for name, _, beside in ADDED:
        key = tuple(type(e).__name__ for e in beside)
        with_, without = size(models[(name,)]), size(models[key])
        more = " | ".join(f"{a - b:+d}" for a, b in zip(with_, without, strict=True))
        ratio, over, run = per_step[(name,)] / unit, (per_step[(name,)] - per_step[key]) / unit, beside_steps[(name,)]
        lines.append(f"| {name} | {', '.join(key)} | {more} | {ratio:.2f} | {over:+.2f} | {run / unit:.0f} |")
    return "\n".join(lines)


def main() -> None:
    names = ("numpy", "scipy", "casadi", "llvmlite")
    versions = ", ".join(f"{name} {version(name)}" for name in names)
    text = PAGE.format(
        repeats=REPEATS,
        short=STEPS[0],
        long=STEPS[1],
        table=table(),
        versions=f"Python {platform.python_version()} on {platform.machine()}, {versions}",
    )
    print(text)
    if "--page" in sys.argv:
        (ROOT / "docs" / "benchmarks" / "effects.md").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
