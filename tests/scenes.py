"""A small scene for tests of files and commands: a trolley on a drive with a load on a rope."""

from __future__ import annotations

from pathlib import Path

EXAMPLES = Path(__file__).resolve().parents[1] / "examples"

TROLLEY = """
name = "trolley"
notes = ["made up"]

[elements]
trolley = { kind = "point_mass", at = [0, 0, 0], mass = 10.0 }
rope = { kind = "rope", start = "trolley", end = [0, 0, -2], EA = 2e5 }
load = { kind = "point_mass", at = "rope.end", mass = 5.0 }

[[joints]]
kind = "support"
node = "trolley"
held = "v w"

[[joints]]
kind = "pin"
first = "trolley"
second = "rope.start"

[[joints]]
kind = "pin"
first = "rope.end"
second = "load"

[[joints]]
kind = "support"
node = "load"
held = ["v"]

[drives.travel_drive]
kind = "linear"
node = "trolley"
direction = "x"
radius = 0.1
ratio = 10.0
stiffness = 50.0
inertia = 1e-3

[inputs]
torque = { kind = "motor_torque", drive = "travel_drive" }
push = { kind = "force", at = "load", direction = "x" }

[outputs]
travel = { kind = "position", at = "trolley", direction = "x" }
load_z = { kind = "position", at = "load", direction = "z" }
sway = { kind = "sway_angle", top = "trolley", load = "load", direction = "x" }
angle = { kind = "drive_angle", drive = "travel_drive" }
speed = { kind = "drive_speed", drive = "travel_drive" }

[effects]
gravity = true
flexible = true
large_rotation = true
rayleigh_damping = { alpha = 0.0, beta = 1e-3 }

[moves]
along = { kind = "minimum_jerk", distance = 0.5, duration = 0.6 }

[[controllers]]
kind = "pid"
measured = "angle"
rate = "speed"
command = "torque"
kp = 0.2
kd = 0.05
reference = { move = "along", through = "travel_drive" }

[hardware]
sample_time = 0.01
limits = { torque = 2.0 }

[simulation]
until = 0.2
step = 2e-3
rho = 0.8
every = 0.01
start = "equilibrium"
rigid_twin = true
"""
