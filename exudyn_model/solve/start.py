"""Initial state and sampling instants of a run, and checks that it can be run."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from exudyn_model.bodies.mechanism import Mechanism
from exudyn_model.control.rigid_dynamics import InverseDynamics
from exudyn_model.solve.system import RobotState
from robot_model import InputError, Robot

__all__ = ["check_movable", "initial_state", "sampling_instants"]

Array = NDArray[np.float64]

#: Relative to the largest eigenvalue of the joint-space inertia: below it a joint has nothing to move.
LEAST_INERTIA = 1e-12


def sampling_instants(robot: Robot, step: float) -> Array:
    """Instants of the recording [s], (N,); raises `InputError` without a reference or for a bad step."""
    if robot.reference is None:
        raise InputError(f"robot '{robot.name}' has no [reference]; give its duration to simulate it.")
    if not (math.isfinite(step) and step > 0):
        raise InputError(f"the time step is {step:g} s; it must be positive.")
    rate = robot.reference.sample_rate
    return np.arange(math.floor(robot.reference.duration * rate + 1e-9) + 1) / rate


def check_movable(robot: Robot, mechanism: Mechanism) -> None:
    """Raise `InputError` for a joint or a free base that moves no inertia."""
    matrix = InverseDynamics(mechanism).mass_matrix([joint.initial_position for joint in robot.moving_joints])
    for joint, inertia in zip(robot.moving_joints, np.diag(matrix)):
        if inertia <= LEAST_INERTIA * max(1.0, float(np.abs(matrix).max())):
            raise InputError(
                f"joint '{joint.name}' has no inertia to move; "
                "give its link a mass or its actuator a rotor_inertia."
            )
    if mechanism.free and float(np.linalg.eigvalsh(mechanism.base.central_inertia)[0]) <= 0:
        raise InputError("the free base has no rotary inertia about some axis; give base.inertia.")


def initial_state(robot: Robot, mechanism: Mechanism) -> RobotState:
    """The initial state of the description."""
    joints = [robot.moving_joints[k] for k in mechanism.coordinate]
    return RobotState(
        time=0.0,
        position=tuple(joint.initial_position for joint in joints),
        velocity=tuple(joint.initial_velocity for joint in joints),
        base_rotation=mechanism.base_rotation,
        base_position=mechanism.base_position,
        base_velocity=np.zeros(3),
        base_angular_velocity=np.zeros(3),
    )
