"""One diagnosis of two: of the joint torques, and of what lies between two encoders of a joint."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

from missing_physics.diagnosis.gear.transmission import TransmissionResult
from missing_physics.diagnosis.gear_file.effects import found_gears, found_sensors
from missing_physics.results.result import Diagnosis, Fit, Result, Verdict
from robot_model import Robot, robot_from_toml, robot_to_toml

__all__ = ["with_transmission"]


def with_transmission(result: Result, gap: TransmissionResult, robot: Robot) -> Result:
    """`result` with the findings between encoders, which are added to its robot file as well.

    Args:
        result: the diagnosis of the torques.
        gap: of the differences between encoders.
        robot: the nominal robot.
    """
    before, gears = result.diagnosis, found_gears(robot, gap)
    verdict: Verdict = before.verdict
    if verdict == "consistent" or (verdict == "not_enough_data" and (gap.findings or gap.mismatch)):
        verdict = _verdict(gap)
    diagnosis = replace(
        before,
        verdict=verdict,
        mismatch=(*before.mismatch, *gap.mismatch),
        findings=(*before.findings, *gap.findings),
        fit=Fit({**before.fit.channels, **gap.fit}, _improvement(before, gap)),
        could_not_tell=(*before.could_not_tell, *gap.could_not_tell, *_unwritten(robot, gap), *gears.words),
    )
    file = robot_from_toml(result.augmented_robot_toml).with_effects(*gears.uses)
    return replace(
        result,
        diagnosis=diagnosis,
        series=(*result.series, *gap.series),
        ladder=(*result.ladder, *gap.ladder),
        augmented_robot_toml=robot_to_toml(_with_sensors(file, gap)),
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


def _with_sensors(file: Robot, gap: TransmissionResult) -> Robot:
    """The robot file with the encoders' errors that the gaps show and the torques do not."""
    there = {(use.effect, use.at) for use in file.effects}
    errors = found_sensors(gap.findings)
    new = [u for u in errors if (u.effect, u.at) not in there and file.sensor(u.at) is not None]
    return file.with_effects(*new)


def _unwritten(robot: Robot, gap: TransmissionResult) -> Iterator[str]:
    """Errors of encoders that the file cannot hold."""
    for use in found_sensors(gap.findings):
        if robot.sensor(use.at) is None:
            yield (
                f"{use.effect} at {use.at}: not in the augmented robot file: the robot file lists no sensor "
                "of that channel."
            )


def _verdict(gap: TransmissionResult) -> Verdict:
    explained = {finding.location.split(".")[0] for finding in gap.findings}
    if any(item.location.split(".")[0] not in explained for item in gap.mismatch):
        return "unexplained"
    if not gap.findings:
        return "consistent"
    return "ambiguous" if any(finding.ambiguous_with for finding in gap.findings) else "explained"
