"""The mount of a base that gives way: where it is at rest, and what it carries there."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from exudyn_model.effects import Effects
from exudyn_model.effects.pushes import Mount, PlacedMount
from exudyn_model.mechanism import Mechanism
from exudyn_model.rigid_dynamics import BaseState, InverseDynamics
from exudyn_model.rotation import from_rpy
from robot_model import InputError, Robot

__all__ = ["mounted"]


def mounted(robot: Robot, effects: Effects, mechanism: Mechanism | None) -> Effects:
    """The effects with the mount of a base that gives way put in place, carrying what rests on it."""
    if not any(isinstance(push, Mount) for _, push in effects.pushes):
        return effects
    if mechanism is None:
        raise InputError(
            f"robot '{robot.name}', effect 'base_motion': the Exudyn engine does not carry it with spherical "
            "joints."
        )
    home, rotation = np.asarray(robot.base.position, dtype=float), from_rpy(robot.base.rpy)
    still = [0.0] * len(robot.moving_joints)
    begin = [joint.initial_position for joint in robot.moving_joints]
    base = BaseState(rotation, np.zeros(3))
    force, moment = np.reshape(
        InverseDynamics(mechanism).needed(begin, still, still, base=base, held=np.zeros(6)).wrench, (2, 3)
    )
    weight = {"force": rotation @ force, "moment": rotation @ moment}
    placed = [
        (at, PlacedMount(push, home, rotation, **weight) if isinstance(push, Mount) else push)
        for at, push in effects.pushes
    ]
    return replace(effects, pushes=tuple(placed))
