"""How long something will still take."""

from __future__ import annotations

import math

import pytest

from flexctrl.cli.progress import Pace, progress


def test_the_time_left_follows_from_what_was_done():
    pace = Pace()
    assert math.isinf(pace.left(0.0, 10.0))
    assert pace.left(0.25, 13.0) == pytest.approx(9.0)
    assert pace.left(1.0, 22.0) == 0.0


def test_what_was_stored_tells_nothing_of_the_pace():
    """60 % come from the store: at once, one by one."""
    pace = Pace()
    pace.left(0.3, 0.0)
    for k in range(30):
        pace.left(0.3 + 0.01 * k, 1e-4 * k)
    pace.left(0.6, 3.1e-3)
    assert pace.left(0.7, 10.0031) == pytest.approx(30.0)
    assert pace.left(0.7001, 10.0032) == pytest.approx(29.9, rel=0.01)


def test_a_log_shows_life_every_ten_seconds(monkeypatch, capsys):
    """Into a file or a pipe go lines, and none of what is over before."""
    clock = iter([0.0, 4.0, 9.0, 12.0, 15.0, 24.0])
    monkeypatch.setattr("flexctrl.cli.progress.time.monotonic", lambda: next(clock))
    with progress("crane: cost") as tell:
        for done in (0.1, 0.2, 0.26, 0.3, 0.5):
            tell(done)
    assert capsys.readouterr().err.splitlines() == [
        "crane: cost: 26 % done, 37 s left",
        "crane: cost: 50 % done, 25 s left",
    ]
