"""Finds the physics that a robot's simulation leaves out: locates, names, models and proves it.

    import missing_physics as mp

    robot = mp.load_robot("arm.urdf", overlay="drive.toml")
    log = mp.load_recording("run1.csv", map="map.toml")
    answer = mp.diagnose(robot, log, validate=mp.load_recording("run2.csv", map="map.toml"))
    print(answer.summary())
    answer.save("out")

Everything is loaded when it is first used, so that the import itself takes no time.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from missing_physics.api import (
        Answer,
        Inspection,
        diagnose,
        inspect,
        load_recording,
        load_robot,
        simulate,
    )
    from robot_model import InputError, Recording, Robot

__all__ = [
    "Answer",
    "InputError",
    "Inspection",
    "Recording",
    "Robot",
    "diagnose",
    "inspect",
    "load_recording",
    "load_robot",
    "simulate",
]

#: Names that come from the robot's description.
_DESCRIBED = ("InputError", "Recording", "Robot")


def __getattr__(name: str) -> Any:
    """A public name, loaded with what it needs."""
    if name not in __all__:
        raise AttributeError(f"module 'missing_physics' has no attribute '{name}'")
    if name in _DESCRIBED:
        import robot_model

        return getattr(robot_model, name)
    from missing_physics import api

    return getattr(api, name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
