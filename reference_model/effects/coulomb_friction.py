"""Coulomb friction: constant magnitude, against the motion."""

from __future__ import annotations

import casadi as ca

from reference_model.effects.base import JointEffect, JointSignals, Parameter, Values

__all__ = ["CoulombFriction"]


class CoulombFriction(JointEffect):
    """T = -T_c sgn(qd)."""

    id = "coulomb_friction"
    title = "Coulomb friction"
    place = "joint"
    standard = "coulomb"
    parameters = (
        Parameter("torque", "N m", "friction torque at any speed", 0.0, 1e5, 5.0, absent=0.0, linear=True),
    )
    equation = "T = -torque * sgn(qd)"
    source = "Armstrong-Helouvry, Dupont, Canudas de Wit, Automatica 30 (1994) 1083-1138"
    signature = "square wave in the torque residual; it jumps by 2 T_c where the velocity changes sign"
    confused_with = ("stribeck_friction", "lugre_friction", "backlash", "load_dependent_friction")
    experiment = (
        "constant speeds in both directions: half the difference of the torques does not depend on speed"
    )
    family = "dry_friction"
    rung = 1
    is_friction_law = True

    def torque(self, s: JointSignals, p: Values, z: ca.SX) -> ca.SX:
        return -p["torque"] * s.kinetic_factor * s.sign
