"""Serial chains of any length, for the cost against the number of links."""

from __future__ import annotations

import math
from typing import Any

from robot_model import Robot

__all__ = ["chain"]

#: Length [m], mass [kg] and moments of inertia [kg m^2] of a rigid link.
LENGTH, MASS, SLENDER, THICK = 0.5, 2.0, 0.01, 0.05
#: Modes of a flexible link.
MODES = 2


def chain(links: int, *, flexible: bool = False) -> Robot:
    """A chain on a fixed base in gravity, its revolute joints about y and z in turn, rigid or of beams."""
    names = [f"link{k}" for k in range(1, links + 1)]
    return Robot.model_validate(
        {
            "name": f"{'flexible' if flexible else 'rigid'}_chain_{links}",
            "gravity": (0.0, 0.0, -9.81),
            "links": [_link(name, flexible) for name in names],
            "joints": [
                {
                    "name": f"joint{k}",
                    "parent": names[k - 2] if k > 1 else "base",
                    "child": name,
                    "origin": (LENGTH if k > 1 else 0.0, 0.0, 0.0),
                    "rpy": (0.1, 0.2, math.pi / 7),
                    "axis": (0.0, 1.0, 0.0) if k % 2 else (0.0, 0.0, 1.0),
                    "actuator": {"gear_ratio": 50.0, "rotor_inertia": 2e-5},
                }
                for k, name in enumerate(names, start=1)
            ],
        }
    )


def _link(name: str, flexible: bool) -> dict[str, Any]:
    if not flexible:
        centre = (LENGTH / 2, 0.0, 0.0)
        return {"name": name, "mass": MASS, "center_of_mass": centre, "inertia": (SLENDER, THICK, THICK)}
    section = {"kind": "tube", "outer_diameter": 0.05, "inner_diameter": 0.04}
    return {
        "name": name,
        "beam": {
            "length": LENGTH,
            "section": section,
            "young": 70e9,
            "shear": 27e9,
            "density": 2700.0,
            "elements": 4,
            "modes": MODES,
        },
    }
