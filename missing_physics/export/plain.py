"""A robot's numbers as JSON, for a simulator of one's own."""

from __future__ import annotations

import json
import math

from missing_physics.export.content import Content

__all__ = ["json_of"]


def json_of(content: Content) -> str:
    """Gravity, bodies, joints, and effects that are in none of these numbers; units as in `Content`."""
    told = {
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
        "effects": [{"effect": use.effect, "at": use.at, **use.parameters} for use in content.left],
    }
    return json.dumps(told, indent=1, ensure_ascii=False, allow_nan=False) + "\n"
