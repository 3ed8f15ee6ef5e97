"""Spatial frequencies at which an effect that is periodic in position is searched for.

An `order` k is an angular spatial frequency: the effect contains cos(k q) and sin(k q), q in rad (or m).
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
#: Multiples of a joint's turn and of a motor's turn that are typical of gears and encoders.
TURN_MULTIPLES = (1.0, 2.0)
#: The travel must cover this fraction of a cycle, or the order looks like a constant and a slope.
LEAST_CYCLES = 0.75
#: Orders closer than this fraction of a cycle over the travel count as one start: their fits agree.
SAME_CYCLES = 0.25


def order_parameter(meaning: str, typical: float = 1.0, default: float | None = None) -> Parameter:
    """The parameter `order`."""
    return Parameter("order", "1/rad", meaning, 1e-2, 1e5, typical, default=default)


def order_starts(
    extent: Extent, parameter: Parameter, fixed: Mapping[str, float] | None = None
) -> tuple[dict[str, float], ...]:
    """Starting values `{"order": k}`: peaks of the residual first, then multiples of joint and motor turns.

    Orders that the travel does not cover, or that the sampling cannot resolve at the slow speed, are omitted;
    if none remains, one cycle over the travel is tried.

    Args:
        extent: what the recording covers.
        parameter: the order, for its bounds.
        fixed: further values included in every start.
    """
    travel = max(extent.position[1] - extent.position[0], 1e-9)
    turns = [ratio * k for ratio in (1.0, extent.gear_ratio) for k in TURN_MULTIPLES]
    found = _distinct([*extent.orders, *turns], extent, parameter, travel)
    found = found or [min(max(2 * math.pi / travel, parameter.lower), parameter.upper)]
    return tuple({"order": order, **(fixed or {})} for order in found[:MOST_STARTS])


def _distinct(orders: Iterable[float], extent: Extent, parameter: Parameter, travel: float) -> list[float]:
    """The observable orders, without near duplicates, in the given sequence."""
    cycle = 2 * math.pi / travel
    step = max(extent.slow * extent.sample_time, 1e-12)
    highest = min(parameter.upper, math.pi / step)
    kept: list[float] = []
    for order in orders:
        seen = max(parameter.lower, LEAST_CYCLES * cycle) <= order <= highest
        if seen and all(abs(order - other) > SAME_CYCLES * cycle for other in kept):
            kept.append(order)
    return kept
