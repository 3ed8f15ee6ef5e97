"""Measures of the friction study for one simulation."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, periodogram, sosfiltfilt

from benchmarks.friction.cases import JOINTS, Case, run
from robot_model import Recording

__all__ = ["Measures", "deflection", "error", "measures", "spectrum"]

Array = NDArray[np.float64]

#: Limit between the loop's own settling, at 0.16 Hz, and oscillation [Hz].
OSCILLATION = 0.5
#: Final interval over which a final value is averaged [s].
FINAL = 1.0


@dataclass(frozen=True)
class Measures:
    """Numbers of one simulation; by joint where they are mappings.

    Attributes:
        tracking: root mean square of reference minus position, whole run [rad].
        final: reference minus position over the last second [rad].
        shaking: root mean square of the tracking error above `OSCILLATION`, whole run [rad].
        vibration: root mean square of the tip's transverse deflection above `OSCILLATION` while the
            reference moves [m].
        residual: the same after the motion; of a manoeuvre without a hold, over the last half [m].
        peak: the tip's largest transverse deflection [m].
        friction, load: largest friction torque and bearing load W [N m].
        turned: final rotation of the base from its initial attitude [rad].
        momentum: largest total momentum of a run that starts at rest, linear [N s] and angular [N m s].
    """

    tracking: Mapping[str, float]
    final: Mapping[str, float]
    shaking: Mapping[str, float]
    vibration: float
    residual: float
    peak: float
    friction: Mapping[str, float]
    load: Mapping[str, float]
    turned: float
    momentum: tuple[float, float]


@cache
def measures(case: Case) -> Measures:
    """All of them; the simulation runs once."""
    found = run(case)
    tip = deflection(found)
    end = found.time > found.time[-1] - FINAL
    moving = found.time <= case.motion_end
    quick = _oscillation(found, tip)
    momenta = [_axes(found, f"robot.{kind}_momentum") for kind in ("linear", "angular")]
    return Measures(
        tracking={name: _rms(error(found, name)) for name in JOINTS},
        final={name: float(np.mean(error(found, name)[end])) for name in JOINTS},
        shaking={name: _rms(_oscillation(found, error(found, name))) for name in JOINTS},
        vibration=_size(quick[moving]),
        residual=_size(quick[_after(case, found)]),
        peak=float(np.linalg.norm(tip, axis=1).max()),
        friction={name: float(np.abs(found[f"{name}.friction_torque"]).max()) for name in JOINTS},
        load={name: float(found[f"{name}.load_moment"].max()) for name in JOINTS},
        turned=float(_angle(found)[-1]),
        momentum=tuple(float(np.linalg.norm(p, axis=1).max()) for p in momenta),  # type: ignore[arg-type]
    )


def error(found: Recording, joint: str) -> Array:
    """Reference minus position [rad], shape (N,)."""
    return found[f"{joint}.reference_position"] - found[f"{joint}.position"]


def deflection(found: Recording) -> Array:
    """Transverse deflection of the link's tip in its two bending planes [m], shape (N, 2)."""
    return np.stack([found[f"link2.tip_deflection.{axis}"] for axis in "yz"], axis=1)


def _oscillation(found: Recording, values: Array) -> Array:
    """The part faster than `OSCILLATION`, without delay."""
    high = butter(4, OSCILLATION, btype="highpass", fs=found.sample_rate, output="sos")
    return np.asarray(sosfiltfilt(high, values, axis=0))


def spectrum(case: Case) -> tuple[Array, Array]:
    """Frequencies [Hz] and power density of the tip's deflection over the whole run [m^2/Hz].

    Mean and the loop's own settling are filtered out.
    """
    found = run(case)
    fast = _oscillation(found, deflection(found))
    frequency, density = periodogram(fast, fs=found.sample_rate, window="hann", axis=0)
    return frequency, density.sum(axis=1)


def _after(case: Case, found: Recording) -> NDArray[np.bool_]:
    """The samples after the motion, or the last half where there is no hold."""
    held = found.time > case.motion_end
    return held if np.count_nonzero(held) > 1 else found.time > found.time[-1] / 2


def _angle(found: Recording) -> Array:
    """Angle between the base's attitude and its first [rad], shape (N,)."""
    attitude = _axes(found, "base.attitude", "wxyz")
    vector = attitude[:, 1:] * attitude[:1, :1] - attitude[:, :1] * attitude[0, 1:]
    vector -= np.cross(attitude[:, 1:], attitude[0, 1:])
    return 2 * np.arcsin(np.clip(np.linalg.norm(vector, axis=1), 0, 1))


def _axes(found: Recording, name: str, axes: str = "xyz") -> Array:
    return np.stack([found[f"{name}.{axis}"] for axis in axes], axis=1)


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _size(columns: Array) -> float:
    """Root mean square of the length of the rows."""
    return float(np.sqrt(np.mean(np.sum(columns**2, axis=1))))
