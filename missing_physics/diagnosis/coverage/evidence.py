"""What recordings show of each joint: whether it moves, for how long surely, and against which noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d

from missing_physics.diagnosis.dynamics.inverse import MotionDynamics
from missing_physics.diagnosis.motion.estimate import Motion
from missing_physics.evaluation.sliding import NEAR
from missing_physics.hypotheses.extents import STANDSTILL
from missing_physics.inference.data import held_out_windows
from missing_physics.recordings import rests_on_levels
from missing_physics.standard.band import SLOWEST
from robot_model import Recording, Robot, unit_of

__all__ = ["FEWEST_SURE", "JointEvidence", "evidence"]

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

#: A joint moves when its travel and its speed exceed their noise by this factor.
MOVES = 10.0
#: Rows of sure direction of which anything can be said [-]: those of five periods of the cut-off.
FEWEST_SURE = 20


@dataclass(frozen=True)
class JointEvidence:
    """One joint in all recordings.

    Attributes:
        name: of the joint.
        moves: whether it moves beyond the noise of its position.
        both_ways: whether it moves in both directions in what is fitted.
        rows_fitted: independent samples that are fitted.
        sure_fitted, sure_held_out: samples in which the joint surely moves in one direction.
        validated: whether recordings of their own are held out.
        recorded: rms of the torque that was recorded [`unit`].
        needed: rms of what the nominal robot needs for the motion, without effects [`unit`].
        noise: rms that the torque's noise leaves after the filter [`unit`].
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
    """What the recordings show of each moving joint.

    Args:
        robot: the nominal robot.
        recordings: those that are fitted first.
        dynamics: along each.
        fitted: number of them; without others, a part of these is held out.
    """
    own, others = dynamics[:fitted], dynamics[fitted:]
    moves = [_moves(one, along.motion) for one, along in zip(recordings, dynamics)]
    sure = [_sure(along.motion) & there for along, there in zip(dynamics, moves)]
    held = [np.zeros(len(rows), dtype=bool) for rows in sure[:fitted]]
    if not others:
        held = [_held_out(along.motion) for along in own]
    held += [np.ones(len(rows), dtype=bool) for rows in sure[fitted:]]
    levels = [_levels(along) for along in own]
    recorded, needed, noise = (np.sqrt(np.mean(np.square(part), axis=0)) for part in zip(*levels))
    found = []
    for k, joint in enumerate(robot.moving_joints):
        found.append(
            JointEvidence(
                name=joint.name,
                moves=any(there[k] for there in moves[:fitted]),
                both_ways=len(set().union(*(_directions(along.motion, k) for along in own))) > 1,
                rows_fitted=sum(int(np.count_nonzero(~out)) for out in held[:fitted]),
                sure_fitted=sum(int(rows[~out, k].sum()) for rows, out in zip(sure[:fitted], held)),
                sure_held_out=sum(int(rows[out, k].sum()) for rows, out in zip(sure, held)),
                validated=bool(others),
                recorded=float(recorded[k]),
                needed=float(needed[k]),
                noise=float(noise[k]),
                described=any(use.at.split(".")[0] == joint.name for use in robot.effects),
                unit=unit_of(f"{joint.name}.torque", prismatic=joint.kind == "prismatic"),
            )
        )
    return tuple(found)


def _held_out(motion: Motion) -> Flags:
    """Which rows of a recording are held out where there are no validation recordings, shape (R,)."""
    time = motion.reduced_time
    windows = held_out_windows(time)
    return np.any([(time >= first) & (time <= last) for first, last in windows], axis=0)


def _sure(motion: Motion) -> Flags:
    """Rows in which each joint surely moves in one direction, (R, n): it stands still nowhere near them.

    Near is what the smoother of the motion remembers: half a period of its cut-off.
    """
    speed, memory = np.abs(motion.velocity), 0.5 / motion.motion_cutoff
    still = speed <= np.maximum(NEAR * motion.velocity_noise, SLOWEST * speed.max(axis=0))
    near = maximum_filter1d(still, 2 * int(memory * motion.low_pass.rate) + 1, axis=0)
    return np.asarray(~near[motion.kept])


def _moves(recording: Recording, motion: Motion) -> Flags:
    """Which joints move beyond the noise of their positions, and beyond their steps, shape (n,)."""
    travel, speed = np.ptp(motion.position, axis=0), np.abs(motion.velocity).max(axis=0)
    clear = (travel > MOVES * motion.position_noise) & (speed > MOVES * motion.velocity_noise)
    channels = (recording.channels.get(name) for name in motion.position_channels)
    return clear & np.array([values is None or not rests_on_levels(values) for values in channels])


def _directions(motion: Motion, index: int) -> set[float]:
    """Signs of the velocities that are more than a standstill."""
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
