"""`Recording`: measured or simulated data, as named channels over time.

It is next to the robot description because both engines return it, every reader makes it and every diagnosis
reads it, while `robot_model` imports no other package: this avoids circular imports.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike, NDArray

from robot_model.input.errors import InputError, nearest

__all__ = ["QUANTITIES", "Recording", "unit_of"]

#: Unit of every quantity a native channel name may end in. `position`, `velocity`, `torque` and their
#: kin are rad, rad/s, N m for a revolute joint and m, m/s, N for a prismatic one.
QUANTITIES: Mapping[str, str] = MappingProxyType(
    {
        "position": "rad",
        "velocity": "rad/s",
        "acceleration": "rad/s^2",
        "torque": "N m",
        "current": "A",
        "voltage": "V",
        "reference_position": "rad",
        "reference_velocity": "rad/s",
        "motor_position": "rad",
        "motor_velocity": "rad/s",
        "temperature": "K",
        "radial_force": "N",
        "axial_force": "N",
        "bending_moment": "N m",
        "load_moment": "N m",
        "friction_torque": "N m",
        "gear_torque": "N m",
        "bristle": "-",
        "sticking": "-",
        "attitude": "-",
        "angular_velocity": "rad/s",
        "linear_velocity": "m/s",
        "linear_acceleration": "m/s^2",
        "control_force": "N",
        "control_torque": "N m",
        "tip_acceleration": "m/s^2",
        "tip_deflection": "m",
        "strain": "-",
        "modal_coordinate": "sqrt(kg) m",
        "contact_force": "N",
        "friction_power": "W",
        "armature_power": "W",
        "friction_energy": "J",
        "armature_energy": "J",
        "energy": "J",
        "work": "J",
        "linear_momentum": "N s",
        "angular_momentum": "N m s",
        "loop_residual": "-",
    }
)

_PRISMATIC = {"rad": "m", "rad/s": "m/s", "rad/s^2": "m/s^2", "N m": "N"}


def unit_of(channel: str, *, prismatic: bool = False) -> str:
    """Unit of a native channel, e.g. ``unit_of("joint1.torque")`` is ``"N m"``.

    Args:
        channel: ``PLACE.QUANTITY[.AXIS]``, or ``time``.
        prismatic: the place is a prismatic joint, so that angles are lengths and torques are forces.

    Returns:
        The unit, or ``"-"`` when the quantity is not a native one. ``base.position`` is in m.
    """
    if channel == "time":
        return "s"
    parts = channel.split(".")
    unit = QUANTITIES.get(parts[1] if len(parts) > 1 else "", "-")
    linear = prismatic or (parts[0] == "base" and len(parts) > 1 and parts[1] == "position")
    return _PRISMATIC.get(unit, unit) if linear else unit


def _frozen(values: ArrayLike, what: str) -> NDArray[np.float64]:
    try:
        array = np.array(values, dtype=np.float64)
    except (TypeError, ValueError):
        raise InputError(f"{what} holds something that is no number.") from None
    if array.ndim != 1:
        raise InputError(f"{what} has {array.ndim} dimensions; a channel is one column of numbers.")
    array.flags.writeable = False
    return array


@dataclass(frozen=True)
class Recording:
    """Named channels in SI units over one time base.

    Attributes:
        time: sample instants [s], shape (N,), strictly increasing; the spacing may vary.
        channels: native name (``joint1.position``) to values, shape (N,); NaN marks a sample that is
            missing in this channel.
        source: where it came from, for people.
        noise: standard deviation of the white noise of a channel, in its unit, where known.
        resolution: smallest step of a channel, in its unit, where known.
        left_out: omitted content of the file and the reason, as a clause for people; empty if complete.

    Arrays are copied and made read-only. Raises `InputError` when lengths differ or time does not rise.
    """

    time: NDArray[np.float64]
    channels: Mapping[str, NDArray[np.float64]]
    source: str = ""
    noise: Mapping[str, float] = field(default_factory=dict)
    resolution: Mapping[str, float] = field(default_factory=dict)
    left_out: str = ""

    def __post_init__(self) -> None:
        time = _frozen(self.time, "time")
        if time.size and not np.all(np.isfinite(time)):
            row = int(np.flatnonzero(~np.isfinite(time))[0])
            raise InputError(f"time is not a number at row {row} of {self.source or 'the recording'}.")
        steps = np.diff(time)
        if steps.size and steps.min() <= 0:
            row = int(np.argmin(steps > 0)) + 1
            raise InputError(
                f"time does not rise at row {row} of {self.source or 'the recording'} "
                f"({time[row - 1]:.9g} s is followed by {time[row]:.9g} s)."
            )
        channels: dict[str, NDArray[np.float64]] = {}
        for name, values in self.channels.items():
            column = _frozen(values, name)
            if column.size != time.size:
                raise InputError(f"{name} has {column.size} samples but time has {time.size}.")
            channels[name] = column
        object.__setattr__(self, "time", time)
        object.__setattr__(self, "channels", MappingProxyType(channels))
        object.__setattr__(self, "noise", MappingProxyType(dict(self.noise)))
        object.__setattr__(self, "resolution", MappingProxyType(dict(self.resolution)))

    def __getitem__(self, channel: str) -> NDArray[np.float64]:
        try:
            return self.channels[channel]
        except KeyError:
            hint = nearest(channel, self.channels)
            raise InputError(f"{self.source or 'the recording'} has no channel '{channel}'{hint}.") from None

    def __contains__(self, channel: object) -> bool:
        return channel in self.channels

    def __iter__(self) -> Iterator[str]:
        return iter(self.channels)

    def __len__(self) -> int:
        return int(self.time.size)

    @property
    def duration(self) -> float:
        """Last minus first instant [s]; 0 for fewer than two samples."""
        return float(self.time[-1] - self.time[0]) if self.time.size > 1 else 0.0

    @property
    def sample_rate(self) -> float:
        """Median rate [Hz]; NaN for fewer than two samples."""
        return float(1.0 / np.median(np.diff(self.time))) if self.time.size > 1 else float("nan")

    def same_values(self, other: Recording) -> bool:
        """Whether `other` holds the same samples of the same channels, whatever its initial time."""
        return self.channels.keys() == other.channels.keys() and all(
            np.array_equal(values, other.channels[name], equal_nan=True)
            for name, values in self.channels.items()
        )

    def window(self, start: float, stop: float) -> Recording:
        """The samples with ``start <= time < stop`` [s]."""
        keep = (self.time >= start) & (self.time < stop)
        return replace(
            self, time=self.time[keep], channels={name: y[keep] for name, y in self.channels.items()}
        )

    def with_channels(self, channels: Mapping[str, ArrayLike]) -> Recording:
        """A copy in which `channels` are added or replaced."""
        added = {name: np.asarray(values, dtype=np.float64) for name, values in channels.items()}
        return replace(self, channels={**self.channels, **added})
