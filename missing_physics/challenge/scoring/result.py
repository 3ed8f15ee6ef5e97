"""What the score of a case and of a whole challenge hold."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import sqrt
from typing import Any

#: Verdict of a case without an answer that can be used.
NO_ANSWER = "no answer"
#: A torque's noise counts as at least this [N m or N], so that errors can be divided by it.
LEAST_NOISE = 1e-12

__all__ = ["NO_ANSWER", "CaseScore", "Finding", "ModelScore", "Report", "case_score"]


@dataclass(frozen=True)
class Finding:
    """One named effect of an answer, judged.

    Attributes:
        label: `ID@PLACE`.
        probability: as stated.
        right: it is hidden there, or it takes something of the nominal robot back that was tuned away.
        set: labels that the answer calls as possible as this one, itself included.
        covered: parameter to whether its 95 % interval holds the truth; only of right ones.
    """

    label: str
    probability: float
    right: bool
    set: tuple[str, ...] = ()
    covered: dict[str, bool] = field(default_factory=dict)


@dataclass(frozen=True)
class ModelScore:
    """A baseline, or the answer beside it: what it names and its error on held-out torque.

    Attributes:
        named: effects as `ID@PLACE`, or terms that are no effects.
        error: rms of measured minus model over the sensor's noise, on the held-out recording.
        note: why there is none.
    """

    named: tuple[str, ...]
    error: float | None
    note: str = ""


@dataclass(frozen=True)
class CaseScore:
    """Everything that is counted of one case.

    Attributes:
        number, name, family, robot: which case.
        hidden: `ID@PLACE` of what is hidden from the catalogue.
        foreign: kind of physics outside the catalogue; empty where there is none.
        identifiable: per hidden label, whether it is identifiable by the true model.
        distance: per hidden label, the information that separates it from its nearest rival.
        verdict: of the answer; `NO_ANSWER` where there is none, or none that can be read.
        findings: of the answer.
        place: every hidden place is named or located; None where nothing is hidden.
        right_name: every hidden effect is named at its place; None where nothing of the catalogue is hidden.
        in_set: the truth is inside the stated set of an `ambiguous` verdict; None for other verdicts.
        errors: whitened rms over all measured channels of the held-out recording in closed loop: `nominal`,
            `answer`, `truth`.
        models: baselines and the answer on held-out torque.
        stated_improvement: of diagnosis.json.
        seconds: that the diagnosis took.
        attempts: processes that it took.
        message: last words of a diagnosis without answer.
        conditions: factor to its level, see `draws.conditions`.
        file_exact: the numbers of the robot file are the machine's.
        log_score, brier: proper scores of the stated probabilities, see `scoring.probability`.
        held_out: by joint the rms of the held-out torque that is left [N m or N] by the `nominal` robot, by
            the `answer`, and by the true one (`noise`).
    """

    number: int
    name: str
    family: str
    robot: str
    hidden: tuple[str, ...]
    foreign: str
    identifiable: dict[str, bool]
    distance: dict[str, float]
    verdict: str
    findings: tuple[Finding, ...]
    place: bool | None
    right_name: bool | None
    in_set: bool | None
    errors: dict[str, float]
    models: dict[str, ModelScore]
    stated_improvement: float | None
    seconds: float
    attempts: int
    message: str = ""
    conditions: dict[str, str] = field(default_factory=dict)
    file_exact: bool = True
    log_score: float = 0.0
    brier: float = 0.0
    held_out: dict[str, dict[str, float]] = field(default_factory=dict)

    @property
    def held_out_ratio(self) -> float | None:
        """Held-out torque error of the answer over the nominal robot's, each joint in units of its noise.

        1 without an answer that can be worked out; None where no torque is recorded.
        """
        if not self.held_out:
            return None
        before, after = (
            sum(
                (own.get(key, own["nominal"]) / max(own["noise"], LEAST_NOISE)) ** 2
                for own in self.held_out.values()
            )
            for key in ("nominal", "answer")
        )
        return sqrt(after / before) if before > 0 else None

    @property
    def wrong(self) -> tuple[Finding, ...]:
        """Findings that are not there."""
        return tuple(finding for finding in self.findings if not finding.right)

    @property
    def improvement(self) -> float | None:
        """The answer's fall of the held-out error over the true model's; None without a fall or an answer."""
        if not self.improvable or "answer" not in self.errors:
            return None
        nominal, truth, answer = (self.errors[key] for key in ("nominal", "truth", "answer"))
        return (nominal - answer) / (nominal - truth)

    @property
    def improvable(self) -> bool:
        """The true model's held-out error is below the nominal robot's."""
        nominal, truth = self.errors.get("nominal"), self.errors.get("truth")
        return nominal is not None and truth is not None and nominal > 1.05 * truth

    @property
    def exactly(self) -> bool | None:
        """The hidden effects are named and nothing wrong; None where nothing of the catalogue is hidden."""
        return bool(self.right_name) and not self.wrong if self.hidden else None


@dataclass(frozen=True)
class Report:
    """A scored challenge.

    Attributes:
        scores: of all cases, by number.
        unmade: cases that could not be simulated, and why, by number.
        facts: fingerprints, isolation, versions, for the reader.
    """

    scores: tuple[CaseScore, ...]
    unmade: dict[int, str]
    facts: dict[str, Any]


def case_score(content: dict[str, Any]) -> CaseScore:
    """A score from the JSON made of it."""
    findings = tuple(Finding(**{**f, "set": tuple(f["set"])}) for f in content["findings"])
    models = {k: ModelScore(tuple(m["named"]), m["error"], m["note"]) for k, m in content["models"].items()}
    return CaseScore(
        **{**content, "findings": findings, "models": models, "hidden": tuple(content["hidden"])}
    )
