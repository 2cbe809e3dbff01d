"""A model on flat vectors, for compiled loops: from degrees of freedom to nodes, forces back, tangents.

One workspace holds all that kernels read: the slots of nodes and drives (see `kinds`), the tangent's seeds,
the pose at the start of a step, and the step, rates and accelerations of the degrees of freedom. These stand
in the order of elimination, with a place at the end for what is held. Forces are added straight to the
degrees of freedom, except those on the nodes of a linkage, which its levers carry on.
"""

from __future__ import annotations

import math

from flexctrl.kernels.eights import eight, larger, largest, put, put_six
from flexctrl.kernels.native import Reals, seldom
from flexctrl.mechanics.rotation import NEAR
from flexctrl.model.flat.workspace import Flat
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
    "keep_tiles",
    "load",
    "place",
    "press_beyond",
    "press_entire",
    "press_tile",
    "press_tiles",
    "pull",
    "push",
    "stand",
    "tangent",
]

_TURN = 2.0 * math.pi
_POSE = 12
_FAST = FAST
_NEAR = NEAR
_SHARED = 16
"""Freedoms before those of a tile that its first nodes may have."""


def load(f: Flat) -> None:
    """Work out the loads of the inputs."""
    for i in range(f.padded + f.carried):
        f.load[i] = 0.0
    for k in range(f.unit_loads):
        f.load[f.inputs[k]] += f.unit[k] * f.u[f.inputs[f.unit_loads + k]]


def place(f: Flat) -> None:
    """Put the nodes where the step takes them."""
    if f.tiles.count > 0:
        place_tiles(f)
        return
    for k in range(f.wholes):
        move(f, k)
    move_parted(f)
    if f.turns > 0:
        f.turn[turned_far(f, 0, f.padded)](f.z, f.z)
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


def move(f: Flat, k: int) -> None:
    """Move a whole node by the step."""
    x = f.pose[_POSE * f.whole[2 * k] :]
    step = f.step[f.whole[2 * k + 1] :]
    slot = f.z[NODE_SLOT * f.whole[2 * k] :]
    slot[0] = x[0] + step[0]
    slot[1] = x[1] + step[1]
    slot[2] = x[2] + step[2]


def move_parted(f: Flat) -> None:
    """Move nodes whose degrees of freedom stand apart."""
    for k in range(f.moving):
        i = f.moved[k]
        for j in range(3):
            f.z[NODE_SLOT * i + j] = f.pose[_POSE * i + j] + f.step[f.cells[6 * i + j]]


def turned_far(f: Flat, first: int, last: int) -> int:
    """Return 1 where the step may turn nodes far by these freedoms, 0 elsewhere: which kernel turns them."""
    most = abs(eight(f.step[first:]))
    for i in range(first + 8, last, 8):
        most = larger(most, abs(eight(f.step[i:])))
    return 0 if largest(most) <= _NEAR else 1


def clear(n: int, x: Reals) -> None:
    """Set entries to zero, eight at a time."""
    i = 0
    while n - i >= 8:
        put(x[i:], 0.0)
        i += 8
    while i < n:
        x[i] = 0.0
        i += 1


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
        rate(f, k)
    rate_parted(f)
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


def rate(f: Flat, k: int) -> None:
    """Give a whole node its rates and accelerations."""
    slot = f.z[NODE_SLOT * f.whole[2 * k] + _POSE :]
    put_six(slot, f.v[f.whole[2 * k + 1] :])
    put_six(slot[6:], f.rate[f.whole[2 * k + 1] :])


def rate_parted(f: Flat) -> None:
    """Give them to nodes whose degrees of freedom stand apart."""
    for k in range(f.rates):
        f.z[f.slots[k]] = f.v[f.sources[k]]
        f.z[f.slots[k] + 6] = f.rate[f.sources[k]]


def place_tiles(f: Flat) -> None:
    """Put the nodes where the step takes them, tile by tile."""
    move_parted(f)
    for k in range(f.tiles.count):
        place_tile(f, k)


def place_tile(f: Flat, k: int) -> None:
    """Put the nodes of a tile where the step takes them."""
    for i in range(f.tiles.nodes[k], f.tiles.nodes[k + 1]):
        move(f, i)
    turn_tile(f, k)


def turn_tile(f: Flat, k: int) -> None:
    """Turn the nodes of a tile by the step; with the last those whose freedoms stand apart, anywhere."""
    first = max(f.tiles.freedoms[k] - _SHARED, 0)
    if k + 1 == f.tiles.count and f.turning > 0:
        first = 0
    f.tiles.turn[2 * k + turned_far(f, first, f.tiles.freedoms[k + 1])](f.z, f.z)


def press_tiles(f: Flat) -> None:
    """Place the nodes and sum up all forces at the end of the step, tile by tile."""
    for k in range(f.tiles.count):
        press_tile(f, k)
    press_beyond(f)


def press_tile(f: Flat, k: int) -> None:
    """Place the nodes of a tile and sum up the forces of its pieces at the end of the step, the tiles before done."""
    tiles = f.tiles
    if k + 1 == tiles.count:
        move_parted(f)
        rate_parted(f)
    begin_tile(f, tiles.freedoms[k], tiles.freedoms[k + 1])
    for i in range(tiles.nodes[k], tiles.nodes[k + 1]):
        move(f, i)
        rate(f, i)
    turn_tile(f, k)
    for i in range(k * tiles.families, (k + 1) * tiles.families):
        tiles.forces[i](f.z, f.z)


def press_beyond(f: Flat) -> None:
    """Add the forces that are in no tile."""
    for k in range(f.tiles.families, f.pieces):
        f.forces[k](f.z, f.z)
    press_following(f)


def begin_tile(f: Flat, first: int, last: int) -> None:
    """Begin the sums of forces on the freedoms of a tile; loads that are nothing are not read."""
    if f.unit_loads == 0:
        clear(last - first, f.force[first:])
        return
    for i in range(first, last, 8):
        put(f.force[i:], eight(f.load[i:]))


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
    press_following(f)


def press_following(f: Flat) -> None:
    """Add the forces of inputs that turn with nodes, and of gusts."""
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
    if f.tiles.count > 0 and f.slopes > 0:
        slope_tiles(f, entries)
    else:
        clear(f.entries, entries)
    for k in range(f.tiles.families, f.slopes):
        f.tangents[k](f.z, entries)


def slope_tiles(f: Flat, entries: Reals) -> None:
    """Fill in the slopes of the pieces, tile by tile: entries are added to while they are near."""
    tiles = f.tiles
    for k in range(tiles.count):
        clear(tiles.entries[k + 1] - tiles.entries[k], entries[tiles.entries[k] :])
        for i in range(k * tiles.families, (k + 1) * tiles.families):
            tiles.tangents[i](f.z, entries)


def energy(f: Flat) -> None:
    """Work out the energies and the dissipated power of the slots."""
    if f.quick > 0:
        f.entire[3](f.z, f.z)
        return
    clear(3, f.books)
    for k in range(f.pieces):
        f.energies[k](f.z, f.books)


def stand(f: Flat) -> None:
    """Put nodes where the step sets out from, to the last bit: a turn by nothing leaves one in the last digit."""
    for i in range(f.nodes):
        put_six(f.z[NODE_SLOT * i :], f.pose[_POSE * i :])
        put_six(f.z[NODE_SLOT * i + 6 :], f.pose[_POSE * i + 6 :])


def keep(f: Flat) -> None:
    """Take the end of the step as the start of the next."""
    for k in range(f.wholes):
        retain(f, k)
    retain_parted(f)
    for i in range(f.drives):
        f.driven[i] = f.found[i]
    for i in range(0, f.padded, 8):
        put(f.q[i:], eight(f.q[i:]) + eight(f.step[i:]))


def keep_tiles(f: Flat) -> None:
    """Put the nodes where the step takes them, and take that as the start of the next, tile by tile."""
    move_parted(f)
    for k in range(f.tiles.count):
        place_tile(f, k)
        for i in range(f.tiles.nodes[k], f.tiles.nodes[k + 1]):
            retain(f, i)
        for i in range(f.tiles.freedoms[k], f.tiles.freedoms[k + 1], 8):
            put(f.q[i:], eight(f.q[i:]) + eight(f.step[i:]))
    retain_parted(f)


def retain(f: Flat, k: int) -> None:
    """Take the place of a whole node as the one at the start of the next step."""
    i = f.whole[2 * k]
    put_six(f.pose[_POSE * i :], f.z[NODE_SLOT * i :])
    put_six(f.pose[_POSE * i + 6 :], f.z[NODE_SLOT * i + 6 :])


def retain_parted(f: Flat) -> None:
    """Take those of other nodes."""
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
