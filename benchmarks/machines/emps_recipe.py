"""The usual way to identify the EMPS axis, for comparison: filter, differentiate, decimate, least squares.

Independent of the diagnosis on purpose. Janot, Gautier, Brunot, "Data Set and Reference Models of EMPS",
Workshop on Nonlinear System Identification Benchmarks, 2019.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import signal

from robot_model import Recording

__all__ = ["PUBLISHED", "STRUCTURES", "Axis", "predicted_force"]

Array = NDArray[np.float64]

#: M [kg], Fv [N s/m], Fc [N], OF [N] of M q'' + Fv q' + Fc sign(q') + OF = force.
PUBLISHED: Mapping[str, float] = {"M": 95.1089, "Fv": 203.5034, "Fc": 20.3935, "OF": -3.1648}
#: Models of growing size, by their parameters.
STRUCTURES = (("M",), ("M", "Fv"), ("M", "Fv", "Fc"), ("M", "Fv", "Fc", "OF"))

#: Zero-phase Butterworth filter of the position: order and cut-off [Hz].
ORDER, CUTOFF = 4, 100.0
#: Every so-many-th sample is kept, after the usual anti-alias filter: order, ripple [dB], part of Nyquist.
KEPT = 10
ANTI_ALIAS = (8, 0.05, 0.8)
#: Samples left out at both ends, where the filters have no past or no future.
EDGE = 200

#: Name in a diagnosis of each number that `predicted_force` understands.
KNOWN = {
    "mass": "carriage.mass",
    "coulomb": "coulomb_friction@joint1.torque",
    "viscous": "viscous_friction@joint1.coefficient",
    "offset": "torque_offset@joint1.torque",
    "coulomb_difference": "asymmetric_friction@joint1.coulomb_difference",
    "viscous_difference": "asymmetric_friction@joint1.viscous_difference",
    "lag": "actuator_lag@joint1.time_constant",
}


@dataclass(frozen=True)
class Axis:
    """Motion and force of one recording by the recipe, at the full rate.

    Attributes:
        rate: samples per second.
        velocity, acceleration: central differences of the filtered position, shape (N,).
        force: as recorded, shape (N,).
    """

    rate: float
    velocity: Array
    acceleration: Array
    force: Array

    @classmethod
    def of(cls, recording: Recording) -> Axis:
        """From `joint1.position` and `joint1.torque`."""
        step = float(np.median(np.diff(recording.time)))
        sections = signal.butter(ORDER, CUTOFF, fs=1.0 / step, output="sos")
        velocity = np.gradient(signal.sosfiltfilt(sections, recording["joint1.position"]), step)
        force = np.asarray(recording["joint1.torque"])
        return cls(1.0 / step, velocity, np.gradient(velocity, step), force)

    def columns(self) -> dict[str, Array]:
        """What each published parameter multiplies, shape (N,) each."""
        ones = np.ones_like(self.velocity)
        return {"M": self.acceleration, "Fv": self.velocity, "Fc": np.sign(self.velocity), "OF": ones}

    def fit(self, structure: tuple[str, ...]) -> dict[str, float]:
        """Least squares of the force on the columns of `structure`."""
        columns = self.columns()
        x = decimated(np.column_stack([columns[name] for name in structure]))
        found = np.linalg.lstsq(x, decimated(self.force), rcond=None)[0]
        return {name: float(value) for name, value in zip(structure, found)}

    def error(self, values: Mapping[str, float]) -> float:
        """rms of force minus model over rms of force with published-style parameters held."""
        columns = self.columns()
        return self.relative_error(np.sum([value * columns[n] for n, value in values.items()], axis=0))

    def relative_error(self, predicted: Array) -> float:
        """rms of force minus `predicted` over rms of force, both decimated."""
        measured = decimated(self.force)
        return float(np.linalg.norm(measured - decimated(predicted)) / np.linalg.norm(measured))


def decimated(values: Array) -> Array:
    """Anti-alias filter without phase, ends left out, every tenth sample kept; along the first axis."""
    order, ripple, part = ANTI_ALIAS
    sections = signal.cheby1(order, ripple, part / KEPT, output="sos")
    return np.asarray(signal.sosfiltfilt(sections, values, axis=0)[EDGE:-EDGE:KEPT])


def predicted_force(axis: Axis, values: Mapping[str, float]) -> Array | None:
    """Force that a diagnosis' parameters predict along the recipe's motion, shape (N,).

    Written anew from the catalogue's equations, so that it also checks them.

    Args:
        values: by name as in `KNOWN`.

    Returns:
        None when `values` holds something that is not understood here.
    """
    if set(values) - set(KNOWN.values()):
        return None
    p = {short: values.get(name, 0.0) for short, name in KNOWN.items()}
    v, direction = axis.velocity, np.sign(axis.velocity)
    friction = p["coulomb"] * direction + p["viscous"] * v
    friction += p["coulomb_difference"] * np.abs(direction) + p["viscous_difference"] * np.abs(v)
    delivered = p["mass"] * axis.acceleration + friction - p["offset"]
    # First-order lag: command = delivered + time constant times its rate.
    return np.asarray(delivered + p["lag"] * np.gradient(delivered, 1.0 / axis.rate))
