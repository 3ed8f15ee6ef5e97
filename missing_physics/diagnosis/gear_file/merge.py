"""Merges the diagnosis of the joint torques with that of the transmissions."""

from __future__ import annotations

from dataclasses import replace

from missing_physics.diagnosis.further.merge import joined
from missing_physics.diagnosis.gear.transmission import TransmissionResult
from missing_physics.diagnosis.gear_file.effects import found_gears, found_sensors
from missing_physics.results.result import Result
from robot_model import Robot

__all__ = ["with_transmission"]


def with_transmission(result: Result, gap: TransmissionResult, robot: Robot) -> Result:
    """`result` merged with the findings on transmissions, also in its robot file.

    Args:
        result: the diagnosis of the torques.
        gap: the diagnosis of the differences between encoders.
        robot: the nominal robot.
    """
    gears = found_gears(robot, gap)
    with_sentences = replace(gap, could_not_tell=(*gap.could_not_tell, *gears.words))
    return joined(result, with_sentences, robot, (*gears.uses, *found_sensors(gap.findings)))
