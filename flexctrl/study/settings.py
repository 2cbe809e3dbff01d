"""How accurately a scene is computed: fidelity, mesh, integrator."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from enum import Enum
from typing import Any

from flexctrl.dynamics.alpha.method import AdaptiveAlpha, GeneralizedAlpha
from flexctrl.dynamics.linear_motion.exact import Exact
from flexctrl.dynamics.methods.checked import Unchecked, bare
from flexctrl.dynamics.methods.extrapolation import Richardson
from flexctrl.dynamics.run import Tolerance
from flexctrl.dynamics.steps import Fixed, Integrator
from flexctrl.effects.component_modes import ComponentModes, elements_alone
from flexctrl.effects.effect import Effect
from flexctrl.effects.flexibility import BeamFlexibility, Deforming, ShaftElasticity
from flexctrl.effects.geometric_stiffness import GeometricStiffness
from flexctrl.effects.large_rotation import LargeRotation
from flexctrl.errors import StructureError, did_you_mean, shortened
from flexctrl.frozen import frozen
from flexctrl.structure.beams import Beam
from flexctrl.structure.drives import Drive
from flexctrl.structure.elements import Part
from flexctrl.structure.freedoms import check_whole
from flexctrl.structure.join_table import JoinTable
from flexctrl.structure.refine import coarsen, refine
from flexctrl.structure.structure import Structure
from flexctrl.study.subject import Subject, planned

__all__ = ["Fidelity", "Setting", "sweep"]

_MODES = 1
_STEPS = 1000
_ORDERS = (1, 3)
_LINEAR_ORDERS = (4, 12)


def _rigid(effects: Sequence[Effect]) -> list[Effect]:
    return [e for e in effects if not isinstance(e, Deforming)]


def _shafts(effects: Sequence[Effect]) -> list[Effect]:
    return [e for e in effects if not isinstance(e, Deforming) or isinstance(e, ShaftElasticity)]


def _modes(effects: Sequence[Effect], structure: Structure, count: int = _MODES) -> list[Effect]:
    """Modes where they save elements, or the scene has some; on every beam if they do nowhere."""
    beams, coarse = ([p for p in s.elements if isinstance(p, Beam)] for s in (structure, _coarse(structure)))
    own = [e for e in effects if isinstance(e, ComponentModes)]
    along = max((e.along for e in own), default=0)
    fewer = {
        b.name for b, c in zip(beams, coarse, strict=True) if c.elements < b.elements or any(e.modes(b) for e in own)
    }
    found: list[Effect] = []
    for effect in elements_alone(effects):
        if not isinstance(effect, BeamFlexibility):
            found.append(effect)
            continue
        named = effect.of or tuple(b.name for b in beams)
        modal = tuple(name for name in named if name in fewer)
        plain = tuple(name for name in named if name not in fewer) if modal else ()
        modes = ComponentModes(count, modal or effect.of, along)
        found += [modes, *([BeamFlexibility(plain)] if plain else [])]
    return found


def _coarse(structure: Structure) -> Structure:
    """As few elements as nodes in use allow; those there are where numbers tie the nodes."""
    return structure if isinstance(structure.joints, JoinTable) else coarsen(structure)


def _linear(effects: Sequence[Effect]) -> list[Effect]:
    return [GeometricStiffness() if isinstance(e, LargeRotation) else e for e in effects]


class Fidelity(Enum):
    """Rungs of physics on the same scene, the cheapest first."""

    RIGID = "rigid"
    RIGID_WITH_SHAFTS = "rigid, shafts"
    LINEAR = "linear"
    COMPONENT_MODES = "component modes"
    FULL = "full"

    def effects(self, given: Sequence[Effect], structure: Structure) -> list[Effect]:
        """Return the effects of this rung out of a scene's.

        Parameters
        ----------
        given : sequence of Effect
        structure : Structure
            The scene's: modes are for beams that need fewer elements with them, if there are any.

        Returns
        -------
        list of Effect
        """
        flat = [part for e in given for part in e.parts()]
        rungs: dict[Fidelity, Callable[[Sequence[Effect]], list[Effect]]] = {
            Fidelity.RIGID: _rigid,
            Fidelity.RIGID_WITH_SHAFTS: _shafts,
            Fidelity.LINEAR: _linear,
            Fidelity.COMPONENT_MODES: lambda effects: _modes(effects, structure),
            Fidelity.FULL: list,
        }
        return rungs[self](flat)

    def structure(self, given: Structure) -> Structure:
        """Return the mesh of this rung: component modes need as few elements as the nodes in use allow.

        Parameters
        ----------
        given : Structure

        Returns
        -------
        Structure
        """
        return coarsen(given) if self is Fidelity.COMPONENT_MODES else given


@frozen
class Setting:
    """One way to compute a scene.

    Attributes
    ----------
    fidelity : Fidelity
    mesh : int
        Elements of each beam over the scene's own.
    method : Integrator
    tolerance : Tolerance
        For error-controlled methods.
    modes : int
        Modes of an element in each plane, where physics are `Fidelity.COMPONENT_MODES`. (A linear machine is reduced
        by its method, ``Exact(step, modes)``.)
    """

    fidelity: Fidelity
    mesh: int
    method: Integrator
    tolerance: Tolerance
    modes: int = _MODES

    @property
    def order(self) -> int | None:
        """To how many modes bending is reduced: of an element, or of the linear machine; None if it is not."""
        if self.fidelity is Fidelity.COMPONENT_MODES:
            return self.modes
        return self.method.modes if isinstance(self.method, Exact) else None

    def __str__(self) -> str:
        order = "" if self.order is None else f" of order {self.order}"
        return f"{self.fidelity.value}{order}, mesh × {self.mesh}, {self._steps}"

    @property
    def _steps(self) -> str:
        kind = type(self.method).__name__
        if isinstance(self.method, Richardson):
            kind += f"({type(self.method.method).__name__})"
        pace = self.method.pace
        accuracy = f"step {pace.step:.3g} s" if isinstance(pace, Fixed) else f"tolerance {self.tolerance.relative:.0e}"
        return f"{kind}, {accuracy}"

    def of(self, scene: Subject) -> Subject:
        """Return a scene computed this way.

        Parameters
        ----------
        scene : Scene

        Returns
        -------
        Scene
        """
        structure = self.fidelity.structure(scene.structure)
        structure = refine(structure, self.mesh) if self.mesh > 1 else structure
        effects = self.fidelity.effects(scene.effects, scene.structure)
        if self.fidelity is Fidelity.COMPONENT_MODES:
            effects = _modes([part for e in scene.effects for part in e.parts()], scene.structure, self.modes)
        return self.run(scene.with_(structure=structure, effects=effects))

    def run(self, scene: Subject) -> Subject:
        """Return a scene that has these physics already, integrated this way and by no other run beside.

        Parameters
        ----------
        scene : Scene

        Returns
        -------
        Scene
        """
        plan = replace(scene.simulation, method=Unchecked(self.method), tolerance=self.tolerance)
        return scene.with_(simulation=plan)

    @property
    def physics(self) -> tuple[Fidelity, int, int]:
        """What tells the machine that is assembled from those of other settings."""
        return self.fidelity, self.mesh, self.modes if self.fidelity is Fidelity.COMPONENT_MODES else _MODES


def sweep(
    scene: Subject,
    fidelities: Sequence[Fidelity] = tuple(Fidelity),
    meshes: Sequence[int] = (1, 2, 4),
    methods: Sequence[tuple[Integrator, Tolerance]] = (),
    orders: Sequence[int] = (),
) -> tuple[Setting, ...]:
    """Return the settings to try on a scene, each once: fidelity × mesh × integrator × step or tolerance × order.

    Parameters
    ----------
    scene : Scene
    fidelities : sequence of Fidelity
        Those that change nothing of the scene are left out.
    meshes : sequence of int
        Factors; a machine whose beams are rigid is tried with the first only.
    methods : sequence of (Integrator, Tolerance)
        Default: around the scene's own: steps from 8 times as long to half, or tolerances from 1e-2 to 1e-5; and
        some of the other kind. A linear machine is also integrated exactly.
    orders : sequence of int
        To how many modes bending is reduced, of each element with component modes or of the linear machine
        (vibrations beside free motion). Default: 1 and 3 of an element; 4 and 12 of the linear machine, and all.

    Returns
    -------
    tuple of Setting

    Raises
    ------
    StructureError
        For a scene without a simulation, or what is no fidelity, factor, order, or pair of method and tolerance.
    """
    planned(scene, "sweep")
    fidelities, meshes, orders = (
        _several(fidelities, "fidelities"),
        _several(meshes, "meshes"),
        _several(orders, "orders"),
    )
    methods = _several(methods, "methods")
    _check(fidelities, meshes, methods, orders)
    chosen = tuple(methods) or (*around(scene.simulation.method, scene.simulation.tolerance), *_others(scene))
    found: list[Setting] = []
    parts = (*scene.structure.elements, *scene.structure.drives)
    seen: list[list[Effect]] = []
    whole = [e for e in Fidelity.FULL.effects(scene.effects, scene.structure) if _acts(e, parts)]
    for fidelity in fidelities:
        effects = fidelity.effects(scene.effects, scene.structure)
        acting = [e for e in effects if _acts(e, parts)]
        if acting in seen or (acting == whole and fidelity is not Fidelity.FULL and Fidelity.FULL in fidelities):
            continue
        seen.append(acting)
        bends = any(e.bends(p) for e in effects for p in scene.structure.elements if isinstance(p, Beam))
        finer = meshes if bends else meshes[:1]
        if fidelity is Fidelity.LINEAR:
            ways = [*chosen, *(() if methods and not orders else _exact(scene, orders))]
        else:
            ways = list(chosen)
        modes = (tuple(orders) or _ORDERS) if fidelity is Fidelity.COMPONENT_MODES else (_MODES,)
        found += [
            Setting(fidelity, mesh, method, tolerance, count)
            for mesh in finer
            for count in modes
            for method, tolerance in ways
        ]
    return tuple(found)


def _several(given: Sequence[Any], what: str) -> tuple[Any, ...]:
    if isinstance(given, str) or not isinstance(given, Iterable):
        raise StructureError(f"sweep: {what} = {shortened(given)}; expected a sequence")
    return tuple(given)


def _check(
    fidelities: Sequence[Fidelity],
    meshes: Sequence[int],
    methods: Sequence[tuple[Integrator, Tolerance]],
    orders: Sequence[int],
) -> None:
    for what, given in (("fidelities", fidelities), ("meshes", meshes)):
        if not given:
            raise StructureError(f"sweep: {what} are none, so there is nothing to try; give at least one")
    for fidelity in fidelities:
        if not isinstance(fidelity, Fidelity):
            hint = did_you_mean(str(fidelity), [f.value for f in Fidelity])
            raise StructureError(f"sweep: fidelity {shortened(fidelity)}; expected one as Fidelity.FULL{hint}")
    for mesh in meshes:
        check_whole(mesh, "mesh (elements over the scene's own)", "sweep", least=1)
    for order in orders:
        check_whole(order, "order (number of modes)", "sweep", least=1)
    for way in methods:
        pair = way if isinstance(way, tuple) and len(way) == 2 else (None, None)
        if isinstance(pair[0], type) or not isinstance(pair[0], Integrator) or not isinstance(pair[1], Tolerance):
            raise StructureError(
                f"sweep: method {shortened(way)}; expected a pair as (GeneralizedAlpha(1e-3), Tolerance())"
            )


def _exact(scene: Subject, orders: Sequence[int]) -> list[tuple[Integrator, Tolerance]]:
    """The whole linear machine, and reduced to fewer modes than it has."""
    step, fewer = spacing_of(scene), [n for n in orders or _LINEAR_ORDERS if n < scene.model.n]
    return [(Exact(step, n), Tolerance()) for n in (*fewer, None)]


def spacing_of(scene: Subject) -> float:
    """Return where the exact motion is looked at: at samples of the controller, else where results are wanted.

    Parameters
    ----------
    scene : Scene

    Returns
    -------
    float
        [s]
    """
    plan = scene.simulation
    sample = scene.law.sample_time if scene.law is not None else 0.0
    return float(sample or plan.every or plan.until / _STEPS)


def _others(scene: Subject) -> tuple[tuple[Integrator, Tolerance], ...]:
    """Methods of the other kind than the scene's own: controlled steps for fixed ones, fixed for controlled."""
    method, tolerance = scene.simulation.method, scene.simulation.tolerance
    if isinstance(method, GeneralizedAlpha):
        return tuple((AdaptiveAlpha(), Tolerance(r, 1e-3 * r)) for r in (1e-3, 1e-5))
    step = spacing_of(scene)
    return tuple((GeneralizedAlpha(f * step), tolerance) for f in (1.0, 0.5))


def _acts(effect: Effect, parts: Sequence[Part | Drive]) -> bool:
    """Tell whether an effect that lets parts deform finds any that do."""
    if isinstance(effect, ComponentModes):
        return any(isinstance(p, Beam) and effect.modes(p) for p in parts)
    return not isinstance(effect, Deforming) or any(effect.bends(p) for p in parts)


def around(method: Integrator | None, tolerance: Tolerance) -> tuple[tuple[Integrator, Tolerance], ...]:
    """Return methods coarser and finer than a scene's own.

    Parameters
    ----------
    method : Integrator or None
    tolerance : Tolerance

    Returns
    -------
    tuple of (Integrator, Tolerance)
    """
    method = bare(method) if method is not None else AdaptiveAlpha()
    if isinstance(method, GeneralizedAlpha):
        return tuple((replace(method, step=f * method.step), tolerance) for f in (8.0, 4.0, 2.0, 1.0, 0.5))
    scale = tolerance.absolute / tolerance.relative if tolerance.relative else 1e-3
    return tuple((method, Tolerance(r, scale * r)) for r in (1e-2, 1e-3, 1e-4, 1e-5))
