"""What a refit in simulation is given: recordings with the controller in force, and who has which role.

Numbers are fitted to one part, another decides what is kept, a third is looked at once, at the end.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import minimize_scalar

from missing_physics.diagnosis.free_run.in_force import NOT_IN_FORCE, not_commanded
from missing_physics.diagnosis.free_run.problem import Trial
from missing_physics.diagnosis.free_run.run import LONGEST_STEP
from missing_physics.diagnosis.motion.estimate import Motion
from missing_physics.recordings import percent
from reference_model.effects.base import GearEffect
from reference_model.effects.body_force import ForceEffect
from reference_model.effects.catalogue import get_effect
from reference_model.effects.structure import StructureEffect
from robot_model import InputError, NoController, Recording, Robot, VoltageServo

__all__ = ["Parts", "obstacle", "parts_of", "trial_of"]

#: A servo's gain may differ from the robot file's by this factor both ways: firmwares let users set it.
GAIN_FACTOR = 16.0
#: A gain that differs by more than this is told.
TOLD = 0.05
#: Shorter recordings are not cut in two [s].
SHORTEST = 4.0
#: With fewer fitted recordings than this each is cut in two; with more, whole ones are shared out.
FEWEST_WHOLE = 4


@dataclass(frozen=True)
class Parts:
    """Recordings by role.

    Attributes:
        fit: what the final numbers are fitted to.
        folds: pairs of what is fitted and what then decides; together they decide what is kept.
        score: what is looked at once, at the end; empty without validation recordings.
        words: which is which.
    """

    fit: tuple[Trial, ...]
    folds: tuple[tuple[tuple[Trial, ...], tuple[Trial, ...]], ...]
    score: tuple[Trial, ...]
    words: str


def obstacle(robot: Robot, recordings: Sequence[Recording]) -> str:
    """Why free runs along these recordings are impossible; empty when they are possible."""
    if isinstance(robot.controller, NoController):
        return "the robot file names no controller"
    if robot.base.kind == "free":
        return "the base floats, and free runs are made for fixed bases"
    if robot.flexible_links or robot.spherical_joints:
        return "free runs are made for rigid links and joints of one coordinate"
    geared = [use.at for use in robot.effects if isinstance(get_effect(use.effect), GearEffect)]
    if geared:
        return (
            f"the motor of {geared[0]} moves by itself, and free runs are made for stiff gears without play"
        )
    walls = [use for use in robot.effects if isinstance(get_effect(use.effect), ForceEffect)]
    bending = [use for use in robot.effects if isinstance(get_effect(use.effect), StructureEffect)]
    if walls and not bending:
        return f"{walls[0].effect} at {walls[0].at} pushes on a body, and free runs are made for joints alone"
    if bending:
        return f"{bending[0].effect} at {bending[0].at} has modes of its own, and free runs are made for none"
    for recording in recordings:
        for joint in robot.moving_joints:
            needed = ["position"] + (["reference_position"] if joint.actuator else [])
            for quantity in needed:
                if f"{joint.name}.{quantity}" not in recording:
                    return f"{_name(recording)} has no {joint.name}.{quantity}"
        if recording.duration < SHORTEST:
            return f"{_name(recording)} is shorter than {SHORTEST:g} s"
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
            f"the controller's gain in {_name(recording)} was found from the voltage of {joint.name}: "
            f"{gain:.3g} per rad"
            for joint, gain, factor in zip(robot.moving_joints, gains, factors)
            if abs(factor - 1) > TOLD
        ]
    else:
        told = []
    trial = Trial(recording, servo)
    changed = robot.model_copy(update={"controller": servo})
    unexplained = not_commanded(changed, recording, motion)
    if unexplained > NOT_IN_FORCE:
        raise InputError(
            f"the torques in {_name(recording)} are not what the robot's controller "
            f"commands along its motion, nor what sensors and drives make of it (they differ by "
            f"{percent(unexplained)})"
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


def parts_of(fitted: Sequence[Trial], validation: Sequence[Trial]) -> Parts:
    """Split by role; validation recordings are never fitted."""
    fit, others = [_thinned(t) for t in fitted], [_thinned(t) for t in validation]
    if not others:
        halves = _halves(fit, whole=len(fit) >= FEWEST_WHOLE)
        words = (
            "what is kept of the refit in simulation was decided by free runs of one half of the data with "
            "numbers fitted to the other, and the positions' validation errors are those of these runs: "
            "they took part in the choice; the final numbers are fitted to all"
        )
        return Parts(tuple(fit), ((halves[0], halves[1]), (halves[1], halves[0])), (), words)
    decide, score = _halves(others, whole=len(others) > 1)
    if len(others) > 1:
        words = (
            f"{_sources(decide)} decided what is kept of the refit in simulation, "
            f"{_sources(score)} had no part in it and give the positions' validation errors"
        )
    else:
        words = (
            "the first half of the validation recording decided what is kept of the refit in simulation, "
            "the second had no part in it and gives the positions' validation errors"
        )
    return Parts(tuple(fit), ((tuple(fit), decide),), score, words)


def _halves(trials: Sequence[Trial], *, whole: bool) -> tuple[tuple[Trial, ...], tuple[Trial, ...]]:
    """Whole recordings, or the two halves of each recording's time.

    Whose turn it is follows the sequence of Thue and Morse, so that both halves get alike shares of whatever
    changes steadily or alternates from recording to recording.
    """
    halves: tuple[list[Trial], list[Trial]] = ([], [])
    for number, trial in enumerate(trials):
        turn = number.bit_count() % 2
        if whole:
            halves[turn].append(trial)
            continue
        halves[turn].append(_window(trial, 0.0, 0.5))
        halves[1 - turn].append(_window(trial, 0.5, 1.0))
    return tuple(halves[0]), tuple(halves[1])


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
    return ", ".join(_name(trial.recording) for trial in trials)


def _name(recording: Recording) -> str:
    """The file's name without its folder."""
    return re.split(r"[/\\]", recording.source)[-1] or "a recording"
