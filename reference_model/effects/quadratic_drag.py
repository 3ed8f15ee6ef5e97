"""Quadratic drag: resistance of a fluid, proportional to the square of the speed."""

from __future__ import annotations

import casadi as ca

from reference_model.effects.base import JointEffect, JointSignals, Parameter, Values

__all__ = ["QuadraticDrag"]


class QuadraticDrag(JointEffect):
    """T = -c |qd| qd."""

    id = "quadratic_drag"
    title = "Quadratic drag"
    place = "joint"
    parameters = (
        Parameter(
            "coefficient",
            "N m s^2/rad^2",
            "drag torque per speed squared",
            0.0,
            1e5,
            1.0,
            absent=0.0,
            linear=True,
        ),
    )
    equation = "T = -coefficient * |qd| qd"
    source = "Batchelor, An Introduction to Fluid Dynamics (1967), sec. 5.11 (drag at large Reynolds numbers)"
    signature = "a torque against the motion that grows with the square of the speed, and none at slow speeds"
    confused_with = ("viscous_friction", "stribeck_friction", "torque_gain", "actuator_lag")
    experiment = "constant speeds up to the fastest: drag over speed is a line through the origin"
    needs = ("velocity",)

    def torque(self, s: JointSignals, p: Values, z: ca.SX) -> ca.SX:
        return -p["coefficient"] * ca.fabs(s.velocity) * s.velocity
