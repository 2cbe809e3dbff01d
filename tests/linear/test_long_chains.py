"""Ten thousand elements: equilibrium, linear model and modes of a hanging chain within a gigabyte."""

import subprocess
import sys

import numpy as np
import pytest
from scipy.special import jn_zeros

CHAIN = """
from pathlib import Path
import numpy as np
import flexctrl as fc
section = fc.Section(EA=2e5 * np.pi, EI_y=1e-3, EI_z=1e-3, GJ=1, rhoA=1, rhoJ=1e-4)
chain = fc.Beam("chain", (0, 0, 0), (0, 0, -10), section, elements=10_000)
hung = fc.Structure([chain], [fc.Support(chain.start, held="u v w rz")])
model = fc.assemble(hung, [fc.Gravity(), fc.Flexible(), fc.LargeRotation()])
modes = fc.linearize(model, at=fc.equilibrium(model)).modes(6)
lines = Path("/proc/self/status").read_text().splitlines()  # its own peak: getrusage tells the parent's beside
print(next(int(line.split()[1]) for line in lines if line.startswith("VmHWM:")) // 1024, *modes.omega)
"""


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="reads its memory from /proc")
def test_ten_thousand_elements_hang_swing_and_fit_in_a_gigabyte():
    done = subprocess.run([sys.executable, "-c", CHAIN], capture_output=True, text=True, check=True)
    memory, *omega = (float(word) for word in done.stdout.split())
    assert memory < 1000
    # (j₀ₖ/2) √(g/L), a little more by bending and less by stretching
    np.testing.assert_allclose(omega[::2], jn_zeros(0, 3) / 2.0 * np.sqrt(9.81 / 10.0), rtol=2e-3)
    np.testing.assert_allclose(omega[1::2], omega[::2], rtol=1e-6)
