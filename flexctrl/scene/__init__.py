"""Scenes: a machine, its physics and its controller, from a TOML file or from Python."""

from __future__ import annotations

from flexctrl.scene.control import PID, Controlled, Gains, Hardware, Law, Move, Reference, StateFeedback, Transfer
from flexctrl.scene.files import load_scene
from flexctrl.scene.scene import Channel, Plan, Scene, Simulation, Start

__all__ = [
    "PID",
    "Channel",
    "Controlled",
    "Gains",
    "Hardware",
    "Law",
    "Move",
    "Plan",
    "Reference",
    "Scene",
    "Simulation",
    "Start",
    "StateFeedback",
    "Transfer",
    "load_scene",
]
