"""Functions that are compiled together have names of their own: machines use only some of them at once."""

from __future__ import annotations

import pytest

from flexctrl.dynamics.march.loops import run
from flexctrl.kernels.native import assembly


def test_no_two_functions_of_the_march_have_one_name():
    pytest.importorskip("llvmlite")
    assert "@run(" in assembly(run)
