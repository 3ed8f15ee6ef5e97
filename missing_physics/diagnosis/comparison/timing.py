"""Offsets between channels that are a matter of recording: estimated, reported, and no missing physics.

A command that is held acts half a sample later, a current is filtered, torque and position come over two
buses: within a sample or so torque and position rarely belong to the same instant.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import make_interp_spline
from scipy.stats import chi2

from missing_physics.checks.actuation import actuator_torque
from missing_physics.results.comparison import Timing
from missing_physics.results.result import Finding, Result
from missing_physics.standard import Offset, fit_standard, torque_offsets
from robot_model import InputError, Recording, Robot

__all__ = ["Aligned", "aligned", "with_timing"]

#: Standard deviation of offsets between buses, before a recording is seen [samples]. A recording that hardly
#: tells the offset (a standard deviation of tens of samples where torque changes slowly) leaves it there.
CUSTOMARY = 1.0
#: Samples up to which an offset is one of recording: half by a hold, and one by a bus.
LARGEST = 1.5
#: Samples below which an offset is not worth its undoing: torque changes too little within it. So much the
#: standard model may be off by at each joint, by reversals above all: of simulated arms 0.06 and 0.19.
SMALLEST = 0.1
#: Standard deviations by which an offset has to differ from nothing.
SURE = 3.0
#: Chance by which joints of one offset differ as much; below it they have offsets of their own.
CHANCE = 1e-3
#: Quantile of the 95 % interval.
QUANTILE = 1.96
#: Rounds in which an offset is estimated to first order and undone.
ROUNDS = 2


@dataclass(frozen=True)
class Aligned:
    """Recordings whose torque belongs to the same instants as the motion, as far as it is known.

    Attributes:
        recordings: with torques moved, or as they were.
        timing: what was estimated.
    """

    recordings: tuple[Recording, ...]
    timing: tuple[Timing, ...] = ()


def aligned(robot: Robot, recordings: Sequence[Recording], fitted: int, *, runs: bool = False) -> Aligned:
    """`recordings` with torques moved by their offsets, where these are small and common to all joints.

    Not where the robot can be run in closed loop: such runs hold the command as the machine does.

    Args:
        robot: as described.
        recordings: all of them, those that are fitted first.
        fitted: how many these are.
        runs: whether runs in closed loop are possible.
    """
    found = Aligned(tuple(recordings))
    if robot.flexible_links or not robot.moving_joints:
        return found
    for _ in range(ROUNDS):
        timing = _estimated(robot, found, recordings, fitted)
        if not timing or any(_surely_large(one) for one in timing):
            return Aligned(tuple(recordings))
        timing = tuple(replace(one, undone=not runs and _sure(one)) for one in timing)
        moved = (_moved(robot, r, one.offset) if one.undone else r for r, one in zip(recordings, timing))
        found = Aligned(tuple(moved), timing)
        if not any(one.undone for one in timing):
            break
    return found


def _estimated(
    robot: Robot, before: Aligned, recordings: Sequence[Recording], fitted: int
) -> tuple[Timing, ...]:
    """Offsets of `recordings`, by what is left of them in those moved `before`; none where joints differ."""
    try:
        standard = fit_standard(robot, before.recordings[:fitted])
        offsets = torque_offsets(standard, before.recordings)
    except InputError:
        return ()
    applied = [one.offset if one.undone else 0.0 for one in before.timing] or [0.0] * len(recordings)
    found = []
    for recording, own, done in zip(recordings, offsets, applied):
        common = _common(own, 1.0 / recording.sample_rate)
        if common is None:
            return ()
        found.append(_timing(recording, *_customary(done + common[0], common[1], recording.sample_rate)))
    return tuple(found)


def with_timing(result: Result, timing: Sequence[Timing], recordings: Sequence[Recording]) -> Result:
    """`result` with `timing`, to which small delays that all joints share are moved from its findings."""
    told = result.diagnosis
    groups = _shared_delays(told.findings, recordings)
    moved = {id(finding) for group in groups for finding in group}
    more = [_shared(group, recordings[0].sample_rate) for group in groups]
    kept = tuple(finding for finding in told.findings if id(finding) not in moved)
    return replace(result, diagnosis=replace(told, findings=kept, timing=(*timing, *more)))


def _shared(group: Sequence[Finding], rate: float) -> Timing:
    """Findings that are one delay."""
    delays = [_delay(finding) for finding in group]
    within = max(delay[1] for delay in delays), min(delay[2] for delay in delays)
    value = float(np.mean([delay[0] for delay in delays]))
    place, _, quantity = group[0].location.rpartition(".")
    joints = ", ".join(finding.location.split(".")[0] for finding in group)
    channel = f"{quantity if place else 'torque'} of {joints}"
    return Timing("", channel, value, within, value * rate, undone=False)


def _common(offsets: Sequence[Offset], step: float) -> tuple[float, float] | None:
    """The offset that all joints share and its standard deviation [s]; None where there is none.

    Args:
        offsets: of the joints.
        step: time from sample to sample [s].
    """
    if not offsets:
        return None
    delays = np.array([offset.delay for offset in offsets])
    spread = np.hypot([offset.deviation for offset in offsets], SMALLEST * step)
    weight = 1.0 / spread**2
    mean = float(weight @ delays / weight.sum())
    scatter = float(weight @ (delays - mean) ** 2)
    if len(offsets) > 1 and chi2.sf(scatter, len(offsets) - 1) < CHANCE:
        return None
    return mean, float(weight.sum() ** -0.5)


def _customary(delay: float, deviation: float, rate: float) -> tuple[float, float]:
    """A measured offset and its standard deviation [s] with what is known of offsets beforehand."""
    kept = 1.0 / (1.0 + (deviation * rate / CUSTOMARY) ** 2)
    return kept * delay, kept**0.5 * deviation


def _timing(recording: Recording, delay: float, deviation: float) -> Timing:
    half = QUANTILE * deviation
    samples = delay * recording.sample_rate
    return Timing(recording.source, "torque", delay, (delay - half, delay + half), samples, undone=False)


def _sure(timing: Timing) -> bool:
    """Whether an offset is surely there, and small enough to be one of recording."""
    low, high = timing.ci95
    deviation = (high - low) / (2.0 * QUANTILE)
    return SMALLEST < abs(timing.samples) <= LARGEST and abs(timing.offset) > SURE * deviation


def _surely_large(timing: Timing) -> bool:
    """Whether an offset is more than one of recording, its uncertainty counted."""
    low, high = (bound * timing.samples / timing.offset for bound in timing.ci95)
    return min(abs(low), abs(high)) > LARGEST and low * high > 0.0


def _moved(robot: Robot, recording: Recording, delay: float) -> Recording:
    """`recording` with its joints' torques, currents or voltages as they were `delay` later."""
    sources = {actuator_torque(robot, recording, joint.name)[0] for joint in robot.moving_joints}
    channels = {}
    for channel in sorted(source for source in sources if source):
        good = np.isfinite(recording[channel])
        time, values = recording.time[good], recording[channel][good]
        instants = np.clip(recording.time + delay, time[0], time[-1])
        moved = np.asarray(make_interp_spline(time, values, k=3)(instants))
        channels[channel] = np.where(good, moved, np.nan)
    return recording.with_channels(channels)


def _shared_delays(findings: Sequence[Finding], recordings: Sequence[Recording]) -> list[tuple[Finding, ...]]:
    """Groups of findings that are one small delay of all joints whose channel is recorded."""
    groups: dict[tuple[str, str], list[Finding]] = {}
    for finding in findings:
        if finding.effect in DELAYS:
            quantity = finding.location.rpartition(".")[2] if "." in finding.location else ""
            groups.setdefault((finding.effect, quantity), []).append(finding)
    step = 1.0 / recordings[0].sample_rate
    found = []
    for (_, quantity), group in groups.items():
        delays = [_delay(finding) for finding in group]
        same = max(d[1] for d in delays) <= min(d[2] for d in delays)
        if same and _all_joints(group, quantity, recordings) and all(d[0] < LARGEST * step for d in delays):
            found.append(tuple(group))
    return found


#: Effects that delay, and which number says by how much.
DELAYS = {"sensor_delay": "delay", "actuator_lag": "time_constant"}


def _delay(finding: Finding) -> tuple[float, float, float]:
    """Value and bounds [s]."""
    estimate = finding.parameters.get(DELAYS[finding.effect])
    return (np.inf, np.inf, np.inf) if estimate is None else (estimate.value, *estimate.ci95)


def _all_joints(group: Sequence[Finding], quantity: str, recordings: Sequence[Recording]) -> bool:
    """Whether every joint has the delay of which it could be told."""
    joints = {finding.location.split(".")[0] for finding in group}
    channels = {channel for channel in recordings[0] if channel.count(".") == 1}
    both = {c.split(".")[0] for c in channels if c.endswith(".motor_position")}
    has = {c.split(".")[0] for c in channels if c.endswith(f".{quantity or 'position'}")}
    return joints == (has & both if quantity == "position" and both else has)
