"""Drawing a case from its number: robot, manoeuvre, controller, sensors, and what is hidden."""

from __future__ import annotations

import numpy as np

from exudyn_model.mechanism import mechanism_of
from exudyn_model.rigid_dynamics import BaseState, InverseDynamics
from missing_physics.challenge.families import Family, family_of
from missing_physics.challenge.foreign import draw_foreign
from missing_physics.challenge.manoeuvre import (
    draw_controller,
    draw_reference,
    reference_samples,
    scales_of,
    with_feedforward,
)
from missing_physics.challenge.ranges import (
    BODY,
    BRIEF,
    DRY,
    JOINT,
    MODIFIERS,
    SENSOR,
    Draw,
    Scale,
    bounded,
)
from missing_physics.challenge.robots import ROBOTS, draw_robot, shares, with_coulomb, without
from missing_physics.challenge.truth import Design, Truth
from robot_model import EffectUse, Robot, Sensor

__all__ = ["draw_design", "draw_truth"]

#: Parts from which a single effect is drawn, with their weights: at a joint, of a link, of a sensor.
PARTS = {"joint": 0.74, "body": 0.12, "sensor": 0.14}
#: How often a joint's velocity is measured as well, and its noise [share of the fastest speed].
VELOCITY, VELOCITY_NOISE = 0.3, 1e-3
#: How often a free base lacks its gyro, or its attitude.
NO_GYRO, NO_ATTITUDE = 0.2, 0.3
#: Gravity's error [m/s^2].
TILT = (0.05, 0.4)
#: One in so many instants of a reference motion is enough for its largest torque.
EVERY = 6
#: Torque noise over what the effect does, in the family where the two are alike.
NOISE_RATIO = (0.5, 1.6)


def draw_truth(first: int, cases: int) -> Truth:
    """The truth of the cases with the numbers `first`, `first + 1`, ..."""
    nonce = np.random.default_rng([first, cases, 11]).bytes(16).hex()
    designs = tuple(draw_design(first + k) for k in range(cases))
    return Truth(nonce=nonce, designs=designs)


def draw_design(number: int) -> Design:
    """The case of that number; the same one every time."""
    d = Draw(np.random.default_rng([number, 3]))
    family = family_of(number)
    shipped, family = _robot_for(family, d)
    kind = ROBOTS[shipped]
    robot = draw_robot(shipped, d)
    robot = robot.model_copy(update={"controller": draw_controller(robot, d, stiff=family == "feedback")})
    robot = robot.model_copy(update={"reference": draw_reference(robot, kind, d)})
    assert robot.reference is not None
    validation = draw_reference(robot, kind, d, like=robot.reference)
    robot = _with_sensors(robot, family, d)
    scales = scales_of(robot, _needed(robot))
    foreign = draw_foreign(robot, scales, d) if family == "foreign" else None
    robot, hidden = _hidden(robot, family, scales, d)
    own = Draw(np.random.default_rng([number, 13]))  # apart from `d`, so that nothing else depends on it
    robot = with_feedforward(robot, hidden, own, compensated=family == "compensated")
    return Design(
        number=number,
        name=np.random.default_rng([number, 5]).bytes(6).hex(),
        shipped=shipped,
        family=family,
        nominal=robot,
        hidden=hidden,
        foreign=foreign,
        validation=validation,
        noise_ratio=d.decades(*NOISE_RATIO) if family == "noisy" else None,
    )


def _robot_for(family: Family, d: Draw) -> tuple[str, Family]:
    """A robot that can show the family, and the family."""
    names, weights = shares()
    if family in ("remote", "compensated"):
        able = [name for name in names if getattr(ROBOTS[name], family)]
        return (able[int(d.chance.integers(len(able)))], family) if able else _robot_for("plain", d)
    return str(d.chance.choice(names, p=weights)), family


def _needed(robot: Robot) -> np.ndarray:
    """Rigid torque of the nominal robot along its reference, its base free to give way, (any, n)."""
    dynamics = InverseDynamics(mechanism_of(robot))
    base = BaseState(np.eye(3), np.zeros(3)) if robot.base.kind == "free" else None
    rows = zip(*(samples[::EVERY].tolist() for samples in reference_samples(robot)))
    return np.array([dynamics(*row, base=base) for row in rows])


def _with_sensors(robot: Robot, family: Family, d: Draw) -> Robot:
    """Channels added and taken away."""
    drop: list[str] = []
    if robot.base.kind == "free":
        blind = family == "remote"
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


def _hidden(
    robot: Robot, family: Family, scales: dict[str, Scale], d: Draw
) -> tuple[Robot, tuple[EffectUse, ...]]:
    """What is hidden, and the nominal robot without what stands in its place."""
    if family in ("none", "foreign"):
        return robot, ()
    count = int(d.chance.integers(2, 4)) if family == "mixed" else 1
    hidden: list[EffectUse] = []
    for _ in range(20 * count):  # drawings that clash with an earlier one are drawn again
        if len(hidden) == count:
            break
        changed, use = _one(robot, family, scales, d)
        if not _clash(use, hidden):
            robot = changed
            hidden.append(use)
    return robot, tuple(hidden)


def _clash(use: EffectUse, others: list[EffectUse]) -> bool:
    """Whether two effects cannot stand side by side."""
    for other in others:
        dry = use.effect in DRY and other.effect in DRY
        modified = {use.effect, other.effect} & set(MODIFIERS) and {use.effect, other.effect} & set(DRY)
        if use.at == other.at and (use.effect == other.effect or dry or modified):
            return True
    return False


def _one(robot: Robot, family: Family, scales: dict[str, Scale], d: Draw) -> tuple[Robot, EffectUse]:
    joints = list(scales)
    joint = joints[int(d.chance.integers(len(joints)))]
    if family == "brief":
        effect = sorted(BRIEF)[int(d.chance.integers(len(BRIEF)))]
        return robot, _use(effect, joint, BRIEF[effect](d, scales[joint]))
    if family == "compensated":
        effect = DRY[int(d.chance.integers(len(DRY)))]
        return without(robot, joint, *DRY), _use(effect, joint, JOINT[effect](d, scales[joint]))
    part = str(d.chance.choice(list(PARTS), p=list(PARTS.values()))) if family != "noisy" else "joint"
    if part == "body":
        return robot, _body(robot, d)
    if part == "sensor":
        return robot, _sensor(robot, joint, scales[joint], d)
    return _at_joint(robot, joint, scales[joint], d)


def _at_joint(robot: Robot, joint: str, scale: Scale, d: Draw) -> tuple[Robot, EffectUse]:
    effect = list(JOINT)[int(d.chance.integers(len(JOINT)))]
    if effect in DRY:
        robot = without(robot, joint, *DRY)
    if effect == "viscous_friction":
        robot = without(robot, joint, effect)
    if effect in MODIFIERS:
        torque = scale.coulomb or scale.torque * d.decades(0.7, 4.0)
        robot = with_coulomb(robot, joint, torque)
        scale = Scale(**{**vars(scale), "coulomb": torque})
    return robot, _use(effect, joint, JOINT[effect](d, scale))


def _body(robot: Robot, d: Draw) -> EffectUse:
    if any(robot.gravity) and d.chance.random() < 0.25:
        tilt = {axis: d.sign() * d.decades(*TILT) for axis in "xyz"}
        return _use("gravity", "base", tilt)
    effect = list(BODY)[int(d.chance.integers(len(BODY)))]
    link = robot.links[int(d.chance.integers(len(robot.links)))]
    return _use(effect, link.name, BODY[effect](d, link))


def _sensor(robot: Robot, joint: str, scale: Scale, d: Draw) -> EffectUse:
    effect = list(SENSOR)[int(d.chance.integers(len(SENSOR)))]
    quantities, draw = SENSOR[effect]
    quantity = str(d.chance.choice(quantities))
    return _use(effect, f"{joint}.{quantity}", draw(d, scale, quantity))


def _use(effect: str, at: str, values: dict[str, float]) -> EffectUse:
    rounded = {key: bounded(value) for key, value in values.items()}
    return EffectUse.model_validate({"effect": effect, "at": at, **rounded})
