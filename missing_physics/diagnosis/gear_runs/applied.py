"""What was found between two encoders, put to use: in the robot file, and in the torques of its joint.

A motor that moves by itself makes the torque of its joint u - B (thdd - qdd), u being the actuator's torque,
th the motor's position, q the joint's and B the reflected inertia of the rotor: the rest of the diagnosis
then sees a joint with the rotor rigidly on it, in the motion of the joint's own encoder.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from missing_physics.diagnosis.dynamics.inverse import MotionDynamics
from missing_physics.diagnosis.gear.transmission import TransmissionResult, listed_gears
from missing_physics.diagnosis.least_squares.problem import Segment
from missing_physics.diagnosis.preparation.setup import make_segments
from missing_physics.diagnosis.written.augment import rounded
from missing_physics.results.result import Finding
from reference_model.effects.base import GearEffect, SensorEffect
from reference_model.effects.catalogue import get_effect
from robot_model import EffectUse, Joint, Recording, Robot

__all__ = ["FoundGears", "at_the_joints", "found_gears", "found_sensors", "without_two_encoders"]

#: Flanks whose stiffness the data do not tell get one of this eigenfrequency of the rotor on them [rad/s]:
#: above what joint controllers excite, below what would make simulations crawl.
FLANKS = 2 * np.pi * 200.0
#: And this part of critical damping.
FLANKS_DAMPING = 0.1


@dataclass(frozen=True)
class FoundGears:
    """What the robot file gets of the findings between two encoders.

    Attributes:
        uses: effects in gears.
        joints: where these are or the robot file lists some, and no encoder is known to err.
        words: what could not be written, and what was assumed.
    """

    uses: tuple[EffectUse, ...] = ()
    joints: tuple[str, ...] = ()
    words: tuple[str, ...] = ()


def found_gears(robot: Robot, gap: TransmissionResult | None) -> FoundGears:
    """The findings of `gap` that lie in gears, as effects that both engines can run."""
    uses: list[EffectUse] = []
    words: list[str] = []
    joints: list[str] = []
    for joint in robot.moving_joints:
        if joint.name in listed_gears(robot):
            joints.append(joint.name)
            continue
        own = {f.effect: f for f in (gap.findings if gap else ()) if f.location == joint.name}
        own = {
            effect: finding for effect, finding in own.items() if isinstance(get_effect(effect), GearEffect)
        }
        if not own:
            continue
        reason = _unwritten(robot, joint)
        if reason:
            words.append(f"{' and '.join(own)} at {joint.name}: not in the augmented robot file: {reason}.")
            continue
        made, told = _written(joint, own)
        uses += made
        words += told
        if made and not _falsified(gap, joint.name):
            joints.append(joint.name)
    return FoundGears(tuple(uses), tuple(joints), tuple(words))


def found_sensors(findings: Sequence[Finding]) -> tuple[EffectUse, ...]:
    """Those of the findings that encoders err by, as effects."""
    return tuple(
        EffectUse(effect=f.effect, at=f.location, **dict(_values(f)))
        for f in findings
        if isinstance(get_effect(f.effect), SensorEffect)
    )


def _unwritten(robot: Robot, joint: Joint) -> str:
    """Why the effects in this gear cannot stand in the file; empty where they can."""
    if joint.actuator is None or joint.actuator.rotor_inertia <= 0:
        return "its actuator has no rotor_inertia, so that its motor cannot move by itself"
    return ""


def _written(joint: Joint, own: Mapping[str, Finding]) -> tuple[list[EffectUse], list[str]]:
    found = dict(own)
    words: list[str] = []
    lossy = found.get("gear_hysteresis")
    if lossy is not None and ("torque" not in lossy.parameters or "joint_elasticity" not in found):
        words.append(
            f"gear_hysteresis at {joint.name} follows the motion and not the torque, as friction behind a "
            "gear with play makes it; the augmented robot file leaves it out."
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
                    f"backlash at {joint.name}: the stiffness of its flanks is not told; the augmented robot "
                    f"file assumes {values['stiffness']:.3g} and damping of {values['damping']:.3g}."
                )
            uses.append(EffectUse(effect=effect, at=joint.name, **values))
    return uses, words


def _values(finding: Finding) -> Iterator[tuple[str, float]]:
    """Parameters within the catalogue's bounds."""
    effect = get_effect(finding.effect)
    for p in effect.parameters:
        if p.name in finding.parameters:
            value = finding.parameters[p.name].value
            yield p.name, rounded(float(np.clip(value, p.lower, p.upper)))


def _flanks(joint: Joint) -> dict[str, float]:
    actuator = joint.actuator
    assert actuator is not None
    inertia = actuator.gear_ratio**2 * actuator.rotor_inertia
    return {
        "stiffness": rounded(inertia * FLANKS**2),
        "damping": rounded(2 * FLANKS_DAMPING * inertia * FLANKS),
    }


def _falsified(gap: TransmissionResult | None, joint: str) -> bool:
    """Whether an encoder of the joint was found to err."""
    return any(f.location.startswith(f"{joint}.") for f in (gap.findings if gap else ()))


def without_two_encoders(robot: Robot, recordings: Sequence[Recording]) -> tuple[str, ...]:
    """Joints whose gears cannot be looked into."""
    geared = [joint.name for joint in robot.moving_joints if joint.actuator is not None]
    return tuple(name for name in geared if not all(_has_both(recording, name) for recording in recordings))


def at_the_joints(
    robot: Robot, recordings: Sequence[Recording], segments: Sequence[Segment], joints: Collection[str]
) -> tuple[Segment, ...]:
    """`segments` of the recordings with the motion of these joints' own encoders, and the torque there."""
    joints = [joint for joint in joints if all(_has_both(recording, joint) for recording in recordings)]
    if not joints:
        return tuple(segments)
    cutoff = segments[0].motion.low_pass.cutoff
    changed = make_segments(robot, [_without_motors(r, joints) for r in recordings], cutoff=cutoff)
    return tuple(_at_the_joints(robot, *pair, joints) for pair in zip(segments, changed))


def _has_both(recording: Recording, joint: str) -> bool:
    return f"{joint}.position" in recording and f"{joint}.motor_position" in recording


def _without_motors(recording: Recording, joints: Collection[str]) -> Recording:
    dropped = {f"{joint}.motor_{quantity}" for joint in joints for quantity in ("position", "velocity")}
    return replace(recording, channels={k: v for k, v in recording.channels.items() if k not in dropped})


def _at_the_joints(robot: Robot, motors: Segment, links: Segment, joints: Collection[str]) -> Segment:
    torque = links.motion.torque.copy()
    for k, joint in enumerate(robot.moving_joints):
        actuator = joint.actuator
        if joint.name in joints and actuator is not None:
            inertia = actuator.gear_ratio**2 * actuator.rotor_inertia
            apart = motors.motion.acceleration[:, k] - links.motion.acceleration[:, k]
            torque[:, k] -= inertia * apart
    motion = replace(links.motion, torque=torque)
    return Segment(robot, MotionDynamics(links.dynamics.model, motion, links.dynamics.further), motion)
