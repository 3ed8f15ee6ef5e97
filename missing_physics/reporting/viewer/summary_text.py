"""The summary as Markdown, for the text panel of the rerun file."""

from __future__ import annotations

import re
from itertools import pairwise

from missing_physics.reporting.elements.formatting import finding_text, plus_minus_text, probability_text
from missing_physics.reporting.elements.verdicts import TITLE, improvement_text, named_text, not_judged_text
from missing_physics.results.result import Result

__all__ = ["markdown", "plain"]


def markdown(result: Result, *, thinned_to: int | None) -> str:
    """Verdict, findings, what could not be determined; `thinned_to`: samples of thinned series, or None."""
    diagnosis = result.diagnosis
    lines = [
        f"## {TITLE[diagnosis.verdict]}: {plain(named_text(diagnosis) + not_judged_text(diagnosis))}",
        plain(diagnosis.summary),
        f"Held-out improvement: **{improvement_text(diagnosis)}**",
    ]
    for finding in diagnosis.findings:
        lines.append(
            f"**{plain(finding_text(finding))}**, probability {probability_text(finding.probability)}"
        )
        narrowed = {key: estimate for key, estimate in finding.parameters.items() if estimate.narrowed}
        lines += [f"- {plain(key)}: {plain(plus_minus_text(e))}" for key, e in narrowed.items()]
    if diagnosis.could_not_tell:
        lines += ["**Could not tell**", *(f"- {plain(item)}" for item in diagnosis.could_not_tell)]
    lines.append("Grey or white: recorded. Vermilion: nominal (before). Blue: augmented (after).")
    if thinned_to is not None:
        lines.append(
            f"Long series are thinned to at most {thinned_to} samples each: the least and the greatest of "
            "each stretch."
        )
    return _paragraphs(lines)


def _paragraphs(lines: list[str]) -> str:
    text = lines[0]
    for before, line in pairwise(lines):
        text += ("\n" if before.startswith("- ") and line.startswith("- ") else "\n\n") + line
    return text + "\n"


def plain(text: str) -> str:
    """Text escaped for Markdown."""
    return re.sub(r"([\\`*_{}\[\]<>#|!])", r"\\\1", text)
