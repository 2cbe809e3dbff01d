"""The report: one page that needs nothing else, clicked through in a browser."""

from __future__ import annotations

import json
import re
import shutil
import tomllib
from pathlib import Path

import numpy as np
import pytest
from scenes import TROLLEY

import flexctrl as fc
from flexctrl.cli import main
from flexctrl.cli.answer import Answer
from flexctrl.cli.health import health
from flexctrl.errors import FlexctrlError
from flexctrl.report.modes import animation
from flexctrl.report.page import Section, page
from flexctrl.scene.files import scene_from
from flexctrl.scene.reading import Place

CHROMIUM, DRIVER = shutil.which("chromium"), shutil.which("chromedriver")


@pytest.fixture(scope="module")
def report(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("report")
    short = TROLLEY.replace("until = 0.2", "until = 0.05").replace("step = 2e-3", "step = 5e-3")
    (folder / "trolley.toml").write_text(short, encoding="utf-8")
    assert main(["report", str(folder / "trolley.toml"), "--out", str(folder), "--tolerance", "0.1"]) == 0
    return folder / "trolley.html"


def test_text_is_escaped_and_data_cannot_end_the_script():
    made = page("a < b", "", [Section("one", "x & y", "<b>")], {"modes": "</script>"})
    assert "a &lt; b" in made
    assert "x &amp; y" in made
    assert "&lt;b&gt;" in made
    assert '"</script>' not in made


def test_the_animation_is_the_mode_shape():
    scene = scene_from(tomllib.loads(TROLLEY), Place("trolley.toml"), "trolley")
    modes = scene.linear.modes()
    found = animation(modes)
    assert len(found["modes"]) == len(modes)
    assert len(found["rest"]) == len(scene.structure.nodes)
    assert {n for line in found["lines"] for n in line} == set(range(len(found["rest"])))
    pendulum = next(m for m, kind in zip(found["modes"], modes.kinds, strict=True) if kind == "flexible")
    moved = dict(zip([str(n) for n in scene.structure.nodes], pendulum["moved"], strict=True))
    assert abs(moved["node 0 of load"][0]) > 10 * abs(moved["node 0 of load"][2])


def test_the_animation_is_of_the_machine_with_the_nodes_that_effects_give_it():
    """A heavy rope of five pieces hangs straight down from a beam's tip: all is where it was drawn."""
    tube = fc.Section.tube(fc.STEEL, 0.08, 0.005)
    jib = fc.Beam("jib", (0, 0, 4), (2, 0, 4), tube, elements=2)
    rope = fc.Rope("rope", (2, 0, 4), (2, 0, 1), EA=1e6, rhoA=1.5, elements=5)
    load = fc.PointMass("load", (2, 0, 1), 50.0)
    joints = [fc.Support(jib.start, "u v w rx ry rz"), fc.Pin(jib.end, rope.start), fc.Pin(rope.end, load.node)]
    structure = fc.Structure([jib, rope, load], joints)
    model = fc.assemble(structure, [fc.Gravity(), fc.Flexible(), fc.RopeMass(), fc.LargeRotation()])
    assert len(model.structure.nodes) > len(structure.nodes)
    found = animation(fc.linearize(model, at=fc.equilibrium(model)).modes())
    rest = np.array(found["rest"])
    curves = [rest[line] for line in found["lines"]]
    hanging = [c for c in curves if np.ptp(c[:, 2]) > 0.5]
    lying = [c for c in curves if np.ptp(c[:, 0]) > 0.5]
    assert len(hanging) == 5
    assert len(lying) == 1
    for kept, length in ((hanging, 3.0), (lying, 2.0)):
        along = sum(np.linalg.norm(np.diff(c, axis=0), axis=1).sum() for c in kept)
        assert along == pytest.approx(length, abs=0.01)
    ends = np.vstack(hanging)
    assert ends[:, 0] == pytest.approx(2.0, abs=0.01)
    assert (ends[:, 2].min(), ends[:, 2].max()) == pytest.approx((1.0, 4.0), abs=0.05)  # the jib sinks by 2 cm
    assert any(len(c) == 1 and c[0] == pytest.approx((2.0, 0.0, 1.0), abs=0.05) for c in curves)  # the load
    for mode in found["modes"]:
        assert np.abs(mode["moved"]).max() < 0.2 * structure.size


def test_ctrl_c_ends_the_report_and_not_the_chapter_alone(tmp_path, monkeypatch, capsys):
    """A study that was stopped has an answer of its own; the chapters after it are not asked for."""
    (tmp_path / "trolley.toml").write_text(TROLLEY, encoding="utf-8")
    asked = []

    def stopped(request):
        asked.append(request)
        return Answer("", {}, "interrupted", interrupted=True)

    for command in ("table", "modes", "bode"):
        monkeypatch.setattr(f"flexctrl.cli.{command}.answer", stopped)
    assert main(["report", str(tmp_path / "trolley.toml"), "--out", str(tmp_path)]) == 1
    assert capsys.readouterr().err == "flexctrl: interrupted\n"
    assert len(asked) == 1
    assert not (tmp_path / "trolley.html").exists()


@pytest.mark.parametrize("raises", [True, False])
def test_a_report_that_is_stopped_has_the_chapters_until_then(tmp_path, monkeypatch, capsys, raises):
    """All that had been found was lost: the folder stayed empty."""
    (tmp_path / "trolley.toml").write_text(TROLLEY, encoding="utf-8")

    def stopped(request):
        if raises:
            raise KeyboardInterrupt
        return Answer("", {}, "interrupted: 3 settings", interrupted=True)

    monkeypatch.setattr("flexctrl.cli.bode.answer", stopped)
    assert main(["report", str(tmp_path / "trolley.toml"), "--out", str(tmp_path)]) == 1
    said = capsys.readouterr().err
    assert re.search(r"flexctrl: interrupted: .*trolley.html has what there was, without Bode, Root locus, .*Acc", said)
    assert "no answer for" not in said
    page = (tmp_path / "trolley.html").read_text(encoding="utf-8")
    assert "degrees of freedom" in page
    assert "stopped before it had an answer" in page
    assert 'id="modes"' in page
    assert 'id="rlocus"' not in page


def test_the_health_of_a_report_tells_the_certificates_of_both_linear_models():
    scene = scene_from(tomllib.loads(TROLLEY), Place("trolley.toml"), "trolley")
    lines = health(scene, "", {}).splitlines()
    cells = {re.split(r"  +", line)[0]: re.split(r"  +", line)[1:3] for line in lines}
    found = [scene.linear.certificate, scene.twin_linear.certificate]
    for said, numbers in {
        "condition of M": [c.condition_mass for c in found],
        "condition of K": [c.condition_stiffness for c in found],
        "Taylor slope of the forces": [c.taylor_slope for c in found],
        "asymmetry of K": [c.asymmetry for c in found],
    }.items():
        assert [float(cell) for cell in cells[said]] == pytest.approx(numbers, rel=0.06)
    for c in found:
        assert any("; ".join(c.rigid_modes) in line for line in lines)


def test_the_health_of_a_report_tells_why_there_is_no_linear_model():
    """A push on a trolley that nothing holds has no equilibrium."""
    pushed = tomllib.loads(TROLLEY + "\n[equilibrium]\ninputs = { push = 2.0 }\n")
    scene = scene_from(pushed, Place("trolley.toml"), "trolley")
    with pytest.raises(FlexctrlError) as why:
        _ = scene.linear
    assert health(scene, "", {}) == f"linear model: {why.value}"


def test_the_health_of_a_report_tells_how_well_references_are_known():
    """The largest disagreement of a reference counts; a study that failed says that it has none."""
    scene = scene_from(tomllib.loads(TROLLEY), Place("trolley.toml"), "trolley")
    agreement = {"a coarser mesh": 0.0, "longer steps": 2.5e-4, "another integrator": 5e-5}
    reference = {"reference": {"setting": "full", "agreement": agreement}}
    full = {"full": {"judged_steps": 10, "judged_error": 3e-3, "error": None}}
    lines = health(scene, "", {"ladder": reference, "ledger": full, "cost": {}}).splitlines()[-3:]
    assert lines[0].startswith("Fidelity: full, known to 2.5e-04; apart from a coarser mesh 0, longer steps 2.5e-04")
    assert "known to 3.0e-03; the scene's own run ended early" in lines[1]
    assert lines[2] == "Accuracy: no reference was found"


@pytest.mark.slow
def test_the_page_needs_nothing_else(report):
    text = report.read_text(encoding="utf-8")
    assert not re.search(r"""(?:src|href)\s*=\s*["'](?!data:)""", text)
    assert "url(" not in text
    assert text.count('class="lead"') == text.count("<section ")
    assert len(re.findall(r"<details>", text)) == 1
    cost = re.search(r'<section id="cost".*?<pre>(.*?)</pre>', text, re.DOTALL)[1].splitlines()
    assert "cheapest within 0.1" in cost[-1] or "no setting" in cost[-1]
    assert all(
        line.endswith("*") for line in cost[3:] if not re.match("reference|error|passed|cheapest|no setting", line)
    )
    trusted = re.search(r'<section id="run".*?<pre>(.*?)</pre>', text, re.DOTALL)[1]
    for said in ("energy residual", "Taylor slope", "condition of K", "Fidelity: full", "Effects: full", "known to"):
        assert said in trusted
    for title in (
        "Machine",
        "Modes",
        "Bode",
        "Root locus",
        "Closed loop",
        "Fidelity",
        "Effects",
        "Accuracy",
        "Numerical health",
        "Versions",
    ):
        assert f">{title}<" in text


@pytest.mark.slow
@pytest.mark.skipif(
    CHROMIUM is None or DRIVER is None, reason="no Chromium here: apt-get install chromium chromium-driver"
)
def test_a_browser_shows_every_section_without_errors(report):
    webdriver = pytest.importorskip(
        "selenium.webdriver", reason="selenium is not installed: pip install flexctrl[test]"
    )
    options = webdriver.ChromeOptions()
    options.binary_location = CHROMIUM
    for flag in ("--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage"):
        options.add_argument(flag)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    browser = webdriver.Chrome(options=options, service=webdriver.ChromeService(executable_path=DRIVER))
    try:
        browser.get(report.as_uri())
        tabs = browser.find_elements("css selector", "nav button")
        assert len(tabs) == 10
        for tab in tabs:
            tab.click()
            shown = [s for s in browser.find_elements("css selector", "main section") if s.is_displayed()]
            assert [s.get_attribute("id") for s in shown] == [tab.get_attribute("data-section")]
            assert shown[0].text.strip()
            for picture in shown[0].find_elements("css selector", "img"):
                assert browser.execute_script("return arguments[0].naturalWidth", picture) > 100
        _modes_move(browser)
        severe = [entry for entry in browser.get_log("browser") if entry["level"] == "SEVERE"]
        assert not severe, json.dumps(severe)
    finally:
        browser.quit()


def _modes_move(browser) -> None:
    """The canvas changes while it plays and stands still when it is paused."""
    pixels = "return document.getElementById('swing').toDataURL()"
    still = (
        """const done = arguments[0]; requestAnimationFrame(() => requestAnimationFrame(() => setTimeout(done, 150)))"""
    )
    browser.find_element("css selector", "[data-section=modes]").click()
    choices = browser.find_elements("css selector", "#mode option")
    choices[-1].click()
    before = browser.execute_script(pixels)
    browser.execute_async_script(still)
    assert browser.execute_script(pixels) != before
    browser.find_element("id", "play").click()
    browser.execute_async_script(still)
    paused = browser.execute_script(pixels)
    browser.execute_async_script(still)
    assert browser.execute_script(pixels) == paused
