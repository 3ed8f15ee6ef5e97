"""The samples of a diagnosis in which robot files are compared."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from missing_physics.diagnosis.comparison.samples import Rows
from missing_physics.diagnosis.problem import Problem
from missing_physics.diagnosis.split import Split
from missing_physics.evaluation import Band

__all__ = ["rows_of"]

Mask = NDArray[np.bool_]


def rows_of(data: Split) -> tuple[Rows, ...]:
    """Of all recordings, those that are fitted first."""
    found = list(_rows(data.problem, ~data.train))
    if data.validation is not data.problem:
        found += _rows(data.validation, data.scored)
    alone = _follows(data)
    return tuple(replace(rows, follows=alone) for rows in found)


def _follows(data: Split) -> bool:
    """Whether torques follow from the joints' recorded motion alone.

    Not where links bend, which the noise of encoders would shake, nor where a joint has no encoder.
    """
    return all(segment.vibration is None and not segment.motion.derived for segment in data.segments)


def _rows(problem: Problem, held_out: Mask) -> Sequence[Rows]:
    used = np.flatnonzero(problem.usable)
    channels = tuple(problem.outputs[k].channel for k in used)
    found = []
    for number, segment in enumerate(problem.segments):
        own, motion = problem.segment_of == number, segment.motion
        found.append(
            Rows(
                channels,
                problem.noise_floor[used],
                problem.time[own],
                held_out[own],
                problem.sliding[own][:, used] > 0,
                Band(motion.low_pass.cutoff, motion.motion_cutoff),
            )
        )
    return found
