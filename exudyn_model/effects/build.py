"""Laws, masses and sensor faults from the effects of a robot file; refuses effects without counterpart."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import MISSING, dataclass, field, fields
from types import MappingProxyType
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from exudyn_model.bodies.mechanism import Mass, PointMass, undeformed
from exudyn_model.bodies.rotation import skew
from exudyn_model.bodies.transmissions import Transmissions
from exudyn_model.effects import drives, friction, loads, sensors
from exudyn_model.effects.base import JointLaw
from exudyn_model.effects.gear import GEAR_PARTS, Gear, GearPart, gear_of
from exudyn_model.effects.links import bodies
from exudyn_model.effects.links.bodies import BodyChange
from exudyn_model.effects.links.pushes import Contact, Mount, Push, Wheels
from exudyn_model.effects.links.structure import STRUCTURES
from exudyn_model.effects.sensors import SensorFault
from robot_model import EffectUse, InputError, Robot, nearest
from robot_model.description.bodies import require_body

__all__ = ["BODY_CHANGES", "JOINT_LAWS", "SENSOR_FAULTS", "Effects", "effects_of", "require_bodies"]

#: Effects at a joint, with the class that implements each.
JOINT_LAWS: Mapping[str, type[JointLaw]] = MappingProxyType(
    {
        "viscous_friction": friction.ViscousFriction,
        "coulomb_friction": friction.CoulombFriction,
        "stribeck_friction": friction.StribeckFriction,
        "lugre_friction": friction.LuGreFriction,
        "asymmetric_friction": friction.AsymmetricFriction,
        "load_dependent_friction": friction.LoadDependentFriction,
        "position_dependent_friction": friction.PositionDependentFriction,
        "temperature_dependent_friction": friction.TemperatureDependentFriction,
        "quadratic_drag": friction.QuadraticDrag,
        "cable_spring": loads.CableSpring,
        "end_stop": loads.EndStop,
        "external_torque": loads.ExternalTorque,
        "torque_gain": drives.TorqueGain,
        "torque_offset": drives.TorqueOffset,
        "torque_ripple": drives.TorqueRipple,
        "torque_saturation": drives.TorqueSaturation,
        "actuator_lag": drives.ActuatorLag,
    }
)

#: Effects of a link or of the base.
BODY_CHANGES: Mapping[str, type[BodyChange]] = MappingProxyType(
    {"payload": bodies.Payload, "inertia": bodies.Inertia, "gravity": bodies.Gravity}
)

#: Effects of a channel.
SENSOR_FAULTS: Mapping[str, type[SensorFault]] = MappingProxyType(
    {
        "sensor_offset": sensors.SensorOffset,
        "sensor_gain": sensors.SensorGain,
        "sensor_delay": sensors.SensorDelay,
        "encoder_eccentricity": sensors.EncoderEccentricity,
        "clock_drift": sensors.ClockDrift,
    }
)

#: Force effects on a body.
PUSHES: Mapping[str, type[Push]] = MappingProxyType({"contact": Contact, "reaction_wheel": Wheels})
#: The effect of a compliant base.
MOUNT = "base_motion"

T = TypeVar("T")


@dataclass(frozen=True)
class Effects:
    """A robot's effects, sorted by what they change.

    Attributes:
        laws: at each moving joint, in the order of the file.
        at_motors: at motors of transmissions, by their index among the drives.
        masses: body name to mass properties added to it, in its own frame.
        gravity: added to the gravity vector, inertial frame [m/s^2], shape (3,).
        faults: channel and fault, in the order of the file.
        gears: of motors with their own coordinate, by their index among the drives, increasing.
        pushes: body and the force effect on it.
        mounts: of a compliant base, before `mounting.mounted` makes pushes of them.
        points: flexible link to the masses fixed to its nodes.
        stiffening: beam to the fraction of its stiffening that is included, where that is not 1.
    """

    laws: tuple[tuple[JointLaw, ...], ...]
    masses: Mapping[str, Mass]
    gravity: NDArray[np.float64]
    faults: tuple[tuple[str, SensorFault], ...]
    gears: Mapping[int, Gear]
    at_motors: Mapping[int, tuple[JointLaw, ...]] = field(default_factory=dict)
    pushes: tuple[tuple[str, Push], ...] = ()
    mounts: tuple[Mount, ...] = ()
    points: Mapping[str, tuple[PointMass, ...]] = field(default_factory=dict)
    stiffening: Mapping[str, float] = field(default_factory=dict)


def effects_of(robot: Robot) -> Effects:
    """The effects of `robot`; `structure.as_is` applies those that change its structure.

    Raises:
        InputError: an effect without a counterpart here, at an impossible place, or with wrong parameters.
    """
    joints = [joint.name for joint in robot.moving_joints]
    links = ["base", *(link.name for link in robot.links)]
    drives, motors = [drive.name for drive in robot.drives], Transmissions(robot).motors
    laws: list[list[JointLaw]] = [[] for _ in joints]
    at_motors: dict[int, list[JointLaw]] = {}
    masses: dict[str, Mass] = {}
    points: dict[str, tuple[PointMass, ...]] = {}
    bending = [link.name for link in robot.flexible_links if link.sprung is None]
    gravity = np.zeros(3)
    faults: list[tuple[str, SensorFault]] = []
    gears: dict[int, list[GearPart]] = {}
    pushes: list[tuple[str, Push]] = []
    mounts: list[Mount] = []
    for use in robot.effects:
        if use.effect in JOINT_LAWS:
            _at(robot, use, [*joints, *motors])
            law = _made(robot, use, JOINT_LAWS[use.effect])
            own = at_motors.setdefault(motors[use.at], []) if use.at in motors else laws[joints.index(use.at)]
            own.append(law)
        elif use.effect in GEAR_PARTS:
            _at(robot, use, drives)
            gears.setdefault(drives.index(use.at), []).append(_made(robot, use, GEAR_PARTS[use.effect]))
        elif use.effect in BODY_CHANGES:
            _at(robot, use, links)
            change = _made(robot, use, BODY_CHANGES[use.effect])
            if isinstance(change, bodies.Payload) and use.at in bending:
                points[use.at] = (*points.get(use.at, ()), change.point())
            else:
                masses[use.at] = masses.get(use.at, Mass()) + change.added()
            gravity = gravity + change.added_gravity()
        elif use.effect in SENSOR_FAULTS:
            faults.append((use.at, _made(robot, use, SENSOR_FAULTS[use.effect])))
        elif use.effect in PUSHES:
            push = _made(robot, use, PUSHES[use.effect])
            _at(robot, use, links[1:] if push.at_link else links[:1])
            pushes += [(use.at, push)] if push.acts else []
        elif use.effect == MOUNT:
            mount = _made(robot, use, Mount)
            _at(robot, use, links[:1])
            mounts += [mount] if mount.acts else []
        elif use.effect not in STRUCTURES:
            known = [*JOINT_LAWS, *GEAR_PARTS, *BODY_CHANGES, *SENSOR_FAULTS, *PUSHES, MOUNT, *STRUCTURES]
            raise InputError(
                f"robot '{robot.name}': the Exudyn engine has no counterpart of effect '{use.effect}' at "
                f"'{use.at}'{nearest(use.effect, known)}."
            )
    made = {k: gear_of(robot, robot.drives[k], gears[k]) for k in sorted(gears)}
    shares = {
        use.at: float(use.parameters["strength"])
        for use in robot.effects
        if use.effect == "centrifugal_stiffening" and use.parameters["strength"]
    }
    return Effects(
        tuple(map(tuple, laws)),
        masses,
        gravity,
        tuple(faults),
        made,
        at_motors={k: tuple(own) for k, own in at_motors.items()},
        pushes=tuple(pushes),
        mounts=tuple(mounts),
        points=points,
        stiffening=shares,
    )


def require_bodies(robot: Robot, effects: Effects) -> None:
    """Raise `InputError` where effects leave a link, or a free base, with impossible mass properties."""
    for name in ("base", *(link.name for link in robot.links)):
        if name not in effects.masses and name not in effects.points:
            continue
        if name == "base" and robot.base.kind != "free":
            continue
        whole = Mass.of(robot.base) if name == "base" else undeformed(robot.link(name))
        whole += effects.masses.get(name, Mass())
        for point in effects.points.get(name, ()):
            cross = skew(point.place)
            whole += Mass(point.mass, point.mass * point.place, -point.mass * cross @ cross)
        require_body(robot, name, whole.mass, whole.first_moment, whole.inertia)


def _made(robot: Robot, use: EffectUse, kind: type[T]) -> T:
    """An instance of `kind`, a dataclass whose fields are the effect's parameters."""
    where = f"robot '{robot.name}', effect '{use.effect}' at '{use.at}'"
    known = {item.name: item for item in fields(kind)}  # type: ignore[arg-type]
    for name in use.parameters:
        if name not in known:
            raise InputError(f"{where}: unknown parameter '{name}'{nearest(name, known)}.")
    for name, item in known.items():
        if name not in use.parameters and item.default is MISSING:
            raise InputError(f"{where}: parameter '{name}' is missing.")
    return kind(**use.parameters)


def _at(robot: Robot, use: EffectUse, places: Sequence[str]) -> None:
    if use.at not in places:
        raise InputError(
            f"robot '{robot.name}', effect '{use.effect}': it can sit at {', '.join(places)}, not at "
            f"'{use.at}'{nearest(use.at, places)}."
        )
