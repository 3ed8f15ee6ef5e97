"""Step 1 of the chain: what the data can support at all, decided before anything is fitted."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from missing_physics.answer.locate import FLOOR_TOLERANCE
from missing_physics.checks.actuation import is_passive, torque_lack
from missing_physics.coverage.evidence import FEWEST_SURE, JointEvidence, evidence
from missing_physics.inference.ledger import ODDS
from missing_physics.motion.inverse import MotionDynamics
from missing_physics.standard.band import SAMPLES_PER_PERIOD
from robot_model import InputError, Recording, Robot

__all__ = [
    "FEWEST_ROWS",
    "Coverage",
    "JointCoverage",
    "Reason",
    "coverage",
    "one_way_words",
    "reason_words",
    "require_same_torques",
]

#: Fewest rows after decimation: ten periods of the cut-off, enough to identify a body's ten parameters.
FEWEST_ROWS = 40


@dataclass(frozen=True)
class Reason:
    """Why a joint cannot be judged.

    Attributes:
        kind: ``no_torque``, ``dead``, ``no_motion``, ``little_motion``, ``rests_held_out`` or ``all_noise``.
        lack: what is missing, as a clause.
        left: what can still be judged, as a clause.
        remedy: what the user can do, in the imperative.
    """

    kind: str
    lack: str
    left: str = "nothing there can be judged"
    remedy: str = ""


@dataclass(frozen=True)
class JointCoverage:
    """Coverage of one joint.

    Attributes:
        name: of the joint.
        reason: why it cannot be judged; None if it can.
        one_way: whether it can be judged, but moves in one direction only.
        sure: number of fitted and of held-out samples in which the direction of motion is certain.
    """

    name: str
    reason: Reason | None
    one_way: bool = False
    sure: tuple[int, int] = (0, 0)


@dataclass(frozen=True)
class Coverage:
    """Coverage of the recordings.

    Attributes:
        joints: one for each moving joint.
        general: sentences on the recordings, such as on a part that is not used.
        enough: whether any statement is possible.
    """

    joints: tuple[JointCoverage, ...]
    general: tuple[str, ...] = ()
    enough: bool = True

    @property
    def not_judged(self) -> dict[Reason, tuple[str, ...]]:
        """The joints that cannot be judged, by reason."""
        found: dict[Reason, tuple[str, ...]] = {}
        for joint in self.joints:
            if joint.reason is not None:
                found[joint.reason] = (*found.get(joint.reason, ()), joint.name)
        return found

    @property
    def one_way(self) -> tuple[str, ...]:
        """The joints that can be judged, but move in one direction only."""
        return tuple(joint.name for joint in self.joints if joint.one_way)

    @property
    def sentences(self) -> tuple[str, ...]:
        """Sentences on what cannot be judged and why; joints with the same reason share one."""
        reasons = (reason_words(reason, names) for reason, names in self.not_judged.items())
        return (*self.general, *reasons, *([one_way_words(self.one_way)] if self.one_way else []))


def reason_words(reason: Reason, names: Sequence[str]) -> str:
    """The sentence on joints that share a reason."""
    remedy = f"; {reason.remedy}" if reason.remedy else ""
    return f"{_listed(names)}: {reason.lack}, so {reason.left}{remedy}."


def one_way_words(names: Sequence[str]) -> str:
    """The sentence on joints that move in one direction only."""
    moves = "moves" if len(names) == 1 else "move"
    return (
        f"{_listed(names)} {moves} in one direction only, so friction and a torque offset cannot be "
        "distinguished there."
    )


def _listed(names: Sequence[str]) -> str:
    return f"{', '.join(names[:-1])} and {names[-1]}" if len(names) > 1 else names[0]


def require_same_torques(
    robot: Robot, recordings: Sequence[Recording], dynamics: Sequence[MotionDynamics]
) -> None:
    """Raises `InputError` if a joint's torque is known in some of the recordings only."""
    for index, joint in enumerate(robot.moving_joints):
        known = [bool(np.isfinite(along.motion.torque[:, index]).all()) for along in dynamics]
        if any(known) and not all(known):
            lacks, has = (recordings[known.index(recorded)].source for recorded in (False, True))
            raise InputError(
                f"{lacks or 'a recording'} has no torque of {joint.name}, nor current or voltage that give "
                f"it, but {has or 'another one'} has; add the channel there, or leave the recording out."
            )


def coverage(
    robot: Robot,
    recordings: Sequence[Recording],
    dynamics: Sequence[MotionDynamics],
    *,
    fitted: int,
    dead: Mapping[str, str] | None = None,
) -> Coverage:
    """Which joints can be judged with these recordings, and why others cannot.

    Args:
        robot: the nominal robot.
        recordings: all recordings, the fitted ones first.
        dynamics: along each recording.
        fitted: number of fitted recordings; without others, a quarter of each is held out.
        dead: channels that were removed from the recordings, with the reason.
    """
    general = [
        f"{one.source or 'the recording'}: {words}."
        for one, along in zip(recordings, dynamics)
        for words in (one.left_out, along.motion.left_out)
        if words
    ]
    motions = [along.motion for along in dynamics[:fitted]]
    rows = sum(motion.reduced_time.size for motion in motions)
    if rows < FEWEST_ROWS:
        cutoff = motions[0].low_pass.cutoff
        general.append(
            f"only {rows} independent samples are left below the cut-off of {cutoff:.3g} Hz; "
            f"record at least {2 * FEWEST_ROWS / (SAMPLES_PER_PERIOD * cutoff):.2g} s more."
        )
        return Coverage((), tuple(general), enough=False)
    found = evidence(robot, recordings, dynamics, fitted=fitted)
    joints = tuple(_covered(robot, recordings[:fitted], one, dead or {}) for one in found)
    return Coverage(joints, tuple(general), enough=any(joint.reason is None for joint in joints))


def _covered(
    robot: Robot, recordings: Sequence[Recording], one: JointEvidence, dead: Mapping[str, str]
) -> JointCoverage:
    reason = next(_reasons(robot, recordings, one, dead), None)
    one_way = reason is None and not one.both_ways
    return JointCoverage(one.name, reason, one_way, (one.sure_fitted, one.sure_held_out))


def _reasons(
    robot: Robot, recordings: Sequence[Recording], one: JointEvidence, dead: Mapping[str, str]
) -> Iterator[Reason]:
    """Reasons why a joint cannot be judged, the most basic first."""
    for recording in recordings:
        lack = torque_lack(robot, recording, one.name)
        if lack is None:
            continue
        wrong = [words for channel, words in dead.items() if channel.split(".")[0] == one.name]
        if wrong:
            yield Reason("dead", wrong[0], _still(recording, one.name))
        elif not is_passive(robot, recording, one.name):
            yield Reason("no_torque", lack.what, _still(recording, one.name), lack.remedy)
    if not one.moves:
        yield Reason("no_motion", "no motion beyond the noise of the position")
    elif one.sure_fitted < FEWEST_SURE:
        yield Reason(
            "little_motion",
            f"hardly any motion: its direction is certain in {one.sure_fitted} of {one.rows_fitted} "
            f"independent samples, and at least {FEWEST_SURE} are needed",
            remedy="move further or faster",
        )
    elif not one.sure_held_out:
        yield Reason(
            "rests_held_out",
            "no certain motion in the held-out data, which must confirm the findings",
            remedy="give a recording with --validate in which the joint moves"
            if one.validated
            else "move throughout the recording, or give a second one with --validate",
        )
    if (
        one.noise > 0
        and not one.described
        and one.recorded <= FLOOR_TOLERANCE * one.noise
        and not _would_show(one)
    ):
        yield Reason(
            "all_noise",
            f"neither the recorded torque ({one.recorded:.2g} {one.unit} rms) nor the torque that the motion "
            f"requires ({one.needed:.2g} {one.unit}) exceeds the torque's noise ({one.noise:.2g} {one.unit})",
            remedy="move faster, further or with a load",
        )


def _would_show(one: JointEvidence) -> bool:
    """Whether the recorded torque would reveal that the joint does not need what the robot file predicts.

    It would if the gain in log score exceeds the odds against an effect.
    """
    return 0.5 * one.rows_fitted * (one.needed / one.noise) ** 2 > ODDS


def _still(recording: Recording, joint: str) -> str:
    """What can still be judged of a joint whose torque is not known."""
    if {f"{joint}.position", f"{joint}.motor_position"} <= set(recording):
        return "only the gear between motor and joint can be judged there"
    return "nothing there can be judged"
