"""The energy books of a run: work in, dissipated, and what is stored, checked now and then."""

from __future__ import annotations

import time

import numpy as np

from flexctrl.dynamics.steps import Block, Point
from flexctrl.model.model import Model
from flexctrl.model.motion import State

__all__ = ["Books"]


class Books:
    """What a run has turned over, and how far each degree of freedom has been from its start."""

    def __init__(self, model: Model, state: State) -> None:
        self.model = model
        kinetic, stored, _ = model.energy(state)
        self.start = kinetic + stored
        self.work = self.lost = self.residual = self.closure = 0.0
        self.turnover = 0.0
        self.moved = np.zeros(model.n)
        self.first = state.q
        probe = np.linspace(1.0, 2.0, model.n)
        self.dissipates = model.energy(state.with_(v=probe))[2] != 0.0
        self.power = model.energy(state)[2] if self.dissipates else 0.0
        self.checked = time.perf_counter()
        self.worst = 0.0

    def enter(self, before: Point, after: Point) -> None:
        """Enter a step."""
        step = after.state.q - before.state.q
        forces = self.model.loads(before.state, before.supply.u) + self.model.loads(after.state, after.supply.u)
        self.work += 0.5 * float(forces @ step)
        self.moved = np.maximum(self.moved, np.abs(after.state.q - self.first))
        if self.dissipates:
            power = self.model.energy(after.state)[2]
            self.lost += 0.5 * (self.power + power) * (after.state.t - before.state.t)
            self.power = power
        if time.perf_counter() - self.checked > 0.05:
            self.close(after)

    def enter_block(self, before: Point, block: Block) -> None:
        """Enter many steps."""
        self.work += block.work
        self.lost += block.lost
        self.moved = np.maximum(self.moved, np.abs(before.state.q - self.first) + block.reach)
        if self.dissipates:
            self.power = self.model.energy(block.last.state)[2]
        if time.perf_counter() - self.checked > 0.05:
            self.close(block.last)

    def close(self, point: Point) -> None:
        """Draw the balance."""
        kinetic, stored, _ = self.model.energy(point.state)
        gap = kinetic + stored - self.start - self.work + self.lost
        turnover = max(kinetic, abs(self.work), self.lost, abs(stored + kinetic - self.start))
        self.turnover = max(self.turnover, turnover)
        self.worst = max(self.worst, abs(gap))
        self.residual = self.worst / self.turnover if self.turnover > 0.0 else 0.0
        self.closure = max(self.closure, self.model.motion.closure_error(point.state))
        self.checked = time.perf_counter()
