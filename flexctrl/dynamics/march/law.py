"""A sampled law in compiled loops: what it reads and says, from sample to sample."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from flexctrl.dynamics.feed import Feed
from flexctrl.dynamics.said import FAULTS
from flexctrl.kernels.kernel import Compiled
from flexctrl.kernels.native import Reals, Runs, Wholes
from flexctrl.model.flat.flat import clear

if TYPE_CHECKING:
    from flexctrl.design.lowering import Lowered

__all__ = ["Law", "Sampling", "enter_inputs", "enter_leg", "no_law", "obeyed", "said"]

_AHEAD = 4096


@dataclass
class Law:
    """A law, and what became of its samples.

    Attributes
    ----------
    outputs, inputs, states, clocks, commands : int
        Of the machine; of the law: its states, what depends on time alone, its commands.
    step : Runs
        The kernel.
    work, answer : Reals
        What it reads: outputs, its states, the clocks. What it says: commands, states at the next sample.
    writes : Wholes
        The inputs commanded.
    base, u : Reals
        Inputs under the commands; inputs in force.
    table : Reals
        Clocks at coming samples, one row a sample.
    told : Reals
        One row a leg: its start, the length of its steps, their number, inputs and states of the law in force.
    rows, before : Reals
        Inputs in force from each step's end on; those before a sample.
    period, pace, last, nearly : float
        Between samples; steps of one length, 0: controlled ones; no sample after this, and none from this on [s].
    passed, first, samples : int
        Samples that are over; the first one in the table, and how many it has.
    legs, wanted, room : int
        Rows told; how many there may be; how many steps there is room for.
    away, start, begun, size : int, float
        Whether a leg is under way: the step it starts with, its time, and the length of its steps.
    """

    outputs: int
    inputs: int
    states: int
    clocks: int
    commands: int
    step: Runs
    work: Reals
    answer: Reals
    writes: Wholes
    base: Reals
    u: Reals
    table: Reals
    told: Reals
    rows: Reals
    before: Reals
    period: float = 0.0
    pace: float = 0.0
    last: float = 0.0
    nearly: float = 0.0
    passed: int = 0
    first: int = 0
    samples: int = 0
    legs: int = 0
    wanted: int = 0
    room: int = 0
    away: int = 0
    start: int = 0
    begun: float = 0.0
    size: float = 0.0


def no_law() -> Law:
    """Return the law of a run without one."""
    empty, none = np.zeros(0), np.zeros(0, dtype=int)
    return Law(0, 0, 0, 0, 0, (), empty, empty, none, empty, empty, empty, empty, empty, empty)


@dataclass(eq=False)
class Sampling:
    """A sampled controller ready for compiled loops.

    Attributes
    ----------
    feed : Feed
    backend : Compiled
    u : numpy.ndarray
        The machine's inputs in force.
    room : int
        Steps in one call.
    """

    feed: Feed
    backend: Compiled
    u: np.ndarray
    room: int
    law: Law = field(init=False)

    def __post_init__(self) -> None:
        found, model = self.feed.lowered, self.feed.model
        assert found is not None
        n, m = len(model.outputs), len(model.inputs)
        commands = found.kernel.n_out - found.states
        work, answer = np.zeros(n + found.states + len(found.clocks)), np.zeros(found.kernel.n_out)
        gather = np.concatenate([self.feed.reads, n + np.arange(found.states + len(found.clocks))])
        run = found.bound(self.backend, gather)
        self.law = Law(
            outputs=n,
            inputs=m,
            states=found.states,
            clocks=len(found.clocks),
            commands=commands,
            step=(run,),
            work=work,
            answer=answer,
            writes=np.array(self.feed.writes, dtype=int),
            base=np.array(self.feed.base, dtype=float),
            u=self.u,
            table=np.zeros(_AHEAD * len(found.clocks)),
            told=np.zeros((3 + m + found.states) * self.room),
            rows=np.zeros(m * self.room),
            before=np.zeros(m),
            period=self.feed.sample_time,
            room=self.room,
        )

    def serves(self, feed: Feed) -> bool:
        """Tell whether this can be the controller of another feed: the same law on the same signals."""
        mine, same = self.feed, feed.lowered is self.feed.lowered and feed.model is self.feed.model
        same = same and mine.sample_time == feed.sample_time
        return same and mine.reads.tolist() == feed.reads.tolist() and mine.writes == feed.writes

    def serve(self, feed: Feed) -> None:
        """Be that controller from now on."""
        self.feed = feed
        self.law.base[:] = feed.base

    @property
    def state(self) -> np.ndarray:
        """The law's state in force."""
        law = self.law
        return law.work[law.outputs : law.outputs + law.states]

    def ahead(self, passed: int, last: float) -> tuple[int, int]:
        """Return the first sample of the table and how many there are, worked out for those to come."""
        count = max(1, min(_AHEAD, math.ceil(last / self.law.period) - passed + 1))
        found = self.feed.lowered
        assert found is not None
        try:
            rows = found.samples(passed + 1, count, self.law.period)
        except (*FAULTS, KeyboardInterrupt):
            rows = _until_one_fails(found, np.arange(passed + 1, passed + 1 + count) * self.law.period)
        self.law.table[: rows.size] = rows.ravel()
        return passed, len(rows)


def _until_one_fails(found: Lowered, times: np.ndarray) -> np.ndarray:
    """The rows of the instants before a function of time fails: it is to do so when its time has come."""
    rows = []
    for t in times.tolist():
        try:
            rows.append(found.now(t))
        except (*FAULTS, KeyboardInterrupt):
            break
    return np.array(rows).reshape(-1, len(found.clocks))


def said(law: Law, y: Reals) -> bool:
    """Ask the law at a sample; tell whether what it says, left in ``answer``, are numbers."""
    own = law.work[law.outputs :]
    for i in range(law.outputs):
        law.work[i] = y[i]
    now = law.table[law.clocks * (law.passed - law.first) :]
    for i in range(law.clocks):
        own[law.states + i] = now[i]
    clear(law.commands + law.states, law.answer)
    law.step[0](law.work, law.answer)
    total = 0.0
    for i in range(law.commands + law.states):
        total += law.answer[i]
    return math.isfinite(total)


def obeyed(law: Law) -> bool:
    """Put what the law has said in force; tell whether inputs change."""
    own = law.work[law.outputs :]
    for i in range(law.inputs):
        law.before[i] = law.u[i]
        law.u[i] = law.base[i]
    for k in range(law.commands):
        law.u[law.writes[k]] += law.answer[k]
    for i in range(law.states):
        own[i] = law.answer[law.commands + i]
    changed = False
    for i in range(law.inputs):
        if law.u[i] != law.before[i]:
            changed = True
    return changed


def enter_leg(law: Law, steps: int) -> None:
    """Write down a leg."""
    row = law.told[(3 + law.inputs + law.states) * law.legs :]
    row[0] = law.begun
    row[1] = law.size
    row[2] = float(steps)
    for i in range(law.inputs):
        row[3 + i] = law.u[i]
    for i in range(law.states):
        row[3 + law.inputs + i] = law.work[law.outputs + i]
    law.legs += 1


def enter_inputs(law: Law, first: int, last: int) -> None:
    """Write down the inputs in force from the ends of some steps on."""
    for k in range(first, last):
        row = law.rows[law.inputs * k :]
        for i in range(law.inputs):
            row[i] = law.u[i]
