"""A good call of every public name that takes arguments, whose arguments `test_wrong_values` puts wrong in turn."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import matplotlib.pyplot as plt
import numpy as np

import flexctrl as fc
from flexctrl import design as d
from flexctrl.effects.coulomb_friction import Coulomb

Call = tuple[Callable[..., Any], dict[str, Any]]

SECTION = fc.Section.tube(fc.STEEL, 0.03, 0.002)
BAR = fc.Beam("bar", (0, 0, 0), (1, 0, 0), SECTION)
OTHER = fc.Beam("other", (1, 0, 0), (2, 0, 0), SECTION)
ROPE = fc.Rope("rope", (1, 0, 0), (1, 0, -1), 1e5)
BOB = fc.RigidBody("bob", (0, 0, -1), 1.0, (1e-3,) * 3, points={"top": (0, 0, 0)})
DRIVE = fc.RotaryDrive("motor", BOB.node, axis="y", stiffness=50.0, inertia=0.1)
PENDULUM = fc.Structure(
    [BOB],
    [fc.Support(BOB.point("top"), "u v w rx rz")],
    [DRIVE],
    [fc.Torque("push", BOB.node, "y")],
    [fc.Rotation("swing", BOB.node, "y"), fc.AngularVelocity("spin", BOB.node, "y")],
)
EFFECTS = (fc.Gravity(), fc.LargeRotation(), fc.ShaftElasticity())
MODEL = fc.assemble(PENDULUM, EFFECTS, fc.CasadiVM())
REST = fc.equilibrium(MODEL, hold={MODEL.coordinates[-1]: 0.0})
LINEAR = fc.linearize(MODEL, at=REST)
PLANT = LINEAR.to_ss()
LAW = d.pd(2.0, 1.0, measured="swing", rate="spin", command="push")
SAMPLED = fc.Sampled(LAW, 0.01)
LOOP = fc.open_loop(LINEAR, LAW[:, ["swing"]], input="push", output="swing")
RESPONSE = LINEAR.frequency_response(np.geomspace(1.0, 100.0, 30))
LOCUS = fc.root_locus(LOOP)
MOVE = d.MinimumJerk(1.0, 2.0)
SHAPER = d.zv(3.0)
N = PLANT.nstates
Q, R = np.eye(N), np.eye(1)
GAIN = np.ones((1, N))
SCENE = fc.Scene(PENDULUM, EFFECTS, SAMPLED, simulation=fc.Simulation(0.02))
NODES = {"first": BAR.end, "second": OTHER.start}
DRIVEN = {"name": "d", "node": BAR.end, "against": OTHER.start, "stiffness": 1.0, "ratio": 2.0, "inertia": 1.0}

STRUCTURE: dict[str, Call] = {
    "Material": (fc.Material, {"E": 2e11, "rho": 7850.0, "nu": 0.3}),
    "Section": (
        fc.Section,
        dict.fromkeys(("EA", "EI_y", "EI_z", "GJ", "rhoA", "rhoJ", "rhoI_y", "rhoI_z", "GA_y", "GA_z"), 1.0),
    ),
    "Section.tube": (fc.Section.tube, {"material": fc.STEEL, "radius": 0.03, "thickness": 0.002}),
    "Section.box": (
        fc.Section.box,
        {"material": fc.STEEL, "width": 0.1, "height": 0.1, "web": 0.01, "flange": 0.01},
    ),
    "Section.circular": (fc.Section.circular, {"material": fc.STEEL, "radius": 0.03}),
    "Beam": (
        fc.Beam,
        {"name": "b", "start": (0, 0, 0), "end": (1, 0, 0), "section": SECTION, "elements": 2, "up": "z"},
    ),
    "Rope": (
        fc.Rope,
        {"name": "r", "start": (0, 0, 0), "end": (1, 0, 0), "EA": 1.0, "length": 1.0, "damping": 1.0, "rhoA": 1.0}
        | {"elements": 2},
    ),
    "Spring": (
        fc.Spring,
        {"name": "s", "start": (0, 0, 0), "end": (1, 0, 0), "stiffness": 1.0, "length": 1.0, "damping": 1.0},
    ),
    "PointMass": (fc.PointMass, {"name": "p", "at": (0, 0, 0), "mass": 1.0}),
    "RigidBody": (
        fc.RigidBody,
        {"name": "p", "at": (0, 0, 0), "mass": 1.0, "inertia": (1.0, 1.0, 1.0), "points": {"a": (0, 0, 1)}},
    ),
    "BeamChain": (fc.BeamChain, {"name": "c", "points": [(0, 0, 0), (1, 0, 0)], "section": SECTION, "up": "z"}),
    "arc": (fc.arc, {"center": (0, 0, 0), "start": (1, 0, 0), "axis": "z", "angle": 1.0, "elements": 3}),
    "polygon": (fc.polygon, {"points": [(0, 0, 0), (1, 0, 0)]}),
    "Hinge": (fc.Hinge, {**NODES, "axis": "z"}),
    "Pin": (fc.Pin, NODES),
    "Weld": (fc.Weld, NODES),
    "Slide": (fc.Slide, {**NODES, "along": "z"}),
    "Support": (fc.Support, {"node": BAR.start, "held": "u v"}),
    "RotaryDrive": (fc.RotaryDrive, {**DRIVEN, "axis": "z", "damping": 1.0}),
    "LinearDrive": (fc.LinearDrive, {**DRIVEN, "direction": "x", "radius": 1.0, "damping": 1.0}),
    "Winch": (
        fc.Winch,
        {"name": "w", "node": BAR.start, "against": BAR.end, "EA": 1.0, "radius": 1.0, "ratio": 1.0, "inertia": 1.0}
        | {"damping": 1.0, "shortest": 0.1},
    ),
    "AngularVelocity": (fc.AngularVelocity, {"name": "a", "at": BAR.end, "axis": "z", "minus": BAR.start}),
    "Rotation": (fc.Rotation, {"name": "a", "at": BAR.end, "axis": "z", "minus": BAR.start}),
    "Position": (fc.Position, {"name": "a", "at": BAR.end, "direction": "z", "minus": BAR.start}),
    "Velocity": (fc.Velocity, {"name": "a", "at": BAR.end, "direction": "z", "minus": BAR.start}),
    "DriveAngle": (fc.DriveAngle, {"name": "a", "drive": DRIVE}),
    "DriveSpeed": (fc.DriveSpeed, {"name": "a", "drive": DRIVE}),
    "MotorTorque": (fc.MotorTorque, {"name": "a", "drive": DRIVE}),
    "Tension": (fc.Tension, {"name": "a", "line": ROPE}),
    "SwayAngle": (fc.SwayAngle, {"name": "a", "top": ROPE.start, "load": ROPE.end, "direction": "x", "down": "-z"}),
    "WindSpeed": (fc.WindSpeed, {"name": "a", "direction": "x"}),
    **{
        kind.__name__: (kind, {"name": "a", "at": BAR.end, what: "x"})
        for kind, what in (
            (fc.Force, "direction"),
            (fc.FollowerForce, "direction"),
            (fc.Torque, "axis"),
            (fc.FollowerTorque, "axis"),
        )
    },
    "Trolley": (fc.Trolley, {"name": "t", "along": BAR, "at": 0.5, "mass": 1.0}),
    "Structure": (
        fc.Structure,
        {"elements": [BAR], "joints": [fc.Support(BAR.start)], "drives": [], "inputs": [], "outputs": [], "name": "s"},
    ),
    "planar": (fc.planar, {"structure": PENDULUM, "normal": "y"}),
    "refine": (fc.refine, {"structure": PENDULUM, "factor": 2}),
    "coarsen": (fc.coarsen, {"structure": PENDULUM, "of": ()}),
}

EFFECT: dict[str, Call] = {
    "Automatic": (fc.Automatic, {"tolerance": 0.01}),
    "Within": (fc.Within, {"outputs": 0.1, "poles": 0.1, "margins": 0.1}),
    "GeometricStiffness": (fc.GeometricStiffness, {"hold": {"motor_source": 0.0}, "inputs": {"push": 0.0}}),
    "Gravity": (fc.Gravity, {"g": (0, 0, -9.81)}),
    "ComponentModes": (fc.ComponentModes, {"count": 2, "of": ("bar",), "along": 1}),
    "BeamFlexibility": (fc.BeamFlexibility, {"of": ("bar",)}),
    "RopeStretch": (fc.RopeStretch, {"of": ("rope",)}),
    "RopeMass": (fc.RopeMass, {"of": ("rope",)}),
    "ShaftElasticity": (fc.ShaftElasticity, {"of": ("motor",)}),
    "RotatingFrame": (fc.RotatingFrame, {"rate": (0, 0, 1), "center": (0, 0, 0)}),
    "ModalDamping": (fc.ModalDamping, {"ratios": 0.01}),
    "RayleighDamping": (fc.RayleighDamping, {"alpha": 0.1, "beta": 0.1}),
    "ViscousFriction": (fc.ViscousFriction, {"coefficients": {"motor": 1.0}}),
    "Coulomb": (Coulomb, {"kinetic": 1.0, "static": 2.0, "stribeck": 0.1}),
    "CoulombFriction": (fc.CoulombFriction, {"laws": {"motor": 1.0}}),
    "LuGre": (
        fc.LuGre,
        {"stiffness": 1.0, "kinetic": 1.0, "static": 1.0, "stribeck": 1.0, "damping": 1.0, "viscous": 1.0},
    ),
    "LuGreFriction": (fc.LuGreFriction, {"laws": {"motor": fc.LuGre(1.0, 1.0)}}),
    "MotorLag": (fc.MotorLag, {"time_constants": {"motor": 1.0}}),
    "Backlash": (fc.Backlash, {"gaps": {"motor": 1.0}}),
    "Wind": (fc.Wind, {"areas": {"bob": 1.0}, "speed": (1.0, 0, 0), "density": 1.25}),
    "Compiled": (fc.Compiled, {"lanes": 4, "optimize_up_to": 100}),
}

MODELS: dict[str, Call] = {
    "assemble": (fc.assemble, {"structure": PENDULUM, "effects": EFFECTS, "backend": fc.CasadiVM()}),
    "rigid": (fc.rigid, {"model_or_effects": EFFECTS}),
    "project": (fc.project, {"model": MODEL, "wish": MODEL.rest, "velocities": {}}),
    "equilibrium": (
        fc.equilibrium,
        {"model": MODEL, "hold": {MODEL.coordinates[-1]: 0.0}, "inputs": {"push": 0.0}, "start": MODEL.rest}
        | {"tolerance": 1e-9},
    ),
    "equilibrium_path": (
        fc.equilibrium_path,
        {"model": MODEL, "load": {"push": 1.0}, "until": 0.01, "inputs": {}, "hold": {MODEL.coordinates[-1]: 0.0}}
        | {"start": MODEL.rest, "most": 2},
    ),
    "linearize": (fc.linearize, {"model": MODEL, "at": REST, "inputs": {"push": 0.0}}),
    "audit": (fc.audit, {"model": MODEL, "at": REST}),
    "Units": (fc.Units, {"length": "m", "mass": "kg", "time": "s", "force": "N", "angle": "rad"}),
    "ZeroOrderHold": (fc.ZeroOrderHold, {"delay": 0.1}),
    "FirstOrderHold": (fc.FirstOrderHold, {"delay": 0.1}),
    "BalancedTruncation": (fc.BalancedTruncation, {"order": 2, "match_dc": True}),
    "BelowFrequency": (fc.BelowFrequency, {"hz": 1.0}),
    "CraigBampton": (fc.CraigBampton, {"interface": ("motor_source",), "modes": 2, "static_correction": True}),
    "DCGain": (fc.DCGain, {"order": 1, "inputs": ("push",), "outputs": ("swing",)}),
    "Participation": (fc.Participation, {"order": 1, "inputs": ("push",), "outputs": ("swing",)}),
    "Lowest": (fc.Lowest, {"order": 1}),
    "ModalTruncation": (fc.ModalTruncation, {"keep": 2, "static_correction": True}),
    "MomentMatching": (fc.MomentMatching, {"points": (1.0,), "order": 1}),
    "RelativeError": (fc.RelativeError, {"tolerance": 0.1, "up_to_hz": 10.0}),
    "Model.displace": (MODEL.displace, {"q": {MODEL.coordinates[0]: 0.1}}),
    "LinearModel.to_ss": (LINEAR.to_ss, {"modes": LINEAR.modes()}),
    "LinearModel.modes": (LINEAR.modes, {"count": 1}),
    "LinearModel.frequency_response": (LINEAR.frequency_response, {"omega": np.ones(3)}),
    "LinearModel.reduce": (LINEAR.reduce, {"to": fc.ModalTruncation(1)}),
}

RUNS: dict[str, Call] = {
    "AdaptiveAlpha": (
        fc.AdaptiveAlpha,
        {"rho": 0.5, "first_step": 1e-3, "largest_step": 1.0, "most_steps": 1e5},
    ),
    "GeneralizedAlpha": (fc.GeneralizedAlpha, {"step": 1e-3, "rho": 0.5}),
    "Richardson": (fc.Richardson, {"method": fc.GeneralizedAlpha(0.01)}),
    "Checked": (fc.Checked, {"method": fc.GeneralizedAlpha(0.01)}),
    "Unchecked": (fc.Unchecked, {"method": fc.AdaptiveAlpha()}),
    "ConservingMidpoint": (fc.ConservingMidpoint, {"step": 1e-3}),
    "ExplicitRungeKutta": (
        fc.ExplicitRungeKutta,
        {"step": 1e-3, "first_step": 1e-3, "largest_step": 1.0, "most_steps": 1e5},
    ),
    "Exact": (fc.Exact, {"step": 1e-3, "modes": 2}),
    "Event": (
        fc.Event,
        {"name": "e", "of": "swing", "at": 0.0, "direction": fc.Direction.RISING, "terminal": True},
    ),
    "CsvStream": (fc.CsvStream, {"path": "run.csv", "every": 0.1}),
    "InMemory": (fc.InMemory, {"states": 1e6}),
    "Autosave": (fc.Autosave, {"path": "run.checkpoint", "seconds": 1.0}),
    "load_checkpoint": (fc.load_checkpoint, {"path": "run.checkpoint"}),
    "Tolerance": (fc.Tolerance, {"relative": 1e-3, "absolute": 1e-6}),
    "simulate": (
        fc.simulate,
        {"model": MODEL, "controller": SAMPLED, "until": 0.02, "start": MODEL.rest, "inputs": {"push": 1.0}}
        | {"method": fc.GeneralizedAlpha(0.01), "tolerance": fc.Tolerance(), "every": 0.01, "events": ()},
    ),
    "sampled_response": (
        fc.sampled_response,
        {"plant": PLANT, "controller": SAMPLED, "until": 0.02, "initial_state": np.zeros(N), "inputs": {"push": 1.0}}
        | {"points": 4, "rtol": 1e-6, "atol": 1e-9},
    ),
    "Simulation": (fc.Simulation, {"until": 1.0, "method": fc.GeneralizedAlpha(0.1), "every": 0.1, "rigid_twin": True}),
    "Scene": (
        fc.Scene,
        {"structure": PENDULUM, "effects": EFFECTS, "controller": SAMPLED, "loads": {"push": 1.0}}
        | {"simulation": fc.Simulation(1.0), "hold": {"motor_source": 0.0}, "units": fc.Units()},
    ),
    "load_scene": (fc.load_scene, {"path": "crane.toml"}),
}

LAWS: dict[str, Call] = {
    "as_controller": (
        d.as_controller,
        {"controller": LAW, "plant_inputs": ("push",), "plant_outputs": ("swing", "spin")},
    ),
    "FilteredRate": (d.FilteredRate, {"time": 1.0}),
    "observer": (d.observer, {"plant": PLANT, "gain": np.ones((N, 2))}),
    "observer_feedback": (
        d.observer_feedback,
        {"gain": GAIN, "observer_gain": np.ones((N, 2)), "plant": PLANT},
    ),
    "pd": (d.pd, {"kp": 1.0, "kd": 1.0, "measured": "swing", "rate": "spin", "command": "push"}),
    "pi": (d.pi, {"kp": 1.0, "ki": 1.0, "measured": "swing", "command": "push"}),
    "pid": (d.pid, {"kp": 1.0, "ki": 1.0, "kd": 1.0, "measured": "swing", "rate": "spin", "command": "push"}),
    "state_feedback": (d.state_feedback, {"gain": GAIN, "plant": PLANT}),
    "AntiWindup": (
        d.AntiWindup,
        {"controller": d.pi(1.0, 1.0, measured="swing", command="push"), "limits": {"push": 1.0}},
    ),
    "Delayed": (fc.Delayed, {"controller": SAMPLED, "samples": 2, "before": {"push": 0.0}}),
    "Noisy": (fc.Noisy, {"controller": SAMPLED, "std": {"swing": 0.1}, "seed": 3}),
    "Quantised": (fc.Quantised, {"controller": SAMPLED, "steps": {"swing": 0.1}}),
    "RateLimited": (fc.RateLimited, {"controller": SAMPLED, "limits": {"push": 1.0}, "before": {"push": 0.0}}),
    "Sampled": (fc.Sampled, {"controller": LAW, "sample_time": 0.1}),
    "Held": (d.Held, {"controller": SAMPLED, "sample_time": 0.005}),
    "Saturated": (fc.Saturated, {"controller": LAW, "limits": {"push": 1.0}}),
    "bryson": (d.bryson, {"plant": PLANT, "outputs": {"swing": 1.0, "spin": 1.0}, "inputs": {"push": 1.0}}),
    "kalman": (d.kalman, {"plant": PLANT, "process": Q, "measurement": np.eye(2)}),
    "lqr": (d.lqr, {"plant": PLANT, "state_cost": Q, "input_cost": R}),
    "lqg": (
        d.lqg,
        {"plant": PLANT, "state_cost": Q, "input_cost": R, "process": Q, "measurement": np.eye(2)},
    ),
    "Constant": (d.Constant, {"value": 1.0}),
    "PiecewisePolynomial": (
        d.PiecewisePolynomial,
        {"knots": (0.0, 1.0), "coefficients": ((0.0, 1.0), (1.0,)), "before": 0.0},
    ),
    "Sum": (d.Sum, {"terms": (MOVE,)}),
    "Mode": (d.Mode, {"omega": 1.0, "zeta": 0.1}),
    "Shaper": (d.Shaper, {"amplitudes": (0.5, 0.5), "times": (0.0, 1.0)}),
    "ei": (d.ei, {"omega": 1.0, "zeta": 0.1, "tolerance": 0.05}),
    **{
        make.__name__: (make, {"omega": 1.0, "zeta": 0.1})
        for make in (d.zv, d.zvd, d.zvdd, d.um_zv, d.um_zvd, d.um_zv_fit, d.um_zvd_fit)
    },
    "Shaped": (d.Shaped, {"trajectory": MOVE, "shaper": SHAPER}),
    "fir": (d.fir, {"shaper": SHAPER, "sample_time": 0.1, "source": "a", "shaped": "b"}),
    "Commanded": (d.Commanded, {"controller": LAW, "signals": {"swing": MOVE}}),
    "FeedForward": (d.FeedForward, {"controller": LAW, "commands": {"push": MOVE}}),
    "OpenLoop": (d.OpenLoop, {"commands": {"push": MOVE}, "sample_time": 0.1}),
    "Tracking": (d.Tracking, {"controller": LAW, "reference": {"swing": MOVE}}),
    "MinimumJerk": (d.MinimumJerk, {"distance": 1.0, "duration": 1.0, "at": 0.0, "start": 0.0}),
    "Ramp": (d.Ramp, {"slope": 1.0, "duration": 1.0, "at": 0.0, "start": 0.0}),
    "Step": (d.Step, {"size": 1.0, "at": 0.0, "start": 0.0}),
    "Spline": (d.Spline, {"times": (0.0, 1.0, 2.0), "values": (0.0, 1.0, 2.0)}),
    "Table": (d.Table, {"times": (0.0, 1.0, 2.0), "values": (0.0, 1.0, 2.0)}),
    "TimeOptimalPendulum": (
        d.TimeOptimalPendulum,
        {"distance": 1.0, "acceleration": 1.0, "omega": 1.0, "at": 0.0, "start": 0.0},
    ),
    "TrapezoidalVelocity": (
        d.TrapezoidalVelocity,
        {"distance": 1.0, "speed": 1.0, "acceleration": 1.0, "at": 0.0, "start": 0.0},
    ),
}

STUDIES: dict[str, Call] = {
    "open_loop": (fc.open_loop, {"plant": LINEAR, "controller": 2.0, "input": "push", "output": "swing"}),
    "broken_loop": (fc.broken_loop, {"plant": LINEAR, "controller": LAW, "input": "push"}),
    "margins": (fc.margins, {"loop": LOOP}),
    "peak_gain": (fc.peak_gain, {"system": LINEAR}),
    "critical_gains": (fc.critical_gains, {"loop": LOOP, "locus": LOCUS}),
    "root_locus": (fc.root_locus, {"loop": LOOP, "gains": [1.0, 2.0]}),
    "sensor_choices": (fc.sensor_choices, {"linear": LINEAR, "below": 10.0}),
    "zeros": (fc.zeros, {"linear": LINEAR, "inputs": ["push"], "outputs": ["swing"]}),
    "compare": (fc.compare, {"subject": MODEL, "until": 0.01}),
    "ladder": (fc.ladder, {"scene": SCENE, "tolerance": 0.01}),
    "ledger": (fc.ledger, {"scene": SCENE, "tolerance": 0.01}),
    "Setting": (
        fc.Setting,
        {"fidelity": fc.Fidelity.FULL, "mesh": 1, "method": fc.GeneralizedAlpha(0.1), "tolerance": fc.Tolerance()},
    ),
    "sweep": (fc.sweep, {"scene": SCENE}),
    "work_precision": (fc.work_precision, {"scene": SCENE, "tolerance": 0.01}),
    "spillover": (fc.spillover, {"plant": LINEAR, "controller": LAW, "least": 0.1, "most": 2.0}),
    "ConstantLoad": (fc.ConstantLoad, {"inputs": {"push": 1.0}}),
    "InitialMode": (fc.InitialMode, {"number": 1, "measured_by": "swing"}),
    **{
        kind.__name__: (kind, {what: "swing"})
        for kind, what in (
            (fc.InitialDisplacement, "coordinate"),
            (fc.InitialSpeed, "coordinate"),
            (fc.CurveDifference, "output"),
            (fc.Deflection, "output"),
            (fc.FinalValue, "output"),
            (fc.Peak, "output"),
            (fc.Period, "output"),
        )
    },
    "Frequency": (fc.Frequency, {"mode": 1}),
    "validity_envelope": (
        fc.validity_envelope,
        {"model": MODEL, "vary": fc.InitialSpeed(MODEL.coordinates[0]), "quantity": fc.Period("swing"), "error": 0.01},
    ),
}

PLOTS: dict[str, Call] = {
    "plot_bode": (fc.plot_bode, {"responses": RESPONSE, "axes": plt.subplots(2)[1], "channel": ("swing", "push")}),
    "plot_nichols": (fc.plot_nichols, {"loops": LOOP, "ax": plt.subplots()[1], "gain": (-40.0, 40.0)}),
    "plot_nyquist": (fc.plot_nyquist, {"loops": LOOP, "ax": plt.subplots()[1], "radius": 3.0}),
    "plot_sensitivities": (fc.plot_sensitivities, {"loops": LOOP, "ax": plt.subplots()[1]}),
    "plot_root_locus": (fc.plot_root_locus, {"loci": LOCUS, "ax": plt.subplots()[1], "critical": (), "top": 10.0}),
    "plot_reduction": (
        fc.plot_reduction,
        {"reduced": LINEAR.reduce(fc.ModalTruncation(1)), "ax": plt.subplots()[1], "channel": ("swing", "push")},
    ),
}

SLOW = {"compare", "ladder", "ledger", "sweep", "work_precision", "validity_envelope", "spillover"}
"""Studies: what is no scene, model or number is to be found before their runs start."""

RESULTS = """
    Audit BranchPoint Certificate Checkpoint Comparison Confirmation Controller CriticalGain Direction
    EnergyBalance Envelope EquilibriumPath ErrorReport Fidelity FrequencyResponse JoinTable Ladder Ledger
    LimitPoint LinearModel Loop Margins Modes Model Moment Node Occurrence PathEnd PathPoint Projection Reduced
    Report Rest RootLocus Run SensorChoice Spillover Start State Status WorkPrecision Zeros Estimator Regulator
    Trajectory ControllerError DesignError CoarseGridWarning IdleInputWarning STEEL plot_envelope rail_force convolve
    Together
""".split()  # noqa: SIM905
"""What is read, not made, and what takes any number of arguments."""
