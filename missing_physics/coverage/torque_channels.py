"""Torques that contradict the motion: wrong sign, unit, side of the gear or joint.

Each way in which a channel may have been recorded or named wrongly is a model of the same recording (see
`coverage/needs.py`). One is reported only if it is decisive: no physics explains the torques as they are
named, and with the correction they are explained to a few percent.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment

from missing_physics.coverage.needs import Needs
from missing_physics.recordings import Correction, Finding, percent
from missing_physics.standard import MODEL_ERROR
from robot_model import Joint, Robot

__all__ = ["FAILS", "PLAUSIBLE", "Suspect", "factors", "log_of", "torque_findings", "unexplained"]

#: Plausible scales of a torque, due to gains of sensors and actuators and to wrong masses.
PLAUSIBLE = (0.1, 10.0)
#: Range of the ratio of a corrected torque to the nominal one, allowing for unknown masses; and the range to
#: distinguish joints from each other.
NEAR, NEARER = (0.4, 2.5), (0.7, 1.4)
#: Largest unexplained energy fraction of a corrected torque, and least factor by which the uncorrected
#: torque's must exceed it.
HOLDS, DECISIVE = 0.1, 10.0
#: A torque with a smaller unexplained energy fraction is accepted.
FAILS = 0.05


@dataclass(frozen=True)
class Suspect:
    """One way to correct the torque of one joint.

    Attributes:
        left: energy fraction that remains unexplained with it.
        scale: factor on the recorded torque.
        words: description of the error, as the end of a sentence.
    """

    left: float
    scale: float
    words: str


def factors(joint: Joint, quantity: str) -> Iterator[tuple[float, str]]:
    """Factors to the SI unit for common mistakes, and descriptions of these."""
    unit = "N" if joint.kind == "prismatic" else "N m"
    if quantity == "current":
        yield 1e-3, "is in mA"
        return
    if quantity == "voltage":
        yield 1e-3, "is in mV"
        return
    yield 1e-3, f"is in {'mN' if joint.kind == 'prismatic' else 'N mm'}"
    yield 1e3, f"is in k{unit}"
    motor = joint.actuator
    if motor is None:
        return
    if motor.gear_ratio != 1.0:
        ratio = motor.gear_ratio
        yield ratio, f"is the motor's, before its gear of {ratio:g}"
        yield 1 / ratio, f"holds the gear's ratio of {ratio:g} twice"
    if motor.torque_constant is not None:
        constant = motor.torque_constant * motor.gear_ratio
        yield constant, f"is the motor's current, which makes {constant:g} {unit} per A at the joint"


def torque_findings(robot: Robot, needs: Needs, channels: Sequence[str | None]) -> tuple[Finding, ...]:
    """Torques that do not measure what their names state.

    Args:
        robot: the nominal robot.
        needs: of one recording.
        channels: source of the torque of each moving joint, shape (n,).
    """
    failing = [k for k in needs.known if unexplained(needs, k) > FAILS]
    if not failing:
        return ()
    suspects = {k: _suspect(robot, needs, k, channels[k] or "") for k in failing}
    exchanged = _exchanged(needs, failing, suspects)
    found = []
    for k, other in exchanged.items():
        found.append(_other_joint(robot, needs, channels, k, other))
    for k, suspect in suspects.items():
        if suspect is not None and k not in exchanged:
            found.append(_corrected(robot, needs, channels[k] or "", k, suspect))
    return tuple(found)


def unexplained(needs: Needs, joint: int) -> float:
    """Energy fraction of a torque that no physics explains.

    Neither as the torque of a driven joint, nor as that of a drive holding its joint while others move.
    """
    return min(needs.left(joint, PLAUSIBLE), needs.left_if_held(joint, PLAUSIBLE))


def log_of(left: float) -> float:
    """Logarithm of an unexplained energy fraction, at least that of the error of any model."""
    return math.log(max(left, MODEL_ERROR**2))


def _decisive(left: float, needs: Needs, joint: int) -> bool:
    return left < HOLDS and left * DECISIVE < unexplained(needs, joint)


def _suspect(robot: Robot, needs: Needs, joint: int, channel: str) -> Suspect | None:
    """The best correction of this channel alone, if it is decisive."""
    tried = []
    for factor, words in [(1.0, ""), *factors(robot.moving_joints[joint], channel.split(".")[-1])]:
        for sign in (1.0, -1.0):
            scale = sign * factor
            if sign > 0 and PLAUSIBLE[0] <= 1.0 / factor <= PLAUSIBLE[1]:
                continue
            limits = NEAR[0] / factor, NEAR[1] / factor
            left = needs.left(joint, limits, sign=sign)
            k = factor * needs.scale(joint, sign=sign)
            tried.append((left, abs(math.log(max(k, 1e-12))), scale, _description(sign, words)))
    left = min(item[0] for item in tried)
    # Among corrections that explain it about equally well, the one closest to the robot's masses.
    alike = [item for item in tried if item[0] <= 1.5 * left + 1e-6]
    best = min(alike, key=lambda item: item[1])
    return Suspect(best[0], best[2], best[3]) if _decisive(best[0], needs, joint) else None


def _description(sign: float, words: str) -> str:
    against = "runs against the motion" if sign < 0 else ""
    return " and ".join(part for part in (against, words) if part)


def _exchanged(needs: Needs, failing: Sequence[int], suspects: dict[int, Suspect | None]) -> dict[int, int]:
    """Joint to the joint under whose name its torque was recorded, if an exchange explains them best."""
    known = list(needs.known)
    left = np.array([[needs.left(a, NEARER, of=b) for b in known] for a in known])
    logs = np.vectorize(log_of)(left)
    rows, columns = linear_sum_assignment(logs)
    moved = {known[a]: known[b] for a, b in zip(rows, columns) if a != b}
    if not moved or not set(moved) <= set(failing):
        return {}
    if not all(_decisive(left[known.index(a), known.index(b)], needs, a) for a, b in moved.items()):
        return {}
    exchanged_cost = sum(logs[known.index(a), known.index(b)] for a, b in moved.items())
    corrected_cost = 0.0
    for a in moved:
        suspect = suspects[a]
        if suspect is None:
            return moved
        factor = abs(suspect.scale)
        own = needs.left(a, (NEARER[0] / factor, NEARER[1] / factor), sign=math.copysign(1.0, suspect.scale))
        corrected_cost += log_of(own)
    return moved if exchanged_cost < corrected_cost else {}


def _other_joint(
    robot: Robot, needs: Needs, channels: Sequence[str | None], joint: int, other: int
) -> Finding:
    names = [j.name for j in robot.moving_joints]
    own, held = channels[joint] or "", channels[other] or ""
    share = needs.left(joint, NEARER, of=other)
    return Finding(
        "error",
        "exchanged",
        held,
        f"{held} is what {names[joint]} needs for its motion, and not {names[other]} (as named it leaves "
        f"{percent(min(unexplained(needs, joint), 1.0))} of {own} unexplained, under the other name "
        f"{percent(share)})",
        {"left": share},
        (Correction(own, source=held),),
    )


def _corrected(robot: Robot, needs: Needs, channel: str, joint: int, suspect: Suspect) -> Finding:
    name = robot.moving_joints[joint].name
    kind = "sign" if suspect.scale == -1.0 else "unit"
    also = " (or reverse that position, if it is the one that counts the other way)" if kind == "sign" else ""
    return Finding(
        "error",
        kind,
        channel,
        f"{channel} {suspect.words}, by the motion of {name} and the masses of the robot file: as it is, "
        f"{percent(min(unexplained(needs, joint), 1.0))} of it stays unexplained whatever friction, gain or "
        f"payload there is, and corrected {percent(suspect.left)}{also}",
        {"left": suspect.left, "scale": suspect.scale},
        (Correction(channel, scale=suspect.scale),),
    )
