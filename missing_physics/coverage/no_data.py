"""The answer if a recording cannot support any statement."""

from __future__ import annotations

from collections.abc import Sequence

from missing_physics.coverage.joints import Coverage
from missing_physics.results.result import Diagnosis, Fit, Result
from robot_model import Recording, Robot, robot_to_toml

__all__ = ["without_data"]


def without_data(
    robot: Robot, recordings: Sequence[Recording], validation: Sequence[Recording], covered: Coverage
) -> Result:
    """The answer when the recording cannot support any statement."""
    diagnosis = Diagnosis(
        robot=robot.name,
        recordings=tuple(r.source for r in recordings),
        validation=tuple(r.source for r in validation),
        verdict="not_enough_data",
        summary="The recording cannot support any statement. " + " ".join(covered.sentences),
        mismatch=(),
        findings=(),
        fit=Fit({}, 0.0),
        could_not_tell=covered.sentences,
    )
    return Result(diagnosis, (), (), robot_to_toml(robot))
