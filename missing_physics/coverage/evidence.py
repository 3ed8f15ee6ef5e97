"""Evidence on each joint in the recordings: whether it moves, for how long, and the noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d

from missing_physics.evaluation.sliding import NEAR
from missing_physics.hypotheses.extents import STANDSTILL
from missing_physics.inference.data import held_out_windows
from missing_physics.motion.estimate import Motion
from missing_physics.motion.inverse import MotionDynamics
from missing_physics.recordings import rests_on_levels
from missing_physics.standard.band import SLOWEST
from robot_model import Recording, Robot, unit_of

__all__ = ["FEWEST_SURE", "JointEvidence", "evidence"]

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

#: A joint moves if its travel and its speed exceed their noise by this factor.
MOVES = 10.0
#: Least number of rows with certain direction to judge a joint [-]: five periods of the cut-off.
FEWEST_SURE = 20


@dataclass(frozen=True)
class JointEvidence:
    """One joint in all recordings.

    Attributes:
        name: of the joint.
        moves: whether it moves beyond the noise of its position.
        both_ways: whether it moves in both directions in the fitted data.
        rows_fitted: number of independent samples that are fitted.
        sure_fitted, sure_held_out: number of samples in which the direction of motion is certain.
        validated: whether separate recordings are held out.
        recorded: rms of the recorded torque [`unit`].
        needed: rms torque that the nominal robot without effects needs for the motion [`unit`].
        noise: rms of the torque's noise after the filter [`unit`].
        described: whether the robot file has effects at the joint.
        unit: of its torque.
    """

    name: str
    moves: bool
    both_ways: bool
    rows_fitted: int
    sure_fitted: int
    sure_held_out: int
    validated: bool
    recorded: float
    needed: float
    noise: float
    described: bool
    unit: str


def evidence(
    robot: Robot, recordings: Sequence[Recording], dynamics: Sequence[MotionDynamics], *, fitted: int
) -> tuple[JointEvidence, ...]:
    """Evidence on each moving joint in the recordings.

    Args:
        robot: the nominal robot.
        recordings: the fitted ones first.
        dynamics: along each recording.
        fitted: number of fitted recordings; without others, a quarter of each is held out.
    """
    own, validation = dynamics[:fitted], dynamics[fitted:]
    moves = [_moves(one, along.motion) for one, along in zip(recordings, dynamics)]
    sure = [_sure(along.motion) & in_motion for along, in_motion in zip(dynamics, moves)]
    held = [np.zeros(len(rows), dtype=bool) for rows in sure[:fitted]]
    if not validation:
        held = [_held_out(along.motion) for along in own]
    held += [np.ones(len(rows), dtype=bool) for rows in sure[fitted:]]
    levels = [_levels(along) for along in own]
    recorded, needed, noise = (np.sqrt(np.mean(np.square(part), axis=0)) for part in zip(*levels))
    found = []
    for k, joint in enumerate(robot.moving_joints):
        found.append(
            JointEvidence(
                name=joint.name,
                moves=any(in_motion[k] for in_motion in moves[:fitted]),
                both_ways=len(set().union(*(_directions(along.motion, k) for along in own))) > 1,
                rows_fitted=sum(int(np.count_nonzero(~out)) for out in held[:fitted]),
                sure_fitted=sum(int(rows[~out, k].sum()) for rows, out in zip(sure[:fitted], held)),
                sure_held_out=sum(int(rows[out, k].sum()) for rows, out in zip(sure, held)),
                validated=bool(validation),
                recorded=float(recorded[k]),
                needed=float(needed[k]),
                noise=float(noise[k]),
                described=any(use.at.split(".")[0] == joint.name for use in robot.effects),
                unit=unit_of(f"{joint.name}.torque", prismatic=joint.kind == "prismatic"),
            )
        )
    return tuple(found)


def _held_out(motion: Motion) -> Flags:
    """Mask of the rows of a recording that are held out without validation recordings, shape (R,)."""
    time = motion.reduced_time
    windows = held_out_windows(time)
    return np.any([(time >= first) & (time <= last) for first, last in windows], axis=0)


def _sure(motion: Motion) -> Flags:
    """Mask of the rows in which the direction of each joint is certain, (R, n): it is not at rest nearby.

    Nearby means within the memory of the motion's smoother: half a period of its cut-off.
    """
    speed, memory = np.abs(motion.velocity), 0.5 / motion.motion_cutoff
    still = speed <= np.maximum(NEAR * motion.velocity_noise, SLOWEST * speed.max(axis=0))
    near = maximum_filter1d(still, 2 * int(memory * motion.low_pass.rate) + 1, axis=0)
    return np.asarray(~near[motion.kept])


def _moves(recording: Recording, motion: Motion) -> Flags:
    """Mask of the joints that move beyond the noise and the resolution of their positions, shape (n,)."""
    travel, speed = np.ptp(motion.position, axis=0), np.abs(motion.velocity).max(axis=0)
    clear = (travel > MOVES * motion.position_noise) & (speed > MOVES * motion.velocity_noise)
    channels = (recording.channels.get(name) for name in motion.position_channels)
    return clear & np.array([values is None or not rests_on_levels(values) for values in channels])


def _directions(motion: Motion, index: int) -> set[float]:
    """Signs of the velocities that exceed a standstill."""
    velocity = motion.velocity[motion.kept, index]
    moving = velocity[np.abs(velocity) > STANDSTILL * np.abs(velocity).max(initial=0.0)]
    return set(np.sign(moving).tolist())


def _levels(along: MotionDynamics) -> tuple[Array, Array, Array]:
    """rms of the recorded torque, of the needed one and of the noise, shape (n,) each."""
    motion, n = along.motion, along.motion.position.shape[1]
    recorded, needed = (
        np.sqrt(np.mean(motion.low_pass.reduce(part) ** 2, axis=0))
        for part in (np.nan_to_num(motion.torque), along.torque[:, :n])
    )
    return recorded, needed, motion.low_pass.noise_gain * motion.torque_noise
