"""Forces of the surroundings and of devices on board on the bodies, collected for one state."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import casadi as ca

__all__ = ["Outside"]


@dataclass(frozen=True)
class Outside:
    """Forces on bodies other than joint forces, with energy and states, by index of the body in the tree.

    Attributes:
        columns: generalised force on each body, rows as its velocity column, (6 + s) x 1.
        spins: angular momentum on board a body in addition to its own, in its axes [N m s], 3 x 1.
        stored: energy stored outside the bodies [J].
        rates: time derivative of the states.
        power: delivered by the forces to the bodies and to the stored energy [W].
    """

    columns: Mapping[int, ca.SX] = field(default_factory=dict)
    spins: Mapping[int, ca.SX] = field(default_factory=dict)
    stored: ca.SX = field(default_factory=lambda: ca.SX(1, 1))
    rates: ca.SX = field(default_factory=lambda: ca.SX(0, 1))
    power: ca.SX = field(default_factory=lambda: ca.SX(1, 1))
