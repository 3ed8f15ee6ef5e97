"""Draft of a map and an overlay from a robot and a log."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence

import numpy as np

from missing_physics.drafting.channels import Entry, assigned
from missing_physics.drafting.clock import Clock, clock_of
from missing_physics.drafting.columns import columns_of
from missing_physics.drafting.corrections import agree_on_gears, corrected, reverse_torques, scale_entry
from missing_physics.drafting.drive import (
    PARTS,
    Drive,
    JointDraft,
    needed_torques,
    torque_per_current,
)
from missing_physics.drafting.motion import POSITIONS, angle_unit, ratio_of, velocity_unit
from missing_physics.drafting.sheet import Draft
from missing_physics.recordings import Budget, read_raw, unit_conversion
from robot_model import Drive as RobotDrive
from robot_model import InputError, Recording, Robot

__all__ = ["Draft", "draft"]

#: Values above these indicate a current in milliamperes, a temperature in kelvins.
MOST_AMPERES, MOST_CELSIUS = 300.0, 200.0
#: Quantities that drive a joint.
EFFORTS = ("torque", "current", "voltage")
#: Relative difference within which torque constants agree.
AGREEMENT = 0.2


def draft(robot: Robot, log: str | os.PathLike[str], *, size_limit: float | None = None) -> Draft:
    """Guess the map of a log, and estimate the robot's drives from its currents.

    Args:
        robot: nominal robot.
        log: any readable file.
        size_limit: memory limit for its variables [bytes].

    Raises:
        InputError: the log cannot be read, has no long columns, or no column of a joint.
    """
    raw = read_raw(log, budget=Budget(size_limit) if size_limit else None)
    columns = columns_of(raw)
    clock = clock_of(columns)
    entries, unused = assigned(robot, [column for column in columns if column is not clock.column])
    if not entries:
        names = ", ".join(f"'{column.label}'" for column in columns[:8])
        raise InputError(
            f"{raw.source} has no column whose name contains a quantity of a joint (it has "
            f"{names}); name them like q1_deg or joint1.position, or write a map by hand."
        )
    found = Draft(clock, entries, unused, source=raw.source)
    _infer_units(clock, entries)
    recording = corrected(robot, found, raw)
    if recording is not None:
        agree_on_gears(found)
        reverse_torques(found, recording)
        _estimate_drives(robot, found, recording)
    _ask_for_efforts(robot, found)
    return found


def _infer_units(clock: Clock, entries: Sequence[Entry]) -> None:
    """Infer units from names, else from ranges and derivatives."""
    by_channel = {entry.channel: entry for entry in entries}
    for entry in entries:
        if entry.reading.unit:
            _set_unit(entry, entry.reading.unit, f"its unit {entry.reading.unit} is in its name")
        elif entry.quantity.endswith("position"):
            _guess_position(entry)
        elif entry.quantity == "temperature":
            celsius = float(np.nanmax(entry.column.values)) < MOST_CELSIUS
            _set_unit(entry, "degC" if celsius else "K", "its values suggest this unit")
        elif entry.quantity == "current" and float(np.nanmax(np.abs(entry.column.values))) > MOST_AMPERES:
            _set_unit(entry, "mA", "")
            entry.questions.append("is its unit mA? It is guessed from the size of the values alone.")
    for entry in entries:
        if entry.quantity.endswith("velocity"):
            position = by_channel.get(entry.channel.replace("velocity", "position"))
            if position is not None:
                _relate(clock, position, entry)


def _set_unit(entry: Entry, unit: str, reason: str) -> None:
    factor, shift = unit_conversion(unit, entry.channel)
    if (factor, shift) != (1.0, 0.0):
        entry.table["unit"] = unit
    if reason:
        entry.reasons.append(reason)


def _guess_position(entry: Entry) -> None:
    unit, reason, certain = angle_unit(entry.joint, entry.column.values)
    _set_unit(entry, unit, reason and f"in {unit}: {reason}")
    if not certain:
        entry.questions.append(f"is its unit {unit}? The robot file gives the joint no position_limits.")


def _relate(clock: Clock, position: Entry, velocity: Entry) -> None:
    """Infer units, signs and clock from position and velocity together."""
    ratio = ratio_of(clock.seconds, position.column.values, velocity.column.values)
    if not ratio.is_integral:
        velocity.questions.append(
            f"is it the velocity of '{position.column.label}'? It is not the derivative of that column."
        )
        return
    slides = position.joint.kind == "prismatic"
    known = velocity.reading.unit or ""
    size = _size(position)
    if not known and not clock.known:
        velocity.questions.append("what is its unit? Neither a name nor a known clock determines it.")
    elif not known:
        unit = velocity_unit(ratio, size, slides=slides)
        if unit:
            _set_unit(velocity, unit, f"in {unit} it is the derivative of '{position.column.label}'")
    elif not position.reading.unit and clock.known:
        wanted = unit_conversion(known, velocity.channel)[0] / abs(ratio.value)
        for unit, size in POSITIONS[slides].items():
            if abs(math.log(wanted / size)) < 0.06 and unit_conversion(unit, position.channel)[0] != _size(
                position
            ):
                position.table.pop("unit", None)
                _set_unit(position, unit, f"in {unit} '{velocity.column.label}' is its derivative")
    elif not clock.known and "rate" in clock.table:
        step = _size(position) / (unit_conversion(known, velocity.channel)[0]) * abs(ratio.value)
        rate = clock.table["rate"] / step
        clock.table["rate"], clock.seconds, clock.known = float(f"{rate:.4g}"), clock.seconds * step, True
        clock.reasons.append(f"at {rate:.4g} Hz '{velocity.column.label}' is the derivative of a position")


def _size(entry: Entry) -> float:
    """Size of a column's unit in SI units, from its table."""
    unit = entry.table.get("unit")
    return entry.table.get("scale", 1.0) * (unit_conversion(unit, entry.channel)[0] if unit else 1.0)


def _estimate_drives(robot: Robot, found: Draft, recording: Recording) -> None:
    """Estimate torque constant and gear from the currents of joints whose torque is not recorded."""
    channels = {entry.channel for entry in found.entries}
    currents = [
        (k, joint, f"{joint.name}.current")
        for k, joint in enumerate(robot.drives)
        if f"{joint.name}.current" in channels and f"{joint.name}.torque" not in channels
    ]
    needed = needed_torques(robot, recording) if currents else None
    for k, joint, channel in currents:
        drive = None if needed is None else torque_per_current(needed, k, recording, channel)
        entry = next(entry for entry in found.entries if entry.channel == channel)
        if joint.joint is None:  # an overlay has joints only
            continue
        _describe_drive(found, entry, joint, drive)


def _describe_drive(found: Draft, entry: Entry, joint: RobotDrive, drive: Drive | None) -> None:
    actuator = joint.actuator
    constant = actuator.torque_constant if actuator else None
    gear = actuator.gear_ratio if actuator else 1.0
    table = JointDraft(joint.name)
    if drive is None or not drive.determined:
        if constant is None:
            table.questions.append(
                "torque_constant [N m/A] and gear_ratio? The recording does not determine them (too little "
                "of the current accelerates or supports the masses); take them from the drive's data sheet."
            )
            found.joints.append(table)
        return
    if drive.factor < 0:
        scale_entry(entry, -1.0)
        entry.reasons.append(
            "reversed: its sign is opposite to the torque that the motion needs according to the robot file"
        )
    factor, low, high = abs(drive.factor), *sorted((abs(drive.low), abs(drive.high)))
    measured = (
        f"{factor:.4g} N m of torque per A at the joint, {low:.4g} to {high:.4g} in {PARTS} parts of the "
        "recording, from the robot's dynamics"
    )
    if constant is not None:
        if abs(math.log(factor / (constant * gear))) > math.log1p(AGREEMENT):
            table.reasons.append(measured)
            table.questions.append(
                f"the robot file gives {constant * gear:.4g} N m per A (torque_constant {constant:.4g}, "
                f"gear_ratio {gear:.4g}): which is right, or are the masses wrong by a factor of "
                f"{factor / constant / gear:.3g}?"
            )
            found.joints.append(table)
        return
    table.actuator = {"gear_ratio": gear, "torque_constant": float(f"{factor / gear:.4g}")}
    table.reasons.append(measured)
    table.questions.append(
        f"gear_ratio? Only its product with torque_constant, {factor:.4g}, is known; rotor_inertia is "
        "multiplied by its square."
        if gear == 1.0
        else "rotor_inertia [kg m^2, motor side]?"
    )
    found.joints.append(table)


def _ask_for_efforts(robot: Robot, found: Draft) -> None:
    channels = {entry.channel for entry in found.entries}
    for joint in (drive for drive in robot.drives if drive.joint is not None):
        if f"{joint.name}.position" not in channels and f"{joint.name}.motor_position" not in channels:
            found.joints.append(
                JointDraft(
                    joint.name, questions=['no column contains its position: is it locked (kind = "fixed")?']
                )
            )
        elif (
            not any(f"{joint.name}.{effort}" in channels for effort in EFFORTS) and joint.actuator is not None
        ):
            found.joints.append(
                JointDraft(
                    joint.name, questions=["no column contains its torque: is it passive (passive = true)?"]
                )
            )
