"""Channels that contradict the robot's dynamics, reported before missing physics is considered.

Torques are tested in `coverage/torque_channels.py`. If some fail, wrongly recorded positions are tested as an
alternative; these change the torque that every joint needs. A gyro on a free base of rigid links is compared
with the rotation of the base due to the joints' motion. Contradictions between channels that need no robot
are found in `recordings`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from missing_physics.checks.actuation import actuator_torque
from missing_physics.coverage.evidence import FEWEST_SURE
from missing_physics.coverage.joints import FEWEST_ROWS
from missing_physics.coverage.needs import Needs
from missing_physics.coverage.torque_channels import (
    DECISIVE,
    FAILS,
    HOLDS,
    NEAR,
    NEARER,
    PLAUSIBLE,
    log_of,
    torque_findings,
    unexplained,
)
from missing_physics.evaluation.band import DENSE
from missing_physics.motion.inverse import MotionDynamics
from missing_physics.motion.recorded import make_dynamics
from missing_physics.recordings import Correction, Finding, Mapping, corrected, percent, sentence_of
from missing_physics.recordings.channels.decimation import decimated
from missing_physics.standard.band import SLOWEST, WIDER, motion_band
from missing_physics.standard.rows import prismatic
from robot_model import InputError, Recording, Robot

__all__ = ["ContradictionError", "contradictions", "require_no_contradiction"]

Array = NDArray[np.float64]

#: Corrected positions are tested if the unexplained fraction of a torque exceeds this, which is rare.
SUSPICIOUS = 0.3
#: Corrected positions must explain all torques better than corrected torques do, by this difference in the
#: logarithm of the unexplained fraction.
BETTER = math.log(3.0)


class ContradictionError(InputError):
    """Channels contradict each other or the robot's dynamics.

    Attributes:
        recording: the recording.
        findings: one for each contradictory channel.
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
        along: its dynamics along each recording.
        cutoff: of the filter used for them [Hz].
    """
    for recording, dynamics in zip(recordings, along):
        findings = contradictions(robot, recording, dynamics, cutoff=cutoff)
        if findings:
            raise ContradictionError(recording, findings)


def contradictions(
    robot: Robot, recording: Recording, dynamics: MotionDynamics, *, cutoff: float | None = None
) -> tuple[Finding, ...]:
    """Channels that cannot be what their names state, whatever physics the robot file lacks.

    Args:
        robot: the nominal robot.
        recording: as read.
        dynamics: of the nominal robot along the recording.
        cutoff: of the filter used for it [Hz].
    """
    needs = Needs.of(dynamics)
    if len(needs.measured) < FEWEST_ROWS:
        return ()  # hardly more rows than parameters
    channels = [actuator_torque(robot, recording, joint.name)[0] for joint in robot.moving_joints]
    torques = torque_findings(robot, needs, channels)
    moved = _moved(robot, dynamics)
    suspicious = [k for k in needs.known if moved[k] and unexplained(needs, k) > SUSPICIOUS]

    motion = dynamics.motion
    thinned, band = recording, cutoff
    if cutoff is None and suspicious:
        band = min(motion.low_pass.cutoff, motion_band(robot, recording))
        thinned = decimated(recording, int(motion.low_pass.rate / (DENSE * WIDER * band)))

    def recomputed(corrections: Sequence[Correction]) -> Needs:
        return Needs.of(make_dynamics(robot, [corrected(thinned, corrections)], cutoff=band)[0])

    if band != cutoff:  # recompute the uncorrected case with the same samples in the same band
        needs = recomputed(())
        suspicious = [k for k in suspicious if unexplained(needs, k) > SUSPICIOUS]

    if suspicious and not _torques_are_settled(robot, needs, torques):
        wrong = _motion(robot, motion.position_channels, recomputed, needs, torques, suspicious)
        if wrong is not None:
            return (wrong,)
    return tuple(_runaways(robot, dynamics)) or (*torques, *_gyro(dynamics))


def _moved(robot: Robot, dynamics: MotionDynamics) -> NDArray[np.bool_]:
    """Mask of the moving joints that are not held, shape (n,), compared within each kind of joint.

    An error in the position of a held joint hardly affects any torque.
    """
    top = np.abs(dynamics.motion.velocity).max(axis=0)
    kinds = prismatic(robot)
    fastest = np.array([top[kinds == kind].max() for kind in kinds])
    return np.asarray(top >= SLOWEST * fastest)


def _runaways(robot: Robot, dynamics: MotionDynamics) -> Iterator[Finding]:
    """Joints that were out of control: a torque at its limit against the motion is then plausible.

    Their speed exceeds the limit by more than a wrong gain could explain, in more than a few samples.
    """
    motion = dynamics.motion
    for k, joint in enumerate(robot.moving_joints):
        if joint.velocity_limit is None:
            continue
        speed = np.sort(np.abs(motion.velocity[motion.kept, k]))
        top = float(speed[-FEWEST_SURE])
        if top > PLAUSIBLE[1] * joint.velocity_limit:
            channel = motion.position_channels[k]
            unit = "m/s" if joint.kind == "prismatic" else "rad/s"
            yield Finding(
                "error",
                "runaway",
                channel,
                f"{joint.name} moves with {top:.3g} {unit}, {top / joint.velocity_limit:.2g} times its "
                f"velocity_limit of {joint.velocity_limit:g} in the robot file: {channel} has another unit, "
                "or the limit is wrong, or the robot was out of control (exclude that part with a window in "
                "a mapping file)",
                {"speed": top, "limit": joint.velocity_limit},
            )


def _torques_are_settled(robot: Robot, needs: Needs, torques: Sequence[Finding]) -> bool:
    """Whether corrected torques are explained, and no correction factor is near that of degrees."""
    near = (
        abs(math.log(math.radians(abs(correction.scale)))) < math.log(2.0)
        for f in torques
        for correction in f.corrections
    )
    return not any(near) and all(left < FAILS for left in _unexplained_torques(robot, needs, torques))


@dataclass(frozen=True)
class _Trial:
    """One way to correct the motion: corrections of channels, and their description."""

    corrections: tuple[Correction, ...]
    words: str


def _motion(
    robot: Robot,
    channels: Sequence[str],
    recomputed: Callable[[Sequence[Correction]], Needs],
    needs: Needs,
    torques: Sequence[Finding],
    suspicious: Sequence[int],
) -> Finding | None:
    """The best correction of positions that explains all torques, if one is decisive."""
    best, best_cost = None, sum(map(log_of, _unexplained_torques(robot, needs, torques))) - BETTER
    for trial in _trials(robot, channels, suspicious):
        moved = recomputed(trial.corrections)
        left = {k: moved.left(k, NEAR) for k in suspicious}
        failed = any(part > HOLDS or part * DECISIVE > unexplained(needs, k) for k, part in left.items())
        if failed or any(unexplained(moved, k) > SUSPICIOUS for k in needs.known):
            continue
        cost = sum(log_of(moved.left(k, NEARER)) for k in needs.known)
        if cost < best_cost:
            best, best_cost = (trial, left), cost
    if best is None:
        return None
    trial, left = best
    worst = max(suspicious, key=lambda k: unexplained(needs, k))
    name = robot.moving_joints[worst].name
    return Finding(
        "error",
        "motion",
        trial.corrections[0].channel,
        f"{trial.words}: as it is, {percent(min(unexplained(needs, worst), 1.0))} of the torque of "
        f"{name} stays unexplained whatever friction, gain or payload there is, and corrected "
        f"{percent(left[worst])}",
        {"left": left[worst]},
        trial.corrections,
    )


def _unexplained_torques(robot: Robot, needs: Needs, torques: Sequence[Finding]) -> Iterator[float]:
    """Unexplained fraction of each known torque, corrected where possible."""
    corrections = {
        correction.channel.split(".")[0]: correction
        for finding in torques
        for correction in finding.corrections
    }
    names = [joint.name for joint in robot.moving_joints]
    for k in needs.known:
        correction = corrections.get(names[k])
        if correction is None:
            yield unexplained(needs, k)
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
    """Wrong unit or signs of a three-axis gyro, compared with the base rotation due to the joints' motion."""
    if len(dynamics.further) < 3:
        return
    keep, others = dynamics.motion.low_pass.reduce, dynamics.motion.others
    read = keep(np.column_stack([others[channel] for channel in dynamics.further]))
    turn = keep(dynamics.base_rates)
    read, turn = read - read.mean(axis=0), turn - turn.mean(axis=0)
    native = _unexplained_by_gain(turn, read, PLAUSIBLE)
    power = (turn**2).sum(axis=0)
    if not power.any() or native * 0.999 < HOLDS:
        return
    active = 4.0 * power > HOLDS * power.sum()  # residual energy with a reversed axis
    trials = []
    for unit, words in ((1.0, ""), (math.radians(1.0), "is in degrees per second")):
        for signs in _signs(active):
            if unit != 1.0 or (signs < 0).any():
                trials.append((_unexplained_by_gain(turn, unit * signs * read, NEAR), unit, signs, words))
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
    """All sign combinations of the active axes; the other axes are reversed only if all active ones are."""
    for pattern in range(2 ** int(active.sum())):
        signs = np.ones(active.size)
        signs[active] = [-1.0 if pattern >> bit & 1 else 1.0 for bit in range(int(active.sum()))]
        if (signs[active] < 0).all():
            signs[:] = -1.0
        yield signs


def _unexplained_by_gain(turn: Array, read: Array, gains: tuple[float, float]) -> float:
    """Fraction of the energy of `read` left by the best gain times `turn`."""
    gain = float(np.clip((turn * read).sum() / (turn * turn).sum(), *gains))
    return float(((read - gain * turn) ** 2).sum() / max(float((read**2).sum()), 1e-300))
