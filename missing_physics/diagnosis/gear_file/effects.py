"""Findings on transmissions as effects of the robot file."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from missing_physics.diagnosis.gear.transmission import TransmissionResult, listed_gears
from missing_physics.results.result import Finding
from missing_physics.standard.model import use_of
from reference_model.effects.base import GearEffect, SensorEffect
from reference_model.effects.catalogue import get_effect
from robot_model import EffectUse, Joint, Robot

__all__ = ["FoundGears", "compliant_joints", "found_gears", "found_sensors"]

#: Flanks whose stiffness the data do not determine get this eigenfrequency with the rotor [rad/s]: above the
#: bandwidth of joint controllers, and low enough for fast simulation.
FLANKS = 2 * np.pi * 200.0
#: Their damping as a fraction of critical damping.
FLANKS_DAMPING = 0.1


@dataclass(frozen=True)
class FoundGears:
    """Effects to be written to the robot file.

    Attributes:
        uses: effects in gears.
        words: sentences on what could not be written, and on assumptions.
    """

    uses: tuple[EffectUse, ...] = ()
    words: tuple[str, ...] = ()


def found_gears(robot: Robot, gap: TransmissionResult) -> FoundGears:
    """The findings of `gap` in gears, as effects that both engines can simulate."""
    uses: list[EffectUse] = []
    words: list[str] = []
    for joint in robot.moving_joints:
        if joint.name in listed_gears(robot):
            continue
        own = {f.effect: f for f in gap.findings if f.location == joint.name}
        own = {
            effect: finding for effect, finding in own.items() if isinstance(get_effect(effect), GearEffect)
        }
        if not own:
            continue
        reason = _unwritten(joint)
        if reason:
            words.append(f"{' and '.join(own)} at {joint.name}: not in the augmented robot file: {reason}.")
            continue
        made, sentences = _written(joint, own)
        uses += made
        words += sentences
    return FoundGears(tuple(uses), tuple(words))


def compliant_joints(robot: Robot, gap: TransmissionResult | None) -> tuple[str, ...]:
    """Joints with a compliant gear, by the file or a finding, and without a finding at their encoders."""
    findings = () if gap is None else gap.findings
    found = {f.location for f in findings if isinstance(get_effect(f.effect), GearEffect)}
    wrong = {f.location.split(".")[0] for f in findings if isinstance(get_effect(f.effect), SensorEffect)}
    return tuple(sorted((found | set(listed_gears(robot))) - wrong))


def found_sensors(findings: Sequence[Finding]) -> tuple[EffectUse, ...]:
    """The findings that are encoder errors, as effects."""
    return tuple(
        use_of(f.effect, f.location, dict(_values(f)))
        for f in findings
        if isinstance(get_effect(f.effect), SensorEffect)
    )


def _unwritten(joint: Joint) -> str:
    """Why the effects in this gear cannot be written to the file; empty if they can."""
    if joint.actuator is None or joint.actuator.rotor_inertia <= 0:
        return "its actuator has no rotor_inertia, so its motor cannot move separately"
    return ""


def _written(joint: Joint, own: Mapping[str, Finding]) -> tuple[list[EffectUse], list[str]]:
    found = dict(own)
    words: list[str] = []
    hysteresis = found.get("gear_hysteresis")
    if hysteresis is not None and ("torque" not in hysteresis.parameters or "joint_elasticity" not in found):
        words.append(
            f"gear_hysteresis at {joint.name} depends on the motion and not on the torque, as with friction "
            "behind a gear with play; the augmented robot file leaves it out."
        )
        del found["gear_hysteresis"]
    if "backlash" in found and "gear_hysteresis" in found:
        words.append(
            f"backlash and gear_hysteresis at {joint.name} cannot be simulated together; the augmented robot "
            "file has backlash."
        )
        del found["gear_hysteresis"]
    uses = []
    for effect in ("joint_elasticity", "backlash", "gear_hysteresis"):
        if effect in found:
            values = dict(_values(found[effect]))
            if effect == "backlash" and "joint_elasticity" not in found:
                values |= _flanks(joint)
                words.append(
                    f"backlash at {joint.name}: the stiffness of its flanks is not known; the augmented "
                    f"robot file assumes {values['stiffness']:.3g} and damping of {values['damping']:.3g}."
                )
            uses.append(use_of(effect, joint.name, values))
    return uses, words


def _values(finding: Finding) -> Iterator[tuple[str, float]]:
    """Parameters within the catalogue's bounds."""
    effect = get_effect(finding.effect)
    for p in effect.parameters:
        if p.name in finding.parameters:
            value = finding.parameters[p.name].value
            yield p.name, float(np.clip(value, p.lower, p.upper))


def _flanks(joint: Joint) -> dict[str, float]:
    actuator = joint.actuator
    assert actuator is not None
    inertia = actuator.gear_ratio**2 * actuator.rotor_inertia
    return {
        "stiffness": inertia * FLANKS**2,
        "damping": 2 * FLANKS_DAMPING * inertia * FLANKS,
    }
