"""The summary of a diagnosis for the user."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from missing_physics.results.result import Finding, Fit, Mismatch, Unnamed, Verdict
from reference_model.effects.catalogue import catalogue
from robot_model import Robot

__all__ = ["summary"]


def summary(
    robot: Robot,
    verdict: Verdict,
    mismatch: Sequence[Mismatch],
    findings: Sequence[Finding],
    fit: Fit,
    unnamed: Sequence[Unnamed] = (),
) -> str:
    """The summary in one paragraph."""
    sentences = [*_sentences(robot, verdict, mismatch, findings, fit)]
    if unnamed and findings and verdict != "unexplained":
        sentences.append("Part of the mismatch has no name.")
    return " ".join([*sentences, *(item.words for item in unnamed)])


def _sentences(
    robot: Robot, verdict: Verdict, mismatch: Sequence[Mismatch], findings: Sequence[Finding], fit: Fit
) -> Iterator[str]:
    if verdict == "consistent":
        bend = " and the error of the model of flexible links" if robot.flexible_links else ""
        yield f"The recording agrees with {robot.name} to within the sensors' noise{bend}."
        return
    if mismatch:
        yield "Where it differs: " + mismatch[0].words
    if findings:
        names = [f"{_title(f.effect)} at {f.location} ({f.probability:.0%})" for f in findings]
        yield "What is missing: " + ", ".join(names) + "."
        change = "falls" if fit.validation_improvement >= 0.0 else "grows"
        yield f"On data that were not fitted the error {change} by {abs(fit.validation_improvement):.0%}."
    if verdict == "ambiguous":
        for finding in findings:
            if finding.ambiguous_with:
                yield (
                    f"{_title(finding.effect)} at {finding.location} cannot be told apart from "
                    f"{', '.join(finding.ambiguous_with)} with these data."
                )
    if verdict == "unexplained" and findings:
        yield "The effects found are not sufficient, or are doubtful; the rest of the mismatch has no name."
    elif verdict == "unexplained":
        yield "The mismatch is real, and no effect of the catalogue explains it."


def _title(effect_id: str) -> str:
    """Title of an effect."""
    effect = catalogue().get(effect_id)
    return effect.title if effect else effect_id.replace("_", " ").capitalize()
