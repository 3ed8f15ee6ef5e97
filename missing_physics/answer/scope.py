"""Which robots and recordings are diagnosed by weighed hypotheses."""

from __future__ import annotations

from collections.abc import Sequence

from missing_physics.checks.actuation import actuator_torque
from reference_model.effects.base import BodyEffect, JointEffect
from reference_model.effects.catalogue import UsedEffect, used_effects
from robot_model import Recording, Robot

__all__ = ["has_two_encoders", "why_not_weighed"]

#: Friction effects of a robot file that are parameters of the standard model.
NUMBERS = frozenset({"viscous_friction", "coulomb_friction"})
#: Quantities in which a joint's motion may be recorded.
ENCODERS = ("motor_position", "position")


def why_not_weighed(robot: Robot, recordings: Sequence[Recording]) -> str:
    """Why hypotheses cannot be weighed and how to correct it, as a clause; empty where they can.

    They require rigid links, an encoder for each joint and some torque. Friction laws of the robot file other
    than viscous and Coulomb friction are not supported yet.
    """
    if not robot.moving_joints:
        return "no joint moves; give the joint that moved another kind than 'fixed'"
    if robot.flexible_links:
        link = robot.flexible_links[0]
        key = "beam" if link.beam is not None else "modal"
        return f"link '{link.name}' bends; leave out its '{key}' and give its whole mass and inertia"
    for used in used_effects(robot):
        clause = _why_not(used)
        if clause:
            return clause
    for recording in recordings:
        clause = _what_lacks(robot, recording)
        if clause:
            return clause
    return ""


def has_two_encoders(robot: Robot, recordings: Sequence[Recording]) -> bool:
    """Whether the motor of some joint has a separate encoder in every recording."""
    return any(
        all(f"{joint.name}.{q}" in recording for recording in recordings for q in ENCODERS)
        for joint in robot.drives
    )


def _why_not(used: UsedEffect) -> str:
    here, effect = f"the robot file has {used.effect.id} at '{used.at}'", used.effect
    if not isinstance(effect, JointEffect | BodyEffect):
        return f"{here}, which cannot be taken as known; leave it out"
    if not isinstance(effect, JointEffect) or effect.id in NUMBERS:
        return ""
    if effect.is_friction_law:
        return (
            f"{here}, but only viscous and Coulomb friction can be taken as known; write it as "
            "viscous_friction and coulomb_friction, or leave it out: the diagnosis tests other laws"
        )
    return f"{here}, which changes a friction law; leave it out" if effect.is_modifier else ""


def _what_lacks(robot: Robot, recording: Recording) -> str:
    name = recording.source or "the recording"
    joints = [drive.name for drive in robot.drives]
    for joint in joints:
        if not any(f"{joint}.{q}" in recording for q in ENCODERS):
            return (
                f"{name} has neither {joint}.position nor a channel that determines it; name its source in a "
                "map"
            )
    if all(actuator_torque(robot, recording, joint)[0] is None for joint in joints):
        return f"{name} has no torque, current or voltage of any motor; name its source in a map"
    return ""
