"""Actuator lag: the delivered torque follows the command with a first-order delay."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import casadi as ca

from reference_model.effects.base import Extent, JointEffect, JointSignals, Parameter, Values

__all__ = ["ActuatorLag"]

#: Added to the time constant so that its rate stays finite at zero [s]; a thousandth of common sampling.
SMALLEST_LAG = 1e-6
#: Starting values, in sample times.
SAMPLE_MULTIPLES = (1.0, 5.0, 25.0)


class ActuatorLag(JointEffect):
    """zd = (u - z)/time_constant, T = z - u; the state z is the delivered torque."""

    id = "actuator_lag"
    title = "Actuator lag"
    place = "actuator"
    parameters = (
        Parameter(
            "time_constant", "s", "of the first-order response of the torque", 0.0, 1.0, 5e-3, absent=0.0
        ),
    )
    equation = "zd = (u - z) / time_constant, T = z - u, u = actuator torque"
    source = (
        "Siciliano, Sciavicco, Villani and Oriolo, Robotics: Modelling, Planning and Control (2009), ch. 5 "
        "(electric drives: windings and current loops respond with L/R or the loop's bandwidth)"
    )
    signature = "a residual proportional to the rate of the torque, with the phase of a low-pass filter"
    confused_with = ("sensor_delay", "viscous_friction", "joint_elasticity", "torque_saturation")
    experiment = "phase against frequency in a sweep: a straight line for a delay, an arc tangent for a lag"
    states = 1
    uses_torque = True
    replaces_delay = True
    needs = ("torque",)

    def torque(self, s: JointSignals, p: Values, z: ca.SX) -> ca.SX:
        return z - s.torque

    def state_rate(self, s: JointSignals, p: Values, z: ca.SX) -> ca.SX:
        return (s.torque - z) / (p["time_constant"] + SMALLEST_LAG)

    def initial_state(self, s: JointSignals, p: Values) -> ca.SX:
        return ca.SX(s.torque)

    def starts(self, extent: Extent) -> Sequence[Mapping[str, float]]:
        upper = self.parameter("time_constant").upper
        return tuple({"time_constant": min(k * extent.sample_time, upper)} for k in SAMPLE_MULTIPLES)
