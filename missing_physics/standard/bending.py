"""The model whose parameters are estimated, including those of beams where links are flexible."""

from __future__ import annotations

from reference_model.codegen.kept import kept
from reference_model.evaluation.drive_model import drive_model
from reference_model.evaluation.model import RobotModel
from robot_model import Robot

__all__ = ["model_of"]


@kept
def model_of(robot: Robot) -> RobotModel:
    """Dynamics of a robot along motions of its drives; without beam parameters if motors are coupled."""
    return drive_model(robot) if robot.transmissions else RobotModel(robot, beams=True)
