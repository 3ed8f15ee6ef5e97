"""Which robots and recordings are diagnosed by weighed hypotheses."""

from __future__ import annotations

from collections.abc import Sequence

from missing_physics.checks.actuation import actuator_torque
from reference_model.effects.base import BodyEffect, JointEffect
from reference_model.effects.catalogue import used_effects
from robot_model import Recording, Robot

__all__ = ["has_two_encoders", "is_weighed"]

#: Friction of a robot file that is among the numbers of the standard model.
NUMBERS = frozenset({"viscous_friction", "coulomb_friction"})
#: Where a joint's motion is recorded.
ENCODERS = ("motor_position", "position")


def is_weighed(robot: Robot, recordings: Sequence[Recording]) -> bool:
    """Whether links are rigid, each joint has an encoder and some torque is recorded.

    Friction laws of the robot file beyond viscous and Coulomb friction are not taken for given yet.
    """
    if robot.flexible_links or not robot.moving_joints:
        return False
    for used in used_effects(robot):
        if not isinstance(used.effect, JointEffect | BodyEffect):
            return False
        law = isinstance(used.effect, JointEffect) and (
            used.effect.is_friction_law or used.effect.is_modifier
        )
        if law and used.effect.id not in NUMBERS:
            return False
    return all(_is_complete(robot, recording) for recording in recordings)


def has_two_encoders(robot: Robot, recordings: Sequence[Recording]) -> bool:
    """Whether the motor of some joint has an encoder of its own in every recording."""
    return any(
        all(f"{joint.name}.{q}" in recording for recording in recordings for q in ENCODERS)
        for joint in robot.drives
    )


def _is_complete(robot: Robot, recording: Recording) -> bool:
    joints = [drive.name for drive in robot.drives]
    driven = any(actuator_torque(robot, recording, joint)[0] is not None for joint in joints)
    return driven and all(any(f"{joint}.{q}" in recording for q in ENCODERS) for joint in joints)
