"""A scene: a machine, the physics asked for, its controller, and how it is to be run."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import field, replace
from enum import Enum
from functools import cached_property
from typing import Any

from flexctrl.design.controller import Controller, as_controller
from flexctrl.design.tracking import OpenLoop, Together
from flexctrl.dynamics.run import Run, Tolerance
from flexctrl.dynamics.simulate import simulate
from flexctrl.dynamics.steps import Integrator
from flexctrl.effects.automatic import Automatic
from flexctrl.effects.damping import ModalDamping
from flexctrl.effects.effect import Effect
from flexctrl.effects.flexibility import Flexible
from flexctrl.effects.geometric_stiffness import GeometricStiffness
from flexctrl.effects.gravity import Gravity
from flexctrl.effects.large_rotation import LargeRotation
from flexctrl.errors import SceneError, StructureError, check_kind, did_you_mean, shortened
from flexctrl.frozen import frozen
from flexctrl.linear.matfile import SI, Units
from flexctrl.linear.model import LinearModel
from flexctrl.model.assemble import assemble, rigid
from flexctrl.model.braked import rest_held
from flexctrl.model.equilibrium import Rest
from flexctrl.model.linearize import released
from flexctrl.model.model import Model
from flexctrl.model.state import State
from flexctrl.structure.freedoms import check_seconds, listed
from flexctrl.structure.refine import renamed
from flexctrl.structure.structure import Structure
from flexctrl.study.bookkeeping import ledger

Signal = Callable[[float], float]


class Start(Enum):
    """The state a run begins in."""

    DRAWN = "drawn"
    EQUILIBRIUM = "equilibrium"


@frozen
class Simulation:
    """How a scene is run through time.

    Attributes
    ----------
    until : float
        End [s].
    method : Integrator or None
        A fixed-step method; left out: steps adapt to ``tolerance``.
    tolerance : Tolerance
    every : float or None
        Spacing of the results [s]; left out: every step.
    start : Start
    rigid_twin : bool
        Whether the rigid twin is run beside the machine.
    """

    until: float
    method: Integrator | None = None
    tolerance: Tolerance = field(default_factory=Tolerance)
    every: float | None = None
    start: Start = Start.DRAWN
    rigid_twin: bool = False

    def __post_init__(self) -> None:
        try:
            check_seconds(self.until, "until", "simulation")
            if self.every is not None:
                check_seconds(self.every, "every", "simulation", endless=True)
        except StructureError as error:
            raise SceneError(str(error)) from None
        for name, value, kinds, expected in (
            ("method", self.method, Integrator | None, "a method with its parameters, as GeneralizedAlpha(1e-3)"),
            ("tolerance", self.tolerance, Tolerance, "a Tolerance, as Tolerance(relative=1e-5)"),
            ("start", self.start, Start, "Start.DRAWN or Start.EQUILIBRIUM"),
            ("rigid_twin", self.rigid_twin, bool, "True or False"),
        ):
            if isinstance(value, type) or not isinstance(value, kinds):
                raise SceneError(f"simulation: {name} = {shortened(value)}; expected {expected}")


@frozen
class Channel:
    """The loop that ``bode`` and ``rlocus`` look at.

    Attributes
    ----------
    input, output : str
        Names of signals; left out: the first ones.
    """

    input: str = ""
    output: str = ""


class _Field(Enum):
    """What is not given of a scene that is copied, and may be taken from it."""

    STAYS = "stays"


class Plan(ABC):
    """A controller that is designed on the scene it is for, when it is first needed."""

    @abstractmethod
    def build(self, scene: Scene) -> Controller:
        """Return the controller for a scene."""


_PHYSICS = ("model", "twin", "rest", "twin_rest", "linear", "twin_linear")
"""What follows from structure, effects and what is held, and is worked out once."""


@frozen(eq=False)
class Scene:
    """Everything a command needs to know.

    Attributes
    ----------
    structure : Structure
    effects : tuple of Effect
        The physics asked for.
    controller : Controller, python-control system, Plan or None
    loads : mapping of str to float or function of time
        Inputs beside the controller's: constant from t = 0, or functions of time (beside a sampled
        controller these are held from sample to sample).
    simulation : Simulation or None
        Needed by ``run`` and ``compare``.
    hold : mapping of str to float
        Freedoms held in the equilibrium, ``"girder.start.u"`` or a coordinate's name, and where.
    rest_inputs : mapping of str to float
        Constant inputs the equilibrium is found with.
    channel : Channel
    name : str
    notes : tuple of str
        Assumptions and sources, shown with the results.
    units : Units
        What its numbers are in, for labels; nothing is converted, and times are seconds.

    Raises
    ------
    SceneError
        For a signal that the machine does not have, or `Automatic` given twice.
    """

    structure: Structure
    effects: tuple[Effect, ...] = (Gravity(), Flexible(), LargeRotation())
    controller: Any = None
    loads: Mapping[str, float | Signal] = field(default_factory=dict)
    simulation: Simulation | None = None
    hold: Mapping[str, float] = field(default_factory=dict)
    rest_inputs: Mapping[str, float] = field(default_factory=dict)
    channel: Channel = Channel()
    name: str = ""
    notes: tuple[str, ...] = ()
    units: Units = SI

    def __post_init__(self) -> None:
        if not isinstance(self.structure, Structure):
            raise SceneError(f"Scene: structure = {shortened(self.structure)}; expected a Structure")
        if not isinstance(self.simulation, Simulation | None):
            raise SceneError(f"Scene: simulation = {shortened(self.simulation)}; expected a Simulation(until=…)")
        check_kind(self.units, Units, "Scene: units", "Units, as Units('mm', 't', 's', 'N')", SceneError)
        if self.units.time != "s":
            raise SceneError(f"Scene: units: time = {self.units.time!r}; expected 's', as times and Hz are told in it")
        object.__setattr__(self, "effects", tuple(listed(self.effects, "Scene: effects")))
        check_kind(self.loads, Mapping, "Scene: loads", "a mapping of inputs to values", SceneError)
        object.__setattr__(self, "name", self.name or self.structure.name)
        if sum(isinstance(e, Automatic) for e in self.effects) > 1:
            raise SceneError(f"{self.name}: Automatic stands twice among the effects; give it once, with one tolerance")
        inputs = [i.name for i in self.structure.inputs]
        outputs = [o.name for o in self.structure.outputs]
        for what, given, known in (
            ("loads", self.loads, inputs),
            ("rest_inputs", self.rest_inputs, inputs),
            ("channel: input", [self.channel.input] if self.channel.input else [], inputs),
            ("channel: output", [self.channel.output] if self.channel.output else [], outputs),
        ):
            for name in given:
                if name not in known:
                    raise SceneError(f"{self.name}: {what}: the machine has no {name!r}{did_you_mean(name, known)}")

    def with_(
        self,
        *,
        structure: Structure | None = None,
        effects: Sequence[Effect] | None = None,
        controller: Any = _Field.STAYS,
        loads: Mapping[str, float | Signal] | None = None,
        simulation: Simulation | _Field | None = _Field.STAYS,
        notes: Sequence[str] | None = None,
    ) -> Scene:
        """Return a copy with some fields replaced; what is left out stays, models of the same physics too.

        Parameters
        ----------
        structure, effects, controller, loads, simulation, notes
            As for the constructor; ``controller=None`` and ``simulation=None`` take these away.

        Returns
        -------
        Scene
        """
        told = notes if notes is None else tuple(notes)
        given = {"structure": structure, "effects": effects, "loads": loads, "notes": told}
        taken = {"controller": controller, "simulation": simulation}
        changes: dict[str, Any] = {name: value for name, value in given.items() if value is not None}
        changes |= {name: value for name, value in taken.items() if value is not _Field.STAYS}
        found = replace(self, **changes)
        if structure is not None:
            found = found._on_mesh_of(self.structure)
        if structure is None and effects is None:
            found.__dict__.update({name: self.__dict__[name] for name in _PHYSICS if name in self.__dict__})
        return found

    def _on_mesh_of(self, before: Structure) -> Scene:
        """The scene with what is held where it was before beams had other numbers of elements."""

        def there(hold: Mapping[str, float]) -> dict[str, float]:
            return {renamed(name, before, self.structure): at for name, at in hold.items()}

        def moved(effect: Effect) -> Effect:
            if isinstance(effect, GeometricStiffness):
                return GeometricStiffness(there(dict(effect.hold)), dict(effect.inputs))
            if isinstance(effect, ModalDamping):
                return ModalDamping(effect.ratios, there(dict(effect.hold)), dict(effect.inputs))
            return effect

        return replace(self, hold=there(self.hold), effects=tuple(moved(e) for e in self.effects))

    @cached_property
    def settled(self) -> Scene:
        """The scene with the effects it needs, and a note of what is left out: itself, without `Automatic`."""
        choice = next((e for e in self.effects if isinstance(e, Automatic)), None)
        if choice is None:
            return self
        full = self.with_(effects=[e for e in self.effects if e is not choice])
        drawn_up = ledger(full, choice.tolerance)
        if not drawn_up.complete:
            raise KeyboardInterrupt  # who stops the choice waits for no run
        found = drawn_up.scene
        assert isinstance(found, Scene)
        way = replace(self._simulation, method=found._simulation.method)
        told = (f"automatic: {note}" for note in (drawn_up.summary, *drawn_up.notes))
        return found.with_(simulation=way, notes=(*self.notes, *told))

    # -- models

    @cached_property
    def model(self) -> Model:
        """The machine under its effects."""
        return assemble(self.structure, [self._loaded(e) for e in self.effects])

    @cached_property
    def twin(self) -> Model:
        """The rigid twin."""
        found = rigid(self.model)
        assert isinstance(found, Model)
        return found

    @cached_property
    def rest(self) -> Rest:
        """The machine's equilibrium."""
        return self._equilibrium(self.model)

    @cached_property
    def twin_rest(self) -> Rest:
        """The rigid twin's equilibrium."""
        return self._equilibrium(self.twin)

    @cached_property
    def linear(self) -> LinearModel:
        """The machine linearised about its equilibrium, with nothing held any more."""
        return released(self.rest)

    @cached_property
    def twin_linear(self) -> LinearModel:
        """The rigid twin linearised about its equilibrium, with nothing held any more."""
        return released(self.twin_rest)

    def _loaded(self, effect: Effect) -> Effect:
        """An effect that is laid about an equilibrium, about that of the scene unless it names one."""
        if effect == GeometricStiffness():
            return GeometricStiffness(self.hold, self.rest_inputs)
        if isinstance(effect, ModalDamping) and effect == ModalDamping(effect.ratios):
            return ModalDamping(effect.ratios, self.hold, self.rest_inputs)
        return effect

    def _equilibrium(self, model: Model) -> Rest:
        try:
            return rest_held(model, self.hold, self.rest_inputs)
        except StructureError as error:
            raise SceneError(f"{self.name}: {error}") from None

    # -- runs

    @cached_property
    def law(self) -> Controller | None:
        """The controller, designed and with its names checked; None without one."""
        own = self.controller.build(self) if isinstance(self.controller, Plan) else self.controller
        return None if own is None else as_controller(own, self.model.inputs, self.model.outputs)

    @cached_property
    def _commands(self) -> Controller | None:
        """The law together with loads that change with time."""
        moving = {name: load for name, load in self.loads.items() if callable(load)}
        if not moving:
            return self.law
        loads = OpenLoop(moving)
        if self.law is None:
            return loads
        return Together(loads.sampled(self.law.sample_time) if self.law.sample_time else loads, self.law)

    def start(self, model: Model) -> State:
        """Return the state from which a model of this scene (``model`` or ``twin``) is run."""
        if self._simulation.start is Start.DRAWN:
            return model.drawn
        if model is self.model:
            return self.rest.state
        return self.twin_rest.state if model is self.twin else self._equilibrium(model).state

    def run(self, model: Model | None = None, progress: Callable[[float], None] | None = None) -> Run:
        """Simulate a model of this scene with its controller and loads.

        Parameters
        ----------
        model : Model, optional
            Left out: `model`, that of the `settled` scene under `Automatic`; give ``scene.twin`` for the rigid twin.
        progress : callable, optional
            Called with the fraction done.

        Returns
        -------
        Run

        Raises
        ------
        SceneError
            If the scene does not say how long to run.
        """
        if model is None and self.settled is not self:
            return self.settled.run(progress=progress)
        plan, chosen = self._simulation, model or self.model
        return simulate(
            chosen,
            self._commands,
            until=plan.until,
            start=self.start(chosen),
            inputs={name: load for name, load in self.loads.items() if not callable(load)},
            method=plan.method,
            tolerance=plan.tolerance,
            every=plan.every,
            progress=progress,
        )

    @property
    def _simulation(self) -> Simulation:
        if self.simulation is None:
            raise SceneError(f"{self.name}: has no [simulation]; give at least until = … (seconds)")
        return self.simulation


__all__ = ["Channel", "Plan", "Scene", "Simulation", "Start"]
