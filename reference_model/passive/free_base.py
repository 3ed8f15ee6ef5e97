"""The unmeasured motion of a free base, computed from momentum.

Without an external wrench only gravity changes the linear momentum, and the angular momentum about the centre
of mass is constant, whatever the joints' torques, friction and control. The base's velocity is then
a function of attitude and joint motion, and only the attitude has to be integrated (Umetani, Yoshida, IEEE
Trans. Robotics and Automation 5 (1989) 303-314).
"""

from __future__ import annotations

from functools import lru_cache

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from reference_model.codegen.batched import BLOCK, Batched
from reference_model.dynamics.balance import centre_of_mass
from reference_model.dynamics.equations import solve_spd
from reference_model.dynamics.inertial import inertial_names
from reference_model.dynamics.symbolic import Motion, SymbolicRobot
from reference_model.kinematics.spatial import quaternion_rate, rotation_from_quaternion
from reference_model.passive.base_motion import BaseMotion
from robot_model import InputError, Robot

__all__ = ["reconstruct"]

Array = NDArray[np.float64]

#: Robots whose functions are kept: many motions of one robot are reconstructed one after the other.
KEPT = 8

#: Inputs of a step at each of its ends: position, velocity, acceleration of the joints.
ENDS = 3


def reconstruct(
    robot: Robot,
    time: Array,
    joints: tuple[Array, Array, Array],
    *,
    initial: BaseMotion,
    momentum: tuple[Array, Array],
    inertial: Array,
) -> BaseMotion:
    """Attitude, twist and acceleration of the base at every instant.

    The attitude is integrated by the classical fourth-order Runge-Kutta method over each sample interval,
    the joint motion inside it by the cubic through both ends' positions and velocities (and velocities
    and accelerations).

    Args:
        robot: with a free base.
        time: [s], shape (N,).
        joints: position, velocity, acceleration, shape (N, n) each.
        initial: its first sample's attitude starts the integration.
        momentum: linear [N s] and angular momentum about the centre of mass [N m s] at the first instant,
            inertial axes, shape (3,) each.
        inertial: the inertial numbers, shape (P,).

    Raises:
        InputError: the base is fixed, links deform or hang on spherical joints, or lengths differ.
    """
    if robot.base.kind != "free":
        raise InputError(f"robot '{robot.name}' has a fixed base; there is no base motion to reconstruct.")
    if robot.flexible_links or robot.spherical_joints:
        raise InputError(
            f"robot '{robot.name}' has flexible links or spherical joints: their motion carries momentum, "
            "which `reconstruct_passive` follows."
        )
    if any(len(column) != len(time) for column in joints):
        raise InputError(f"time has {len(time)} samples, the joint motion {[len(c) for c in joints]}.")
    start = initial.attitude[0] / np.linalg.norm(initial.attitude[0])
    constants = np.concatenate([*momentum, inertial])
    attitude = _attitudes(robot, time, np.hstack(joints), start, constants)
    elapsed = (time - time[:1])[:, None]
    twist, acceleration = Batched(_final(robot))(elapsed, attitude, *joints, constants)
    return BaseMotion.from_stacked(np.hstack([attitude, twist, acceleration]))


def _attitudes(robot: Robot, time: Array, joints: Array, start: Array, constants: Array) -> Array:
    """Attitudes at all instants, shape (N, 4), unit length."""
    steps = len(time) - 1
    blocks = -(-steps // BLOCK)
    padded = np.pad(joints, ((0, blocks * BLOCK - steps), (0, 0)), mode="edge")
    lengths = np.pad(np.diff(time), (0, blocks * BLOCK - steps))  # a step of zero length changes nothing
    elapsed = np.pad(time[:-1] - time[0], (0, blocks * BLOCK - steps), mode="edge") if steps else time[:0]
    march = _march(robot)
    found, attitude = [start[None]], start
    for block in range(blocks):
        rows = slice(block * BLOCK, (block + 1) * BLOCK)
        ends = np.hstack([padded[:-1][rows], padded[1:][rows]])
        times = np.column_stack([elapsed[rows], lengths[rows]])
        turned = march(attitude, times.T, ends.T, np.tile(constants[:, None], BLOCK)).full().T
        found.append(turned)
        attitude = turned[-1]
    return np.vstack(found)[: len(time)]


def _twist(robot: Robot, elapsed: ca.SX, attitude: ca.SX, q: ca.SX, qd: ca.SX, constants: ca.SX) -> ca.SX:
    """[linear; angular] velocity of the base in its axes from momentum, 6 x 1.

    Momentum is Z_bb v_b + Z_bm qd at the base's origin in base axes; the angular momentum about the centre
    of mass moves there by c x p.
    """
    count = q.shape[0]
    numbers = constants[6:]
    still = Motion(q, ca.SX(count, 1), ca.SX(count, 1), attitude, ca.SX(6, 1), ca.SX(6, 1), ca.SX(3, 1))
    model = SymbolicRobot(robot, still, numbers)
    mass, centre = centre_of_mass(model.mechanism)
    turn = rotation_from_quaternion(attitude).T
    linear = turn @ (constants[:3] + mass * numbers[-3:] * elapsed)
    angular = turn @ constants[3:6] + ca.cross(turn @ centre, linear)
    matrix = model.mass_matrix
    return solve_spd(matrix[:6, :6], ca.vertcat(linear, angular) - matrix[:6, 6:] @ qd)


@lru_cache(maxsize=KEPT)
def _march(robot: Robot) -> ca.Function:
    """A chain of intervals: attitude, columns of [elapsed; length], of both ends' joint motion and of
    constants -> columns of attitudes."""
    return _step(robot).mapaccum(BLOCK)


def _step(robot: Robot) -> ca.Function:
    """attitude, [elapsed; length], both ends' joint motion, constants -> attitude one interval later."""
    count = len(robot.moving_joints)
    attitude, times, ends = ca.SX.sym("a", 4), ca.SX.sym("t", 2), ca.SX.sym("e", 2 * ENDS * count)
    constants = ca.SX.sym("c", 6 + len(inertial_names(robot)))
    q0, v0, a0, q1, v1, a1 = ca.vertsplit(ends, count)
    elapsed, h = times[0], times[1]
    middle_q = (q0 + q1) / 2 + h / 8 * (v0 - v1)  # cubic Hermite interpolation at one half
    middle_v = (v0 + v1) / 2 + h / 8 * (a0 - a1)

    def rate(part: float, at: ca.SX, q: ca.SX, qd: ca.SX) -> ca.SX:
        twist = _twist(robot, elapsed + part * h, at, q, qd, constants)
        return quaternion_rate(at, twist[3:])

    k1 = rate(0.0, attitude, q0, v0)
    k2 = rate(0.5, attitude + h / 2 * k1, middle_q, middle_v)
    k3 = rate(0.5, attitude + h / 2 * k2, middle_q, middle_v)
    k4 = rate(1.0, attitude + h * k3, q1, v1)
    turned = attitude + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    return ca.Function(
        "turn", [attitude, times, ends, constants], [turned / ca.norm_2(turned)], {"cse": True}
    )


@lru_cache(maxsize=KEPT)
def _final(robot: Robot) -> ca.Function:
    """elapsed, attitude, joint motion, constants -> twist and acceleration of the base."""
    count = len(robot.moving_joints)
    elapsed, attitude = ca.SX.sym("t"), ca.SX.sym("a", 4)
    q, qd, qdd = (ca.SX.sym(name, count) for name in ("q", "qd", "qdd"))
    constants = ca.SX.sym("c", 6 + len(inertial_names(robot)))
    twist = _twist(robot, elapsed, attitude, q, qd, constants)
    motion = Motion(q, qd, qdd, attitude, twist, ca.SX(6, 1), ca.SX(3, 1))
    acceleration = SymbolicRobot(robot, motion, constants[6:]).base_acceleration
    inputs = [elapsed, attitude, q, qd, qdd, constants]
    return ca.Function("final", inputs, [ca.densify(twist), ca.densify(acceleration)], {"cse": True})
