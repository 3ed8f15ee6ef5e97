"""Energy and momentum differentiated along a motion: they tie the accelerations to the kinematics.

Forward and inverse dynamics agree with each other even when both use a wrong centripetal or Coriolis term;
these rates do not.
"""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from random_robots import Case, cases

from reference_model.passive.base_motion import BaseMotion

pytestmark = pytest.mark.fuzz
few = settings(max_examples=settings.default.max_examples // 3, derandomize=True)

#: Step of the central differences [s]; truncation is its square times third derivatives below 1e3, rounding
#: 1e-13 over it.
STEP = 1e-5
TOLERANCE = 1e-6


def turn(attitude: np.ndarray, vector: np.ndarray, *, back: bool = False) -> np.ndarray:
    q = attitude / np.linalg.norm(attitude, axis=1, keepdims=True)
    w, v = q[:, :1], -q[:, 1:] if back else q[:, 1:]
    return vector + 2 * np.cross(v, np.cross(v, vector) + w * vector)


def turned(attitude: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """Attitude after a rotation vector in body axes."""
    size = np.linalg.norm(angle, axis=1, keepdims=True)
    w, v = np.cos(size / 2), angle * np.sinc(size / (2 * np.pi)) / 2
    a, b = attitude[:, :1], attitude[:, 1:]
    return np.hstack([a * w - np.sum(b * v, 1, keepdims=True), a * v + w * b + np.cross(b, v)])


def moved(case: Case, h: float) -> tuple[np.ndarray, np.ndarray, BaseMotion | None, np.ndarray]:
    """Joint position and velocity, base and its position after the time h, to second order."""
    q = case.position + h * case.velocity + h**2 / 2 * case.acceleration
    qd = case.velocity + h * case.acceleration
    base = case.base
    if base is None:
        return q, qd, None, np.zeros(3)
    attitude = turned(base.attitude, h * base.angular_velocity + h**2 / 2 * base.angular_acceleration)
    velocity = turn(base.attitude, base.linear_velocity + h * base.linear_acceleration)
    there = BaseMotion(
        attitude,
        base.angular_velocity + h * base.angular_acceleration,
        turn(attitude, velocity, back=True),
        base.angular_acceleration,
        base.linear_acceleration,
    )
    way = h * base.linear_velocity + h**2 / 2 * base.linear_acceleration
    return q, qd, there, turn(base.attitude, way)


@few
@given(cases())
def test_energy_changes_by_the_power_of_the_forces(case: Case) -> None:
    energies = []
    for h in (STEP, -STEP):
        q, qd, base, place = moved(case, h)
        energies.append(case.model.energy(q, qd, base=base, base_position=place))
    rate = (energies[0] - energies[1]) / (2 * STEP)
    force = case.model.inverse_dynamics(*case.motion, base=case.base)
    speed = case.velocity
    if case.base is not None:
        speed = np.hstack([case.base.linear_velocity, case.base.angular_velocity, speed])
    power = np.sum(force * speed, axis=1)
    np.testing.assert_allclose(rate, power, atol=TOLERANCE * (1 + np.abs(power).max()))


@few
@given(cases(base=("free",)))
def test_momentum_changes_by_the_external_wrench(case: Case) -> None:
    """Linear: force and weight. Angular, about the centre of mass: the moment about it."""
    assert case.base is not None
    ends = [moved(case, h) for h in (STEP, -STEP)]
    first, second = (case.model.momentum(q, qd, base=base) for q, qd, base, _ in ends)
    linear, angular = ((a - b) / (2 * STEP) for a, b in zip(first, second))
    wrench = case.model.inverse_dynamics(*case.motion, base=case.base)[:, :6]
    force, moment = (turn(case.base.attitude, part) for part in (wrench[:, :3], wrench[:, 3:]))
    names = case.model.inertial_names
    mass = sum(case.model.inertial[k] for k, name in enumerate(names) if name.endswith(".mass"))
    weight = mass * np.array(case.model.robot.gravity)
    scale = 1 + np.abs(wrench).max()
    np.testing.assert_allclose(linear, force + weight, atol=TOLERANCE * scale)
    arm = centre(case)
    np.testing.assert_allclose(angular, moment - np.cross(arm, force), atol=TOLERANCE * scale)


def centre(case: Case) -> np.ndarray:
    """Centre of mass from the base's origin, inertial axes: from how energy changes with gravity."""
    found = []
    still = 0 * case.velocity
    names = list(case.model.inertial_names)
    mass = sum(case.model.inertial[k] for k, name in enumerate(names) if name.endswith(".mass"))
    for axis in range(3):
        numbers = case.model.inertial.copy()
        numbers[-3:] = -np.eye(3)[axis]
        at_rest = BaseMotion.from_stacked(np.hstack([case.base.attitude, np.zeros((len(still), 12))]))
        found.append(
            case.model.energy(case.position, still, base=at_rest, base_position=np.zeros(3), inertial=numbers)
        )
    return np.stack(found, axis=1) / mass
