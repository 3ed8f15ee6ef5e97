"""Whether the nominal robot, simulated by itself, does what was recorded: every channel, down to the noise.

A robot file that holds controller and reference motion foretells a whole recording, with nothing taken from
it. Where every recorded channel then differs from the simulation by no more than its sensor's noise, nothing
is missing that these data could show, whatever a regression along a smoothed motion makes of the noise.

The difference of a channel, in units of its noise, is white with variance one if nothing is missing. So its
discrete cosine transform holds independent standard normal numbers, and the energy in each octave of
frequency is chi-square distributed, with as many degrees of freedom as numbers. That is compared with the
stated noise and, where a sensor is better than stated, with the upper half of the spectrum (F distribution;
Scheffe, The Analysis of Variance (1959), ch. 2). The smallest of all these chances decides, times the number
of them (Bonferroni). A small effect puts its energy into a few octaves, where it stands out. A run that fails
proves nothing: start, disturbance or reference may have been others than the robot file's.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy import stats
from scipy.fft import dct

from missing_physics.diagnosis.replay.replay import Replay
from missing_physics.diagnosis.replay.sensor_errors import as_measured, difference, known_noise, measured
from missing_physics.recordings import sensor_of, sensors_of
from robot_model import InputError, NoController, Recording, Robot

__all__ = ["CHANCE", "Reproduction", "chance_of", "octave_chances", "reproduction"]

Array = NDArray[np.float64]

#: A recording counts as reproduced unless noise alone would differ so much less often than this. Failing is
#: cheap, the usual diagnosis then follows, so that it is far stricter than a finding is.
CHANCE = 0.1
#: Fewest samples with octaves worth the name.
FEWEST_SAMPLES = 128
#: Instants and references may differ by this part of a sample time, or of their largest value.
SAME = 1e-6
#: A sensor is not taken to be better than this part of what is stated: below it rounding is no noise.
BEST_SENSOR = 0.1


@dataclass(frozen=True)
class Reproduction:
    """How well the nominal robot's own run does what was recorded.

    Attributes:
        channels: that were compared.
        chance: that noise alone differs so much from the run, corrected for the number of comparisons.
    """

    channels: tuple[str, ...]
    chance: float

    @property
    def complete(self) -> bool:
        """Whether nothing beyond noise is left."""
        return self.chance >= CHANCE

    @property
    def words(self) -> str:
        """One sentence."""
        return (
            f"The nominal robot's own run, with nothing taken from the recording, gives every one of the "
            f"{len(self.channels)} recorded channels to within the sensors' noise (chance of a larger "
            f"difference by noise alone {self.chance:.2g}), so no effect was looked for."
        )


def reproduction(robot: Robot, recordings: Sequence[Recording]) -> Reproduction | None:
    """Compare recordings with the robot's simulation of its own reference motion, or of theirs.

    Returns:
        None where that is not possible: no controller in the robot file; neither the robot file's reference
        nor one that can be replayed in a recording; instants that are no samples of it; a channel that a
        simulation does not give or whose noise is not stated; missing samples.
    """
    if isinstance(robot.controller, NoController) or not recordings:
        return None
    if not all(_comparable(robot, recording) for recording in recordings):
        return None
    every: list[Array] = []
    own: Recording | None = None
    for recording in recordings:
        rows = None
        sensors = {sensor.channel: sensor for sensor in sensors_of(robot, recording)}
        if robot.reference is not None:
            try:
                own = own or as_measured(robot)
            except InputError:
                return None
            rows = _rows(recording, own)
        if own is not None and rows is not None and _same_reference(robot, recording, own, rows):
            errors = {c: difference(sensors[c], recording[c], own[c][rows]) for c in measured(recording)}
        elif (replay := Replay.of(robot, [recording])) is not None:
            if (found := replay.errors(robot, 0)) is None or set(found) != set(measured(recording)):
                return None
            errors = found
        else:
            return None
        every += errors.values()
    channels = tuple(sorted({name for recording in recordings for name in measured(recording)}))
    return Reproduction(channels, chance_of(every))


def chance_of(errors: Iterable[Array]) -> float:
    """That noise alone differs so much, corrected for the number of comparisons.

    Args:
        errors: in units of the stated noise, shape (N,) each.
    """
    chances = [chance for error in errors for chance in octave_chances(error)]
    return min(1.0, min(chances) * len(chances))


def octave_chances(difference: Array) -> list[float]:
    """Chance of each octave's energy if the difference is white and of variance one; or of less variance.

    Args:
        difference: in units of the stated noise, shape (N,).
    """
    energy = dct(difference, norm="ortho") ** 2
    half = energy.size // 2
    level = max(float(energy[half:].mean()), BEST_SENSOR**2)
    edges = [0, *(2**k for k in range(energy.size.bit_length()) if 2**k < half), half]
    found = [float(stats.chi2.sf(energy[half:].sum(), energy.size - half))]
    for first, last in pairwise(edges):
        total, count = float(energy[first:last].sum()), last - first
        found.append(float(stats.chi2.sf(total, count)))
        if level < 1.0:
            found.append(float(stats.f.sf(total / count / level, count, energy.size - half)))
    return found


def _comparable(robot: Robot, recording: Recording) -> bool:
    """Whether positions and torques are there, and the noise of every channel is known."""
    needed = [f"{joint.name}.position" for joint in robot.moving_joints]
    for joint in robot.moving_joints:
        if joint.actuator is not None:
            needed += [f"{joint.name}.torque", f"{joint.name}.reference_position"]
    if len(recording) < FEWEST_SAMPLES or any(name not in recording for name in needed):
        return False
    for name in measured(recording):
        sensor = sensor_of(robot, recording, name)
        if sensor is None or not known_noise(sensor):
            return False
    return all(bool(np.isfinite(recording[name]).all()) for name in recording)


def _rows(recording: Recording, run: Recording) -> NDArray[np.int_] | None:
    """Which samples of the run were recorded; None when the instants are others."""
    step = run.time[1] - run.time[0]
    rows = np.round((recording.time - run.time[0]) / step).astype(int)
    if rows[0] < 0 or rows[-1] >= len(run):
        return None
    return rows if np.abs(recording.time - run.time[rows]).max() <= SAME * step else None


def _same_reference(robot: Robot, recording: Recording, run: Recording, rows: NDArray[np.int_]) -> bool:
    names = [f"{joint.name}.reference_position" for joint in robot.moving_joints]
    return all(
        np.abs(recording[name] - run[name][rows]).max() <= SAME * max(float(np.ptp(run[name])), SAME)
        for name in names
        if name in recording
    )
