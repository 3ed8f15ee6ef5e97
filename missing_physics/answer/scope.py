"""Which robots and recordings are diagnosed by weighed hypotheses."""

from __future__ import annotations

from collections.abc import Collection, Sequence

from missing_physics.checks.actuation import actuator_torque
from missing_physics.standard.rows import is_friction
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

    They require an encoder for each joint and some torque; links that do not bend where motors move several
    joints; and of the friction laws in the robot file, no two of one kind at one joint, and at joints that
    transmissions move only viscous and Coulomb friction.
    """
    if not robot.moving_joints:
        return "no joint moves; give the joint that moved another kind than 'fixed'"
    if robot.flexible_links and robot.transmissions:
        link = robot.flexible_links[0]
        key = "beam" if link.beam is not None else "modal"
        return f"link '{link.name}' bends; leave out its '{key}' and give its whole mass and inertia"
    drives, laws = {drive.name for drive in robot.drives}, set[tuple[str, str]]()
    for used in used_effects(robot):
        clause = _why_not(used) or (_why_no_law(used, drives, laws) if _is_other_law(used) else "")
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
    if isinstance(used.effect, JointEffect | BodyEffect):
        return ""
    here = f"the robot file has {used.effect.id} at '{used.at}'"
    return f"{here}, which cannot be taken as known; leave it out"


def _is_other_law(used: UsedEffect) -> bool:
    """Whether it is friction that is no parameter of the standard model."""
    return is_friction(used.effect) and used.effect.id not in NUMBERS


def _why_no_law(used: UsedEffect, drives: Collection[str], laws: set[tuple[str, str]]) -> str:
    """Why a friction law beyond viscous and Coulomb friction cannot be taken as known.

    Args:
        used: the law.
        drives: joints with an actuator of their own, and motors of transmissions.
        laws: joint and kind of the laws before it, to which it is added.
    """
    if used.at not in drives:
        return (
            f"the robot file has {used.effect.id} at '{used.at}', which a transmission moves, and there only "
            "viscous and Coulomb friction can be taken as known; leave it out: the diagnosis tests other laws"
        )
    kind = used.at, used.effect.family or used.effect.id
    if kind in laws:
        return f"the robot file has {kind[1].replace('_', ' ')} twice at '{used.at}'; leave one of them out"
    laws.add(kind)
    return ""


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
