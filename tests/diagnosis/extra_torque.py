"""Recordings of a simulated axis with a torque of any form added, and their diagnosis."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from missing_physics.diagnosis import Diagnosis, Options
from missing_physics.diagnosis import by_regression as diagnose
from reference_model.simulation import simulate
from robot_model import Recording, Robot, load_robot

__all__ = ["diagnosed", "recorded"]

Array = NDArray[np.float64]


@lru_cache
def recorded(reach: tuple[float, float] = (1.0, 1.0)) -> tuple[Robot, Recording, Recording]:
    """An axis, and two recordings of different motions in which nothing is missing, of relative `reach`."""
    robot = load_robot("single_axis")
    assert robot.reference is not None
    made = []
    for seed, factor, far in ((1, 1.0, reach[0]), (2, 0.8, reach[1])):
        joints = tuple(
            sines.model_copy(
                update={
                    "amplitudes": tuple(far * a for a in sines.amplitudes),
                    "frequencies": tuple(factor * f for f in sines.frequencies),
                }
            )
            for sines in robot.reference.joints
        )
        reference = robot.reference.model_copy(
            update={"duration": 16.0, "sample_rate": 500.0, "joints": joints}
        )
        made.append(simulate(robot.model_copy(update={"reference": reference}), seed=seed))
    return robot, made[0], made[1]


def diagnosed(
    extra: Callable[[Array, Array, Array], Array], *, reach: tuple[float, float] = (1.0, 1.0)
) -> Diagnosis:
    """The diagnosis where the actuator delivers `extra` more, a function of time, position and velocity."""
    robot, *recordings = recorded(reach)
    changed = []
    for made in recordings:
        position = made["joint1.position"]
        smooth = np.convolve(np.pad(position, 10, mode="edge"), np.ones(21) / 21, mode="valid")
        velocity = np.gradient(smooth, made.time)
        torque = made["joint1.torque"] + extra(made.time, position, velocity)
        changed.append(made.with_channels({"joint1.torque": torque}))
    options = Options(experiments=False, simulation=False)
    return diagnose(robot, changed[:1], changed[1:], options=options).diagnosis
