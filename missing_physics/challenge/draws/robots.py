"""The robots of the challenge: shipped ones with masses, inertias, geometry, friction and sensors varied.

Every number that a file of a case holds is drawn with all its digits in every family, so that no family can
be recognised by roundness.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np

from missing_physics.challenge.cases.ranges import Draw
from robot_model import EffectUse, Joint, Robot, load_robot

__all__ = [
    "BENDING",
    "BENDS",
    "ROBOTS",
    "Kind",
    "draw_robot",
    "friction_at",
    "in_order",
    "shares",
    "usual",
    "with_coulomb",
    "without",
]


@dataclass(frozen=True)
class Kind:
    """A shipped robot as the challenge uses it.

    Attributes:
        share: how often it is drawn, relative to the others; 0 of those that `BENDS` brings in.
        durations: of a recording [s], drawn between the two.
        rates: samples per second, one of these [Hz].
        compensated: both engines carry out the feed-forward of its controller.
        beams: how often its flexible links bend in Exudyn as geometrically exact beams, which have neither
            modes nor small deflections, while the robot file keeps to a few modes.
        geared: its motors can have encoders of their own.
        structures: effects of links, base and surroundings that it can show, keys of
            `wider_ranges.STRUCTURES`.
        unseen: of these, and `payload` of a link that bends, what sits where no joint is.
    """

    share: float
    durations: tuple[float, float]
    rates: tuple[float, ...]
    compensated: bool = False
    beams: float = 0.0
    geared: bool = False
    structures: tuple[str, ...] = ()
    unseen: tuple[str, ...] = ()


#: How often a robot with a flexible link takes the place of the drawn one: Exudyn takes half a minute of a
#: processor to record one for eight seconds.
BENDS = 0.13
BENDING = Kind(
    0,
    (8.0, 9.0),
    (200.0,),
    compensated=True,
    beams=0.25,
    structures=("modal_damping", "slosh", "reaction_wheel"),
    unseen=("modal_damping", "slosh", "reaction_wheel", "payload"),
)
ROBOTS: Mapping[str, Kind] = MappingProxyType(
    {
        "single_axis": Kind(4, (14.0, 24.0), (500.0, 1000.0), compensated=True),
        "two_link_arm": Kind(
            5,
            (12.0, 20.0),
            (250.0, 500.0),
            compensated=True,
            geared=True,
            structures=("link_flexibility", "base_motion", "contact"),
            unseen=("link_flexibility", "base_motion"),
        ),
        # Slosh and wheels on its base would take Exudyn a quarter of a minute for each second of motion.
        "six_joint_space_arm": Kind(1, (9.0, 12.0), (200.0, 250.0), compensated=True),
        "flexible_space_robot": BENDING,
        "flexible_space_robot_planar": BENDING,
    }
)
#: How often a joint of the nominal robot has viscous and Coulomb friction.
VISCOUS, COULOMB = 0.75, 0.4
#: Ranges of masses and rotors over the shipped ones, of viscous friction over what is shipped (or a fiftieth
#: of the actuator's limit), and of Coulomb friction in hundredths of that limit.
HEAVIER, DAMPED, RUBBING = (0.7, 1.4), (0.4, 2.0), (0.5, 4.0)


def draw_robot(shipped: str, d: Draw) -> Robot:
    """The shipped robot with other masses, lengths, rotors, friction and sensors; no reference is changed."""
    robot = load_robot(shipped)
    data = robot.model_dump(mode="python")
    lengths = {name: d.decades(0.8, 1.25) for name in ("base", *(link.name for link in robot.links))}
    for body, name in [(data["base"], "base"), *((link, link["name"]) for link in data["links"])]:
        heavier = d.decades(*HEAVIER)
        body["mass"] *= heavier
        body["center_of_mass"] = tuple(x * lengths[name] for x in body["center_of_mass"])
        body["inertia"] = tuple(x * heavier * lengths[name] ** 2 for x in body["inertia"])
    for link in data["links"]:
        if link["beam"] is not None:
            _vary_beam(link["beam"], lengths[link["name"]], d)
    for joint in data["joints"]:
        joint["origin"] = tuple(x * lengths[joint["parent"]] for x in joint["origin"])
        if joint["actuator"] is not None:
            joint["actuator"]["rotor_inertia"] *= d.decades(*HEAVIER)
    data["sensors"] = tuple(_sensor(sensor, d) for sensor in data["sensors"])
    data["effects"] = _friction(robot, d)
    return Robot.model_validate(data)


def _vary_beam(beam: dict[str, Any], longer: float, d: Draw) -> None:
    """Another length, stiffness and payload; its bending goes with powers of the length."""
    beam["length"] *= longer**0.5
    beam["young"] *= (stiffer := d.decades(0.8, 1.4))
    beam["shear"] *= stiffer
    beam["density"] *= d.decades(0.8, 1.25)
    beam["tip"]["mass"] *= d.decades(0.7, 1.4)
    for gauge in beam["gauges"]:
        gauge["place"] *= longer**0.5


def _sensor(sensor: dict[str, Any], d: Draw) -> dict[str, Any]:
    """Noise and resolution from half as good to four times as bad as shipped."""
    torque = sensor["channel"].endswith(".torque")
    found = {**sensor, "noise": sensor["noise"] * d.decades(0.6, 4.0)}
    found["resolution"] = (sensor["resolution"] or (sensor["noise"] if torque else 0.0)) * d.decades(0.4, 2.5)
    return found


def _friction(robot: Robot, d: Draw) -> tuple[dict[str, Any], ...]:
    """Nominal friction of the joints: some have none, some viscous, some Coulomb too.

    Beside the bristles of a shipped robot's LuGre friction its viscous friction is a token, and no measure.
    """
    uses: list[dict[str, Any]] = []
    for joint, (viscous, coulomb) in _usual_friction(robot):
        viscous, coulomb = viscous * d.decades(*DAMPED), coulomb * d.decades(*RUBBING)
        if d.chance.random() < VISCOUS:
            uses.append({"effect": "viscous_friction", "at": joint.name, "coefficient": viscous})
        if d.chance.random() < COULOMB:
            uses.append({"effect": "coulomb_friction", "at": joint.name, "torque": coulomb})
    return tuple(uses)


def _usual_friction(robot: Robot) -> Iterator[tuple[Joint, tuple[float, float]]]:
    """Of each joint of a shipped robot the viscous and Coulomb friction that ranges are relative to."""
    bristly = {use.at for use in robot.effects if use.effect == "lugre_friction"}
    for joint in robot.moving_joints:
        limit = joint.actuator.torque_limit if joint.actuator and joint.actuator.torque_limit else 100.0
        shipped = 0.0 if joint.name in bristly else friction_at(robot, joint.name, "viscous_friction")
        yield joint, (shipped or limit / 50, limit / 100)


def usual(name: str) -> dict[str, tuple[float, float]]:
    """Ranges over which masses of links, rotors and friction of a shipped robot are drawn.

    By the name of the link, that of the joint, and `ID@PLACE`.
    """
    robot = load_robot(name)
    found = {link.name: _times(link.mass, HEAVIER) for link in robot.links}
    for joint in robot.moving_joints:
        if joint.actuator:
            found[joint.name] = _times(joint.actuator.rotor_inertia, HEAVIER)
    for joint, (viscous, coulomb) in _usual_friction(robot):
        found[f"viscous_friction@{joint.name}"] = _times(viscous, DAMPED)
        found[f"coulomb_friction@{joint.name}"] = _times(coulomb, RUBBING)
    return found


def _times(value: float, bounds: tuple[float, float]) -> tuple[float, float]:
    return value * bounds[0], value * bounds[1]


def friction_at(robot: Robot, joint: str, effect: str) -> float:
    """The only parameter of a nominal friction law at a joint; zero where it has none."""
    for use in robot.effects:
        if (use.effect, use.at) == (effect, joint):
            return next(iter(use.parameters.values()))
    return 0.0


def without(robot: Robot, joint: str, *effects: str) -> Robot:
    """A copy that lacks these effects at that joint."""
    kept = tuple(use for use in robot.effects if use.at != joint or use.effect not in effects)
    return robot.model_copy(update={"effects": kept})


def with_coulomb(robot: Robot, joint: str, torque: float) -> Robot:
    """A copy with Coulomb friction at that joint, if it has none yet."""
    if friction_at(robot, joint, "coulomb_friction"):
        return robot
    return robot.with_effects(EffectUse.model_validate(_coulomb(joint, torque)))


def in_order(robot: Robot) -> Robot:
    """A copy whose effects are listed by joint, then by name, however they came to be there."""
    places = [joint.name for joint in robot.joints]

    def key(use: EffectUse) -> tuple[int, str, str]:
        return places.index(use.at) if use.at in places else len(places), use.at, use.effect

    return robot.model_copy(update={"effects": tuple(sorted(robot.effects, key=key))})


def _coulomb(joint: str, torque: float) -> dict[str, Any]:
    return {"effect": "coulomb_friction", "at": joint, "torque": torque}


def shares() -> tuple[list[str], np.ndarray]:
    """Names of the robots, and how probable each is."""
    weights = np.array([kind.share for kind in ROBOTS.values()])
    return list(ROBOTS), weights / weights.sum()
