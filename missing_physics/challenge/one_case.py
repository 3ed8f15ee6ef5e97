"""One case of the flexible space robot, drawn from a seed: dry friction in one joint.

Its base floats, its second link bends and carries a load at its tip, and only joint encoders and torques are
recorded.
"""

from __future__ import annotations

import multiprocessing
from collections.abc import Mapping
from concurrent.futures import ProcessPoolExecutor

import numpy as np
from numpy.typing import NDArray

from exudyn_model import simulate
from missing_physics.challenge.cases.ranges import Draw, bounded
from missing_physics.challenge.cases.truth import Design
from missing_physics.challenge.concealing.conceal import Concealed
from missing_physics.challenge.draws.manoeuvre import slow_sines
from robot_model import EffectUse, Reference, Robot, load_robot

__all__ = ["ROBOT", "case_files", "draw_case"]

ROBOT = "flexible_space_robot"
#: Length [s] and samples per second [Hz] of a recording.
DURATION, RATE = 12.0, 200.0
#: Largest time step of the simulation [s]: half a sample. Position errors are then a sixth of the encoder
#: noise (3e-7 of 2e-6 rad), torque errors an eighth of the torque noise.
STEP = 2.5e-3
#: Ranges of the viscous friction in the robot file [N m s/rad] and of the hidden friction [N m].
DESCRIBED = (15.0, 40.0)
TORQUE = (4.0, 14.0)
STRIBECK_VELOCITY = (0.006, 0.02)


def draw_case(seed: int) -> Design:
    """The case of that seed, reproducibly."""
    d = Draw(np.random.default_rng([seed, 19]))
    robot = _described(load_robot(ROBOT), d)
    joint = robot.moving_joints[int(d.chance.integers(len(robot.moving_joints)))].name
    return Design(
        number=seed,
        name=np.random.default_rng([seed, 5]).bytes(6).hex(),
        shipped=ROBOT,
        family="plain",
        nominal=robot,
        hidden=(_friction(joint, d),),
        validation=_reference(robot, d),
    )


def _described(robot: Robot, d: Draw) -> Robot:
    """Nominal robot: viscous friction instead of the shipped friction laws, and another motion."""
    joints = [joint.name for joint in robot.moving_joints]
    damping = tuple(_use("viscous_friction", at, {"coefficient": d.decades(*DESCRIBED)}) for at in joints)
    # Joint encoders and torques only: the diagnosis of flexible links uses no others.
    sensors = tuple(sensor for sensor in robot.sensors if sensor.channel.split(".")[0] in joints)
    changes = {"effects": damping, "reference": _reference(robot, d), "sensors": sensors, "description": ""}
    return robot.model_copy(update=changes)


def _reference(robot: Robot, d: Draw) -> Reference:
    joints = tuple(slow_sines(joint.name, d) for joint in robot.moving_joints)
    return Reference(duration=DURATION, sample_rate=RATE, joints=joints)


def _friction(joint: str, d: Draw) -> EffectUse:
    kind = int(d.chance.integers(2))
    torque = d.decades(*TORQUE)
    if kind == 0:
        return _use("coulomb_friction", joint, {"torque": torque})
    values = {
        "coulomb_torque": torque,
        "static_torque": torque * d.even(1.4, 2.0),
        "stribeck_velocity": d.decades(*STRIBECK_VELOCITY),
    }
    return _use("stribeck_friction", joint, values)


def _use(effect: str, at: str, values: Mapping[str, float]) -> EffectUse:
    rounded = {key: bounded(value) for key, value in values.items()}
    return EffectUse.model_validate({"effect": effect, "at": at, **rounded})


def case_files(design: Design) -> dict[str, bytes]:
    """Robot file and both recordings of a case, simulated in parallel."""
    robots = [design.real, design.real.model_copy(update={"reference": design.validation})]
    with ProcessPoolExecutor(2, mp_context=multiprocessing.get_context("spawn")) as pool:
        made = list(pool.map(_exact, [robot.model_dump_json() for robot in robots]))
    return Concealed.of(design, made).files()


def _exact(robot: str) -> tuple[NDArray[np.float64], dict[str, NDArray[np.float64]]]:
    """Time and every channel without sensors."""
    recording = simulate(Robot.model_validate_json(robot), sensors=False, step=STEP)
    return recording.time, dict(recording.channels)
