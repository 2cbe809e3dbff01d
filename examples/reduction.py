"""One portal frame reduced in every way there is, by order and by error.

A trolley stands on a portal of box beams, is braked across it and lifts a load: two inputs, three outputs, 90
degrees of freedom. Every method gives a model with the same signal names and measures its own error against the
full model. Then the question is put the other way round: which order is needed for an error of 0.1 % of the
peak up to 20 Hz?

    python examples/reduction.py --out results

prints orders and achieved errors and draws ``reduction.png``.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

import flexctrl as fc

# [portal]
box = fc.Section.box(fc.STEEL, width=0.3, height=0.5, web=0.008, flange=0.012)
left = fc.Beam("left", start=(0, 0, 0), end=(0, 0, 8), section=box, elements=5)
right = fc.Beam("right", start=(0, 12, 0), end=(0, 12, 8), section=box, elements=5)
girder = fc.Beam("girder", start=left.end, end=right.end, section=box, elements=6)
place = girder.node(2)
trolley = fc.PointMass("trolley", at=place, mass=800.0)
portal = fc.Structure(
    elements=[left, right, girder, trolley],
    joints=[
        fc.Support(left.start),
        fc.Support(right.start),
        fc.Weld(left.end, girder.start),
        fc.Weld(girder.end, right.end),
        fc.Pin(place, trolley.node),
    ],
    inputs=[fc.Force("brake", place, "x"), fc.Force("lift", place, "z")],
    outputs=[
        fc.Position("trolley_x", place, "x"),
        fc.Position("trolley_z", place, "z"),
        fc.Position("far_x", right.end, "x"),
    ],
    name="portal",
)
effects = [fc.Gravity(), fc.Flexible(), fc.LargeRotation(), fc.RayleighDamping(alpha=0.2, beta=1e-4)]
full = fc.linearize(fc.assemble(portal, effects))
# [/portal]

# [methods]
heads = tuple(c for c in full.coordinates if c.startswith(("left_5_", "right_5_", "girder_2_")))
METHODS = {
    "6 lowest modes": fc.ModalTruncation(6),
    "… and their static rest": fc.ModalTruncation(6, static_correction=True),
    "modes below 35 Hz, static rest": fc.ModalTruncation(fc.BelowFrequency(35.0), static_correction=True),
    "6 modes by their part in trolley_z": fc.ModalTruncation(fc.Participation(6, outputs=("trolley_z",))),
    "6 modes by their DC gain": fc.ModalTruncation(fc.DCGain(6), static_correction=True),
    "Craig–Bampton, frame corners kept": fc.CraigBampton(heads, modes=1),
    "balanced, 12 states": fc.BalancedTruncation(12),
    "balanced, DC gain exact": fc.BalancedTruncation(12, match_dc=True),
    "moments at 0, 6 and 12 Hz": fc.MomentMatching((0.0, 38j, 75j), 12),
}
# [/methods]

# [by_error]
GOAL = fc.RelativeError(0.001, up_to_hz=20.0)
FAMILIES = {
    "lowest modes": fc.ModalTruncation,
    "lowest modes, static rest": lambda order: fc.ModalTruncation(order, static_correction=True),
    "modes that take part most": lambda order: fc.ModalTruncation(fc.Participation(order), static_correction=True),
    "balanced, DC gain exact": lambda order: fc.BalancedTruncation(order, match_dc=True),
    "moments at 0, 6 and 12 Hz": lambda order: fc.MomentMatching((0.0, 38j, 75j), order),
}
# [/by_error]


def states(reduced: fc.Reduced) -> int:
    """States of a first-order model; two for each coordinate of a second-order one."""
    return len(reduced.to_ss().A)


def draw(directory: Path, by_order: dict[str, fc.Reduced], by_error: dict[str, fc.Reduced]) -> None:
    """Draw error curves of one channel and the orders that 0.1 % takes into ``reduction.png``."""
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, 2, figsize=(13.0, 5.2), layout="constrained", width_ratios=[1.7, 1.0])
    fc.plot_reduction(by_order, axes[0], channel=("trolley_z", "lift"))
    axes[0].set(title="trolley_z from lift (m/N), and how far the reduced models are from it", xlim=(0.5, 300.0))
    axes[0].set_ylim(1e-14, 1e-4)
    axes[0].get_legend().remove()
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower left", ncols=3, frameon=False, fontsize=8)
    rows = np.arange(len(by_error))[::-1]
    axes[1].barh(rows, [states(r) for r in by_error.values()], color="#1d4ed8", height=0.6)
    for row, reduced in zip(rows, by_error.values(), strict=True):
        text = f"{states(reduced)} states, {100 * reduced.error_up_to(20.0).worst:.2g} %"
        axes[1].text(0.4, row, text, va="center", color="white", fontsize=9)
    axes[1].set_yticks(rows, list(by_error), fontsize=9)
    axes[1].set(xlabel="states", title="0.1 % up to 20 Hz takes")
    figure.savefig(directory / "reduction.png", dpi=75)


def main(out: Path | None = None) -> tuple[dict[str, fc.Reduced], dict[str, fc.Reduced]]:
    """Print orders and errors, and draw into ``out``."""
    # [print]
    by_order = {name: full.reduce(method) for name, method in METHODS.items()}
    print(f"{len(full.coordinates)} coordinates:                   error up to 20 Hz: at worst  lift → trolley_z")
    for name, reduced in by_order.items():
        error = reduced.error_up_to(20.0)
        print(f"{name:34} {states(reduced):3d} states  {error.worst:16.1e}  {error.relative[1, 1]:16.1e}")
    by_error = {name: full.reduce(GOAL, using=family) for name, family in FAMILIES.items()}
    print("\n0.1 % up to 20 Hz:                                  achieved")
    for name, reduced in by_error.items():
        print(f"{name:34} {states(reduced):3d} states  {reduced.error_up_to(20.0).worst:16.1e}")
    # [/print]
    if out is not None:
        out.mkdir(parents=True, exist_ok=True)
        draw(out, by_order, by_error)
    return by_order, by_error


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="A portal frame reduced in every way there is.")
    parser.add_argument("--out", type=Path, default=Path(__file__).parent, help="directory for the picture")
    main(parser.parse_args().out)
