"""Asymmetric friction: the difference of friction between the two directions."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import casadi as ca

from reference_model.effects.base import JointEffect, JointSignals, Parameter, Values

__all__ = ["AsymmetricFriction"]


class AsymmetricFriction(JointEffect):
    """T = -(dTc |sgn qd| + dc |qd|), added to a symmetric law.

    |sgn v| is smoothed to tanh(v/vt)^2 and |v| to v tanh(v/vt): zero at rest, and at every speed no larger
    than the symmetric terms tanh(v/vt) and v, so that total friction dissipates whenever
    |dTc| <= Tc and |dc| <= c.
    """

    #: While the joint slides, the constant part acts like a torque offset.
    contains: ClassVar[Mapping[str, Mapping[str, str]]] = {"torque_offset": {"torque": "coulomb_difference"}}
    id = "asymmetric_friction"
    title = "Direction-dependent friction"
    place = "joint"
    parameters = (
        Parameter(
            "coulomb_difference",
            "N m",
            "half the difference of Coulomb friction forwards and backwards",
            -1e5,
            1e5,
            0.5,
            absent=0.0,
            linear=True,
        ),
        Parameter(
            "viscous_difference",
            "N m s/rad",
            "half the difference of the viscous coefficient forwards and backwards",
            -1e5,
            1e5,
            0.1,
            absent=0.0,
            linear=True,
        ),
    )
    equation = "T = -(coulomb_difference * |sgn(qd)| + viscous_difference * |qd|)"
    source = "Armstrong-Helouvry, Dupont, Canudas de Wit, Automatica 30 (1994) 1083-1138"
    signature = "the mean of both directions' friction is not zero, grows with speed, and vanishes at rest"
    confused_with = ("torque_offset", "gravity", "cable_spring", "sensor_offset")
    experiment = "constant speeds in both directions at several positions, and the torque held at standstill"
    builds_on = ("viscous_friction", "coulomb_friction", "stribeck_friction", "lugre_friction")
    simpler = ("torque_offset",)
    is_friction_law = True
    needs = ("velocity",)

    def torque(self, s: JointSignals, p: Values, z: ca.SX) -> ca.SX:
        sign = s.sign
        difference = p["coulomb_difference"] * sign**2 + p["viscous_difference"] * s.velocity * sign
        return -s.kinetic_factor * difference
