"""What is hidden in a robot: one effect or several, drawn from all that the robot can show."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from missing_physics.challenge.cases.families import Family
from missing_physics.challenge.cases.ranges import (
    BODY,
    BRIEF,
    DRY,
    HIDDEN,
    JOINT,
    MODIFIERS,
    SENSOR,
    Draw,
    Scale,
    bounded,
)
from missing_physics.challenge.cases.truth import Warming
from missing_physics.challenge.draws.robots import Kind, with_coulomb, without
from missing_physics.challenge.draws.warming import EFFECT as BY_TEMPERATURE
from missing_physics.challenge.draws.wider_ranges import GEARS, STRUCTURES
from robot_model import EffectUse, Robot

__all__ = ["Hiding"]

#: Parts from which a single effect is drawn, with their weights: at a joint, of a link's masses, of a sensor.
PARTS = {"joint": 0.74, "body": 0.12, "sensor": 0.14}
#: How often it is one of links, base or surroundings beyond their masses instead.
STRUCTURE = 0.09
#: How often an effect at a joint is one that only its motor's encoder, or its thermometer, shows.
IN_GEAR, BY_WARMTH = 0.5, 0.5
#: Relative fall of friction per kelvin [1/K].
FADING = (0.01, 0.05)
#: Gravity's error along each axis [m/s^2]: all three together make two degrees of tilt at most.
TILT = (0.05, 0.19)


@dataclass(frozen=True)
class Hiding:
    """A draw of what one robot hides.

    Attributes:
        kind: of the robot.
        family: how it hides.
        scales: sizes at each joint.
        warming: of the joint with a thermometer.
        d, later: chance; what was added later has its own, so that other cases stay as they were.
    """

    kind: Kind
    family: Family
    scales: Mapping[str, Scale]
    warming: Warming | None
    d: Draw
    later: Draw

    def hide(self, robot: Robot) -> tuple[Robot, tuple[EffectUse, ...]]:
        """What is hidden, and the nominal robot without what stands in its place."""
        if self.family in ("none", "foreign"):
            return robot, ()
        count = int(self.d.chance.integers(2, 4)) if self.family == "mixed" else 1
        hidden: list[EffectUse] = []
        for _ in range(20 * count):  # drawings that clash with an earlier one are drawn again
            if len(hidden) == count:
                break
            changed, use = self._one(robot)
            if not _clash(use, hidden):
                robot = changed
                hidden.append(use)
        return robot, tuple(hidden)

    def _one(self, robot: Robot) -> tuple[Robot, EffectUse]:
        d, joint = self.d, list(self.scales)[int(self.d.chance.integers(len(self.scales)))]
        scale = self.scales[joint]
        if self.family == "brief":
            effect = sorted(BRIEF)[int(d.chance.integers(len(BRIEF)))]
            if effect == "end_stop" and not scale.sides:
                effect = "external_torque"
            return robot, _use(effect, joint, BRIEF[effect](d, scale))
        if self.family == "compensated":
            effect = DRY[int(d.chance.integers(len(DRY)))]
            return without(robot, joint, *DRY), _use(effect, joint, JOINT[effect](d, scale))
        if self.family == "remote":
            return robot, self._unseen(robot)
        noisy = self.family == "noisy"
        part = "joint" if noisy else str(d.chance.choice(list(PARTS), p=list(PARTS.values())))
        if not noisy and self.kind.structures and self.later.chance.random() < STRUCTURE:
            kinds = self.kind.structures
            effect = kinds[int(self.later.chance.integers(len(kinds)))]
            return robot, STRUCTURES[effect](self.later, robot)
        if part == "body":
            return robot, _body(robot, d)
        if part == "sensor":
            return robot, _sensor(joint, scale, d)
        return self._between(robot, joint, scale) or self._at_joint(robot, joint, scale)

    def _unseen(self, robot: Robot) -> EffectUse:
        """Of a base or a link that bends, where no joint is."""
        d, kinds = self.later, self.kind.unseen
        effect = kinds[int(d.chance.integers(len(kinds)))]
        if effect in STRUCTURES:
            return STRUCTURES[effect](d, robot)
        link = robot.flexible_links[0]
        return _use(effect, link.name, BODY[effect](d, link))

    def _between(self, robot: Robot, joint: str, scale: Scale) -> tuple[Robot, EffectUse] | None:
        """What only a thermometer or an encoder at the motor shows, if it is to be hidden."""
        d, warming = self.later, self.warming
        if warming and self.family != "mixed" and d.chance.random() < BY_WARMTH:
            torque = self.scales[warming.joint].torque * d.decades(1.0, 4.0)
            robot = with_coulomb(robot, warming.joint, torque)
            return robot, _use(BY_TEMPERATURE, warming.joint, {"rate": d.decades(*FADING)})
        # A torque's noise is no measure of what shows between two encoders.
        double = robot.sensor(f"{joint}.motor_position") and self.family != "noisy"
        if double and d.chance.random() < IN_GEAR:
            return robot, GEARS[list(GEARS)[int(d.chance.integers(len(GEARS)))]](d, joint, scale)
        return None

    def _at_joint(self, robot: Robot, joint: str, scale: Scale) -> tuple[Robot, EffectUse]:
        d = self.d
        effect = HIDDEN[int(d.chance.integers(len(HIDDEN)))]
        if effect in DRY:
            robot = without(robot, joint, *DRY)
        if effect == "viscous_friction":
            robot = without(robot, joint, effect)
        if effect in MODIFIERS:
            torque = scale.coulomb or scale.torque * d.decades(0.7, 4.0)
            robot = with_coulomb(robot, joint, torque)
            scale = replace(scale, coulomb=torque)
        return robot, _use(effect, joint, JOINT[effect](d, scale))


def _clash(use: EffectUse, others: list[EffectUse]) -> bool:
    """Whether two effects cannot stand side by side."""
    for other in others:
        dry = any({use.effect, other.effect} <= set(group) for group in (DRY, GEARS))
        modified = {use.effect, other.effect} & set(MODIFIERS) and {use.effect, other.effect} & set(DRY)
        if use.at == other.at and (use.effect == other.effect or dry or modified):
            return True
    return False


def _body(robot: Robot, d: Draw) -> EffectUse:
    if any(robot.gravity) and d.chance.random() < 0.25:
        tilt = {axis: d.sign() * d.decades(*TILT) for axis in "xyz"}
        return _use("gravity", "base", tilt)
    effect = list(BODY)[int(d.chance.integers(len(BODY)))]
    link = robot.links[int(d.chance.integers(len(robot.links)))]
    effect = "payload" if link.flexible else effect  # the masses of its beam are no rigid body's
    return _use(effect, link.name, BODY[effect](d, link))


def _sensor(joint: str, scale: Scale, d: Draw) -> EffectUse:
    effect = list(SENSOR)[int(d.chance.integers(len(SENSOR)))]
    quantities, draw = SENSOR[effect]
    quantity = str(d.chance.choice(quantities))
    return _use(effect, f"{joint}.{quantity}", draw(d, scale, quantity))


def _use(effect: str, at: str, values: dict[str, float]) -> EffectUse:
    rounded = {key: bounded(value) for key, value in values.items()}
    return EffectUse.model_validate({"effect": effect, "at": at, **rounded})
