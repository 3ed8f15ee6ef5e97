"""Whether an effect in a gear is identifiable from the encoders on its two sides.

The difference of both encoders has white noise. The distance of an effect in the gear is the energy of this
difference, in units of the noise, that no substitute explains: a constant (the encoders' zeros),
a delayed or scaled encoder, an eccentric disc, and every other effect in a gear that is not less simple. An
elastic gear twists in proportion to the torque and its rate.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from missing_physics.challenge.torques.along import ArmAlong
from robot_model import EffectUse, Sensor

__all__ = ["gear_distance"]

Array = NDArray[np.float64]

#: Torque over which a backlash changes flanks, as a fraction of the rms torque.
FLANKS = 0.05


def gear_distance(along: ArmAlong, use: EffectUse) -> float:
    """Distance of an effect in a gear from its nearest substitute; zero without both encoders."""
    motor, joint = (along.robot.sensor(f"{use.at}.{side}") for side in ("motor_position", "position"))
    if motor is None or joint is None:
        return 0.0
    noise = np.sqrt(_variance(motor) + _variance(joint))
    twist = (along.exact[motor.channel] - along.exact[joint.channel]) / noise
    return float(min(_residual_energy(twist, rival) for rival in _rivals(along, use)))


def _variance(sensor: Sensor) -> float:
    return max(sensor.noise**2 + sensor.resolution**2 / 12, 1e-24)


def _rivals(along: ArmAlong, use: EffectUse) -> Iterator[list[Array]]:
    k = along.joints.index(use.at)
    position, velocity = along.state[0][:, k], along.state[1][:, k]
    yield [velocity]
    yield [position]
    yield [np.cos(position), np.sin(position)]
    if use.effect == "joint_elasticity":  # every other effect in a gear is less simple
        return
    torque = along.exact[f"{use.at}.gear_torque"]
    elastic = [torque, np.gradient(torque, along.time)]
    yield elastic
    if use.effect == "gear_hysteresis":
        side = np.tanh(torque / max(FLANKS * float(np.sqrt(np.mean(torque**2))), 1e-12))
        yield [*elastic, side]


def _residual_energy(target: Array, columns: list[Array]) -> float:
    """Residual energy of the target after fitting a constant and these columns."""
    matrix = np.column_stack([np.ones_like(target), *columns])
    matrix = matrix / np.maximum(np.linalg.norm(matrix, axis=0), 1e-300)
    return float(np.sum((target - matrix @ np.linalg.lstsq(matrix, target, rcond=None)[0]) ** 2))
