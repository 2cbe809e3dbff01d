"""Root loci of a bridge crane, rigid and flexible, and where polynomials stop telling the truth.

A PD loop from the trolley's place to one travel motor is stable at any gain on the rigid twin. On the flexible
machine a mode of the girder crosses the axis at 2.6 × the controller's gain. Then the mesh is refined: flexctrl's
locus is made of eigenvalues, python-control's (`control.root_locus_map`) of the roots of polynomials, whose
coefficients run out of digits from about 60 states on.
The crane's data are assumed (see ``flexctrl.cranes.bridge_crane``).

    python examples/root_locus.py --out results

prints critical gains and errors and draws ``root_locus.png``.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import control
import numpy as np
from scipy.optimize import linear_sum_assignment

import flexctrl as fc
from flexctrl.cranes import bridge_crane

EFFECTS = [fc.Gravity(), fc.Flexible(), fc.LargeRotation(), fc.RayleighDamping(alpha=0.002, beta=1e-4)]
LAW = control.tf([60.0, 10.0], [0.1, 1.0])
MESHES = (2, 4, 6, 8, 10)


# [loops]
def loop_of(model: fc.Model) -> fc.Loop:
    """Trolley to left motor, times the law."""
    return fc.open_loop(fc.linearize(model), LAW, input="left_torque", output="travel")


# [/loops]


@dataclass(frozen=True)
class Checked:
    """Poles at the critical gain by polynomials, beside those by eigenvalues."""

    states: int
    gain: float
    exact: np.ndarray
    polynomial: np.ndarray
    failure: str

    @property
    def error(self) -> float:
        """Largest relative error of a pole; infinite where there are none."""
        if self.failure:
            return np.inf
        gap = abs(self.exact[:, None] - self.polynomial) / np.maximum(abs(self.exact[:, None]), 1e-3)
        return float(gap[linear_sum_assignment(gap)].max())


# [polynomials]
def checked(loop: fc.Loop) -> Checked:
    """Ask python-control for the closed-loop poles at the first critical gain of the flexible loop."""
    gain = fc.margins(loop).gain_up.margin
    exact, system = loop.closed_poles(gain), control.ss(loop.A, loop.B, loop.C, loop.D)
    try:
        with np.errstate(all="ignore"):
            theirs = control.root_locus_map(system, gains=[gain]).loci[0]
    except (np.linalg.LinAlgError, ValueError) as error:
        return Checked(len(exact), gain, exact, np.zeros(0), type(error).__name__)
    return Checked(len(exact), gain, exact, theirs, "")


# [/polynomials]


def draw(directory: Path, loci: Mapping[str, fc.RootLocus], found: list[Checked]) -> None:
    """Draw the loci and the errors into ``root_locus.png``."""
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, 3, figsize=(14.0, 4.6), layout="constrained", width_ratios=[1.25, 1.0, 0.9])
    fc.plot_root_locus(loci, axes[0], critical=loci["flexible"].critical, top=62.0)
    axes[0].set(xlim=(-18.0, 14.0))
    axes[0].set_title("PD from trolley to left motor; k over the controller's gain", fontsize=10)
    worst = next(c for c in found if c.error > 0.01)
    axes[1].plot(worst.exact.real, worst.exact.imag, "o", mfc="none", ms=7, color="#1d4ed8", label="eigenvalues")
    axes[1].plot(worst.polynomial.real, worst.polynomial.imag, "k.", ms=5, label="polynomials (python-control)")
    axes[1].set(xlabel="real part (1/s)", ylabel="imaginary part (rad/s)", ylim=(0.0, None), xscale="symlog")
    axes[1].set_xlim(right=1.0)
    axes[1].set_title(f"poles at k = {worst.gain:.3f}, {worst.states} states", fontsize=10)
    axes[1].legend(frameon=False, fontsize="small")
    shown = [c for c in found if np.isfinite(c.error)]
    axes[2].semilogy([c.states for c in shown], [c.error for c in shown], "ko-", label="polynomials (python-control)")
    for c in found:
        if c.failure:
            axes[2].annotate(c.failure, (c.states, 1.0), (0, -14), textcoords="offset points", ha="right", fontsize=9)
            axes[2].plot(c.states, 1.0, "kx", ms=9)
    axes[2].set(xlabel="states", ylabel="worst relative error of a pole", ylim=(1e-10, 3.0))
    axes[2].grid(color="#e5e7eb")
    figure.savefig(directory / "root_locus.png", dpi=72)


def main(out: Path | None = None) -> tuple[dict[str, fc.RootLocus], list[Checked]]:
    """Print critical gains and errors, and draw into ``out``."""
    # [loci]
    models = {n: fc.assemble(bridge_crane(elements=n), EFFECTS) for n in MESHES}
    loci = {
        "flexible": fc.root_locus(loop_of(models[4])),
        "rigid": fc.root_locus(loop_of(fc.rigid(models[4]))),
    }
    for name, locus in loci.items():
        crossings = [f"{c.gain:.4f} × at {c.omega / (2 * np.pi):.3f} Hz" for c in locus.critical if c.unstable_above]
        print(f"{name:8}: {locus.loci.shape[1]} poles, unstable above: {crossings[0] if crossings else 'never'}")
    # [/loci]
    found = [checked(loop_of(model)) for model in models.values()]
    print("states  critical gain  worst error of a pole by polynomials")
    for c in found:
        print(f"{c.states:6d}  {c.gain:13.6f}  {c.failure or format(c.error, '.1e')}")
    if out is not None:
        out.mkdir(parents=True, exist_ok=True)
        draw(out, loci, found)
    return loci, found


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="Root loci of a bridge crane, rigid and flexible.")
    parser.add_argument("--out", type=Path, default=Path(__file__).parent, help="directory for the picture")
    main(parser.parse_args().out)
