"""How much gain the flexible crane bears from controllers that were designed on its rigid twin.

The 32 t bridge crane under three regulators in its computer (100 Hz, one sample of delay): PD on the motor angles;
PD on the trolley's place as a laser measures it, half a span away from the motors; and LQR designed on the rigid twin.
For each: the critical gain, and where the mode lives that gives way. The second is confirmed by
nonlinear simulation just below and above its critical gain. The crane's data are assumed (see
``flexctrl.cranes.bridge_crane``).

    python examples/spillover.py --out results

prints the certificates and draws ``spillover.png``.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import flexctrl as fc
from flexctrl.cranes import bridge_crane
from flexctrl.design import Controller, FilteredRate, Together, bryson, lqr, pd, state_feedback

SAMPLE = 0.01  # s
SIDES = ("left", "right")
TORQUES = ("left_torque", "right_torque")
STATES = ("left_angle", "right_angle", "left_speed", "right_speed", "load_offset", "load_offset_rate")

# [model]
effects = [fc.Gravity(), fc.Flexible(), fc.LargeRotation(), fc.RayleighDamping(alpha=0.01, beta=1.5e-3)]
crane = fc.assemble(bridge_crane(elements=2), effects)
rest = fc.equilibrium(crane)
twin = fc.linearize(fc.rigid(crane))
# [/model]


def motor_pd() -> Controller:
    """Each motor on its own angle and speed."""
    return Together(*(pd(20.0, 30.0, measured=f"{s}_angle", rate=f"{s}_speed", command=f"{s}_torque") for s in SIDES))


# [laser]
def laser_pd() -> Controller:
    """Both motors on the trolley's place, whose rate is filtered from it."""
    return Together(
        *(pd(100.0, 200.0, measured="travel", rate=FilteredRate(0.05), command=torque) for torque in TORQUES)
    )


# [/laser]


def rigid_lqr() -> Controller:
    """State feedback on all that the rigid twin has; the load's place counts."""
    plant = twin.select(TORQUES, (*STATES, "load_x")).to_ss()
    accepted = {"load_x": 0.1, "load_offset_rate": 0.1, "left_angle": 50.0, "right_angle": 50.0}
    regulator = lqr(plant, *bryson(plant, accepted, dict.fromkeys(TORQUES, 100.0)))
    return state_feedback(regulator.gain, plant[list(STATES), :])


def main(out: Path | None = None) -> dict[str, fc.Spillover]:
    """Print the certificates, confirm the laser's, and draw it into ``out``."""
    laws = {"PD on the motors": motor_pd(), "PD on the trolley": laser_pd(), "LQR of the rigid twin": rigid_lqr()}
    # [certificates]
    found = {}
    for name, law in laws.items():
        found[name] = fc.spillover(crane, fc.Delayed(fc.Sampled(law, SAMPLE), 1), rest)
        print(f"{name}: {found[name]}\n", flush=True)
    confirmation = found["PD on the trolley"].confirm()
    print(confirmation)
    # [/certificates]
    if out is not None:
        out.mkdir(parents=True, exist_ok=True)
        found["PD on the trolley"].plot(confirmation).savefig(out / "spillover.png", dpi=90)
    return found


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="Spillover certificates of three regulators on a bridge crane.")
    parser.add_argument("--out", type=Path, default=Path(__file__).parent, help="directory for the picture")
    main(parser.parse_args().out)
