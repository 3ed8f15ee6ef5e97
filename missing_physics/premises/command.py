"""Torques that are not measured but equal a controller's command up to rounding."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from missing_physics.recordings import Finding, estimate_resolution
from robot_model import Recording, Robot

__all__ = ["command_findings"]

Array = NDArray[np.float64]

#: Number of consecutive samples that are used, and the fewest that suffice.
MOST_SAMPLES, FEWEST = 20_000, 200
#: Largest residual of a command: this many standard deviations of its rounding, or the rounding of single
#: precision.
ROUNDING, SINGLE = 3.0, 1e-6
#: The reference must be essential: without it the residual is this many times larger.
WITHOUT = 30.0


def command_findings(robot: Robot, recording: Recording) -> Iterator[Finding]:
    """Findings of torques that are a linear function of reference and measured motion, as from PD control.

    A measured torque has additional noise, however well a drive follows its command.
    """
    steps = estimate_resolution(recording)
    found = []
    for joint in robot.drives:
        torque, reference = f"{joint.name}.torque", f"{joint.name}.reference_position"
        if torque in recording and reference in recording and f"{joint.name}.position" in recording:
            residual = _residuals(recording, joint.name)
            if residual is None:
                continue
            with_reference, without, spread = residual
            rounding = max(ROUNDING * steps.get(torque, 0.0) / np.sqrt(12.0), SINGLE * spread)
            if with_reference < rounding and without > WITHOUT * with_reference:
                found.append(torque)
    if found:
        one = len(found) == 1
        yield Finding(
            "note",
            "command",
            found[0],
            f"{', '.join(found)} {'is' if one else 'are'} a linear law of reference and position to "
            f"rounding, so {'it is' if one else 'they are'} a controller's command and not measured: what "
            "the drive makes of it (lag, gain, saturation) counts as missing physics; map a measured torque "
            "or current if there is one",
        )


def _residuals(recording: Recording, joint: str) -> tuple[float, float, float] | None:
    """rms residual of the law with and without the reference, and rms torque; None without enough data."""
    names = [f"{joint}.{q}" for q in ("reference_position", "position", "velocity", "reference_velocity")]
    names = [name for name in names if name in recording]
    channels = np.column_stack([recording[f"{joint}.torque"], *(recording[name] for name in names)])
    whole = np.isfinite(channels).all(axis=1)
    channels = channels[whole][:MOST_SAMPLES]
    if len(channels) < FEWEST:
        return None
    torque = channels[1:-1, 0]
    spread = float(np.std(torque))
    if spread == 0.0:
        return None
    before, now, after = channels[:-2, 1:], channels[1:-1, 1:], channels[2:, 1:]
    errors = np.cumsum(channels[:, 1] - channels[:, 2])[1:-1, None]
    constant = np.ones((len(torque), 1))
    everything = np.column_stack([before, now, after, errors, constant])
    own = np.column_stack([part[:, 1:] for part in (before, now, after)] + [constant])
    return _rms(everything, torque), _rms(own, torque), spread


def _rms(columns: Array, torque: Array) -> float:
    columns = columns - columns.mean(axis=0) * (np.ptp(columns, axis=0) > 0)
    size = np.linalg.norm(columns, axis=0)
    scaled = columns / np.where(size > 0.0, size, 1.0)
    residual = torque - scaled @ np.linalg.lstsq(scaled, torque, rcond=1e-13)[0]
    return float(np.sqrt(np.mean(residual**2)))
