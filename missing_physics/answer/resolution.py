"""A law of friction that the recording cannot tell from a simpler one of its family is that one.

LuGre's bristles give before they slide. Where they give less than the joint travels while the filter of its
position remembers, what is seen is a joint that sticks: dry friction of the lower rungs. It fits better than
these along a recorded motion, in which the sign of a velocity is not known at rest, and is no LuGre friction
for that; the robot file keeps it as the law that sticks.
"""

from __future__ import annotations

import numpy as np

from missing_physics.hypotheses import Term
from missing_physics.inference import Data, Fit
from missing_physics.inference.fit import FILE
from missing_physics.standard.band import WIDER, WIDEST
from reference_model.effects.base import Effect, JointEffect
from reference_model.effects.catalogue import get_effect

__all__ = ["is_filed", "resolved_travel", "simpler"]

#: Standard deviations by which static friction has to exceed kinetic friction to be said to, and part of it.
SURE, WORTH = 2.0, 0.05
#: Kinetic friction within this part of the file's is the file's [-]: two standard deviations of it.
TOLERANCE = 2.0 * FILE


def resolved_travel(data: Data, joint: str) -> float:
    """Travel of a joint from a reversal on, within the memory of its position's filter [rad or m]."""
    k, longest = data.joints.index(joint), 0.0
    for run in data.runs[: data.fitted]:
        motion = run.motion
        memory = 0.5 / min(WIDER * motion.cutoff, WIDEST * motion.rate)
        longest = max(longest, 0.5 * memory**2 * float(np.sqrt(np.mean(motion.acceleration[:, k] ** 2))))
    return longest


def simpler(data: Data, fit: Fit, term: Term) -> tuple[Effect, dict[str, str]] | None:
    """The effect of the family that a law is as far as recordings resolve it; None where it is itself.

    Returns:
        The effect, and for each of its numbers that of the term which it is.
    """
    effect = term.effect
    if not isinstance(effect, JointEffect) or not effect.family:
        return None
    if not 0.0 < effect.build_up(term.parameters) < resolved_travel(data, term.at):
        return None
    static, kinetic = term.parameters["static_torque"], term.parameters["coulomb_torque"]
    spread = fit.deviation(f"{effect.id}@{term.at}.static_torque")
    peaked = static - kinetic > max(SURE * spread, WORTH * kinetic)
    name = "stribeck_friction" if peaked else "coulomb_friction"
    lower = get_effect(name)
    same = {p.name: p.name for p in lower.estimated} if peaked else {"torque": "coulomb_torque"}
    return lower, same


def is_filed(data: Data, fit: Fit, term: Term) -> bool:
    """Whether the robot file has kinetic friction of the same size at the joint."""
    filed = data.filed[fit.layout.names.index(f"{term.at}.coulomb")]
    return bool(filed > 0.0 and abs(term.parameters["coulomb_torque"] - filed) <= TOLERANCE * filed)
