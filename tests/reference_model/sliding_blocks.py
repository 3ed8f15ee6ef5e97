"""Blocks that slide with dry friction, for tests with closed forms."""

from __future__ import annotations

from robot_model import Robot

GRAVITY = 9.81
MASS = 2.0


def on_load(joint: str, kinetic: float, static: float | None = None, velocity: float = 1e-3) -> dict:
    """Friction in proportion to the bearing load alone."""
    return {
        "effect": "stribeck_friction",
        "at": joint,
        "coulomb_torque": 0.0,
        "static_torque": 0.0,
        "stribeck_velocity": velocity,
        "load_coefficient": kinetic,
        "load_static_coefficient": kinetic if static is None else static,
    }


def of_torque(joint: str, kinetic: float, static: float | None = None, velocity: float = 1e-3) -> dict:
    """Friction of a constant level."""
    return {
        "effect": "stribeck_friction",
        "at": joint,
        "coulomb_torque": kinetic,
        "static_torque": kinetic if static is None else static,
        "stribeck_velocity": velocity,
    }


def block(
    *effects: dict,
    tilt: float = 0.0,
    velocity: float = 0.0,
    duration: float = 2.0,
    rate: float = 100.0,
    **more,
) -> Robot:
    """A block on a plane that falls by `tilt` [rad] in the direction of the joint."""
    reference = {"duration": duration, "sample_rate": rate, "joints": more.pop("motion", ())}
    return Robot.model_validate(
        {
            "name": "block",
            "gravity": (0.0, 0.0, -GRAVITY),
            "links": [{"name": "body", "mass": MASS}],
            "joints": [
                {
                    "name": "slide",
                    "kind": "prismatic",
                    "parent": "base",
                    "child": "body",
                    "rpy": (0.0, tilt, 0.0),
                    "axis": (1.0, 0.0, 0.0),
                    "initial_velocity": velocity,
                    "bearing": {"radial_arm": 1.0},
                    "actuator": {},
                }
            ],
            "effects": effects,
            "reference": reference,
            **more,
        }
    )


def ramp(joint: str, speed: float, duration: float) -> dict:
    """A reference that rises evenly from 0."""
    times = [duration * k / 4 for k in range(5)]
    return {"joint": joint, "kind": "table", "times": times, "positions": [speed * t for t in times]}
