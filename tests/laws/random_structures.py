"""Random structures: trees and closed loops of parts on every kind of joint, with drives, loads and effects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import cos, sin

import numpy as np
from machines import SECTION
from scipy.spatial.transform import Rotation

import flexctrl as fc
from flexctrl.effects.effect import Effect
from flexctrl.errors import StructureError

SLENDER = fc.Section(EA=700.0, EI_y=50.0, EI_z=35.0, GJ=25.0, rhoA=0.6, rhoJ=0.02, rhoI_y=0.01, rhoI_z=0.01)
GRAVITY = (1.0, -2.0, -9.0)
CYCLE = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
ASKEW = Rotation.from_rotvec([0.7, -1.2, 1.9]).as_matrix()
TWISTS = ("u v w", "all", "rx ry rz")
SINGLE = ("u v w rx ry", "v w", "w rz", "w", "v w rx ry rz")
NEXT = {"u": "v", "v": "w", "w": "u", "rx": "ry", "ry": "rz", "rz": "rx"}


@dataclass(frozen=True)
class Frame:
    """Where all is drawn: places are turned by Q and shifted, directions turned."""

    Q: np.ndarray = field(default_factory=lambda: np.eye(3))
    shift: np.ndarray = field(default_factory=lambda: np.zeros(3))
    cycles: bool = False

    def place(self, p: Sequence[float]) -> tuple[float, ...]:
        return tuple((self.Q @ p + self.shift).tolist())

    def along(self, d: Sequence[float]) -> tuple[float, ...]:
        return tuple((self.Q @ d).tolist())

    def held(self, names: str) -> str:
        return " ".join(NEXT.get(n, n) for n in names.split()) if self.cycles else names


HERE = Frame()


@dataclass(frozen=True)
class Case:
    """A structure with the effects that act on it and what its inputs do."""

    structure: fc.Structure
    effects: list[Effect]
    loads: dict[str, float]
    swings: dict[str, tuple[float, float]]

    @property
    def controller(self) -> fc.OpenLoop | None:
        """Loads that change with time: a cos ωt."""

        def wave(a: float, w: float):
            return lambda t: a * cos(w * t) + 0.3 * a * sin(2.3 * w * t)

        return fc.OpenLoop({name: wave(*swing) for name, swing in self.swings.items()}) if self.swings else None


def turned_frame(seed: int) -> Frame:
    """Another frame for a seed: supports that hold single axes can be turned onto other axes only."""
    isotropic = seed % 2 == 0
    return Frame(ASKEW if isotropic else CYCLE, np.array([0.3, -2.0, 1.1]), cycles=not isotropic)


def case(seed: int, frame: Frame = HERE, calm: bool = False) -> Case:
    """The structure of a seed: even ones stand on supports that hold all axes alike, or float.

    A calm one is at rest as drawn: no weight, lines as long as they are drawn, springs for ropes.
    """
    return _Builder(seed, frame, calm).case()


class _Builder:
    def __init__(self, seed: int, frame: Frame, calm: bool) -> None:
        self.seed, self.frame, self.calm, self.rng = seed, frame, calm, np.random.default_rng(seed)
        self.elements: list = []
        self.joints: list = []
        self.drives: list = []
        self.places: list[tuple[fc.Node, np.ndarray]] = []

    # -- numbers

    def _choose(self, items: Sequence):
        return items[int(self.rng.integers(len(items)))]

    def _chance(self, share: float) -> bool:
        return bool(self.rng.random() < share)

    def _unit(self) -> np.ndarray:
        d = self.rng.normal(size=3)
        return np.eye(3)[self.rng.integers(3)] if self._chance(0.3) else d / np.linalg.norm(d)

    def _offset(self) -> np.ndarray:
        return self._unit() * self.rng.uniform(0.5, 1.5)

    def _motor(self) -> dict[str, float]:
        draw, sign = self.rng.uniform, self._choose((-1.0, 1.0))
        return {
            "stiffness": draw(5, 20),
            "ratio": sign * draw(1, 3),
            "inertia": draw(0.05, 0.2),
            "damping": draw(0, 0.5),
        }

    # -- the machine

    def case(self) -> Case:
        self._chain(np.zeros(3), None, int(self.rng.integers(1, 4)))
        self._ground()
        for _ in range(int(self.rng.integers(0, 3))):
            node, at = self._choose(self._six())
            self._chain(at, node, int(self.rng.integers(1, 3)))
        if self.seed % 3:
            self._close()
        structure = fc.Structure(self.elements, self.joints, self.drives, self._inputs(), self._outputs())
        effects = self._effects()
        return Case(structure, effects, *self._course())

    def _six(self) -> list[tuple[fc.Node, np.ndarray]]:
        return [(n, at) for n, at in self.places if len(n.freedoms) == 6]

    def _chain(self, at: np.ndarray, base: fc.Node | None, parts: int) -> None:
        """Parts one behind the other."""
        for _ in range(parts):
            kind = self._choose(["beam", "beam", "body", "rope"]) if base else self._choose(["beam", "body"])
            end = at + self._offset()
            start, far = self._part(kind, at, end)
            if base:
                self.joints.append(fc.Pin(base, start)) if kind == "rope" else self._join(base, start)
            if kind == "rope" or self._chance(0.2):
                far = self._weigh(far, end, kind == "rope")
            base, at = far, end
            if len(base.freedoms) < 6:
                return

    def _weigh(self, node: fc.Node, at: np.ndarray, bare: bool) -> fc.Node:
        """A mass at a node; at the end of a rope there has to be one, or a body."""
        if bare and self._chance(0.4):
            start, far = self._part("body", at, at + self._offset())
            self.joints.append(fc.Pin(node, start))
            return far
        mass = fc.PointMass(f"mass{len(self.elements)}", self.frame.place(at), self.rng.uniform(0.5, 2))
        self.elements.append(mass)
        self.joints.append(fc.Pin(node, mass.node))
        self.places.append((mass.node, at))
        return node

    def _part(self, kind: str, a: np.ndarray, b: np.ndarray) -> tuple[fc.Node, fc.Node]:
        """A part from place to place."""
        name, frame, p, q = f"{kind}{len(self.elements)}", self.frame, self.frame.place(a), self.frame.place(b)
        if kind == "beam":
            count = int(self.rng.integers(1, 4))
            section = self._choose([SECTION, SLENDER])
            made = fc.Beam(name, p, q, section, count, up=frame.along(self.rng.normal(size=3)))
            mids = [(n, a + (b - a) * (i + 1) / count) for i, n in enumerate(made.nodes[1:-1])]
            ends, more = (made.start, made.end), mids
        elif kind == "body":
            root = self.rng.normal(size=(3, 3))
            inertia = 0.3 * (np.trace(root @ root.T) * np.eye(3) - root @ root.T) + 0.05 * np.eye(3)
            inertia = frame.Q @ inertia @ frame.Q.T
            centre = 0.5 * (a + b) + 0.2 * self._unit()
            mass = self.rng.uniform(0.5, 2)
            made = fc.RigidBody(name, frame.place(centre), mass, 0.5 * (inertia + inertia.T), {"a": p, "b": q})
            ends, more = (made.point("a"), made.point("b")), [(made.node, centre)]
        elif kind == "rope" and not self.calm:
            length = self.rng.uniform(0.9, 0.98) * float(np.linalg.norm(b - a))
            made = fc.Rope(name, p, q, EA=self.rng.uniform(100, 400), length=length, damping=0.2)
            ends, more = (made.start, made.end), []
        else:
            length = (1.0 if self.calm else self.rng.uniform(0.8, 1.2)) * float(np.linalg.norm(b - a))
            made = fc.Spring(name, p, q, stiffness=self.rng.uniform(10, 60), length=length, damping=0.3)
            ends, more = (made.start, made.end), []
        self.elements.append(made)
        if kind in ("beam", "body"):
            self.places += [(ends[0], a), (ends[1], b), *more]
        return ends

    def _join(self, base: fc.Node, node: fc.Node) -> None:
        """Some joint of two nodes that meet, now and then with its motor."""
        kind, axis, name = self._choose(["weld", "pin", "hinge", "hinge", "slide"]), self._unit(), len(self.drives)
        there = self.frame.along(axis)
        if kind == "weld":
            self.joints.append(fc.Weld(base, node))
        elif kind == "pin":
            self.joints.append(fc.Pin(base, node))
        elif kind == "hinge":
            self.joints.append(fc.Hinge(base, node, there))
            if self._chance(0.6):
                self.drives.append(fc.RotaryDrive(f"motor{name}", node, base, axis=there, **self._motor()))
        else:
            self.joints.append(fc.Slide(base, node, there))
            drive = fc.LinearDrive(f"motor{name}", node, base, direction=there, radius=0.2, **self._motor())
            self.drives += [drive] if self._chance(0.6) else []

    def _ground(self) -> None:
        """The first node stands on a support, hangs on a driven one, or the machine floats."""
        node = self.places[0][0]
        held = self._choose(["", "all", "u v w", "u v w"] if self.seed % 2 == 0 else SINGLE)
        if not held:
            return
        self.joints.append(fc.Support(node, self.frame.held(held)))
        spins = "u v w" in held and held != "all"
        if spins and self._chance(0.6):
            axis = self.frame.along((0.0, 0.0, -1.0))
            self.drives.append(fc.RotaryDrive("slew", node, axis=axis, **self._motor()))
        if "u" not in held.split() and held != "all" and self._chance(0.6):
            along = self.frame.along((1.0, 0.0, 0.0))
            self.drives.append(fc.LinearDrive("travel", node, direction=along, radius=0.3, **self._motor()))

    def _close(self) -> None:
        """Parts between places that are held together already: loops."""
        for _ in range(int(self.rng.integers(1, 3))):
            known = self._six()
            pairs = [
                (m, n)
                for m in known
                for n in known
                if m[0].part != n[0].part and np.linalg.norm(m[1] - n[1]) > 0.3  # a body is no loop with itself
            ]
            if not pairs:
                return
            (m, a), (n, b) = self._choose(pairs)
            kind = self._choose(["beam", "beam", "rope", "spring", "spring", "body"])
            start, far = self._part(kind, a, b)
            for node, end in ((m, start), (n, far)):
                self._join(node, end) if kind in ("beam", "body") else self.joints.append(fc.Pin(node, end))

    # -- what acts

    def _inputs(self) -> list:
        node, six = self._choose(self.places)[0], self._choose(self._six())[0]
        push = (fc.Force, fc.Torque) if self._chance(0.6) else (fc.FollowerForce, fc.FollowerTorque)
        force = push[0]("force", node if len(node.freedoms) == 6 else six, self.frame.along(self._unit()))
        torque = push[1]("torque", six, self.frame.along(self._unit()))
        return [force, torque, *(fc.MotorTorque(f"{d.name}_torque", d) for d in self.drives)]

    def _outputs(self) -> list:
        last, first = self.places[-1][0], self.places[0][0]
        along = self.frame.along
        found = [fc.Velocity("speed", last, along(self._unit()))]
        found += [fc.AngularVelocity("spin", self._six()[-1][0], along(self._unit()))]
        found += [fc.Position("span", last, along(self._unit()), minus=first)] if last != first else []
        return found + [fc.DriveAngle(f"{d.name}_angle", d) for d in self.drives]

    def _course(self) -> tuple[dict[str, float], dict[str, tuple[float, float]]]:
        """Loads that stay, and for every other structure loads that swing: amplitude and frequency."""
        names = ["force", "torque", *(f"{d.name}_torque" for d in self.drives)]
        loads = {name: float(self.rng.uniform(-4, 4)) for name in names}
        swing = {name: (float(self.rng.uniform(-4, 4)), float(self.rng.uniform(5, 30))) for name in names}
        return loads, (swing if self._chance(0.4) else {})

    def _effects(self) -> list[Effect]:
        weight = [] if self.calm else [fc.Gravity(self.frame.along(GRAVITY))]
        common: list[Effect] = [*weight, fc.LargeRotation()]
        damped = [fc.RayleighDamping(0.1, 0.002)]
        drives = [d.name for d in self.drives]
        springs = [p.name for p in self.elements if isinstance(p, fc.Spring)]
        plain = [p.name for p in self.elements if isinstance(p, fc.Beam) and not p.section.shears]
        modes = [fc.ComponentModes(1, plain, along=1)] if plain else []
        chosen = self.seed % 8
        if chosen == 0:
            return [*common, fc.Flexible()]
        if chosen == 1:
            return [*common, *damped]
        if chosen == 2:
            return [*common, *damped, *modes, fc.ShaftElasticity(), fc.RopeStretch()]
        full = [*common, *damped, fc.Flexible()]
        if chosen == 3:
            return [*full, fc.CoulombFriction({d: fc.Coulomb(0.3, 0.4) for d in drives})]
        if chosen == 4:
            return [*full, fc.ViscousFriction(dict.fromkeys(drives, 0.2)), fc.MotorLag(dict.fromkeys(drives, 0.02))]
        if chosen == 5:
            return [*full, fc.Backlash(dict.fromkeys(drives, 0.05) | dict.fromkeys(springs, 0.02))]
        if chosen == 6:
            law = fc.LuGre(stiffness=60.0, kinetic=0.3, static=0.4, stribeck=0.5, damping=0.5, viscous=0.02)
            return [*full, fc.LuGreFriction(dict.fromkeys(drives, law))]
        return full


def whole(seed: int, frame: Frame = HERE, calm: bool = False) -> Case:
    """The structure of this seed or the next that may be built: drives held by supports are refused."""
    while True:
        try:
            return case(seed, frame, calm)
        except StructureError:
            seed += 10_000 - 10_000 % 24
