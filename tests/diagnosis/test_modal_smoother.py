"""The correction of modal motion by torques, and what a diagnosis of a flexible robot makes of it."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.linalg import expm

from missing_physics.diagnosis.modal_smoother import ModalResponse, modal_torque
from missing_physics.diagnosis.pipeline import Options, diagnose
from reference_model.simulation import simulate
from robot_model import EffectUse, InputError, MultiSine, Reference, Robot, load_robot

Array = NDArray[np.float64]

STEP = 5e-3
TIME = np.arange(4000) * STEP
TRIAL = Options(experiments=False, flexible=True)
#: A joint of 4 kg m^2 that carries one mode of 1 Hz.
FREQUENCY, DAMPING, COUPLING, INERTIA = 2 * np.pi, 0.005, 1.5, 4.0


def response() -> ModalResponse:
    matrix = np.array([[[INERTIA, COUPLING], [COUPLING, 1.0]]])
    stiffness, damping = np.array([[FREQUENCY**2]]), np.array([[2 * DAMPING * FREQUENCY]])
    return ModalResponse.of(matrix, stiffness, damping, base=0, samples=TIME.size)


def vibration(chance: np.random.Generator, noise: float) -> Array:
    """Torque of the mode under white noise of the joint's acceleration, shape (N, 1)."""
    move = expm(np.array([[0.0, 1.0], [-(FREQUENCY**2), -2 * DAMPING * FREQUENCY]]) * STEP)
    state, found = np.zeros(2), []
    for push in noise * chance.standard_normal(TIME.size):
        found.append(-COUPLING * (FREQUENCY**2 * state[0] + 2 * DAMPING * FREQUENCY * state[1]))
        state = move @ state + np.array([0.0, COUPLING * push])
    return np.array(found)[:, None]


def test_vibration_is_told_from_what_is_missing() -> None:
    chance = np.random.default_rng(5)
    position_noise = np.array([5e-4])
    true = vibration(chance, FREQUENCY**2 * position_noise[0] * STEP)
    missing = 0.05 * np.sign(np.sin(2 * np.pi * 0.11 * TIME))[:, None]
    noise = 1e-3
    residual = true + missing + noise * chance.standard_normal(true.shape)
    found = modal_torque(
        response(), residual, STEP, position_noise=position_noise, torque_noise=np.array([noise])
    )
    left = np.sqrt(np.mean((found - true) ** 2) / np.mean(true**2))
    # a jump of the missing torque holds all frequencies, the mode's as well: part of it is taken for it
    assert left < 0.3
    untouched = np.sqrt(np.mean((residual - found - missing) ** 2))
    assert untouched < 0.3 * np.sqrt(np.mean(true**2))


def test_without_motion_noise_nothing_is_taken_for_vibration() -> None:
    missing = 0.05 * np.sin(2 * np.pi * 0.11 * TIME)[:, None]
    found = modal_torque(response(), missing, STEP, position_noise=np.zeros(1), torque_noise=np.array([1e-3]))
    assert np.abs(found).max() < 1e-9 * np.abs(missing).max()


@pytest.fixture(scope="module")
def nominal() -> Robot:
    """The flexible space robot without friction, in a motion that reverses often."""
    robot = load_robot("flexible_space_robot")
    joints = (
        MultiSine(
            joint="joint1", amplitudes=(0.2, 0.08), frequencies=(0.06, 0.17), phases=(0.0, 1.0), ramp=5.0
        ),
        MultiSine(
            joint="joint2", amplitudes=(0.25, 0.1), frequencies=(0.08, 0.21), phases=(0.6, 2.0), ramp=5.0
        ),
    )
    reference = Reference(duration=30.0, sample_rate=200.0, joints=joints)
    return robot.model_copy(update={"reference": reference, "effects": ()})


def test_flexible_robots_are_refused_unless_asked_for(nominal: Robot) -> None:
    with pytest.raises(InputError, match="false alarms too often"):
        diagnose(nominal, [simulate(nominal, seed=11)])


def test_nothing_missing_in_a_flexible_robot(nominal: Robot) -> None:
    result = diagnose(nominal, [simulate(nominal, seed=11)], options=TRIAL)
    assert result.diagnosis.findings == ()
    assert result.diagnosis.verdict == "consistent"


def test_friction_of_a_flexible_robot_is_found(nominal: Robot) -> None:
    true = nominal.with_effects(EffectUse(effect="coulomb_friction", at="joint2", torque=0.4))
    result = diagnose(nominal, [simulate(true, seed=12)], options=TRIAL)
    found = {(f.effect, f.location): f for f in result.diagnosis.findings}
    assert ("coulomb_friction", "joint2") in found
    low, high = found["coulomb_friction", "joint2"].parameters["torque"].ci95
    assert low < 0.4 < high
    assert len(found) == 1
