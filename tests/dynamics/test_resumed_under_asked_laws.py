"""Runs under continuous laws that only Python can be asked for go on with the same bits, wherever they are cut."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, ClassVar

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.design import OpenLoop

METHODS = {"chosen": fc.Unchecked(fc.AdaptiveAlpha()), "fixed": fc.Unchecked(fc.GeneralizedAlpha(2e-3))}


class Own:
    """A law that tells nothing, with some states, whose reference may have corners."""

    inputs: ClassVar[tuple[str, ...]] = ("x", "vx")
    outputs: ClassVar[tuple[str, ...]] = ("push",)
    sample_time = 0.0

    def __init__(self, states: int, reference: Callable[[float], float]) -> None:
        self.states, self.reference = states, reference

    def initial(self) -> np.ndarray:
        return np.zeros(self.states)

    def command(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.array([60.0 * (self.reference(t) - y[0]) - 10.0 * y[1] + 20.0 * x.sum()])

    def rate(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.full(self.states, self.reference(t) - y[0])


def laws(frequency: float) -> dict[str, Any]:
    """Functions of time, and laws with and without state."""
    sway = {"smooth": lambda t: np.sin(frequency * t), "cornered": lambda t: abs(np.sin(frequency * t))}
    opened = {f"{name}, open": OpenLoop({"push": lambda t, f=f: 60.0 * f(t)}) for name, f in sway.items()}
    return opened | {f"{name}, {n} states": Own(n, f) for n in (0, 1) for name, f in sway.items()}


def cart(link: str) -> fc.Model:
    """A load on a cart, by a rope that goes slack or by a spring."""
    body = fc.PointMass("cart", (0, 0, 0), 5.0)
    ends = "link", body.node, (0, 0, -1), 400.0
    line = fc.Rope(*ends, damping=1.0) if link == "rope" else fc.Spring(*ends, damping=1.0)
    load = fc.PointMass("load", line.end, 2.0)
    joints = [fc.Support(body.node, "v w"), fc.Pin(body.node, line.start), fc.Pin(line.end, load.node)]
    structure = fc.Structure(
        [body, line, load],
        [*joints, fc.Support(load.node, "v")],
        inputs=[fc.Force("push", body.node, "x")],
        outputs=[fc.Position("x", body.node, "x"), fc.Velocity("vx", body.node, "x"), fc.Tension("T", line)],
    )
    return fc.assemble(structure, [fc.Gravity(), fc.LargeRotation(), *([fc.RopeStretch()] if link == "rope" else [])])


def check_cuts(model: fc.Model, law: Any, method: Any, until: float, cuts: np.ndarray) -> None:
    """Rows, books, counts and the end of a run in two parts are those of the run in one."""
    how = {"method": method, "every": 0.01}
    whole = fc.simulate(model, law, until=until, **how)
    for cut in cuts.tolist():
        half = fc.simulate(model, law, until=cut, **how)
        rest = fc.simulate(model, law, until=until, start=half.checkpoint, **how)
        assert np.array_equal(rest.t, whole.t[-len(rest.t) :]), cut
        assert np.array_equal(rest.y, whole.y[-len(rest.t) :]), cut
        assert np.array_equal(rest.final.x, whole.final.x), cut
        assert np.array_equal(rest.final.v, whole.final.v), cut
        one, other = rest.report, whole.report
        assert (one.steps, one.rejected_steps, one.energy) == (other.steps, other.rejected_steps, other.energy), cut


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("law", laws(3.0))
@pytest.mark.parametrize("link", ["rope", "spring"])
def test_they_go_on_with_the_same_bits(link, law, method):
    """11 of 25 parts under a function of time took other steps, and those to come were up to 0.4 N of 155 N off."""
    cuts = np.random.default_rng(1).uniform(0.1, 1.3, 4)
    check_cuts(cart(link), laws(3.0)[law], METHODS[method], 1.4, cuts)


@pytest.mark.parametrize("states", [0, 1])
def test_how_long_a_part_is_has_no_say_in_which_steps_a_law_goes_straight_on(states):
    """It was asked at more places in each step of a shorter part, and other steps were left to plain ones."""
    law = Own(states, lambda t: abs(np.sin((7.0 + 2.0 * states) * t)))
    check_cuts(cart("spring"), law, METHODS["fixed"], 2.4, np.array([0.72, 1.008]))


@pytest.mark.long
@pytest.mark.parametrize("seed", range(12))
def test_they_go_on_with_the_same_bits_from_anywhere(seed):
    r = np.random.default_rng(seed)
    model, method = cart(["rope", "spring"][seed % 2]), list(METHODS.values())[(seed // 2 + seed) % 2]
    law = list(laws(float(r.uniform(1.0, 12.0))).values())[seed // 2]
    check_cuts(model, law, method, 2.0, r.uniform(0.05, 1.95, 12))
