"""What compiled steps know of a continuous law."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flexctrl.kernels.native import Reals, Runs, Wholes

__all__ = ["Answer", "no_answer"]


@dataclass
class Answer:
    """A continuous law, and what it has said; see `flexctrl.design.answers`.

    Attributes
    ----------
    outputs, inputs : int
        Of the machine.
    states, clocks, commands, width : int
        Of the law: its states, what depends on time alone, its commands, coefficients of what depends on time.
    step, slope : Runs
        The kernels.
    work, answer : Reals
        What they read: outputs, the law's state near the end of the step, state and rate at the start, clocks. What it
        says: commands, and the rate there.
    slopes, factors, order : Reals, Reals, Wholes
        ∂f/∂x of the law's rate f; what `flexctrl.kernels.dense` has made of 1 − h/2 ∂f/∂x.
    off : Reals
        What is left of the trapezoidal rule, and what it asks for.
    writes : Wholes
        The inputs commanded.
    base, u, last, trend, said : Reals
        Inputs under the commands; inputs guessed, those at the start of the step, their rates over the one before,
        and what the law says they are.
    inverse, gap, before, change, felt, row : Reals
        Of Broyden's method: minus the inverse of the gap's slope; what the law says beside the guess, now and before
        it was changed; by how much that was; room.
    way : Reals
        The step as it was before the last change of the inputs.
    powers, origins : Reals
        What depends on time: falling powers of the time since some instant, one row a clock; these instants.
    told : Reals
        One row a step: inputs, state and rate of the law at its end.
    asked, answers : Reals
        Rows of what the law reads, and of its commands.
    sides, kept : Reals
        Rates of the law's state in the last two tries; room.
    bend, reached : Reals
        How fast its rate changed over the last step, and how large it has been.
    spoken : int
        Whether Python is asked; see `spoken`.
    bent : int
        Whether there was such a step.
    changing : int
        How many entries of ∂f/∂x are not the same for good.
    reading : int
        How many outputs it reads; 0: what it commands depends on time and its state alone.
    tries, still, wanted : int
        How often the inputs were put right in this step, how often that moved nothing; rows to be answered.
    most, span : float
        The largest gap; the length of step that the factors are for.
    """

    outputs: int
    inputs: int
    states: int
    clocks: int
    commands: int
    width: int
    step: Runs
    slope: Runs
    work: Reals
    answer: Reals
    slopes: Reals
    factors: Reals
    order: Wholes
    off: Reals
    writes: Wholes
    base: Reals
    u: Reals
    last: Reals
    trend: Reals
    said: Reals
    inverse: Reals
    gap: Reals
    before: Reals
    change: Reals
    felt: Reals
    row: Reals
    way: Reals
    powers: Reals
    origins: Reals
    told: Reals
    asked: Reals
    answers: Reals
    sides: Reals
    kept: Reals
    bend: Reals
    reached: Reals
    spoken: int = 0
    bent: int = 0
    changing: int = 0
    reading: int = 0
    tries: int = 0
    still: int = 0
    wanted: int = 0
    most: float = 0.0
    span: float = 0.0


def no_answer() -> Answer:
    """Return what there is without a continuous law."""
    e, none = np.zeros(0), np.zeros(0, dtype=int)
    tail = e, e, e, e, e, e, e, e, e, e, e, e, e, e, e, e, e, e, e, e, e
    return Answer(0, 0, 0, 0, 0, 0, (), (), e, e, e, e, none, e, none, *tail)
