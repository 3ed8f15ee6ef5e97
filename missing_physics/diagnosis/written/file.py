"""The robot file in the end, when everything that was found stands, and what it says of the recordings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from missing_physics.diagnosis.written import words
from missing_physics.diagnosis.written.statement import restated
from missing_physics.results.result import Result
from reference_model.effects.base import GearEffect
from reference_model.effects.catalogue import get_effect
from robot_model import InputError, Recording, Robot, robot_from_toml, robot_to_toml

__all__ = ["with_file"]


def with_file(result: Result, robot: Robot, recordings: Sequence[Recording]) -> Result:
    """`result` with the robot file by which its errors are stated.

    What was found between encoders and of their errors came into the file after the errors were stated: where
    that changes what it predicts, they are stated again.

    Args:
        result: the diagnosis; nothing changes where it states no errors.
        robot: as the user described it.
        recordings: all of them, those that are fitted first.
    """
    told = result.diagnosis
    if result.stated is None:
        return result
    written = _merged(robot_from_toml(result.augmented_robot_toml), result.stated)
    found = replace(result, augmented_robot_toml=robot_to_toml(written))
    if written == result.stated or not told.fit.bands:
        return found
    try:
        fit, series = restated(written, recordings, told.fit, result.series)
    except InputError:  # what was found between encoders cannot be simulated along their motion
        return replace(found, diagnosis=replace(told, fit=replace(told.fit, bands=())))
    summary = words.summary(robot, told.verdict, told.mismatch, told.findings, fit, told.unnamed)
    return replace(found, diagnosis=replace(told, fit=fit, summary=summary), series=series)


def _merged(found: Robot, stated: Robot) -> Robot:
    """All effects that were found, with bodies and numbers by which errors are stated."""
    own = {(use.effect, use.at): use for use in stated.effects}
    effects = tuple(
        use if isinstance(get_effect(use.effect), GearEffect) else own.get((use.effect, use.at), use)
        for use in found.effects
    )
    bodies = {"links": stated.links, "base": stated.base, "joints": stated.joints}
    return found.model_copy(update={**bodies, "effects": effects})
