"""Choice of the robot file to write: the answer's, unless a simpler one predicts held-out data better."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from missing_physics.answer.guard import WORSE
from missing_physics.diagnosis.comparison.predictions import Predictions
from missing_physics.results.comparison import AT_NOISE, Written
from missing_physics.standard.rows import without_friction
from robot_model import EffectUse, Robot

__all__ = ["Choice", "chosen", "energy", "levels", "worse_channels"]

Evaluated = Callable[[Robot], Predictions | None]


@dataclass(frozen=True)
class Choice:
    """The robot file to be written.

    Attributes:
        written: kind of its content.
        predictions: of this file.
        worse: channels in which the answer was worse than the standard model.
        overall: whether it was worse over all channels.
    """

    written: Written
    predictions: Predictions
    worse: tuple[str, ...] = ()
    overall: bool = False


def chosen(
    answer: Predictions,
    nominal: Predictions,
    standard: Predictions | None,
    noise: Mapping[str, float],
    evaluated: Evaluated,
) -> Choice:
    """The answer if it is not worse than the others, else the best alternative.

    Args:
        answer: predictions of the robot with the findings.
        nominal: of the nominal robot.
        standard: of the standard model, None if it could not be fitted.
        noise: rms of the noise by channel; errors below it never count as worse.
        evaluated: computes the predictions of another robot on the same samples.
    """
    rivals = {"nominal": nominal} if standard is None else {"standard": standard, "nominal": nominal}
    level = levels(standard or nominal, noise)
    best = min(rivals, key=lambda name: energy(rivals[name], level))
    overall = energy(answer, level) > WORSE**2 * max(energy(rivals[best], level), _floor(level, noise))
    worse = () if standard is None else tuple(worse_channels(answer, standard, noise))
    if overall:
        return Choice("standard" if best == "standard" else "nominal", rivals[best], worse, overall=True)
    if not worse or standard is None:
        return Choice("answer", answer)
    joints: set[str] = set()
    more = {channel.split(".")[0] for channel in worse}
    while more - joints:  # mixing bodies and friction of both models may make another joint worse
        joints |= more
        for written, robot in _mixed(answer.robot, standard.robot, joints):
            made = evaluated(robot)
            if made is not None:
                left = list(worse_channels(made, standard, noise))
                if not left:
                    return Choice(written, made, worse)
                more = {channel.split(".")[0] for channel in left}
    return Choice("standard", standard, worse)


def levels(reference: Predictions, noise: Mapping[str, float]) -> dict[str, float]:
    """Scale of the errors of each channel before they are added: held-out rms of the reference."""
    return {
        channel: max(errors.validation_rms, noise.get(channel, 0.0), np.finfo(float).eps)
        for channel, errors in reference.errors.items()
    }


def energy(made: Predictions, level: Mapping[str, float]) -> float:
    """Mean over channels of the squared held-out rms in units of `level`."""
    parts = [(made.errors[c].validation_rms / level[c]) ** 2 for c in level if c in made.errors]
    return float(np.mean(parts)) if parts else 0.0


def _floor(level: Mapping[str, float], noise: Mapping[str, float]) -> float:
    return float(np.mean([(noise.get(c, 0.0) / size) ** 2 for c, size in level.items()])) if level else 0.0


def worse_channels(made: Predictions, standard: Predictions, noise: Mapping[str, float]) -> Iterator[str]:
    """Channels in which `made` predicts held-out data worse than the standard model."""
    for channel, errors in standard.errors.items():
        least = max(WORSE * errors.validation_rms, AT_NOISE * noise.get(channel, 0.0))
        if channel in made.errors and made.errors[channel].validation_rms > least:
            yield channel


def _mixed(answer: Robot, standard: Robot, joints: Collection[str]) -> Iterator[tuple[Written, Robot]]:
    """Mixtures of the answer and the standard model, the one nearest to the answer first."""
    effects = _friction_of(answer, standard, joints)
    bodies = {key: getattr(standard, key) for key in ("links", "base", "joints", "transmissions")}
    yield "standard_friction", answer.model_copy(update={"effects": effects})
    yield "standard_bodies", answer.model_copy(update=bodies)
    yield "standard_friction", answer.model_copy(update={**bodies, "effects": effects})


def _friction_of(answer: Robot, standard: Robot, joints: Collection[str]) -> tuple[EffectUse, ...]:
    """The answer's effects, with friction and offset of the standard model at `joints`."""
    others = {id(use) for use in without_friction(answer).effects}
    kept = [use for use in answer.effects if id(use) in others or use.at not in joints]
    theirs = {id(use) for use in without_friction(standard).effects}
    return (*kept, *(use for use in standard.effects if id(use) not in theirs and use.at in joints))
