"""The robot of several studies: the flexible space robot with bearing friction, swinging slowly."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import radians
from typing import Any

import numpy as np
from scipy.signal import butter, sosfiltfilt

from benchmarks.friction.cases import MU_KINETIC, MU_STATIC, PRELOAD, RADIUS, SIGMA
from robot_model import EffectUse, MultiSine, Recording, Reference, Robot, load_robot

__all__ = ["JOINTS", "MILLI", "above", "lugre", "rms", "swinging", "swings"]

MILLI = 1e3
JOINTS = ("joint1", "joint2")


def lugre(stribeck: float) -> list[dict[str, Any]]:
    """LuGre friction on the preload and the bearing load; `stribeck` is its speed [rad/s]."""
    stiffness, damping, viscosity = (RADIUS * sigma for sigma in SIGMA)
    bristles = {
        "coulomb_torque": MU_KINETIC * PRELOAD,
        "static_torque": MU_STATIC * PRELOAD,
        "bristle_stiffness": stiffness * PRELOAD,
        "bristle_damping": damping * PRELOAD,
        "stribeck_velocity": stribeck,
        "load_coefficient": MU_KINETIC,
        "load_static_coefficient": MU_STATIC,
        "load_stiffness": stiffness,
        "load_damping": damping,
        "load_viscosity": viscosity,
    }
    return [{"effect": "lugre_friction", **bristles}]


def swings(amplitude: float, frequency: float, duration: float, *, rate: float = 100.0) -> Reference:
    """Both joints on a sine of `amplitude` [degrees] and `frequency` [Hz], faded in over its first period."""
    waves = {"amplitudes": (radians(amplitude),), "frequencies": (frequency,), "ramp": 1 / frequency}
    joints = tuple(MultiSine(joint=name, **waves) for name in JOINTS)
    return Reference(duration=duration, sample_rate=rate, joints=joints)


def swinging(
    laws: Sequence[Mapping[str, Any]], reference: Reference, controller: object, **changes: object
) -> Robot:
    """The flexible space robot with these effects at both joints."""
    robot = load_robot("flexible_space_robot")
    effects = tuple(EffectUse.model_validate({**law, "at": joint}) for joint in JOINTS for law in laws)
    given = {"reference": reference, "sensors": (), "effects": effects, "controller": controller}
    return robot.model_copy(update={**given, **changes})


def rms(values: np.ndarray) -> float:
    """Root of the mean square."""
    return float(np.sqrt(np.mean(values**2)))


def above(run: Recording, channel: str, frequency: float) -> np.ndarray:
    """The part of a channel above a frequency [Hz], by a zero-phase Butterworth filter of order four."""
    rate = 1 / float(run.time[1] - run.time[0])
    sections = butter(4, frequency, "highpass", fs=rate, output="sos")
    return np.asarray(sosfiltfilt(sections, run[channel]))
