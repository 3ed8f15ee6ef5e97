"""The twist between two encoders in closed form: right names and correct intervals."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import brentq
from two_encoders import along_each

from missing_physics.diagnosis.gear.transmission import TransmissionResult, diagnose_transmission
from robot_model import Recording, Robot

Array = NDArray[np.float64]

RATE = 250.0
DURATION = 12.0
NOISE = 3e-6
TORQUE_NOISE = 0.1
STIFFNESS = 2e5
GEAR = 50.0
ROTOR = 1e-3
MASS, LEVER, INERTIA = 40.0, 0.6, 2.0
FRICTION = 30.0
GRAVITY = 9.81

#: Ninety-five percent intervals miss one truth in twenty; the half width is stretched by this factor, so that
#: the two dozen intervals below seldom fail by chance.
SLACK = 1.5

ROBOT = Robot.model_validate(
    {
        "name": "pendulum",
        "gravity": [0.0, 0.0, -GRAVITY],
        "links": [
            {"name": "arm", "mass": MASS, "center_of_mass": [0.0, 0.0, -LEVER], "inertia": [INERTIA] * 3}
        ],
        "joints": [
            {
                "name": "joint1",
                "parent": "base",
                "child": "arm",
                "axis": [0.0, 1.0, 0.0],
                "actuator": {"gear_ratio": GEAR, "rotor_inertia": ROTOR},
            }
        ],
    }
)


class Motion:
    """A smooth multi-sine with its derivatives and torques; `turns` scales the travel.

    Friction is dry, or viscous where a coefficient is given.
    """

    def __init__(self, seed: int, *, turns: float = 0.15, viscous: float = 0.0) -> None:
        chance = np.random.default_rng(1000 + seed)
        self.time = np.arange(0.0, DURATION, 1.0 / RATE)
        frequency = np.array([1, 2, 3, 5]) / DURATION
        phase = chance.uniform(0, 2 * np.pi, 4)
        size = 2 * np.pi * turns * chance.uniform(0.5, 1.0, 4) / np.array([1, 2, 3, 5])
        self._parts = 2 * np.pi * frequency, phase, size
        self.position = self.at(self.time)
        omega = self._parts[0]
        angle = np.outer(self.time, omega) + phase
        self.velocity = np.cos(angle) @ (size * omega)
        self.acceleration = -np.sin(angle) @ (size * omega**2)
        inertia = INERTIA + MASS * LEVER**2
        self.link_torque = inertia * self.acceleration + MASS * GRAVITY * LEVER * np.sin(self.position)
        dry = FRICTION * np.tanh(self.velocity / 1e-3)
        friction = viscous * self.velocity if viscous else dry
        self.torque = self.link_torque + ROTOR * GEAR**2 * self.acceleration + friction

    def at(self, time: Array) -> Array:
        """Position at any time."""
        omega, phase, size = self._parts
        return np.asarray(np.sin(np.outer(time, omega) + phase) @ size)


Gap = Callable[[Motion], Array]


def recording(motion: Motion, gap: Array, seed: int, torque_noise: float = TORQUE_NOISE) -> Recording:
    """Both encoders with white noise, and the motor's torque."""
    chance = np.random.default_rng(seed)
    return Recording(
        time=motion.time,
        channels={
            "joint1.motor_position": motion.position + NOISE * chance.standard_normal(gap.size),
            "joint1.position": motion.position + gap + NOISE * chance.standard_normal(gap.size),
            "joint1.torque": motion.torque + torque_noise * chance.standard_normal(gap.size),
        },
        source=f"run{seed}",
        noise={
            "joint1.motor_position": NOISE,
            "joint1.position": NOISE,
            "joint1.torque": torque_noise,
        },
    )


def diagnose(
    gap: Gap,
    seed: int,
    *,
    turns: float = 0.15,
    viscous: float = 0.0,
    torque_noise: float = TORQUE_NOISE,
    validate: bool = True,
) -> TransmissionResult:
    """Fit one motion, score another."""
    count = 2 if validate else 1
    motions = [Motion(2 * seed + k, turns=turns, viscous=viscous) for k in range(count)]
    runs = [recording(motion, gap(motion), 2 * seed + i, torque_noise) for i, motion in enumerate(motions)]
    along = along_each(ROBOT, runs)
    result = diagnose_transmission(ROBOT, runs[:1], runs[1:], along=along)
    assert result is not None
    return result


def elasticity(motion: Motion) -> Array:
    return -motion.link_torque / STIFFNESS


def delay(motion: Motion) -> Array:
    return motion.at(motion.time - 0.004) - motion.position


CUBIC, DAMPING = 8e10, 400.0


def damped(motion: Motion) -> Array:
    """K e + D ed = T by its own solution in steps over which T is a straight line."""
    fine = np.linspace(0.0, DURATION, 40 * motion.time.size)
    torque = np.interp(fine, motion.time, motion.link_torque)
    e, decay = torque[0] / STIFFNESS, np.exp(-STIFFNESS / DAMPING * (fine[1] - fine[0]))
    found = [e]
    for before, after in pairwise(torque / STIFFNESS):
        lag = (after - before) / (fine[1] - fine[0]) * DAMPING / STIFFNESS
        e = after - lag + (e - before + lag) * decay
        found.append(e)
    return -np.interp(motion.time, fine, found)


def hardening(motion: Motion) -> Array:
    """K e + K3 e^3 = T."""
    roots = [
        brentq(lambda e, t=t: STIFFNESS * e + CUBIC * e**3 - t, -1e-2, 1e-2, xtol=1e-14)
        for t in motion.link_torque
    ]
    return -np.array(roots)


LOSS, TRAVEL = 40.0, 2e-4


def lossy(motion: Motion) -> Array:
    """K e + T_h z = T, z in closed form of the twist, which runs one way between samples."""
    found, e, z = [], 0.0, 0.0
    for torque in motion.link_torque:
        way = np.sign(torque - STIFFNESS * e - LOSS * z) or 1.0

        def loaded(twist: float, e: float = e, z: float = z, way: float = way) -> float:
            return way + (z - way) * np.exp(-abs(twist - e) / TRAVEL)

        end = e + 1e-2 * way
        span = sorted((e, end))
        twist = brentq(lambda x, t=torque: STIFFNESS * x + LOSS * loaded(x) - t, *span, xtol=1e-15)
        z, e = loaded(twist), twist
        found.append(e)
    return -np.array(found)


def backlash(motion: Motion) -> Array:
    """The flank changes with the sign of the transmitted torque."""
    return -2e-4 * np.sign(motion.link_torque)


def eccentricity(motion: Motion) -> Array:
    return 1e-4 * np.cos(motion.position) + 2e-4 * np.sin(motion.position)


def motor_eccentricity(motion: Motion) -> Array:
    """The motor's encoder errs by as much the other way."""
    return 5e-5 * np.cos(GEAR * motion.position)


def both(motion: Motion) -> Array:
    return elasticity(motion) + delay(motion)


def nothing(motion: Motion) -> Array:
    return np.zeros(motion.time.size)


TRUTHS: list[tuple[Gap, float, dict[str, dict[str, float]]]] = [
    (elasticity, 0.15, {"joint_elasticity": {"stiffness": STIFFNESS}}),
    (damped, 0.15, {"joint_elasticity": {"stiffness": STIFFNESS, "damping": DAMPING}}),
    (hardening, 0.15, {"joint_elasticity": {"stiffness": STIFFNESS, "cubic_stiffness": CUBIC}}),
    (
        lossy,
        0.15,
        {"joint_elasticity": {"stiffness": STIFFNESS}, "gear_hysteresis": {"torque": LOSS, "travel": TRAVEL}},
    ),
    (delay, 0.15, {"sensor_delay": {"delay": 0.004}}),
    (backlash, 0.15, {"backlash": {"half_width": 2e-4}}),
    (both, 0.15, {"joint_elasticity": {"stiffness": STIFFNESS}, "sensor_delay": {"delay": 0.004}}),
    (eccentricity, 1.0, {"encoder_eccentricity": {"cosine": 1e-4, "sine": 2e-4}}),
    (motor_eccentricity, 0.05, {"encoder_eccentricity": {"cosine": -5e-5, "sine": 0.0}}),
]

#: More than one are a proof.
SEEDS = [0, *(pytest.param(seed, marks=pytest.mark.proof) for seed in (1, 2))]


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize(("gap", "turns", "truth"), TRUTHS, ids=lambda value: getattr(value, "__name__", ""))
def test_simulated_gear_effects_are_named(
    gap: Gap, turns: float, truth: dict[str, dict[str, float]], seed: int
) -> None:
    result = diagnose(gap, seed, turns=turns)
    assert {finding.effect for finding in result.findings} == set(truth)
    assert {rung.effect for rung in result.ladder if rung.kept} <= set(truth)
    for finding in result.findings:
        assert not finding.ambiguous_with
        for name, value in truth[finding.effect].items():
            estimate = finding.parameters[name]
            low, high = estimate.ci95
            half = SLACK * max(high - estimate.value, estimate.value - low)
            assert abs(value - estimate.value) <= half, (name, value, estimate)
    assert [item.channel for item in result.mismatch] == ["joint1.position"]


@pytest.mark.parametrize("seed", SEEDS)
def test_gear_twist_by_output_friction_is_not_named_as_a_delay(seed: int) -> None:
    """Friction c over stiffness K moves the joint as a delay of c/K = 0.3 ms would.

    The torque's sensor is so noisy that the torque of the links says more.
    """

    def behind(motion: Motion) -> Array:
        return -(motion.link_torque + 60.0 * motion.velocity) / STIFFNESS

    def late(motion: Motion) -> Array:
        return behind(motion) + delay(motion)

    noise = 30 * TORQUE_NOISE
    found = diagnose(behind, seed, viscous=60.0, torque_noise=noise)
    assert {finding.effect for finding in found.findings} == {"joint_elasticity"}
    assert any("no delay of its encoder is named" in words for words in found.could_not_tell)
    found = diagnose(late, seed, viscous=60.0, torque_noise=noise)
    assert {finding.effect for finding in found.findings} >= {"joint_elasticity", "sensor_delay"}


@pytest.mark.proof
@pytest.mark.parametrize("validate", [True, False])
def test_ideal_gear_gives_no_finding(*, validate: bool) -> None:
    for seed in range(20):
        result = diagnose(nothing, seed, validate=validate)
        assert result.findings == ()
        # One in twenty p-values of pure noise is below 0.05; the tolerance of the floor makes it rarer.
        assert all(item.p_value > 1e-4 for item in result.mismatch)


def test_holds_out_stretches_without_a_validation_recording() -> None:
    result = diagnose(both, 5, validate=False)
    assert {finding.effect for finding in result.findings} == {"joint_elasticity", "sensor_delay"}
    (series,) = result.series
    # Two stretches of eight, to within the rows that a division leaves over.
    assert series.held_out.mean() == pytest.approx(0.25, abs=0.02)


def test_held_out_error_of_the_twist_reaches_the_noise() -> None:
    result = diagnose(both, 7)
    errors = result.fit["joint1.position - joint1.motor_position"]
    # The truth is in the catalogue, so only noise is left; 30 % is room for filter edges and rounding.
    assert errors.after.validation_rms < 1.3 * errors.noise_floor
    assert errors.before.validation_rms > 50 * errors.noise_floor


def test_constant_offset_between_encoders_is_not_a_finding() -> None:
    result = diagnose(lambda motion: np.full(motion.time.size, 0.01), 3)
    assert result.findings == ()
    assert any("0.01 rad" in sentence and "zero error" in sentence for sentence in result.could_not_tell)


def test_gear_is_not_diagnosed_without_two_encoders() -> None:
    full = recording(Motion(0), np.zeros(Motion(0).time.size), 0)
    channels = {name: values for name, values in full.channels.items() if name != "joint1.position"}
    single = Recording(time=full.time, channels=channels, source="one encoder")
    assert diagnose_transmission(ROBOT, [single], [], along=along_each(ROBOT, [single])) is None
