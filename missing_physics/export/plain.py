"""A robot's parameters as JSON, for a user's own simulator."""

from __future__ import annotations

import json
import math

from missing_physics.export.content import Content

__all__ = ["json_of"]


def json_of(content: Content) -> str:
    """Bodies, joints, motors of transmissions, and effects in none of these; units as in `Content`."""
    document = {
        "robot": content.robot.name,
        "gravity": content.gravity.tolist(),
        "bodies": {
            name: {
                "mass": body.mass,
                "center_of_mass": body.centre.tolist(),
                "inertia": body.inertia.tolist(),
            }
            for name, body in content.bodies.items()
        },
        "joints": {
            name: {key: value if math.isfinite(value) else None for key, value in vars(joint).items()}
            for name, joint in content.joints.items()
        },
        "motors": {
            name: {key: value if math.isfinite(value) else None for key, value in vars(motor).items()}
            for name, motor in content.motors.items()
        },
        "transmissions": [
            {
                "joints": list(one.joints),
                "motors": [motor.name for motor in one.motors],
                "joints_from_motors": one.joints_from_motors.tolist(),
            }
            for one in content.robot.transmissions
        ],
        "effects": [{"effect": use.effect, "at": use.at, **use.parameters} for use in content.left],
    }
    return json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False) + "\n"
