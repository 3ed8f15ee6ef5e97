"""Torque offset: a constant torque that was not commanded."""

from __future__ import annotations

import casadi as ca

from reference_model.effects.base import JointEffect, JointSignals, Parameter, Values

__all__ = ["TorqueOffset"]


class TorqueOffset(JointEffect):
    """T = T_0."""

    id = "torque_offset"
    title = "Torque offset"
    place = "actuator"
    standard = "offset"
    parameters = (
        Parameter(
            "torque", "N m", "delivered minus commanded torque", -1e5, 1e5, 1.0, absent=0.0, linear=True
        ),
    )
    equation = "T = torque"
    source = (
        "Janot, Gautier, Brunot, Data set and reference models of EMPS, NonlinearBenchmark workshop (2019)"
    )
    signature = "a constant residual, the same at rest, in both directions and at all positions"
    confused_with = ("asymmetric_friction", "gravity", "cable_spring", "sensor_offset", "coulomb_friction")
    experiment = "hold several positions, then turn the robot over: an offset of the drive stays as it is"
    needs = ("torque",)

    def torque(self, s: JointSignals, p: Values, z: ca.SX) -> ca.SX:
        return ca.SX(p["torque"])
