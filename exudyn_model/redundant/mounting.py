"""The mount of a compliant base: its rest pose, and its load there."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from exudyn_model.bodies.mechanism import Mass
from exudyn_model.bodies.moments import moments_of
from exudyn_model.bodies.rotation import cross, from_rpy
from exudyn_model.effects import Effects
from exudyn_model.effects.links.pushes import PlacedMount
from exudyn_model.redundant.bodies.parts import Part, initial_poses, parts_of
from robot_model import Robot

__all__ = ["mounted"]

Array = NDArray[np.float64]


def mounted(robot: Robot, effects: Effects) -> Effects:
    """The effects with the mount of a compliant base placed and balancing its initial load."""
    if not effects.mounts:
        return effects
    home, rotation = np.asarray(robot.base.position, dtype=float), from_rpy(robot.base.rpy)
    force, moment = _carried(robot, effects)
    placed = [("base", PlacedMount(mount, home, rotation, force, moment)) for mount in effects.mounts]
    return replace(effects, pushes=(*effects.pushes, *placed), mounts=())


def _carried(robot: Robot, effects: Effects) -> tuple[Array, Array]:
    """Force and moment about the base's origin that hold the robot at the start, inertial axes [N, N m]."""
    parts, connections = parts_of(robot, effects.masses, effects.points, effects.stiffening)
    gravity = np.asarray(robot.gravity, dtype=float) + effects.gravity
    poses = initial_poses(robot, parts, connections)
    force, moment = np.zeros(3), np.zeros(3)
    for part, pose in zip(parts, poses):
        mass, first = _weight(part)
        lever = pose.rotation @ first + mass * (pose.position - poses[0].position)
        force, moment = force - mass * gravity, moment - cross(lever, gravity)
    return force, moment


def _weight(part: Part) -> tuple[float, Array]:
    """Mass and first moment of a part, straight, in its frame [kg, kg m]."""
    whole = Mass(part.mass.mass, part.mass.first_moment)
    if part.flexible:
        moments, surplus = moments_of(part.flexible.points), part.flexible.surplus
        whole += Mass(moments.mass, moments.first[:, 0] + (surplus.first if surplus else 0.0))
    for point in part.points:
        whole += Mass(point.mass, point.mass * point.place)
    return whole.mass, whole.first_moment
