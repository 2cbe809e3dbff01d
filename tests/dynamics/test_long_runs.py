"""Long runs: stopped by Ctrl-C or killed, gone on from a checkpoint bit for bit, in bounded memory."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from long_running import CASES, FIXED, Servo, arm, ends, ran

import flexctrl as fc
from flexctrl.dynamics.march import ride

HERE = Path(__file__).parent
UNTIL = 0.25


def process(*task: object) -> subprocess.Popen[str]:
    words = [sys.executable, str(HERE / "long_running.py"), str(os.getpid()), *map(str, task)]
    return subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def printed(*task: object) -> list[str]:
    child = process(*task)
    out, error = child.communicate(timeout=300)
    assert child.returncode == 0, error
    return out.split()


def wait_for(path: Path) -> None:
    for _ in range(3000):
        if path.exists():
            return
        time.sleep(0.02)
    raise TimeoutError(path)


# -- interrupted


@pytest.mark.slow
def test_ctrl_c_keeps_the_trajectory(tmp_path):
    child = process("forever", tmp_path)
    wait_for(tmp_path / "begun")
    child.send_signal(signal.SIGINT)
    out, error = child.communicate(timeout=60)
    assert child.returncode == 0, error
    status, last, final, checkpoint = out.split()
    assert status == "INTERRUPTED"
    assert float(last) == float(final) == float(checkpoint) > 0.0
    rows = np.loadtxt(tmp_path / "forever.csv", delimiter=",", skiprows=1)
    assert rows[-1, 0] == float(last)
    assert np.allclose(rows[:-1, 0], 0.01 * np.arange(len(rows) - 1), rtol=0.0, atol=1e-9)


@pytest.mark.slow
def test_a_second_ctrl_c_does_not_wait_for_the_controller(tmp_path):
    child = process("stuck", tmp_path)
    wait_for(tmp_path / "begun")
    child.send_signal(signal.SIGINT)
    time.sleep(0.3)
    assert child.poll() is None
    child.send_signal(signal.SIGINT)
    out, error = child.communicate(timeout=60)
    assert child.returncode == 0, error
    status, rows, last, final = out.split()
    assert status == "INTERRUPTED"
    assert int(rows) >= 1
    assert 0.0 <= float(final) <= 0.51
    assert 0.0 <= float(last) <= 0.51


ORPHAN = """
import os, subprocess, sys, time
from pathlib import Path
child = subprocess.Popen([sys.executable, {program!r}, str(os.getpid()), "forever", {folder!r}])
print(child.pid, flush=True)
while not Path({folder!r}, "begun").exists():
    time.sleep(0.02)
"""


@pytest.mark.slow
def test_a_run_whose_parent_is_gone_ends(tmp_path):
    """A suite that is killed leaves nothing behind that runs for ever."""
    parent = ORPHAN.format(program=str(HERE / "long_running.py"), folder=str(tmp_path))
    with subprocess.Popen([sys.executable, "-c", parent], stdout=subprocess.PIPE, text=True) as child:
        assert child.stdout is not None
        orphan = int(child.stdout.readline())
        child.stdout.read()  # to the end: the orphan writes there too
    assert _gone(orphan)


def _gone(pid: int) -> bool:
    for _ in range(200):
        try:
            os.kill(pid, 0)
        except ProcessLookupError:
            return True
        if Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] == "Z":
            return True
        time.sleep(0.02)
    return False


SCENE = """
import sys
from pathlib import Path
sys.path.insert(0, {here!r})
from long_running import FIXED, Servo, arm
import flexctrl as fc

class Telling(Servo):
    def command(self, t, x, y):
        if 0.2 < t < 0.21:
            Path({flag!r}).touch()
        return super().command(t, x, y)

model = arm()
run = fc.Simulation(until=1e5, method=FIXED, every=0.1)
scene = fc.Scene(model.structure, effects=list(model.effects), controller=Telling(), simulation=run)
"""


@pytest.mark.slow
def test_ctrl_c_on_the_command_line_writes_what_there_is(tmp_path):
    scene, flag, out = tmp_path / "scene.py", tmp_path / "begun", tmp_path / "out"
    scene.write_text(SCENE.format(here=str(HERE), flag=str(flag)))
    begin = f"import sys; sys.path.insert(0, {str(HERE)!r}); from long_running import as_child; as_child({os.getpid()})"
    code = f"{begin}; from flexctrl.cli import main; sys.exit(main(sys.argv[1:]))"
    words = [sys.executable, "-c", code, "run", str(scene), "--out", str(out)]
    child = subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    wait_for(flag)
    child.send_signal(signal.SIGINT)
    text, error = child.communicate(timeout=120)
    assert child.returncode == 1
    assert "interrupted at t = " in error
    assert "interrupted" in text
    rows = np.loadtxt(out / "run.csv", delimiter=",", skiprows=1)
    assert rows[-1, 0] >= 0.2
    assert np.isfinite(rows).all()
    assert (out / "outputs.png").stat().st_size > 5_000


# -- gone on with


@pytest.mark.slow
def test_runs_go_on_in_another_process_bit_for_bit(tmp_path):
    for name in CASES:
        half = ran(name, 0.5 * UNTIL + 0.0035, tmp_path, "parts")  # between two rows
        assert half.status is fc.Status.FINISHED
        half.checkpoint.save(tmp_path / f"{name}.checkpoint")
    printed("resume", tmp_path, UNTIL)
    for name in CASES:
        once = ran(name, UNTIL, tmp_path, "once")
        with np.load(tmp_path / f"{name}.npz") as found:
            for part, value in ends(once).items():
                assert np.array_equal(found[part], value), (name, part)
        parts, whole = ((tmp_path / f"{name}_{label}.csv").read_bytes() for label in ("parts", "once"))
        assert parts == whole, name


@pytest.mark.slow
def test_a_killed_run_goes_on_from_its_autosave(tmp_path):
    child = process("forever", tmp_path)
    wait_for(tmp_path / "autosave")
    child.kill()
    child.communicate(timeout=60)
    saved = fc.load_checkpoint(tmp_path / "autosave")
    how = {"until": saved.t + 0.1234, "method": FIXED, "every": 0.01}
    stream = fc.CsvStream(tmp_path / "forever.csv", every=0.01)
    resumed = fc.simulate(arm(), Servo(), start=saved, record=stream, **how)
    once = fc.simulate(arm(), Servo(), record=fc.CsvStream(tmp_path / "once.csv", every=0.01), **how)
    for part, value in ends(once).items():
        assert np.array_equal(ends(resumed)[part], value), part
    assert (tmp_path / "forever.csv").read_bytes() == (tmp_path / "once.csv").read_bytes()


def test_a_run_that_was_stopped_at_its_end_has_one_last_row(tmp_path):
    for until in (0.05, 0.0535):  # on a row, and between two
        half = ran("marched", until, tmp_path, "parts")
        once = (tmp_path / "marched_parts.csv").read_bytes()
        whole = ran("marched", until, tmp_path, "parts", half.checkpoint)
        assert (tmp_path / "marched_parts.csv").read_bytes() == once
        assert whole.t.tolist() == half.t.tolist() == [0.0, until]
        assert np.array_equal(whole.y, half.y)


@pytest.mark.parametrize("name", ["marched", "sampled", "adaptive", "exact", "exact_sampled", "exact_continuous"])
def test_books_do_not_depend_on_where_a_run_was_stopped(name, tmp_path):
    once, way = ran(name, 0.4, tmp_path, "once"), None
    for until in (0.0013, 0.0457, 0.0999, 0.3, 0.4):
        stopped = ran(name, until, tmp_path, "parts", way)
        way = stopped.checkpoint
    assert stopped.report.energy == once.report.energy
    assert stopped.report.energy_residual == once.report.energy_residual > 0.0
    assert stopped.report.closure_error == once.report.closure_error


@pytest.mark.parametrize("name", ["marched", "sampled", "adaptive", "exact", "exact_sampled"])
def test_the_clock_on_the_wall_has_no_say(name, tmp_path, monkeypatch):
    """How long compiled rides go on at a time is its business; where they end, nothing changes."""
    runs = []
    for seconds in (1e-9, 3e-4, 10.0):
        monkeypatch.setattr(ride, "_SECONDS", seconds)
        runs.append(ran(name, 0.2, tmp_path, f"{seconds:g}"))
    rows = {(tmp_path / f"{name}_{seconds}.csv").read_bytes() for seconds in ("1e-09", "0.0003", "10")}
    assert len(rows) == 1
    for run in runs[1:]:
        assert all(np.array_equal(value, ends(run)[part]) for part, value in ends(runs[0]).items())
        assert run.report.energy == runs[0].report.energy


def _saving(name: str, until: float, folder: Path, seconds: float, monkeypatch) -> list[fc.Checkpoint]:
    """What a case saves on its way."""
    found, put = [], fc.Checkpoint.put
    monkeypatch.setattr(fc.Checkpoint, "put", lambda self, path: found.append(self) or put(self, path))
    model, controller, method, inputs = CASES[name]
    how = {"until": until, "method": method, "inputs": inputs, "autosave": fc.Autosave(folder / "autosave", seconds)}
    fc.simulate(model(), controller() if controller else None, **how)
    monkeypatch.undo()
    return found


@pytest.mark.parametrize("name", [name for name in CASES if name != "explicit"])
def test_a_run_saves_as_often_as_it_is_asked_to_however_short_it_is(name, tmp_path, monkeypatch):
    """Runs of milliseconds, open and closed loops, in plain steps and in compiled ones, save and go on from there."""
    saved = _saving(name, 0.05, tmp_path, 1e-9, monkeypatch)
    assert saved
    assert 0.0 < saved[0].t <= saved[-1].t < 0.0501
    if name in ("plain", "sampled_plain", "midpoint"):
        assert len(saved) == 50  # each step
    model, controller, method, inputs = CASES[name]
    law = controller() if controller else None
    once = fc.simulate(model(), law, until=0.1, method=method, inputs=inputs)
    last = fc.load_checkpoint(tmp_path / "autosave")
    assert last.t == saved[-1].t
    for start in (saved[0], last):
        rest = fc.simulate(model(), law, until=0.1, method=method, start=start)
        assert all(np.array_equal(value, ends(rest)[part]) for part, value in ends(once).items())


def test_a_run_that_ends_before_its_first_save_writes_none(tmp_path, monkeypatch):
    assert not _saving("marched", 0.05, tmp_path, 600.0, monkeypatch)


def test_a_stream_of_something_else_is_not_gone_on_with(tmp_path):
    half = ran("marched", 0.05, tmp_path, "parts")
    (tmp_path / "marched_parts.csv").write_text("t,other\n0.0,1.0\n")
    with pytest.raises(fc.errors.StructureError, match="expected 6 rows of t,angle"):
        ran("marched", 0.1, tmp_path, "parts", half.checkpoint)


# -- memory


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["streamed", "decimated"])
def test_an_hour_of_closed_loop_stays_within_300_megabytes(kind, tmp_path, monkeypatch):
    """What it grows by in a second, 3600 times, on top of what it takes at most; its code is compiled on the way.

    What it takes once, as allocators do, is no growth: that goes on.
    """
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    status, *numbers, peak = printed("closed_loop", tmp_path, kind, 300.0)
    assert status == "FINISHED"
    times, taken = np.array(numbers, dtype=float).reshape(3, 2).T
    growth = min(np.diff(taken) / np.diff(times))
    assert float(peak) + 3600.0 * max(growth, 0.0) < 300.0


@pytest.mark.slow
def test_a_minute_with_all_its_states_stays_within_300_megabytes_too(tmp_path):
    """States done again for the runs laid beside it took ten times the room of what they are made from: 500 MB."""
    status, rides, peak = printed("minute", tmp_path)
    assert status == "FINISHED"
    assert int(rides) > 5
    assert float(peak) < 300.0


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["mesh", "chain", "hinged", "tree", "net"])
def test_ten_thousand_elements_stay_within_a_gigabyte(kind, tmp_path):
    """Hinged beams asked for 27 GB, a full matrix, and trees took 1.5 GB, a band as wide as their branches are many.

    Meshes took 2.5 GB, all freedoms for each line that may ring, and nets 1.2 GB, what factors of masses fill in.
    """
    status, steps, peak = printed(kind, tmp_path, 10_000)
    assert (status, steps) == ("FINISHED", "20")
    assert float(peak) < 1000.0
