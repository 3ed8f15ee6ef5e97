"""The correction of modal motion by torques, and what a diagnosis of a flexible robot makes of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import signal
from scipy.interpolate import make_interp_spline

from missing_physics.diagnosis import Options
from missing_physics.diagnosis import by_regression as diagnose
from missing_physics.diagnosis.modal.response import ModalResponse
from missing_physics.diagnosis.modal.smoother import VibrationSmoother
from reference_model.simulation import simulate
from robot_model import EffectUse, MultiSine, Reference, Robot, load_robot

Array = NDArray[np.float64]

STEP = 5e-3
TIME = np.arange(4000) * STEP
TRIAL = Options(experiments=False)
#: A joint of 4 kg m^2 that carries one mode, whose frequency beside the free joint is 1.5 Hz.
FREQUENCY, DAMPING, COUPLING, INERTIA = 2 * np.pi, 0.005, 1.5, 4.0
ENCODER, TORQUE, CUTOFF = 1e-4, 1e-3, 5.0


def response() -> ModalResponse:
    matrix = np.array([[[INERTIA, COUPLING], [COUPLING, 1.0]]])
    stiffness, damping = np.array([[FREQUENCY**2]]), np.array([[2 * DAMPING * FREQUENCY]])
    return ModalResponse.of(matrix, stiffness, damping, base=0, samples=TIME.size, step=STEP)


def recorded(chance: np.random.Generator) -> tuple[Array, Array, Array]:
    """Residual, gap and torque of the true correction, (N, 1) each, of a joint that truly stands still.

    What is seen is the smoothed noise of the encoder and, in the torque, what that motion would need.
    """
    noise = ENCODER * chance.standard_normal(TIME.size)
    sections = signal.butter(4, CUTOFF, fs=1 / STEP, output="sos")
    smooth = signal.sosfiltfilt(sections, noise)
    acceleration = make_interp_spline(TIME, smooth, k=5)(TIME, 2)[:, None]
    modal = response().driven(acceleration)
    residual = TORQUE * chance.standard_normal((TIME.size, 1)) - INERTIA * acceleration - modal
    return residual, (noise - smooth)[:, None], -modal - COUPLING**2 * acceleration


def smoothed(residual: Array, gap: Array) -> VibrationSmoother:
    return VibrationSmoother(
        response(),
        residual,
        gap,
        position_noise=np.array([ENCODER]),
        torque_noise=np.array([TORQUE]),
        rate_noise=np.array([ENCODER]),
        level=(np.ones(1), np.ones(1)),
    )


def rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


def test_driven_modes_ring_at_their_own_frequency() -> None:
    # A step of the joint's acceleration: x = -COUPLING / w^2 (1 - decaying cosine), in closed form.
    acceleration = np.ones((TIME.size, 1))
    w, d = FREQUENCY, DAMPING
    rung = w * np.sqrt(1 - d**2)
    decay = np.exp(-d * w * TIME)
    x2 = -COUPLING * decay * (np.cos(rung * TIME) - d * w / rung * np.sin(rung * TIME))
    found = response().driven(acceleration)[:, 0]
    np.testing.assert_allclose(found, COUPLING * x2, atol=1e-9 * COUPLING**2)


def test_noise_of_the_motion_is_not_taken_for_missing_torque() -> None:
    residual, gap, vibration = recorded(np.random.default_rng(5))
    found = smoothed(residual, gap).torque
    assert rms(vibration) > 5 * TORQUE  # what is to be found stands out
    # The encoder's own noise bounds what can be known; five times better than without is asked for.
    assert rms(found - vibration) < 0.2 * rms(vibration)


def test_what_is_missing_is_not_taken_for_vibration() -> None:
    # The encoder says that the joint stands still, so that nothing vibrates whatever the torque does.
    chance = np.random.default_rng(6)
    missing = 0.05 * np.sign(np.sin(2 * np.pi * 0.11 * TIME))[:, None]
    gap, noise = chance.standard_normal((2, TIME.size, 1))
    found = smoothed(missing + TORQUE * noise, ENCODER * gap)
    assert rms(found.torque) < 0.2 * rms(missing)


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


@pytest.mark.proof
def test_nothing_missing_in_a_flexible_robot() -> None:
    """Friction from bearing loads, and no reference in the recording, so that no run of its own decides."""
    robot = load_robot("flexible_space_robot_planar")
    recording = simulate(robot, seed=4000)
    known = {k: v for k, v in recording.channels.items() if not k.endswith(".reference_position")}
    result = diagnose(robot, [replace(recording, channels=known)], options=TRIAL)
    assert result.diagnosis.findings == ()
    assert result.diagnosis.verdict == "consistent"
    for channel in ("joint1.torque", "joint2.torque"):
        fit = result.diagnosis.fit.channels[channel]
        # The floor foretells what noise leaves. An rms of slow noise is known to some 20 %.
        assert 0.4 < fit.before.train_rms / fit.noise_floor < 1.3
        # The nominal friction is no unknown torque; taken for one it leaves 0.016 N m at joint 2.
        assert fit.noise_floor < 0.01


@pytest.mark.proof
def test_friction_of_a_flexible_robot_is_found(nominal: Robot) -> None:
    true = nominal.with_effects(EffectUse(effect="coulomb_friction", at="joint2", torque=0.4))
    result = diagnose(nominal, [simulate(true, seed=12)], options=TRIAL)
    found = {(f.effect, f.location): f for f in result.diagnosis.findings}
    assert ("coulomb_friction", "joint2") in found
    low, high = found["coulomb_friction", "joint2"].parameters["torque"].ci95
    assert low < 0.4 < high
    assert len(found) == 1
