"""Corrections of a draft whose recording contradicts itself, the robot's dynamics, or the sign of work."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Sequence

from missing_physics.diagnosis import contradictions, prepared
from missing_physics.drafting.channels import Entry
from missing_physics.drafting.clock import Clock
from missing_physics.drafting.drive import power_share
from missing_physics.drafting.sheet import Draft
from missing_physics.recordings import (
    Finding,
    Raw,
    consistency_findings,
    mapping_from_toml,
    recording_of_raw,
)
from robot_model import InputError, Recording, Robot

__all__ = ["agree_on_gears", "corrected", "reverse_torques", "scale_entry"]

#: Maximum number of rounds of correcting contradictions.
ROUNDS = 4
#: Factors that correspond to a unit, by quantity.
_FACTORS = {
    "position": {"deg": math.pi / 180, "mm": 1e-3},
    "velocity": {"deg/s": math.pi / 180, "rpm": math.pi / 30, "mm/s": 1e-3},
    "torque": {"mNm": 1e-3},
}
#: The sign of a torque is known if its net work is at least this fraction of all exchanged work.
NET_WORK = 0.5
#: If most torques of a family with at least this many joints are on the motor side, all of them are.
FAMILY = 3


def corrected(robot: Robot, found: Draft, raw: Raw) -> Recording | None:
    """The recording read with the draft, after correcting contradictions in itself and with the dynamics."""
    for _ in range(ROUNDS):
        mapping = mapping_from_toml(found.map, source="the draft")
        try:
            recording = recording_of_raw(raw, mapping)
        except InputError as error:
            found.notes.append(f"the log cannot be read yet with the drafted map: {error}")
            return None
        if not _correct(found, _contradictions(robot, recording, found)):
            return recording
    return recording


def _contradictions(robot: Robot, recording: Recording, found: Draft) -> list[Finding]:
    own = [f for f in consistency_findings(recording, robot=robot) if f.severity == "error" and f.corrections]
    if own:
        return own
    try:
        ready = prepared(robot, [recording])
    except InputError as error:
        note = f"torques were not compared with the robot's dynamics: {error}"
        found.notes = [*(n for n in found.notes if n != note), note]
        return []
    return [f for f in contradictions(robot, ready.recordings[0], ready.dynamics[0]) if f.corrections]


def _correct(found: Draft, findings: Sequence[Finding]) -> bool:
    """Apply the corrections of findings to the entries; return whether there were any."""
    by_channel = {entry.channel: entry for entry in found.entries}
    before = {entry.channel: (entry.column, dict(entry.table)) for entry in found.entries}
    changed = False
    for finding in findings:
        for correction in finding.corrections:
            if correction.channel == "time":
                _correct_time(found.clock, correction.scale)
                found.clock.reasons.append(f"corrected: {finding.sentence}")
                changed = True
            elif correction.channel in by_channel and correction.origin in before:
                entry, (column, table) = by_channel[correction.channel], before[correction.origin]
                entry.column, entry.table = column, dict(table)
                scale_entry(entry, correction.scale)
                if correction.delay:
                    entry.table["delay"] = entry.table.get("delay", 0.0) + correction.delay
                entry.reasons.append(f"corrected: {finding.sentence}")
                changed = True
    return changed


def _correct_time(clock: Clock, scale: float) -> None:
    if "rate" in clock.table:
        clock.table["rate"] /= scale
    else:
        clock.table["scale"] = clock.table.get("scale", 1.0) * scale


def scale_entry(entry: Entry, factor: float) -> None:
    """Multiply a channel by a factor, or set its unit if the factor corresponds to one."""
    sign, size = math.copysign(1.0, factor), abs(factor)
    units = _FACTORS.get(entry.quantity.removeprefix("motor_").removeprefix("reference_"), {})
    unit = next((name for name, own in units.items() if abs(size / own - 1.0) < 1e-3), "")
    if unit and not entry.table.keys() & {"unit", "scale"}:
        entry.table["unit"], size = unit, 1.0
    scale = entry.table.pop("scale", 1.0) * sign * size
    if scale != 1.0:
        entry.table["scale"] = scale


def reverse_torques(found: Draft, recording: Recording) -> None:
    """Reverse the sign of torques whose net work over the motion is negative.

    Friction dissipates energy, so the work of a drive over a long motion is positive, unless there are
    external loads.
    """
    shares = {
        entry.channel: power_share(recording, entry.joint.name)
        for entry in found.entries
        if entry.quantity == "torque"
    }
    reversed_ = {entry.family for entry in found.entries if shares.get(entry.channel, 0.0) < -NET_WORK}
    driving = {entry.family for entry in found.entries if shares.get(entry.channel, 0.0) > NET_WORK}
    for entry in found.entries:
        if (
            entry.quantity == "torque"
            and entry.family in reversed_ - driving
            and entry.table.get("scale", 1) > 0
        ):
            scale_entry(entry, -1.0)
            share = shares[entry.channel]
            why = (
                f"it removes {-share:.0%} of the energy that it exchanges with the motion"
                if share < -NET_WORK
                else "as torques with similar names, which remove energy from the motion"
            )
            entry.reasons.append(f"reversed: {why}")
            entry.questions.append("is it the torque on the joint, or the reaction on the drive?")


def agree_on_gears(found: Draft) -> None:
    """Correct all torques of a family if most of them turned out to be on the motor side of the gear."""
    families: dict[str, list[Entry]] = defaultdict(list)
    for entry in found.entries:
        actuator = entry.joint.actuator
        if entry.quantity == "torque" and actuator is not None and actuator.gear_ratio != 1.0:
            families[entry.family].append(entry)
    for family in families.values():
        before = [entry for entry in family if _on_motor_side(entry)]
        if len(family) < FAMILY or 2 * len(before) <= len(family):
            continue
        for entry in family:
            if entry not in before and entry.joint.actuator is not None:
                entry.table["scale"] = math.copysign(
                    entry.joint.actuator.gear_ratio, entry.table.get("scale", 1.0)
                )
                entry.reasons.append("on the motor side of the gear, as most torques with similar names")
                entry.questions.append("is it on the motor side? Its own values do not show it.")


def _on_motor_side(entry: Entry) -> bool:
    """Whether a torque was found to be on the motor side of its gear."""
    actuator = entry.joint.actuator
    return actuator is not None and abs(abs(entry.table.get("scale", 1.0)) / actuator.gear_ratio - 1.0) < 1e-3
