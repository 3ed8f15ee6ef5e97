"""Torques on the motor side of their gear, currents named as torques, torques without gravity."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from missing_physics.premises.carried import Carried
from missing_physics.premises.evidence import Scale, log_absence, log_evidence, scale_of
from missing_physics.recordings import Correction, Finding
from robot_model import Drive

__all__ = ["CERTAIN", "REPORTED", "stated", "torque_scale_findings"]

#: Prior probability that torques are not what their names state, over all kinds of errors; and the fraction
#: of it for all channels alike, the rest being for a single channel.
WRONG, ALIKE = 0.2, 0.9
#: Probabilities above which a finding is reported, above which it is an error, and above which alternatives
#: are reported with it.
REPORTED, CERTAIN, ALSO = 0.5, 0.99, 0.1
#: Weight determines a scale if it varies by at least this fraction of the largest weight torque of a joint.
CHANGES = 0.1


_OTHERS = {"motor_side": "before the gear", "current": "a current", "no_weight": "without gravity"}


@dataclass(frozen=True)
class _ChannelError:
    """One way in which torque channels may not be what their names state.

    Attributes:
        kind: of the finding.
        factor: ratio of each joint's channel to its torque; 1 if the channel is right.
        joints: indices of the wrong channels.
        part: fraction of the prior probability of the kind.
    """

    kind: str
    factor: tuple[float, ...]
    joints: tuple[int, ...]
    part: float = 1.0


def torque_scale_findings(carried: Carried) -> Iterator[Finding]:
    """Findings of torques whose weight component contradicts their names.

    Weight is the best known component of a torque: neither rotors nor friction change it.
    """
    robot = carried.robot
    gravity = np.array(robot.gravity, dtype=float)
    if not gravity.any():
        return
    joints, scales = [], []
    for k in map(int, np.flatnonzero(carried.known)):
        weight, most = carried.weight[:, k] @ gravity, np.linalg.norm(carried.weight[:, k], axis=1).mean()
        if np.std(weight) < CHANGES * most * np.linalg.norm(gravity):
            continue
        others = np.column_stack([carried.dynamic[:, k], carried.other(k)])
        scale = scale_of(weight, others, carried.torque[:, k])
        if scale is not None and carried.channels[k].endswith(".torque"):
            joints.append(k)
            scales.append(scale)
    if not joints:
        return
    moving = [robot.drives[k] for k in joints]
    right = log_evidence(scales, [1.0] * len(scales))
    ways = list(_channel_errors(moving))
    kinds = len({way.kind for way in ways})
    weighed = [_evidence(way, scales) + math.log(WRONG / kinds * way.part) for way in ways]
    total = np.logaddexp.reduce([right + math.log1p(-WRONG), *weighed])
    best = ways[int(np.argmax(weighed))]
    kinds_of = {
        kind: float(
            np.exp(np.logaddexp.reduce([v for v, way in zip(weighed, ways) if way.kind == kind]) - total)
        )
        for kind in dict.fromkeys(way.kind for way in ways)
    }
    if sum(kinds_of.values()) > REPORTED:
        yield _finding(carried, best, joints, scales, kinds_of)


def _evidence(way: _ChannelError, scales: Sequence[Scale]) -> float:
    return log_absence(scales) if way.kind == "no_weight" else log_evidence(scales, way.factor)


def _channel_errors(joints: Sequence[Drive]) -> Iterator[_ChannelError]:
    """Errors of all channels alike, and of single channels."""
    count = len(joints)
    every = tuple(range(count))
    for kind, made in (("motor_side", _motor_side), ("current", _current)):
        factors = [made(joint) for joint in joints]
        if not any(factors):
            continue
        concerned = tuple(k for k in every if factors[k])
        alone = [(k,) for k in concerned] if len(every) > 1 else []
        for chosen in [concerned, *alone]:
            part = 1.0 if not alone else ALIKE if chosen == concerned else (1.0 - ALIKE) / len(alone)
            yield _ChannelError(
                kind, tuple(factors[k] or 1.0 if k in chosen else 1.0 for k in every), chosen, part
            )
    yield _ChannelError("no_weight", (0.0,) * count, every)


def _motor_side(joint: Drive) -> float | None:
    motor = joint.actuator
    return None if motor is None or motor.gear_ratio == 1.0 else 1.0 / motor.gear_ratio


def _current(joint: Drive) -> float | None:
    motor = joint.actuator
    if motor is None or motor.torque_constant is None:
        return None
    return 1.0 / (motor.torque_constant * motor.gear_ratio)


def _finding(
    carried: Carried,
    way: _ChannelError,
    joints: Sequence[int],
    scales: Sequence[Scale],
    likely: Mapping[str, float],
) -> Finding:
    concerned = [joints[k] for k in way.joints]
    channels = [carried.channels[k] for k in concerned]
    first, scale = carried.robot.drives[concerned[0]], scales[way.joints[0]]
    probability = likely[way.kind]
    names, one = ", ".join(channels), len(channels) == 1
    measured = (
        f"{'it' if one else channels[0]} holds {scale.value:.3g} ± {2 * scale.error:.2g} times the weight "
        "that the robot file gives that joint to carry"
    )
    severity = "error" if probability > CERTAIN else "warning"
    others = [kind for kind, value in likely.items() if kind != way.kind and value > ALSO]
    known = "".join(f", or {_OTHERS[kind]} ({stated(likely[kind])})" for kind in others)
    known = f"(probability {stated(probability)}{known})"
    corrections: tuple[Correction, ...] = ()
    if way.kind == "no_weight":
        sentence = (
            f"{names} {'carries' if one else 'carry'} no weight {known}: {measured}. Either gravity was "
            "taken out of the torque before it was recorded, or the robot is mounted in another orientation: "
            "correct gravity in the robot file or overlay, [0.0, 0.0, 0.0] where torques are without it"
        )
    else:
        factor = way.factor[way.joints[0]]
        corrections = tuple(
            Correction(channel, scale=1.0 / way.factor[k]) for channel, k in zip(channels, way.joints)
        )
        what = _description(way.kind, first, 1.0 / factor, one)
        sentence = (
            f"{names} {'is' if one else 'are'} {what} {known}: {measured}, and {factor:.3g} is expected then"
        )
    return Finding(
        severity,  # type: ignore[arg-type]
        way.kind,
        channels[0],
        sentence,
        {"probability": probability, "scale": scale.value, "error": scale.error},
        corrections,
    )


def stated(probability: float) -> str:
    return "above 0.99" if probability > CERTAIN else f"{probability:.2f}"


def _description(kind: str, joint: Drive, factor: float, one: bool) -> str:
    motor = joint.actuator
    assert motor is not None
    if kind == "motor_side":
        return f"before the gear, {motor.gear_ratio:g} at {joint.name}"
    unit = "N" if joint.kind == "prismatic" else "N m"
    return f"the motor's current{'' if one else 's'}, {factor:.4g} {unit} per A at {joint.name}"
