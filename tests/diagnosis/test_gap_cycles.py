"""Encoder errors of an order that nobody said: found with their order, and not read into other curves."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from test_transmission import SLACK, Motion, diagnose, elasticity

Array = NDArray[np.float64]

COSINE, SINE = -1.4e-4, 3e-4
#: Half a cycle over the way, and a dozen.
ORDERS = (1.4, 33.0)


def error(motion: Motion, order: float) -> Array:
    return COSINE * np.cos(order * motion.position) + SINE * np.sin(order * motion.position)


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("beside", [None, elasticity])
def test_an_order_that_is_no_multiple_of_a_turn_is_found(order: float, beside: object) -> None:
    def gap(motion: Motion) -> Array:
        return error(motion, order) + (elasticity(motion) if beside else 0.0)

    result = diagnose(gap, 1)
    wanted = {"encoder_eccentricity"} | ({"joint_elasticity"} if beside else set())
    assert {finding.effect for finding in result.findings} == wanted
    [found] = [f for f in result.findings if f.effect == "encoder_eccentricity"]
    assert found.location == "joint1.position"
    for name, value in {"order": order, "cosine": COSINE, "sine": SINE}.items():
        low, high = found.parameters[name].ci95
        half = SLACK * (high - low) / 2
        assert abs(found.parameters[name].value - value) <= half, name
    # An order that is told at all is told to a quarter of a cycle over the way; here noise is a hundredth.
    low, high = found.parameters["order"].ci95
    assert high - low < 0.1 * order


def test_a_curve_over_position_is_no_cycle() -> None:
    """Three orders of one size: the best of them leaves most to the others."""

    def gap(motion: Motion) -> Array:
        return sum((2e-4 * np.sin(order * motion.position) for order in (7.3, 12.1, 19.7)), np.zeros(1))

    result = diagnose(gap, 1)
    assert "encoder_eccentricity" not in {finding.effect for finding in result.findings}
    assert any("nothing that was tried explains it" in words for words in result.could_not_tell)
