"""Headline and verdict of a diagnosis where runs in closed loop speak for everything that was named.

A regression along the recorded motion scores torques. Where a controller follows the motion that something
else brought about, or the nominal masses were tuned beside it, they hardly tell what is explained; runs show
all channels.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from missing_physics.diagnosis.naming.judge import verdict_on_names
from missing_physics.diagnosis.replay.replay import Replay
from missing_physics.diagnosis.runs.confirmation import HALF_BELIEVED
from missing_physics.diagnosis.runs.energies import down_to_noise, left_in_runs, runs_of
from missing_physics.diagnosis.written import words
from missing_physics.diagnosis.written.augment import with_findings
from missing_physics.results.result import Result
from robot_model import InputError, Robot, robot_from_toml

__all__ = ["as_runs_show"]

Array = NDArray[np.float64]
#: How it was counted.
COUNTED = "The held-out error is that of runs in closed loop, over all channels in units of their noise."


def as_runs_show(result: Result, robot: Robot, replay: Replay | None) -> Result:
    """`result` with the held-out error of runs, where these leave little of what differs.

    Where runs with all names come down to the noise in every recording nothing is unexplained.

    Args:
        robot: as the user described it.
        replay: runs along all recordings; None where that is not possible: nothing changes then.
    """
    told = result.diagnosis
    if replay is None or not told.findings or not result.real:
        return result
    try:
        whole = with_findings(robot_from_toml(result.augmented_robot_toml), told.findings)
        after, before = runs_of(replay, whole), runs_of(replay, robot)
    except InputError:
        return result
    left = left_in_runs(replay, after, before, lenient=True, exact=False)
    if after is None or before is None or left is None or left > HALF_BELIEVED:
        return result
    fit, notes, verdict, unnamed = told.fit, told.notes, told.verdict, told.unnamed
    if replay.fitted < len(replay.asked):
        fit = replace(fit, validation_improvement=_fall(before[replay.fitted :], after[replay.fitted :]))
        notes = (*notes, COUNTED)
    if verdict == "unexplained" and down_to_noise(replay, whole):
        result = replace(result, runs_whole=True)
        verdict, unnamed = verdict_on_names(told.findings), ()
    summary = words.summary(robot, verdict, told.mismatch, told.findings, fit, unnamed)
    diagnosis = replace(told, fit=fit, notes=notes, verdict=verdict, unnamed=unnamed, summary=summary)
    return replace(result, diagnosis=diagnosis)


def _fall(before: Sequence[Array], after: Sequence[Array]) -> float:
    """By how much the error falls, from mean squares of all channels in units of the noise."""
    return 1.0 - float(np.sqrt(sum(e.sum() for e in after) / sum(e.sum() for e in before)))
