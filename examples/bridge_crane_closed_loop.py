"""Three controllers of a 32 t bridge crane, each on the flexible machine and on its rigid twin.

Long-travel motors at both ends carry the load 5 m: (a) PD on the motor angles, (b) the same with a command
shaped by ZVD, (c) state feedback designed by LQR on the rigid twin. All run at 100 Hz with limited torque. The
crane's data are assumed (see ``flexctrl.cranes.bridge_crane``).

    python examples/bridge_crane_closed_loop.py --out results

prints settling time, residual sway, peak torque and the gain margin at a motor, and draws
``bridge_crane_closed_loop.png``. Along the path flexible and rigid hardly differ: what flexibility costs
is margin: the rigid twin promises five to ten times what there is.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import flexctrl as fc
from flexctrl.cranes import bridge_crane
from flexctrl.design import (
    Controller,
    Sampled,
    Saturated,
    Shaped,
    Together,
    Tracking,
    Trajectory,
    TrapezoidalVelocity,
    bryson,
    lqr,
    pd,
    state_feedback,
    zvd,
)
from flexctrl.plots.run import comparison_curves
from flexctrl.study.broken_loop import broken_loop

DISTANCE, GEAR = 5.0, 100.0  # m; motor radians a metre
SAMPLE, LIMIT, SWAY_PERIOD = 0.01, 250.0, 6.4  # s, N m, s
KP, KD = 20.0, 30.0  # N m/rad and N m s/rad at each motor
SIDES = ("left", "right")
TORQUES = ("left_torque", "right_torque")
STATES = ("left_angle", "right_angle", "left_speed", "right_speed", "load_offset", "load_offset_rate")
MOVE = TrapezoidalVelocity(GEAR * DISTANCE, speed=GEAR * 1.0, acceleration=GEAR * 0.25, at=1.0)  # of the motors

SCENE = fc.Scene(
    bridge_crane(),
    effects=(fc.Gravity(), fc.Flexible(), fc.LargeRotation(), fc.RayleighDamping(alpha=0.01, beta=1.5e-3)),
    simulation=fc.Simulation(
        until=30.0, tolerance=fc.Tolerance(1e-4, 1e-6), every=0.02, start=fc.Start.EQUILIBRIUM, rigid_twin=True
    ),
    notes=("Assumed data: typical catalogue figures, rounded.",),
)


def motor_pd() -> Controller:
    """Each motor on its own angle and speed."""
    sides = [pd(KP, KD, measured=f"{s}_angle", rate=f"{s}_speed", command=f"{s}_torque") for s in SIDES]
    return Together(*sides)


def rigid_lqr() -> Controller:
    """State feedback on all that the rigid twin has, both ends and the load's offset; the load's place counts."""
    plant = SCENE.twin_linear.select(TORQUES, (*STATES, "load_x")).to_ss()
    accepted = {"load_x": 0.1, "load_offset_rate": 0.1, "left_angle": 0.5 * GEAR, "right_angle": 0.5 * GEAR}
    regulator = lqr(plant, *bryson(plant, accepted, dict.fromkeys(TORQUES, 100.0)))
    return state_feedback(regulator.gain, plant[list(STATES), :])


def sway_under(law: Controller) -> tuple[float, float]:
    """Frequency (rad/s) and damping of the sway along the travel while a law holds the rigid twin's motors.

    Of the two sways the motors' give damps this one; the other goes across.
    """
    poles = broken_loop(SCENE.twin_linear, law, TORQUES[0]).closed_poles()
    pole = min((p for p in poles if 0.5 < p.imag < 1.5), key=lambda p: p.real)
    return abs(pole), -pole.real / abs(pole)


def in_hardware(law: Controller, move: Trajectory) -> Controller:
    """The law, following a move of the motors, in the crane's computer: sampled, its torques limited."""
    references = {f"{s}_angle": move for s in SIDES} | {f"{s}_speed": move.derivative for s in SIDES}
    return Saturated(Sampled(Tracking(law, references), SAMPLE), dict.fromkeys(TORQUES, LIMIT))


def controllers() -> dict[str, Controller]:
    """The three, by what the picture calls them."""
    held = motor_pd()
    return {
        "PD on the motors": in_hardware(held, MOVE),
        "PD, command shaped by ZVD": in_hardware(held, Shaped(MOVE, zvd(*sway_under(held)))),
        "LQR of the rigid twin": in_hardware(rigid_lqr(), MOVE),
    }


def gain_margins(controller: Controller) -> list[float]:
    """By what factor (to 1 %) a motor's loop may grow before it is unstable, flexible and rigid."""
    factors = np.geomspace(1.0, 100.0, 463)
    loops = [broken_loop(linear, controller, TORQUES[0]) for linear in (SCENE.linear, SCENE.twin_linear)]
    return [next((float(k) for k in factors if not loop.is_stable(k)), np.inf) for loop in loops]


def figures(run: fc.Run) -> tuple[float, float, float]:
    """Time until the load stays within 5 cm (inf: never) [s], sway left after 20 s [deg], peak motor torque [N m]."""
    last_outside = run.t[np.abs(run["load_x"] - DISTANCE) > 0.05][-1]
    settled = last_outside if last_outside < run.t[-1] - SWAY_PERIOD else np.inf
    left = np.degrees(np.abs(run["sway"][run.t >= 20.0]).max())
    return float(settled), float(left), float(max(np.abs(run[name]).max() for name in TORQUES))


def draw(comparisons: dict[str, fc.Comparison]) -> Figure:
    """One column a controller: where trolley and load are, sway, torque, and the girders' bending; rigid dashed."""
    unit = {"travel": "m", "load_x": "m", "sway": "rad", "left_torque": "N m", "bend": "m"}
    figure = Figure(figsize=(13.0, 10.0), layout="constrained")
    axes = figure.subplots(len(unit), len(comparisons), sharex=True, sharey="row")
    for column, (title, comparison) in zip(axes.T, comparisons.items(), strict=True):
        comparison_curves(column, comparison, tuple(unit), unit)
        column[0].set_title(title, fontsize=11)
        column[-1].set_xlabel("time (s)")
    figure.suptitle("A 32 t bridge crane over 5 m: flexible machine and rigid twin under the same controllers")
    return figure


def main(out: Path | None = None) -> dict[str, fc.Comparison]:
    """Run everything, print the numbers and draw the picture into ``out``."""
    heads = ("settled (s)", "sway left (deg)", "peak torque (N m)", "gain margin")
    print(f"{'':28}" + "".join(f"{head:>22}" for head in heads))
    print(f"{'':28}" + f"{'flexible':>12}{'rigid':>10}" * len(heads))
    found = {}
    for title, controller in controllers().items():
        found[title] = comparison = fc.compare(SCENE.with_(controller=controller))
        pairs = list(zip(figures(comparison.flexible), figures(comparison.rigid), strict=True))
        pairs.append(tuple(gain_margins(controller)))
        print(f"{title:28}" + "".join(f"{f:12.2f}{r:10.2f}" for f, r in pairs), flush=True)
    if out is not None:
        out.mkdir(parents=True, exist_ok=True)
        draw(found).savefig(out / "bridge_crane_closed_loop.png", dpi=150)
    return found


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="Three controllers of a bridge crane, flexible and rigid.")
    parser.add_argument("--out", type=Path, default=Path(__file__).parent, help="directory for the picture")
    main(parser.parse_args().out)
