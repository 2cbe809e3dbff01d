"""Machines of the tests of long runs, and what these do in a process: ``python long_running.py PARENT TASK …``."""

from __future__ import annotations

import itertools
import os
import resource
import signal
import sys
import threading
import time
from pathlib import Path
from typing import Any

import numpy as np

import flexctrl as fc

SAMPLE = 1e-3


class Servo:
    """A sampled controller with a state: position with integral, towards a reference that swings."""

    inputs = ("angle", "speed")
    outputs = ("torque",)
    sample_time = SAMPLE

    def initial(self) -> np.ndarray:
        return np.zeros(1)

    def _error(self, t: float, y: np.ndarray) -> float:
        return 0.5 * np.sin(0.7 * t) - y[0]

    def command(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.array([4.0 * self._error(t, y) - 0.8 * y[1] + x[0]])

    def update(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return x + SAMPLE * self._error(t, y)


def arm(*effects, backend=None) -> fc.Model:
    """A link behind an elastic gear, and a pendulum on it."""
    link = fc.RigidBody("link", (0.5, 0, 0), 1.0, (0.01, 0.1, 0.1), {"hinge": (0, 0, 0), "tip": (1, 0, 0)})
    load = fc.RigidBody("load", (1, 0, -0.4), 0.5, (0.01, 0.01, 0.01), {"hook": (1, 0, 0)})
    hinge = link.point("hinge")
    motor = fc.RotaryDrive("motor", hinge, axis="z", stiffness=2000.0, ratio=1.0, inertia=0.05, damping=1.0)
    machine = fc.Structure(
        [link, load],
        [fc.Support(hinge, "u v w rx ry"), fc.Hinge(link.point("tip"), load.point("hook"), "x")],
        [motor],
        [fc.MotorTorque("torque", motor)],
        [fc.DriveAngle("angle", motor), fc.DriveSpeed("speed", motor), fc.Position("load_y", load.node, "y")],
    )
    return fc.assemble(machine, [fc.LargeRotation(), fc.Gravity(), fc.ShaftElasticity(), *effects], backend)


class Damper:
    """A sampled controller of the cantilever's tip."""

    inputs, outputs, sample_time = ("tip",), ("push",), 10 * SAMPLE

    def initial(self) -> np.ndarray:
        return np.zeros(1)

    def command(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.array([np.cos(3.0 * t) - 20.0 * (y[0] - x[0])])

    def update(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return y[:1]


class Leaning:
    """A controller of the same tip that never stops looking, with a state; not linear in time."""

    inputs, outputs = ("tip",), ("push",)

    def initial(self) -> np.ndarray:
        return np.zeros(1)

    def command(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.array([np.cos(3.0 * t) - 20.0 * (y[0] - x[0])])

    def rate(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return 5.0 * (y[:1] - x)


def small() -> fc.Model:
    """A cantilever that moves little, with a mass on it."""
    section = fc.Section(EA=1e5, EI_y=10.0, EI_z=10.0, GJ=10.0, rhoA=1.0, rhoJ=1e-3)
    beam, load = fc.Beam("beam", (0, 0, 0), (1, 0, 0), section, 4), fc.PointMass("load", (1, 0, 0), 0.3)
    machine = fc.Structure(
        [beam, load],
        [fc.Support(beam.start), fc.Pin(beam.end, load.node)],
        inputs=[fc.Force("push", beam.end, "z")],
        outputs=[fc.Position("tip", beam.end, "z"), fc.Rotation("lean", beam.end, "y")],
    )
    return fc.assemble(machine, [fc.Gravity(), fc.Flexible(), fc.RayleighDamping(0.1, 1e-3)])


FIXED = fc.GeneralizedAlpha(SAMPLE)
DRY = fc.CoulombFriction({"motor": fc.Coulomb(0.2, static=0.3)})
CASES = {
    "marched": (lambda: arm(), None, FIXED, {"torque": 0.8}),
    "plain": (lambda: arm(backend=fc.CasadiVM()), None, FIXED, {"torque": 0.8}),
    "adaptive": (lambda: arm(), None, fc.AdaptiveAlpha(), {"torque": 0.8}),
    "adaptive_sampled": (lambda: arm(), Servo, fc.AdaptiveAlpha(), {}),
    "friction": (lambda: arm(DRY), Servo, FIXED, {}),
    "sampled": (lambda: arm(), Servo, FIXED, {}),
    "sampled_plain": (lambda: arm(backend=fc.CasadiVM()), Servo, FIXED, {}),
    "midpoint": (lambda: arm(), Servo, fc.ConservingMidpoint(SAMPLE), {}),
    "exact": (lambda: small(), None, fc.Exact(SAMPLE), {"push": 0.8}),
    "exact_sampled": (lambda: small(), Damper, fc.Exact(SAMPLE), {}),
    "exact_continuous": (lambda: small(), Leaning, fc.Exact(10 * SAMPLE), {}),
    "explicit": (lambda: arm(), Servo, fc.ExplicitRungeKutta(SAMPLE), {}),
}


def ran(name: str, until: float, folder: Path, label: str, start: fc.Checkpoint | None = None) -> fc.dynamics.run.Run:
    """A case until some time, with its rows in a file."""
    model, controller, method, inputs = CASES[name]
    stream = fc.CsvStream(folder / f"{name}_{label}.csv", every=0.01)
    given = {"inputs": inputs} if start is None else {"start": start}
    law = controller() if controller else None
    return fc.simulate(model(), law, until=until, method=method, record=stream, **given)


def resume(folder: str, until: str) -> None:
    """Go on with every case from its checkpoint in a folder, and write how each ends."""
    place = Path(folder)
    for name in CASES:
        run = ran(name, float(until), place, "parts", fc.load_checkpoint(place / f"{name}.checkpoint"))
        np.savez(place / f"{name}.npz", **ends(run))


def ends(run: fc.dynamics.run.Run) -> dict[str, np.ndarray]:
    """What a run ends with."""
    e, final = run.report.energy, run.final
    books = np.array([e.work, e.dissipated, e.kinetic, e.stored, run.report.energy_residual, run.report.steps])
    return {"x": final.x, "R": final.R, "q": final.q, "v": final.v, "books": books, "t": np.array(final.t)}


def forever(folder: str) -> None:
    """A run that ends only when it is stopped; tells when it is under way, and what it kept."""
    place = Path(folder)
    autosave = fc.Autosave(place / "autosave", seconds=0.2)
    stream = fc.CsvStream(place / "forever.csv", every=0.01)

    def tell(share: float) -> None:
        (place / "begun").touch()

    run = fc.simulate(
        arm(), Servo(), until=1e5, method=FIXED, every=0.01, record=stream, autosave=autosave, progress=tell
    )
    print(run.status.name, run.t[-1], run.final.t, run.checkpoint.t)


class Stuck(Servo):
    """A controller that does not come back."""

    def __init__(self, flag: Path) -> None:
        self.flag = flag

    def command(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        if t > 0.5:
            self.flag.touch()
            time.sleep(600.0)
        return super().command(t, x, y)


def stuck(folder: str) -> None:
    """A run whose controller hangs at 0.5 s."""
    run = fc.simulate(arm(), Stuck(Path(folder) / "begun"), until=1.0, method=FIXED, every=0.01)
    print(run.status.name, len(run.t), run.t[-1], run.final.t)


def resident() -> float:
    """Resident memory now [MB]."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * resource.getpagesize() / 1e6


def most_resident() -> float:
    """Most resident memory that there was [MB]; getrusage would tell that of the process which started this one."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return 1024e-6 * next(float(line.split()[1]) for line in lines if line.startswith("VmHWM:"))


def closed_loop(folder: str, kind: str, until: str) -> None:
    """A closed loop at 1 kHz; prints times and resident memory [MB] three times on the way, and the most there was."""
    kept = fc.CsvStream(Path(folder) / "rows.csv") if kind == "streamed" else fc.InMemory(states=1e6)
    marks: list[tuple[float, float]] = []
    end = float(until)
    run = fc.simulate(
        arm(), Servo(), until=end, method=FIXED, every=0.1, record=kept,
        progress=lambda share: marks.append((share * end, resident())),
    )  # fmt: skip
    early, late = (next(m for m in marks if m[0] > share * end) for share in (0.4, 0.7))
    print(run.status.name, *early, *late, *marks[-1], most_resident())


def minute(folder: str) -> None:
    """A minute of a beam behind a gear at 1 kHz, whose states just fit; prints the most memory there was."""
    section = fc.Section.tube(fc.STEEL, radius=0.03, thickness=0.002)
    beam = fc.Beam("beam", (0, 0, 0), (2, 0, 0), section, elements=4)
    motor = fc.RotaryDrive("motor", beam.start, axis="z", stiffness=2.0, ratio=100.0, inertia=4e-3, damping=0.01)
    plan = fc.Structure(
        [beam],
        [fc.Support(beam.start, "u v w rx ry")],
        [motor],
        [fc.MotorTorque("torque", motor)],
        [fc.DriveAngle("angle", motor), fc.DriveSpeed("speed", motor)],
    )
    model = fc.assemble(plan, [fc.LargeRotation(), fc.Flexible(), fc.RayleighDamping(beta=1e-3)])
    kept = fc.CsvStream(Path(folder) / "rows.csv", every=0.1)
    run = fc.simulate(model, Turning(), until=60.0, method=FIXED, every=0.1, record=kept)
    print(run.status.name, len(run.track.stretches), most_resident())


class Turning:
    """Turns a motor to and fro."""

    inputs, outputs, sample_time = ("angle", "speed"), ("torque",), SAMPLE

    def initial(self) -> np.ndarray:
        return np.zeros(0)

    def command(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.array([2.0 * (50.0 * np.sin(0.5 * t) - y[0]) - 0.3 * y[1]])

    def update(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return x


def chain(folder: str, elements: str) -> None:
    """Twenty steps of a long chain; prints status and the most memory there was [MB]."""
    section = fc.Section(EA=1e5, EI_y=10.0, EI_z=10.0, GJ=10.0, rhoA=1.0, rhoJ=1e-3)
    beam = fc.Beam("chain", (0, 0, 0), (0.1 * int(elements), 0, 0), section, int(elements))
    _falls([beam], [fc.Support(beam.start, "u v w")])


def hinged(folder: str, elements: str) -> None:
    """The same of twenty beams hinged one to the next: long linkages of much that bends."""
    section = fc.Section.tube(fc.STEEL, radius=0.02, thickness=0.002)
    beams = [fc.Beam(f"b{i}", (i, 0, 0), (i + 1, 0, 0), section, int(elements) // 20) for i in range(20)]
    hinges = [fc.Hinge(a.end, b.start, "y") for a, b in itertools.pairwise(beams)]
    _falls(beams, [fc.Support(beams[0].start, "u v w rx rz"), *hinges])


def tree(folder: str, elements: str) -> None:
    """The same of a tree: each branch bears two, seven times."""
    section = fc.Section.tube(fc.STEEL, radius=0.05, thickness=0.004)
    each, rng = int(elements) // 255, np.random.default_rng(0)
    trunk = fc.Beam("b0", (0, 0, 0), (0, 0, 3), section, each)
    branches, joints = [trunk], [fc.Support(trunk.start)]
    for i in range(254):
        bearer = branches[i // 2]
        way = np.subtract(bearer.end.position, bearer.start.position) * 0.8 + rng.normal(size=3)
        end = tuple(bearer.end.position + way)
        branches.append(fc.Beam(f"b{i + 1}", bearer.end.position, end, section, each))
        joints.append(fc.Weld(bearer.end, branches[-1].start))
    _falls(branches, joints)


def net(folder: str, elements: str) -> None:
    """The same of a net of welded beams: what is eliminated fills in."""
    section = fc.Section.tube(fc.STEEL, radius=0.05, thickness=0.004)
    side = round((int(elements) / 2) ** 0.5)
    beams = [
        fc.Beam(f"b{i}_{j}_{k}", (i, j, 0), (i + (k == 0), j + (k == 1), 0), section, 1)
        for i, j, k in itertools.product(range(side), range(side), range(2))
    ]
    at: dict[tuple[float, ...], fc.Node] = {}
    joints = []
    for node in (node for beam in beams for node in (beam.start, beam.end)):
        first = at.setdefault(tuple(node.position), node)
        joints += [] if first is node else [fc.Weld(first, node)]
    _falls(beams, [fc.Support(at[0.0, 0.0, 0.0]), *joints])


def mesh(folder: str, elements: str) -> None:
    """The same of springs between point masses, held all around: as many lines as there are elements."""
    side = round((int(elements) / 2) ** 0.5)
    places = list(itertools.product(range(side), range(side)))
    masses = {at: fc.PointMass(f"p{at[0]}_{at[1]}", (*at, 0), 1.0) for at in places}
    springs, joints = [], [fc.Support(masses[at].node) for at in places if {0, side - 1} & set(at)]
    for (i, j), (di, dj) in itertools.product(places, ((1, 0), (0, 1))):
        if (i + di, j + dj) in masses:
            ends = masses[i, j].node, masses[i + di, j + dj].node
            springs.append(fc.Spring(f"s{i}_{j}_{di}", *ends, stiffness=5e3, length=0.9, damping=5.0))
            joints += [fc.Pin(ends[0], springs[-1].start), fc.Pin(ends[1], springs[-1].end)]
    _falls([*masses.values(), *springs], joints)


def _falls(parts: list[Any], joints: list[fc.Support | fc.Hinge | fc.Weld | fc.Pin]) -> None:
    tip = parts[-1].end
    machine = fc.Structure(parts, joints, outputs=[fc.Position("tip", tip, "z"), fc.Velocity("speed", tip, "z")])
    model = fc.assemble(machine, [fc.LargeRotation(), fc.Gravity(), fc.Flexible()])
    run = fc.simulate(model, until=20e-4, method=fc.GeneralizedAlpha(1e-4))
    print(run.status.name, run.report.steps, most_resident())


def as_child(parent: int) -> None:
    """Heed Ctrl-C, though a shell may have started the parent without, and do not outlive the parent."""
    signal.signal(signal.SIGINT, signal.default_int_handler)
    threading.Thread(target=_while_there, args=(parent,), daemon=True).start()


def _while_there(parent: int) -> None:
    while os.getppid() == parent:
        time.sleep(0.5)
    os._exit(1)


if __name__ == "__main__":
    as_child(int(sys.argv[1]))
    globals()[sys.argv[2]](*sys.argv[3:])
