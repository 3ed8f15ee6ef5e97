"""Which model a controller carries: rigid bodies in a tree where that says all, else the full one."""

from __future__ import annotations

from exudyn_model.bodies.mechanism import mechanism_of
from exudyn_model.control.full_dynamics import FullDynamics
from exudyn_model.control.rigid_dynamics import InverseDynamics
from robot_model import Robot

__all__ = ["Nominal", "nominal_model"]

Nominal = InverseDynamics | FullDynamics


def nominal_model(robot: Robot) -> Nominal:
    """The model that the controller of `robot` believes in, its effects unknown to it."""
    full = getattr(robot.controller, "model", "rigid") == "full"
    deformed = full and bool(robot.flexible_links)
    if deformed or robot.spherical_joints:
        return FullDynamics(robot, deformed=deformed)
    return InverseDynamics(mechanism_of(robot))
