"""Where forces have a corner there is no linear model: whichever way the machine is turned, and by name."""

from __future__ import annotations

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.errors import LinearizationError
from flexctrl.model.certify import taylor_slope

FLEXIBLE = (fc.Flexible(), fc.LargeRotation())


def stayed(seed: int, stretch: float) -> fc.Model:
    """A mast with a stay in some direction, its length short of the distance by a share."""
    rng = np.random.default_rng(seed)
    tube = fc.Section.tube(fc.STEEL, 0.02, 0.002)
    mast = fc.Beam("mast", (0, 0, 0), (*rng.normal(size=2), 1.5), tube, elements=2)
    anchor = np.array(mast.end.position) + rng.normal(size=3)
    length = float(np.linalg.norm(anchor - np.array(mast.end.position))) * (1.0 - stretch)
    stay = fc.Rope("stay", mast.end, anchor, EA=1e5, length=length)
    joints = [fc.Support(mast.start), fc.Pin(mast.end, stay.start), fc.Support(stay.end, "u v w")]
    return fc.assemble(fc.Structure([mast, stay], joints), FLEXIBLE)


@pytest.mark.parametrize("block", range(4))
def test_a_rope_at_its_natural_length_is_refused_by_name(block):
    for seed in range(10 * block, 10 * block + 10):
        with pytest.raises(LinearizationError, match="stay is exactly at its natural length; prestress it"):
            fc.linearize(stayed(seed, 0.0))


@pytest.mark.parametrize("stretch", [1e-4, -1e-4, 1e-8, -1e-8])
def test_beside_it_there_is_a_linear_model_on_either_side(stretch):
    for seed in range(3):
        linear = fc.linearize(stayed(seed, stretch))
        stay = abs(linear.parts["stay"].stiffness).max()
        assert stay > 1e3 if stretch > 0 else stay == 0.0


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_rope_that_no_free_motion_stretches_to_first_order_is_no_corner(sign):
    """Held along the rope, the mass moves across it only: tension grows with the square of its displacement."""
    rope = fc.Rope("rope", (0, 0, 0), (sign, 0, 0), EA=1e4)
    mass = fc.PointMass("mass", rope.end, 1.0)
    spring = fc.Spring("spring", (sign, 0, 0), (sign, 1, 0), 5.0)
    joints = [
        fc.Support(rope.start),
        fc.Pin(rope.end, mass.node),
        fc.Support(mass.node, "u w"),
        fc.Pin(mass.node, spring.start),
        fc.Support(spring.end),
    ]
    linear = fc.linearize(fc.assemble(fc.Structure([rope, mass, spring], joints), FLEXIBLE))
    assert linear.K.toarray() == pytest.approx(np.array([[5.0]]))


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_flank_of_a_gap_is_refused_by_name(sign):
    mass = fc.PointMass("mass", (1, 0, 0), 1.0)
    spring = fc.Spring("spring", (0, 0, 0), (1, 0, 0), 1e4)
    joints = [fc.Support(mass.node, "v w"), fc.Support(spring.start), fc.Pin(mass.node, spring.end)]
    model = fc.assemble(fc.Structure([mass, spring], joints), [fc.LargeRotation(), fc.Backlash({"spring": 0.25})])
    with pytest.raises(LinearizationError, match="spring stands exactly on a flank of its gap"):
        fc.linearize(model, at=model.displace({"mass_0_u": sign * 0.125}))


@pytest.mark.parametrize("seed", range(5))
def test_the_taylor_remainder_sees_a_corner_from_either_side(seed):
    """f = −k max(n·d, 0): with K of either side the slope is 1, whatever the orientation of n."""
    import scipy.sparse as sp

    rng = np.random.default_rng(seed)
    n = rng.normal(size=6)
    for sign in (1.0, -1.0):
        side = sign * n
        for K in (np.outer(n, n), np.zeros((6, 6))):
            K = sp.csc_matrix(K + np.eye(6))
            slope = taylor_slope(lambda d, side=side: -max(side @ d, 0.0) * side - d, K, np.ones(6))
            assert slope == pytest.approx(1.0, abs=0.05)


def loaded(EA: float) -> fc.Model:
    """A kilogram on a rope of a metre."""
    rope = fc.Rope("rope", (0, 0, 0), (0, 0, -1), EA=EA)
    load = fc.PointMass("load", rope.end, 1.0)
    structure = fc.Structure([rope, load], [fc.Support(rope.start), fc.Pin(rope.end, load.node)])
    return fc.assemble(structure, [fc.LargeRotation(), fc.Gravity(), fc.RopeStretch()], fc.CasadiVM())


def hanging_free(EA: float) -> fc.Model:
    """A rope of its own weight, whose last element is stretched by 2e-10 at EA = 1e10."""
    rope = fc.Rope("rope", (0, 0, 0), (0, 0, -4), EA=EA, rhoA=2.0, elements=20)
    structure = fc.planar(fc.Structure([rope], [fc.Support(rope.start)]), "y")
    return fc.assemble(structure, [fc.Gravity(), fc.RopeMass(), *FLEXIBLE], fc.CasadiVM())


@pytest.mark.parametrize("model", [loaded(1e13), hanging_free(1e12)], ids=["loaded", "free"])
def test_a_taut_rope_too_stiff_for_the_digits_of_places_is_named_as_such(model):
    with pytest.raises(LinearizationError, match=r"so stiff that .* make (it|that) softer, or rigid"):
        fc.linearize(model)


@pytest.mark.parametrize(
    ("model", "lowest"),
    [(loaded(1e12), np.sqrt(9.81)), (hanging_free(1e9), 1.2024155 * np.sqrt(9.81 / 4))],
    ids=["loaded", "free"],
)
def test_a_taut_rope_that_hardly_stretches_has_a_linear_model(model, lowest):
    """Its corner is 1e-11 away, and the frequencies are as good as the certificate says."""
    linear = fc.linearize(model)
    assert linear.modes().omega[0] == pytest.approx(lowest, rel=linear.certificate.frequency_error + 1e-7)
    assert linear.certificate.frequency_error < 2e-5
