"""Forces that are summed tile by tile are those that are summed by loops over all of a machine."""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.kernels.native import Packed, Reals
from flexctrl.model.flat.flat import drive, load, place, press_tiles, push, tangent
from flexctrl.model.flat.flattening import flatten
from flexctrl.model.flat.tiles import NO_TILES
from flexctrl.model.flat.workspace import Flat

EFFECTS = (fc.Gravity(), fc.Flexible(), fc.LargeRotation(), fc.RayleighDamping(0.1, 1e-3))
SECTION = fc.Section(EA=1e5, EI_y=10.0, EI_z=20.0, GJ=5.0, rhoA=1.0, rhoJ=1e-3)


@dataclass
class Once:
    flat: Flat
    entries: Reals


def tiled(m: Once) -> int:
    load(m.flat)
    press_tiles(m.flat)
    if m.flat.slopes > 0:
        tangent(m.flat, 1.0, 20.0, 400.0, m.entries)
    return 0


def untiled(m: Once) -> int:
    load(m.flat)
    place(m.flat)
    drive(m.flat)
    push(m.flat)
    if m.flat.slopes > 0:
        tangent(m.flat, 1.0, 20.0, 400.0, m.entries)
    return 0


def chain() -> fc.Structure:
    beam = fc.Beam("chain", (0, 0, 0), (3, 0, -4), SECTION, elements=700)
    return fc.Structure([beam], [fc.Support(beam.start, held="u v w")])


def trident() -> fc.Structure:
    """Three beams welded to a fourth, with a body, a spring between them, a slack line and two inputs."""
    stem = fc.Beam("stem", (0, 0, 0), (1, 0, 0), SECTION, elements=90)
    arms = [fc.Beam(f"arm{k}", (1, 0, 0), (2, k - 1.0, 0.3 * k), SECTION, elements=150) for k in range(3)]
    spring = fc.Spring("spring", arms[0].node(80), arms[2].node(40), stiffness=1e3)
    line = fc.Rope("line", arms[1].end, (2, 0, 1), EA=1e4, length=1.5)
    load = fc.PointMass("load", arms[1].end, 2.0)
    joints = [fc.Support(stem.start), *(fc.Weld(stem.end, arm.start) for arm in arms), fc.Support(line.end)]
    joints += [fc.Pin(arms[0].node(80), spring.start), fc.Pin(arms[2].node(40), spring.end)]
    joints += [fc.Pin(arms[1].end, line.start), fc.Pin(arms[1].end, load.node)]
    inputs = [fc.Force("push", arms[2].end, (0, 1, 0)), fc.FollowerForce("jet", arms[0].end, (1, 0, 0))]
    return fc.Structure([stem, *arms, spring, line, load], joints, [], inputs)


def braced() -> fc.Structure:
    """The same without what turns with a node, which has no tangent of its own."""
    return replace(trident(), inputs=())


def pinned() -> fc.Structure:
    """A cable of beams pinned together: nodes at one place turn by themselves."""
    links = [fc.Beam(f"link{k}", (k, 0, 0), (k + 1, 0, 0), SECTION, elements=40) for k in range(9)]
    pins = [fc.Pin(a.end, b.start) for a, b in itertools.pairwise(links)]
    return fc.Structure(links, [fc.Support(links[0].start, held="u v w"), *pins])


def grid(columns: int, rows: int) -> fc.Structure:
    """Beams welded together wherever they meet: up to four nodes share their freedoms."""
    at = {(i, j): (1.0 * i, 1.0 * j, 0.0) for i in range(columns) for j in range(rows)}
    ways = [(p, q) for p in at for q in ((p[0] + 1, p[1]), (p[0], p[1] + 1)) if q in at]
    beams = [fc.Beam(f"b{k}", at[p], at[q], SECTION, elements=2) for k, (p, q) in enumerate(ways)]
    ends: dict[tuple[int, int], list[fc.Node]] = {p: [] for p in at}
    for beam, (p, q) in zip(beams, ways, strict=True):
        ends[p].append(beam.start)
        ends[q].append(beam.end)
    welds = [fc.Weld(first, other) for first, *others in ends.values() for other in others]
    return fc.Structure(beams, [fc.Support(ends[0, 0][0]), *welds])


def oblong() -> fc.Structure:
    return grid(8, 9)


def square() -> fc.Structure:
    return grid(10, 10)


@pytest.mark.parametrize("machine", [chain, trident, braced, pinned, oblong, square])
@pytest.mark.parametrize("compiled", [True, False])
@pytest.mark.parametrize("far", [0.0, 1.0])
def test_tiles_change_nothing(machine, compiled, far):
    """Steps near and far (1.7 rad), which turn nodes by two kernels; in tiles of one model by either."""
    if compiled:
        pytest.importorskip("llvmlite")
    model = fc.assemble(machine(), EFFECTS, backend=None if compiled else fc.CasadiVM())
    F = flatten(model)
    f, rng = F.flat, np.random.default_rng(2)
    assert f.tiles.count >= 4
    step, v, rate = rng.normal(size=(3, model.n)) * [[1e-3], [1.0], [10.0]]
    step += np.linspace(0.0, far, model.n)
    found = []
    for plain, work in ((f, tiled), (replace(f, tiles=NO_TILES), untiled)):
        F.enter(model.rest)
        f.force[:] = np.nan
        f.u[:] = 3.0
        f.step[:], f.v[:], f.rate[:] = F.ordered(step), F.ordered(v), F.ordered(rate)
        once = Once(plain, np.full(f.entries + 1, np.nan))
        Packed(once).bound(work)() if compiled else work(once)
        found.append((f.z[: f.posed].copy(), f.force[: f.n].copy(), once.entries[:-1]))
        assert np.isfinite(found[-1][1]).all()
    (slots, *sums), (others, *other_sums) = found
    np.testing.assert_allclose(slots, others, rtol=0, atol=1e-14)  # either kernel may turn a tile
    for ours, theirs in zip(sums, other_sums, strict=True):
        if f.slopes or ours is sums[0]:
            np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-11 * abs(theirs).max())


def test_machines_of_few_nodes_and_driven_ones_have_no_tiles():
    few = fc.Beam("few", (0, 0, 0), (1, 0, 0), SECTION, elements=100)
    arm = fc.Beam("arm", (0, 0, 0), (1, 0, 0), SECTION, elements=600)
    motor = fc.RotaryDrive("motor", arm.start, axis="z", stiffness=1e3, ratio=5.0, inertia=0.1)
    for beam, drives in ((few, []), (arm, [motor])):
        machine = fc.Structure([beam], [fc.Support(beam.start, held="u v w rx ry")], drives)
        assert flatten(fc.assemble(machine, EFFECTS)).flat.tiles is NO_TILES
