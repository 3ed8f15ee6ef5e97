"""Cable spring: a harness or hose that pulls the joint towards a neutral position."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import casadi as ca

from reference_model.effects.base import JointEffect, JointSignals, Parameter, Values

__all__ = ["CableSpring"]


class CableSpring(JointEffect):
    """T = T_0 - k q, that is -k (q - q_0) with the neutral position q_0 = T_0 / k.

    T_0 is estimated and not q_0: the law is then linear in both, and both keep an influence even if the
    spring is weak.
    """

    id = "cable_spring"
    title = "Cable or hose spring"
    place = "joint"
    essential = ("stiffness",)
    contains: ClassVar[Mapping[str, Mapping[str, str]]] = {"torque_offset": {"torque": "torque_at_zero"}}
    parameters = (
        Parameter("stiffness", "N m/rad", "spring rate", 0.0, 1e5, 1.0, absent=0.0, linear=True),
        Parameter(
            "torque_at_zero",
            "N m",
            "spring torque at joint position 0; the neutral position is torque_at_zero / stiffness",
            -1e5,
            1e5,
            1.0,
            absent=0.0,
            linear=True,
            default=0.0,
        ),
    )
    equation = "T = torque_at_zero - stiffness * q"
    source = "ECSS-E-ST-33-01C, Space Engineering: Mechanisms (2009), torque budget (springs and harnesses)"
    signature = "a torque that follows the position, even in direction and present at rest"
    confused_with = ("gravity", "torque_offset", "asymmetric_friction", "joint_elasticity", "end_stop")
    experiment = "holding torque up and down over the full travel: a straight line, unlike gravity's sine"
    needs = ("position",)

    def torque(self, s: JointSignals, p: Values, z: ca.SX) -> ca.SX:
        return p["torque_at_zero"] - p["stiffness"] * s.position
