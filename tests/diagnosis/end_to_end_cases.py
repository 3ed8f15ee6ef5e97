"""Robots and hidden effects of the end-to-end tests."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from missing_physics.diagnosis import Options
from robot_model import EffectUse, Robot, load_robot

__all__ = ["ARM", "AXIS", "CASES", "FRICTION", "QUICK", "Case", "otherwise", "shortened", "within"]


def shortened(name: str, *, duration: float, rate: float) -> Robot:
    robot = load_robot(name)
    assert robot.reference is not None
    reference = robot.reference.model_copy(update={"duration": duration, "sample_rate": rate})
    return robot.model_copy(update={"reference": reference})


ARM = shortened("two_link_arm", duration=20.0, rate=250.0)
AXIS = shortened("single_axis", duration=16.0, rate=500.0)


FRICTION = EffectUse(effect="coulomb_friction", at="joint1", torque=30.0)


def otherwise(robot: Robot, factor: float = 0.7) -> Robot:
    """The robot with a slower reference."""
    assert robot.reference is not None
    joints = tuple(
        j.model_copy(update={"frequencies": tuple(factor * f for f in j.frequencies)})  # type: ignore[union-attr]
        for j in robot.reference.joints
    )
    return robot.model_copy(update={"reference": robot.reference.model_copy(update={"joints": joints})})


@dataclass(frozen=True)
class Case:
    """A hidden effect, what else the robot has and is known to have, and what shall be found of it.

    Attributes:
        identified: parameters whose true values shall be inside their intervals.
        twins: other labels that are the same along these motions.
        improvement: least fall of the held-out error that shows that it was modelled.
    """

    effect: str
    at: str
    parameters: Mapping[str, float]
    improvement: float
    known: tuple[EffectUse, ...] = ()
    identified: tuple[str, ...] = field(default=())
    twins: tuple[str, ...] = ()

    @property
    def hidden(self) -> EffectUse:
        return EffectUse(effect=self.effect, at=self.at, **self.parameters)


DRY = EffectUse(effect="coulomb_friction", at="joint1", torque=2.0)
#: The least improvement is a third of what the true model reaches with seed 1, as the noise allows.
CASES = {
    "coulomb": Case("coulomb_friction", "joint1", {"torque": 3.0}, 0.8, identified=("torque",)),
    "stribeck": Case(
        "stribeck_friction",
        "joint2",
        {"coulomb_torque": 2.0, "static_torque": 3.5, "stribeck_velocity": 0.1},
        0.8,
        identified=("coulomb_torque", "static_torque", "stribeck_velocity"),
    ),
    "spring": Case(
        "cable_spring",
        "joint1",
        {"stiffness": 4.0, "torque_at_zero": 1.0},
        0.8,
        identified=("stiffness", "torque_at_zero"),
    ),
    "ripple": Case(
        "torque_ripple",
        "joint2",
        {"cosine": 0.5, "sine": 0.3, "cosine_per_torque": 0.0, "sine_per_torque": 0.0, "order": 80.0},
        0.7,
        identified=("cosine", "sine", "order"),
    ),
    "asymmetric": Case(
        "asymmetric_friction",
        "joint1",
        {"coulomb_difference": 0.5, "viscous_difference": 0.4},
        0.7,
        identified=("coulomb_difference", "viscous_difference"),
    ),
    "lag": Case("actuator_lag", "joint1", {"time_constant": 0.005}, 0.4, identified=("time_constant",)),
    "delay": Case("sensor_delay", "joint2.position", {"delay": 0.004}, 0.15, identified=("delay",)),
    "by position": Case(
        "position_dependent_friction",
        "joint1",
        {"cosine": 0.4, "sine": 0.2, "order": 5.0},
        0.5,
        known=(DRY,),
        identified=("cosine", "sine", "order"),
    ),
    "by load": Case(
        "load_dependent_friction",
        "joint1",
        {"coefficient": 0.0, "gear_share": 0.04},
        0.8,
        known=(DRY,),
        identified=("gear_share",),
    ),
    "payload": Case("payload", "link2", {"mass": 0.6, "x": 0.4, "y": 0.0, "z": 0.0}, 0.9),
    "torque gain": Case(
        "torque_gain",
        "joint1",
        {"gain_error": 0.05},
        0.8,
        twins=("sensor_gain@joint1.torque", "sensor_gain@joint2.torque", "torque_gain@joint2"),
    ),
    "torque sensor delay": Case(
        "sensor_delay",
        "joint1.torque",
        {"delay": 0.005},
        0.4,
        identified=("delay",),
        twins=("actuator_lag@joint2",),
    ),
    "torque sensor clock": Case("clock_drift", "joint2.torque", {"rate": 7e-4}, 0.2, identified=("rate",)),
}
QUICK = Options(experiments=False)


def within(estimate: Any, true: float) -> bool:
    """Inside the interval, widened by half: of 20 honest intervals one misses, but none by so much."""
    low, high = estimate.ci95
    return bool(abs(true - (low + high) / 2) <= 0.75 * (high - low))
