"""Robots of beams in free flight, under control and with friction, for tests of the closed loop."""

from __future__ import annotations

import numpy as np

from robot_model import Recording, Robot, load_robot

#: A link 1 of the shipped robot that bends as well, with the modes of a free body, so that joint 2 sits on a
#: node that moves and turns, and its own root does too.
INBOARD_BEAM = {
    "length": 5.0,
    "section": {"kind": "tube", "outer_diameter": 0.12, "inner_diameter": 0.11},
    "young": 70e9,
    "shear": 27e9,
    "density": 2700.0,
    "elements": 10,
    "modes": 5,
    "boundary": "free",
    "damping_ratio": 0.01,
}

FRICTION = (
    {"effect": "viscous_friction", "at": "joint1", "coefficient": 5.0},
    {"effect": "load_dependent_friction", "at": "joint1", "coefficient": 0.1, "gear_share": 0.0},
    {"effect": "coulomb_friction", "at": "joint2", "torque": 2.0},
)


def space_robot(duration: float, *, inboard: bool = False, **changes: object) -> Robot:
    """The shipped free-floating robot, every joint already moving; `inboard`: link 1 bends as well."""
    given = load_robot("flexible_space_robot").model_dump(exclude_none=True)
    for joint, speed in zip(given["joints"], (0.05, -0.08)):
        joint["initial_velocity"] = speed
    if inboard:
        given["links"] = ({"name": "link1", "beam": INBOARD_BEAM}, given["links"][1])
    waves = (("joint1", 0.3, 0.05), ("joint2", 0.4, 0.07))
    motions = [
        {"joint": joint, "kind": "multisine", "amplitudes": [size], "frequencies": [rate]}
        for joint, size, rate in waves
    ]
    reference = {"duration": duration, "sample_rate": 20.0, "joints": motions}
    return Robot.model_validate({**given, "sensors": (), "effects": (), "reference": reference, **changes})


def cantilever(**changes: object) -> Robot:
    """A steel beam on a locked base: a single link on a fixed joint; `changes` are the beam's."""
    beam = {
        "length": 2.0,
        "section": {"kind": "rectangle", "width": 0.02, "height": 0.01},
        "young": 210e9,
        "shear": 80e9,
        "density": 7800.0,
        "elements": 24,
        "modes": 12,
        "damping_ratio": 0.7,
        "tip": {"mass": 0.5},
        "gauges": [{"place": 0.0, "normal": [0.0, 1.0], "distance": 0.005}],
        **changes,
    }
    return Robot.model_validate(
        {
            "name": "cantilever",
            "gravity": (0.0, 0.0, -9.81),
            "links": [{"name": "link1", "beam": beam}],
            "joints": [{"name": "clamp", "kind": "fixed", "parent": "base", "child": "link1"}],
            "reference": {"duration": 10.0, "sample_rate": 10.0},
        }
    )


def axes(recording: Recording, name: str, which: str = "xyz") -> np.ndarray:
    """The columns of a vector channel, shape (N, len(which))."""
    return np.column_stack([recording[f"{name}.{axis}"] for axis in which])
