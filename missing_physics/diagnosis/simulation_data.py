"""What a refit in simulation is given: recordings with the controller in force, split in three.

Numbers are fitted to one part, the second decides what is kept, the third is looked at once, at the end.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import cumulative_trapezoid
from scipy.optimize import minimize_scalar

from missing_physics.diagnosis.free_runs import Trial
from missing_physics.diagnosis.motion import Motion
from missing_physics.diagnosis.rollout import LONGEST_STEP, Runner
from missing_physics.diagnosis.rollout_model import LoopModel, Row
from reference_model.batched import Batched
from robot_model import InputError, Recording, Robot, VoltageServo

__all__ = ["Parts", "obstacle", "parts_of", "trial_of"]

Array = NDArray[np.float64]

#: Torque that the robot's controller does not explain, as a part of the recorded one, beyond which another
#: controller was in force.
NOT_IN_FORCE = 0.5
#: A servo's gain may differ from the robot file's by this factor both ways: firmwares let users set it.
GAIN_FACTOR = 16.0
#: A gain that differs by more than this is told.
TOLD = 0.05
#: Recordings are cut so that no role gets a stretch shorter than this [s].
SHORTEST = 1.0
#: Parts of a recording when no validation recording was given: two fitted, one decides, one is scored.
QUARTERS = 4


@dataclass(frozen=True)
class Parts:
    """Recordings by role.

    Attributes:
        fit, decide, score: disjoint.
        words: which is which.
    """

    fit: tuple[Trial, ...]
    decide: tuple[Trial, ...]
    score: tuple[Trial, ...]
    words: str


def obstacle(robot: Robot, recordings: Sequence[Recording]) -> str:
    """Why free runs along these recordings are impossible; empty when they are possible."""
    if robot.controller is None:
        return "the robot file names no controller"
    if robot.base.kind == "free":
        return "the base floats, and free runs are made for fixed bases"
    if robot.flexible_links or robot.spherical_joints:
        return "free runs are made for rigid links and joints of one coordinate"
    for recording in recordings:
        for joint in robot.moving_joints:
            needed = ["position"] + (["reference_position"] if joint.actuator else [])
            for quantity in needed:
                if f"{joint.name}.{quantity}" not in recording:
                    return f"{recording.source or 'a recording'} has no {joint.name}.{quantity}"
        if recording.duration < QUARTERS * SHORTEST:
            return f"{recording.source or 'a recording'} is shorter than {QUARTERS * SHORTEST:g} s"
    return ""


def trial_of(robot: Robot, recording: Recording, motion: Motion) -> tuple[Trial, str]:
    """A recording with the controller that was in force, and a sentence where that is not the robot's.

    The gain of a voltage servo is found from the voltage that was recorded; every other controller must
    explain the recorded torque as it is.

    Raises:
        InputError: another controller was in force.
    """
    servo = robot.controller
    if isinstance(servo, VoltageServo):
        factors = [_gain_factor(servo, k, recording, j.name) for k, j in enumerate(robot.moving_joints)]
        gains = np.broadcast_to(np.asarray(servo.gain, float), len(factors)) * np.array(factors)
        servo = servo.model_copy(update={"gain": tuple(map(float, gains))})
        told = [
            f"{recording.source or 'a recording'}: the voltage of {joint.name} is that of a gain of "
            f"{gain:.3g} per rad"
            for joint, gain, factor in zip(robot.moving_joints, gains, factors)
            if abs(factor - 1) > TOLD
        ]
    else:
        told = []
    trial = Trial(recording, servo)
    unexplained = _unexplained(robot, trial, motion)
    if unexplained > NOT_IN_FORCE:
        raise InputError(
            f"the torques in {recording.source or 'a recording'} are not what the robot's controller "
            f"commands along its motion (they differ by {unexplained:.0%})"
        )
    return trial, "; ".join(told)


def _gain_factor(servo: VoltageServo, k: int, recording: Recording, joint: str) -> float:
    """By what the gain must be multiplied to give the recorded voltage; 1 where none was recorded."""
    channel = f"{joint}.voltage"
    if channel not in recording:
        return 1.0
    gain = float(np.broadcast_to(np.asarray(servo.gain, float), k + 1)[k])
    error = recording[f"{joint}.reference_position"] - recording[f"{joint}.position"]
    known = np.isfinite(error) & np.isfinite(recording[channel])
    if not known.any():
        return 1.0

    def misfit(logarithm: float) -> float:
        duty = np.clip(np.exp(logarithm) * gain * error[known], -1, 1)
        return float(np.abs(recording[channel][known] - servo.supply * duty).sum())

    span = np.log(GAIN_FACTOR)
    tried = np.linspace(-span, span, 41)
    best = tried[int(np.argmin([misfit(x) for x in tried]))]
    step = tried[1] - tried[0]
    found = minimize_scalar(misfit, bounds=(best - step, best + step), method="bounded")
    return float(np.exp(found.x))


def _unexplained(robot: Robot, trial: Trial, motion: Motion) -> float:
    """Largest part of a joint's torque that the controller does not explain; 0 where no torque is known."""
    changed = robot.model_copy(update={"controller": trial.controller})
    runner = Runner(changed, trial.recording)
    inside = (runner.time >= motion.time[0]) & (runner.time <= motion.time[-1])
    time, rows = runner.time[inside], runner.rows[inside]
    q, v, torque = (
        np.column_stack([np.interp(time, motion.time, column) for column in series.T])
        for series in (motion.position, motion.velocity, motion.torque)
    )
    ends = Row.ends(q.shape[1])
    integral = cumulative_trapezoid(rows[:, ends[1] : ends[2]] - q, time, axis=0, initial=0.0)
    said = Batched(LoopModel(changed).commanded())(q, v, integral, rows, runner.constants())[0]
    worst = 0.0
    for k in range(q.shape[1]):
        known = np.isfinite(torque[:, k])
        level = float(np.sqrt(np.mean(torque[known, k] ** 2))) if known.any() else 0.0
        if level > 0:
            gap = said[known, k] - torque[known, k]
            worst = max(worst, float(np.sqrt(np.mean(gap**2))) / level)
    return worst


def parts_of(fitted: Sequence[Trial], validation: Sequence[Trial]) -> Parts:
    """Split by role; validation recordings are never fitted."""
    fitted, validation = [_thinned(t) for t in fitted], [_thinned(t) for t in validation]
    if len(validation) > 1:
        decide, score = validation[::2], validation[1::2]
        words = (
            f"{_sources(decide)} decided what is kept of the refit in simulation, "
            f"{_sources(score)} had no part in it and give the positions' validation error"
        )
        return Parts(tuple(fitted), tuple(decide), tuple(score), words)
    if validation:
        halves = [_window(validation[0], part / 2, (part + 1) / 2) for part in (0, 1)]
        words = (
            "the first half of the validation recording decided what is kept of the refit in simulation, "
            "the second had no part in it and gives the positions' validation error"
        )
        return Parts(tuple(fitted), (halves[0],), (halves[1],), words)
    roles: tuple[list[Trial], list[Trial], list[Trial]] = ([], [], [])
    for number, trial in enumerate(fitted):
        deciding, scored = (number + 2) % QUARTERS, (number + 3) % QUARTERS
        for first, last, role in _runs(deciding, scored):
            roles[role].append(_window(trial, first / QUARTERS, last / QUARTERS))
    words = (
        "of the recordings two quarters were fitted in simulation, one decided what is kept, and one had no "
        "part in it and gives the positions' validation error"
    )
    return Parts(tuple(roles[0]), tuple(roles[1]), tuple(roles[2]), words)


def _runs(deciding: int, scored: int) -> list[tuple[int, int, int]]:
    """(first, last, role) of stretches of quarters; neighbouring quarters of one role stay together."""
    roles = [{deciding: 1, scored: 2}.get(quarter, 0) for quarter in range(QUARTERS)]
    found: list[tuple[int, int, int]] = []
    for quarter, role in enumerate(roles):
        if found and found[-1][2] == role:
            found[-1] = (found[-1][0], quarter + 1, role)
        else:
            found.append((quarter, quarter + 1, role))
    return found


def _window(trial: Trial, first: float, last: float) -> Trial:
    """A part of a recording's time."""
    recording = trial.recording
    start, span = float(recording.time[0]), recording.duration
    return replace(trial, recording=recording.window(start + first * span, start + last * span))


def _thinned(trial: Trial) -> Trial:
    """Not many more samples than the integration has steps."""
    recording = trial.recording
    stride = max(1, int(LONGEST_STEP * recording.sample_rate + 1e-6))
    kept = {name: values[::stride] for name, values in recording.channels.items()}
    return replace(trial, recording=replace(recording, time=recording.time[::stride], channels=kept))


def _sources(trials: Sequence[Trial]) -> str:
    return ", ".join(trial.recording.source or "a recording" for trial in trials)
