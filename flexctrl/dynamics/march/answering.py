"""Generalised alpha in compiled loops: steps under a continuous law, whose inputs at the end follow from what is there.

A step is solved under inputs that are guessed, the law is asked at its end, and the guess put right by Broyden's method
(1965), which learns how the law answers, until what is still put right moves nothing.
"""

from __future__ import annotations

import math

from flexctrl.dynamics.alpha.sliding import NOTICED
from flexctrl.dynamics.law_state import CLEAR, HALVINGS, LOOSE, NEARER, YOUNG
from flexctrl.dynamics.march.answer import Answer
from flexctrl.dynamics.march.books import reach
from flexctrl.dynamics.march.clock import later
from flexctrl.dynamics.march.record import DONE, EVALUATE, FAILED, FRESH, WANTS_TANGENT, March
from flexctrl.dynamics.march.step import step
from flexctrl.kernels.dense import full_factors, full_solve
from flexctrl.kernels.eights import eight, larger, largest
from flexctrl.model.flat.flat import clear, drive, load
from flexctrl.model.flat.solving import copy_on
from flexctrl.model.gauges import read

__all__ = ["commanded", "forget", "recite", "strayed_off", "take"]

_EXACT = 1e-11
_LEFT = 1e-8
"""What steps of Newton's method may leave of the law's state."""
_AFRESH, _MOST, _STILL = 20, 40, 3
"""Tries until what has been learned of the law is forgotten, until the step is given up, and that move nothing."""


def commanded(m: March) -> int:
    """Solve a step under inputs that are at its end what the law says there."""
    a = m.answer
    if m.phase == FRESH and a.tries == 0:
        foresee(m)
    while True:
        status = step(m)
        if status == WANTS_TANGENT:
            return status
        if status == DONE:
            reach(m)
            status = asked(m)
        if status != DONE or a.tries == _MOST:
            a.tries = 0
            forget(a)
            return FAILED if status == DONE else status
        if settled_inputs(m, unlike(a)):
            a.tries = 0
            return DONE
        correct_inputs(m)


def foresee(m: March) -> None:
    """Guess the inputs and the law's state at the end of the step, and set the clocks of the law."""
    a = m.answer
    a.still = 0
    for i in range(a.inputs):
        a.u[i] = a.last[i] + m.h * a.trend[i]
    load(m.flat)
    x = a.work[a.outputs :]
    for i in range(a.states):
        x[i] = x[a.states + i] + m.h * x[2 * a.states + i]
    t = later(m.t, m.h)
    now = x[3 * a.states :]
    for k in range(a.clocks):
        s = t - a.origins[k]
        value = 0.0
        for j in range(a.width):
            value = value * s + a.powers[a.width * k + j]
        now[k] = value


def asked(m: March) -> int:
    """Ask the law at the end of the step; tell whether what it says are numbers."""
    a = m.answer
    if m.gauges.moving == 1 and m.swift != 1 and m.whole != 1:
        drive(m.flat)
    read(m.gauges, m.flat.z, a.work)
    status = say(a)
    if a.states == 0 or status != DONE:
        return status
    for _ in range(NEARER):
        for i in range(a.states):
            a.sides[i] = a.answer[a.commands + i]
        if nearer(m) == FAILED:
            return FAILED
        if at_end(m):
            return DONE
    between(m)
    return DONE


def say(a: Answer) -> int:
    """Ask the law at its state; tell whether what it says are numbers."""
    if a.spoken == 1:  # who is interrupted before it says anything has said nothing
        for i in range(a.commands + a.states):
            a.answer[i] = math.nan
    else:
        clear(a.commands + a.states, a.answer)
    a.step[0](a.work, a.answer)
    total = 0.0
    for i in range(a.commands + a.states):
        total += a.answer[i]
    return DONE if math.isfinite(total) else FAILED


def nearer(m: March) -> int:
    """Take a step of Newton's method towards the law's state at the end; tell whether the law says numbers there."""
    a = m.answer
    x = a.work[a.outputs :]
    n = a.states
    for i in range(n):
        a.off[i] = x[i] - x[n + i] - 0.5 * m.h * (x[2 * n + i] + a.answer[a.commands + i])
    soften(m)
    for i in range(n):
        x[i] -= a.off[i]
    return say(a)


def soften(m: March) -> None:
    """Solve with 1 − h/2 ∂f/∂x at the law's state; most laws leave it as it is while steps are of one length."""
    a = m.answer
    n = a.states
    if a.changing > 0 or m.h != a.span:
        a.span = m.h
        if a.changing > 0:
            a.slope[0](a.work, a.slopes)
        for k in range(n * n):
            a.factors[k] = -0.5 * m.h * a.slopes[k]
        for i in range(n):
            a.factors[(n + 1) * i] += 1.0
        full_factors(n, a.factors, a.order)
    full_solve(n, a.factors, a.order, a.off)


def at_end(m: March) -> bool:
    """Tell whether the law's state is that of the trapezoidal rule: one step of Newton's method finds a linear one.

    Where its rate jumps with it there may be none.
    """
    a = m.answer
    x = a.work[a.outputs :]
    for i in range(a.states):
        before = x[a.states + i]
        first = 0.5 * m.h * x[2 * a.states + i]
        last = 0.5 * m.h * a.answer[a.commands + i]
        if abs(x[i] - before - first - last) > _LEFT * (abs(x[i]) + abs(before) + abs(first) + abs(last)):
            return False
    return True


def between(m: March) -> None:
    """Put the law's state where its rate jumps, under the rate between; as `flexctrl.dynamics.law_state` does."""
    a = m.answer
    x = a.work[a.outputs :]
    n = a.states
    for i in range(n):
        a.sides[n + i] = a.answer[a.commands + i]
    low = 0.0
    high = 1.0
    share = 0.0
    for _ in range(HALVINGS):
        share = 0.5 * (low + high)
        for i in range(n):
            rate = a.sides[i] + share * (a.sides[n + i] - a.sides[i])
            x[i] = x[n + i] + 0.5 * m.h * (x[2 * n + i] + rate)
        say(a)
        turned = 0.0
        for i in range(n):
            apart = a.sides[n + i] - a.sides[i]
            turned += (a.answer[a.commands + i] - a.sides[i] - share * apart) * apart
        if turned > 0.0:
            low = share
        else:
            high = share
    for i in range(n):
        a.answer[a.commands + i] = a.sides[i] + share * (a.sides[n + i] - a.sides[i])


def strayed_off(m: March) -> float:
    """Return the error of the law's state over what is allowed; as `flexctrl.dynamics.law_state.error` does."""
    a = m.answer
    if a.bent == 0:
        return 0.0
    x = a.work[a.outputs :]
    n = a.states
    for i in range(n):
        a.off[i] = m.h * m.h / 12.0 * ((a.answer[a.commands + i] - x[2 * n + i]) / m.h - a.bend[i])
        a.kept[i] = a.off[i]
    worst = not_allowed(m)
    if worst <= CLEAR:
        return worst
    soften(m)
    for i in range(n):
        a.kept[i] = min(abs(a.kept[i]), abs(a.off[i]))
    return not_allowed(m)


def not_allowed(m: March) -> float:
    """Return errors of the law's state, which are at hand, over what is allowed."""
    a = m.answer
    x = a.work[a.outputs :]
    young = YOUNG * (m.t + m.h)
    worst = 0.0
    for i in range(a.states):
        rate = max(abs(x[2 * a.states + i]), abs(a.answer[a.commands + i]))
        allowed = LOOSE * (m.relative + m.absolute) * max(max(a.reached[i], abs(x[i])), young * rate)
        if allowed > 0.0:
            worst = max(worst, abs(a.kept[i]) / allowed)
    return worst


def unlike(a: Answer) -> float:
    """Find by how much the law says others than the inputs in force; return the largest difference, 0 for round-off."""
    for i in range(a.inputs):
        a.said[i] = a.base[i]
    for k in range(a.commands):
        a.said[a.writes[k]] += a.answer[k]
    most = 0.0
    for k in range(a.commands):
        a.gap[k] = a.said[a.writes[k]] - a.u[a.writes[k]]
        if abs(a.gap[k]) > _EXACT * abs(a.said[a.writes[k]]):
            most = max(most, abs(a.gap[k]))
    return most


def settled_inputs(m: March, gap: float) -> bool:
    """Tell whether inputs need not be put right any more.

    What was put right has moved nothing, and brought them nearer to what the law says: they would not come nearer by
    changes that are too small because the law answers otherwise than before, as one that has come to a limit. What
    comes no nearer in three tries is round-off.
    """
    a = m.answer
    before = a.most
    a.most = gap
    if gap == 0.0:
        return True
    if a.tries == 0 or moved(m) > m.tolerance:
        a.still = 0
        return False
    a.still += 1
    return (gap <= 0.5 * before or a.still >= _STILL) and not (a.spoken == 1 and jumps(a))


def jumps(a: Answer) -> bool:
    """Tell whether a law in Python says others than the inputs in force by so much that it may jump there."""
    for k in range(a.commands):
        i = a.writes[k]
        if abs(a.gap[k]) > NOTICED * max(abs(a.last[i]), max(abs(a.u[i]), abs(a.said[i]))):
            return True
    return False


def correct_inputs(m: March) -> None:
    """Put the inputs right, and go on with the step from where it is."""
    a = m.answer
    if a.tries == _AFRESH:
        forget(a)
    elif a.tries > 0:
        learn(a)
    for k in range(a.commands):
        a.before[k] = a.gap[k]
        change = 0.0
        for j in range(a.commands):
            change += a.inverse[a.commands * k + j] * a.gap[j]
        a.change[k] = change
        a.u[a.writes[k]] += change
    load(m.flat)
    copy_on(m.flat.padded, m.flat.step, a.way)
    m.phase = EVALUATE
    m.iteration = 0
    m.last = math.inf
    m.contraction = 0.0
    m.strayed = 0.0
    m.short = 0.0
    a.tries += 1


def learn(a: Answer) -> None:
    """Take the last change of the inputs and of the gap into account: by the least change of the inverse, H.

    H is minus that of the gap's slope: H ← H + (c + H d) cᵀH / (−cᵀ H d), for a change c of inputs and d of the gap.
    """
    n = a.commands
    share = 0.0
    for i in range(n):
        felt = 0.0
        for j in range(n):
            felt += a.inverse[n * i + j] * (a.gap[j] - a.before[j])
        a.felt[i] = felt
        share -= a.change[i] * felt
    if not abs(share) > 1e-300:
        return
    for j in range(n):
        back = 0.0
        for i in range(n):
            back += a.change[i] * a.inverse[n * i + j]
        a.row[j] = back / share
    for i in range(n):
        for j in range(n):
            a.inverse[n * i + j] += (a.change[i] + a.felt[i]) * a.row[j]


def forget(a: Answer) -> None:
    """Begin again as if what the law says did not depend on the inputs."""
    for i in range(a.commands):
        for j in range(a.commands):
            a.inverse[a.commands * i + j] = 1.0 if i == j else 0.0


def moved(m: March) -> float:
    """Return how far the end of the step has moved since the inputs were put right."""
    most = 0.0 * eight(m.weight)
    for i in range(0, m.flat.padded, 8):
        most = larger(most, abs(eight(m.flat.step[i:]) - eight(m.answer.way[i:])) * eight(m.weight[i:]))
    return largest(most)


def take(m: March) -> None:
    """Go on to the end of the step, and write down inputs and the law's state there."""
    a = m.answer
    told = a.told[(a.inputs + 2 * a.states) * m.done :]
    for i in range(a.inputs):
        a.trend[i] = (a.u[i] - a.last[i]) / m.h
        a.last[i] = a.u[i]
        told[i] = a.u[i]
    x = a.work[a.outputs :]
    a.bent = 1
    for i in range(a.states):
        a.bend[i] = (a.answer[a.commands + i] - x[2 * a.states + i]) / m.h
        a.reached[i] = max(a.reached[i], abs(x[i]))
        x[a.states + i] = x[i]
        x[2 * a.states + i] = a.answer[a.commands + i]
        told[a.inputs + i] = x[i]
        told[a.inputs + a.states + i] = a.answer[a.commands + i]


def recite(a: Answer) -> int:
    """Ask the law at instants whose states are known."""
    wide = a.outputs + 3 * a.states + a.clocks
    for k in range(a.wanted):
        asked_now = a.asked[wide * k :]
        for i in range(wide):
            a.work[i] = asked_now[i]
        say(a)
        for i in range(a.commands):
            a.answers[a.commands * k + i] = a.answer[i]
    return 0
