"""A model on flat vectors, for compiled loops: from degrees of freedom to nodes, forces back, tangents.

One workspace holds all that kernels read: the slots of nodes and drives (see `kinds`), the tangent's seeds,
the pose at the start of a step, and the step, rates and accelerations of the degrees of freedom. These stand
in the order of elimination, with a place at the end for what is held. Forces are added straight to the
degrees of freedom, except those on the nodes of a linkage, which its levers carry on.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from flexctrl.kernels.eights import eight, larger, largest, put, put_six
from flexctrl.kernels.native import Reals, Runs, Wholes, seldom
from flexctrl.mechanics.rotation import NEAR
from flexctrl.model.laws.kinds import DRIVE_SLOT, NODE_SLOT
from flexctrl.model.motion import FAST

__all__ = [
    "Flat",
    "accelerate",
    "arrive",
    "carry",
    "clear",
    "dissipate",
    "drive",
    "energy",
    "keep",
    "load",
    "place",
    "press_entire",
    "pull",
    "push",
    "tangent",
]

HIDDEN = frozenset({"slots", "drawn", "back", "units"})
"""Parts of the workspace that only kernels read."""

_TURN = 2.0 * math.pi
_POSE = 12
_FAST = FAST
_NEAR = NEAR


@dataclass
class Flat:
    """A model on flat vectors. Vectors marked * are parts of the workspace.

    Attributes
    ----------
    n, padded : int
        Degrees of freedom; length of their vectors, a multiple of eight and more than n.
    size, nodes : int
        Length of the workspace; nodes, the ground included.
    z : Reals
        The workspace, slots first.
    seeds, pose, step, v, rate : Reals *
        The tangent's seeds (3), poses at the start of the step (12 a node), and the step under way: increments,
        rates and accelerations at its end.
    force, load : Reals *
        Sums of forces on the degrees of freedom, then raw ones on the linkage; the same of inputs that keep
        their directions.
    q : Reals *
        Sums of the degrees of freedom at the start of the step.
    driven, found, about : Reals *
        Driven coordinates at the start of the step, at its end, and about what the step adds to them.
    whole : Wholes
        Nodes whose six degrees of freedom are their own and follow each other, and the first of these.
    moved, turned, linked : Wholes
        Other nodes that move and that turn by degrees of freedom of their own, and those of the linkage.
    cells : Wholes
        Degree of freedom of each of a node's six.
    slots, sources : Wholes
        Velocities of other nodes among the slots, and the degrees of freedom they are.
    shafts, rigid, rotary : Wholes
        Degrees of freedom of source angles, then of modes; which shafts are rigid; which joints turn.
    ratios : Reals
    inputs : Wholes
        Where unit loads act, then the inputs they are of.
    unit : Reals
        Their values.
    spun : Wholes
        Degrees of freedom that turn what is driven.
    follows : Wholes
        Of each load that turns with a node: the input, the node, and where its three components act.
    toward : Reals
        Their directions at rest.
    u : Reals *
        Inputs.
    shift : Reals *
        How far all nodes are shifted and turned from the drawn shape, for models in small motion.
    turn : Runs
        Kernels that turn nodes by a step: by little, and by any.
    winding, forces, tangents, energies, shifts : Runs
        Kernels; of the linkage's drives: driven coordinates, and what steps add to them.
    placing, rating, changing, carrying : Runs
        What levers do: places, rates, accelerations; forces.
    placed, levers, slopes : int
        How many kernels place; how many do each of the others; how many tangents there are.
    gusts : Runs
        Kernels of the forces of gusts.
    books : Reals *
        Kinetic energy, stored energy, dissipated power.
    answer : Reals *
        Accelerations; see `accelerate`.
    entire : Runs
        Kernels of the whole machine, where it has few freedoms; see `flexctrl.model.flat.entire`.
    quick : int
        How many there are.
    pressing : int
        Whether the first of them gives forces (`press_entire`) rather than accelerations.
    """

    LASTING = ("linking", "placed", "levers", "carried", "quick")

    n: int
    padded: int
    size: int
    nodes: int
    wholes: int
    moving: int
    turning: int
    turns: int
    linking: int
    placed: int
    levers: int
    slopes: int
    rates: int
    drives: int
    spinning: int
    inner: int
    pieces: int
    unit_loads: int
    following: int
    gusting: int
    carried: int
    shifting: int
    entries: int
    drive_base: int
    z: Reals
    seeds: Reals
    pose: Reals
    step: Reals
    v: Reals
    rate: Reals
    force: Reals
    load: Reals
    q: Reals
    driven: Reals
    found: Reals
    about: Reals
    whole: Wholes
    moved: Wholes
    turned: Wholes
    linked: Wholes
    cells: Wholes
    slots: Wholes
    sources: Wholes
    shafts: Wholes
    rigid: Wholes
    rotary: Wholes
    ratios: Reals
    spun: Wholes
    inputs: Wholes
    unit: Reals
    follows: Wholes
    toward: Reals
    u: Reals
    shift: Reals
    turn: Runs
    placing: Runs
    rating: Runs
    changing: Runs
    carrying: Runs
    winding: Runs
    forces: Runs
    tangents: Runs
    energies: Runs
    shifts: Runs
    gusts: Runs
    books: Reals
    answer: Reals
    entire: Runs = ()
    quick: int = 0
    pressing: int = 0


def load(f: Flat) -> None:
    """Work out the loads of the inputs."""
    for i in range(f.padded + f.carried):
        f.load[i] = 0.0
    for k in range(f.unit_loads):
        f.load[f.inputs[k]] += f.unit[k] * f.u[f.inputs[f.unit_loads + k]]


def place(f: Flat) -> None:
    """Put the nodes where the step takes them."""
    for k in range(f.wholes):
        x = f.pose[_POSE * f.whole[2 * k] :]
        step = f.step[f.whole[2 * k + 1] :]
        slot = f.z[NODE_SLOT * f.whole[2 * k] :]
        slot[0] = x[0] + step[0]
        slot[1] = x[1] + step[1]
        slot[2] = x[2] + step[2]
    for k in range(f.moving):
        i = f.moved[k]
        for j in range(3):
            f.z[NODE_SLOT * i + j] = f.pose[_POSE * i + j] + f.step[f.cells[6 * i + j]]
    if f.turns > 0:
        f.turn[turned_far(f)](f.z, f.z)
    if f.shifting > 0:
        clear(f.shifting, f.shift)
        f.shifts[0](f.z, f.z)
    if f.linking > 0:
        for k in range(f.linking):
            clear(_POSE, f.z[NODE_SLOT * f.linked[k] :])
    if f.placed > 0:
        for k in range(f.placed):
            f.placing[k](f.z, f.z)
    if f.drives > 0:
        wind(f)
    for i in range(f.drives, f.drives + f.inner):
        f.z[f.drive_base + DRIVE_SLOT * i] = f.q[f.shafts[i]] + f.step[f.shafts[i]]


def turned_far(f: Flat) -> int:
    """Return 1 where the step may turn nodes far, 0 elsewhere: which kernel turns them."""
    most = abs(eight(f.step))
    for i in range(8, f.padded, 8):
        most = larger(most, abs(eight(f.step[i:])))
    return 0 if largest(most) <= _NEAR else 1


def clear(n: int, x: Reals) -> None:
    """Set entries to zero."""
    for i in range(n):
        x[i] = 0.0


def wind(f: Flat) -> None:
    """Find the driven coordinates, with the whole turns that bring them next to what the step makes of them."""
    clear(f.drives, f.found)
    f.winding[0](f.z, f.z)
    clear(f.drives, f.about)
    if fast(f):
        f.winding[1](f.z, f.z)
    for i in range(f.drives):
        slot = f.z[f.drive_base + DRIVE_SLOT * i :]
        slot[3] = 0.0
        if f.rotary[i] == 1:
            f.found[i] += _TURN * math.floor((f.driven[i] + f.about[i] - f.found[i]) / _TURN + 0.5)
            slot[3] = math.floor(f.found[i] / _TURN + 0.5)
        if f.rigid[i] == 1:
            slot[0] = f.ratios[i] * f.found[i]
        else:
            slot[0] = f.q[f.shafts[i]] + f.step[f.shafts[i]]


def fast(f: Flat) -> bool:
    """Tell whether the step may turn what is driven by more than half a turn."""
    most = 0.0
    for i in range(f.spinning):
        most = max(most, abs(f.step[f.spun[i]]))
    return most >= _FAST


def drive(f: Flat) -> None:
    """Give nodes and drives the rates and accelerations of the step's end."""
    for k in range(f.wholes):
        slot = f.z[NODE_SLOT * f.whole[2 * k] + _POSE :]
        put_six(slot, f.v[f.whole[2 * k + 1] :])
        put_six(slot[6:], f.rate[f.whole[2 * k + 1] :])
    for k in range(f.rates):
        f.z[f.slots[k]] = f.v[f.sources[k]]
        f.z[f.slots[k] + 6] = f.rate[f.sources[k]]
    for i in range(f.drives + f.inner):
        slot = f.z[f.drive_base + DRIVE_SLOT * i :]
        slot[1] = f.v[f.shafts[i]]
        slot[2] = f.rate[f.shafts[i]]
    if f.linking > 0:
        for k in range(f.linking):
            clear(_POSE, f.z[NODE_SLOT * f.linked[k] + _POSE :])
    if f.levers > 0:
        for k in range(f.levers):
            f.rating[k](f.z, f.z)
        for k in range(f.levers):
            f.changing[k](f.z, f.z)


def push(f: Flat) -> None:
    """Sum up all forces on the degrees of freedom, inertia and inputs included."""
    press(f)
    for k in range(f.pieces):
        f.forces[k](f.z, f.z)
    carry(f)


def carry(f: Flat) -> None:
    """Hand forces on, from followers to their masters."""
    if f.carried > 0:
        for k in range(f.levers):
            f.carrying[k](f.z, f.z)


def accelerate(f: Flat) -> None:
    """Find the accelerations at the end of the step, of machines with kernels for all of it."""
    f.entire[0](f.z, f.z)


def press_entire(f: Flat) -> None:
    """Sum up all forces at the end of the step, of machines with kernels for all of it; nodes stay where they were."""
    f.entire[0](f.z, f.z)


def dissipate(f: Flat) -> None:
    """Work out the dissipated power of the slots, maybe the energies too."""
    if f.quick > 0:
        f.entire[4](f.z, f.z)
        return
    energy(f)


def arrive(f: Flat) -> None:
    """Put nodes and drives where the step takes them, with the rates of its end; of such machines."""
    f.entire[1](f.z, f.z)


def pull(f: Flat) -> None:
    """Sum up the forces of the inputs alone."""
    if f.quick > 0:
        f.entire[2](f.z, f.z)
        return
    press(f)
    carry(f)


def press(f: Flat) -> None:
    """Put the inputs' forces where they act."""
    for i in range(0, f.padded, 8):
        put(f.force[i:], eight(f.load[i:]))
    for i in range(f.padded, f.padded + f.carried):
        f.force[i] = f.load[i]
    for k in range(f.following):
        at = f.follows[5 * k :]
        R = f.z[NODE_SLOT * at[1] + 3 :]
        way = f.toward[3 * k :]
        for i in range(3):
            along = R[3 * i] * way[0] + R[3 * i + 1] * way[1] + R[3 * i + 2] * way[2]
            f.force[at[2 + i]] += f.u[at[0]] * along
    for k in range(f.gusting):
        f.gusts[k](f.z, f.z)


@seldom
def tangent(f: Flat, on_place: float, on_rate: float, on_acceleration: float, entries: Reals) -> None:
    """Fill in the slope of the forces for motions that add these times an increment."""
    f.seeds[0] = on_place
    f.seeds[1] = on_rate
    f.seeds[2] = on_acceleration
    clear(f.entries, entries)
    for k in range(f.slopes):
        f.tangents[k](f.z, entries)


def energy(f: Flat) -> None:
    """Work out the energies and the dissipated power of the slots."""
    if f.quick > 0:
        f.entire[3](f.z, f.z)
        return
    clear(3, f.books)
    for k in range(f.pieces):
        f.energies[k](f.z, f.books)


def keep(f: Flat) -> None:
    """Take the end of the step as the start of the next."""
    for k in range(f.wholes):
        i = f.whole[2 * k]
        put_six(f.pose[_POSE * i :], f.z[NODE_SLOT * i :])
        put_six(f.pose[_POSE * i + 6 :], f.z[NODE_SLOT * i + 6 :])
    for k in range(f.moving):
        i = f.moved[k]
        for j in range(3):
            f.pose[_POSE * i + j] = f.z[NODE_SLOT * i + j]
    for k in range(f.turning):
        i = f.turned[k]
        for j in range(3, _POSE):
            f.pose[_POSE * i + j] = f.z[NODE_SLOT * i + j]
    for k in range(f.linking):
        before = f.pose[_POSE * f.linked[k] :]
        after = f.z[NODE_SLOT * f.linked[k] :]
        put(before, eight(after))
        put(before[4:], eight(after[4:]))
    for i in range(f.drives):
        f.driven[i] = f.found[i]
    for i in range(0, f.padded, 8):
        put(f.q[i:], eight(f.q[i:]) + eight(f.step[i:]))
