"""Findings at a free base: added to the diagnosis and the robot file, and removed from the torques."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.interpolate import make_interp_spline

from missing_physics.checks.actuation import actuator_torque
from missing_physics.diagnosis.base.stage import BaseResult
from missing_physics.diagnosis.further.merge import joined, written_with
from missing_physics.hypotheses import Term
from missing_physics.motion.inverse import MotionDynamics
from missing_physics.results.result import Result
from missing_physics.standard.model import use_of
from reference_model.effects.base import SensorEffect
from reference_model.passive.prescribed import prescribed
from robot_model import EffectUse, Recording, Robot, robot_from_toml

__all__ = ["with_base", "without_base_effects"]


def without_base_effects(
    robot: Robot, recordings: Sequence[Recording], along: Sequence[MotionDynamics], found: BaseResult | None
) -> tuple[Recording, ...]:
    """The recordings with joint torques corrected for the effects found on the base.

    These effects change the base's motion and so the torques that the joints' motion needs. The change is
    the difference between two simulations with prescribed joint motion.
    """
    uses = () if found is None else tuple(_use(term) for term in found.terms if not _is_of_sensor(term))
    if not uses:
        return tuple(recordings)
    bare = robot.model_copy(update={"effects": ()})
    changed, made = bare.with_effects(*uses), []
    for recording, dynamics in zip(recordings, along):
        motion = dynamics.motion
        state = motion.position, motion.velocity, motion.acceleration
        with_it, rest = (prescribed(one, motion.time, *state) for one in (changed, bare))
        channels = {}
        for joint in robot.moving_joints:
            channel, factor = actuator_torque(robot, recording, joint.name)
            if channel is None:
                continue
            more = (with_it[f"{joint.name}.torque"] - rest[f"{joint.name}.torque"]) / factor
            inside = np.clip(recording.time, motion.time[0], motion.time[-1])
            channels[channel] = recording[channel] - make_interp_spline(motion.time, more, k=3)(inside)
        made.append(recording.with_channels(channels) if channels else recording)
    return tuple(made)


def with_base(result: Result, base: BaseResult, robot: Robot) -> Result:
    """`result` with the findings at the base, which are added to its robot file as well.

    Args:
        result: the diagnosis of the torques.
        base: the diagnosis of the gyros.
        robot: the nominal robot.
    """
    uses = [_use(term) for term in base.terms]
    file, _ = written_with(robot_from_toml(result.augmented_robot_toml), robot, uses)
    return joined(result, base.written(file), robot, uses, first=True)


def _use(term: Term) -> EffectUse:
    """A term as an effect of a robot file."""
    return use_of(term.effect.id, term.at, term.parameters)


def _is_of_sensor(term: Term) -> bool:
    return isinstance(term.effect, SensorEffect)
