"""How long a digital controller holds its command, such that its loop keeps its phase."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from exudyn_model.bodies.mechanism import mechanism_of
from exudyn_model.control.rigid_dynamics import InverseDynamics
from missing_physics.challenge.cases.ranges import Draw
from robot_model import ComputedTorque, JointPD, Robot

__all__ = ["bandwidth", "draw_hold"]

Array = NDArray[np.float64]

#: Ticks of the controller per sample of the recording: both run on one clock.
TICKS = (1, 2, 4)
#: What a hold may cost the loop in phase at its bandwidth [rad]: 15 degrees of the 40 to 60 that a drive is
#: tuned for. A hold of P seconds delays by P/2.
PHASE = np.pi / 12
#: Shortest hold [s]: joint controllers commonly run at 1 kHz, and each tick is a step of the simulation.
SHORTEST = 1e-3


def draw_hold(robot: Robot, rate: float, d: Draw) -> float:
    """Time for which the controller of `robot` holds its command [s], at `rate` samples per second [Hz]."""
    holds = [hold for ticks in TICKS if (hold := 1 / (rate * ticks)) >= SHORTEST * (1 - 1e-9)]
    longest = 2 * PHASE / bandwidth(robot)
    allowed = [hold for hold in holds if hold <= longest] or holds[-1:]
    return allowed[int(d.chance.integers(len(allowed)))]


def bandwidth(robot: Robot) -> float:
    """Largest bandwidth of the joints' position loops [rad/s]: max(sqrt(kp), kd) per unit of inertia."""
    controller, count = robot.controller, len(robot.moving_joints)
    assert isinstance(controller, JointPD | ComputedTorque)
    kp, kd = (
        np.broadcast_to(np.asarray(gain, dtype=float), count) for gain in (controller.kp, controller.kd)
    )
    light = _inverse_inertia(robot) if isinstance(controller, JointPD) else np.ones(count)
    return float(max(np.sqrt(kp * light).max(), (kd * light).max()))


def _inverse_inertia(robot: Robot) -> Array:
    """Acceleration of each joint per torque at it, the others free, at the initial pose, shape (n,)."""
    pose = [joint.initial_position for joint in robot.moving_joints]
    return np.diag(np.linalg.inv(InverseDynamics(mechanism_of(robot)).mass_matrix(pose)))
