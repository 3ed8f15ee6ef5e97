"""Choice of a controller's model: rigid bodies in a tree where that suffices, else the full one."""

from __future__ import annotations

from exudyn_model.bodies.mechanism import mechanism_of
from exudyn_model.control.full_dynamics import FullDynamics
from exudyn_model.control.rigid_dynamics import InverseDynamics
from robot_model import Robot

__all__ = ["Nominal", "nominal_model"]

Nominal = InverseDynamics | FullDynamics


def nominal_model(robot: Robot) -> Nominal:
    """The model of the controller of `robot`, without effects."""
    full = getattr(robot.controller, "model", "rigid") == "full"
    deformed = full and bool(robot.flexible_links)
    if deformed or robot.spherical_joints:
        return FullDynamics(robot, deformed=deformed)
    return InverseDynamics(mechanism_of(robot))
