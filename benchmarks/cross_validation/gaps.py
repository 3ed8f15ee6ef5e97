"""Differences of two recordings of one motion, absolute and relative to their range."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from exudyn_model import simulate as exudyn_simulate
from reference_model.simulation import simulate as reference_simulate
from robot_model import Recording, Robot

__all__ = [
    "Gap",
    "by_quantity",
    "extrapolated",
    "exudyn_run",
    "gaps",
    "reference_run",
]

#: Tolerances of the reference run. The error of CVODES is then 1e-12 to 1e-11 of a channel's range.
TIGHT = {"rtol": 1e-13, "atol": 1e-15}
#: A range below this fraction of the largest value, or of 1, is rounding: no relative difference is given.
FLAT = 1e-9
#: The same in SI units for quantities that may be constant, where a range is an engine's error.
HELD = 1e-5
KEPT = (
    *("position", "attitude", "velocity", "linear_velocity", "angular_velocity", "linear_acceleration"),
    *("linear_momentum", "angular_momentum"),
)
#: Channels that both engines compute from the same formula of time: no dynamics in them.
GIVEN = ("reference_position", "reference_velocity")


@dataclass(frozen=True)
class Gap:
    """Difference of two recordings in one quantity of one place, over all its axes.

    Attributes:
        place, quantity: as in the channel's name.
        largest: of the difference, in the channel's unit.
        extent: largest range of its axes, in the channel's unit; 0 for constant channels.
    """

    place: str
    quantity: str
    largest: float
    extent: float

    @property
    def relative(self) -> float | None:
        """Largest difference over the range; None for constant channels."""
        return self.largest / self.extent if self.extent > 0 else None


def gaps(reference: Recording, other: Recording) -> list[Gap]:
    """Gaps of every quantity in both recordings, without reference and given channels."""
    groups: dict[tuple[str, str], list[str]] = {}
    for channel in (name for name in reference if name in other):
        place, quantity = channel.split(".")[:2]
        if quantity not in GIVEN:
            groups.setdefault((place, quantity), []).append(channel)
    found = []
    for (place, quantity), channels in groups.items():
        ours, theirs = (np.array([run[name] for name in channels]) for run in (reference, other))
        gap = np.abs(theirs - ours)
        extent, size = float(np.ptp(ours, axis=1).max()), float(np.abs(ours).max())
        extent = extent if extent > max(FLAT * max(size, 1.0), HELD if quantity in KEPT else 0.0) else 0.0
        found.append(Gap(place, quantity, float(gap.max()), extent))
    return found


def extrapolated(coarse: Recording, fine: Recording) -> Recording:
    """Limit of two runs of a second-order method, the second at half the step (Richardson 1911)."""
    channels = {name: fine[name] + (fine[name] - coarse[name]) / 3 for name in fine}
    return Recording(fine.time, channels, source=fine.source)


def by_quantity(found: Iterable[Gap]) -> Mapping[str, float]:
    """Largest relative difference of each quantity over all places."""
    result: dict[str, float] = {}
    for gap in found:
        if gap.relative is not None:
            result[gap.quantity] = max(result.get(gap.quantity, 0.0), gap.relative)
    return result


def reference_run(robot: Robot, **settings: float) -> Recording:
    """The reference model's recording, without sensors."""
    return reference_simulate(robot, sensors=False, **{**TIGHT, **settings})


def exudyn_run(robot: Robot, **settings: object) -> Recording:
    """Exudyn's recording, without sensors."""
    return exudyn_simulate(robot, sensors=False, **settings)  # type: ignore[arg-type]
