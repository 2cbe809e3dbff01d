"""What a compiled march works on."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from flexctrl.dynamics.march.answer import Answer
from flexctrl.dynamics.march.closing import Closing
from flexctrl.dynamics.march.contacts import Contacts
from flexctrl.dynamics.march.corners import Corners
from flexctrl.dynamics.march.flowing import Flows
from flexctrl.dynamics.march.lagging import Lags
from flexctrl.dynamics.march.law import Law
from flexctrl.dynamics.march.probing import Probes
from flexctrl.kernels.native import Reals, Singles, Wholes
from flexctrl.model.flat.axes import Axes
from flexctrl.model.flat.fronts import Fronts
from flexctrl.model.flat.workspace import Flat
from flexctrl.model.gauges import Gauges

DONE, WANTS_TANGENT, WANTS_MASS, FAILED, SINGULAR, SHORT, CORNER, SILENT = 0, 1, 2, 3, 4, 5, 6, 7
TURNED, TURN = 8, 9
"""How a call ends: with all done; before it can go on; at a step that does not converge, or cannot be shorter; before
one that passes a corner of a law of force, or a place where a loop of rigid parts may lock; at a sample at which the
law does not say numbers; beyond a corner, anew, or where that is to be done."""

FIXED, CONTROLLED, JUMP, SETTLE, REFACTOR, WEIGH, REMADE, WEIGHED, SAMPLED, START = 0, 1, 2, 3, 4, 5, 6, 7, 8, 9
"""What to do."""

FRESH, EVALUATE, CORRECT, PRESSED = 0, 1, 2, 3
"""Where in a step it is: before it, before an iteration, with the forces of one known, or with those of the first
guess."""


@dataclass
class Factors:
    """A factorised matrix, as seen from axes that turn with the nodes.

    Attributes
    ----------
    down, up, diagonal, work, wide : Reals
        What solving reads; the sizes of its diagonal before, and room for a column and for unknowns beyond the degrees
        of freedom.
    made, turned : Reals
        Rotations of the axes when it was made, and since.
    angles : Reals
        Turning degrees of freedom without axes, when it was made.
    place : Reals
        The workspace when it was made.
    brief_down, brief_up : Singles
        What solving reads in single precision, where that may do; empty elsewhere.
    swaying : int
        Whether shear of fine beams is to be seen to; not in a matrix of masses.
    bends : Reals
        For each axis how fast turns change along such a beam, and which way it leads, seen from there as it was.
    """

    down: Reals
    up: Reals
    diagonal: Reals
    work: Reals
    wide: Reals
    made: Reals
    turned: Reals
    angles: Reals
    place: Reals
    brief_down: Singles
    brief_up: Singles
    swaying: int
    bends: Reals


@dataclass
class Leap:
    """Exact steps of linear equations.

    Its state: modal states, the first of every pair and then the second, each filled up to a multiple of eight;
    inputs; 1.

    Attributes
    ----------
    modes, size, wide : int
        Modal states, filling included; these, inputs and 1; that filled up to a multiple of eight.
    transition : Reals
        Over a step, column by column; of pairs that nothing couples (``paired``) first their own entries: first on
        first, second on first, first on second, second on second.
    state, before, after : Reals
        Where it is; at the start of the last step, and at its end.
    places, rates : Reals
        What the state adds to degrees of freedom and their rates, column by column.
    losses : Reals
        The energy dissipated over a step as a quadratic form in the state; where nothing couples pairs (``parted``)
        first their own entries, as above but for one mixed, doubled, then columns of inputs and 1, doubled.
    seen : Reals
        What the state adds to the sums that outputs are read from, to the ways of the inputs and to the arms of lines
        that have corners (3 each), column by column.
    sight : Reals
        These sums, ways and arms.
    ways : Reals
        What a unit of each degree of freedom adds to the ways of the inputs, input by input.
    sights, gliding : int
        Number of sums, ways and arms, filled up to a multiple of eight; whether corners are all read from them.
    aloft : int
        Whether the state is ahead of degrees of freedom and nodes.
    h : float
        Step that the tables are for.
    lost : float
        Dissipated over the last step.
    """

    modes: int
    size: int
    wide: int
    paired: int
    parted: int
    sights: int
    gliding: int
    transition: Reals
    state: Reals
    before: Reals
    after: Reals
    places: Reals
    rates: Reals
    losses: Reals
    seen: Reals
    sight: Reals
    ways: Reals
    aloft: int = 0
    h: float = -1.0
    lost: float = 0.0


def no_leap() -> Leap:
    """Return the leaps of a model that is not linear."""
    e = np.zeros(0)
    return Leap(0, 0, 0, 0, 0, 0, 0, e, e, e, e, e, e, e, e, e, e)


@dataclass
class March:
    """A march under way. Vectors of degrees of freedom stand in the order of elimination.

    Attributes
    ----------
    flat : Flat
    gauges : Gauges
    corners : Corners
    closing : Closing
    flows : Flows
    law : Law
    answer : Answer
    leap : Leap
    fronts : Fronts
    axes : Axes
    tangent, mass : Factors
    probes : Probes
    lags : Lags
    entries : Reals
        Fronts of the matrix that is being made.
    alpha_m, alpha_f, beta, gamma : float
        The method; see `Coefficients`.
    least, loosest, share : float
        Newton's tolerance: a share of the method's own error, within these bounds.
    tolerance, error : float
        That tolerance; by how much the method's own acceleration has changed over the last step.
    h, t : float
        Step; time.
    size, largest, stop, until : float
        Of error-controlled steps: the next one and the largest, where to end and what not to pass [s].
    relative, absolute, reached : float
        Their tolerance, and how far any degree of freedom has been from where it was first.
    parts, part, farthest : int, Wholes, Reals
        Parts of the machine that are not coupled, which one each degree of freedom belongs to, and how far each of
        them has been.
    task : int
    wanted, done, rejected : int
        Steps.
    tried, refused : float, int
        Size and count before the step under way was rejected.
    follow, cap, led, taken : int, float
        Of error-controlled steps beyond a corner, of steps of one length; see `flexctrl.dynamics.steps.Mark`.
    phase, attempt, iteration, last, contraction, strayed : int, float
        Where in a step it is.
    exact : int
        Whether steps are solved to the last digits; see `flexctrl.dynamics.alpha.newton.wanted`.
    leaping, answering : int
        Whether steps are exact ones on modal states; whether inputs follow from what is at the end of the step.
    paced : int
        Whether steps of controlled error, or from sample to sample of a law, are among the tasks.
    firmest, short : float
        Highest frequency of a line against the masses at its ends [rad/s]; by what share corrections are shortened.
    throws : int
        Whether parts may be thrown by forces that jump; see `flexctrl.dynamics.swift.thrown`.
    damping, holding : float
        What holds motions that inputs bring about, over the mass [1/s, 1/s²].
    swift : int
        1: accelerations come from kernels of the whole machine, and Newton's method takes the mass at hand for the
        tangent; 0: the machine has none; below: steps until that is tried again, after one for which it was not enough.
    whole : int
        1: forces come from kernels of the whole machine, while nodes stay where they were till the end of the step.
    habit, trusted : float, int
        How much smaller each correction has been than the one before, and in how many steps that was only believed.
    price, spent, lately, served : float, int
        What a tangent costs, in iterations; what was spent on it and on iterations since, how many the last step
        took, and how many steps there were.
    lean : float
        What share of their last change accelerations are expected to change by; see `AlphaPoint`.
    came, lagging : float
        Length of the last step; that of the one for which the start has other rates than the last one left, 0: of none.
    brief, halved : int
        Whether the tangent may be solved with in single precision; whether it is (−1: to be looked at); see `halving`.
    made_for, mass_for : float
        Step for which the tangent was made; 1 once the mass has been.
    missed, believed : float, int
        What share of accelerations the mass got wrong when that was last looked at (−1: not yet known), and in how many
        jumps of the inputs it was only believed.
    newton, factorisations, weighings, worst : int
    losing, asking, watching, jumping, unsure : int
        Whether power is dissipated; whether tangents are asked for; whether steps end before corners;
        whether inputs jump before the next step; whether accelerations are not known yet.
    keeping, due, spacing, kept, shelf : int, float
        Whether all states are kept, or only those that are due: when the next one is, and their spacing; how many
        there are, and how many there is room for.
    drawing, entered : int
        Whether balances are drawn, and steps since the run's start: often at first, then every few.
    begun, moving, turnover, gap, made : float
        Energy at the run's start and what of it was kinetic; see `flexctrl.dynamics.records.books.Sums`.
    lawful, absurd : int
        Whether energy is kept but for what is dissipated; whether the method makes so much of it that the run ends.
    power, gained, lost, unseen : float
        Dissipated power; work of the inputs, energy dissipated, and that by rates that are over within a step.
    v, rate, algorithmic, trend : Reals
        At the start of the step; see `AlphaPoint`.
    left, own : Reals
        Rates and the method's own accelerations there as the last step left them, where those along stiff lines are
        others now, for the step to come (``lagging``).
    pulled : Reals
        The inputs' forces at its start.
    fresh, before, asked : Reals
        Where forces jump: accelerations over the mass alone, those before, and the forces between.
    weight, turns, dust : Reals
        One over the yardsticks; 1 for what turns; mass that is but rounding.
    coning, cones : int, Wholes
        Rotations that turn all ways, and their degrees of freedom, three each, in order; see
        `flexctrl.dynamics.alpha.coning`.
    fastest : float
        The largest rate of what turns at the start of the step.
    turned : float
        The farthest that anything has turned within a step since this was set to zero [rad].
    reach, first : Reals
        Largest distance of each degree of freedom from where it was first.
    ahead, swept, bent, path : Reals
        Sums of local errors of some of the steps; see `flexctrl.dynamics.records.books.Sums`.
    stray : Reals
        By how much the method's own acceleration changes in the step about to be judged, over yardsticks.
    rows : Reals
        Time and outputs after each step.
    states : Reals
        Poses, degrees of freedom, rates, driven coordinates, angles of outputs, and the time.
    """

    LASTING = ("answering", "leaping", "swift", "whole", "brief")

    flat: Flat
    gauges: Gauges
    corners: Corners
    closing: Closing
    flows: Flows
    contacts: Contacts
    law: Law
    answer: Answer
    leap: Leap
    fronts: Fronts
    axes: Axes
    tangent: Factors
    mass: Factors
    probes: Probes
    lags: Lags
    entries: Reals
    v: Reals
    left: Reals
    own: Reals
    rate: Reals
    algorithmic: Reals
    trend: Reals
    pulled: Reals
    fresh: Reals
    before: Reals
    asked: Reals
    weight: Reals
    turns: Reals
    dust: Reals
    cones: Wholes
    reach: Reals
    first: Reals
    ahead: Reals
    swept: Reals
    bent: Reals
    path: Reals
    stray: Reals
    rows: Reals
    states: Reals
    parts: int
    part: Wholes
    farthest: Reals
    alpha_m: float
    alpha_f: float
    beta: float
    gamma: float
    least: float
    loosest: float
    share: float
    price: float
    asking: int
    coning: int
    shelf: int
    leaping: int
    answering: int
    paced: int = 1
    firmest: float = 0.0
    throws: int = 0
    damping: float = 0.0
    holding: float = 0.0
    short: float = 0.0
    swift: int = 0
    whole: int = 0
    tolerance: float = 0.0
    error: float = 0.0
    h: float = 0.0
    t: float = 0.0
    size: float = 0.0
    largest: float = math.inf
    stop: float = 0.0
    until: float = 0.0
    relative: float = 0.0
    absolute: float = 0.0
    reached: float = 0.0
    task: int = FIXED
    wanted: int = 0
    done: int = 0
    rejected: int = 0
    tried: float = 0.0
    refused: int = 0
    follow: int = 0
    cap: float = 0.0
    led: float = 0.0
    taken: float = 0.0
    phase: int = FRESH
    attempt: int = 0
    exact: int = 0
    iteration: int = 0
    last: float = math.inf
    contraction: float = 0.0
    strayed: float = 0.0
    fastest: float = 0.0
    turned: float = 0.0
    habit: float = 0.0
    trusted: int = 0
    spent: float = 0.0
    lately: float = 0.0
    served: int = 0
    lean: float = 1.0
    came: float = 0.0
    lagging: float = 0.0
    brief: int = 0
    halved: int = 0
    made_for: float = -1.0
    mass_for: float = 0.0
    missed: float = -1.0
    believed: int = 0
    newton: int = 0
    factorisations: int = 0
    weighings: int = 0
    worst: int = 0
    losing: int = 0
    watching: int = 0
    jumping: int = 0
    unsure: int = 0
    keeping: int = 1
    due: float = 0.0
    spacing: float = 0.0
    kept: int = 0
    drawing: int = 0
    entered: int = 0
    begun: float = 0.0
    moving: float = 0.0
    turnover: float = 0.0
    gap: float = 0.0
    made: float = 0.0
    lawful: int = 0
    absurd: int = 0
    power: float = 0.0
    gained: float = 0.0
    lost: float = 0.0
    unseen: float = 0.0
