"""Long linkages, whose levers are worked off in loops, do what short ones do, and take what their length takes."""

import itertools
import subprocess
import sys
from dataclasses import fields, replace

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.kernels.kernel import CasadiVM
from flexctrl.mechanics.rotation import orthonormal
from flexctrl.model.flat.flattening import layout_of
from flexctrl.model.linkages.levers import LONG, Levers
from flexctrl.model.linkages.linkage import Linkage
from flexctrl.model.model import Model
from flexctrl.model.state import State

SECTION = fc.Section(EA=1e5, EI_y=10, EI_z=10, GJ=8, rhoA=1, rhoJ=1e-4)
RIGID = [fc.Gravity(), fc.RopeMass(), fc.LargeRotation()]


def arm_with_chains() -> fc.Structure:
    """Every kind of lever: a driven arm with hinges about oblique axes, a slide, a rigid rope, a bar."""
    places = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (1, 1, 1)]
    base, upper, hand = (fc.Beam(f"b{i}", a, b, SECTION) for i, (a, b) in enumerate(itertools.pairwise(places)))
    slider = fc.Beam("slider", hand.end, (2, 1, 1), SECTION)
    rope = fc.Rope("rope", (1, 1, 1), (1, 2, 0), EA=1e5, rhoA=1.0, elements=5)
    bar = fc.Beam("bar", (1, 2, 0), (1, 3, 0), SECTION)
    load = fc.PointMass("load", at=bar.end, mass=2.0)
    motor = fc.RotaryDrive("motor", base.start, axis="z", stiffness=2.0, ratio=50, inertia=1e-3)
    joints = [
        fc.Support(base.start, held="u v w rx ry"),
        fc.Hinge(base.end, upper.start, axis=(1, 0, 0)),
        fc.Hinge(upper.end, hand.start, axis=(0, 0.6, 0.8)),
        fc.Slide(hand.end, slider.start, along="x"),
        fc.Pin(hand.end, rope.start),
        fc.Pin(rope.end, bar.start),
        fc.Pin(bar.end, load.node),
    ]
    return fc.Structure([base, upper, hand, slider, rope, bar, load], joints, drives=[motor])


def chain(links: int, rope: bool = False) -> Model:
    """A chain of rigid links of 10 m and 10 kg, drawn level."""
    if rope:
        line = fc.Rope("rope", (0, 0, 0), (10, 0, 0), EA=1e6, rhoA=1.0, elements=links)
        load = fc.PointMass("load", at=line.end, mass=5.0)
        parts, joints = [line, load], [fc.Support(line.start, held="u v w"), fc.Pin(line.end, load.node)]
        end = load.node
    else:
        x = np.linspace(0.0, 10.0, links + 1)
        parts = [fc.Beam(f"link{i}", (a, 0, 0), (b, 0, 0), SECTION) for i, (a, b) in enumerate(itertools.pairwise(x))]
        pins = [fc.Pin(a.end, b.start) for a, b in itertools.pairwise(parts)]
        joints, end = [fc.Support(parts[0].start, held="u v w"), *pins], parts[-1].end
    outputs = [fc.Position("x", end, "x"), fc.Position("z", end, "z")]
    return fc.assemble(fc.Structure(parts, joints, outputs=outputs), RIGID)


def with_linkage(model: Model, kind: type[Linkage]) -> Model:
    old = model.motion.linkage
    return replace(
        model, motion=replace(model.motion, linkage=kind(**{f.name: getattr(old, f.name) for f in fields(old)}))
    )


def moved(model: Model) -> tuple[State, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(3)
    state = model.advance(model.rest, rng.normal(size=model.n) * 0.3, rng.normal(size=model.n), 0.0)
    return state, rng.normal(size=model.n), rng.normal(size=model.motion.raw)


@pytest.mark.parametrize("backend", [None, CasadiVM()])
def test_every_kind_of_lever_does_what_expressions_of_the_whole_do(backend, monkeypatch):
    short = fc.assemble(arm_with_chains(), RIGID).motion
    if backend is not None:
        monkeypatch.setattr("flexctrl.model.linkages.levers.best_backend", lambda: backend)
    one = short.linkage
    other = Levers(**{f.name: getattr(one, f.name) for f in fields(one)})
    kinds = {group.kind.name for group in other.groups}
    assert kinds == {"lean", "ride", "turn", "same_turn", "slide", "shaft_RotaryDrive"}
    rng, pose = np.random.default_rng(1), short.pose(short.rest)
    for _ in range(3):
        step = 0.3 * rng.normal(size=one.free)
        there = one.placed(pose, step)
        np.testing.assert_allclose(other.placed(pose, step), there, atol=1e-13)
        pose = there.reshape(-1, 12)
        pose = np.hstack([pose[:, :3], orthonormal(pose[:, 3:].reshape(-1, 3, 3)).reshape(-1, 9)])
    v, a, force = rng.normal(size=one.free), rng.normal(size=one.free), rng.normal(size=other.raw)
    np.testing.assert_allclose(other.rates(pose, v), one.rates(pose, v), atol=1e-13)
    np.testing.assert_allclose(other.accelerations(pose, v, a), one.accelerations(pose, v, a), atol=1e-12)
    np.testing.assert_allclose(other.collect(pose, force), one.collect(pose, force), atol=1e-12)
    np.testing.assert_allclose(other.matrix_at(pose), one.matrix_at(pose), atol=1e-13)


@pytest.mark.parametrize("seeds", [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (1.0, 20.0, 400.0)])
@pytest.mark.parametrize(
    "effects", [[], [fc.BeamFlexibility(["bar"]), fc.RayleighDamping(beta=1e-3)]], ids=["rigid", "bends"]
)
def test_unfolded_slopes_are_those_of_the_degrees_of_freedom(seeds, effects):
    short = fc.assemble(arm_with_chains(), [*RIGID, *effects])
    long = with_linkage(short, Levers)
    state, a, raw = moved(short)
    one, other = (m.slope(state, state.v, a, seeds, np.zeros(0)).toarray() for m in (short, long))
    np.testing.assert_allclose(other, one, atol=1e-11 * np.abs(one).max())
    turning = short.motion.stiffening(state, raw)
    found = long.motion.stiffening(state, raw).toarray()
    np.testing.assert_allclose(found, turning, atol=1e-12 * np.abs(turning).max())


@pytest.mark.parametrize("rope", [False, True], ids=["links", "rope"])
def test_a_long_chain_falls_as_the_same_one_in_one_expression(rope):
    long = chain(LONG // 2 + 2, rope)
    assert isinstance(long.motion.linkage, Levers)
    short = with_linkage(long, Linkage)
    runs = [fc.simulate(model, until=0.4, method=fc.GeneralizedAlpha(1e-3), every=0.0125) for model in (long, short)]
    for name in ("x", "z"):  # Newton's method leaves up to 1e-6 of what the method errs by
        np.testing.assert_allclose(runs[0][name], runs[1][name], atol=1e-7)
    assert runs[0].report.newton_iterations <= 1.1 * runs[1].report.newton_iterations


def test_a_long_pendulum_of_links_swings_as_the_catenary_of_bessel():
    """A hanging chain's lowest frequencies: (j₀ₖ/2) √(g/L), with links for a rope to second order in their length."""
    from scipy.special import jn_zeros

    links = 60
    x = np.linspace(0.0, -10.0, links + 1)
    parts = [fc.Beam(f"link{i}", (0, 0, a), (0, 0, b), SECTION) for i, (a, b) in enumerate(itertools.pairwise(x))]
    joints = [
        fc.Support(parts[0].start, held="u v w rz"),
        *(fc.Pin(a.end, b.start) for a, b in itertools.pairwise(parts)),
    ]
    joints += [fc.Support(p.start, held="rz") for p in parts[1:]]
    model = fc.assemble(fc.Structure(parts, joints), RIGID)
    assert isinstance(model.motion.linkage, Levers)
    omega = fc.linearize(model).modes(6).omega[::2]
    np.testing.assert_allclose(omega, jn_zeros(0, 3) / 2.0 * np.sqrt(9.81 / 10.0), rtol=2e-3)


@pytest.mark.parametrize("rope", [False, True], ids=["links", "rope"])
def test_what_long_chains_take_grows_with_their_length(rope):
    """Entries of fronts, of tables and of the workspace, and numbers that solving reads."""
    taken = []
    for links in (50, 100, 200):
        layout = layout_of(chain(links, rope))
        F = layout.made()
        tangents = sum(run.gather.size + run.scatter.size for run in F.flat.tangents)
        loops = sum(run.gather.size for runs in (F.flat.placing, F.flat.rating, F.flat.changing) for run in runs)
        fronts = F.plan.fronts
        taken.append(
            [F.plan.length, fronts.below + fronts.right, F.flat.z.size, tangents, loops, 1 + F.axes.pair_count]
        )
    growth = np.log2(np.array(taken[1:]) / np.array(taken[:-1]))
    assert (growth <= 1.05).all(), growth


RUN = """
import sys
from pathlib import Path
sys.path.insert(0, {tests!r})
import flexctrl as fc
from test_long_linkages import chain
run = fc.simulate(chain({links}, {rope}), until=0.01, method=fc.GeneralizedAlpha(1e-3))
assert run.status is fc.Status.FINISHED, run.report
lines = Path("/proc/self/status").read_text().splitlines()
print(next(int(line.split()[1]) for line in lines if line.startswith("VmHWM:")) // 1024)
"""


@pytest.mark.slow
@pytest.mark.parametrize(("links", "most"), [(400, 400), (1000, 900)])
@pytest.mark.parametrize("rope", [False, True], ids=["links", "rope"])
def test_hundreds_of_links_run_in_some_hundred_megabytes(links, most, rope):
    code = RUN.format(tests=str(__file__).rsplit("/", 1)[0], links=links, rope=rope)
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert int(done.stdout) < most
