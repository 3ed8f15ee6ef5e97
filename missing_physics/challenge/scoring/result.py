"""Scores of a case and of a whole challenge."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import sqrt
from typing import Any

#: Verdict of a case without a usable answer.
NO_ANSWER = "no answer"
#: Lower bound of a torque's noise [N m or N], to avoid a division by zero.
LEAST_NOISE = 1e-12

__all__ = ["NO_ANSWER", "CaseScore", "Finding", "ModelScore", "Report", "case_score"]


@dataclass(frozen=True)
class Finding:
    """One named effect of an answer, compared with the truth.

    Attributes:
        label: `ID@PLACE`.
        probability: stated probability.
        right: it is hidden there, or it corrects a wrong parameter of the robot file.
        set: labels that the answer cannot distinguish from this one, including itself.
        covered: for each parameter whether its 95 % interval contains the truth; only if right.
    """

    label: str
    probability: float
    right: bool
    set: tuple[str, ...] = ()
    covered: dict[str, bool] = field(default_factory=dict)


@dataclass(frozen=True)
class ModelScore:
    """Named effects of a baseline, or of the answer, and its error on held-out torque.

    Attributes:
        named: effects as `ID@PLACE`, or terms that are not effects.
        error: rms of measured minus model relative to the sensor's noise, on the held-out recording.
        note: reason if there is none.
    """

    named: tuple[str, ...]
    error: float | None
    note: str = ""


@dataclass(frozen=True)
class CaseScore:
    """Score of one case.

    Attributes:
        number, name, family, robot: identify the case.
        hidden: `ID@PLACE` of the hidden effects of the catalogue.
        foreign: kind of physics outside the catalogue; empty if there is none.
        identifiable: per hidden label, whether it is identifiable by the true model.
        distance: per hidden label, the information that separates it from its nearest rival.
        verdict: verdict of the answer; `NO_ANSWER` without a readable answer.
        findings: findings of the answer.
        place: every hidden place is named or located; None if nothing is hidden.
        right_name: every hidden effect is named at its place; None without hidden effects of the catalogue.
        in_set: the truth is inside the stated set of an `ambiguous` verdict; None for other verdicts.
        errors: whitened rms over all measured channels of the held-out recording in closed loop: `nominal`,
            `answer`, `truth`.
        models: baselines and the answer on held-out torque.
        stated_improvement: improvement stated in diagnosis.json.
        seconds: duration of the diagnosis.
        attempts: number of processes that were started.
        message: last error output of a diagnosis without answer.
        conditions: level of each factor, see `draws.conditions`.
        file_exact: the parameters of the robot file are correct.
        log_score, brier: proper scores of the stated probabilities, see `scoring.probability`.
        held_out: by joint the rms of the held-out torque residual [N m or N] of the `nominal` robot, of
            the `answer`, and of the true one (`noise`).
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
        """Held-out torque error relative to the nominal robot's, with each joint in units of its noise.

        1 without a usable answer; None if no torque is recorded.
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
        """Findings of effects that are not present."""
        return tuple(finding for finding in self.findings if not finding.right)

    @property
    def improvement(self) -> float | None:
        """Reduction of the held-out error relative to that of the true model; None without either."""
        if not self.improvable or "answer" not in self.errors:
            return None
        nominal, truth, answer = (self.errors[key] for key in ("nominal", "truth", "answer"))
        return (nominal - answer) / (nominal - truth)

    @property
    def improvable(self) -> bool:
        """Whether the true model's held-out error is below the nominal robot's."""
        nominal, truth = self.errors.get("nominal"), self.errors.get("truth")
        return nominal is not None and truth is not None and nominal > 1.05 * truth

    @property
    def exactly(self) -> bool | None:
        """Whether exactly the hidden effects are named; None without hidden effects of the catalogue."""
        return bool(self.right_name) and not self.wrong if self.hidden else None


@dataclass(frozen=True)
class Report:
    """A scored challenge.

    Attributes:
        scores: scores of all cases, in the order of their numbers.
        unmade: reasons for cases that could not be simulated, by number.
        facts: fingerprints, isolation and versions.
    """

    scores: tuple[CaseScore, ...]
    unmade: dict[int, str]
    facts: dict[str, Any]


def case_score(content: dict[str, Any]) -> CaseScore:
    """A score from its JSON."""
    findings = tuple(Finding(**{**f, "set": tuple(f["set"])}) for f in content["findings"])
    models = {k: ModelScore(tuple(m["named"]), m["error"], m["note"]) for k, m in content["models"].items()}
    return CaseScore(
        **{**content, "findings": findings, "models": models, "hidden": tuple(content["hidden"])}
    )
