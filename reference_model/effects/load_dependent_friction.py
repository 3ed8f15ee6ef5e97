"""Load-dependent friction: grows with the load of bearings and gear."""

from __future__ import annotations

import casadi as ca

from reference_model.effects.base import JointEffect, JointSignals, Parameter, Values

__all__ = ["LoadDependentFriction"]


class LoadDependentFriction(JointEffect):
    """T = -(mu W + share |torque|) sgn(qd)."""

    id = "load_dependent_friction"
    title = "Load-dependent friction"
    place = "joint"
    parameters = (
        Parameter(
            "coefficient",
            "-",
            "friction coefficient of the bearings",
            0.0,
            1.0,
            0.05,
            absent=0.0,
            linear=True,
        ),
        Parameter(
            "gear_share",
            "-",
            "fraction of the actuator's torque lost to gear friction",
            0.0,
            1.0,
            0.05,
            absent=0.0,
            linear=True,
        ),
    )
    equation = (
        "T = -(coefficient * W + gear_share * |torque|) * sgn(qd), "
        "W = axial_arm * F_axial + radial_arm * (F_radial + M_bending/bending_arm), or with a span b "
        "W = axial_arm * F_axial + radial_arm * (|R_1| + |R_2|), R_1,2 = F_radial/2 +- (axis x M_bending)/b"
    )
    source = "MSC Adams FRICTION statement (arms); Hamon, Gautier, Garrec, IROS 2010 (share of the torque)"
    signature = "the jump of friction at a reversal is larger when the joint carries or accelerates more"
    confused_with = ("coulomb_friction", "inertia", "payload", "position_dependent_friction", "torque_gain")
    experiment = "the same speeds with and without payload, and in poses of different gravity load"
    simpler = ("coulomb_friction",)
    is_friction_law = True
    uses_torque = True
    per_torque = ("coefficient", "gear_share")
    needs = ("velocity", "torque")

    def torque(self, s: JointSignals, p: Values, z: ca.SX) -> ca.SX:
        load = p["coefficient"] * s.load_moment + p["gear_share"] * ca.fabs(s.torque)
        return -load * s.kinetic_factor * s.sign
