"""The stepping rule by which the authors of the servo pendulum's logs fit and score their friction models.

Written anew from the description in M. Duclusaud, G. Passault, V. Padois, O. Ly, "Extended Friction Models
for the Physics Simulation of Servo Actuators", ICRA 2025, and from the facts of their repository
(Rhoban/bam): explicit Euler steps of 5 ms on the linearly resampled log, started at the logged position and
speed; friction is the torque that would stop the servo within the step, clipped to a budget.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["PUBLISHED", "Log", "run_log"]

Array = NDArray[np.float64]

#: Length of a step [s], and the gravity they use [m/s^2].
STEP = 0.005
GRAVITY = 9.80665
#: Largest speed their rule lets through [rad/s].
FASTEST = 100.0

#: Parameters published for the XL330 (bam/params/xl330 of their main branch), without the quadratic M6.
#: Names:
#: `external` and `motor` are the shares of the load's and the motor's torque that add to friction (both the
#: same up to M4), `stribeck` marks what is added at standstill.
PUBLISHED: Mapping[str, Mapping[str, float]] = {
    "M1": {
        "kt": 0.3866957639,
        "R": 4.0171292223,
        "armature": 0.00181416727,
        "q_offset": 0.0308710003,
        "base": 0.0128327204,
        "viscous": 0.0036616723,
    },
    "M2": {
        "kt": 0.3852809157,
        "R": 4.0002638870,
        "armature": 0.00181928532,
        "q_offset": 0.0328454803,
        "base": 0.0,
        "stribeck": 0.0126512383,
        "speed": 4.1665211110,
        "exponent": 1.3636445350,
        "viscous": 0.0056208455,
    },
    "M3": {
        "kt": 0.3804202286,
        "R": 3.3800669548,
        "armature": 0.00191777228,
        "q_offset": 0.0294395769,
        "base": 0.0088817130,
        "external": 0.1216645553,
        "motor": 0.1216645553,
        "viscous": 0.0043790998,
    },
    "M4": {
        "kt": 0.3861709980,
        "R": 3.4025726412,
        "armature": 0.00189545526,
        "q_offset": 0.0280724588,
        "base": 0.0087586276,
        "stribeck": 0.0,
        "external": 0.0680335733,
        "motor": 0.0680335733,
        "external_stribeck": 0.0738118083,
        "motor_stribeck": 0.0738118083,
        "speed": 2.5577016869,
        "exponent": 0.7601158769,
        "viscous": 0.0046210350,
    },
    "M5": {
        "kt": 0.3622127815,
        "R": 2.7519133088,
        "armature": 0.00184689363,
        "q_offset": 0.0291424106,
        "base": 0.0003659521,
        "stribeck": 0.0086778876,
        "external": 0.0,
        "motor": 0.2896521958,
        "external_stribeck": 0.0586825054,
        "motor_stribeck": 0.0000305745,
        "speed": 3.1889119964,
        "exponent": 2.9904004892,
        "viscous": 0.0063480319,
    },
}


@dataclass(frozen=True)
class Log:
    """One log as the rule needs it, arrays of shape (N,).

    Attributes:
        time: [s], from 0.
        position, speed, goal: as logged [rad, rad/s].
        on: whether the motor was switched on.
        gain: duty cycle per position error [1/rad].
        supply: nominal supply [V].
        mass, length: of the pendulum [kg, m].
    """

    time: Array
    position: Array
    speed: Array
    goal: Array
    on: NDArray[np.bool_]
    gain: float
    supply: float
    mass: float
    length: float


def run_log(log: Log, parameters: Mapping[str, float]) -> tuple[Array, Array]:
    """Simulated and logged positions on the rule's grid, shape (M,) each."""
    grid = np.arange(0.0, log.time[-1], STEP)
    position, speed, goal = (np.interp(grid, log.time, y) for y in (log.position, log.speed, log.goal))
    on = np.interp(grid, log.time, log.on.astype(float)) > 0.5
    q, v = float(position[0]), float(speed[0])
    found = np.empty(grid.size)
    for k in range(grid.size):
        found[k] = q
        q, v = _advance(log, parameters, q, v, float(goal[k]), bool(on[k]))
    return found, position


def _advance(
    log: Log, p: Mapping[str, float], q: float, v: float, goal: float, on: bool
) -> tuple[float, float]:
    voltage = log.supply * float(np.clip(log.gain * (goal - q), -1.0, 1.0))
    motor = p["kt"] / p["R"] * (voltage - p["kt"] * v) if on else 0.0
    load = -log.mass * GRAVITY * log.length * float(np.sin(q + p["q_offset"]))
    inertia = log.mass * log.length**2 + p["armature"]
    net = motor + load
    stopping = inertia / STEP * v + net
    friction = min(abs(stopping), _budget(p, motor, load, v))
    acceleration = (net - float(np.sign(stopping)) * friction) / inertia
    v = float(np.clip(v + acceleration * STEP, -FASTEST, FASTEST))
    return q + v * STEP + 0.5 * acceleration * STEP**2, v


def _budget(p: Mapping[str, float], motor: float, load: float, v: float) -> float:
    """Largest friction torque [N m]: Coulomb, load-dependent, their excess at standstill, and viscous."""
    still = float(np.exp(-(abs(v / p["speed"]) ** p["exponent"]))) if "speed" in p else 0.0
    carried = abs(load * p.get("external", 0.0) - motor * p.get("motor", 0.0))
    excess = abs(load * p.get("external_stribeck", 0.0) - motor * p.get("motor_stribeck", 0.0))
    return p["base"] + carried + still * (p.get("stribeck", 0.0) + excess) + p["viscous"] * abs(v)
