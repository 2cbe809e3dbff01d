"""flexctrl: structural models coupled to controllers.

One description of a machine gives its join table, its linear models and its closed-loop
simulation; see ``docs/`` and ``README.md``. Names are loaded when they are first used.
"""

from __future__ import annotations

import difflib
import importlib
import importlib.util
from typing import Any

_HOMES = {
    "flexctrl.structure.sections": ("STEEL", "Material", "Section"),
    "flexctrl.structure.nodes": ("Node",),
    "flexctrl.structure.beams": ("Beam",),
    "flexctrl.structure.lines": ("Rope", "Spring"),
    "flexctrl.structure.bodies": ("PointMass", "RigidBody"),
    "flexctrl.structure.chains": ("BeamChain", "arc", "polygon"),
    "flexctrl.structure.joints": ("Hinge", "Pin", "Slide", "Support", "Weld"),
    "flexctrl.structure.drives": ("LinearDrive", "RotaryDrive", "Winch"),
    "flexctrl.structure.inputs": ("FollowerForce", "FollowerTorque", "Force", "MotorTorque", "Torque", "WindSpeed"),
    "flexctrl.structure.outputs": (
        "AngularVelocity",
        "DriveAngle",
        "DriveSpeed",
        "Position",
        "Rotation",
        "SwayAngle",
        "Tension",
        "Velocity",
    ),
    "flexctrl.structure.trolleys": ("Trolley",),
    "flexctrl.structure.join_table": ("JoinTable",),
    "flexctrl.structure.structure": ("Structure", "planar"),
    "flexctrl.structure.refine": ("coarsen", "refine"),
    "flexctrl.effects.automatic": ("Automatic", "Within"),
    "flexctrl.effects.gravity": ("Gravity",),
    "flexctrl.effects.flexibility": ("BeamFlexibility", "Flexible", "RopeStretch", "ShaftElasticity"),
    "flexctrl.effects.component_modes": ("ComponentModes",),
    "flexctrl.effects.large_rotation": ("LargeRotation",),
    "flexctrl.effects.geometric_stiffness": ("GeometricStiffness",),
    "flexctrl.effects.rotating_frame": ("RotatingFrame",),
    "flexctrl.effects.damping": ("ModalDamping", "RayleighDamping"),
    "flexctrl.effects.viscous_friction": ("ViscousFriction",),
    "flexctrl.effects.coulomb_friction": ("Coulomb", "CoulombFriction"),
    "flexctrl.effects.lugre_friction": ("LuGre", "LuGreFriction"),
    "flexctrl.effects.motor_lag": ("MotorLag",),
    "flexctrl.effects.backlash": ("Backlash",),
    "flexctrl.effects.wind": ("Wind",),
    "flexctrl.effects.rope_mass": ("RopeMass",),
    "flexctrl.kernels.kernel": ("CasadiVM", "Compiled"),
    "flexctrl.model.assemble": ("assemble", "rigid"),
    "flexctrl.model.model": ("Model",),
    "flexctrl.model.state": ("State",),
    "flexctrl.model.project": ("Projection", "project"),
    "flexctrl.model.equilibrium": ("Rest", "equilibrium"),
    "flexctrl.model.paths.path": (
        "BranchPoint",
        "EquilibriumPath",
        "LimitPoint",
        "PathEnd",
        "PathPoint",
        "equilibrium_path",
    ),
    "flexctrl.model.linearize": ("linearize",),
    "flexctrl.linear.model": ("LinearModel",),
    "flexctrl.linear.certificate": ("Certificate",),
    "flexctrl.linear.matfile": ("Units",),
    "flexctrl.linear.modes": ("Modes",),
    "flexctrl.linear.response": ("FrequencyResponse",),
    "flexctrl.linear.statespace": ("ModalForm", "PhysicalForm"),
    "flexctrl.linear.discrete": ("FirstOrderHold", "ZeroOrderHold"),
    "flexctrl.model.audit": ("Audit", "audit"),
    "flexctrl.linear.reduction": (
        "BalancedTruncation",
        "BelowFrequency",
        "CraigBampton",
        "DCGain",
        "ErrorReport",
        "Lowest",
        "ModalTruncation",
        "MomentMatching",
        "Participation",
        "Reduced",
        "RelativeError",
    ),
    "flexctrl.dynamics.alpha.method": ("AdaptiveAlpha", "GeneralizedAlpha"),
    "flexctrl.dynamics.methods.checked": ("Checked", "Unchecked"),
    "flexctrl.dynamics.methods.extrapolation": ("Richardson",),
    "flexctrl.dynamics.methods.midpoint": ("ConservingMidpoint",),
    "flexctrl.dynamics.methods.explicit": ("ExplicitRungeKutta",),
    "flexctrl.dynamics.linear_motion.exact": ("Exact",),
    "flexctrl.dynamics.events.event": ("Direction", "Event", "Occurrence"),
    "flexctrl.dynamics.records.record": ("CsvStream", "InMemory"),
    "flexctrl.dynamics.checkpoint": ("Autosave", "Checkpoint", "load_checkpoint"),
    "flexctrl.dynamics.run": ("EnergyBalance", "Moment", "Report", "Run", "Status", "Tolerance"),
    "flexctrl.dynamics.simulate": ("simulate",),
    "flexctrl.dynamics.rail_force": ("rail_force",),
    "flexctrl.dynamics.sampled": ("sampled_response",),
    "flexctrl.design": ("Delayed", "Noisy", "OpenLoop", "Quantised", "RateLimited", "Sampled", "Saturated", "Tracking"),
    "flexctrl.study.loop": ("Loop", "open_loop"),
    "flexctrl.study.broken_loop": ("broken_loop",),
    "flexctrl.study.frequency": ("Margins", "margins", "peak_gain"),
    "flexctrl.study.root_locus": ("CriticalGain", "RootLocus", "critical_gains", "root_locus"),
    "flexctrl.study.zeros": ("SensorChoice", "Zeros", "sensor_choices", "zeros"),
    "flexctrl.study.compare": ("Comparison", "compare"),
    "flexctrl.study.ladder": ("Ladder", "ladder"),
    "flexctrl.study.ledger": ("Ledger",),
    "flexctrl.study.bookkeeping": ("ledger",),
    "flexctrl.study.settings": ("Fidelity", "Setting", "sweep"),
    "flexctrl.study.work_precision": ("WorkPrecision", "work_precision"),
    "flexctrl.study.spillover": ("Spillover", "spillover"),
    "flexctrl.study.confirm": ("Confirmation",),
    "flexctrl.study.amplitudes": ("ConstantLoad", "InitialDisplacement", "InitialMode", "InitialSpeed"),
    "flexctrl.study.predictions": ("CurveDifference", "Deflection", "FinalValue", "Frequency", "Peak", "Period"),
    "flexctrl.study.envelope": ("Envelope", "validity_envelope"),
    "flexctrl.plots.frequency": ("plot_bode",),
    "flexctrl.plots.loops": ("plot_nichols", "plot_nyquist", "plot_sensitivities"),
    "flexctrl.plots.root_locus": ("plot_root_locus",),
    "flexctrl.plots.reduction": ("plot_reduction",),
    "flexctrl.plots.envelope": ("plot_envelope",),
    "flexctrl.scene": ("Scene", "Simulation", "Start", "load_scene"),
}
_HOME = {name: module for module, names in _HOMES.items() for name in names}

__version__ = "0.1.0"
__all__ = sorted(_HOME)


def __getattr__(name: str) -> Any:
    if name in _HOME:
        value = getattr(importlib.import_module(_HOME[name]), name)
        globals()[name] = value
        return value
    if not name.startswith("_") and importlib.util.find_spec(f"flexctrl.{name}"):
        return importlib.import_module(f"flexctrl.{name}")
    raise AttributeError(f"module 'flexctrl' has no attribute {name!r}{_hint(name)}")


def _hint(name: str) -> str:
    if name in importlib.import_module("flexctrl.design").__all__:
        return f"; it is flexctrl.design.{name}"
    close = difflib.get_close_matches(name, __all__, n=1)
    return f"; did you mean {close[0]!r}?" if close else ""


def __dir__() -> list[str]:
    return sorted([*globals(), *__all__])
