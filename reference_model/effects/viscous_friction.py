"""Viscous friction: proportional to the speed."""

from __future__ import annotations

import casadi as ca

from reference_model.effects.base import JointEffect, JointSignals, Parameter, Values

__all__ = ["ViscousFriction"]


class ViscousFriction(JointEffect):
    """T = -c qd."""

    id = "viscous_friction"
    title = "Viscous friction"
    place = "joint"
    standard = "viscous"
    parameters = (
        Parameter(
            "coefficient",
            "N m s/rad",
            "friction torque per speed",
            0.0,
            1e5,
            1.0,
            absent=0.0,
            linear=True,
        ),
    )
    equation = "T = -coefficient * qd"
    source = "Armstrong-Helouvry, Dupont, Canudas de Wit, Automatica 30 (1994) 1083-1138"
    signature = "torque residual in proportion to the velocity; it vanishes at rest and has no memory"
    confused_with = ("sensor_delay", "actuator_lag", "modal_damping", "stribeck_friction", "torque_gain")
    experiment = "constant speeds, six or more: the friction torque against speed is a straight line"
    is_friction_law = True
    needs = ("velocity",)

    def torque(self, s: JointSignals, p: Values, z: ca.SX) -> ca.SX:
        return -p["coefficient"] * s.kinetic_factor * s.velocity
