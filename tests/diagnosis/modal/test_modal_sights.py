"""Strain gauges, tip and gyro in the smoother of a flexible robot's modal motion."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import stats

from missing_physics.diagnosis.least_squares.problem import Segment
from missing_physics.diagnosis.preparation.setup import (
    build_problem,
    inertial_basis,
    make_dynamics,
    make_segments,
)
from reference_model.plant.sensing import measure
from reference_model.simulation import simulate
from robot_model import MultiSine, Recording, Reference, Robot, Sensor, load_robot

Array = NDArray[np.float64]

STRAIN = ("link2.strain.1", "link2.strain.2")
TIP = ("link2.tip_deflection.y", "link2.tip_deflection.z")
GYRO = tuple(f"base.angular_velocity.{axis}" for axis in "xyz")
ATTITUDE = tuple(f"base.attitude.{part}" for part in "wxyz")
ACCELEROMETER = tuple(f"base.linear_acceleration.{axis}" for axis in "xyz")
TIP_ACCELEROMETER = tuple(f"link2.tip_acceleration.{axis}" for axis in "xyz")
NOISE = dict.fromkeys(STRAIN, 2e-7) | dict.fromkeys(TIP, 1e-5) | dict.fromkeys(GYRO, 1e-6)
NOISE |= dict.fromkeys(ATTITUDE, 2e-7) | dict.fromkeys((*ACCELEROMETER, *TIP_ACCELEROMETER), 1e-4)
JOINTS = ("joint1.position", "joint1.torque", "joint2.position", "joint2.torque")
SEED = 10840
#: Noise of coarse encoders [rad] and torques [N m].
COARSE = {"position": 5e-5, "torque": 0.5}
#: Chance that a right covariance fails its band.
ERRS = 1e-3


@lru_cache(maxsize=2)
def robot(*, coarse: bool = False) -> Robot:
    """The flexible space robot without effects, with gauges, a tip that is seen, and a gyro.

    Its encoders and torques are so good that gauges add little; `coarse` ones are what many arms have.
    """
    described = load_robot("flexible_space_robot")
    joints = tuple(
        MultiSine(
            joint=f"joint{k + 1}",
            amplitudes=(0.2, 0.08),
            frequencies=(0.06 + 0.02 * k, 0.17 + 0.04 * k),
            phases=(0.6 * k, 1.0 + k),
            ramp=5.0,
        )
        for k in range(2)
    )
    sensors = tuple(
        sensor.model_copy(update={"noise": COARSE[sensor.channel.split(".")[1]]}) if coarse else sensor
        for sensor in described.sensors
        if sensor.channel in JOINTS
    )
    sensors += tuple(Sensor(channel=channel, noise=noise) for channel, noise in NOISE.items())
    reference = Reference(duration=15.0, sample_rate=200.0, joints=joints)
    return described.model_copy(update={"reference": reference, "effects": (), "sensors": sensors})


@lru_cache(maxsize=1)
def truth() -> Recording:
    return simulate(robot(), sensors=False)


def recorded(seed: int, *channels: str, coarse: bool = False) -> Recording:
    """Encoders, torques and `channels`."""
    whole = measure(robot(coarse=coarse), truth().time, truth().channels, seed=seed, source="")
    return replace(whole, channels={c: whole[c] for c in (*JOINTS, *channels)})


@dataclass(frozen=True)
class Modal:
    """Errors of the modal coordinates at some instants, their covariance, whitened innovations."""

    error: Array
    covariance: Array
    white: Array
    torque: Array
    loaded: bool

    @property
    def square(self) -> float:
        """Mean normalised square."""
        solved = np.linalg.solve(self.covariance, self.error[:, :, None])[:, :, 0]
        return float(np.mean(np.sum(self.error * solved, axis=1)) / self.error.shape[1])

    @property
    def rms(self) -> float:
        """Rms of the errors."""
        return float(np.sqrt(np.mean(self.error**2)))

    @property
    def stated(self) -> float:
        """Stated rms."""
        return float(np.sqrt(np.trace(self.covariance, axis1=1, axis2=2).mean()))


def smoothed(recording: Recording, described: Robot | None = None) -> Modal:
    described = described or robot(coarse=True)
    dynamics = make_dynamics(described, [recording])[0]
    smoother = Segment(described, dynamics, dynamics.motion).vibration
    assert smoother is not None
    assert dynamics.inner is not None
    rows = np.arange(300, dynamics.motion.time.size - 100, 200)
    found = smoother.corrections(rows)
    n, s = smoother.response.joints, smoother.response.modes
    true = np.column_stack([truth()[f"link2.modal_coordinate.{k + 1}"] for k in range(s)])
    error = (true - dynamics.inner.modal)[rows] - found.mean[:, n : n + s]
    covariance = found.covariance[:, n : n + s, n : n + s]
    return Modal(error, covariance, found.innovations, smoother.torque, smoother.walks["load"] > 0)


@lru_cache(maxsize=1)
def without() -> Modal:
    return smoothed(recorded(SEED, coarse=True))


def with_strain() -> Recording:
    return recorded(SEED, *STRAIN, coarse=True)


def band(found: Modal) -> tuple[float, float]:
    low, high = stats.chi2.ppf([ERRS / 2, 1 - ERRS / 2], found.error.size) / found.error.size
    return float(low), float(high)


@pytest.mark.parametrize(
    ("channels", "better"),
    [
        (STRAIN, 1.6),
        pytest.param(TIP, 4.0, marks=pytest.mark.proof),
        pytest.param(GYRO, 3.0, marks=pytest.mark.proof),
        pytest.param(ATTITUDE, 1.4, marks=pytest.mark.proof),
        pytest.param(ACCELEROMETER, 2.0, marks=pytest.mark.proof),
        pytest.param(TIP_ACCELEROMETER, 2.0, marks=pytest.mark.proof),
    ],
    ids=["strain", "tip", "gyro", "attitude", "accelerometer", "tip's accelerometer"],
)
def test_a_channel_makes_the_modes_surer_and_says_by_how_much(
    channels: tuple[str, ...], better: float
) -> None:
    blind, seen = without(), smoothed(recorded(SEED, *channels, coarse=True))
    assert seen.stated * better < blind.stated
    assert seen.rms * 0.8 * better < blind.rms  # thirteen instants tell an rms to a tenth
    low, high = band(seen)
    # where loads are allowed for that are not there the modes are surer than what is said
    assert (0.1 if seen.loaded else low) < seen.square < high
    # 3000 samples tell a variance to 3 %; a floor stands beside the noise of an attitude that is so exact
    power = np.nanmean(seen.white**2, axis=0)
    assert np.all((power > 0.8) & (power < 1.1))


def test_samples_that_are_missing_are_not_made_up() -> None:
    """A gauge at a quarter of the rate, and one that fails for a while: the modes are less sure."""
    whole = with_strain()
    time = np.arange(len(whole))
    one, other = (whole[channel].copy() for channel in STRAIN)
    one[time % 4 != 0] = np.nan
    other[(time > 1000) & (time < 2000)] = np.nan
    holed = smoothed(whole.with_channels(dict(zip(STRAIN, (one, other)))))
    assert np.isnan(holed.white[:, 2]).sum() == np.isnan(one).sum()
    assert np.isnan(holed.white[:, 3]).sum() == np.isnan(other).sum()
    assert smoothed(whole).stated < holed.stated < without().stated
    low, high = band(holed)
    assert low < holed.square < high


def test_a_channel_that_holds_nothing_changes_nothing() -> None:
    plain = recorded(SEED, coarse=True)
    empty = plain.with_channels({channel: np.full(len(plain), np.nan) for channel in (*STRAIN, *GYRO)})
    np.testing.assert_array_equal(smoothed(empty).torque, without().torque)


def test_noise_that_nobody_stated_is_estimated() -> None:
    plain = replace(with_strain(), noise={}, resolution={})
    found = smoothed(plain, robot().model_copy(update={"sensors": ()}))
    low, high = band(found)
    assert low < found.square < high
    assert np.all(np.abs(np.nanmean(found.white**2, axis=0) - 1.0) < 0.1)


@pytest.mark.parametrize(
    "stated",
    [True, pytest.param(False, marks=pytest.mark.proof)],
    ids=["noise stated", "noise estimated"],
)
def test_zero_and_gain_of_a_gauge_are_no_vibration(stated: bool) -> None:
    """Zero and gain are estimated: the modes are as sure as with a right gauge, and as right."""
    plain = with_strain()
    wrong = plain.with_channels({channel: 1.04 * plain[channel] + 1e-4 for channel in STRAIN})
    described = robot(coarse=True)
    if not stated:
        wrong = replace(wrong, noise={}, resolution={})
        described = described.model_copy(update={"sensors": ()})
    found = smoothed(wrong, described)
    assert found.rms < 0.8 * without().rms
    low, high = band(found)
    assert low < found.square < high


@pytest.mark.parametrize(
    "factor", [-1.0, pytest.param(1e6, marks=pytest.mark.proof)], ids=["reversed", "microstrain"]
)
def test_a_gauge_that_is_not_what_its_name_says_is_not_looked_at(factor: float) -> None:
    plain = with_strain()
    wrong = plain.with_channels({channel: factor * plain[channel] for channel in STRAIN})
    np.testing.assert_array_equal(smoothed(wrong).torque, without().torque)


def test_what_a_gauge_makes_up_is_not_believed() -> None:
    """A vibration as large as the bending, of which encoders and torques know nothing."""
    plain = with_strain()
    ringing = np.sin(5.0 * plain.time)
    wrong = plain.with_channels({c: plain[c] + np.std(plain[c]) * ringing for c in STRAIN})
    assert smoothed(wrong).rms < 1.3 * without().rms


@pytest.mark.proof
def test_what_noise_of_all_channels_leaves_in_the_torques_is_predicted() -> None:
    described = robot(coarse=True)
    segments = make_segments(described, [recorded(10842, *NOISE, coarse=True)])
    problem = build_problem(segments, inertial_basis(described, segments))
    left = np.sqrt(np.mean(problem.residual[:, :2] ** 2, axis=0))
    # noise below 2 Hz in 15 s: 60 independent numbers tell an rms to a tenth
    np.testing.assert_allclose(left, problem.noise_floor[:2], rtol=0.3)
