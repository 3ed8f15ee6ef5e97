"""One diagnosis of two: of the joint torques, and of what lies between two encoders of a joint."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from missing_physics.diagnosis import words
from missing_physics.diagnosis.judge import SURE
from missing_physics.diagnosis.result import Fit, Result, Verdict
from missing_physics.diagnosis.transmission import TransmissionResult
from robot_model import Robot

__all__ = ["with_transmission"]

#: Verdicts from the one that leaves most open to the one that leaves least.
OPENNESS: tuple[Verdict, ...] = ("unexplained", "ambiguous", "explained", "consistent")


def with_transmission(
    result: Result, gap: TransmissionResult | None, robot: Robot, remarks: Sequence[str] = ()
) -> Result:
    """`result` with what the gaps between encoders say; the verdict is the more open one of the two.

    `remarks` are sentences on what became of it.
    """
    if gap is None:
        told = (*result.diagnosis.could_not_tell, *remarks)
        return replace(result, diagnosis=replace(result.diagnosis, could_not_tell=told))
    before = result.diagnosis
    findings = (*before.findings, *gap.findings)
    mismatch = (*before.mismatch, *gap.mismatch)
    fit = Fit({**before.fit.channels, **gap.fit}, before.fit.validation_improvement)
    verdict = before.verdict
    if verdict == "not_enough_data" and (gap.findings or gap.mismatch):
        verdict = _verdict(gap)
    elif verdict != "not_enough_data":
        verdict = min(verdict, _verdict(gap), key=OPENNESS.index)
    diagnosis = replace(
        before,
        verdict=verdict,
        summary=words.summary(robot, verdict, mismatch, findings, fit),
        mismatch=mismatch,
        findings=findings,
        fit=fit,
        could_not_tell=(*before.could_not_tell, *gap.could_not_tell, *remarks),
    )
    return replace(
        result,
        diagnosis=diagnosis,
        series=(*result.series, *gap.series),
        ladder=(*result.ladder, *gap.ladder),
    )


def _verdict(gap: TransmissionResult) -> Verdict:
    explained = {finding.location.split(".")[0] for finding in gap.findings}
    if any(item.location.split(".")[0] not in explained for item in gap.mismatch):
        return "unexplained"
    if not gap.findings:
        return "consistent"
    sure = all(f.probability >= SURE and not f.ambiguous_with for f in gap.findings)
    return "explained" if sure else "ambiguous"
