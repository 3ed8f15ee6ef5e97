"""The last step: errors of robot as described, standard model and answer, and what follows of them."""

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
    left_over,
    no_comparison,
    of_choice,
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
from robot_model import EffectUse, InputError, Recording, Robot, robot_from_toml, robot_to_toml

__all__ = ["compared", "judged"]


def compared(
    result: Result,
    robot: Robot,
    recordings: Sequence[Recording],
    fitted: int,
) -> Result:
    """`result` with the standard model next to it, and the robot file that predicts best.

    Args:
        result: a diagnosis with its robot file.
        robot: as the user described it.
        recordings: all of them, those that are fitted first.
        fitted: how many these are.

    The answer was compared with the standard model joint by joint already (`missing_physics.answer.guard`),
    so that names which are all in that model are not refuted by its slightly better predictions.
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
        return _told(result, Comparison(words=no_comparison(rows)))
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
        choice = replace(choice, written="answer", worse=(), whole=False)
    result = restated(result, nominal, choice.predictions, made)
    three = nominal, made, choice.predictions
    named = _standard_names(choice.written, choice.predictions.robot, result.diagnosis.findings)
    said = why or (NAMED_BY_STANDARD if named else of_choice(choice))
    comparison = Comparison(_channels(result.diagnosis.fit, three, noise), choice.written, choice.worse, said)
    score = LogScore(*(None if one is None else one.log_score() for one in three))  # type: ignore[arg-type]
    file = choice.predictions.robot
    told = result.diagnosis
    others = choice.written in ("standard", "nominal", "standard_bodies")
    numbers = in_the_file(told.nominal_parameters, file, standard=others)
    result = replace(
        result,
        augmented_robot_toml=robot_to_toml(file),
        diagnosis=replace(told, nominal_parameters=numbers),
    )
    return _told(result, comparison, score)


def judged(result: Result, robot: Robot, lacking: Sequence[str] = ()) -> Result:
    """`result` with the verdict and the summary that follow of everything in it.

    Args:
        result: the diagnosis with its errors.
        robot: as the user described it.
        lacking: joints of which nothing can be judged, as the recordings say.
    """
    told = result.diagnosis
    if told.verdict == "not_enough_data":
        return result
    silent = tuple(dict.fromkeys([*lacking, *not_judged(robot, result.rows)]))
    floor = result.rows[0].floor if result.rows else {}
    written, held = told.comparison.written, _held(told.fit, floor, silent)
    before, after = energies(held)
    file = robot_from_toml(result.augmented_robot_toml)
    named_by_standard = _standard_names(written, file, told.findings)
    explained = 1.0 - after / before if before > 0.0 else 0.0
    renumbered = not (told.findings or told.unnamed) and explained >= LARGER_PART
    renumbered = renumbered and _has_credible_bodies(robot, file)
    named_by_standard = named_by_standard or (renumbered and written.startswith("standard"))
    if named_by_standard:  # it says the same, and is no rival
        held = [replace(one, standard=None) for one in held]
    search = Search(
        told.verdict,
        worse=written in ("standard", "nominal") and not named_by_standard,
        mixed=written != "answer" and not named_by_standard,
        renumbered=renumbered,
        explained=explained,
    )
    verdict = decided(held, told.findings, told.unnamed, search)
    sentences = [summary(robot, verdict, told.mismatch, told.findings, told.fit, told.unnamed)]
    if renumbered and verdict != "unexplained":
        told = replace(told, comparison=replace(told.comparison, words=NUMBERS_ARE_OFF))
    if verdict == "partly_explained":
        sentences += left_over(told.fit, floor)
    if told.comparison.words and (renumbered or told.comparison.written != "answer"):
        sentences.append(told.comparison.words)
    diagnosis = replace(told, verdict=verdict, summary=" ".join(sentences), not_judged=silent)
    return replace(result, diagnosis=diagnosis)


def _has_credible_bodies(robot: Robot, file: Robot) -> bool:
    """Whether the bodies of a robot file are credible estimates of those of the nominal robot."""
    numbers = zip(inertial_names(robot), nominal_inertial(file), nominal_inertial(robot), strict=True)
    return all(is_credible_number(name, mine, given, robot) for name, mine, given in numbers)


def not_judged(robot: Robot, rows: Sequence[Rows]) -> tuple[str, ...]:
    """Drives of which no fitted sample counts: their torque is not known, or they hardly move."""
    counted = fitted_channels(rows)
    return tuple(j.name for j in robot.drives if rows and f"{j.name}.torque" not in counted)


def _standard_names(written: str, file: Robot, findings: Sequence[Finding]) -> bool:
    """Whether the robot file has the standard model's numbers, and these confirm all that is named."""
    if not written.startswith("standard") or not _is_standard(findings):
        return False
    return all(
        any(use.effect == f.effect and use.at == f.location and _confirms(use, f) for use in file.effects)
        for f in findings
    )


def _confirms(use: EffectUse, finding: Finding) -> bool:
    """Whether every number is as near to the finding's as its interval is wide."""
    numbers = use.model_dump()
    return bool(finding.parameters) and all(
        abs(numbers[name] - one.value) <= one.ci95[1] - one.ci95[0]
        for name, one in finding.parameters.items()
    )


def _is_standard(findings: Sequence[Finding]) -> bool:
    """Whether all that is named is in the standard model, whose numbers are as good as the answer's then."""
    own = {effect for effect, _, _ in EFFECTS.values()}
    return bool(findings) and {finding.effect for finding in findings} <= own


def _told(result: Result, comparison: Comparison, score: LogScore | None = None) -> Result:
    """`result` with the comparison, which names at joints that the standard model predicts better say."""
    joints = {channel.split(".")[0] for channel in comparison.worse}
    findings = tuple(
        replace(f, note=" ".join([*([f.note] if f.note else []), PREDICTED_BETTER]))
        if f.location.split(".")[0] in joints
        else f
        for f in result.diagnosis.findings
    )
    told = replace(result.diagnosis, comparison=comparison, log_score=score, findings=findings)
    return replace(result, diagnosis=told)


def _standard(
    robot: Robot, recordings: Sequence[Recording], rows: Sequence[Rows]
) -> tuple[StandardModel | None, str]:
    """The standard model, fitted to what is compared, or why there is none."""
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


def _held(fit: Fit, floor: Mapping[str, float], silent: Collection[str]) -> list[Held]:
    """Held-out errors of the channels that the verdict is about. The error of any model counts as noise.

    Args:
        fit: of all channels.
        floor: rms by channel of which nothing can be said.
        silent: joints that could not be judged; what is left there says nothing about the answer.
    """
    return [
        Held(
            one.before.validation_rms,
            None if one.standard is None else one.standard.validation_rms,
            one.after.validation_rms,
            max(one.noise_floor, floor.get(name, 0.0)),
        )
        for name, one in fit.channels.items()
        if math.isfinite(one.after.validation_rms)
        and not (name.endswith(".torque") and name.removesuffix(".torque") in silent)
    ]
