"""Units of positions and velocities, inferred from ranges and from the derivatives of positions."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from missing_physics.recordings import position_per_velocity
from robot_model import Drive

__all__ = ["Ratio", "angle_unit", "ratio_of", "velocity_unit"]

#: Largest |log| of a ratio relative to a known one, and smallest correlation.
TOLERANCE, CORRELATED = 0.06, 0.9
#: Factor by which a joint's range may be exceeded.
SLACK = 1.2
#: Two turns; few joints move further [rad].
TWO_TURNS = 4.0 * math.pi
#: Units of position by their size in rad or m; of velocity in rad/s or m/s.
POSITIONS = {False: {"rad": 1.0, "deg": math.pi / 180, "rev": 2 * math.pi}, True: {"m": 1.0, "mm": 1e-3}}
VELOCITIES = {
    False: {"rad/s": 1.0, "deg/s": math.pi / 180, "rpm": math.pi / 30, "rev/s": 2 * math.pi},
    True: {"m/s": 1.0, "mm/s": 1e-3},
}

Array = NDArray[np.float64]


class Ratio(NamedTuple):
    """Change of a position per integral of a velocity, in the log's units, and their correlation."""

    value: float
    correlation: float

    @property
    def is_integral(self) -> bool:
        """Whether the position is the integral of the velocity, up to a factor."""
        return abs(self.correlation) > CORRELATED


def ratio_of(time: Array, position: Array, velocity: Array) -> Ratio:
    """The ratio for columns of shape (N,) over instants [s]."""
    return Ratio(*position_per_velocity(time, position, velocity))


def angle_unit(joint: Drive, values: Array) -> tuple[str, str, bool]:
    """Unit of a position, the reason (empty if not known), and whether it is certain."""
    slides = joint.kind == "prismatic"
    plain, other = list(POSITIONS[slides])[:2]
    size = POSITIONS[slides][other]
    low, high = float(np.nanmin(values)), float(np.nanmax(values))
    spans = f"it spans {low:.4g} to {high:.4g}"
    if joint.position_limits is not None:
        first, last = joint.position_limits
        reach = SLACK * max(abs(first), abs(last))
        if max(abs(low), abs(high)) > reach:
            if max(abs(low), abs(high)) * size <= reach:
                return other, f"{spans}, beyond the joint's {first:.4g} to {last:.4g} {plain}", True
            return plain, "", True
    elif not slides and high - low > TWO_TURNS and (high - low) * size < TWO_TURNS:
        return other, f"{spans}, which few joints reach in radians", False
    return plain, "", True


def velocity_unit(ratio: Ratio, position_size: float, *, slides: bool) -> str:
    """Unit of a velocity whose integral is a position of known unit; empty if none fits."""
    if not ratio.is_integral:
        return ""
    wanted = abs(ratio.value) * position_size
    fits = (unit for unit, size in VELOCITIES[slides].items() if abs(math.log(wanted / size)) < TOLERANCE)
    return next(fits, "")
