"""Effects that need more than a joint's torque to be described: gears, bending links, base, surroundings.

Relative to the robot and its motion, like `ranges`; credible sizes are those that the catalogue's pages name.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType

import numpy as np

from exudyn_model.control.motion import motions
from missing_physics.challenge.cases.ranges import Draw, Scale, bounded
from robot_model import EffectUse, Robot

__all__ = ["GEARS", "STRUCTURES"]

Values = Mapping[str, float]

#: A wall is met over so much of the way of the point that meets it [m].
DEPTHS = (0.004, 0.02)
#: Looks at the reference motion for where that point goes.
LOOKS = 600


def _use(effect: str, at: str, values: Values) -> EffectUse:
    return EffectUse.model_validate(
        {"effect": effect, "at": at, **{key: bounded(value) for key, value in values.items()}}
    )


def _elasticity(d: Draw, joint: str, s: Scale) -> EffectUse:
    """Winds up by a half to eight arc minutes under the largest torque."""
    stiffness = s.peak / d.decades(2e-4, 2.5e-3)
    damping = stiffness * d.decades(3e-4, 2e-3)
    return _use("joint_elasticity", joint, {"stiffness": stiffness, "damping": damping})


def _backlash(d: Draw, joint: str, s: Scale) -> EffectUse:
    """A third to five arc minutes of play, flanks that give little."""
    stiffness = s.peak / d.decades(2e-4, 6e-4)
    values = {"half_width": d.decades(1e-4, 1.5e-3), "stiffness": stiffness, "damping": 1e-3 * stiffness}
    return _use("backlash", joint, values)


def _hysteresis(d: Draw, joint: str, s: Scale) -> EffectUse:
    stiffness = s.peak / d.decades(5e-4, 2.5e-3)
    values = {
        "torque": s.peak * d.even(0.05, 0.2),
        "travel": d.decades(1e-4, 5e-4),
        "stiffness": stiffness,
        "damping": 6e-4 * stiffness,
    }
    return _use("gear_hysteresis", joint, values)


#: Effects of a gear, which show between an encoder at the motor and one at the joint.
GEARS: Mapping[str, Callable[[Draw, str, Scale], EffectUse]] = MappingProxyType(
    {"joint_elasticity": _elasticity, "backlash": _backlash, "gear_hysteresis": _hysteresis}
)


def _link_flexibility(d: Draw, robot: Robot) -> EffectUse:
    """A first mode at 4 to 25 Hz, damped as metal or as a link with joints in it."""
    link = robot.links[int(d.chance.integers(len(robot.links)))].name
    values = {"period": d.decades(0.04, 0.25), "damping_ratio": d.decades(0.005, 0.03)}
    return _use("link_flexibility", link, values)


def _modal_damping(d: Draw, robot: Robot) -> EffectUse:
    link = next(link.name for link in robot.links if link.flexible)
    return _use("modal_damping", link, {"damping_ratio": d.decades(0.01, 0.1)})


def _base_motion(d: Draw, robot: Robot) -> EffectUse:
    values = {
        "compliance": d.decades(2e-6, 5e-5),
        "arm": d.even(0.3, 0.8),
        "damping": d.decades(5e-4, 5e-3),
        "mass": d.even(20.0, 80.0),
        "inertia": d.even(2.0, 12.0),
    }
    return _use("base_motion", "base", values)


def _contact(d: Draw, robot: Robot) -> EffectUse:
    """A level wall under the tip of the planar arm, met at the lowest points of its way."""
    lower, upper = robot.joints[1].origin[0], 2 * robot.links[1].center_of_mass[0]
    goals = motions(robot)
    assert robot.reference is not None
    times = np.linspace(1.0, robot.reference.duration, LOOKS)
    angles = np.array([[motion(float(t))[0] for motion in goals] for t in times])
    height = lower * np.sin(angles[:, 0]) + upper * np.sin(angles.sum(1))
    depth = d.even(*DEPTHS)
    values = {
        "stiffness": d.even(20.0, 80.0) / depth**1.5,
        "offset": float(height.min()) + depth,
        "damping": d.even(0.1, 0.5),
        "x": upper,
    }
    return _use("contact", robot.links[1].name, values)


def _slosh(d: Draw, robot: Robot) -> EffectUse:
    values = {
        "mass": robot.base.mass * d.even(0.03, 0.12),
        "frequency": d.decades(0.2, 1.0),
        "damping_ratio": d.decades(0.005, 0.05),
        "x": d.even(-0.3, 0.3),
        "z": d.even(-0.3, 0.3),
    }
    return _use("slosh", "base", values)


def _reaction_wheel(d: Draw, robot: Robot) -> EffectUse:
    values = {f"momentum_{axis}": d.sign() * d.decades(1.0, 8.0) for axis in "xyz"}
    values |= {f"torque_{axis}": d.sign() * d.decades(0.02, 0.2) for axis in "xyz"}
    return _use("reaction_wheel", "base", values)


#: Effects of links, base and surroundings; each fits the robots that name it in `robots.ROBOTS`.
STRUCTURES: Mapping[str, Callable[[Draw, Robot], EffectUse]] = MappingProxyType(
    {
        "link_flexibility": _link_flexibility,
        "modal_damping": _modal_damping,
        "base_motion": _base_motion,
        "contact": _contact,
        "slosh": _slosh,
        "reaction_wheel": _reaction_wheel,
    }
)
