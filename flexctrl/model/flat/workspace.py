"""The workspace of a model on flat vectors, as compiled loops read it."""

from __future__ import annotations

from dataclasses import dataclass

from flexctrl.kernels.native import Reals, Runs, Wholes
from flexctrl.model.flat.tiles import Tiles

__all__ = ["HIDDEN", "Flat"]

HIDDEN = frozenset({"slots", "drawn", "back", "units"})
"""Parts of the workspace that only kernels read."""


@dataclass
class Flat:
    """A model on flat vectors. Vectors marked * are parts of the workspace.

    Attributes
    ----------
    n, padded : int
        Degrees of freedom; length of their vectors, a multiple of eight and more than n.
    posed, nodes : int
        How much of the workspace is slots and inputs, which tangents go by; nodes, the ground included.
    z : Reals
        The workspace, slots first, then inputs.
    seeds, pose, step, v, rate : Reals *
        The tangent's seeds (3), poses at the start of the step (12 a node), and the step under way: increments,
        rates and accelerations at its end.
    force, load : Reals *
        Sums of forces on the degrees of freedom, then raw ones on the linkage; the same of inputs that keep
        their directions.
    q : Reals *
        Sums of the degrees of freedom at the start of the step.
    driven, found, about : Reals *
        Driven coordinates at the start of the step, at its end, and about what the step adds to them.
    whole : Wholes
        Nodes whose six degrees of freedom are their own and follow each other, and the first of these.
    moved, turned, linked : Wholes
        Other nodes that move and that turn by degrees of freedom of their own, and those of the linkage.
    cells : Wholes
        Degree of freedom of each of a node's six.
    slots, sources : Wholes
        Velocities of other nodes among the slots, and the degrees of freedom they are.
    shafts, rigid, rotary : Wholes
        Degrees of freedom of source angles, then of modes; which shafts are rigid; which joints turn.
    ratios : Reals
    inputs : Wholes
        Where unit loads act, then the inputs they are of.
    unit : Reals
        Their values.
    spun : Wholes
        Degrees of freedom that turn what is driven.
    follows : Wholes
        Of each load that turns with a node: the input, the node, and where its three components act.
    toward : Reals
        Their directions at rest.
    u : Reals *
        Inputs.
    shift : Reals *
        How far all nodes are shifted and turned from the drawn shape, for models in small motion.
    turn : Runs
        Kernels that turn nodes by a step: by little, and by any.
    winding, forces, tangents, energies, shifts : Runs
        Kernels; of the linkage's drives: driven coordinates, and what steps add to them.
    placing, rating, changing, carrying : Runs
        What levers do: places, rates, accelerations; forces.
    placed, levers, slopes : int
        How many kernels place; how many do each of the others; how many tangents there are.
    gusts : Runs
        Kernels of the forces of gusts.
    books : Reals *
        Kinetic energy, stored energy, dissipated power.
    answer : Reals *
        Accelerations; see `accelerate`.
    tiles : Tiles
        What is placed, turned and pushed at once, of large models; see `press_tiles`.
    entire : Runs
        Kernels of the whole machine, where it has few freedoms; see `flexctrl.model.flat.entire`.
    quick : int
        How many there are.
    pressing : int
        Whether the first of them gives forces (`press_entire`) rather than accelerations.
    """

    LASTING = ("linking", "placed", "levers", "carried", "quick")

    n: int
    padded: int
    posed: int
    nodes: int
    wholes: int
    moving: int
    turning: int
    turns: int
    linking: int
    placed: int
    levers: int
    slopes: int
    rates: int
    drives: int
    spinning: int
    inner: int
    pieces: int
    unit_loads: int
    following: int
    gusting: int
    carried: int
    shifting: int
    entries: int
    drive_base: int
    z: Reals
    seeds: Reals
    pose: Reals
    step: Reals
    v: Reals
    rate: Reals
    force: Reals
    load: Reals
    q: Reals
    driven: Reals
    found: Reals
    about: Reals
    whole: Wholes
    moved: Wholes
    turned: Wholes
    linked: Wholes
    cells: Wholes
    slots: Wholes
    sources: Wholes
    shafts: Wholes
    rigid: Wholes
    rotary: Wholes
    ratios: Reals
    spun: Wholes
    inputs: Wholes
    unit: Reals
    follows: Wholes
    toward: Reals
    u: Reals
    shift: Reals
    turn: Runs
    placing: Runs
    rating: Runs
    changing: Runs
    carrying: Runs
    winding: Runs
    forces: Runs
    tangents: Runs
    energies: Runs
    shifts: Runs
    gusts: Runs
    books: Reals
    answer: Reals
    tiles: Tiles
    entire: Runs = ()
    quick: int = 0
    pressing: int = 0
