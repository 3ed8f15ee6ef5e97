"""An arm with encoders on both sides of its gears, and a torque diagnosis without findings."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from missing_physics.motion.inverse import MotionDynamics
from missing_physics.motion.recorded import make_dynamics
from missing_physics.results.result import ChannelFit, Diagnosis, Errors, Fit, Mismatch, Result
from robot_model import Recording, Robot, load_robot, robot_to_toml


def arm(*effects: dict[str, Any], gravity: bool = True, **changes: Any) -> Robot:
    """The shipped arm with encoders at joints and motors."""
    data = load_robot("two_link_arm").model_dump()
    data["gravity"] = data["gravity"] if gravity else (0.0, 0.0, 0.0)
    sensors = [s for s in data["sensors"] if s["channel"].endswith(".torque")]
    for joint in ("joint1", "joint2"):
        for quantity in ("position", "motor_position"):
            sensors.append({"channel": f"{joint}.{quantity}", "noise": 5e-6, "resolution": 1e-6})
    data["sensors"] = sensors
    data["reference"] |= {"duration": 10.0, **changes}
    data["effects"] = [*data["effects"], *effects]
    return Robot.model_validate(data)


def half_open(*mismatch: Mismatch, left: float = 2.0, verdict: str = "unexplained") -> Result:
    """A diagnosis of torques that names nothing; `left` of the torque's error over its noise."""
    errors = Errors(left, left)
    fit = Fit({"joint1.torque": ChannelFit("N m", errors, errors, 1.0)}, 0.0)
    diagnosis = Diagnosis("arm", ("one",), (), verdict, "", mismatch, (), fit)  # type: ignore[arg-type]
    return Result(diagnosis, (), (), robot_to_toml(arm()))


def along_each(robot: Robot, recordings: Sequence[Recording]) -> tuple[MotionDynamics, ...]:
    """Motion and dynamics of `robot` along each recording."""
    return make_dynamics(robot, recordings)
