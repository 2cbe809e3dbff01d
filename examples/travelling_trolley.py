"""A trolley crosses the girder of a 32 t bridge crane as it bends, with the load swinging below.

The girder is that of ``flexctrl.cranes.bridge_crane`` (assumed data), its ends held; the trolley's wheels are driven
by a motor whose angle follows a move of 15 m, plain and shaped by ZVD.

    python examples/travelling_trolley.py --out results

prints how far the girder sinks under the trolley against the influence line of a standing load, and the sway that is
left, and draws ``travelling_trolley.png``.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from scipy.interpolate import CubicHermiteSpline

import flexctrl as fc
from flexctrl.cranes.bridge_crane import GIRDERS, SPAN
from flexctrl.design import Controller, Sampled, Shaped, Tracking, Trajectory, TrapezoidalVelocity, pd, zvd

TROLLEY, LOAD, ROPE, G = 11e3, 32e3, 10.0, 9.81  # kg, kg, m, m/s²
START, DISTANCE, GEAR = 3.75, 15.0, 100.0  # m, m, motor radians a metre
MOVE = TrapezoidalVelocity(GEAR * DISTANCE, speed=GEAR * 1.5, acceleration=GEAR * 0.4, at=1.0)  # of the motor

girder = fc.Beam("girder", (0, 0, 0), (SPAN, 0, 0), GIRDERS, elements=8)
trolley = fc.Trolley("trolley", girder, at=START, mass=TROLLEY)
rope = fc.Rope("rope", trolley.node, (START, 0, -ROPE), EA=1.28e8)
load = fc.PointMass("load", rope.end, LOAD)
travel = fc.LinearDrive("travel", trolley.travel, direction="x", radius=0.315, ratio=31.5, stiffness=525.0, inertia=0.3)
crane = fc.Structure(
    [girder, trolley, rope, load],
    [
        fc.Support(girder.start, "u v w rx"),
        fc.Support(girder.end, "v w"),
        fc.Pin(trolley.node, rope.start),
        fc.Pin(rope.end, load.node),
    ],
    drives=[travel],
    inputs=[fc.MotorTorque("torque", travel)],
    outputs=[
        fc.Position("s", trolley.travel, "x"),
        fc.Position("sag", trolley.node, "z"),
        fc.Position("middle", girder.node(4), "z"),
        fc.SwayAngle("sway", trolley.node, load.node, "x"),
        fc.DriveAngle("angle", travel),
        fc.DriveSpeed("speed", travel),
    ],
    name="travelling_trolley",
)
model = fc.assemble(
    crane, [fc.Gravity(), fc.Flexible(), fc.LargeRotation(), fc.RayleighDamping(alpha=0.01, beta=1.5e-3)]
)
rest = fc.equilibrium(model, hold={"travel_source": 0.0})


def followed(move: Trajectory) -> Controller:
    """The motor follows a move, at 100 Hz; what it has at the start is an operating point."""
    law = pd(20.0, 30.0, measured="angle", rate="speed", command="torque")
    return Sampled(Tracking(law, {"angle": move, "speed": move.derivative}), 0.01)


def crossed(move: Trajectory) -> fc.Run:
    """The passage, and some swings after it."""
    return fc.simulate(model, followed(move), until=30.0, start=rest, tolerance=fc.Tolerance(1e-4, 1e-6), every=0.02)


def standing(s: np.ndarray) -> np.ndarray:
    """Sag under a load that stands still: P a² b²/(3 E I L), and the girder's own weight [m]."""
    P, q, EI = (TROLLEY + LOAD) * G, GIRDERS.rhoA * G, GIRDERS.EI_y
    own = q * s * (SPAN**3 - 2.0 * SPAN * s**2 + s**3) / (24.0 * EI)
    return -(P * (s * (SPAN - s)) ** 2 / (3.0 * EI * SPAN) + own)


runs = {"plain": crossed(MOVE), "shaped by ZVD": crossed(Shaped(MOVE, zvd(np.sqrt(G / ROPE), 0.0)))}
for name, run in runs.items():
    deepest, still = 1e3 * run["sag"].min(), 1e3 * standing(run["s"]).min()
    left = np.degrees(np.abs(run["sway"][run.t > 22.0]).max())
    print(f"{name:13}  deepest {deepest:.1f} mm (standing still: {still:.1f} mm), sway left {left:.2f} deg")


def draw() -> Figure:
    """The passage in pictures, sag under the trolley, and sway."""
    figure = Figure(figsize=(10.0, 9.0), layout="constrained")
    passage, sag, sway = figure.subplots(3, 1, gridspec_kw={"height_ratios": (1.6, 1.0, 1.0)})
    run, along = runs["plain"], np.linspace(0.0, SPAN, 200)
    nodes = [crane.number(node) for node in girder.nodes]
    ends = [crane.number(node) for node in (trolley.node, load.node)]
    for k, t in enumerate(np.linspace(2.0, 13.0, 6)):
        x, R, color = run.at(t).state.x, run.at(t).state.R, f"C{k}"
        hung = x[ends][:, [0, 2]] + (0.0, 99.0 * x[ends[0], 2])
        axis = CubicHermiteSpline(x[nodes, 0], x[nodes, 2], -R[nodes, 0, 2])
        passage.plot(along, 100.0 * axis(along), color=color, linewidth=1.0)
        passage.plot(*hung.T, "o-", color=color, linewidth=0.8)
        passage.annotate(f"{t:.1f} s", hung[1] - (0.0, 1.4), color=color, ha="center")
    passage.set(xlabel="x (m)", ylabel="z (m), sag × 100", xlim=(0.0, SPAN), ylim=(-17.0, 1.0))
    for name, found in runs.items():
        sag.plot(found["s"], 1e3 * (found["sag"] - standing(found["s"])), label=name)
        sway.plot(found.t, np.degrees(found["sway"]), label=name)
    sag.set(xlabel="s (m)", ylabel="sag beyond a still load's (mm)", xlim=(0.0, SPAN))
    sway.set(xlabel="time (s)", ylabel="sway (deg)", xlim=(0.0, 30.0))
    sag.legend(frameon=False)
    sway.legend(frameon=False)
    figure.suptitle("A trolley with 32 t crosses a girder of 22.5 m at 1.5 m/s")
    return figure


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="A trolley crosses a girder that bends.")
    parser.add_argument("--out", type=Path, default=Path(__file__).parent, help="directory for the picture")
    out = parser.parse_args().out
    out.mkdir(parents=True, exist_ok=True)
    draw().savefig(out / "travelling_trolley.png", dpi=120)
