"""Frequency responses that show every peak, and the margins that follow from them.

A 32 t bridge crane under a PD loop from the trolley's place, as a laser measures it, to one travel motor; the
flexible machine and its rigid twin. python-control's default grid of 1000 points walks past the lightly damped
peaks, and its margins through polynomials fail at 37 states; handed flexctrl's response, they are right.
The crane's data are assumed (see ``flexctrl.cranes.bridge_crane``).

    python examples/bode.py --out results

prints peaks and margins and draws ``bode_margins.png``.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import control
import numpy as np

import flexctrl as fc
from flexctrl.cranes import bridge_crane

# [model]
effects = [fc.Gravity(), fc.Flexible(), fc.LargeRotation(), fc.RayleighDamping(alpha=0.002, beta=1e-4)]
crane = fc.assemble(bridge_crane(elements=4), effects)
machines = {"flexible": fc.linearize(crane), "rigid": fc.linearize(fc.rigid(crane))}
channels = {name: linear.select(["left_torque"], ["travel"]) for name, linear in machines.items()}
responses = {name: channel.frequency_response(span=(0.03, 300.0)) for name, channel in channels.items()}
# [/model]


# [peaks]
def peaks() -> list[tuple[float, float, float]]:
    """Frequency [Hz] of each resonance seen in the channel, its peak, and how much of it python-control shows."""
    mine, theirs = responses["flexible"], control.frequency_response(channels["flexible"].to_ss())
    found = []
    for omega in channels["flexible"].damped_poles().imag:
        near, also = (abs(w - omega) < 0.02 * omega for w in (mine.omega, theirs.omega))
        if omega > 0.3 and near.any():
            size = abs(mine.values[0, 0])
            k = int(np.argmax(np.where(near, size, 0.0)))
            if near[k - 1 : k + 2].all() and size[k] > 1.5 * size[near].min():
                found.append((omega / (2 * np.pi), size[k], abs(theirs.frdata[0, 0])[also].max(initial=0.0) / size[k]))
    return found


# [/peaks]

# [loop]
law = control.tf([60.0, 10.0], [0.1, 1.0])  # N m per m: a derivative up to 1.6 Hz
loops = {name: fc.open_loop(channel, law) for name, channel in channels.items()}
margins = {name: fc.margins(loop) for name, loop in loops.items()}
# [/loop]


# [python_control]
def margins_by_python_control() -> tuple[float, float, float]:
    """Gain margin, phase margin [deg] and distance to −1 from flexctrl's response of the flexible loop."""
    data = loops["flexible"].frd(responses["flexible"].omega)
    gain, phase, distance = control.stability_margins(data)[:3]
    return float(gain), float(phase), float(distance)


def polynomial_failure() -> str:
    """What python-control says to the same loop as a state space."""
    with np.errstate(all="ignore"):
        try:
            control.stability_margins(law * channels["flexible"].to_ss())
        except np.linalg.LinAlgError as error:
            return f"LinAlgError: {error}"
    return "no failure"


# [/python_control]


def draw(directory: Path) -> None:
    """Draw plant, loop, Nyquist, Nichols and sensitivities into ``bode_margins.png``."""
    import matplotlib.pyplot as plt

    figure = plt.figure(figsize=(13.0, 7.2), layout="constrained")
    ax = figure.subplot_mosaic(
        [["gain", "peak", "nyquist"], ["phase", "sensitivity", "nichols"]], width_ratios=[3, 2, 2]
    )
    fc.plot_bode(responses, (ax["gain"], ax["phase"]))
    ax["gain"].set_title("trolley from left motor's torque (m/(N m))", fontsize=10)
    theirs = control.frequency_response(channels["flexible"].to_ss())
    mine = responses["flexible"]
    ax["peak"].plot(
        mine.frequencies, abs(mine.values[0, 0]), ".-", ms=3, lw=1.2, label="flexctrl's grid", color="#1d4ed8"
    )
    ax["peak"].plot(theirs.omega / (2 * np.pi), abs(theirs.frdata[0, 0]), "ks-", ms=5, lw=0.8, label="python-control's")
    ax["peak"].set(yscale="log", xlim=(4.0, 4.5), ylim=(1e-5, 4e-3), xlabel="frequency (Hz)", ylabel="magnitude")
    ax["peak"].set_title("one peak, closer", fontsize=10)
    ax["peak"].legend(fontsize="small", frameon=False)
    fc.plot_nyquist(loops, ax["nyquist"], margins=margins["flexible"], radius=1.6)
    fc.plot_nichols(loops, ax["nichols"], gain=(-50.0, 40.0))
    fc.plot_sensitivities(loops, ax["sensitivity"])
    ax["sensitivity"].set(xlim=(3e-3, 20.0), ylim=(-40.0, 20.0))
    figure.savefig(directory / "bode_margins.png", dpi=75)


def main(out: Path | None = None) -> None:
    """Print peaks and margins, and draw into ``out``."""
    print("resonance      peak (m/(N m))  python-control's default grid shows")
    for hertz, size, share in peaks():
        print(f"{hertz:8.4f} Hz  {size:14.4g}  {100 * share:6.0f} %")
    for name, found in margins.items():
        print(f"\n{name} {found}")
    gain, phase, distance = margins_by_python_control()
    print("\npython-control from flexctrl's response: ", end="")
    print(f"gain margin {gain:.4f}, phase margin {phase:.3f} deg, modulus {distance:.4f}")
    print(f"python-control from the state space: {polynomial_failure()}")
    if out is not None:
        out.mkdir(parents=True, exist_ok=True)
        draw(out)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="Bode, Nyquist and Nichols of a bridge crane, rigid and flexible.")
    parser.add_argument("--out", type=Path, default=Path(__file__).parent, help="directory for the picture")
    main(parser.parse_args().out)
