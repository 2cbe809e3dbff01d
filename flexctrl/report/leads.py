"""What a newcomer is told at the head of each section of a report."""

from __future__ import annotations

__all__ = ["LEADS"]

LEADS = {
    "table": (
        "The machine as drawn, with the node numbers of its join table. In the table, 0 is held, equal "
        "numbers move together, and every other number is a degree of freedom of its own. Below it: the "
        "parts, and an audit of what each freedom is."
    ),
    "modes": (
        "How the machine moves freely about its equilibrium: choose a mode and watch it, enlarged. Rigid "
        "modes do not vibrate; one in which a part only spins about its own axis shows nothing. Damping is "
        "the share of critical damping; the part named is the one that moves or bends most."
    ),
    "bode": (
        "How far the output swings for a sine at the input, by frequency, for the machine as it is and for "
        "its rigid twin. With a controller: the loop cut at its command, and how far it is from instability, "
        "which says something only where the closed loop is stable."
    ),
    "rlocus": (
        "Where the poles of the closed loop go as its gain grows, for the machine as it is and for its rigid "
        "twin: × without the loop, ○ zeros, where they end. To the right of the upright line the loop is "
        "unstable."
    ),
    "compare": (
        "The scene through time, as it is and rigid. In the table: each signal at the end and at its largest, "
        "the root mean square of the difference, to what it is known (both runs integrated more finely), and "
        "the frequency at which the signal vibrates."
    ),
    "run": (
        "Whether the numbers can be trusted. The energy residual of the run is what the balance of energy misses, "
        "over the energy turned over: well below 1e-2 is good. Rejected steps were tried again with shorter ones. "
        "The linear model shows how it was checked against the forces of the machine. At the end, how far the "
        "references of the other tabs are from coarser meshes, longer steps and another integrator."
    ),
    "ladder": (
        "The same scene from rigid to refined: the largest error of an output against a certified reference, "
        "over the time of the run (1: a fixed small calculation on this computer). Within the grey band the "
        "reference knows no better."
    ),
    "ledger": (
        "What the answer loses without each effect (change of outputs and to what that is known, poles, "
        "margins) and how long the run then takes (time: 0.5 is twice as fast). Of pole: the pole that changes "
        "most, 100 % if it is gone or new. Kept, in blue, is the smallest set that changes no output, pole or margin "
        "by more than is borne."
    ),
    "cost": (
        "Error of many ways to compute the scene against a certified reference, over their time (1: a fixed "
        "small calculation on this computer). The line joins those that no other beats in both; the ring is "
        "the cheapest within the tolerance that also holds under loads it was not chosen on. Grey: where the "
        "reference itself is in doubt."
    ),
    "versions": "What this page was made with.",
}
