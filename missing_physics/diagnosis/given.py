"""Checks whether a robot, recordings and options can be used at all."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from itertools import combinations

from missing_physics.standard.prediction import knows_links
from missing_physics.standard.rows import is_friction
from reference_model.effects.base import GearEffect
from reference_model.effects.catalogue import UsedEffect, used_effects
from robot_model import InputError, Recording, Robot

__all__ = ["has_two_encoders", "require_usable", "require_weighable"]

#: Quantities in which a joint's motion may be recorded.
ENCODERS = ("motor_position", "position")


def require_weighable(robot: Robot, recordings: Sequence[Recording]) -> None:
    """Raises `InputError`, with a remedy, if hypotheses cannot be weighed.

    Required are: an encoder for each joint; rigid links if motors move several joints; in the robot file no
    effects of structure and surroundings except walls that rigid links touch; no two friction laws of one
    kind at one joint; and only viscous and Coulomb friction at joints behind transmissions.
    """
    if reason := _robot_lacks(robot):
        raise InputError(f"robot '{robot.name}' cannot be diagnosed as it is: {reason}.")
    for recording in recordings:
        for joint in robot.drives:
            if not any(f"{joint.name}.{q}" in recording for q in ENCODERS):
                raise InputError(
                    f"{recording.source or 'the recording'} has neither {joint.name}.position nor a channel "
                    "that determines it; record it, or name its source in a map."
                )


def has_two_encoders(robot: Robot, recordings: Sequence[Recording]) -> bool:
    """Whether the motor of some joint has a separate encoder in every recording."""
    return any(
        all(f"{joint.name}.{q}" in recording for recording in recordings for q in ENCODERS)
        for joint in robot.drives
    )


def require_usable(every: Sequence[Recording], fitted: int, cutoff: float | None) -> None:
    """Raises `InputError` for an impossible cut-off, or a recording that is given twice.

    Args:
        every: recordings, the fitted ones first.
        fitted: number of recordings that are fitted.
        cutoff: of the low-pass filter [Hz], None if it follows from the data.
    """
    slowest = min(every, key=lambda recording: recording.sample_rate)
    if cutoff is not None and not 0.0 < cutoff < slowest.sample_rate / 2:
        raise InputError(
            f"the cut-off of {cutoff:g} Hz is not between 0 and {slowest.sample_rate / 2:.6g} Hz, half the "
            f"sampling rate of {slowest.source or 'the recording'}; give another one, or leave it out."
        )
    for (i, one), (j, other) in combinations(enumerate(every), 2):
        if not one.same_values(other):
            continue
        name = other.source or f"recording {j + 1}"
        if i < fitted <= j:
            raise InputError(
                f"{name} is given with --validate and holds what is fitted (recording {i + 1}), so it would "
                "prove nothing; give another one, or none, and a quarter of each recording is held out."
            )
        raise InputError(f"{name} holds the same as recording {i + 1}; give each recording once.")


def _robot_lacks(robot: Robot) -> str:
    """Why hypotheses cannot be weighed for a robot, as a clause; empty if they can."""
    if not robot.moving_joints:
        return "it has no moving joint; give the joint that moved a kind other than 'fixed'"
    if robot.flexible_links and robot.transmissions:
        link = robot.flexible_links[0]
        key = "beam" if link.beam is not None else "modal"
        return f"link '{link.name}' bends; leave out its '{key}' and give its whole mass and inertia"
    drives, laws = {drive.name for drive in robot.drives}, set[tuple[str, str]]()
    for used in used_effects(robot):
        clause = _why_not(robot, used) or (_why_no_law(used, drives, laws) if _is_other_law(used) else "")
        if clause:
            return clause
    return ""


def _why_not(robot: Robot, used: UsedEffect) -> str:
    if used.effect.along_motion and not (robot.transmissions and isinstance(used.effect, GearEffect)):
        return ""
    if used.effect.beam_number and not robot.transmissions:
        link = robot.link(used.at)
        if link.beam is not None:
            return ""
    if used.effect.along_link and knows_links(robot):
        return ""
    here = f"the robot file has {used.effect.id} at '{used.at}'"
    return f"{here}, which cannot be taken as known; leave it out"


def _is_other_law(used: UsedEffect) -> bool:
    """Whether it is friction that is not a parameter of the standard model."""
    return is_friction(used.effect) and not used.effect.standard


def _why_no_law(used: UsedEffect, drives: Collection[str], laws: set[tuple[str, str]]) -> str:
    """Why a friction law beyond viscous and Coulomb friction cannot be taken as known.

    Args:
        used: the law.
        drives: names of directly driven joints, and of motors of transmissions.
        laws: joint and kind of the previous laws; the law is added.
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
