"""One diagnosis of two: of the joint torques, and of what lies between two encoders of a joint."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

from missing_physics.diagnosis.gear.transmission import TransmissionResult
from missing_physics.diagnosis.gear_runs.applied import found_sensors
from missing_physics.diagnosis.naming.judge import EXPLAINED_PART, beyond_noise, verdict_on_names
from missing_physics.diagnosis.written import words
from missing_physics.results.result import Diagnosis, Fit, Result, Verdict
from reference_model.effects.base import GearEffect
from reference_model.effects.catalogue import get_effect
from robot_model import Robot, robot_from_toml, robot_to_toml

__all__ = ["with_transmission"]

#: Verdicts from the one that leaves most open to the one that leaves least.
OPENNESS: tuple[Verdict, ...] = ("unexplained", "ambiguous", "explained", "consistent")


def with_transmission(
    result: Result, gap: TransmissionResult | None, robot: Robot, remarks: Sequence[str] = ()
) -> Result:
    """`result` with what the gaps between encoders say; the verdict is the more open one of the two.

    Errors of encoders go into the augmented robot, which has the gears already. `remarks` are sentences on
    what became of it.
    """
    if gap is None:
        told = (*result.diagnosis.could_not_tell, *remarks)
        return replace(result, diagnosis=replace(result.diagnosis, could_not_tell=told))
    before = result.diagnosis
    findings = (*before.findings, *gap.findings)
    mismatch = (*before.mismatch, *gap.mismatch)
    fit = Fit({**before.fit.channels, **gap.fit}, _improvement(before, gap))
    verdict = before.verdict
    if verdict == "not_enough_data" and (gap.findings or gap.mismatch):
        verdict = _verdict(gap)
    elif verdict != "not_enough_data" and not _left_by_gears(before, gap, fit):
        verdict = min(verdict, _verdict(gap), key=OPENNESS.index)
    elif verdict != "not_enough_data":
        verdict = _verdict(gap)
    diagnosis = replace(
        before,
        verdict=verdict,
        summary=words.summary(robot, verdict, mismatch, findings, fit, before.unnamed),
        mismatch=mismatch,
        findings=findings,
        fit=fit,
        could_not_tell=(*before.could_not_tell, *gap.could_not_tell, *_unwritten(robot, gap), *remarks),
    )
    return replace(
        result,
        diagnosis=diagnosis,
        series=(*result.series, *gap.series),
        ladder=(*result.ladder, *gap.ladder),
        augmented_robot_toml=_with_sensors(result.augmented_robot_toml, gap),
    )


def _improvement(torques: Diagnosis, gap: TransmissionResult) -> float:
    """How much the held-out error falls: of the gaps where names lie only there, of the torques otherwise."""
    if torques.findings or not gap.findings:
        return torques.fit.validation_improvement
    named = {finding.location.split(".")[0] for finding in gap.findings}
    errors = [c for name, c in gap.fit.items() if name.split(".")[0] in named and c.noise_floor > 0]
    before, after = (
        sum((part.validation_rms / c.noise_floor) ** 2 for c, part in pairs)
        for pairs in ([(c, c.before) for c in errors], [(c, c.after) for c in errors])
    )
    return 1.0 - math.sqrt(after / before) if before > 0 else torques.fit.validation_improvement


def _with_sensors(written: str, gap: TransmissionResult) -> str:
    """The robot file with the encoders' errors that the gaps show and the torques do not."""
    errors = found_sensors(gap.findings)
    if not errors:
        return written
    robot = robot_from_toml(written)
    there = {(use.effect, use.at) for use in robot.effects}
    new = [u for u in errors if (u.effect, u.at) not in there and robot.sensor(u.at) is not None]
    return robot_to_toml(robot.with_effects(*new)) if new else written


def _unwritten(robot: Robot, gap: TransmissionResult) -> Iterator[str]:
    """Errors of encoders that the file cannot hold."""
    for use in found_sensors(gap.findings):
        if robot.sensor(use.at) is None:
            yield (
                f"{use.effect} at {use.at}: not in the augmented robot file: the robot file lists no sensor "
                "of that channel."
            )


def _left_by_gears(torques: Diagnosis, gap: TransmissionResult, fit: Fit) -> bool:
    """Whether all that the torques leave open lies where gears were found, and is the smaller part by far.

    The torques of a joint whose gear was found are taken with it already, so that what is left of them is
    what the gear's model leaves, impacts of its flanks above all: no mismatch for which nothing was found. It
    counts with what the gear explains between the encoders, in units of the noise, as in `verdict_of`.
    """
    if torques.verdict != "unexplained" or torques.findings:
        return False
    geared = {f.location for f in gap.findings if isinstance(get_effect(f.effect), GearEffect)}
    if not {item.location for item in beyond_noise(torques.mismatch)} <= geared:
        return False
    energies = [
        [
            max((errors.validation_rms / channel.noise_floor) ** 2 - 1.0, 0.0)
            for errors in (channel.before, channel.after)
        ]
        for name, channel in fit.channels.items()
        if name.split(".")[0] in geared and channel.noise_floor > 0
    ]
    before, after = (sum(pair[k] for pair in energies) for k in range(2))
    return after < (1.0 - EXPLAINED_PART) * before


def _verdict(gap: TransmissionResult) -> Verdict:
    explained = {finding.location.split(".")[0] for finding in gap.findings}
    if any(item.location.split(".")[0] not in explained for item in gap.mismatch):
        return "unexplained"
    if not gap.findings:
        return "consistent"
    return verdict_on_names(gap.findings)
