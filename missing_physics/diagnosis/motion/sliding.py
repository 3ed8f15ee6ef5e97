"""When a joint surely moves in one direction: where the torque of dry friction is known."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d, minimum_filter1d

from missing_physics.diagnosis.motion.estimate import Motion
from reference_model.effects.base import JointEffect
from reference_model.effects.catalogue import used_effects
from robot_model import Robot

__all__ = ["transition_speeds", "weights"]

Array = NDArray[np.float64]

#: Slower than this many transition speeds, or than this part of the largest speed, the direction of a joint
#: is not sure; nor is it within the filter's memory of such a moment [periods of the cut-off].
STICKS = 2.0
STANDSTILL = 5e-3
MEMORY_PERIODS = 0.6
#: A joint that is so slow for longer than this many periods does not just reverse, it sticks: friction then
#: takes whatever value holds the joint, so that these rows say nothing about a friction law.
DWELL_PERIODS = 1.0
#: Friction has built up after travelling this many times the bristles' deflection at break-away: but for
#: exp(-5), less than 1 % of it, is then the same whatever was before.
BUILD_UPS = 5.0


#: A speed counts as known in sign when it exceeds this many times its uncertainty (smooth sign:
#: tanh(v/(1.25 s)) is within 2 % of the mean sign of a Gaussian of standard deviation s).
SIGN_UNCERTAINTY = 1.25
#: Smallest transition speed, as a part of the largest speed: below it the filtered motion knows no sign.
SMALLEST_TRANSITION = 2e-4


def transition_speeds(motion: Motion) -> Array:
    """Speed below which the sign of the smoothed velocity is not known [rad/s or m/s], shape (n,)."""
    return np.maximum(
        SIGN_UNCERTAINTY * motion.velocity_noise,
        np.maximum(SMALLEST_TRANSITION * np.abs(motion.velocity).max(axis=0), 1e-9),
    )


def weights(robot: Robot, motion: Motion, transition: Array) -> tuple[Array, Array]:
    """What each full-rate sample counts without and with reversals, 0 or 1, shape (N, n) each.

    Args:
        robot: the nominal robot.
        motion: of its joints.
        transition: speed below which the sign of a joint's velocity is not known, shape (n,).
    """
    speed = np.abs(motion.velocity)
    limit = np.maximum(STICKS * transition, STANDSTILL * speed.max(axis=0))
    slow = np.maximum(speed <= limit, _building_up(robot, motion, speed <= limit)).astype(float)
    period = motion.low_pass.rate / motion.low_pass.cutoff
    dwell = 2 * int(DWELL_PERIODS * period / 2) + 1
    memory = 2 * int(MEMORY_PERIODS * period) + 1
    stuck = maximum_filter1d(minimum_filter1d(slow, dwell, axis=0), dwell, axis=0)
    return 1.0 - maximum_filter1d(slow, memory, axis=0), 1.0 - maximum_filter1d(stuck, memory, axis=0)


def _building_up(robot: Robot, motion: Motion, still: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Where friction with bristles that the nominal robot has is still building up, shape (N, n).

    How far it has built up when a joint sets out depends on what the joint did at rest, which no encoder
    resolves.
    """
    found, names = np.zeros_like(still), [joint.name for joint in robot.moving_joints]
    for used in used_effects(robot):
        if not isinstance(used.effect, JointEffect) or used.at not in names:  # a motor of a transmission
            continue
        index = names.index(used.at)
        needed = BUILD_UPS * used.effect.build_up(used.parameters)
        if needed > 0:
            resting = np.where(still[:, index], np.arange(len(still)), 0)
            last = np.maximum.accumulate(resting)
            position = motion.position[:, index]
            found[:, index] |= np.abs(position - position[last]) < needed
    return found
