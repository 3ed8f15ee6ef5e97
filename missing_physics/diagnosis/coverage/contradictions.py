"""Channels that contradict the robot's dynamics, reported before any physics is blamed.

Torques are weighed in `coverage/torque_channels.py`. Where they fail, another reason is weighed as well: a
position that was recorded wrongly, which changes what every joint needs. A gyro on a free base of rigid
links is held against how the joints' motion turns the base. What the channels say of each other without a
robot is a matter of `recordings`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from missing_physics.checks.actuation import actuator_torque
from missing_physics.diagnosis.coverage.evidence import FEWEST_SURE
from missing_physics.diagnosis.coverage.joints import FEWEST_ROWS
from missing_physics.diagnosis.coverage.needs import Needs
from missing_physics.diagnosis.coverage.torque_channels import (
    BELIEVED,
    DECISIVE,
    FAILS,
    HOLDS,
    NEAR,
    NEARER,
    believed,
    log_of,
    torque_findings,
)
from missing_physics.diagnosis.dynamics.inverse import MotionDynamics
from missing_physics.diagnosis.dynamics.recorded import make_dynamics
from missing_physics.evaluation.band import DENSE
from missing_physics.recordings import Correction, Finding, Mapping, corrected, percent, sentence_of
from missing_physics.recordings.channels.decimation import decimated
from missing_physics.standard.band import SLOWEST, WIDER, motion_band
from missing_physics.standard.rows import prismatic
from robot_model import InputError, Recording, Robot

__all__ = ["ContradictionError", "contradictions", "require_no_contradiction"]

Array = NDArray[np.float64]

#: Other motions are tried where a torque as it is named leaves this part, which few effects do.
SUSPICIOUS = 0.3
#: Another motion must explain all torques better than corrected torques do, by this in the logarithm of what
#: they leave.
BETTER = math.log(3.0)


class ContradictionError(InputError):
    """Channels contradict each other or the robot's dynamics.

    Attributes:
        recording: in which.
        findings: what was seen, one for each channel.
    """

    def __init__(
        self, recording: Recording, findings: Sequence[Finding], mapping: Mapping | None = None
    ) -> None:
        self.recording, self.findings = recording, tuple(findings)
        more = len(findings) - 1
        channels = ", ".join(dict.fromkeys(finding.channel for finding in findings[1:]))
        rest = f" (and {channels} alike)" if more else ""
        super().__init__(
            f"{recording.source or 'the recording'}: {sentence_of(findings[0], mapping).rstrip('.')}{rest}"
        )


def require_no_contradiction(
    robot: Robot,
    recordings: Sequence[Recording],
    along: Sequence[MotionDynamics],
    *,
    cutoff: float | None = None,
) -> None:
    """Raises `ContradictionError` for the first recording in which `contradictions` finds any.

    Args:
        robot: the nominal robot.
        recordings: as read.
        along: its dynamics along each.
        cutoff: with which they were made [Hz].
    """
    for recording, dynamics in zip(recordings, along):
        findings = contradictions(robot, recording, dynamics, cutoff=cutoff)
        if findings:
            raise ContradictionError(recording, findings)


def contradictions(
    robot: Robot, recording: Recording, dynamics: MotionDynamics, *, cutoff: float | None = None
) -> tuple[Finding, ...]:
    """What cannot be as it is named, whatever physics the robot file lacks.

    Args:
        robot: the nominal robot.
        recording: as read.
        dynamics: of the nominal robot along it.
        cutoff: with which it was made [Hz].
    """
    needs = Needs.of(dynamics)
    if len(needs.measured) < FEWEST_ROWS:
        return ()  # hardly more than there are numbers to weigh them by
    channels = [actuator_torque(robot, recording, joint.name)[0] for joint in robot.moving_joints]
    torques = torque_findings(robot, needs, channels)
    moved = _moved(robot, dynamics)
    suspicious = [k for k in needs.known if moved[k] and believed(needs, k) > SUSPICIOUS]

    motion = dynamics.motion
    thinned, band = recording, cutoff
    if cutoff is None and suspicious:
        band = min(motion.low_pass.cutoff, motion_band(robot, recording))
        thinned = decimated(recording, int(motion.low_pass.rate / (DENSE * WIDER * band)))

    def again(corrections: Sequence[Correction]) -> Needs:
        return Needs.of(make_dynamics(robot, [corrected(thinned, corrections)], cutoff=band)[0])

    if band != cutoff:  # as it is, by the same samples in the same band
        needs = again(())
        suspicious = [k for k in suspicious if believed(needs, k) > SUSPICIOUS]

    if suspicious and not _settled(robot, needs, torques):
        wrong = _motion(robot, motion.position_channels, again, needs, torques, suspicious)
        if wrong is not None:
            return (wrong,)
    return tuple(_runaways(robot, dynamics)) or (*torques, *_gyro(dynamics))


def _moved(robot: Robot, dynamics: MotionDynamics) -> NDArray[np.bool_]:
    """Which moving joints are not held, shape (n,); revolute and prismatic ones each among themselves.

    How the position of a joint that is held was recorded is hardly seen in any torque.
    """
    top = np.abs(dynamics.motion.velocity).max(axis=0)
    kinds = prismatic(robot)
    fastest = np.array([top[kinds == kind].max() for kind in kinds])
    return np.asarray(top >= SLOWEST * fastest)


def _runaways(robot: Robot, dynamics: MotionDynamics) -> Iterator[Finding]:
    """Joints that were out of control: a torque at its limit against the motion is right then.

    They were faster than their limit by more than gains may make, and so for as long as is needed to judge a
    joint: a stray position is another matter.
    """
    motion = dynamics.motion
    for k, joint in enumerate(robot.moving_joints):
        if joint.velocity_limit is None:
            continue
        speed = np.sort(np.abs(motion.velocity[motion.kept, k]))
        top = float(speed[-FEWEST_SURE])
        if top > BELIEVED[1] * joint.velocity_limit:
            channel = motion.position_channels[k]
            unit = "m/s" if joint.kind == "prismatic" else "rad/s"
            yield Finding(
                "error",
                "runaway",
                channel,
                f"{joint.name} moves with {top:.3g} {unit}, {top / joint.velocity_limit:.2g} times its "
                f"velocity_limit of {joint.velocity_limit:g} in the robot file: {channel} has another unit, "
                "or the limit is wrong, or the robot was out of control (cut that off with a window in "
                "a mapping file)",
                {"speed": top, "limit": joint.velocity_limit},
            )


def _settled(robot: Robot, needs: Needs, torques: Sequence[Finding]) -> bool:
    """Whether corrected torques leave next to nothing, and no factor of theirs could be that of degrees."""
    near = (
        abs(math.log(math.radians(abs(correction.scale)))) < math.log(2.0)
        for f in torques
        for correction in f.corrections
    )
    return not any(near) and all(left < FAILS for left in _left_of_torques(robot, needs, torques))


@dataclass(frozen=True)
class _Trial:
    """One way to correct the motion: the channels, and what they are."""

    corrections: tuple[Correction, ...]
    words: str


def _motion(
    robot: Robot,
    channels: Sequence[str],
    again: Callable[[Sequence[Correction]], Needs],
    needs: Needs,
    torques: Sequence[Finding],
    suspicious: Sequence[int],
) -> Finding | None:
    """A motion recorded otherwise than named that makes the torques right, each of which fails as it is."""
    best, best_cost = None, sum(map(log_of, _left_of_torques(robot, needs, torques))) - BETTER
    for trial in _trials(robot, channels, suspicious):
        moved = again(trial.corrections)
        left = {k: moved.left(k, NEAR) for k in suspicious}
        failed = any(part > HOLDS or part * DECISIVE > believed(needs, k) for k, part in left.items())
        if failed or any(believed(moved, k) > SUSPICIOUS for k in needs.known):
            continue
        cost = sum(log_of(moved.left(k, NEARER)) for k in needs.known)
        if cost < best_cost:
            best, best_cost = (trial, left), cost
    if best is None:
        return None
    trial, left = best
    worst = max(suspicious, key=lambda k: believed(needs, k))
    name = robot.moving_joints[worst].name
    return Finding(
        "error",
        "motion",
        trial.corrections[0].channel,
        f"{trial.words}: as it is, {percent(min(believed(needs, worst), 1.0))} of the torque of "
        f"{name} stays unexplained whatever friction, gain or payload there is, and corrected "
        f"{percent(left[worst])}",
        {"left": left[worst]},
        trial.corrections,
    )


def _left_of_torques(robot: Robot, needs: Needs, torques: Sequence[Finding]) -> Iterator[float]:
    """What each known torque leaves, corrected where it can be."""
    corrections = {
        correction.channel.split(".")[0]: correction
        for finding in torques
        for correction in finding.corrections
    }
    names = [joint.name for joint in robot.moving_joints]
    for k in needs.known:
        correction = corrections.get(names[k])
        if correction is None:
            yield believed(needs, k)
            continue
        factor = abs(correction.scale)
        limits = NEARER[0] / factor, NEARER[1] / factor
        other = names.index(correction.origin.split(".")[0])
        yield needs.left(k, limits, of=other, sign=math.copysign(1.0, correction.scale))


def _trials(robot: Robot, channels: Sequence[str], suspicious: Sequence[int]) -> Iterator[_Trial]:
    joints, degree = robot.moving_joints, math.radians(1.0)
    turning = [c for c, joint in zip(channels, joints) if joint.kind == "revolute"]
    if len(turning) > 1:
        yield _Trial(tuple(Correction(c, scale=degree) for c in turning), f"{_and(turning)} are in degrees")
    for k in suspicious:
        if joints[k].kind == "revolute":
            yield _Trial((Correction(channels[k], scale=degree),), f"{channels[k]} is in degrees")
        else:
            yield _Trial((Correction(channels[k], scale=1e-3),), f"{channels[k]} is in mm")
        yield _Trial((Correction(channels[k], scale=-1.0),), f"{channels[k]} counts the other way round")
    for a, b in combinations(suspicious, 2):
        one, other = channels[a], channels[b]
        corrections = Correction(one, source=other), Correction(other, source=one)
        yield _Trial(corrections, f"{one} and {other} are exchanged")


def _and(names: Sequence[str]) -> str:
    return f"{', '.join(names[:-1])} and {names[-1]}"


def _gyro(dynamics: MotionDynamics) -> Iterator[Finding]:
    """Unit and signs of a gyro of three axes, against how the joints' motion turns the base."""
    if len(dynamics.further) < 3:
        return
    keep, others = dynamics.motion.low_pass.reduce, dynamics.motion.others
    read = keep(np.column_stack([others[channel] for channel in dynamics.further]))
    turn = keep(dynamics.base_rates)
    read, turn = read - read.mean(axis=0), turn - turn.mean(axis=0)
    native = _gain_left(turn, read, BELIEVED)
    power = (turn**2).sum(axis=0)
    if not power.any() or native * 0.999 < HOLDS:
        return
    active = 4.0 * power > HOLDS * power.sum()  # what is left with an axis reversed
    trials = []
    for unit, words in ((1.0, ""), (math.radians(1.0), "is in degrees per second")):
        for signs in _signs(active):
            if unit != 1.0 or (signs < 0).any():
                trials.append((_gain_left(turn, unit * signs * read, NEAR), unit, signs, words))
    left, unit, signs, words = min(trials, key=lambda trial: trial[0])
    if left > HOLDS or left * DECISIVE > native:
        return
    turned = [c for c, sign in zip(dynamics.further, signs) if sign < 0]
    against = f"{', '.join(turned)} run{'s' if len(turned) == 1 else ''} against the motion" if turned else ""
    unit_words = f"base.angular_velocity {words}" if words else ""
    yield Finding(
        "error",
        "gyro",
        turned[0] if turned else dynamics.further[0],
        f"{' and '.join(part for part in (unit_words, against) if part)}: the joints' motion turns the base "
        f"otherwise; {percent(min(native, 1.0))} of what was read disagrees, corrected {percent(left)}",
        {"left": left},
        tuple(
            Correction(channel, scale=unit * sign)
            for channel, sign in zip(dynamics.further, signs)
            if unit * sign != 1.0
        ),
    )


def _signs(active: NDArray[np.bool_]) -> Iterator[Array]:
    """All signs of the axes that turn; those that do not go with the majority."""
    for pattern in range(2 ** int(active.sum())):
        signs = np.ones(active.size)
        signs[active] = [-1.0 if pattern >> bit & 1 else 1.0 for bit in range(int(active.sum()))]
        if (signs[active] < 0).all():
            signs[:] = -1.0
        yield signs


def _gain_left(turn: Array, read: Array, gains: tuple[float, float]) -> float:
    """Part of what was read that the best gain times `turn` leaves."""
    gain = float(np.clip((turn * read).sum() / (turn * turn).sum(), *gains))
    return float(((read - gain * turn) ** 2).sum() / max(float((read**2).sum()), 1e-300))
