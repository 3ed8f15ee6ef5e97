"""A joint motion between two samples: the quintic through positions, velocities and accelerations of both."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import casadi as ca

__all__ = ["between"]


def between(ends: Any, length: Any, count: int) -> Callable[[float], tuple[Any, Any, Any]]:
    """Position, velocity and acceleration as functions of the elapsed fraction of the interval.

    Args:
        ends: position, velocity, acceleration at the start, then at the end, 6 n x 1.
        length: of the interval [s]; may be zero.
        count: n.
    """
    q0, v0, a0, q1, v1, a1 = ca.vertsplit(ends, count)
    rise = q1 - q0 - length * v0 - length**2 / 2 * a0
    speed = length * (v1 - v0) - length**2 * a0
    bend = length**2 * (a1 - a0)
    c3 = 10 * rise - 4 * speed + bend / 2
    c4 = -15 * rise + 7 * speed - bend
    c5 = 6 * rise - 3 * speed + bend / 2
    still = length + (length == 0)

    def at(s: float) -> tuple[Any, Any, Any]:
        q = q0 + s * length * v0 + s**2 * length**2 / 2 * a0 + s**3 * c3 + s**4 * c4 + s**5 * c5
        v = v0 + s * length * a0 + (3 * s**2 * c3 + 4 * s**3 * c4 + 5 * s**4 * c5) / still
        a = a0 + (6 * s * c3 + 12 * s**2 * c4 + 20 * s**3 * c5) / still**2
        return q, v, a

    return at
