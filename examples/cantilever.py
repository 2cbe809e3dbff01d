"""The first tutorial: from a cantilever to a crane that carries a swinging load.

    python examples/cantilever.py --out results

prints what the tutorial shows and draws ``bode.png`` and ``move.png``.
"""

import argparse
from pathlib import Path

import numpy as np

import flexctrl as fc
from flexctrl.design import MinimumJerk, Shaped, Trajectory, pd, zvd

# [cantilever]
box = fc.Section.box(fc.STEEL, width=0.1, height=0.1, web=0.004, flange=0.004)
foot = fc.Beam("foot", start=(0, 0, 0), end=(1.5, 0, 0), section=box)
tip = fc.Beam("tip", start=foot.end, end=(3, 0, 0), section=box)

cantilever = fc.planar(
    fc.Structure(
        elements=[foot, tip],
        joints=[fc.Support(foot.start), fc.Weld(foot.end, tip.start)],
        outputs=[fc.Position("tip_y", at=tip.end, direction="y")],
    )
)
print(cantilever.join_table)
# [/cantilever]

# [frequency]
model = fc.assemble(cantilever, effects=[fc.Flexible(), fc.LargeRotation()])
first = fc.linearize(model).modes().frequencies[0]
textbook = 1.8751**2 * np.sqrt(box.EI_z / (box.rhoA * 3.0**4)) / (2 * np.pi)
print(f"first bending frequency: {first:.3f} Hz, textbook {textbook:.3f} Hz")
# [/frequency]

# [crane]
mast = fc.Beam("mast", start=(0, 0, 0), end=(0, 0, 3), section=box, elements=4)
jib = fc.Beam("jib", start=mast.end, end=(1.5, 0, 3), section=box, elements=2)
rope = fc.Rope("rope", start=jib.end, end=(1.5, 0, 1), EA=1e6)
load = fc.PointMass("load", at=rope.end, mass=100.0)
cart = fc.PointMass("cart", at=mast.start, mass=200.0)
travel = fc.LinearDrive("travel", mast.start, direction="x", radius=0.1, ratio=20, stiffness=50.0, inertia=0.01)

crane = fc.planar(
    fc.Structure(
        elements=[mast, jib, rope, load, cart],
        joints=[
            fc.Support(mast.start, held="w ry"),
            fc.Pin(mast.start, cart.node),
            fc.Weld(mast.end, jib.start),
            fc.Pin(jib.end, rope.start),
            fc.Pin(rope.end, load.node),
        ],
        drives=[travel],
        inputs=[fc.MotorTorque("torque", travel)],
        outputs=[
            fc.DriveAngle("angle", travel),
            fc.DriveSpeed("speed", travel),
            fc.Position("load_x", at=load.node, direction="x"),
            fc.Position("jib_z", at=jib.end, direction="z"),
            fc.SwayAngle("sway", top=jib.end, load=load.node, direction="x"),
        ],
        name="crane",
    ),
    normal="y",
)
print(crane.join_table)
# [/crane]

# [equilibrium]
effects = [fc.Gravity(), fc.Flexible(), fc.LargeRotation(), fc.RayleighDamping(beta=2e-4)]
flexible = fc.assemble(crane, effects)
rest = fc.equilibrium(flexible, hold={"mast_0_u": 0.0})
print(f"under the load the jib's end sinks by {3.0 - rest.outputs['jib_z']:.4f} m")
# [/equilibrium]

# [linear]
linear = fc.linearize(flexible, at=rest.state)
modes = linear.modes()
for k in range(4):
    shares = {part: share[k] for part, share in modes.kinetic_shares.items()}
    print(f"{modes.kinds[k]:8} {modes.frequencies[k]:6.3f} Hz  moves most: {max(shares, key=shares.get)}")
# [/linear]

# [bode]
twin = fc.rigid(flexible)
stiff = fc.linearize(twin)
responses = {
    "flexible": linear.select(["torque"], ["sway"]).frequency_response(span=(0.5, 200.0)),
    "rigid": stiff.select(["torque"], ["sway"]).frequency_response(span=(0.5, 200.0)),
}
# [/bode]

# [control]
pendulum = modes.omega[1]
law = pd(kp=1.0, kd=0.2, measured="angle", rate="speed", command="torque")
move = MinimumJerk(distance=2.0 * travel.effective_ratio, duration=4.0)
shaped = Shaped(move, zvd(pendulum))


def carried(model: fc.Model, command: Trajectory) -> fc.Run:
    """Run a model whose motor follows a command, sampled at 100 Hz, with a torque limit."""
    tracking = fc.Tracking(law, {"angle": command, "speed": command.derivative})
    hardware = fc.Saturated(fc.Sampled(tracking, 0.01), {"torque": 60.0})
    return fc.simulate(model, hardware, until=12.0, start=fc.equilibrium(model, hold={"mast_0_u": 0.0}), every=0.02)


runs = {
    "PD, flexible": carried(flexible, move),
    "PD, rigid": carried(twin, move),
    "PD and shaper, flexible": carried(flexible, shaped),
    "PD and shaper, rigid": carried(twin, shaped),
}
for name, run in runs.items():
    sway, torque = np.abs(run["sway"][run.t > 8.0]).max(), np.abs(run["torque"]).max()
    nod = 1e3 * np.ptp(run["jib_z"])
    print(f"{name:23}  sway left {sway:.3f} rad, peak torque {torque:.2f} N m, jib nods {nod:.1f} mm")
# [/control]


def draw(directory: Path) -> None:
    """Draw the frequency responses and the moves."""
    import matplotlib.pyplot as plt

    # [bode picture]
    figure, ax = plt.subplots(figsize=(6.4, 3.2), layout="constrained")
    for name, response in responses.items():
        ax.loglog(response.frequencies, np.abs(response.channel("sway", "torque")), label=name)
    ax.set(xlabel="frequency [Hz]", ylabel="sway per torque [rad/(N m)]", ylim=(1e-6, 1e2))
    ax.legend()
    figure.savefig(directory / "bode.png", dpi=90)
    # [/bode picture]
    # [move picture]
    figure, axes = plt.subplots(2, sharex=True, figsize=(6.4, 4.0), layout="constrained")
    for name, run in runs.items():
        style = "--" if "rigid" in name else "-"
        axes[0].plot(run.t, run["load_x"], style, label=name)
        axes[1].plot(run.t, 1e3 * (run["jib_z"] - 3.0), style)
    axes[0].set(ylabel="load x [m]")
    axes[1].set(xlabel="time [s]", ylabel="jib's end [mm]")
    axes[0].legend(fontsize="small")
    figure.savefig(directory / "move.png", dpi=90)
    # [/move picture]


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="From a cantilever to a crane that carries a swinging load.")
    parser.add_argument("--out", type=Path, default=Path(__file__).parent, help="directory for the pictures")
    out = parser.parse_args().out
    out.mkdir(parents=True, exist_ok=True)
    draw(out)
