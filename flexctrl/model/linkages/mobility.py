"""From a structure to its motion: which nodes lead, which follow, and how loops of rigid parts close."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from flexctrl.effects.effect import Inner
from flexctrl.errors import StructureError
from flexctrl.frozen import frozen
from flexctrl.kernels.kernel import Backend
from flexctrl.mechanics.rotation import cross
from flexctrl.model.linkages.levers import long_or_short
from flexctrl.model.linkages.linkage import Linkage
from flexctrl.model.linkages.open_linkage import Link, Loop, renumbered, span_of
from flexctrl.model.linkages.rounds import going_round
from flexctrl.model.linkages.twists import Twists
from flexctrl.model.motion import DENSE_UP_TO, Motion
from flexctrl.model.state import Dry, State
from flexctrl.model.units import TURNS
from flexctrl.structure.freedoms import FREEDOMS, IDENTIFIERS, TRAVEL, Vector
from flexctrl.structure.join_table import JoinTable
from flexctrl.structure.joints import main_axis
from flexctrl.structure.relations import Closure, Fit, Follow, Group, Ride, Ties, Track, Turn
from flexctrl.structure.structure import Structure
from flexctrl.structure.ties import tie

_INDEPENDENT, _FELT_ON_RAILS = 1e-9, 1e-3
_PROBE, _OPENS = 1e-4, 1e-5
_NAMED = 8
_HARMLESS = "it is one condition too many, which is harmless: where they can move they do not open it"
_LOCKS = (
    "it is left free to second order, as parts in line are: a run or an equilibrium that opens it fails. Draw them off "
    "that line, leave one flexible, or free the end along it"
)


def motion_of(
    structure: Structure,
    rigid: tuple[Group, ...],
    elastic: tuple[str, ...],
    backend: Backend,
    inner: tuple[Inner, ...] = (),
) -> Motion:
    """Work out how the nodes of a structure move.

    Parameters
    ----------
    structure : Structure
    rigid : tuple of Group
        Parts that do not deform, rigid bodies included.
    elastic : tuple of str
        Drives with an elastic shaft, whose source angle is a degree of freedom.
    backend : Backend
    inner : tuple of Inner
        Freedoms of effects that no node has.

    Returns
    -------
    Motion

    Raises
    ------
    StructureError
        If rigid parts are asked of a machine that is tied by a table of numbers.
    """
    ties = _ties(structure, rigid)
    open_loop = _motion(structure, ties, elastic, inner, backend, _Loops())
    if not ties.closures:
        return open_loop
    return _motion(structure, ties, elastic, inner, backend, _loops(structure, open_loop, ties))


def _ties(structure: Structure, rigid: tuple[Group, ...]) -> Ties:
    if isinstance(structure.joints, JoinTable):
        if rigid:
            raise StructureError(
                f"structure {structure.name!r} is tied by a join table of numbers; rigid parts need joints to ride on"
            )
        table = structure.joints
        numbers = {n for row in table.rows for n in row}
        return Ties(table.rows, (), (), (), max(numbers, default=0))
    return tie(structure.nodes, structure.joints, rigid, structure.tracks)


@frozen
class _Loops:
    """Independent closures, the degrees of freedom that depend on others through them, closures left out, and notes."""

    closures: tuple[Closure | Fit, ...] = ()
    dependent: tuple[int, ...] = ()
    spare: tuple[Closure | Fit, ...] = ()
    notes: tuple[str, ...] = ()


def _motion(
    structure: Structure,
    ties: Ties,
    elastic: tuple[str, ...],
    inner: tuple[Inner, ...],
    backend: Backend,
    loops: _Loops,
) -> Motion:
    own = [*_names(structure, ties), *(f"{name}_source" for name in elastic)]
    names = [*own, *(i.name for i in inner if i.name)]
    kept = [i for i in range(len(names)) if i not in loops.dependent]
    number = np.full(len(names) + 1, len(kept))
    number[kept] = np.arange(len(kept))
    cells = np.array([*ties.cells, (0,) * 6])
    open_place = np.where(cells > 0, cells - 1, len(names))
    x = np.array([*(n.position for n in structure.nodes), (0.0, 0.0, 0.0)])
    R = np.broadcast_to(np.eye(3), (len(x), 3, 3)).copy()
    zero = np.zeros(len(kept))
    after = {name: ties.free + i for i, name in enumerate(elastic)}
    sources = number[np.array([after.get(d.name, len(names)) for d in structure.drives], dtype=int)]
    last = iter(range(len(own), len(names)))
    linkage, nodes, linked = _linkage(structure, ties, elastic, x, open_place, loops)
    twists = Twists.of(structure)
    return Motion(
        names=tuple(names[i] for i in kept),
        place=number[open_place],
        sources=sources,
        drives=structure.drives,
        backend=backend,
        linkage=linkage,
        nodes=nodes,
        linked=number[linked],
        rest=State(
            x, R, zero, zero, np.zeros(len(structure.drives)), 0.0, Dry.loose(len(inner)), np.zeros(len(twists))
        ),
        notes=loops.notes,
        twists=twists,
        inner=number[np.array([next(last) if i.name else len(names) for i in inner], dtype=int)],
        effects=inner,
        spare=tuple(_label(structure, c) for c in loops.spare),
    )


def _linkage(
    s: Structure, ties: Ties, elastic: tuple[str, ...], x: np.ndarray, place: np.ndarray, loops: _Loops
) -> tuple[Linkage, np.ndarray, np.ndarray]:
    """Return the linkage of a structure, the numbers of its nodes and of its independent freedoms."""
    none = int(place.max(initial=0))
    sides = [(s.number(d.node), len(s.nodes) if d.against is None else s.number(d.against)) for d in s.drives]
    used = {n for f in ties.follows for n in _involved(f)} | {n for n, _ in ties.lines}
    used |= {n for pair in sides for n in pair}
    used |= set(np.flatnonzero(np.isin(place, loops.dependent).any(axis=1)).tolist())
    used |= {n for c in (*loops.closures, *loops.spare) for n in _sides(c) if n >= 0}
    nodes = sorted(used)
    local = {n: i for i, n in enumerate(nodes)}
    owns = {f.own - 1 for f in ties.follows if isinstance(f, Ride | Turn) and f.own}
    every = (set(place[nodes].ravel().tolist()) - {none}) | owns
    independent = sorted(every - set(loops.dependent))
    order = {number: i for i, number in enumerate([*independent, *loops.dependent])}
    cells = [[order.get(k, len(order)) for k in row] for row in place[nodes].tolist()]
    own = {k + 1: i + 1 for k, i in order.items()}
    linkage = Linkage(
        cells=np.array(cells, dtype=int).reshape(-1, 6),
        rest=x[nodes],
        follows=tuple(renumbered(f, local, own) for f in ties.follows),
        lines=tuple((local[n], _line_axes(along)) for n, along in ties.lines),
        links=tuple(
            Link(d, local[a], local[b], tuple((x[a] - x[b]).tolist()), d.name not in elastic)
            for d, (a, b) in zip(s.drives, sides, strict=True)
        ),
        loops=tuple(_local(c, local) for c in loops.closures),
        free=len(independent),
        spare=tuple(_local(c, local) for c in loops.spare),
    )
    return long_or_short(linkage), np.array(nodes, dtype=int), np.array(independent, dtype=int)


def _involved(follow: Follow) -> tuple[int, ...]:
    """The nodes a follower has to do with."""
    if isinstance(follow, Track):
        return (follow.node, follow.gauge, *follow.rail)
    return (follow.node, follow.master)


def _sides(c: Closure | Fit) -> tuple[int, int]:
    """The two nodes of a condition; −1 for the ground."""
    return (c.node, c.master if isinstance(c, Fit) else c.other)


def _local(c: Closure | Fit, local: dict[int, int]) -> Loop | Fit:
    """Return a condition in the node numbers of a linkage."""
    node, other = (local.get(n, -1) for n in _sides(c))
    return replace(c, node=node, master=other) if isinstance(c, Fit) else Loop(node, c.freedom, other)


def _line_axes(along: Vector) -> np.ndarray:
    """Axes (columns) whose main one is the line; ties hold the turn about it. They point as the global ones do."""
    main = main_axis(along)
    line = np.sign(along[main]) * np.array(along)
    axes = np.eye(3)
    side = np.cross(line, axes[:, (main + 1) % 3])
    axes[:, (main + 2) % 3] = side / np.linalg.norm(side)
    axes[:, (main + 1) % 3] = np.cross(axes[:, (main + 2) % 3], line)
    axes[:, main] = line
    return axes


def _names(structure: Structure, ties: Ties) -> list[str]:
    """Name each degree of freedom after the first node that has it: ``part_index_freedom``."""
    names = [""] * ties.free
    for follow in ties.follows:
        if isinstance(follow, Ride | Turn) and follow.own:
            node = structure.nodes[follow.node]
            kind = "turn" if isinstance(follow, Turn) else "slide"
            names[follow.own - 1] = f"{node.part}_{node.index}_{kind}"
    for node, row in zip(structure.nodes, ties.cells, strict=True):
        for f, number in enumerate(row):
            if number > 0 and not names[number - 1]:
                own = "slide" if node.freedoms == TRAVEL else f"{node.index}_{IDENTIFIERS[f]}"
                names[number - 1] = f"{node.part}_{own}"
    return names


def _loops(structure: Structure, motion: Motion, ties: Ties) -> _Loops:
    """Choose which closures are independent, and which degrees of freedom shall follow from the others."""
    unit = np.where([name.endswith(TURNS) for name in motion.names], 1.0, span_of(motion.rest.x))
    rows = _openings(motion, motion.rest, ties.closures) * unit
    moved = motion.advance(motion.rest, 0.1 * unit * np.cos(np.arange(motion.n)), motion.rest.v, 0.0)
    turned = _openings(motion, moved, ties.closures)
    kept = np.abs(rows).max(axis=1, initial=0.0) + np.abs(turned).max(axis=1, initial=0.0) > 0.0
    chosen = _independent(rows.T, _INDEPENDENT)
    dependent = _independent(rows[chosen] * _lasting(ties, motion.n), _INDEPENDENT)
    if dependent and not motion.linkage.tracks:
        independent = tuple(ties.closures[i] for i in chosen)
        felt = (np.abs(rows) + np.abs(turned) > 0.0)[chosen]
        dependent = going_round(motion, lambda s: _openings(motion, s, independent) * unit, unit, felt, dependent)
    spare = [i for i in range(len(rows)) if kept[i] and i not in chosen]
    opens = _opens(motion, ties.closures, rows, chosen)
    labels = [_label(structure, c) for c in ties.closures]
    notes = [f"{labels[i]} is held by rigid parts already; {_LOCKS if opens[i] else _HARMLESS}" for i in spare]
    if chosen:
        tied, through = _first([motion.names[i] for i in dependent]), _first([labels[i] for i in chosen])
        notes.append(f"{tied} given by the others through {through}")
    closures, left = ([ties.closures[i] for i in some] for some in (chosen, spare))
    return _Loops(tuple(closures), tuple(dependent), tuple(left), tuple(notes))


def _first(names: list[str]) -> str:
    """The first of some names, and how many there are beside them."""
    more = f" and {len(names) - _NAMED} more" if len(names) > _NAMED else ""
    return ", ".join(names[:_NAMED]) + more


def _lasting(ties: Ties, count: int) -> np.ndarray:
    """Return what to weigh each degree of freedom with where some are to follow from others.

    Those of a rail least: a trolley feels the node behind it less and less, and beyond the next one not at all.
    """
    rails = {node for f in ties.follows if isinstance(f, Track) for node in f.rail}
    weights = np.ones(count)
    weights[[k - 1 for node in rails for k in ties.cells[node] if k > 0]] = _FELT_ON_RAILS
    return weights


def _opens(motion: Motion, closures: tuple[Closure | Fit, ...], rows: np.ndarray, chosen: list[int]) -> np.ndarray:
    """Tell which closures open to second order as the machine moves, the chosen ones closed.

    With J q̇ = 0 and J_s = Λ J at rest, gap_s'' = (J_s' − Λ J') q̇: what the accelerations do cancels.
    """
    J = rows[chosen]
    way = np.cos(1.0 + np.arange(motion.n))
    way = way - np.linalg.lstsq(J, J @ way, rcond=_INDEPENDENT)[0] if chosen else way
    unit = np.where([name.endswith(TURNS) for name in motion.names], 1.0, span_of(motion.rest.x))
    ahead, behind = (motion.advance(motion.rest, s * _PROBE * unit * way, motion.rest.v, 0.0) for s in (1.0, -1.0))
    change = (_openings(motion, ahead, closures) - _openings(motion, behind, closures)) * unit @ way / (2.0 * _PROBE)
    if chosen:
        change = change - np.linalg.lstsq(J.T, rows.T, rcond=_INDEPENDENT)[0].T @ change[chosen]
    return np.abs(change) > _OPENS


def _openings(motion: Motion, state: State, closures: tuple[Closure | Fit, ...]) -> np.ndarray:
    """Return how fast each loop opens with each degree of freedom, in radians or shares of the machine."""
    rates, span = _rates(motion, state, closures), span_of(motion.rest.x)
    turns = [c.freedom >= 3 if isinstance(c, Closure) else c.axis is not None for c in closures]
    return np.array([_opening(rates, state, c) for c in closures]) / np.where(turns, 1.0, span)[:, None]


def _rates(motion: Motion, state: State, closures: tuple[Closure | Fit, ...]) -> dict[int, np.ndarray]:
    """Return how fast the nodes of conditions move with each degree of freedom, shape (6, n); the ground does not."""
    nodes = sorted({n for c in closures for n in _sides(c) if n >= 0})
    rows = (6 * np.array(nodes, dtype=int)[:, None] + np.arange(6)).ravel()
    T = motion.dense_jacobian(state)[rows] if motion.n <= DENSE_UP_TO else motion.jacobian(state)[rows].toarray()
    return {-1: np.zeros((6, motion.n)), **dict(zip(nodes, T.reshape(len(nodes), 6, motion.n), strict=True))}


def _opening(rates: dict[int, np.ndarray], state: State, c: Closure | Fit) -> np.ndarray:
    node, other = (rates[n] for n in _sides(c))
    if isinstance(c, Closure):
        return node[c.freedom] - other[c.freedom]
    across = state.R[c.master] @ c.across
    if c.axis is not None:
        return cross(state.R[c.node] @ c.axis, across) @ (node[3:] - other[3:])
    return across @ (node[:3] - other[:3]) + cross(across, state.x[c.node] - state.x[c.master]) @ other[3:]


def _independent(A: np.ndarray, tolerance: float) -> list[int]:
    """Return columns of A that span all of them, the largest first (QR with column pivoting)."""
    if not A.size:
        return []
    from scipy.linalg import qr

    _, R, order = qr(A, mode="economic", pivoting=True)
    rank = int(np.count_nonzero(np.abs(np.diag(R)) > tolerance))
    return sorted(int(i) for i in order[:rank])


def _label(structure: Structure, c: Closure | Fit) -> str:
    node = structure.nodes[c.node]
    return f"{node} on {structure.nodes[c.master]}" if isinstance(c, Fit) else f"{FREEDOMS[c.freedom]} of {node}"
