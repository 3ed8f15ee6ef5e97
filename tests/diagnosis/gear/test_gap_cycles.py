"""Encoder errors of unknown order are found with their order, and not confused with other curves."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from test_transmission import ROBOT, SLACK, Motion, diagnose, elasticity
from two_encoders import along_each

from missing_physics.diagnosis.gear.transmission import diagnose_transmission
from robot_model import Recording

Array = NDArray[np.float64]

#: The links' torque follows from the joint's encoder, so that its error is in the twist of the gear as well.
SHARED = 0.02
COSINE, SINE = -1.4e-4, 3e-4
#: Half a cycle over the way, and a dozen.
ORDERS = (1.4, 33.0)


def error_at(position: Array, order: float) -> Array:
    return COSINE * np.cos(order * position) + SINE * np.sin(order * position)


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("beside", [False, True])
def test_non_integer_order_of_a_gear_error_is_found(order: float, *, beside: bool) -> None:
    def gap(motion: Motion) -> Array:
        return error_at(motion.position, order) + (elasticity(motion) if beside else 0.0)

    result = diagnose(gap, 1)
    wanted = {"encoder_eccentricity"} | ({"joint_elasticity"} if beside else set())
    assert {finding.effect for finding in result.findings} == wanted
    [found] = [f for f in result.findings if f.effect == "encoder_eccentricity"]
    assert found.location == "joint1.position"
    for name, value in {"order": order, "cosine": COSINE, "sine": SINE}.items():
        low, high = found.parameters[name].ci95
        half = max(SLACK * (high - low) / 2, SHARED * abs(value) if beside else 0.0)
        assert abs(found.parameters[name].value - value) <= half, name
    # An identifiable order is known to a quarter of a cycle over the travel; noise is a hundredth.
    low, high = found.parameters["order"].ci95
    assert high - low < 0.1 * order


def test_orders_are_found_for_a_joint_that_mostly_rests() -> None:
    """The median speed of all samples is nothing then, by which there would be no end of orders."""
    time = np.arange(0.0, 20.0, 0.004)
    phase = np.clip(time / 7.0, 0.0, 1.0)
    position = 1.5 * (phase - np.sin(2 * np.pi * phase) / (2 * np.pi))
    other = position + error_at(position, 33.0)
    torque = 150.0 * np.sin(position)
    channels = {"joint1.motor_position": position, "joint1.position": other, "joint1.torque": torque}
    run = Recording(time=time, channels=channels, source="rests")
    result = diagnose_transmission(ROBOT, [run], (), along=along_each(ROBOT, [run]))
    assert result is not None
    [found] = [f for f in result.findings if f.effect == "encoder_eccentricity"]
    assert found.parameters["order"].value == pytest.approx(33.0, rel=0.01)
