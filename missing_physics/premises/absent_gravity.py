"""Torques that include the weight of an arm although the robot file has no gravity."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from missing_physics.premises.carried import Carried
from missing_physics.premises.evidence import Scale, log_absence, log_evidence, scale_of
from missing_physics.premises.torque_scale import CERTAIN, REPORTED, stated
from missing_physics.recordings import Finding, percent

__all__ = ["absent_gravity_findings"]

STANDARD = 9.81
#: Prior probabilities that a robot file without gravity is right, that it lacks some other load correlated
#: with the weight, and that gravity was forgotten (along any of six directions).
NONE, SOMETHING = 0.4, 0.02
#: Forgotten gravity acts along -z of the base unless the robot is mounted otherwise.
ALONG = {(2, -1): 0.8, **dict.fromkeys([(2, 1), (0, 1), (0, -1), (1, 1), (1, -1)], 0.04)}


def absent_gravity_findings(carried: Carried) -> Iterator[Finding]:
    """Findings of gravity that is visible in the torques but missing in the robot file."""
    robot = carried.robot
    if any(robot.gravity) or any(use.effect == "gravity" for use in robot.effects):
        return
    known = np.flatnonzero(carried.known)
    weighed: list[tuple[int, int, dict[int, Scale]]] = []
    for axis in range(3):
        found = {int(k): scale for k in known if (scale := _scale(carried, int(k), axis)) is not None}
        if found:
            weighed += [(axis, sign, found) for sign in (-1, 1)]
    if not weighed:
        return
    # The same rows under every hypothesis: each axis is compared with its absence.
    odds = []
    for axis, sign, by_joint in weighed:
        scales = list(by_joint.values())
        none = np.logaddexp(
            math.log(NONE) + log_absence(scales), math.log(SOMETHING) + log_absence(scales, 1.0)
        )
        prior = math.log((1.0 - NONE - SOMETHING) * ALONG[axis, sign])
        odds.append(prior + log_evidence(scales, [float(sign)] * len(scales)) - float(none))
    best = int(np.argmax(odds))
    probability = float(np.exp(odds[best] - np.logaddexp.reduce([0.0, *odds])))
    if probability <= REPORTED:
        return
    axis, sign, by_joint = weighed[best]
    shares = {k: 1.0 - scale.left / scale.without for k, scale in by_joint.items() if scale.without > 0.0}
    clearest = max(shares, key=lambda k: shares[k])
    channel, share = carried.channels[clearest], percent(shares[clearest])
    gravity = [0.0, 0.0, 0.0]
    gravity[axis] = sign * STANDARD
    yield Finding(
        "error" if probability > CERTAIN else "warning",
        "no_gravity",
        channel,
        f"no gravity given; {sign * STANDARD:g} along {'xyz'[axis]} would explain {share} of "
        f"{channel} beyond what inertia and friction make (probability "
        f"{stated(probability)}): write gravity = {gravity} into the robot file or its overlay",
        {"share": shares[clearest], "probability": probability},
    )


def _scale(carried: Carried, joint: int, axis: int) -> Scale | None:
    weight = STANDARD * carried.weight[:, joint, axis]
    others = np.column_stack([carried.dynamic[:, joint], carried.other(joint)])
    return scale_of(weight, others, carried.torque[:, joint])
