"""Controllers: from the state and the reference to the actuators' torques at the joints.

A controller gives a *command*, which a sampled controller holds between its instants; the drive converts it
to a torque at every instant. The command is the torque, or for a voltage servo the winding voltage, so
that back-EMF acts continuously. A controller that holds a free base commands the wrench on it first.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from reference_model.control.adaptive_network import Network
from reference_model.control.decoupling import (
    BASE_ROWS,
    base_error,
    feedforward_sign,
    joint_rows,
    load_moments,
    nominal_robot,
)
from reference_model.control.sliding_mode import reaching_acceleration
from reference_model.dynamics.symbolic import Motion, SymbolicRobot
from reference_model.kinematics.coupling import Coupling
from robot_model import (
    AdaptiveNetwork,
    ComputedTorque,
    InputError,
    JointPD,
    NoController,
    Robot,
    SlidingMode,
    VoltageServo,
)

__all__ = ["Goal", "command", "command_size", "drive", "has_integral", "holds_base", "sample_time"]


@dataclass(frozen=True)
class Goal:
    """Reference position, velocity, acceleration and the integrated position error, n x 1 each.

    `weights` are those of an adaptive network, joint by joint.
    """

    position: ca.SX
    velocity: ca.SX
    acceleration: ca.SX
    integral: ca.SX
    weights: ca.SX = field(default_factory=lambda: ca.SX(0, 1))


def sample_time(robot: Robot) -> float:
    """Interval over which the command is held [s]; 0 for a continuous controller."""
    return 0.0 if isinstance(robot.controller, NoController) else robot.controller.sample_time


def has_integral(robot: Robot) -> bool:
    """Whether the controller integrates the position error."""
    controller = robot.controller
    return isinstance(controller, JointPD) and any(_gains(robot, controller.ki).elements())


def holds_base(robot: Robot) -> bool:
    """Whether the controller holds the free base by a wrench, which its command then begins with."""
    return isinstance(robot.controller, ComputedTorque) and robot.controller.base_kp is not None


def adapts(robot: Robot) -> bool:
    """Whether the controller has an adaptive network, whose error s is the end of the command."""
    return isinstance(robot.controller, AdaptiveNetwork)


def command_size(robot: Robot) -> int:
    """Rows of the command: the base's wrench where it is held, and one or two for each moving joint."""
    count = len(robot.moving_joints)
    return count + (BASE_ROWS if holds_base(robot) else 0) + (count if adapts(robot) else 0)


def command(robot: Robot, motion: Motion, goal: Goal, inertial: NDArray[np.float64]) -> ca.SX:
    """The command: for a held base the wrench [force; moment] about its origin in base axes [N, N m], then
    one number for every moving joint [N m or N; V for a voltage servo]; then for an adaptive network the
    error s that drives its weights [rad/s or m/s], n x 1; `command_size` x 1.

    Args:
        robot: the description; joints without an actuator get no torque from `drive`.
        motion: state; its accelerations are not used.
        goal: reference of the controller.
        inertial: inertial parameters of the controller's model, shape (P,).
    """
    controller = robot.controller
    if isinstance(controller, JointPD):
        return _joint_pd(robot, controller, motion, goal, inertial)
    if isinstance(controller, ComputedTorque):
        return _computed_torque(robot, controller, motion, goal, inertial)
    if isinstance(controller, SlidingMode):
        return _sliding_mode(robot, controller, motion, goal, inertial)
    if isinstance(controller, AdaptiveNetwork):
        return _adaptive_network(robot, controller, motion, goal, inertial)
    if isinstance(controller, VoltageServo):
        error = Coupling(robot).drives(goal.position - motion.position)
        duty = _gains(robot, controller.gain) * error
        return controller.supply * ca.fmax(-1, ca.fmin(1, duty))
    return ca.SX.zeros(motion.position.shape[0])


def drive(robot: Robot, commanded: ca.SX, velocity: ca.SX) -> ca.SX:
    """Limited torque of the drives behind their gears, from the command, n x 1 [N m or N].

    A command is torques on the joints, or the drives' voltages; `velocity` is that of the drives.

    A voltage servo's winding carries i = (V - k n qd)/R and gives the torque n k i, with n the gear ratio
    and k the torque constant.

    Raises:
        InputError: a voltage servo's actuator lacks its torque constant or resistance.
    """
    torques, servo = [], isinstance(robot.controller, VoltageServo)
    asked = commanded if servo else Coupling(robot).on_drives(commanded[: len(robot.drives)])
    for k, one in enumerate(robot.drives):
        actuator = one.actuator
        if actuator is None:
            torques.append(ca.SX(0.0))
            continue
        torque = asked[k]
        if servo:
            if actuator.torque_constant is None or actuator.resistance is None:
                place = "joint" if one.joint else "motor"
                raise InputError(
                    f"robot '{robot.name}', {place} '{one.name}': a voltage servo needs the actuator's "
                    "torque_constant and resistance."
                )
            constant = actuator.gear_ratio * actuator.torque_constant
            torque = constant * (torque - constant * velocity[k]) / actuator.resistance
        limit = actuator.torque_limit
        torques.append(torque if limit is None else ca.fmax(-limit, ca.fmin(limit, torque)))
    return ca.densify(ca.vertcat(*torques))


def _joint_pd(
    robot: Robot, controller: JointPD, motion: Motion, goal: Goal, inertial: NDArray[np.float64]
) -> ca.SX:
    kp, ki, kd = (_gains(robot, gains) for gains in (controller.kp, controller.ki, controller.kd))
    torque = kp * (goal.position - motion.position) + kd * (goal.velocity - motion.velocity)
    torque += ki * goal.integral if has_integral(robot) else 0
    torque += _static_torque(robot, motion, inertial) if controller.gravity_feedforward else 0

    def nominal() -> SymbolicRobot:
        return nominal_robot(robot, motion, inertial, acceleration=goal.acceleration)

    return torque + _feedforward(robot, controller, nominal, goal)


def _computed_torque(
    robot: Robot, controller: ComputedTorque, motion: Motion, goal: Goal, inertial: NDArray[np.float64]
) -> ca.SX:
    """u = Zbar (rdd + kd ed + kp e) - zbar, for the joints and a base that is held."""
    kp, kd = _gains(robot, controller.kp), _gains(robot, controller.kd)
    error, error_rate = goal.position - motion.position, goal.velocity - motion.velocity
    held = None
    if controller.base_kp is not None:
        astray, drift = base_error(robot, motion)
        held = controller.base_kp * astray + controller.base_kd * drift
    nominal = nominal_robot(
        robot,
        motion,
        inertial,
        acceleration=goal.acceleration + kd * error_rate + kp * error,
        base_acceleration=held,
        deformed=controller.model == "full",
    )
    forces = nominal.inverse_dynamics
    torque = forces[joint_rows(robot)] + _feedforward(robot, controller, lambda: nominal, goal)
    return ca.vertcat(forces[:BASE_ROWS], torque) if holds_base(robot) else torque


def _sliding_mode(
    robot: Robot, controller: SlidingMode, motion: Motion, goal: Goal, inertial: NDArray[np.float64]
) -> ca.SX:
    """u = Zbar (rdd + slope ed + a(s)) - zbar."""
    keys = ("slope", "rate", "proportional", "boundary_layer")
    given = {key: _gains(robot, getattr(controller, key)) for key in keys}
    error, error_rate = goal.position - motion.position, goal.velocity - motion.velocity
    wanted = goal.acceleration + reaching_acceleration(controller, given, error, error_rate)
    full = controller.model == "full"
    nominal = nominal_robot(robot, motion, inertial, acceleration=wanted, deformed=full)
    return nominal.inverse_dynamics[joint_rows(robot)]


def _adaptive_network(
    robot: Robot, controller: AdaptiveNetwork, motion: Motion, goal: Goal, inertial: NDArray[np.float64]
) -> ca.SX:
    """u = Zbar (rdd + kd ed + kp e + W^T phi) - zbar, and s."""
    network, kp, kd = Network(robot, controller), _gains(robot, controller.kp), _gains(robot, controller.kd)
    if goal.weights.shape[0] != network.centres * motion.position.shape[0]:
        raise InputError(
            f"robot '{robot.name}': an adaptive network has weights that this kind of run does not carry; "
            "choose another controller."
        )
    error, error_rate = goal.position - motion.position, goal.velocity - motion.velocity
    learnt = network.output(goal.weights, network.basis(motion.position, motion.velocity))
    wanted = goal.acceleration + kd * error_rate + kp * error + learnt
    full = controller.model == "full"
    nominal = nominal_robot(robot, motion, inertial, acceleration=wanted, deformed=full)
    return ca.vertcat(nominal.inverse_dynamics[joint_rows(robot)], error_rate + kd / 2 * error)


def _feedforward(
    robot: Robot,
    controller: JointPD | ComputedTorque,
    nominal: Callable[[], SymbolicRobot],
    goal: Goal,
) -> ca.SX:
    """Friction expected along the reference: (level + coefficient W) sgn(rd), W at the nominal motion."""
    level = ca.SX(_gains(robot, controller.coulomb_feedforward))
    share = _gains(robot, controller.load_feedforward)
    if any(share.elements()):
        level += share * load_moments(nominal())
    return level * feedforward_sign(goal.velocity)


def _static_torque(robot: Robot, motion: Motion, inertial: NDArray[np.float64]) -> ca.SX:
    """Nominal torque that holds the joints still against gravity; a free base falls."""
    count = motion.position.shape[0]
    turning = ca.SX(*motion.ball_rates.shape)
    still = replace(motion, velocity=ca.SX(count, 1), base_velocity=ca.SX(6, 1), ball_rates=turning)
    nominal = nominal_robot(robot, still, inertial, acceleration=ca.SX(count, 1))
    return nominal.inverse_dynamics[joint_rows(robot)]


def _gains(robot: Robot, value: float | tuple[float, ...]) -> ca.DM:
    count = len(robot.moving_joints)
    return ca.DM(np.broadcast_to(np.asarray(value, dtype=float), count).tolist())
