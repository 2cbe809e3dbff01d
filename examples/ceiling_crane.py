"""The paper's crane as a study: its Fig. 11 and 12, with Exudyn's curves laid over.

    python examples/ceiling_crane.py --out results

prints how far the nearest mesh and a fine one are from a converged run of Exudyn's cable element (32 elements a
member, 5 µs steps), and draws their curves and the rigid twin's into ``ceiling_crane.png``.
"""

import argparse
from pathlib import Path

import numpy as np

import flexctrl as fc
from flexctrl.cranes import ceiling_crane

REFERENCE = Path(__file__).resolve().parents[1] / "tests" / "data" / "ceiling_crane_exudyn.csv"
effects = [fc.Gravity(), fc.Flexible(), fc.LargeRotation()]


def pushed(model: fc.Model, step: float) -> fc.Run:
    """Push both ends of the girder with 500 N, from the straight shape, for 50 ms."""
    method = fc.GeneralizedAlpha(step=step)
    return fc.simulate(model, until=0.05, inputs={"push": 500.0}, method=method, every=1e-4)


def apart(run: fc.Run, output: str, column: str) -> float:
    """RMS difference to Exudyn [m]."""
    return float(np.sqrt(np.mean((run[output] - exudyn[column]) ** 2)))


exudyn = np.genfromtxt(REFERENCE, delimiter=",", names=True, skip_header=3)
coarse = pushed(fc.assemble(ceiling_crane(), effects), 1e-4)
fine = pushed(fc.assemble(ceiling_crane(elements=8), effects), 5e-5)
twin = pushed(fc.rigid(fc.assemble(ceiling_crane(), effects)), 5e-4)
for name, run in {"1 element a member": coarse, "8 elements a member": fine}.items():
    relative, height = apart(run, "x1_minus_x4", "x1_minus_x4"), apart(run, "load_z", "z13")
    print(f"{name:19}: RMS from Exudyn {relative:.1e} m in x1 - x4, {height:.1e} m in z13")
print(f"rigid twin: z13 rises to {twin['load_z'][-1]:.6f} m, x1 - x4 stays {np.abs(twin['x1_minus_x4']).max():.1g} m")


def draw(directory: Path) -> None:
    """Draw both figures side by side."""
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, 2, figsize=(9.0, 3.4), layout="constrained")
    curves = ("x1_minus_x4", "x1_minus_x4", "x₁ − x₄ [m]"), ("load_z", "z13", "z₁₃ [m]")
    for ax, (output, column, label) in zip(axes, curves, strict=True):
        ax.plot(1e3 * coarse.t, coarse[output], ":", color="tab:blue", label="flexible, 1 element a member")
        ax.plot(1e3 * fine.t, fine[output], color="tab:blue", label="flexible, 8 elements a member")
        ax.plot(1e3 * exudyn["t"][::20], exudyn[column][::20], "k.", ms=4, label="Exudyn, converged")
        ax.plot(1e3 * twin.t, twin[output], "--", color="tab:orange", label="rigid twin")
        ax.set(xlabel="time [ms]", ylabel=label)
    axes[0].legend(fontsize="small")
    figure.savefig(directory / "ceiling_crane.png", dpi=80)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="The paper's crane beside Exudyn's.")
    parser.add_argument("--out", type=Path, default=Path(__file__).parent, help="directory for the picture")
    out = parser.parse_args().out
    out.mkdir(parents=True, exist_ok=True)
    draw(out)
