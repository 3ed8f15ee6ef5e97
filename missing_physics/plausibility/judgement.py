"""Whether an effect's parameters are credible for this robot and recording."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from missing_physics.plausibility.table import SATURATION, credible_range
from reference_model.effects.gravity import TILT
from robot_model import Robot

__all__ = ["NOT_CREDIBLE", "implausible"]

#: Prefix of every reason, which distinguishes effects that are not credible from those that data refute.
NOT_CREDIBLE = "it is not credible"


def implausible(
    effect: str, place: str, values: Mapping[str, float], robot: Robot, *, needed: float = 0.0
) -> str:
    """Why these values are not credible, as a clause; empty if they are.

    Args:
        effect, place: as in a robot file.
        values: its parameters.
        robot: nominal.
        needed: largest torque that the recorded motion required at the joint [N m or N], 0 if not known.
    """
    for name, value in values.items():
        row = credible_range(effect, name, place)
        if row is not None and not row.low <= value <= row.high:
            return f"{NOT_CREDIBLE}: {name} of {value:.3g}{_unit(row.unit)}, while {row.reason}"
    if effect == "gravity":
        return _gravity(values, robot)
    if effect == "torque_saturation" and values["limit"] < SATURATION * needed:
        return (
            f"{NOT_CREDIBLE}: a limit of {values['limit']:.3g}, while the recorded motion needed a torque of "
            f"{needed:.3g}"
        )
    return ""


def _gravity(values: Mapping[str, float], robot: Robot) -> str:
    """Why gravity is not credible: on the ground its magnitude is known; in orbit any gravity is credible.

    Gravity along the file's direction is confounded with the masses, so only a small change is credible
    there.
    """
    file = np.asarray(robot.gravity)
    size = float(np.linalg.norm(file))
    if size == 0.0 or robot.base.kind == "free":
        return ""
    change = np.array([values.get(axis, 0.0) for axis in "xyz"])
    along = float(change @ file) / size
    across = float(np.linalg.norm(change - along * file / size))
    whole = float(np.linalg.norm(file + change))
    if abs(whole - size) <= TILT * size or (abs(along) <= TILT * size and across <= size):
        return ""
    return f"{NOT_CREDIBLE}: gravity of {whole:.4g} m/s^2, while on the ground it is 9.81 m/s^2"


def _unit(unit: str) -> str:
    return "" if unit == "-" else f" {unit}"
