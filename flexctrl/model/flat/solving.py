"""Solving with a matrix that has been eliminated by fronts, in compiled loops.

As long as all of it is in a near cache, what takes time is waiting: for the product before in a sum, and for entries
written one by one that are read eight at once. So rows are summed up side by side, and copied eight at a time.
"""

from __future__ import annotations

from flexctrl.kernels.eights import add_six, ahead, eight, put, put_six
from flexctrl.kernels.native import Reals, Wholes
from flexctrl.model.flat.fronts import NODE, Fronts

__all__ = ["copy_on", "solve", "solve_own"]

_SOON = 144
"""Numbers until what is read backwards is fetched: two fronts of a chain. Memory does not see that coming by itself."""
_FORTH, _BACK = 1152, 576
"""The same of fronts of a node, in both directions: 16 of them. They are those of models that fit no near cache."""


def solve_own(f: Fronts, down: Reals, up: Reals, b: Reals, work: Reals, wide: Reals) -> None:
    """Solve in place for the degrees of freedom, nothing being on the other unknowns; these need ``wide``."""
    if f.beyond > 0:
        for i in range(f.n):
            wide[i] = 0.0
        for i in range(f.n - f.beyond):
            wide[f.seats[i]] = b[i]
        solve(f, down, up, wide, work)
        for i in range(f.n - f.beyond):
            b[i] = wide[f.seats[i]]
    else:
        solve(f, down, up, b, work)


def solve(f: Fronts, down: Reals, up: Reals, b: Reals, work: Reals) -> None:
    """Solve in place with a factorised matrix."""
    below = 0
    for s in range(f.count):
        pivots = f.pivots[s]
        own = b[f.first[s] :]
        if f.onto[s] < 0:
            size = f.size[s]
            others = f.others[f.rest[s] :]
            forward(pivots, size, own, down[below:], work)
            copy_on(pivots, work, own)
            for i in range(pivots, size):
                b[others[i - pivots]] += work[i]
            below += pivots * size
        elif pivots == NODE:
            fetch(2 * NODE * NODE, down[below + _FORTH :])
            node_forward(own, b[f.onto[s] :], down[below:], work)
            below += 2 * NODE * NODE
        else:
            pair_forward(own, b[f.onto[s] :], down[below:], work)
            below += 6 * NODE * NODE
    right = f.right
    for s in range(f.count - 1, -1, -1):
        pivots = f.pivots[s]
        own = b[f.first[s] :]
        if pivots == NODE and f.onto[s] >= 0:
            right -= NODE * NODE
            fetch(NODE * NODE, up[right - _BACK :])
            node_backward(own, b[f.onto[s] :], up[right:], work)
            continue
        rest = f.size[s] - pivots
        right -= pivots * rest
        others = f.others[f.rest[s] :]
        if pivots >= 8 and pivots <= 16:
            backward_in_place(pivots, rest, b, others, up[right:], own)
        else:
            copy_on(pivots, own, work)
            backward(pivots, rest, b, others, up[right:], work)
            copy_on(pivots, work, own)


def fetch(count: int, a: Reals) -> None:
    """Have so many numbers brought near."""
    for i in range(0, count, 8):
        ahead(a[i:])


def node_forward(own: Reals, onto: Reals, a: Reals, work: Reals) -> None:
    """Go forward from one node to the next, in twice two sums: its loops are of known length, and none is left."""
    one = own[0] * eight(a)
    two = own[0] * eight(a[8:])
    three = own[1] * eight(a[2 * NODE :])
    four = own[1] * eight(a[2 * NODE + 8 :])
    for k in range(2, NODE, 2):
        column = a[2 * NODE * k :]
        one = one + own[k] * eight(column)
        two = two + own[k] * eight(column[8:])
        three = three + own[k + 1] * eight(column[2 * NODE :])
        four = four + own[k + 1] * eight(column[2 * NODE + 8 :])
    add_six(onto, one + three)
    put(work, one + three)
    put(work[8:], two + four)
    put_six(own, work[NODE:])


def pair_forward(own: Reals, onto: Reals, a: Reals, work: Reals) -> None:
    """Go forward from two nodes to the next, in twice three sums; of twelve unknowns eight are written at once."""
    one = own[0] * eight(a)
    two = own[0] * eight(a[8:])
    three = own[0] * eight(a[16:])
    four = own[1] * eight(a[3 * NODE :])
    five = own[1] * eight(a[3 * NODE + 8 :])
    six = own[1] * eight(a[3 * NODE + 16 :])
    for k in range(2, 2 * NODE, 2):
        column = a[3 * NODE * k :]
        one = one + own[k] * eight(column)
        two = two + own[k] * eight(column[8:])
        three = three + own[k] * eight(column[16:])
        four = four + own[k + 1] * eight(column[3 * NODE :])
        five = five + own[k + 1] * eight(column[3 * NODE + 8 :])
        six = six + own[k + 1] * eight(column[3 * NODE + 16 :])
    add_six(onto, one + four)
    put(work, one + four)
    put(work[8:], two + five)
    put(work[16:], three + six)
    put_six(own, work[NODE:])
    put_six(own[NODE:], work[2 * NODE :])


def node_backward(own: Reals, onto: Reals, a: Reals, work: Reals) -> None:
    """Come back to a node from the next."""
    one = -onto[0] * eight(a)
    two = -onto[1] * eight(a[NODE:])
    for j in range(2, NODE, 2):
        one = one - onto[j] * eight(a[NODE * j :])
        two = two - onto[j + 1] * eight(a[NODE * j + NODE :])
    add_six(own, one + two)


def copy_on(n: int, x: Reals, y: Reals) -> None:
    """Copy entries, eight at a time: what was written one by one is not there yet when eight of it are read."""
    i = 0
    while n - i >= 8:
        put(y[i:], eight(x[i:]))
        i += 8
    while i < n:
        y[i] = x[i]
        i += 1


def forward(pivots: int, size: int, own: Reals, a: Reals, work: Reals) -> None:
    """Sum up columns times their unknowns, up to 24 rows side by side: each sum waits for its last product."""
    i = 0
    while size - i > 16:
        one = own[0] * eight(a[i:])
        two = own[0] * eight(a[i + 8 :])
        three = own[0] * eight(a[i + 16 :])
        for k in range(1, pivots):
            column = a[k * size + i :]
            one = one + own[k] * eight(column)
            two = two + own[k] * eight(column[8:])
            three = three + own[k] * eight(column[16:])
        put(work[i:], one)
        put(work[i + 8 :], two)
        put(work[i + 16 :], three)
        i += 24
    while i < size:
        one = own[0] * eight(a[i:])
        for k in range(1, pivots):
            one = one + own[k] * eight(a[k * size + i :])
        put(work[i:], one)
        i += 8


def backward(pivots: int, rest: int, b: Reals, others: Wholes, a: Reals, found: Reals) -> None:
    """Take columns times other unknowns from the rows of pivots."""
    for i in range(0, pivots, 8):
        one = eight(found[i:])
        for j in range(rest):
            one = one - b[others[j]] * eight(a[j * pivots + i :])
        put(found[i:], one)


def backward_in_place(pivots: int, rest: int, b: Reals, others: Wholes, a: Reals, own: Reals) -> None:
    """Do so for 8 to 16 pivots, the first eight and the last eight side by side; some may be in both."""
    last = pivots - 8
    one = eight(own)
    two = eight(own[last:])
    for j in range(rest):
        column = a[j * pivots :]
        ahead(column[-_SOON:])
        ahead(column[8 - _SOON :])
        one = one - b[others[j]] * eight(column)
        two = two - b[others[j]] * eight(column[last:])
    put(own, one)
    put(own[last:], two)
