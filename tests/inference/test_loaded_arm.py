"""A load that the robot file does not know, at an arm whose file is off by some percent besides."""

from __future__ import annotations

from typing import Any

import numpy as np

from missing_physics.diagnosis import Options, diagnose
from missing_physics.results.result import Result
from reference_model.evaluation.model import RobotModel
from robot_model import Recording, Robot

RATE, DURATION, NOISE = 100.0, 12.0, 2e-3
VISCOUS, COULOMB = (1.2, 0.4), (2.0, 0.9)
#: Mass, position and inertia about the centre of the two links; of the second one with and without the load.
UPPER, FORE = (4.0, 0.19, 0.06), (2.3, 0.15, 0.03)
LOAD, REACH = 0.6, 0.33


def arm(upper: tuple[float, float, float], fore: tuple[float, float, float]) -> Robot:
    """Two links in a vertical plane, 0.4 m apart."""

    def link(name: str, numbers: tuple[float, float, float]) -> dict[str, Any]:
        mass, centre, inertia = numbers
        return {
            "name": name,
            "mass": mass,
            "center_of_mass": (centre, 0.0, 0.0),
            "inertia": (0.1 * inertia, inertia, inertia),
        }

    drive = {"gear_ratio": 1.0, "torque_limit": 100.0}
    return Robot.model_validate(
        {
            "name": "arm",
            "gravity": (0.0, 0.0, -9.81),
            "links": [link("upper", upper), link("fore", fore)],
            "joints": [
                {"name": "a", "parent": "base", "child": "upper", "axis": (0.0, 1.0, 0.0), "actuator": drive},
                {
                    "name": "b",
                    "parent": "upper",
                    "child": "fore",
                    "axis": (0.0, 1.0, 0.0),
                    "origin": (0.4, 0.0, 0.0),
                    "actuator": drive,
                },
            ],
        }
    )


def loaded(mass: float) -> tuple[float, float, float]:
    """The second link with a point mass at its end."""
    own, centre, inertia = FORE
    whole = own + mass
    at = (own * centre + mass * REACH) / whole
    return whole, at, inertia + own * (centre - at) ** 2 + mass * (REACH - at) ** 2


def recorded(mass: float, seed: int) -> Recording:
    random = np.random.default_rng(seed)
    time = np.arange(0.0, DURATION, 1.0 / RATE)
    rates = 2.0 * np.pi * np.array([0.11, 0.29, 0.53])
    q, v, a = np.zeros((3, time.size, 2))
    for k in range(2):
        for size, rate in zip((0.7, 0.4, 0.2), rates * (1.0 + 0.17 * k)):
            angle = rate * time + random.uniform(0.0, 2.0 * np.pi)
            q[:, k] += size * np.sin(angle)
            v[:, k] += size * rate * np.cos(angle)
            a[:, k] -= size * rate**2 * np.sin(angle)
    torque = RobotModel(arm(UPPER, loaded(mass))).inverse_dynamics(q, v, a)
    torque = torque + np.array(VISCOUS) * v + np.array(COULOMB) * np.sign(v)
    channels = {}
    for k, name in enumerate("ab"):
        channels[f"{name}.position"] = q[:, k] + random.normal(0.0, 1e-7, time.size)
        channels[f"{name}.torque"] = torque[:, k] + random.normal(0.0, NOISE, time.size)
    return Recording(time, channels, source=f"run {seed}")


def diagnosed(mass: float) -> Result:
    """Of a file whose links are 5 % too heavy and too light."""
    file = arm((1.05 * UPPER[0], UPPER[1], 1.05 * UPPER[2]), (0.95 * FORE[0], FORE[1], 0.95 * FORE[2]))
    options = Options(experiments=False)
    return diagnose(file, [recorded(mass, 1)], [recorded(mass, 2)], options=options)


def test_the_load_is_named_with_its_mass_and_its_place() -> None:
    """Bodies that may differ from the file would take the load for a link that is a quarter heavier."""
    found = {f.effect: f for f in diagnosed(LOAD).diagnosis.findings if f.location == "fore"}
    assert set(found) == {"payload"}
    numbers = found["payload"].parameters
    for name, value in (("mass", LOAD), ("x", REACH)):
        low, high = numbers[name].ci95
        assert low <= value <= high  # two deviations, of which a tenth of the file's masses is the most
    assert numbers["mass"].ci95[0] > 0.0


def test_a_file_that_is_off_by_some_percent_carries_no_load() -> None:
    assert not [f for f in diagnosed(0.0).diagnosis.findings if f.location in ("upper", "fore")]
