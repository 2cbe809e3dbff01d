"""The commands: what they print, what they write, how they end."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from functools import partial

import numpy as np
import pytest
from matplotlib.figure import Figure
from scenes import EXAMPLES, TROLLEY

import flexctrl
from flexctrl.cli import main
from flexctrl.cli.answer import plain
from flexctrl.cli.program import COMMANDS
from flexctrl.scene import load_scene

REPORT = {"scene", "status", "steps", "rejected_steps", "newton_iterations", "wall_s", "dofs", "energy_residual"}


@pytest.fixture
def scene(tmp_path):
    path = tmp_path / "trolley.toml"
    path.write_text(TROLLEY, encoding="utf-8")
    return path


@pytest.fixture
def call(capsys):
    def run(*arguments: object) -> tuple[int, str, str]:
        code = main([str(a) for a in arguments])
        out, err = capsys.readouterr()
        return code, out, err

    return run


@pytest.fixture
def told(call, scene):
    def run(command: str, *arguments: object) -> dict:
        code, out, err = call(command, scene, "--json", *arguments)
        assert (code, [line for line in err.splitlines() if " % done" not in line]) == (0, [])
        return json.loads(out, parse_constant=lambda word: pytest.fail(f"{word} in JSON"))

    return run


# -- what programs read


def test_run_reports_the_machine_and_its_twin(told):
    data = told("run")
    assert set(data) >= REPORT
    assert data["status"] == "finished"
    assert data["scene"] == "trolley"
    assert data["end_s"] == pytest.approx(0.2)
    for side in (data, data["rigid"]):
        assert set(side["outputs"]) == {"travel", "load_z", "sway", "angle", "speed"}
        assert all(set(numbers) == {"final", "max_abs", "rms"} for numbers in side["outputs"].values())
    assert data["rigid"]["dofs"] < data["dofs"]
    # The rigid twin's motor turns with the trolley: ratio/radius = 100 rad/m.
    rigid = data["rigid"]["outputs"]
    assert rigid["angle"]["final"] == pytest.approx(100.0 * rigid["travel"]["final"], rel=1e-9)
    assert data["outputs"]["angle"]["final"] != pytest.approx(100.0 * data["outputs"]["travel"]["final"], rel=1e-6)


def test_run_without_a_twin_says_nothing_of_one(call, scene):
    scene.write_text(TROLLEY.replace("rigid_twin = true", "rigid_twin = false"), encoding="utf-8")
    assert "rigid" not in json.loads(call("run", scene, "--json")[1])


def test_modes_are_those_of_a_trolley_with_a_pendulum(told):
    data = told("modes", "--count", 4)
    assert set(data["equilibrium"]) == {"residual", "outputs"}
    assert data["equilibrium"]["residual"] < 1e-9
    assert data["rigid_body_modes"] == 1
    assert len(data["frequencies_hz"]) == len(data["damping"]) == len(data["parts"]) == 4
    # Motor 10 kg on the rail, so M = 20 kg: ω² = (M + m) g / (M l), the rope stretched by m g l / EA.
    swing = np.sqrt((20.0 + 5.0) * 9.81 / (20.0 * (2.0 + 5.0 * 9.81 * 2.0 / 2e5))) / (2 * np.pi)
    bounce = np.sqrt(2e5 / 2.0 / 5.0) / (2 * np.pi)
    assert data["frequencies_hz"][1] == pytest.approx(swing, rel=1e-3)
    assert min(abs(f - bounce) for f in data["frequencies_hz"]) < 1e-3 * bounce
    assert (
        data["parts"][data["frequencies_hz"].index(min(data["frequencies_hz"], key=lambda f: abs(f - bounce)))]
        == "rope"
    )


def test_table_holds_the_join_table_and_the_audit(told):
    data = told("table")
    assert data["join_table"]["rows"][0] == [1, 0, 0, 0, 0, 0]
    assert data["dofs"] == 1 + 2 + 1
    assert data["audit"]["dynamic"] == ["trolley_0_u", "rope_1_u", "rope_1_w", "travel_drive_source"]
    assert [e["name"] for e in data["elements"]] == ["trolley", "rope", "load"]
    assert data["notes"] == ["made up"]


def test_the_table_tells_freedoms_that_effects_add(call, tmp_path):
    """Ropes with mass have nodes of their own, which are not the structure's."""
    text = TROLLEY.replace("EA = 2e5 }", "EA = 2e5, rhoA = 1.0, elements = 3 }")
    text = text.replace("gravity = true", "gravity = true\nrope_mass = true")
    (tmp_path / "heavy.toml").write_text(text, encoding="utf-8")
    code, out, _ = call("table", tmp_path / "heavy.toml")
    assert code == 0
    assert "trolley: 4 degrees of freedom in the join table, 10 under the scene's effects" in out
    assert [line.split()[-2:] for line in out.splitlines() if line.startswith("rope ")] == [["2", "2"]]  # m, kg


def test_the_table_tells_the_mass_that_is_in_the_model(call, tmp_path):
    """The masses of all elements are those that move with the machine, whether ropes have theirs or not."""
    text = TROLLEY.replace("EA = 2e5 }", "EA = 2e5, rhoA = 1.0 }")
    note = "note: mass of rope rope, 2 kg, is left out: no effect rope_mass gives it any"
    for effects, said in (("", True), ("rope_mass = true\n", False)):
        path = tmp_path / "heavy.toml"
        path.write_text(text.replace("[effects]\n", f"[effects]\n{effects}"), encoding="utf-8")
        code, out, _ = call("table", path)
        assert (code, note in out) == (0, said)
        _, data, _ = call("table", path, "--json")
        model = load_scene(path).model
        sideways = np.array([name.endswith("_u") for name in model.coordinates], dtype=float)
        moving = sideways @ model.mass() @ sideways
        assert sum(e["mass"] for e in json.loads(data)["elements"]) == pytest.approx(moving)


def test_labels_are_in_the_units_that_the_scene_names(call, tmp_path, monkeypatch):
    """The numbers are as they stand in the file."""
    path = tmp_path / "named.toml"
    path.write_text(TROLLEY + '\n[units]\nlength = "mm"\nmass = "t"\n', encoding="utf-8")
    said: list[str] = []
    monkeypatch.setattr(Figure, "savefig", lambda figure, *_, **__: said.extend(_labels(figure)))
    plain_text, out = (call("table", p, "--out", tmp_path)[1] for p in (_trolley(tmp_path), path))
    assert "length (m)  mass (kg)" in plain_text
    assert "length (mm)  mass (t)" in out
    assert [line.split() for line in out.splitlines() if line.startswith("rope ")] == [
        line.split() for line in plain_text.splitlines() if line.startswith("rope ")
    ]
    assert said[-2:] == ["x (mm)", "z (mm)"]
    call("run", path, "--out", tmp_path)
    assert {"travel (mm)", "sway (rad)", "torque (N mm)", "push (N)"} <= set(said)


def _trolley(folder):
    path = folder / "trolley.toml"
    path.write_text(TROLLEY, encoding="utf-8")
    return path


def _labels(figure):
    return [label for ax in figure.axes for label in (ax.get_xlabel(), ax.get_ylabel())]


def test_bode_gives_margins_and_poles_of_both(told):
    data = told("bode")
    assert (data["input"], data["output"]) == ("torque", "travel")
    for side in (data["flexible"], data["rigid"]):
        assert side["responds"]
        assert side["margins"]["stable"]
        assert all(len(pole) == 2 for pole in side["poles"])
    # The trolley's rigid twin is a double integrator with a pendulum.
    poles = np.array(data["rigid"]["poles"])
    assert np.sort(np.hypot(*poles.T)) == pytest.approx([0, 0, *[np.sqrt(25 * 9.81 / 40)] * 2], abs=1e-6)


def test_rlocus_finds_where_the_flexible_loop_turns_unstable(told):
    data = told("rlocus")
    assert data["controlled"]
    assert data["sample_time"] == 0.01
    gains = {side: [c["gain"] for c in data[side]["critical_gains"]] for side in ("flexible", "rigid")}
    up = data["flexible"]["margins"]["gain"]
    assert any(g == pytest.approx(up, rel=1e-4) for g in gains["flexible"])
    assert min(g for g in gains["flexible"] if g > 1) < min(g for g in gains["rigid"] if g > 1)
    assert data["flexible"]["stable"]


@pytest.mark.parametrize("share", [1.0, 0.02, 1e-4])
def test_bode_and_rlocus_tell_the_same_critical_gains(call, scene, share):
    """Of the machine and of its twin, however weak the controller: a share of it has as many times the margin."""
    gains = {"kp": 0.2 * share, "kd": 0.05 * share}
    text = TROLLEY.replace("kp = 0.2", f"kp = {gains['kp']}").replace("kd = 0.05", f"kd = {gains['kd']}")
    scene.write_text(text, encoding="utf-8")
    bode, rlocus = (json.loads(call(command, scene, "--json")[1]) for command in ("bode", "rlocus"))
    for side in ("flexible", "rigid"):
        margin = bode[side]["margins"]["gain"]
        lost = [c["gain"] for c in rlocus[side]["critical_gains"] if c["unstable_above"] and c["gain"] > 1.0]
        assert min(lost) == pytest.approx(margin, rel=1e-9)
        assert margin * share == pytest.approx({"flexible": 7.0921, "rigid": 7.9999}[side], rel=1e-4)


def test_signals_of_the_loop_can_be_chosen(told):
    data = told("bode", "--input", "push", "--output", "load_z")
    assert data["input"] == "push"
    assert not data["rigid"]["responds"]  # a push along x does not lift the load of the straight rigid rope


def test_compare_holds_both_and_their_difference(told):
    data = told("compare")
    assert data["status"] == data["rigid_status"] == "finished"
    travel = data["signals"]["travel"]
    assert set(travel) >= {"flexible", "rigid", "max_difference", "rms_difference", "frequency_hz"}
    assert 0 < travel["rms_difference"] <= travel["max_difference"]
    assert 0 < travel["rms_difference_known"] < travel["rms_difference"]


# -- what is written


@pytest.mark.parametrize(
    ("command", "files"),
    [
        ("table", {"join_table.csv", "table.json", "machine.png"}),
        ("run", {"run.json", "run.csv", "rigid.csv", "outputs.png", "inputs.png", "final.png"}),
        ("modes", {"modes.csv", "modes.json", "modes.png"}),
        ("bode", {"bode.json", "bode_flexible.csv", "bode_rigid.csv", "loop_flexible.csv", "bode.png", "loop.png"}),
        ("rlocus", {"rlocus.json", "rlocus_flexible.csv", "rlocus_rigid.csv", "rlocus.png"}),
        ("compare", {"compare.json", "compare.csv", "outputs.png"}),
    ],
)
def test_out_holds_pictures_and_data(call, scene, tmp_path, command, files):
    out = tmp_path / "deep" / "out"
    code, text, err = call(command, scene, "--out", out)
    assert (code, [line for line in err.splitlines() if " % done" not in line]) == (0, [])
    assert text.strip()
    assert {p.name for p in out.iterdir()} >= files
    for picture in out.glob("*.png"):
        assert picture.read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"
    for table in out.glob("*.csv"):
        rows = table.read_text(encoding="utf-8").splitlines()
        assert len({row.count(",") for row in rows}) == 1
        assert "nan" not in "".join(rows[1:])


PLANAR = """
planar = "y"
[sections]
tube = { shape = "circular", material = "steel", radius = 0.01 }
[elements]
mast = { kind = "beam", start = [0, 0, 0], end = [0, 0, 1], section = "tube" }
[[joints]]
kind = "support"
node = "mast.start"
held = "u w ry"
[effects]
flexible = true
"""


@pytest.mark.parametrize("command", ["table", "modes", "report"])
@pytest.mark.parametrize("text", [PLANAR, 'planar = "y"\n' + TROLLEY], ids=["mast", "trolley"])
def test_planar_machines_are_drawn(call, tmp_path, text, command):
    if command == "report":
        text = text.split("[simulation]")[0]  # what it says of runs takes long
    (tmp_path / "flat.toml").write_text(text, encoding="utf-8")
    code, _, err = call(command, tmp_path / "flat.toml", "--out", tmp_path)
    assert (code, [line for line in err.splitlines() if " % done" not in line]) == (0, [])
    assert [*tmp_path.glob("*.png"), *tmp_path.glob("*.html")]


def test_notes_stand_below_a_run_and_in_its_data(call, scene, told):
    for command in ("run", "compare"):
        _, text, _ = call(command, scene)
        notes = told(command)["notes"]
        assert notes[0] == "made up"
        assert "\n".join(f"note: {note}" for note in notes) in text


def test_written_curves_are_the_run(call, scene, tmp_path):
    _, out, _ = call("run", scene, "--json", "--out", tmp_path)
    curves = np.genfromtxt(tmp_path / "run.csv", delimiter=",", names=True)
    data = json.loads(out)
    assert curves["t"][-1] == data["end_s"]
    assert curves["travel"][-1] == data["outputs"]["travel"]["final"]
    assert np.abs(curves["sway"]).max() == data["outputs"]["sway"]["max_abs"]
    assert json.loads((tmp_path / "run.json").read_text(encoding="utf-8")) == data


# -- how it ends


def test_bad_input_ends_with_2_and_the_message_on_the_error_stream(call, scene):
    scene.write_text(TROLLEY.replace("mass = 5.0", "weight = 5.0"), encoding="utf-8")
    for command in COMMANDS:
        code, out, err = call(command, scene)
        assert (code, out) == (2, "")
        assert err.startswith(f"flexctrl: {scene}: [elements.load] weight: unknown key")
        assert "Traceback" not in err


@pytest.mark.parametrize("command", ["modes", "bode", "rlocus"])
def test_what_linear_models_leave_out_of_the_controller_is_said(call, scene, command):
    hardware = "[hardware]\nnoise = { angle = 1e-4 }\nsteps = { angle = 1e-3, torque = 1e-2 }"
    scene.write_text(TROLLEY.replace("[hardware]", hardware), encoding="utf-8")
    notes = call(command, scene)[1].split("note: ")[1:]
    alone = "the machine is shown by itself, without the scene's controller"
    law = [
        "limits of torque act in simulations only",
        "rounding of angle, torque acts in simulations only",
        "noise of angle acts in simulations only",
    ]
    assert [n.rstrip() for n in notes if not n.startswith("rigid twin: ")] == ([alone] if command == "modes" else law)
    if command != "modes":
        assert alone in call(command, scene, "--input", "push", "--output", "travel")[1]


@pytest.mark.parametrize("command", ["modes", "bode", "rlocus"])
def test_what_linear_models_leave_out_is_said_where_they_are_shown(call, scene, command):
    """Dry friction, and play that no load presses to a flank, are in the simulation alone."""
    plain = call(command, scene)[1]
    assert "friction" not in plain
    assert "play" not in plain
    loose = TROLLEY.replace(
        "[effects]", "[effects]\ncoulomb_friction = { travel_drive = 0.1 }\nbacklash = { travel_drive = 0.1 }"
    )
    scene.write_text(loose, encoding="utf-8")
    out = call(command, scene)[1]
    assert "note: dry friction at travel_drive acts in simulations only" in out
    assert "note: the play of travel_drive is open at rest" in out


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("bode", "--input", "torq"), "the machine has no input 'torq'; did you mean 'torque'?"),
        (("bode", "--output", "trvel"), "the machine has no output 'trvel'; did you mean 'travel'?"),
        (("modes", "--count", "0"), "ask for at least one mode"),
    ],
)
def test_bad_options_are_bad_input(call, scene, arguments, said):
    command, *options = arguments
    code, out, err = call(command, scene, *options)
    assert (code, out) == (2, "")
    assert said in err


def test_a_directory_that_cannot_be_made_is_bad_input(call, scene):
    code, _, err = call("table", scene, "--out", scene / "below")
    assert code == 2
    assert "flexctrl:" in err


def test_no_equilibrium_is_a_failed_run(call, scene):
    scene.write_text(TROLLEY + "\n[equilibrium]\ninputs = { push = 2.0 }\n", encoding="utf-8")
    code, out, err = call("modes", scene)
    assert (code, out) == (1, "")
    assert err.startswith(f"flexctrl: {scene}: no equilibrium found")
    assert "[equilibrium] hold = " in err


INTERRUPTED = """
import flexctrl as fc
from flexctrl.cranes import ceiling_crane

class Impatient:
    inputs, outputs, sample_time = ("travel",), ("push",), 1e-3

    def initial(self):
        return ()

    def command(self, t, x, y):
        if t > 4.5e-3:
            raise KeyboardInterrupt
        return [500.0]

scene = fc.Scene(
    ceiling_crane(),
    controller=Impatient(),
    simulation=fc.Simulation(until=0.02, method=fc.GeneralizedAlpha(5e-4), every=1e-3, rigid_twin=True),
)
"""


@pytest.mark.parametrize("command", ["run", "compare"])
def test_ctrl_c_keeps_what_was_computed(call, tmp_path, command):
    path = tmp_path / "impatient.py"
    path.write_text(INTERRUPTED, encoding="utf-8")
    code, out, err = call(command, path, "--json", "--out", tmp_path)
    data = json.loads(out)
    assert code == 1
    assert "interrupted" in err
    assert data["status"] == "interrupted"
    assert 4e-3 <= data["end_s"] <= 6e-3
    assert "rigid" not in data
    if command == "run":
        assert len((tmp_path / "run.csv").read_text(encoding="utf-8").splitlines()) >= 5


def test_help_has_an_example_of_every_command(capsys):
    for command in COMMANDS:
        with pytest.raises(SystemExit) as end:
            main([command, "--help"])
        assert end.value.code == 0
        assert f"example: flexctrl {command} examples/" in " ".join(capsys.readouterr().out.split())


def test_version_and_wrong_command(capsys):
    with pytest.raises(SystemExit) as end:
        main(["--version"])
    assert end.value.code == 0
    assert capsys.readouterr().out == f"flexctrl {flexctrl.__version__}\n"
    with pytest.raises(SystemExit) as end:
        main(["walk", "scene.toml"])
    assert end.value.code == 2


def test_starting_up_imports_nothing_heavy():
    code = "import sys, flexctrl.cli; print(sorted({'numpy', 'casadi', 'control', 'matplotlib'} & set(sys.modules)))"
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=environment, check=True)
    assert done.stdout.strip() == "[]"


def test_json_knows_no_nan_and_no_numpy():
    strange = {"a": np.float64(np.nan), "b": np.array([1.0, np.inf]), "c": 1 + 2j, "d": np.int64(3), "e": (np.True_,)}
    assert plain(strange) == {"a": None, "b": [1.0, None], "c": [1.0, 2.0], "d": 3, "e": [True]}
    json.dumps(plain(strange), allow_nan=False)


def test_progress_is_shown_on_a_terminal_and_wiped_away(monkeypatch, capsys):
    from flexctrl.cli.progress import progress

    with progress("crane") as tell:
        tell(0.25)
    assert capsys.readouterr().err == ""  # the error stream of a test is no terminal, and it took no time
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True, raising=False)
    with progress("crane") as tell:
        tell(0.25)
    shown = capsys.readouterr().err
    assert "crane" in shown
    assert "25 %" in shown
    assert shown.endswith("\r\033[K")


@pytest.mark.parametrize(
    ("typed", "meant"),
    [
        (["ledgr", "x.toml"], "did you mean 'ledger'?"),
        (["cost", "x.toml", "--tolerence", "0.1"], "did you mean '--tolerance'?"),
    ],
)
def test_a_slip_of_the_pen_is_asked_about(typed, meant, capsys):
    with pytest.raises(SystemExit) as stopped:
        main(typed)
    assert stopped.value.code == 2
    assert meant in capsys.readouterr().err


def test_a_reader_that_leaves_early_is_no_error(scene):
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    command = [sys.executable, "-m", "flexctrl", "table", str(scene)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, env=environment) as process:
        process.stdout.close()
        assert process.stderr.read() == b""
    assert process.returncode == 0


@pytest.mark.slow
@pytest.mark.parametrize("command", ["table", "bode", "rlocus"])
@pytest.mark.parametrize("name", ["ceiling_crane", "bridge_crane", "flexible_arm"])
def test_shipped_scenes_answer(call, command, name, tmp_path):
    code, out, err = call(command, EXAMPLES / f"{name}.toml", "--json", "--out", tmp_path)
    assert (code, err) == (0, "")
    assert [*tmp_path.glob("*.png")]
    data = json.loads(out, parse_constant=lambda word: pytest.fail(f"{word} in JSON"))
    assert data["scene"] == name
    if command == "table":
        assert data["dofs"] == {"ceiling_crane": 65, "bridge_crane": 30, "flexible_arm": 40}[name]
    elif name != "ceiling_crane":  # the machines with a controller are stable under it, flexible and rigid
        for side in (data["flexible"], data["rigid"]):
            assert max(re for re, _ in side["closed_loop_poles"]) < 0.0
            assert side["margins"]["stable"]


@pytest.mark.slow
def test_ledger_tells_what_each_effect_changes(told, tmp_path):
    data = told("ledger", "--tolerance", "0.02", "--out", tmp_path)
    assert {"effects", "minimal_set"} <= set(data)
    for entry in data["effects"]:
        assert {"name", "output_change", "cost_ratio", "keep"} <= set(entry)
    assert data["minimal_set"] == [e["name"] for e in data["effects"] if e["keep"]]
    assert data["minimal"]["output_change"] <= 0.02
    assert json.loads((tmp_path / "ledger.json").read_text())["minimal_set"] == data["minimal_set"]
    assert (tmp_path / "ledger.png").stat().st_size > 10_000


@pytest.mark.parametrize("command", ["bode", "rlocus", "modes"])
def test_what_is_told_of_the_linear_machine_is_of_all_effects(call, scene, command):
    """A choice of effects for runs does not touch margins, loci and modes."""
    chosen = scene.with_name("chosen.toml")
    chosen.write_text(TROLLEY.replace("[effects]", "[effects]\nautomatic = { tolerance = 0.5 }"), encoding="utf-8")
    whole, automatic = (json.loads(call(command, path, "--json")[1]) for path in (scene, chosen))
    assert automatic == whole


@pytest.mark.slow
def test_cost_tells_the_cheapest_setting(told, tmp_path):
    data = told("cost", "--tolerance", "0.05", "--out", tmp_path)
    assert {"points", "chosen"} <= set(data)
    for point in data["points"]:
        assert {"setting", "error", "time_ratio", "pareto"} <= set(point)
    assert data["chosen"] in [p["setting"] for p in data["points"]]
    assert (tmp_path / "cost.png").stat().st_size > 10_000
    kept = [json.loads(line) for line in (tmp_path / "cost.jsonl").read_text().splitlines()]
    assert len({line["key"][1] for line in kept if line["key"][0] == "point"}) == len(data["points"])


@pytest.mark.slow
@pytest.mark.parametrize("asked", [signal.SIGTERM, signal.SIGINT])
def test_a_cost_that_is_ended_leaves_nothing_running_and_goes_on(scene, tmp_path, asked):
    """Its processes end with it, or its streams would stay open; what was run is kept, and the last line says so."""
    pytest.importorskip("joblib")
    scene.write_text(TROLLEY.replace("until = 0.2", "until = 20.0"), encoding="utf-8")
    command = [sys.executable, "-m", "flexctrl", "cost", str(scene), "--out", str(tmp_path), "--workers", "2"]
    environment = os.environ | {"PYTHONPATH": str(EXAMPLES.parent)}
    heard = partial(signal.signal, signal.SIGINT, signal.SIG_DFL)  # ignored where tests run in the background
    child = subprocess.Popen(command, stdout=-1, stderr=-1, env=environment, text=True, preexec_fn=heard)
    store = tmp_path / "cost.jsonl"
    while not store.exists() or len(store.read_text(encoding="utf-8").splitlines()) < 5:
        assert child.poll() is None
        time.sleep(0.05)
    child.send_signal(asked)
    out, err = child.communicate(timeout=60)
    assert child.returncode == 1
    assert "stopped before a setting was chosen" in out
    lines = [line for line in err.splitlines() if " % done" not in line]
    assert len(lines) == 1
    assert lines[0].startswith("flexctrl: interrupted: errors of ")
    assert f"kept in {store}; the same command goes on from there" in lines[0]
    kept = [json.loads(line)["key"][0] for line in store.read_text(encoding="utf-8").splitlines()]
    assert kept.count("run") == 4
    assert "point" in kept


def test_a_cost_that_is_ended_at_once_has_kept_nothing_and_says_so(scene, tmp_path, call, monkeypatch):
    """Stopped in the first run of the reference: the file has no line to go on from."""

    def stopped(*anything):
        raise KeyboardInterrupt

    monkeypatch.setattr("flexctrl.study.work_precision.trace", stopped)
    for out, said in ((("--out", tmp_path), "nothing is kept yet"), ((), "runs so far are lost; --out DIR keeps them")):
        code, _, err = call("cost", scene, *out)
        assert code == 1
        assert err == f"flexctrl: interrupted: no reference was found yet; {said}\n"
    assert not (tmp_path / "cost.jsonl").read_text(encoding="utf-8")


@pytest.mark.parametrize("scene", ["flexible_arm", "bridge_crane"])
def test_the_bode_plot_holds_the_resonance_that_is_told(scene, tmp_path, call):
    code, out, _ = call("bode", EXAMPLES / f"{scene}.toml", "--out", tmp_path, "--json")
    peak, table = (
        json.loads(out)["flexible"]["resonance"],
        np.loadtxt(tmp_path / "bode_flexible.csv", delimiter=",", skiprows=1),
    )
    assert code == 0
    assert table[0, 1] < peak["hz"] < table[-1, 1]
    beside = np.abs(table[:, 1] / peak["hz"] - 1.0) < 0.01
    assert table[beside, 2].max() == pytest.approx(peak["magnitude"], rel=0.01)
