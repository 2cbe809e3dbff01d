"""The join table: which nodal freedoms are the same, which are free and which are held."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import field
from typing import TYPE_CHECKING

from flexctrl.errors import StructureError
from flexctrl.frozen import frozen
from flexctrl.structure.drives import Drive
from flexctrl.structure.freedoms import FREEDOMS, IDENTIFIERS, Vector, check_whole, listed, numbers
from flexctrl.structure.joints import Joint, main_axis
from flexctrl.structure.nodes import Node
from flexctrl.structure.relations import Copy, Follow, Group, Ride, Track, Turn
from flexctrl.structure.ties import tie

if TYPE_CHECKING:
    from matplotlib.figure import Figure


Row = tuple[int, int, int, int, int, int]


@frozen
class JoinTable:
    """(node, freedom) → number of the structure's degree of freedom; 0 is held.

    Nodes are numbered from 1 in the order of the parts, degrees of freedom from 1 in the order of
    the rows; drive source angles come last. A freedom marked in ``relative`` follows its number in
    the axes of a moving master (a hinge in space, a point of a rigid body); at rest it is as the table says.

    Attributes
    ----------
    rows : tuple of 6-tuples of int
        One row a node: u, v, w, θx, θy, θz.
    drives : tuple of 6-tuples of int
        One row a drive source angle, its number in the column of the driven freedom.
    labels : tuple of str
        What each node row is, e.g. ``"girder 0"``.
    drive_labels : tuple of str
        Names of the drives.
    relative : frozenset of (int, int)
        (row, column) of the cells that follow a master in the master's axes.

    Examples
    --------
    >>> print(JoinTable.from_rows([(0, 0, 0), (1, 2, 3), (1, 2, 3), (4, 5, 6)], columns="u v θz"))
    Node |  u  v θz
       1 |  0  0  0
       2 |  1  2  3
       3 |  1  2  3
       4 |  4  5  6
    """

    rows: tuple[Row, ...]
    drives: tuple[Row, ...] = ()
    labels: tuple[str, ...] = ()
    drive_labels: tuple[str, ...] = ()
    relative: frozenset[tuple[int, int]] = field(default_factory=frozenset)

    def __post_init__(self) -> None:
        for i, row in enumerate((*self.rows, *self.drives), 1):
            _check_row(row, 6, i)
        numbers = sorted({n for row in (*self.rows, *self.drives) for n in row} - {0})
        if numbers != list(range(1, len(numbers) + 1)):
            missing = next(i for i, n in enumerate(numbers, 1) if i != n)
            raise StructureError(
                f"JoinTable: degrees of freedom are numbered 1…{len(numbers)} without gaps; {missing} is missing"
            )
        own = max((n for row in self.rows for n in row), default=0)
        for i, row in enumerate(self.drives, 1):
            if sorted(row)[-2:] != [0, own + i]:
                raise StructureError(
                    f"JoinTable: the source angle of drive {i} has the row {row}; expected one number of its own, "
                    f"{own + i}: source angles come last, in the order of the drives"
                )

    @classmethod
    def from_rows(
        cls,
        rows: Sequence[Sequence[int]],
        columns: str = "u v w θx θy θz",
        drives: Sequence[Sequence[int]] = (),
    ) -> JoinTable:
        """Make a table from the numbers as the paper prints them.

        Parameters
        ----------
        rows : sequence of sequence of int
            One row a node; 0 is held.
        columns : str
            Which freedoms the columns are; the others are held.
        drives : sequence of sequence of int
            One row a drive source angle, after the nodes.

        Returns
        -------
        JoinTable

        Raises
        ------
        StructureError
            For rows of the wrong width, negative numbers, or numbers with gaps.
        """
        places = _columns(columns)

        def widen(row: Sequence[int], i: int) -> Row:
            _check_row(row, len(places), i)
            full = [0] * 6
            for place, number in zip(places, row, strict=True):
                full[place] = int(number)
            return tuple(full)  # type: ignore[return-value]

        nodes = listed(rows, "JoinTable: rows")
        return cls(
            rows=tuple(widen(r, i) for i, r in enumerate(nodes, 1)),
            drives=tuple(widen(r, i) for i, r in enumerate(listed(drives, "JoinTable: drives"), len(nodes) + 1)),
        )

    @property
    def free(self) -> int:
        """Number of the structure's degrees of freedom."""
        return max((n for row in (*self.rows, *self.drives) for n in row), default=0)

    def columns(self, columns: str) -> tuple[tuple[int, ...], ...]:
        """Return the node rows reduced to some freedoms, e.g. ``"u v θz"``.

        Parameters
        ----------
        columns : str

        Returns
        -------
        tuple of tuple of int
        """
        places = _columns(columns)
        return tuple(tuple(row[i] for i in places) for row in self.rows)

    def plot(self) -> Figure:
        """Draw the table: what is tied has one colour, what is held is grey.

        Returns
        -------
        matplotlib.figure.Figure
        """
        from flexctrl.plots.join_table import join_table_figure

        return join_table_figure(self)

    def __str__(self) -> str:
        everything = (*self.rows, *self.drives)
        places = [i for i in range(6) if any(row[i] for row in everything)] or list(range(6))
        if places == [0, 1] or places == [5]:
            places = [0, 1, 5]
        heads = [str(i) for i in range(1, len(self.rows) + 1)]
        heads += [f"θd {name}" for name in self.drive_labels or ("",) * len(self.drives)]
        wide = max(map(len, [*heads, "Node"]))
        digits = max(2, len(str(self.free)))
        lines = [f"{'Node':>{wide}} | " + " ".join(f"{FREEDOMS[i]:>{digits}}" for i in places)]
        for r, (head, row) in enumerate(zip(heads, everything, strict=True)):
            cells = [f"{row[i]}{'~' if (r, i) in self.relative else ''}" for i in places]
            label = f"  {self.labels[r]}" if r < len(self.labels) else ""
            lines.append(f"{head:>{wide}} | " + " ".join(f"{c:>{digits}}" for c in cells) + label)
        if self.relative:
            lines.append("~ follows a master node in the master's axes")
        return "\n".join(line.rstrip() for line in lines)


def _check_row(row: Sequence[int], width: int, number: int) -> None:
    owner = f"JoinTable: row {number}"
    if len(numbers(row)) != width:
        raise StructureError(f"{owner} is {row!r}; expected {width} whole numbers ≥ 0")
    for n in row:
        check_whole(n, "number", owner, least=0)


def _columns(columns: str) -> list[int]:
    names = columns.split() if isinstance(columns, str) else [columns]
    known = {n: i for i, n in enumerate(FREEDOMS)} | {n: i for i, n in enumerate(IDENTIFIERS)}
    unknown = [n for n in names if not isinstance(n, str) or n not in known]
    if unknown or not names:
        given = f"no freedom {unknown[0]!r}" if unknown else "no columns given"
        raise StructureError(f"JoinTable: {given}; columns are some of {' '.join(FREEDOMS)}")
    if len({known[n] for n in names}) < len(names):
        raise StructureError(f"JoinTable: columns {columns!r} name a freedom twice")
    return [known[n] for n in names]


def join(
    nodes: Sequence[Node],
    joints: Sequence[Joint],
    drives: Sequence[Drive],
    groups: Sequence[Group],
    tracks: Sequence[Track] = (),
) -> JoinTable:
    """Make the join table of some nodes from their joints.

    Parameters
    ----------
    nodes : sequence of Node
        All nodes in order.
    joints : sequence of Joint
    drives : sequence of Drive
    groups : sequence of Group
        Rigid parts, whose points follow each other.
    tracks : sequence of Track
        What travels along beams.

    Returns
    -------
    JoinTable
    """
    ties = tie(nodes, joints, groups, tracks)
    rows = [list(row) for row in ties.cells]
    relative: set[tuple[int, int]] = set()
    for follow in ties.follows:
        columns = _columns_of(follow)
        for f in columns:
            rows[follow.node][f] = rows[follow.master][f]
            if (follow.master, f) in relative or _skew(follow, nodes):
                relative.add((follow.node, f))
        axis = _axis_of(follow)
        if isinstance(follow, Ride | Turn) and axis is not None:
            rows[follow.node][columns[0] + main_axis(axis)] = follow.own
    return JoinTable(
        rows=tuple(tuple(row) for row in rows),  # type: ignore[misc]
        drives=tuple(drive_row(d, ties.free + k) for k, d in enumerate(drives, 1)),
        labels=tuple(f"{n.part} {n.index}" for n in nodes),
        drive_labels=tuple(d.name for d in drives),
        relative=frozenset(relative),
    )


def _columns_of(follow: Follow) -> range:
    if isinstance(follow, Copy):
        return range(3, 6) if follow.freedom == 3 else range(follow.freedom, follow.freedom + 1)
    return range(3, 6) if isinstance(follow, Turn) else range(3)


def _axis_of(follow: Follow) -> Vector | None:
    if isinstance(follow, Turn):
        return follow.axis
    return follow.along if isinstance(follow, Ride) else None


def _skew(follow: Follow, nodes: Sequence[Node]) -> bool:
    """Tell whether the row does not say it all: a lever arm, or an axis that is not a global one."""
    if isinstance(follow, Copy | Track):
        return isinstance(follow, Track)
    axis = _axis_of(follow)
    if axis is not None:
        return abs(axis[main_axis(axis)]) < 1.0 - 1e-12
    return math.dist(nodes[follow.node].position, nodes[follow.master].position) > 0.0


def drive_row(drive: Drive, number: int) -> Row:
    """Return a source angle's row: its number in the column nearest to the driven freedom."""
    row = [0] * 6
    row[drive.column + main_axis(drive.direction)] = number
    return tuple(row)  # type: ignore[return-value]


__all__ = ["JoinTable", "join"]
