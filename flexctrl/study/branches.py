"""Branches of a root locus: eigenvalues followed from gain to gain, with gains put in where branches bend or meet."""

from __future__ import annotations

import numpy as np
from scipy.optimize import brentq, linear_sum_assignment

from flexctrl.frozen import frozen
from flexctrl.study.loop import Loop

__all__ = ["TREMBLE", "followed", "in_s", "on_edge", "sided"]

MOST_GAINS = 400
ROOM = 100
"""Of those, gains kept for where branches meet."""

TURN = 0.1
SHORT = 0.01
CLOSEST = 1e-5
TREMBLE = 1e-10
DEADBEAT = 1e-10
"""Where z is 0 but for the rounding of the eigenvalues, which are about 1."""

SHARES = (2.0 / 3.0, 1.0 / 3.0)
"""How far from each other two branches are at gains put in before and after they meet, over what they were."""


def in_s(z: np.ndarray, dt: float) -> np.ndarray:
    """Poles or zeros of a sampled loop where they would be in the s-plane.

    Parameters
    ----------
    z : array_like of complex
    dt : float
        Sampling time, s; with 0 the points are s already.

    Returns
    -------
    numpy.ndarray of complex
        ln(z)/dt; a negative real z, which is at both ±iπ/dt, at +iπ/dt. What is 0 but for rounding (deadbeat,
        ``|z| < 1e-10``) is at −23/dt: as fast as can be told.
    """
    points = np.asarray(z, complex)
    return np.log(np.where(abs(points) < DEADBEAT, DEADBEAT, points)) / dt if dt else points


def on_edge(points: np.ndarray, dt: float) -> np.ndarray:
    """Which points of the s-plane are a negative real z, and so at both ±iπ/dt.

    Parameters
    ----------
    points : numpy.ndarray of complex
    dt : float
        Sampling time, s; 0 for continuous time, where there are none.

    Returns
    -------
    numpy.ndarray of bool
    """
    return np.asarray(abs(points.imag) * dt > np.pi * (1 - 1e-12))


def sided(loci: np.ndarray, dt: float) -> np.ndarray:
    """Branches of a sampled loop in the s-plane, each on its own side: at −iπ/dt too where z is negative.

    Parameters
    ----------
    loci : numpy.ndarray of complex, shape (N, n)
        One column a branch, z.
    dt : float
        Sampling time, s; with 0 the points are s already.

    Returns
    -------
    numpy.ndarray of complex, shape (N, n)
        See :func:`in_s`.
    """
    points = in_s(loci, dt)
    if not dt or not points.size:
        return points
    edge = on_edge(points, dt)
    known = np.where(edge, 0.0, np.sign(points.imag))
    # a pair that has met at a negative z goes on where each came from; one that begins there, where it goes
    for rows in (range(1, len(known)), range(len(known) - 2, -1, -1)):
        for i in rows:
            before = known[i - 1 if rows.step > 0 else i + 1]
            known[i] = np.where(edge[i] & (known[i] == 0), before, known[i])
    return np.where(edge & (known < 0), points.conj(), points)


def followed(loop: Loop, gains: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Closed-loop poles over the gains, one column a branch.

    Gains are put in where a step is ambiguous or bends too much, and where two branches meet on the real axis.

    Parameters
    ----------
    loop : Loop
    gains : numpy.ndarray, shape (N,)
        Ascending from 0.

    Returns
    -------
    gains : numpy.ndarray, shape (M,)
    loci : numpy.ndarray of complex, shape (M, n)
    """
    used, rows = _marched(loop, gains)
    return _met(loop, np.array(used), np.array(rows))


def _marched(loop: Loop, gains: np.ndarray) -> tuple[list[float], list[np.ndarray]]:
    used, rows = [gains[0]], [loop.closed_poles(gains[0])]
    ahead = list(gains[:0:-1])
    known: dict[float, np.ndarray] = {}
    while ahead:
        gain = ahead[-1]
        if gain not in known:
            known[gain] = loop.closed_poles(gain)
        row = _matched(_predicted(used, rows, gain), known[gain])
        between = float(np.sqrt(used[-1] * gain)) or 0.1 * gain
        spent = len(used) + len(ahead) >= MOST_GAINS - ROOM
        fine = spent or gain <= used[-1] * (1 + CLOSEST) or gain < 1e-6 * gains[1]
        sizes = _sizes(loop, row)
        if fine or not (_ambiguous(_predicted(used, rows, gain), row, sizes) or _bent(rows, row, sizes)):
            used.append(ahead.pop())
            rows.append(row)
        else:
            ahead.append(between)
    return used, rows


def _sizes(loop: Loop, row: np.ndarray) -> np.ndarray:
    """What a pole's steps are small or large beside: the size of s, as z stretches it; above what it trembles by."""
    points = np.where(abs(row) < DEADBEAT, DEADBEAT, row) if loop.dt else row
    far = abs(points * np.log(points)) if loop.dt else abs(points)
    far = np.where(loop.at_rest(row), 1e3 * loop.rest_radius, far)
    return np.asarray(np.maximum(far, TREMBLE / SHORT * float(abs(row).max(initial=0.0))))


def _predicted(used: list[float], rows: list[np.ndarray], gain: float) -> np.ndarray:
    if len(used) < 2:
        return rows[-1]
    step = (gain - used[-1]) / (used[-1] - used[-2])
    return np.asarray(rows[-1] + min(step, 3.0) * (rows[-1] - rows[-2]))


def _matched(expected: np.ndarray, poles: np.ndarray) -> np.ndarray:
    return np.asarray(poles[linear_sum_assignment(abs(expected[:, None] - poles))[1]])


def _ambiguous(expected: np.ndarray, row: np.ndarray, sizes: np.ndarray) -> bool:
    """Whether a branch lies farther from its prediction than a third of the way to its neighbour."""
    miss = abs(expected - row)
    apart = abs(row[:, None] - row)
    np.fill_diagonal(apart, np.inf)
    return bool(((miss > 0.1 * SHORT * sizes) & (miss > 0.3 * apart.min(axis=1, initial=np.inf))).any())


def _bent(rows: list[np.ndarray], row: np.ndarray, sizes: np.ndarray) -> bool:
    """Whether a branch turns by more than 6 degrees in a step long enough to be seen."""
    if len(rows) < 2:
        return False
    before, after = rows[-1] - rows[-2], row - rows[-1]
    long = (abs(before) > SHORT * sizes) & (abs(after) > SHORT * sizes)
    return bool((abs(np.angle(after[long] / before[long])) > TURN).any())


@frozen
class _Meeting:
    """A step in which a conjugate pair becomes two real poles, or the other way about."""

    step: int
    pair: tuple[int, int]
    kink: float


def _met(loop: Loop, gains: np.ndarray, loci: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The same with gains put in where branches meet, the largest kinks first."""
    most, lost = len(gains) + ROOM, set[tuple[float, int, int]]()
    while len(gains) + 2 * len(SHARES) < most:
        left = [m for m in _meetings(loop, loci) if (gains[m.step], *m.pair) not in lost]
        if not left:
            break
        worst = max(left, key=lambda m: m.kink)
        lost.add((gains[worst.step], *worst.pair))
        at = worst.step + 1
        ends = gains[worst.step : at + 1], loci[worst.step : at + 1]
        new = _meeting_gains(loop, *ends, worst.pair)
        rows = [_matched(_expected(*ends, worst.pair, k), loop.closed_poles(k)) for k in new]
        gains, loci = np.insert(gains, at, new), np.vstack([loci[:at], *rows, loci[at:]])
    return gains, loci


def _meetings(loop: Loop, loci: np.ndarray) -> list[_Meeting]:
    """Where branches meet so far from both rows that the picture would show a kink."""
    found = []
    turned = (loci.imag[:-1] != 0) != (loci.imag[1:] != 0)
    for i in np.flatnonzero(turned.any(axis=1)):
        sizes = _sizes(loop, loci[i : i + 2].mean(axis=0))
        for paired in loci[i : i + 2]:
            for a in np.flatnonzero(turned[i] & (paired.imag > 0)):
                b = int(abs(paired - paired[a].conj()).argmin())
                kink = float(abs(loci[i : i + 2, a] - loci[i : i + 2, b]).min() / sizes[a])
                if turned[i, b] and kink > 0.1 * SHORT:
                    found.append(_Meeting(int(i), (int(a), b), kink))
    return found


def _expected(gains: np.ndarray, rows: np.ndarray, pair: tuple[int, int], gain: float) -> np.ndarray:
    """Poles between two gains: a pair's mean and its squared distance are smooth where it meets, as others are."""
    share = (gain - gains[0]) / (gains[1] - gains[0])
    row = rows[0] + share * (rows[1] - rows[0])
    half = (rows[:, pair[0]] - rows[:, pair[1]]) / 2
    squared = float((half[0] ** 2 + share * (half[1] ** 2 - half[0] ** 2)).real)
    side = half[(half.imag == 0) if squared > 0 else (half.imag != 0)][0]
    apart = side / abs(side) * np.sqrt(abs(squared))
    row[list(pair)] = row[list(pair)].mean() + np.array([apart, -apart])
    return np.asarray(row)


def _meeting_gains(loop: Loop, gains: np.ndarray, rows: np.ndarray, pair: tuple[int, int]) -> np.ndarray:
    """The gain at which a pair meets, and some on either side."""

    def squared(gain: float) -> float:
        poles = _matched(_expected(gains, rows, pair, gain), loop.closed_poles(gain))
        return float(((poles[pair[0]] - poles[pair[1]]) ** 2).real)

    meet = float(brentq(squared, *gains, rtol=1e-12))
    new = [meet, *(meet + share**2 * (end - meet) for end in gains for share in SHARES)]
    return np.unique([k for k in new if gains[0] < k < gains[1]])
