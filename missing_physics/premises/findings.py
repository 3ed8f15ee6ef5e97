"""Tests of all premises of a diagnosis."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from missing_physics.premises.absent_gravity import absent_gravity_findings
from missing_physics.premises.carried import Carried
from missing_physics.premises.command import command_findings
from missing_physics.premises.computed_torque import computed_torque_findings
from missing_physics.premises.torque_scale import torque_scale_findings
from missing_physics.recordings import Finding, Mapping, sentence_of
from robot_model import InputError, Recording, Robot

__all__ = ["PremiseError", "premise_findings", "require_premises"]


class PremiseError(InputError):
    """A recording contradicts a premise of the diagnosis about the robot file or the map.

    Attributes:
        recording: the recording.
        finding: the contradiction.
    """

    def __init__(self, recording: Recording, finding: Finding, mapping: Mapping | None = None) -> None:
        self.recording, self.finding = recording, finding
        super().__init__(
            f"{recording.source or 'the recording'}: {sentence_of(finding, mapping).rstrip('.')}"
        )


def premise_findings(robot: Robot, recording: Recording) -> tuple[Finding, ...]:
    """Premises of a diagnosis that the recording contradicts; errors first.

    Args:
        robot: nominal.
        recording: with consistent channels.

    Returns:
        Findings of the kinds ``no_gravity``, ``motor_side``, ``current``, ``no_weight``, ``computed_torque``
        and ``command``; only ``command`` for a robot on a free base or with flexible links.
    """
    carried = Carried.of(robot, recording)
    found: list[Finding] = list(command_findings(robot, recording))
    if carried is not None and carried.known.any():
        with np.errstate(over="ignore", under="ignore"):
            for weighed in (absent_gravity_findings, torque_scale_findings, computed_torque_findings):
                found += weighed(carried)
    order = ("error", "warning", "note")
    return tuple(sorted(found, key=lambda finding: order.index(finding.severity)))


def require_premises(
    robot: Robot,
    recordings: Sequence[Recording],
    mapping: Mapping | None = None,
    *,
    as_recorded: bool = False,
) -> tuple[Finding, ...]:
    """Findings that cast doubt on premises without refuting them, once for each kind and channel.

    Args:
        robot: nominal.
        recordings: all that are fitted or scored.
        mapping: with which they were read, for sentences on how to correct it.
        as_recorded: continue even if a premise is refuted.

    Raises:
        PremiseError: a premise is refuted.
    """
    doubts: dict[tuple[str, str], Finding] = {}
    for recording in recordings:
        for finding in premise_findings(robot, recording):
            if finding.severity == "error" and not as_recorded:
                raise PremiseError(recording, finding, mapping)
            doubts.setdefault((finding.kind, finding.channel), finding)
    return tuple(doubts.values())
