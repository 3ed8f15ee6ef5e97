"""The last step: errors of nominal robot, standard model and answer, and the resulting verdict."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

from missing_physics.diagnosis.comparison.choice import Choice, chosen
from missing_physics.diagnosis.comparison.credible import in_the_file
from missing_physics.diagnosis.comparison.predictions import Predictions, predictions
from missing_physics.diagnosis.comparison.restating import restated
from missing_physics.diagnosis.comparison.sentences import (
    BEYOND_A_FILE,
    NAMED_BY_STANDARD,
    NUMBERS_ARE_OFF,
    PREDICTED_BETTER,
    choice_sentence,
    no_comparison,
    remaining_errors,
)
from missing_physics.diagnosis.comparison.summary import summary
from missing_physics.diagnosis.comparison.verdict import LARGER_PART, Held, Search, decided, energies
from missing_physics.plausibility import is_credible_number
from missing_physics.results.comparison import Compared, Comparison, LogScore
from missing_physics.results.result import Finding, Fit, Result
from missing_physics.results.samples import Rows, fitted_channels
from missing_physics.standard import StandardModel, fit_standard
from missing_physics.standard.model import EFFECTS
from reference_model.dynamics.inertial import inertial_names, nominal_inertial
from reference_model.effects.catalogue import get_effect
from robot_model import EffectUse, InputError, Recording, Robot, robot_from_toml, robot_to_toml

__all__ = ["compared", "judged"]


def compared(
    result: Result,
    robot: Robot,
    recordings: Sequence[Recording],
    fitted: int,
) -> Result:
    """`result` with the comparison to the standard model, and with the robot file that predicts best.

    Args:
        result: a diagnosis with its robot file.
        robot: the nominal robot.
        recordings: all recordings, the fitted ones first.
        fitted: number of recordings that are fitted.

    The answer was already compared with the standard model joint by joint (`missing_physics.answer.guard`).
    So findings that are all part of that model are not refuted by its slightly better predictions.
    """
    rows = result.rows
    fit, why = _standard(robot, recordings[:fitted], rows) if rows else (None, "")
    if fit is not None:
        rows = tuple(replace(own, band=replace(own.band, rest=tuple(fit.weights.rest))) for own in rows)
        bands = replace(result.diagnosis.fit, bands=tuple(own.band for own in rows))
        result = replace(result, rows=rows, diagnosis=replace(result.diagnosis, fit=bands))
    standard = None if fit is None else fit.robot
    nominal = answer = None
    if rows:
        nominal = predictions(robot, recordings, rows)
        answer = predictions(robot_from_toml(result.augmented_robot_toml), recordings, rows)
    if nominal is None or answer is None:
        return _with_comparison(result, Comparison(words=no_comparison(rows)))
    made = None if standard is None else predictions(standard, recordings, rows)
    if standard is not None and made is None:
        why = BEYOND_A_FILE
    noise = dict(zip(rows[0].channels, map(float, rows[0].noise)))
    choice = Choice("answer", answer)
    if result.diagnosis.verdict != "consistent":
        choice = chosen(
            answer, nominal, made, rows[0].floor, lambda other: predictions(other, recordings, rows)
        )
    if choice.written.startswith("standard") and _is_standard(result.diagnosis.findings):
        choice = replace(choice, written="answer", worse=(), overall=False)
    result = restated(result, nominal, choice.predictions, made)
    three = nominal, made, choice.predictions
    named = _standard_names(choice.written, choice.predictions.robot, result.diagnosis.findings)
    words = why or (NAMED_BY_STANDARD if named else choice_sentence(choice))
    comparison = Comparison(
        _channels(result.diagnosis.fit, three, noise), choice.written, choice.worse, words
    )
    score = LogScore(*(None if one is None else one.log_score() for one in three))  # type: ignore[arg-type]
    file = choice.predictions.robot
    diagnosis = result.diagnosis
    others = choice.written in ("standard", "nominal", "standard_bodies")
    numbers = in_the_file(diagnosis.nominal_parameters, file, standard=others)
    result = replace(
        result,
        augmented_robot_toml=robot_to_toml(file),
        diagnosis=replace(diagnosis, nominal_parameters=numbers),
    )
    return _with_comparison(result, comparison, score)


def judged(result: Result, robot: Robot, lacking: Sequence[str] = ()) -> Result:
    """`result` with the verdict and the summary that follow from its content.

    Args:
        result: the diagnosis with its errors.
        robot: the nominal robot.
        lacking: joints that cannot be judged from the recordings.
    """
    diagnosis = result.diagnosis
    if diagnosis.verdict == "not_enough_data":
        return result
    silent = tuple(dict.fromkeys([*lacking, *not_judged(robot, result.rows)]))
    floor = result.rows[0].floor if result.rows else {}
    written = diagnosis.comparison.written
    held = _held(diagnosis.fit, floor, silent, _beyond_standard(robot, diagnosis.findings))
    before, after = energies(held)
    file = robot_from_toml(result.augmented_robot_toml)
    named_by_standard = _standard_names(written, file, diagnosis.findings)
    explained = 1.0 - after / before if before > 0.0 else 0.0
    renumbered = not (diagnosis.findings or diagnosis.unnamed) and explained >= LARGER_PART
    renumbered = renumbered and _has_credible_bodies(robot, file)
    named_by_standard = named_by_standard or (renumbered and written.startswith("standard"))
    if named_by_standard:  # the standard model agrees with the answer and is no rival
        held = [replace(one, standard=None) for one in held]
    search = Search(
        diagnosis.verdict,
        worse=written in ("standard", "nominal") and not named_by_standard,
        mixed=written != "answer" and not named_by_standard,
        renumbered=renumbered,
        explained=explained,
    )
    verdict = decided(held, diagnosis.findings, diagnosis.unnamed, search)
    sentences = [
        summary(robot, verdict, diagnosis.mismatch, diagnosis.findings, diagnosis.fit, diagnosis.unnamed)
    ]
    if renumbered and verdict != "unexplained":
        diagnosis = replace(diagnosis, comparison=replace(diagnosis.comparison, words=NUMBERS_ARE_OFF))
    if verdict == "partly_explained":
        sentences += remaining_errors(diagnosis.fit, floor)
    if diagnosis.comparison.words and (renumbered or diagnosis.comparison.written != "answer"):
        sentences.append(diagnosis.comparison.words)
    diagnosis = replace(diagnosis, verdict=verdict, summary=" ".join(sentences), not_judged=silent)
    return replace(result, diagnosis=diagnosis)


def _has_credible_bodies(robot: Robot, file: Robot) -> bool:
    """Whether the bodies of a robot file are credible estimates of those of the nominal robot."""
    numbers = zip(inertial_names(robot), nominal_inertial(file), nominal_inertial(robot), strict=True)
    return all(is_credible_number(name, mine, given, robot) for name, mine, given in numbers)


def not_judged(robot: Robot, rows: Sequence[Rows]) -> tuple[str, ...]:
    """Drives without a compared sample: their torque is not known, or they hardly move."""
    counted = fitted_channels(rows)
    return tuple(j.name for j in robot.drives if rows and f"{j.name}.torque" not in counted)


def _standard_names(written: str, file: Robot, findings: Sequence[Finding]) -> bool:
    """Whether the robot file has the standard model's parameters, and these confirm all findings."""
    if not written.startswith("standard") or not _is_standard(findings):
        return False
    return all(
        any(use.effect == f.effect and use.at == f.location and _confirms(use, f) for use in file.effects)
        for f in findings
    )


def _confirms(use: EffectUse, finding: Finding) -> bool:
    """Whether every parameter is within the width of the interval of the finding's parameter."""
    numbers = use.model_dump()
    return bool(finding.parameters) and all(
        abs(numbers[name] - one.value) <= one.ci95[1] - one.ci95[0]
        for name, one in finding.parameters.items()
    )


def _is_standard(findings: Sequence[Finding]) -> bool:
    """Whether all findings are effects of the standard model, whose parameters are then as good."""
    own = {effect for effect, _, _ in EFFECTS.values()}
    return bool(findings) and {finding.effect for finding in findings} <= own


def _with_comparison(result: Result, comparison: Comparison, score: LogScore | None = None) -> Result:
    """`result` with the comparison, noted at findings whose joint the standard model predicts better."""
    joints = {channel.split(".")[0] for channel in comparison.worse}
    findings = tuple(
        replace(f, note=" ".join([*([f.note] if f.note else []), PREDICTED_BETTER]))
        if f.location.split(".")[0] in joints
        else f
        for f in result.diagnosis.findings
    )
    diagnosis = replace(result.diagnosis, comparison=comparison, log_score=score, findings=findings)
    return replace(result, diagnosis=diagnosis)


def _standard(
    robot: Robot, recordings: Sequence[Recording], rows: Sequence[Rows]
) -> tuple[StandardModel | None, str]:
    """The standard model, fitted to the compared samples, or the reason why there is none."""
    fitted = rows[: len(recordings)]
    windows, samples = [own.windows for own in fitted], [own.sample for own in fitted]
    try:
        return fit_standard(robot, recordings, held_out=windows, samples=samples), ""
    except InputError as reason:
        return None, f"No standard model: {reason}"


def _channels(
    fit: Fit, three: tuple[Predictions, Predictions | None, Predictions], noise: dict[str, float]
) -> dict[str, Compared]:
    nominal, standard, answer = three
    return {
        channel: Compared(
            fit.channels[channel].unit,
            nominal.errors[channel],
            None if standard is None else standard.errors.get(channel),
            answer.errors[channel],
            noise[channel],
        )
        for channel in nominal.errors
        if channel in answer.errors and channel in fit.channels
    }


def _beyond_standard(robot: Robot, findings: Sequence[Finding]) -> set[str]:
    """Joints at which an effect that the standard model lacks is named; all if one is not at a joint."""
    every = {drive.name for drive in robot.drives}
    places = {f.location.split(".")[0] for f in findings if get_effect(f.effect).is_beyond_standard}
    return every if places - every else places


def _held(
    fit: Fit, floor: Mapping[str, float], silent: Collection[str], beyond: Collection[str]
) -> list[Held]:
    """Held-out errors of the channels on which the verdict is based; the error of any model counts as noise.

    Args:
        fit: errors of all channels.
        floor: rms by channel below which errors are not significant.
        silent: joints that could not be judged; their residuals are ignored.
        beyond: joints at which an effect that the standard model lacks is named.
    """
    return [
        Held(
            one.before.validation_rms,
            None if one.standard is None else one.standard.validation_rms,
            one.after.validation_rms,
            max(one.noise_floor, floor.get(name, 0.0)),
            name.split(".")[0] in beyond,
        )
        for name, one in fit.channels.items()
        if math.isfinite(one.after.validation_rms)
        and not (name.endswith(".torque") and name.removesuffix(".torque") in silent)
    ]
