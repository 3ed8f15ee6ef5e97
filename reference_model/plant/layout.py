"""The state of a simulated robot as one column of numbers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TypeVar

import casadi as ca
import numpy as np
from numpy.typing import NDArray

__all__ = ["Layout"]

Column = TypeVar("Column", ca.SX, ca.MX, NDArray[np.float64])


@dataclass(frozen=True)
class Layout:
    """Names and sizes of the parts of the state, in order.

    Attributes:
        joints: number of moving joints.
        free_base: the base's position (3), attitude (4) and velocity (6) are states.
        effect_states: internal states of the effects at joints.
        integral: the controller integrates the position error of every joint.
        balls: number of spherical joints; their quaternions and angular velocities are states.
        modal: number of modal coordinates.
        work: the work of all forces is integrated.
        motors: number of separate motor coordinates; their positions and velocities are states.
        gear_states: internal states of their gears.
        outer: internal states of the force effects on bodies.
        weights: of an adaptive controller's network.
        losses: the energies dissipated by friction and windings are integrated.
    """

    joints: int
    free_base: bool
    effect_states: int
    integral: bool
    balls: int = 0
    modal: int = 0
    work: bool = False
    motors: int = 0
    gear_states: int = 0
    outer: int = 0
    weights: int = 0
    losses: bool = False

    @property
    def sizes(self) -> Mapping[str, int]:
        """Part to its number of rows."""
        free = 1 if self.free_base else 0
        return {
            "base_position": 3 * free,
            "attitude": 4 * free,
            "position": self.joints,
            "balls": 4 * self.balls,
            "modal": self.modal,
            "motor": self.motors,
            "base_velocity": 6 * free,
            "velocity": self.joints,
            "ball_rates": 3 * self.balls,
            "modal_rates": self.modal,
            "motor_rates": self.motors,
            "gears": self.gear_states,
            "effects": self.effect_states,
            "outer": self.outer,
            "integral": self.joints if self.integral else 0,
            "weights": self.weights,
            "work": 1 if self.work else 0,
            "losses": 2 * self.joints if self.losses else 0,
        }

    @property
    def size(self) -> int:
        """Rows of the whole column."""
        return sum(self.sizes.values())

    @property
    def positions(self) -> int:
        """Rows at the beginning whose rates depend only on attitudes and velocities."""
        return self.rows("base_velocity").start

    def rows(self, part: str) -> slice:
        """Where a part is."""
        names = list(self.sizes)
        start = sum(self.sizes[name] for name in names[: names.index(part)])
        return slice(start, start + self.sizes[part])

    def split(self, column: Column) -> dict[str, Column]:
        """The parts of a column (or of an array of columns, one per sample along axis 0)."""
        parts, start = {}, 0
        for name, size in self.sizes.items():
            rows = slice(start, start + size)
            parts[name] = (
                column[:, rows] if isinstance(column, np.ndarray) and column.ndim == 2 else column[rows]
            )
            start += size
        return parts
