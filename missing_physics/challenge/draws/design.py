"""Drawing a case from its number: robot, manoeuvre, controller, sensors, and what is hidden."""

from __future__ import annotations

import numpy as np

from exudyn_model.bodies.mechanism import mechanism_of
from exudyn_model.control.rigid_dynamics import BaseState, InverseDynamics
from missing_physics.challenge.cases.conditions import (
    Conditions,
    Factors,
    draw_torque_record,
    factors_of,
)
from missing_physics.challenge.cases.families import Family, as_often_as, family_of
from missing_physics.challenge.cases.ranges import Draw
from missing_physics.challenge.cases.truth import Design, Truth
from missing_physics.challenge.draws.file_errors import draw_file_errors
from missing_physics.challenge.draws.foreign import draw_foreign
from missing_physics.challenge.draws.hiding import Hiding
from missing_physics.challenge.draws.hold import draw_hold
from missing_physics.challenge.draws.manoeuvre import (
    draw_controller,
    draw_reference,
    reference_samples,
    scales_of,
    with_feedforward,
)
from missing_physics.challenge.draws.robots import BENDING, BENDS, ROBOTS, draw_robot, in_order, shares
from missing_physics.challenge.draws.warming import draw_warming
from robot_model import EffectUse, Robot, Sensor

__all__ = ["draw_design", "draw_truth"]

#: How often a joint's velocity is measured as well, and its noise [share of the fastest speed].
VELOCITY, VELOCITY_NOISE = 0.3, 1e-3
#: How often a free base lacks its gyro, or its attitude.
NO_GYRO, NO_ATTITUDE = 0.2, 0.3
#: How often flexible links have no gauges, and no accelerometer at their tip.
NO_STRAIN, NO_TIP = 0.5, 0.5
#: How often geared motors have encoders beside those of the joints, and a joint a thermometer.
MOTOR_ENCODERS, THERMOMETER = 0.4, 0.15
#: One in so many instants of a reference motion is enough for its largest torque.
EVERY = 6
#: Torque noise over what the effect does, in the family where the two are alike.
NOISE_RATIO = (0.5, 1.6)
#: How often cases of other families have stiff gains as well, torque noise from the same range of levels,
#: or a free base without any sensor: none of these may reveal that something is hidden.
STIFF, RAISED, BLIND = 0.15, 0.1, 0.25


def draw_truth(first: int, cases: int) -> Truth:
    """The truth of the cases with the numbers `first`, `first + 1`, ..."""
    nonce = np.random.default_rng([first, cases, 11]).bytes(16).hex()
    designs = tuple(draw_design(first + k) for k in range(cases))
    return Truth(nonce=nonce, designs=designs)


def draw_design(number: int) -> Design:
    """The case of that number; the same one every time."""
    d = Draw(np.random.default_rng([number, 3]))
    later = Draw(
        np.random.default_rng([number, 23])
    )  # what came later, so that other cases stay as they were
    family = family_of(number)
    shipped, family = _robot_for(family, d)
    if later.chance.random() < BENDS:
        shipped = str(later.chance.choice([name for name in ROBOTS if ROBOTS[name] is BENDING]))
    kind = ROBOTS[shipped]
    alike = Draw(np.random.default_rng([number, 29]))  # what makes other families look like these
    robot = draw_robot(shipped, d)
    stiff = alike.chance.random() < as_often_as("feedback", family, STIFF)
    robot = robot.model_copy(update={"controller": draw_controller(robot, d, stiff=stiff, firm=alike)})
    robot = robot.model_copy(update={"reference": draw_reference(robot, kind, d)})
    assert robot.reference is not None
    factors, around = factors_of(number), Draw(np.random.default_rng([number, 41]))
    robot = _clocked(robot, around, held=factors.held)
    validation = draw_reference(robot, kind, d, like=robot.reference)
    blind = alike.chance.random() < BLIND
    robot = _with_more_sensors(_with_sensors(robot, d, blind=blind), later)
    joints = [joint.name for joint in robot.moving_joints]
    warm = later.chance.random() < THERMOMETER
    warming = draw_warming(joints[int(later.chance.integers(len(joints)))], later) if warm else None
    scales = scales_of(robot, _needed(robot))
    foreign = draw_foreign(scales, d) if family == "foreign" else None
    robot, hidden = Hiding(kind, family, scales, warming, d, later).hide(robot)
    if family == "remote":
        robot = _unseen(robot, hidden[0].at)
    robot, noise_of = _raised(robot, hidden, Hiding(kind, "noisy", scales, None, alike, alike), family)
    own = Draw(np.random.default_rng([number, 13]))  # apart from `d`, so that nothing else depends on it
    robot = with_feedforward(robot, hidden, own, compensated=family == "compensated")
    robot = in_order(robot)
    return Design(
        number=number,
        name=np.random.default_rng([number, 5]).bytes(6).hex(),
        shipped=shipped,
        family=family,
        nominal=robot,
        hidden=hidden,
        foreign=foreign,
        validation=validation,
        noise_ratio=alike.decades(*NOISE_RATIO) if noise_of else None,
        noise_of=noise_of,
        beams=bool(later.chance.random() < kind.beams),
        warming=warming,
        conditions=_conditions(factors, robot, around),
    )


def _clocked(robot: Robot, d: Draw, *, held: bool) -> Robot:
    """With a controller that holds its command, or works without pause."""
    assert robot.reference is not None
    hold = draw_hold(robot, robot.reference.sample_rate, d) if held else 0.0
    return robot.model_copy(update={"controller": robot.controller.model_copy(update={"sample_time": hold})})


def _conditions(factors: Factors, robot: Robot, d: Draw) -> Conditions:
    assert robot.reference is not None
    return Conditions(
        factors=factors,
        file_errors={} if factors.file_exact else draw_file_errors(robot, d),
        torque=draw_torque_record(factors.torque, robot.reference.sample_rate, d),
    )


def _robot_for(family: Family, d: Draw) -> tuple[str, Family]:
    """A robot that can show the family, and the family."""
    names, weights = shares()
    able = {
        "remote": [name for name in names if ROBOTS[name].unseen],
        "compensated": [name for name in names if ROBOTS[name].compensated and ROBOTS[name].share],
    }.get(family)
    if able:
        return able[int(d.chance.integers(len(able)))], family
    return str(d.chance.choice(names, p=weights)), family


def _needed(robot: Robot) -> np.ndarray:
    """Rigid torque of the nominal robot along its reference, its base free to give way, (any, n)."""
    dynamics = InverseDynamics(mechanism_of(robot))
    base = BaseState(np.eye(3), np.zeros(3)) if robot.base.kind == "free" else None
    rows = zip(*(samples[::EVERY].tolist() for samples in reference_samples(robot)))
    return np.array([dynamics(*row, base=base) for row in rows])


def _raised(
    robot: Robot, hidden: tuple[EffectUse, ...], noisy: Hiding, family: Family
) -> tuple[Robot, EffectUse | None]:
    """The robot, and the effect whose size its torque noise has, if any.

    In other families than `noisy` it is one that might have been hidden, with the friction that it would have
    beside it, so that nothing but the hidden effect differs.
    """
    if family == "noisy":
        return robot, hidden[0]
    if noisy.d.chance.random() >= as_often_as("noisy", family, RAISED):
        return robot, None
    if hidden:
        return robot, noisy.hide(robot)[1][0]
    changed, (use,) = noisy.hide(robot)
    return changed, use


def _unseen(robot: Robot, at: str) -> Robot:
    """Without any sensor of that link or base."""
    sensors = tuple(sensor for sensor in robot.sensors if sensor.channel.split(".")[0] != at)
    return robot.model_copy(update={"sensors": sensors})


def _with_sensors(robot: Robot, d: Draw, *, blind: bool) -> Robot:
    """Channels added and taken away."""
    drop: list[str] = []
    if robot.base.kind == "free":
        drop += ["base.angular_velocity"] if blind or d.chance.random() < NO_GYRO else []
        drop += ["base.attitude"] if blind or d.chance.random() < NO_ATTITUDE else []
    sensors = [s for s in robot.sensors if not any(s.channel.startswith(f"{name}.") for name in drop)]
    if d.chance.random() < VELOCITY:
        fastest = np.abs(reference_samples(robot)[1]).max(0)
        sensors += [
            Sensor(channel=f"{joint.name}.velocity", noise=VELOCITY_NOISE * float(speed) * d.decades(0.5, 2))
            for joint, speed in zip(robot.moving_joints, fastest)
            if speed > 0
        ]
    return robot.model_copy(update={"sensors": tuple(sensors)})


def _with_more_sensors(robot: Robot, d: Draw) -> Robot:
    """Sensors of flexible links taken away, and encoders at the motors added."""
    drop: list[str] = []
    for link in robot.flexible_links:
        drop += [f"{link.name}.strain"] if d.chance.random() < NO_STRAIN else []
        drop += [f"{link.name}.tip_acceleration"] if d.chance.random() < NO_TIP else []
    sensors = [s for s in robot.sensors if not any(s.channel.startswith(f"{name}.") for name in drop)]
    if ROBOTS[robot.name].geared and d.chance.random() < MOTOR_ENCODERS:
        sensors += [_at_motor(s, d) for s in sensors if s.channel in _positions(robot)]
    return robot.model_copy(update={"sensors": tuple(sensors)})


def _positions(robot: Robot) -> set[str]:
    return {f"{joint.name}.position" for joint in robot.moving_joints}


def _at_motor(sensor: Sensor, d: Draw) -> Sensor:
    """An encoder at the motor, on the joint's side of the gear's ratio, beside the joint's own."""
    channel = sensor.channel.replace(".", ".motor_")
    return sensor.model_copy(update={"channel": channel, "noise": sensor.noise * d.decades(0.5, 2.0)})
