"""Step 1 of the chain: what the data can carry at all, said before anything is fitted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from missing_physics.diagnosis.problem import Segment
from robot_model import InputError, Recording, Robot

__all__ = ["FEWEST_ROWS", "Excitation", "judge_excitation", "require_same_torques"]

#: Fewest rows after decimation, and shortest time [periods of the cut-off].
FEWEST_ROWS = 40
#: A joint moves when its speed exceeds its speed noise by this factor.
MOVES = 10.0
#: Reversals needed to tell friction from an offset.
FEWEST_REVERSALS = 1


@dataclass(frozen=True)
class Excitation:
    """Whether any statement is possible, and sentences on what is not."""

    enough: bool
    sentences: tuple[str, ...]


def require_same_torques(robot: Robot, recordings: Sequence[Recording], segments: Sequence[Segment]) -> None:
    """Raises `InputError` where a joint's torque is known in a part of the recordings only."""
    for index, joint in enumerate(robot.moving_joints):
        known = [bool(segment.usable[index]) for segment in segments]
        if any(known) and not all(known):
            lacks, has = (recordings[known.index(there)].source for there in (False, True))
            raise InputError(
                f"{lacks or 'a recording'} has no torque of {joint.name}, nor current or voltage that give "
                f"it, but {has or 'another one'} has; add the channel there, or leave the recording out."
            )


def judge_excitation(robot: Robot, segments: Sequence[Segment]) -> Excitation:
    """Look at length, torque, travel and directions of every joint."""
    sentences: list[str] = []
    rows = sum(s.time.size for s in segments)
    if rows < FEWEST_ROWS:
        cutoff = segments[0].motion.low_pass.cutoff
        return Excitation(
            False,
            (
                f"only {rows} independent samples are left below the cut-off of {cutoff:.3g} Hz; "
                f"record at least {2 * FEWEST_ROWS / (4 * cutoff):.2g} s more.",
            ),
        )
    possible = False
    for index, joint in enumerate(robot.moving_joints):
        known = all(s.usable[index] for s in segments)
        moves = any(_moves(s, index) for s in segments)
        if not known:
            sentences.append(
                f"{joint.name}: its actuator torque is neither recorded nor computable from current or "
                "voltage, so nothing at this joint could be judged."
            )
        elif not moves:
            sentences.append(
                f"{joint.name} does not move beyond its noise, so nothing that depends on motion could be "
                "told there."
            )
        else:
            possible = True
            sentences += _directions(joint.name, segments, index)
    return Excitation(possible, tuple(sentences))


def _moves(segment: Segment, index: int) -> bool:
    motion = segment.motion
    travel = float(np.ptp(motion.position[:, index]))
    speed = float(np.abs(motion.velocity[:, index]).max())
    noise = float(motion.position_noise[index]), float(motion.velocity_noise[index])
    return travel > MOVES * noise[0] and speed > MOVES * noise[1]


def _directions(name: str, segments: Sequence[Segment], index: int) -> list[str]:
    reversals = 0
    for segment in segments:
        velocity = segment.velocity[:, index]
        moving = velocity[np.abs(velocity) > 0.02 * np.abs(velocity).max()]
        reversals += int(np.count_nonzero(np.diff(np.sign(moving))))
    if reversals < FEWEST_REVERSALS:
        return [
            f"{name} moves in one direction only, so friction and a torque offset could not be told "
            "apart there."
        ]
    return []
