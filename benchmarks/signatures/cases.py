"""For every effect a small robot, parameters, and the most informative channel, for `pictures`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from robot_model import (
    Actuator,
    Base,
    Beam,
    Bearing,
    Cycloid,
    EffectUse,
    Joint,
    JointPD,
    Link,
    MultiSine,
    Reference,
    Robot,
    TipBody,
    Tube,
)

__all__ = ["CASES", "Case"]

#: Plotted quantity: residual torque of the description; error of a faulty sensor; relative motion of a gear's
#: two sides; or the channel itself, without and with the effect.
Kind = Literal["residual", "error", "twist", "channel"]


@dataclass(frozen=True)
class Case:
    """One picture.

    Attributes:
        kind: vertical quantity.
        robot: without the effect.
        at: place of the effect.
        values: its parameters, at least those without defaults.
        over: horizontal quantity: `time`, or a quantity of joint1.
        channel: of kinds "channel" and "error".
        beside: other effects that both robots have.
        span: plotted part of the run [s].
    """

    kind: Kind
    robot: Robot
    at: str = "joint1"
    values: Mapping[str, float] = field(default_factory=dict)
    over: str = "time"
    channel: str = "joint1.position"
    beside: tuple[EffectUse, ...] = ()
    span: tuple[float, float] = (0.0, 1e9)


def _arm(**changes: Any) -> Robot:
    """A link on a level axis in gravity, moved by two sines."""
    sines = MultiSine(
        joint="joint1", amplitudes=(0.5, 0.2), frequencies=(0.25, 0.6), phases=(0.0, 1.0), ramp=1.0
    )
    given = {
        "name": "arm",
        "gravity": (0.0, 0.0, -9.81),
        "links": (Link(name="link1", mass=4.0, center_of_mass=(0.3, 0.0, 0.0), inertia=(0.01, 0.15, 0.15)),),
        "joints": (
            Joint(
                name="joint1",
                parent="base",
                child="link1",
                axis=(0.0, -1.0, 0.0),
                actuator=Actuator(gear_ratio=100.0, rotor_inertia=4e-5),
                bearing=Bearing(radial_arm=0.05, axial_arm=0.05, bending_arm=0.1),
            ),
        ),
        "controller": JointPD(kp=4000.0, kd=200.0, sample_time=0.0),
        "reference": Reference(duration=8.0, sample_rate=250.0, joints=(sines,)),
    }
    return Robot.model_validate({**given, **changes})


def _flyer(**changes: Any) -> Robot:
    """A free base whose arm moves for half a second and stops."""
    move = Cycloid(joint="joint1", displacement=0.8, start=0.2, duration=0.5)
    given = {
        "name": "flyer",
        "base": Base(kind="free", mass=60.0, inertia=(6.0, 7.0, 8.0)),
        "links": (Link(name="link1", mass=5.0, center_of_mass=(0.6, 0.0, 0.0), inertia=(0.01, 0.6, 0.6)),),
        "joints": (
            Joint(
                name="joint1",
                parent="base",
                child="link1",
                origin=(0.3, 0.0, 0.2),
                axis=(0.0, 0.0, 1.0),
                actuator=Actuator(),
            ),
        ),
        "controller": JointPD(kp=2e4, kd=600.0, sample_time=0.0),
        "reference": Reference(duration=6.0, sample_rate=100.0, joints=(move,)),
    }
    return Robot.model_validate({**given, **changes})


def _boom(speed: float = 0.0) -> Robot:
    """The free flyer with a flexible link; or one that spins on a heavy hub in a weak transverse field."""
    beam = Beam(
        length=1.2,
        section=Tube(outer_diameter=0.02, inner_diameter=0.018),
        young=70e9,
        shear=27e9,
        density=2700.0,
        elements=8,
        modes=2,
        damping_ratio=0.01,
        tip=TipBody(mass=1.0),
    )
    if not speed:
        return _flyer(links=(Link(name="link1", beam=beam),))
    hub = Joint(name="joint1", parent="base", child="link1", initial_velocity=speed)
    return _flyer(
        gravity=(0.0, 0.0, -0.5),
        base=Base(),
        links=(Link(name="link1", mass=1.0, inertia=(1e6, 1e6, 1e6), beam=beam),),
        joints=(hub,),
        controller={"kind": "none"},
        reference=Reference(duration=3.0, sample_rate=200.0),
    )


def _friction(effect: str, **values: float) -> EffectUse:
    return EffectUse.model_validate({"effect": effect, "at": "joint1", **values})


_DRY = {"coulomb_torque": 3.0, "static_torque": 5.0, "stribeck_velocity": 0.1}
_BY_SPEED: dict[str, Any] = {"kind": "residual", "robot": _arm(), "over": "velocity"}
_BY_PLACE: dict[str, Any] = {"kind": "residual", "robot": _arm(), "over": "position"}
_IN_TIME: dict[str, Any] = {"kind": "residual", "robot": _arm()}
_GEAR: dict[str, Any] = {
    "kind": "twist",
    "robot": _arm(gravity=(0.0, 0.0, 0.0)),
    "over": "torque",
    "span": (2.0, 8.0),
}
_RATE: dict[str, Any] = {"kind": "channel", "robot": _flyer(), "at": "base"}
_SENSOR: dict[str, Any] = {"kind": "error", "robot": _arm(), "at": "joint1.position"}

#: By effect.
CASES: Mapping[str, Case] = {
    "viscous_friction": Case(**_BY_SPEED, values={"coefficient": 3.0}),
    "quadratic_drag": Case(**_BY_SPEED, values={"coefficient": 1.0}),
    "coulomb_friction": Case(**_BY_SPEED, values={"torque": 3.0}),
    "stribeck_friction": Case(**_BY_SPEED, values=_DRY),
    "lugre_friction": Case(**_BY_SPEED, values={**_DRY, "bristle_stiffness": 2e3, "bristle_damping": 10.0}),
    "asymmetric_friction": Case(**_BY_SPEED, values={"coulomb_difference": 1.0, "viscous_difference": 0.5}),
    "load_dependent_friction": Case(**_IN_TIME, values={"coefficient": 0.1, "gear_share": 0.05}),
    "position_dependent_friction": Case(**_BY_PLACE, values={"cosine": 1.0, "sine": 0.5, "order": 12.0}),
    "temperature_dependent_friction": Case(
        **_BY_SPEED,
        values={"rate": 0.03, "reference_temperature": 283.15},
        beside=(_friction("viscous_friction", coefficient=2.0), _friction("coulomb_friction", torque=3.0)),
    ),
    "joint_elasticity": Case(**_GEAR, values={"stiffness": 5e3, "damping": 5.0}),
    "backlash": Case(**_GEAR, values={"half_width": 5e-4, "stiffness": 5e3, "damping": 5.0}),
    "gear_hysteresis": Case(
        **_GEAR, values={"torque": 1.0, "travel": 1e-4, "stiffness": 5e3, "damping": 5.0}
    ),
    "cable_spring": Case(**_BY_PLACE, values={"stiffness": 2.0, "torque_at_zero": 0.5}),
    "end_stop": Case(**_BY_PLACE, values={"stiffness": 200.0, "position": 0.4}),
    "torque_ripple": Case(
        **_BY_PLACE, values={"cosine": 0.5, "sine": 0.0, "cosine_per_torque": 0.03, "order": 25.0}
    ),
    "torque_gain": Case(kind="residual", robot=_arm(), over="torque", values={"gain_error": 0.05}),
    "torque_offset": Case(**_BY_SPEED, values={"torque": 1.0}),
    "torque_saturation": Case(
        kind="residual", robot=_arm(gravity=(0.0, 0.0, 0.0)), over="torque", values={"limit": 2.5}
    ),
    "actuator_lag": Case(**_IN_TIME, span=(2.0, 8.0), values={"time_constant": 0.01}),
    "external_torque": Case(**_IN_TIME, values={"torque": 4.0, "start": 3.0, "duration": 1.0}),
    "payload": Case(**{**_IN_TIME, "at": "link1"}, span=(0.5, 8.0), values={"mass": 0.5, "x": 0.6}),
    "inertia": Case(
        kind="residual",
        robot=_arm(gravity=(0.0, 0.0, 0.0)),
        at="link1",
        over="acceleration",
        values={"inertia_yy": 0.04, "inertia_zz": 0.04},
    ),
    "gravity": Case(**{**_BY_PLACE, "at": "base"}, values={"x": 1.0}),
    "link_flexibility": Case(
        kind="channel",
        robot=_flyer(),
        at="link1",
        values={"period": 0.8},
        channel="base.angular_velocity.z",
    ),
    "modal_damping": Case(
        kind="channel",
        robot=_boom(),
        at="link1",
        values={"damping_ratio": 0.03},
        channel="link1.tip_deflection.y",
    ),
    "centrifugal_stiffening": Case(
        kind="channel",
        robot=_boom(12.0),
        at="link1",
        values={"strength": 1.0},
        channel="link1.tip_deflection.z",
    ),
    "contact": Case(
        kind="channel",
        robot=_flyer(),
        at="link1",
        values={
            "stiffness": 1e5,
            "offset": -0.3,
            "damping": 0.2,
            "normal_y": -1.0,
            "normal_z": 0.0,
            "x": 1.2,
        },
        channel="robot.linear_momentum.y",
    ),
    "base_motion": Case(
        kind="channel",
        robot=_flyer(base=Base()),
        at="base",
        values={"compliance": 2e-4, "arm": 0.4, "mass": 60.0, "inertia": 8.0},
        channel="joint1.torque",
    ),
    "slosh": Case(
        **_RATE,
        values={"mass": 15.0, "frequency": 0.6, "damping_ratio": 0.02, "x": 0.2, "y": 0.3},
        channel="base.angular_velocity.z",
    ),
    "reaction_wheel": Case(**_RATE, values={"momentum_x": 2.0}, channel="base.angular_velocity.y"),
    "sensor_offset": Case(**_SENSOR, values={"offset": 0.01}),
    "sensor_gain": Case(**_SENSOR, over="position", values={"gain_error": 0.02}),
    "encoder_eccentricity": Case(
        **_SENSOR, over="position", values={"cosine": 0.0, "sine": 1e-3, "order": 8.0}
    ),
    "sensor_delay": Case(**_SENSOR, over="velocity", values={"delay": 0.005}),
    "clock_drift": Case(**_SENSOR, values={"rate": 1e-3}),
}
