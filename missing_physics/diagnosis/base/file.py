"""Findings at a free base in the diagnosis, the robot file, and the torques that they take part in."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from scipy.interpolate import make_interp_spline

from missing_physics.checks.actuation import actuator_torque
from missing_physics.diagnosis.base.stage import BaseResult
from missing_physics.diagnosis.dynamics.inverse import MotionDynamics
from missing_physics.hypotheses import Term
from missing_physics.results.result import Fit, Result, Verdict
from missing_physics.standard.model import use_of
from reference_model.effects.base import SensorEffect
from reference_model.passive.prescribed import prescribed
from robot_model import EffectUse, Recording, Robot, robot_from_toml, robot_to_toml

__all__ = ["with_base", "without_base_effects"]


def without_base_effects(
    robot: Robot, recordings: Sequence[Recording], along: Sequence[MotionDynamics], found: BaseResult | None
) -> tuple[Recording, ...]:
    """The recordings with torques as they would be without what was found on board.

    It moves the base by other torques than those of the joints, so that its share of what the joints' motion
    takes is the difference of two prescribed motions.
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
        base: of the gyros.
        robot: the nominal robot.
    """
    file = robot_from_toml(result.augmented_robot_toml)
    there = {(use.effect, use.at) for use in file.effects}
    uses = [_use(term) for term in base.terms if not _is_of_sensor(term) or robot.sensor(term.at) is not None]
    file = file.with_effects(*(use for use in uses if (use.effect, use.at) not in there))
    base = base.written(file)
    before = result.diagnosis
    verdict: Verdict = before.verdict
    if verdict == "consistent" or (verdict == "not_enough_data" and (base.findings or base.mismatch)):
        verdict = _verdict(base)
    named = {(finding.effect, finding.location) for finding in base.findings}
    others = tuple(f for f in before.findings if (f.effect, f.location) not in named)
    diagnosis = replace(
        before,
        verdict=verdict,
        mismatch=(*base.mismatch, *before.mismatch),
        findings=(*base.findings, *others),
        fit=Fit({**before.fit.channels, **base.fit}, _improvement(result, base), before.fit.bands),
        could_not_tell=(*before.could_not_tell, *base.could_not_tell, *_unwritten(robot, base)),
    )
    return replace(
        result,
        diagnosis=diagnosis,
        series=(*result.series, *base.series),
        ladder=(*result.ladder, *base.ladder),
        augmented_robot_toml=robot_to_toml(file),
    )


def _improvement(result: Result, base: BaseResult) -> float:
    """How much the held-out error falls: of gyros where names lie only there, of torques otherwise."""
    told = result.diagnosis
    if told.findings or not base.findings:
        return told.fit.validation_improvement
    errors = [channel for channel in base.fit.values() if channel.noise_floor > 0]
    before, after = (
        sum((part.validation_rms / channel.noise_floor) ** 2 for channel, part in pairs)
        for pairs in ([(c, c.before) for c in errors], [(c, c.after) for c in errors])
    )
    return 1.0 - float(np.sqrt(after / before)) if before > 0.0 else told.fit.validation_improvement


def _use(term: Term) -> EffectUse:
    """A term in a robot file."""
    return use_of(term.effect.id, term.at, term.parameters)


def _is_of_sensor(term: Term) -> bool:
    return isinstance(term.effect, SensorEffect)


def _unwritten(robot: Robot, base: BaseResult) -> Iterator[str]:
    """Errors of gyros that the file cannot hold."""
    for term in base.terms:
        if _is_of_sensor(term) and robot.sensor(term.at) is None:
            yield (
                f"{term.effect.id} at {term.at}: not in the augmented robot file: the robot file lists no "
                "sensor of that channel."
            )


def _verdict(base: BaseResult) -> Verdict:
    if not base.mismatch:
        return "consistent"
    if not base.findings:
        return "unexplained"
    return "ambiguous" if any(finding.ambiguous_with for finding in base.findings) else "explained"
