"""Torque gain: the delivered torque differs from the command by a constant factor."""

from __future__ import annotations

import casadi as ca

from reference_model.effects.base import JointEffect, JointSignals, Parameter, Values

__all__ = ["TorqueGain"]


class TorqueGain(JointEffect):
    """Delivered = (1 + e) commanded, so T = e u."""

    id = "torque_gain"
    title = "Torque gain error"
    place = "actuator"
    parameters = (
        Parameter(
            "gain_error",
            "-",
            "delivered over commanded torque, minus one",
            -0.9,
            2.0,
            0.05,
            absent=0.0,
            linear=True,
        ),
    )
    equation = "T = gain_error * u, u = actuator torque"
    source = "Gautier and Briot, J. Dyn. Sys. Meas. Control 136 (2014), on joint drive gains"
    signature = "a residual proportional to the torque in every regime"
    confused_with = ("inertia", "payload", "viscous_friction", "load_dependent_friction", "sensor_gain")
    experiment = (
        "repeat a motion with a payload of known mass: the gain scales every torque, a wrong inertia only "
        "inertial ones"
    )
    uses_torque = True
    per_torque = ("gain_error",)
    needs = ("torque",)

    def torque(self, s: JointSignals, p: Values, z: ca.SX) -> ca.SX:
        return p["gain_error"] * s.torque
