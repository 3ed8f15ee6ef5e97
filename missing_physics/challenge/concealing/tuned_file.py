"""A tuned robot file: masses and friction fitted to a recording without the hidden physics."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from missing_physics.challenge.cases.ranges import Draw
from missing_physics.challenge.cases.truth import Design
from missing_physics.challenge.concealing.tuning import tunable
from missing_physics.challenge.draws.robots import usual
from missing_physics.challenge.torques.along import ArmAlong
from robot_model import EffectUse, Link, Recording, Robot

__all__ = ["limits_of", "tuned"]

Array = NDArray[np.float64]

#: Range of relative changes by which a mass or friction coefficient is tuned.
TUNED = (-0.5, 1.0)


def limits_of(file: Robot, design: Design) -> dict[str, tuple[float, float]]:
    """Limits for tuning masses and friction of a file, strictly within the range of the draws.

    Relative changes by the names of `tunable`.
    """
    d, found = Draw(np.random.default_rng([design.number, 31])), {}
    now = tunable(file)
    for name, ends in usual(design.shipped).items():
        if (value := now.get(name, 0.0)) > 0:
            found[name] = tuple(d.decades(*sorted((end, (end * value) ** 0.5))) / value - 1 for end in ends)
    return {name: (max(low, TUNED[0]), min(high, TUNED[1])) for name, (low, high) in found.items()}


def tuned(
    robot: Robot, exact: Recording, recording: Recording, limits: Mapping[str, tuple[float, float]]
) -> Robot:
    """`robot` with body masses, rotor inertias and friction fitted to the recorded torque.

    All inertial parameters of a body are scaled together, so that it stays realisable; `limits` are relative.
    """
    along = ArmAlong(robot, exact)
    rows = [k for k, joint in enumerate(along.joints) if f"{joint}.torque" in recording]
    target = (
        np.column_stack([recording[f"{along.joints[k]}.torque"] for k in rows]) - along.nominal()[:, rows]
    )
    columns, numbers = [], dict(zip(along.model.inertial_names, along.model.inertial))
    bodies = [link.name for link in robot.links]
    rotors = [j.name for j in robot.moving_joints if j.actuator and j.actuator.rotor_inertia > 0]
    for name in [*bodies, *rotors]:
        own = np.array([v if n.split(".")[0] == name else 0.0 for n, v in numbers.items()])
        columns.append((along.regressor @ own)[:, rows].ravel())
    columns += [along.part(use)[:, rows].ravel() for use in robot.effects]
    laws = [f"{use.effect}@{use.at}" for use in robot.effects]
    ends = np.array([limits.get(name, TUNED) for name in [*bodies, *rotors, *laws]])
    matrix = np.column_stack(columns)
    size = np.linalg.norm(matrix, axis=0)
    seen = size > 1e-9 * size.max()
    shares = np.zeros(len(columns))
    shares[seen] = lsq_linear(matrix[:, seen], target.ravel(), bounds=ends[seen].T).x
    named = dict(zip([*bodies, *rotors], shares))
    return _scaled(robot, named, shares[len(named) :])


def _scaled(robot: Robot, bodies: Mapping[str, float], friction: Array) -> Robot:
    links = tuple(_scaled_link(link, 1 + float(bodies[link.name])) for link in robot.links)
    joints = tuple(
        joint.model_copy(
            update={
                "actuator": joint.actuator.model_copy(
                    update={"rotor_inertia": joint.actuator.rotor_inertia * (1 + float(bodies[joint.name]))}
                )
            }
        )
        if joint.actuator and joint.name in bodies
        else joint
        for joint in robot.joints
    )
    effects = tuple(_scaled_effect(use, 1 + float(share)) for use, share in zip(robot.effects, friction))
    return robot.model_copy(update={"links": links, "joints": joints, "effects": effects})


def _scaled_link(link: Link, factor: float) -> Link:
    inertia = tuple(factor * moment for moment in link.inertia)
    return link.model_copy(update={"mass": factor * link.mass, "inertia": inertia})


def _scaled_effect(use: EffectUse, factor: float) -> EffectUse:
    """A nominal friction law (viscous or Coulomb, linear in its only parameter) scaled by a factor."""
    values = {key: factor * value for key, value in use.parameters.items()}
    return EffectUse.model_validate({"effect": use.effect, "at": use.at, **values})
