"""The samples of a diagnosis in which robot files are compared."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from missing_physics.diagnosis.least_squares.problem import Problem, Segment
from missing_physics.diagnosis.preparation.split import Split
from missing_physics.evaluation import Band
from missing_physics.results.samples import Rows
from missing_physics.standard.band import SLOWEST
from missing_physics.standard.rows import prismatic
from robot_model import Robot

__all__ = ["moved_joints", "rows_of"]

Mask = NDArray[np.bool_]


def rows_of(data: Split) -> tuple[Rows, ...]:
    """Of all recordings, those that are fitted first."""
    moved = moved_joints(data.problem.segments[0].robot, data.problem.segments)
    found = list(_rows(data.problem, ~data.train, moved))
    if data.validation is not data.problem:
        found += _rows(data.validation, data.scored, moved)
    alone = _follows(data)
    return tuple(replace(rows, follows=alone) for rows in found)


def _follows(data: Split) -> bool:
    """Whether torques follow from the joints' recorded motion: not where a joint has no encoder."""
    return not any(segment.motion.derived for segment in data.segments)


def moved_joints(robot: Robot, segments: Sequence[Segment]) -> frozenset[str]:
    """Joints that what is fitted moves.

    A joint that is held while others move gives way by the stiffness of its controller, which tells neither
    its friction nor its masses: whatever fits there goes astray once it moves.
    """
    peaks = np.max([np.abs(segment.velocity).max(axis=0) for segment in segments], axis=0)
    kinds = prismatic(robot)
    least = np.array([SLOWEST * peaks[kinds == kind].max() for kind in kinds])
    return frozenset(j.name for j, peak, low in zip(robot.moving_joints, peaks, least) if peak > low)


def _rows(problem: Problem, held_out: Mask, moved: Collection[str]) -> Sequence[Rows]:
    used = np.flatnonzero(problem.usable)
    channels = tuple(problem.outputs[k].channel for k in used)
    judged = np.array([not c.endswith(".torque") or c.removesuffix(".torque") in moved for c in channels])
    found = []
    for number, segment in enumerate(problem.segments):
        own, motion = problem.segment_of == number, segment.motion
        found.append(
            Rows(
                channels,
                problem.noise_floor[used],
                problem.time[own],
                held_out[own],
                (problem.sliding[own][:, used] > 0) & judged,
                Band(motion.low_pass.cutoff, motion.motion_cutoff),
            )
        )
    return found
