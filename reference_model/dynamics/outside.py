"""What the surroundings and devices on board do to the bodies, gathered for one state."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import casadi as ca

__all__ = ["Outside"]


@dataclass(frozen=True)
class Outside:
    """Forces on bodies that no joint makes, and what goes with them, by index of the body in the tree.

    Attributes:
        columns: generalised force on each body, rows as its velocity column, (6 + s) x 1.
        spins: angular momentum that a body carries besides its own motion, in its axes [N m s], 3 x 1.
        stored: energy stored outside the bodies [J].
        rates: time derivative of the states.
        power: that the forces give to the bodies and to what is stored [W].
    """

    columns: Mapping[int, ca.SX] = field(default_factory=dict)
    spins: Mapping[int, ca.SX] = field(default_factory=dict)
    stored: ca.SX = field(default_factory=lambda: ca.SX(1, 1))
    rates: ca.SX = field(default_factory=lambda: ca.SX(0, 1))
    power: ca.SX = field(default_factory=lambda: ca.SX(1, 1))
