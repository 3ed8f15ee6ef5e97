"""A controller's own model: forces for desired accelerations, decoupled from passive coordinates.

The generalised coordinates are partitioned into driven ones (c), the joints with one coordinate and a held
base, and passive ones (p): a floating base, spherical joints, modal coordinates. With ``Z ydd = z + f`` and
f_p = 0 the passive accelerations follow from the desired ones,
``Z_pp ydd_p = z_p - Z_pc ydd_c``, and the forces that decouple the driven coordinates are
f_c = Zbar ydd_c - zbar with Zbar = Z_cc - Z_cp Z_pp^-1 Z_pc and zbar = z_c - Z_cp Z_pp^-1 z_p: here inverse
dynamics at both, so that neither is formed.
"""

from __future__ import annotations

from dataclasses import replace

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from reference_model.dynamics.equations import solve_spd
from reference_model.dynamics.inertial import nominal_inertial
from reference_model.dynamics.symbolic import Motion, SymbolicRobot
from reference_model.dynamics.tree import tree_of
from reference_model.effects.base import smooth_sign
from reference_model.flexible.undeformed import undeformed
from reference_model.kinematics.spatial import quaternion_from_rpy, rotation_from_quaternion
from robot_model import Robot

__all__ = [
    "BASE_ROWS",
    "FEEDFORWARD_TRANSITION",
    "base_error",
    "feedforward_sign",
    "joint_rows",
    "load_moments",
    "nominal_robot",
]

#: Rows of a base wrench, [force; moment].
BASE_ROWS = 6

#: Speed of the reference over which a friction feed-forward changes its sign [rad/s or m/s].
FEEDFORWARD_TRANSITION = 1e-4


def nominal_robot(
    robot: Robot,
    motion: Motion,
    inertial: NDArray[np.float64],
    *,
    acceleration: ca.SX,
    base_acceleration: ca.SX | None = None,
    deformed: bool = False,
) -> SymbolicRobot:
    """The nominal robot in the measured motion at desired accelerations, passive coordinates reacting.

    Its `inverse_dynamics` holds the required control forces, and zeros in the passive rows.

    Args:
        robot: the description.
        motion: the measured motion; its accelerations are not used.
        inertial: inertial parameters of the controller's model, shape (P,).
        acceleration: desired, of the moving joints, n x 1.
        base_acceleration: desired, of a held base, inertial, in base axes, [linear; angular], 6 x 1; None for
            a base that is fixed or free to react.
        deformed: modal coordinates and rates are measured; else flexible links are treated as undeformed
            rigid bodies of the same mass properties.
    """
    if robot.flexible_links and not deformed:
        robot = undeformed(robot)
        inertial = nominal_inertial(robot)
        motion = replace(motion, modal=ca.SX(0, 1), modal_rates=ca.SX(0, 1))
    tree, numbers = tree_of(robot), ca.SX(inertial)
    wanted = ca.SX(BASE_ROWS, 1) if base_acceleration is None else base_acceleration
    inner = ca.SX(tree.inner, 1)
    moving = replace(motion, acceleration=acceleration, base_acceleration=wanted, inner_acceleration=inner)
    nominal = SymbolicRobot(robot, moving, numbers)
    reacts = BASE_ROWS if tree.free_base and base_acceleration is None else 0
    passive = [*range(reacts), *range(tree.rows - tree.inner, tree.rows)]
    if not passive:
        return nominal
    # Z_pp ydd_p = z_p - Z_pc ydd_c: the right side is minus the inverse dynamics at ydd_p = 0
    reaction = solve_spd(nominal.mass_matrix[passive, passive], -nominal.inverse_dynamics[passive])
    moving = replace(moving, inner_acceleration=reaction[reacts:])
    return SymbolicRobot(
        robot, replace(moving, base_acceleration=reaction[:reacts]) if reacts else moving, numbers
    )


def base_error(robot: Robot, motion: Motion) -> tuple[ca.SX, ca.SX]:
    """Pose and velocity error of a free base to its initial pose at rest, [linear; angular], 6 x 1 each.

    The attitude error is twice the vector part of q_d q^-1, in base axes: the return rotation's axis times
    its angle times sin(angle/2)/(angle/2). Both signs of a quaternion are the same attitude; the shorter
    rotation is used.
    """
    wanted = ca.SX(quaternion_from_rpy(robot.base.rpy))
    present = motion.attitude / ca.norm_2(motion.attitude)
    w, v = present[0], present[1:4]
    # q_d q^-1 = [w_d w + v_d.v ; w v_d - w_d v - v_d x v], in inertial axes
    way = ca.if_else(w * wanted[0] + ca.dot(v, wanted[1:4]) < 0, -2, 2)
    turn = way * (w * wanted[1:4] - wanted[0] * v - ca.cross(wanted[1:4], v))
    place = ca.SX(np.asarray(robot.base.position, dtype=float)) - motion.base_position
    to_base = rotation_from_quaternion(motion.attitude).T
    return ca.vertcat(to_base @ place, to_base @ turn), -motion.base_velocity


def joint_rows(robot: Robot) -> slice:
    """Places of the one-coordinate joints in generalised vectors."""
    start = BASE_ROWS if robot.base.kind == "free" else 0
    return slice(start, start + len(robot.moving_joints))


def load_moments(nominal: SymbolicRobot) -> ca.SX:
    """W of every joint's bearing [N m or N], n x 1; zero without a bearing. See `robot_model.Bearing`."""
    loads = nominal.bearing_loads(nominal.joint_wrenches)
    moments = [ca.SX(0.0)] * loads.shape[1]
    for k, joint in enumerate(nominal.robot.moving_joints):
        if bearing := joint.bearing:
            moments[k] = bearing.axial_arm * loads[1, k] + bearing.radial_arm * loads[3, k]
    return ca.vertcat(*moments)


def feedforward_sign(rate: ca.SX) -> ca.SX:
    """Smoothed sign of the reference velocity, zero while the reference rests, n x 1."""
    return smooth_sign(rate, FEEDFORWARD_TRANSITION)
