"""One diagnosis of two: of the joint torques, and of what lies between two encoders of a joint."""

from __future__ import annotations

from dataclasses import replace

from missing_physics.diagnosis.further.merge import joined
from missing_physics.diagnosis.gear.transmission import TransmissionResult
from missing_physics.diagnosis.gear_file.effects import found_gears, found_sensors
from missing_physics.results.result import Result
from robot_model import Robot

__all__ = ["with_transmission"]


def with_transmission(result: Result, gap: TransmissionResult, robot: Robot) -> Result:
    """`result` with the findings between encoders, which are added to its robot file as well.

    Args:
        result: the diagnosis of the torques.
        gap: of the differences between encoders.
        robot: the nominal robot.
    """
    gears = found_gears(robot, gap)
    told = replace(gap, could_not_tell=(*gap.could_not_tell, *gears.words))
    return joined(result, told, robot, (*gears.uses, *found_sensors(gap.findings)))
