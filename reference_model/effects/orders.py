"""Spatial frequencies: where an effect that repeats with the angle is looked for.

An `order` k is an angular spatial frequency: the effect runs through cos(k q) and sin(k q), q in rad (or m).
On a revolute joint k = 1 is once per turn of the joint and k = gear ratio once per turn of the motor. One
cycle takes the travel 2 pi / k.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping

from reference_model.effects.base import Extent, Parameter

__all__ = ["order_parameter", "order_starts"]

#: At most this many starting values.
MOST_STARTS = 12
#: Multiples of a joint's turn and of a motor's turn that gears and encoders are known for.
TURN_MULTIPLES = (1.0, 2.0)
#: An order must run through this share of a cycle, or it is a constant and a slope.
LEAST_CYCLES = 0.75
#: Orders closer than this share of a cycle over the travel are one start: their fits end alike.
SAME_CYCLES = 0.25


def order_parameter(meaning: str, typical: float = 1.0, default: float | None = None) -> Parameter:
    """The parameter `order`."""
    return Parameter("order", "1/rad", meaning, 1e-2, 1e5, typical, default=default)


def order_starts(
    extent: Extent, parameter: Parameter, fixed: Mapping[str, float] | None = None
) -> tuple[dict[str, float], ...]:
    """Starting values `{"order": k}`: peaks of the residual first, then multiples of joint and motor turns.

    Orders that the travel does not run through, or that the sampling cannot follow at the slow speed, are
    left out; when none is left, one cycle over the travel is tried.

    Args:
        extent: what the recording covers.
        parameter: the order, for its bounds.
        fixed: further values that every start shall carry.
    """
    travel = max(extent.position[1] - extent.position[0], 1e-9)
    turns = [ratio * k for ratio in (1.0, extent.gear_ratio) for k in TURN_MULTIPLES]
    found = _distinct([*extent.orders, *turns], extent, parameter, travel)
    found = found or [min(max(2 * math.pi / travel, parameter.lower), parameter.upper)]
    return tuple({"order": order, **(fixed or {})} for order in found[:MOST_STARTS])


def _distinct(orders: Iterable[float], extent: Extent, parameter: Parameter, travel: float) -> list[float]:
    """Those that can be seen, without near repetitions, in the given order."""
    cycle = 2 * math.pi / travel
    step = max(extent.slow * extent.sample_time, 1e-12)
    highest = min(parameter.upper, math.pi / step)
    kept: list[float] = []
    for order in orders:
        seen = max(parameter.lower, LEAST_CYCLES * cycle) <= order <= highest
        if seen and all(abs(order - other) > SAME_CYCLES * cycle for other in kept):
            kept.append(order)
    return kept
