"""How long something will still take."""

from __future__ import annotations

import math

import pytest

from flexctrl.cli.progress import Pace, progress, spoken


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


@pytest.mark.parametrize(
    ("seconds", "words"),
    [(0.0, "0 s"), (99.6, "100 s"), (150.0, "2 min"), (9000.0, "2 h"), (5e5, "6 days"), (1e300, "over 1000 days")],
)
def test_a_time_to_wait_is_told_in_a_unit_one_would_say_it_in(seconds, words):
    assert spoken(seconds) == words


def test_a_run_without_an_end_in_sight_is_told_in_few_letters(monkeypatch, capsys):
    clock = iter([0.0, 1.0, 20.0])
    monkeypatch.setattr("flexctrl.cli.progress.time.monotonic", lambda: next(clock))
    with progress("crane") as tell:
        tell(0.0)
        tell(1e-300)
    assert capsys.readouterr().err == "crane: 0 % done, over 1000 days left\n"
