"""Every simulation of a hard case has its report checked; see `health`."""

from __future__ import annotations

from typing import Any

import pytest
from health import check

import flexctrl as fc


@pytest.fixture(autouse=True)
def _healthy_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    simulate = fc.simulate

    def checked(*args: Any, until: float, **more: Any) -> fc.Run:
        run = simulate(*args, until=until, **more)
        check(run, until)
        return run

    monkeypatch.setattr(fc, "simulate", checked)
