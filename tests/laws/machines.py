"""Random machines: trees of beams, bodies, points, ropes and springs on every kind of joint, with drives."""

from __future__ import annotations

import numpy as np

import flexctrl as fc

SECTION = fc.Section(
    EA=900.0, EI_y=40.0, EI_z=60.0, GJ=30.0, rhoA=0.8, rhoJ=0.02, rhoI_y=0.01, rhoI_z=0.015, GA_y=500.0
)
JOINTS = ("weld", "pin", "hinge", "slide")


def machine(seed: int, parts: int = 5, supported: bool = True) -> fc.Structure:
    """A tree of parts on a first one; every freedom has mass and every kind of piece turns up over the seeds."""
    return _Builder(np.random.default_rng(seed), supported).build(parts)


class _Builder:
    def __init__(self, rng: np.random.Generator, supported: bool) -> None:
        self.rng, self.supported = rng, supported
        self.elements: list = []
        self.joints: list = []
        self.drives: list = []
        self.six: list[fc.Node] = []
        self.places: list[fc.Node] = []

    def build(self, parts: int) -> fc.Structure:
        first = self._beam(np.zeros(3)) if self.rng.random() < 0.5 else self._body(np.zeros(3))
        if self.supported:
            self._ground(first)
        for _ in range(parts - 1):
            self._grow()
        if len(self.places) > 4 and self.rng.random() < 0.7:
            self._spring()
        return fc.Structure(self.elements, self.joints, self.drives, self._inputs(), self._outputs())

    def _choose(self, items: list):
        return items[int(self.rng.integers(len(items)))]

    def _axis(self) -> tuple[float, float, float]:
        if self.rng.random() < 0.3:
            return self._choose([(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)])
        axis = self.rng.normal(size=3)
        return tuple(float(a) for a in axis / np.linalg.norm(axis))

    def _motor(self) -> dict[str, float]:
        draw = self.rng.uniform
        return {"stiffness": draw(5, 20), "ratio": draw(-3, -1), "inertia": draw(0.05, 0.2), "damping": draw(0, 1)}

    def _offset(self) -> np.ndarray:
        d = self.rng.normal(size=3)
        return d / np.linalg.norm(d) * self.rng.uniform(0.5, 1.5)

    def _beam(self, at: np.ndarray) -> fc.Node:
        end = at + self._offset()
        beam = fc.Beam(f"beam{len(self.elements)}", at, end, SECTION, int(self.rng.integers(1, 3)), up=self._offset())
        self.elements.append(beam)
        self.six += beam.nodes
        self.places += beam.nodes
        return beam.start

    def _body(self, at: np.ndarray) -> fc.Node:
        root = self.rng.normal(size=(3, 3))
        inertia = root @ root.T
        inertia = np.trace(inertia) * np.eye(3) - inertia
        points = {"a": at, "b": at + self._offset()}
        body = fc.RigidBody(f"body{len(self.elements)}", at + self._offset(), self.rng.uniform(0.5, 2), inertia, points)
        self.elements.append(body)
        self.six += body.nodes
        self.places += body.nodes
        return body.point("a")

    def _ground(self, node: fc.Node) -> None:
        held = self._choose(["all", "u v w", "u v w θx θy", "v w", "w θz"])
        self.joints.append(fc.Support(node, held))
        if held in ("u v w", "u v w θx θy"):
            self.drives.append(fc.RotaryDrive("slew", node, axis="-z", **self._motor()))
        elif held != "all":
            self.drives.append(fc.LinearDrive("travel", node, direction="x", radius=0.3, **self._motor()))

    def _grow(self) -> None:
        kind = self._choose(["beam", "beam", "beam", "body", "body", "rope", "point"])
        base = self._choose(self.six)
        at = np.array(base.position)
        if kind == "point":
            self._hang(base, at)
        elif kind == "rope":
            end = at + self._offset()
            rope = fc.Rope(
                f"rope{len(self.elements)}", at, end, EA=400.0, length=0.9 * np.linalg.norm(end - at), damping=0.2
            )
            self.elements.append(rope)
            self.joints.append(fc.Pin(base, rope.start))
            self._hang(rope.end, end)
        else:
            node = self._beam(at) if kind == "beam" else self._body(at)
            self._join(base, node)

    def _hang(self, base: fc.Node, at: np.ndarray) -> None:
        mass = fc.PointMass(f"mass{len(self.elements)}", at, self.rng.uniform(0.5, 2))
        self.elements.append(mass)
        self.joints.append(fc.Pin(base, mass.node))
        self.places.append(mass.node)

    def _join(self, base: fc.Node, node: fc.Node) -> None:
        kind, axis = self._choose(list(JOINTS)), self._axis()
        name = f"motor{len(self.drives)}"
        if kind == "weld":
            self.joints.append(fc.Weld(base, node))
        elif kind == "pin":
            self.joints.append(fc.Pin(base, node))
            if self.rng.random() < 0.3:
                self.drives.append(fc.RotaryDrive(name, node, base, axis=axis, **self._motor()))
        elif kind == "hinge":
            self.joints.append(fc.Hinge(base, node, axis))
            if self.rng.random() < 0.6:
                self.drives.append(fc.RotaryDrive(name, node, base, axis=axis, **self._motor()))
        else:
            self.joints.append(fc.Slide(base, node, axis))
            if self.rng.random() < 0.6:
                self.drives.append(fc.LinearDrive(name, node, base, direction=axis, radius=0.2, **self._motor()))

    def _spring(self) -> None:
        a, b = self.places[0], self.places[-1]
        if np.linalg.norm(np.subtract(a.position, b.position)) > 0.1:
            spring = fc.Spring("spring", a, b, stiffness=30.0, damping=0.3)
            self.elements.append(spring)
            self.joints += [fc.Pin(a, spring.start), fc.Pin(b, spring.end)]

    def _inputs(self) -> list:
        force = fc.Force("force", [self.places[-1]], self._axis())
        torque = fc.Torque("torque", self.six[-1], self._axis())
        return [force, torque, *(fc.MotorTorque(f"{d.name}_torque", d) for d in self.drives)]

    def _outputs(self) -> list:
        a, b = self.places[0], self.places[-1]
        found = [
            fc.Position("place", b, self._axis(), minus=a),
            fc.Velocity("speed", b, self._axis(), minus=a),
            fc.AngularVelocity("spin", self.six[-1], self._axis(), minus=self.six[0]),
            fc.Rotation("turn", self.six[-1], self._axis(), minus=self.six[0]),
            fc.Rotation("absolute", self.six[-1], self._axis()),
            *(fc.DriveAngle(f"{d.name}_angle", d) for d in self.drives),
            *(fc.DriveSpeed(f"{d.name}_speed", d) for d in self.drives),
            *(fc.Tension(f"{p.name}_pull", p) for p in self.elements if isinstance(p, fc.Rope | fc.Spring)),
        ]
        if np.linalg.norm(np.subtract(a.position, b.position)) > 0.1:
            found.append(fc.SwayAngle("sway", a, b, "x"))
        return found


def four_bar() -> fc.Structure:
    """A driven crank, a coupler and a rocker that carries a load on a rope; a loop where all are rigid."""
    crank = fc.Beam("crank", (0, 0, 0), (0.2, 0, 0.5), SECTION)
    coupler = fc.Beam("coupler", crank.end, (1.3, 0, 0.9), SECTION, elements=2)
    rocker = fc.Beam("rocker", coupler.end, (1.0, 0, 0), SECTION)
    rope = fc.Rope("rope", coupler.node(1), (0.75, 0, -0.4), EA=400.0)
    load = fc.PointMass("load", rope.end, 1.5)
    joints = [fc.Support(n, "u v w rx rz") for n in (crank.start, rocker.end)]
    joints += [fc.Hinge(crank.end, coupler.start, "y"), fc.Hinge(coupler.end, rocker.start, "y")]
    joints += [fc.Pin(coupler.node(1), rope.start), fc.Pin(rope.end, load.node)]
    motor = fc.RotaryDrive("motor", crank.start, axis="y", stiffness=9.0, ratio=2.0, inertia=0.1)
    outputs = [fc.Position("load_x", load.node, "x"), fc.Rotation("tilt", coupler.end, "y", minus=rocker.start)]
    return _signalled([crank, coupler, rocker, rope, load], joints, [motor], load.node, outputs)


def bridle() -> fc.Structure:
    """A trolley on four wheels; a load on two ropes under it, which swings and twists."""
    points = {"a": (0.5, 0.4, 0), "b": (0.5, -0.4, 0), "c": (-0.5, 0.4, 0), "d": (-0.5, -0.4, 0)}
    sheaves = {"left": (-0.4, 0, 0), "right": (0.4, 0, 0)}
    lugs = {"left": (-0.4, 0, -1.1), "right": (0.4, 0, -1.1)}
    trolley = fc.RigidBody("trolley", (0, 0, 0.2), 3.0, (0.5, 0.5, 0.8), points | sheaves)
    load = fc.RigidBody("load", (0, 0, -1.2), 2.0, (0.1, 0.3, 0.35), lugs)
    ropes = [fc.Rope(f"{side}_rope", sheaves[side], lugs[side], EA=500.0) for side in sheaves]
    joints = [fc.Support(trolley.point(p), "w") for p in points]
    for rope, side in zip(ropes, sheaves, strict=True):
        joints += [fc.Pin(trolley.point(side), rope.start), fc.Pin(rope.end, load.point(side))]
    drive = fc.LinearDrive("travel", trolley.node, direction="x", radius=0.2, stiffness=8.0, inertia=0.05)
    outputs = [fc.SwayAngle("sway", trolley.node, load.node, "x"), fc.Rotation("skew", load.node, "z")]
    return _signalled([trolley, *ropes, load], joints, [drive], load.node, outputs)


def double_girder() -> fc.Structure:
    """Two girders on end carriages with wheels, a trolley that slides on both, a load under it: loops on loops."""
    ends = {"near": -1.5, "far": 1.5}
    rails = {"left": -0.4, "right": 0.4}
    carriages = [
        fc.RigidBody(end, (0, y, 0), 2.0, (0.3, 0.4, 0.3), {rail: (x, y, 0) for rail, x in rails.items()})
        for end, y in ends.items()
    ]
    girders = [fc.Beam(f"{rail}_girder", (x, -1.5, 0), (x, 1.5, 0), SECTION, 2) for rail, x in rails.items()]
    trolley = fc.RigidBody("trolley", (0, 0, 0.2), 1.5, (0.2, 0.2, 0.3), {rail: (x, 0, 0) for rail, x in rails.items()})
    rope = fc.Rope("rope", trolley.node, (0, 0, -1.0), EA=500.0)
    load = fc.PointMass("load", rope.end, 2.0)
    joints = [fc.Support(c.point(rail), "w") for c in carriages for rail in rails]
    joints += [fc.Support(carriages[0].point(rail), "v") for rail in rails]
    for rail, girder in zip(rails, girders, strict=True):
        joints += [fc.Weld(carriages[0].point(rail), girder.start), fc.Weld(girder.end, carriages[1].point(rail))]
        joints.append(fc.Slide(girder.node(1), trolley.point(rail), "y"))
    joints += [fc.Pin(trolley.node, rope.start), fc.Pin(rope.end, load.node)]
    drives = [
        fc.LinearDrive("travel", carriages[0].node, direction="x", radius=0.2, stiffness=8.0, inertia=0.05),
        fc.LinearDrive(
            "cross", trolley.point("left"), girders[0].node(1), direction="y", radius=0.1, stiffness=8.0, inertia=0.05
        ),
    ]
    outputs = [fc.SwayAngle("sway", trolley.node, load.node, "y")]
    return _signalled([*carriages, *girders, trolley, rope, load], joints, drives, load.node, outputs)


def _signalled(elements: list, joints: list, drives: list, node: fc.Node, outputs: list) -> fc.Structure:
    inputs = [fc.Force("push", node, (1.0, 0.5, -0.3)), *(fc.MotorTorque(f"{d.name}_torque", d) for d in drives)]
    outputs += [fc.DriveAngle(f"{d.name}_angle", d) for d in drives]
    outputs += [fc.DriveSpeed(f"{d.name}_speed", d) for d in drives]
    return fc.Structure(elements, joints, drives, inputs, [*outputs, fc.Velocity("speed", node, "x")])
