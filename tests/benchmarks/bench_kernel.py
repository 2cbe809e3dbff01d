"""What a kernel costs: casadi's virtual machine against compiled code, for 9, 100 and 1000 items.

Run as a script; trust the ratios, not the times.
"""

from __future__ import annotations

import os
import tempfile
import time
from collections.abc import Callable
from itertools import pairwise

import casadi as ca
import numpy as np

from flexctrl.kernels.kernel import CasadiVM, Compiled, Kernel, Run

PARTS = 24


def lattice() -> Kernel:
    """Return about 1,000 instructions of springs, cross products and angles, in the mix of a beam element."""
    x, p = ca.SX.sym("x", 3 * PARTS + 3), ca.SX.sym("p", 20)
    points = ca.vertsplit(x, 3)
    force = ca.SX.zeros(12)
    for k, (a, b) in enumerate(pairwise(points)):
        d = b - a
        length = ca.sqrt(ca.dot(d, d))
        lever = ca.cross(d / length, p[:3] + a)
        pull = p[3 + k % 17] * (length - p[3]) * lever + ca.if_else(length < p[4], d, 0)
        j = 3 * (k % 4)
        force[j : j + 3] += pull
    turn = ca.atan2(force[1], force[0]), ca.atan2(force[4], force[3])
    force[6] += ca.tan(turn[0] / 2) + ca.tan(turn[1] / 2)
    return Kernel("lattice", x, p, force)


def bound(kernel: Kernel, backend: CasadiVM | Compiled, n: int) -> tuple[Run, np.ndarray, np.ndarray]:
    """Return a chain of n items (each shares half its freedoms with the next) and vectors for it."""
    rng = np.random.default_rng(0)
    gather = np.arange(n)[:, None] * (kernel.n_in // 2) + np.arange(kernel.n_in)
    scatter = np.arange(n)[:, None] * (kernel.n_out // 2) + np.arange(kernel.n_out)
    run = backend.bind(kernel, gather, rng.uniform(0.5, 2.0, (n, kernel.n_par)), scatter)
    return run, rng.standard_normal(gather.max() + 1), np.zeros(scatter.max() + 1)


def seconds(action: Callable[[], object], window: float = 0.002) -> float:
    """Return the best of many short timings of an action: other work on the machine disturbs some of them."""
    start = time.perf_counter()
    action()
    repeats = max(1, int(window / max(time.perf_counter() - start, 1e-7)))
    best = float("inf")
    for _ in range(60):
        start = time.perf_counter()
        for _ in range(repeats):
            action()
        best = min(best, (time.perf_counter() - start) / repeats)
    return best


def main() -> None:
    """Print the table."""
    kernel = lattice()
    print(f"{kernel.instructions} instructions, {kernel.n_in} inputs, {kernel.n_out} outputs")
    with tempfile.TemporaryDirectory() as empty:
        os.environ["XDG_CACHE_HOME"] = os.environ["LOCALAPPDATA"] = empty
        start = time.perf_counter()
        bound(kernel, Compiled(), 9)
        print(f"first bind, nothing cached: {time.perf_counter() - start:.2f} s")
        print(f"{'items':>6} {'VM us':>9} {'compiled us':>12} {'fixed us':>9} {'ratio':>6} {'ns/instruction/item':>20}")
        for n in (9, 100, 1000):
            vm, z, r = bound(kernel, CasadiVM(), n)
            code, _, _ = bound(kernel, Compiled(), n)
            slow, quick = seconds(lambda vm=vm, z=z, r=r: vm(z, r)), seconds(lambda c=code, z=z, r=r: c(z, r))
            fixed = seconds(code.fixed(z, r))
            each = fixed / n / kernel.instructions * 1e9
            print(f"{n:6d} {slow * 1e6:9.1f} {quick * 1e6:12.2f} {fixed * 1e6:9.2f} {slow / quick:6.1f} {each:20.4f}")


if __name__ == "__main__":
    main()
