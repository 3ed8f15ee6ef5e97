"""Links that seem to bend where it may as well be the gear: joints that are known from their motor only.

Behind an elastic gear a link vibrates as a whole, nearly as one that bends, and an encoder at the motor sees
neither. Only the shape of the mode differs, by less than masses and inertias are known. So both are told.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from missing_physics.diagnosis.least_squares.problem import Problem
from missing_physics.results.result import Alternative, Finding

__all__ = ["with_elastic_gears"]

RIVAL = "joint_elasticity"
WHY = "only the motor's encoder is recorded, and behind an elastic gear the link vibrates in the same way"


def with_elastic_gears(findings: Sequence[Finding], problem: Problem) -> tuple[Finding, ...]:
    """`findings` with the gear of a bending link's joint beside it where only its motor has an encoder."""
    blind = {
        joint.child: joint.name
        for k, joint in enumerate(problem.robot.moving_joints)
        if joint.actuator is not None
        and all(
            s.motion.position_channels[k] == f"{joint.name}.motor_position"
            and f"{joint.name}.position" not in s.motion.others
            for s in problem.segments
        )
    }
    return tuple(
        _with_gear(found, blind[found.location])
        if found.effect == "link_flexibility" and found.location in blind
        else found
        for found in findings
    )


def _with_gear(found: Finding, joint: str) -> Finding:
    """The finding and the gear, as probable as each other."""
    half = found.probability / 2
    return replace(
        found,
        probability=half,
        ambiguous_with=(*found.ambiguous_with, f"{RIVAL}@{joint}"),
        alternatives=(Alternative(RIVAL, joint, half, WHY), *found.alternatives),
    )
