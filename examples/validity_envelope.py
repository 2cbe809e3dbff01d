"""How far linear models may be trusted: amplitude, speed and load at which they are wrong by one per cent.

A pendulum's period and its swing from a push, both beside their closed forms; the sway of a 32 t bridge crane;
the sag of the paper's ceiling crane under a load that is hung on its chain. The bridge crane's data are assumed
(see ``flexctrl.cranes.bridge_crane``); it is its rigid twin that sways, so that nothing but geometry speaks.

    python examples/validity_envelope.py --out results

prints the limits and draws ``validity_envelope.png``.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from scipy.special import ellipk

import flexctrl as fc
from flexctrl.cranes import bridge_crane, ceiling_crane

LENGTH, GRAVITY = 2.0, 9.81
EFFECTS = [fc.Gravity(), fc.Flexible(), fc.LargeRotation()]


# [pendulum]
def pendulum() -> fc.Model:
    """2 kg on a rigid rope of 2 m, in the x-z plane."""
    rope = fc.Rope("rope", (0, 0, 0), (0, 0, -LENGTH), EA=1e5)
    bob = fc.PointMass("bob", rope.end, 2.0)
    structure = fc.Structure(
        elements=[rope, bob],
        joints=[fc.Support(rope.start, "u v w"), fc.Pin(rope.end, bob.node)],
        outputs=[fc.SwayAngle("sway", rope.start, bob.node, "x")],
        name="pendulum",
    )
    return fc.assemble(fc.planar(structure, normal="y"), [fc.Gravity(), fc.LargeRotation()])


def swinging() -> fc.Envelope:
    """Let go at an angle: its period."""
    vary, step = fc.InitialDisplacement("rope_0_ry"), fc.GeneralizedAlpha(step=0.012, rho=1.0)
    return fc.validity_envelope(pendulum(), vary, fc.Period("sway"), error=0.01, first=0.3, method=step)


def pushed() -> fc.Envelope:
    """Pushed at the bottom: how far it swings."""
    vary, step = fc.InitialSpeed("rope_0_ry"), fc.GeneralizedAlpha(step=0.005, rho=1.0)
    return fc.validity_envelope(pendulum(), vary, fc.Peak("sway"), error=0.01, until=1.0, method=step)


# [/pendulum]


# [cranes]
def swaying() -> fc.Envelope:
    """Period of the bridge crane's sway with the bridge rolling freely, over the angle of the rope."""
    twin = fc.assemble(bridge_crane(elements=2), fc.rigid(EFFECTS))
    mode = len(fc.linearize(twin).modes())
    vary = fc.InitialMode(mode, measured_by="rope_0_ry")
    step = fc.GeneralizedAlpha(step=0.025, rho=1.0)
    return fc.validity_envelope(twin, vary, fc.Period("sway"), error=0.01, until=8.0, first=0.15, method=step)


def hung() -> fc.Envelope:
    """Sag of the chain's end under a load in newtons; the girder's ends cannot come nearer, so it stiffens."""
    crane = ceiling_crane()
    loaded = crane.with_(inputs=[fc.Force("hung", crane.part("link3").end, "-z")])
    model = fc.assemble(loaded, EFFECTS)
    return fc.validity_envelope(model, fc.ConstantLoad({"hung": 1.0}), fc.Deflection("load_z"), error=0.01)


# [/cranes]


def closed_forms(angle: np.ndarray, rate: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Errors of the linear period by the complete elliptic integral, and of the linear swing by energy."""
    period = 2.0 / np.pi * ellipk(np.sin(angle / 2.0) ** 2) - 1.0
    swing = rate / np.sqrt(GRAVITY / LENGTH)
    return period, 2.0 * np.arcsin(swing / 2.0) / swing - 1.0


def draw(directory: Path, envelopes: dict[str, fc.Envelope]) -> None:
    """Draw the four error curves into ``validity_envelope.png``."""
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(2, 2, figsize=(11.0, 7.0), layout="constrained")
    for ax, (name, envelope) in zip(axes.ravel(), envelopes.items(), strict=True):
        fc.plot_envelope(envelope, ax)
        ax.set_title(name, fontsize=10)
    angle, rate = np.geomspace(0.02, 1.0, 50), np.geomspace(0.05, 2.0, 50)
    for ax, x, error in zip(axes[0], (angle, rate), closed_forms(angle, rate), strict=True):
        ax.plot(x, 100.0 * error, "k:", label="closed form", zorder=0)
        ax.legend(frameon=False, fontsize="small")
    figure.savefig(directory / "validity_envelope.png", dpi=80)


def main(out: Path | None = None) -> dict[str, fc.Envelope]:
    """Print the limits, and draw into ``out``."""
    # [main]
    found = {
        "a pendulum let go": swinging(),
        "a pendulum pushed": pushed(),
        "a bridge crane's sway": swaying(),
        "the ceiling crane, loaded": hung(),
    }
    for envelope in found.values():
        print(envelope)
    # [/main]
    if out is not None:
        out.mkdir(parents=True, exist_ok=True)
        draw(out, found)
    return found


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="Where linear predictions are wrong by one per cent.")
    parser.add_argument("--out", type=Path, default=Path(__file__).parent, help="directory for the picture")
    main(parser.parse_args().out)
