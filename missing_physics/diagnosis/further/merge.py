"""Merges the diagnosis of the joint torques with that of further sensors."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain

from missing_physics.results.result import (
    ChannelFit,
    ChannelSeries,
    Diagnosis,
    Finding,
    Fit,
    Mismatch,
    Result,
    Rung,
    Verdict,
)
from reference_model.effects.base import SensorEffect
from reference_model.effects.catalogue import get_effect
from robot_model import EffectUse, Robot, robot_from_toml, robot_to_toml

__all__ = ["Further", "joined", "written_with"]


@dataclass(frozen=True, kw_only=True)
class Further:
    """Diagnosis of further sensors.

    Attributes:
        mismatch: one for each channel whose residual exceeds the noise; shares are fractions of the whitened
            energy of all channels.
        findings: named causes.
        fit: errors by channel.
        could_not_tell: sentences on what could not be determined.
        ladder: every cause that was tried.
        series: measurements, and predictions without and with the findings.
    """

    mismatch: tuple[Mismatch, ...] = ()
    findings: tuple[Finding, ...] = ()
    fit: Mapping[str, ChannelFit] = field(default_factory=dict)
    could_not_tell: tuple[str, ...] = ()
    ladder: tuple[Rung, ...] = ()
    series: tuple[ChannelSeries, ...] = ()


def written_with(file: Robot, robot: Robot, uses: Sequence[EffectUse]) -> tuple[Robot, tuple[str, ...]]:
    """A robot file with the findings of further sensors, and sentences on what it cannot hold.

    Args:
        file: the file to which effects are added unless it has them.
        robot: the nominal robot, which lists the sensors.
        uses: the findings as effects.
    """
    in_file = {(use.effect, use.at) for use in file.effects}
    lacks = [
        use
        for use in uses
        if isinstance(get_effect(use.effect), SensorEffect) and robot.sensor(use.at) is None
    ]
    new = [use for use in uses if use not in lacks and (use.effect, use.at) not in in_file]
    return file.with_effects(*new), tuple(
        f"{use.effect} at {use.at}: not in the augmented robot file: the robot file lists no sensor of that "
        "channel."
        for use in lacks
    )


def joined(
    result: Result, more: Further, robot: Robot, uses: Sequence[EffectUse], *, first: bool = False
) -> Result:
    """`result` merged with the diagnosis of further sensors, also in its robot file.

    Args:
        result: the diagnosis of the torques.
        more: the diagnosis of the sensors; its findings replace the same ones from the torques.
        robot: the nominal robot.
        uses: the findings of `more` as effects.
        first: whether these findings precede those from the torques.
    """
    file, lacks = written_with(robot_from_toml(result.augmented_robot_toml), robot, uses)
    before = result.diagnosis
    verdict: Verdict = before.verdict
    if verdict == "consistent" or (verdict == "not_enough_data" and (more.findings or more.mismatch)):
        verdict = _verdict(more)
    named = {(finding.effect, finding.location) for finding in more.findings}
    others = tuple(f for f in before.findings if (f.effect, f.location) not in named)
    mismatch, findings = (before.mismatch, more.mismatch), (others, more.findings)
    diagnosis = replace(
        before,
        verdict=verdict,
        mismatch=tuple(chain(*(reversed(mismatch) if first else mismatch))),
        findings=tuple(chain(*(reversed(findings) if first else findings))),
        fit=Fit({**before.fit.channels, **more.fit}, _improvement(before, more), before.fit.bands),
        could_not_tell=(*before.could_not_tell, *more.could_not_tell, *lacks),
    )
    return replace(
        result,
        diagnosis=diagnosis,
        series=(*result.series, *more.series),
        ladder=(*result.ladder, *more.ladder),
        augmented_robot_toml=robot_to_toml(file),
    )


def _improvement(torques: Diagnosis, more: Further) -> float:
    """Improvement of the held-out error: of these sensors if all findings are there, else of torques."""
    if torques.findings or not more.findings:
        return torques.fit.validation_improvement
    named = {finding.location.split(".")[0] for finding in more.findings}
    errors = [c for name, c in more.fit.items() if name.split(".")[0] in named and c.noise_floor > 0]
    before, after = (
        sum((part.validation_rms / c.noise_floor) ** 2 for c, part in pairs)
        for pairs in ([(c, c.before) for c in errors], [(c, c.after) for c in errors])
    )
    return 1.0 - math.sqrt(after / before) if before > 0 else torques.fit.validation_improvement


def _verdict(more: Further) -> Verdict:
    explained = {finding.location.split(".")[0] for finding in more.findings}
    if any(item.location.split(".")[0] not in explained for item in more.mismatch):
        return "unexplained"
    if not more.findings:
        return "consistent"
    return "ambiguous" if any(finding.ambiguous_with for finding in more.findings) else "explained"
