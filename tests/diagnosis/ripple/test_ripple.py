"""Waves over position that are faster than the band of the motion."""

from __future__ import annotations

import numpy as np
import pytest
from end_to_end_cases import AXIS
from scipy.signal import welch

from missing_physics.diagnosis import diagnose
from missing_physics.diagnosis.ripple.whitening import Whitening
from missing_physics.diagnosis.ripple.zeros import zeros_of
from missing_physics.hypotheses import Sight
from reference_model.simulation import simulate
from robot_model import EffectUse, Recording

#: Amplitude [N], and angular order [1/m]: once in 4 mm. The axis moves at up to 0.16 m/s.
SINE, ORDER = 1.5, 2.0 * np.pi / 4e-3


def rippled(seed: int, zero: float = 0.0) -> Recording:
    """The axis with a ripple, its encoder switched on at another place."""
    ripple = EffectUse(effect="torque_ripple", at="joint1", cosine=0.0, sine=SINE, order=ORDER)
    made = simulate(AXIS.with_effects(ripple), seed=seed)
    return made.with_channels({"joint1.position": made["joint1.position"] + zero})


def test_a_ripple_above_the_band_is_named_with_its_order_and_amplitude() -> None:
    result = diagnose(AXIS, [rippled(1)])
    [found] = result.diagnosis.findings
    assert (found.effect, found.location) == ("torque_ripple", "joint1")
    # The band ends below what it makes at a tenth of a metre per second.
    assert result.diagnosis.fit.bands[0].torque < 0.1 * ORDER / (2.0 * np.pi)
    order, sine = found.parameters["order"], found.parameters["sine"]
    assert order.ci95[0] <= ORDER <= order.ci95[1]
    assert sine.value == pytest.approx(SINE, abs=0.1 * SINE)
    assert "One cycle is 0.004 m" in found.note
    assert "torque_ripple" in result.augmented_robot_toml


def test_a_ripple_is_proven_on_a_recording_whose_encoder_has_another_zero() -> None:
    result = diagnose(AXIS, [rippled(1)], [rippled(2, zero=1.3e-3)])
    [found] = result.diagnosis.findings
    assert found.effect == "torque_ripple"
    assert found.validation_improvement > 0.05  # with the other zero it would rise


def test_a_ripple_is_proven_on_a_recording_of_another_sampling_rate() -> None:
    other = rippled(2)
    every_third = Recording(
        time=other.time[::3], channels={name: other[name][::3] for name in other.channels}, source="slower"
    )
    result = diagnose(AXIS, [rippled(1)], [every_third])
    [found] = result.diagnosis.findings
    assert found.effect == "torque_ripple"
    assert found.validation_improvement > 0.05  # filtered for another rate, the wave would not be there


def test_a_wave_passes_the_filter_alike_at_every_sampling_rate() -> None:
    rng = np.random.default_rng(0)
    series, rates = [rng.normal(size=20_000), rng.normal(size=8_000)], [1000.0, 400.0]
    white = Whitening.of(series, rates, low=5.0, high=80.0)
    assert white is not None

    def passed(rate: float) -> float:
        wave = np.sin(2.0 * np.pi * 20.0 * np.arange(int(4.0 * rate)) / rate)
        return float(white(wave, rate)[int(rate) : int(3.0 * rate)].std())

    assert passed(1000.0) == pytest.approx(passed(400.0), rel=0.01)  # interpolation of the gain


def test_whitened_noise_is_white_and_as_large_as_before() -> None:
    rate, low, high = 500.0, 5.0, 100.0
    noise = np.random.default_rng(0).normal(size=60_000)
    coloured = np.convolve(noise, np.exp(-np.arange(60) / 12.0), mode="same")
    white = Whitening.of([coloured], [rate], low=low, high=high)
    assert white is not None
    found = white(coloured, rate)
    frequencies, density = welch(found, fs=rate, nperseg=1024)
    inside = (frequencies > 1.5 * low) & (frequencies < 0.7 * high)
    assert density[inside].max() < 1.6 * density[inside].min()  # 117 segments: 9 % each, 3.5 deviations
    before = welch(coloured, fs=rate, nperseg=1024)[1]
    energy = np.sum(before[(frequencies > low) & (frequencies < high)]) * frequencies[1]
    assert found.std() == pytest.approx(np.sqrt(energy), rel=0.1)  # flanks of the band
    assert white.level == pytest.approx(found.std(), rel=0.05)


@pytest.mark.parametrize("noise", [0.0, 1.0, 30.0])
def test_noise_of_encoders_is_no_acceleration(noise: float) -> None:
    """Of a column of variance 1 + noise^2 the torque shares one part."""
    random = np.random.default_rng(5)
    true, wrong, rate = *random.normal(size=(2, 40000)), 1000.0
    column, torque = true + noise * wrong, true + 0.5 * random.normal(size=40000)
    white = Whitening.of([torque], [rate], low=20.0, high=200.0)
    assert white is not None
    shared = white.sharing([column], [torque], [rate]).shared
    assert shared is not None
    # A spectrum of some hundred segments is known to a tenth; the median over an octave averages these.
    assert shared == pytest.approx(1.0 / (1.0 + noise**2), abs=0.1)


def test_a_silent_joint_has_no_whitening() -> None:
    assert Whitening.of([np.zeros(1000)], [500.0], low=5.0, high=100.0) is None


@pytest.mark.parametrize("shift", [0.0, 4e-3, -7e-3])
def test_the_zero_of_an_encoder_is_found_from_the_phase_of_a_wave(shift: float) -> None:
    time = np.linspace(0.0, 10.0, 5000)
    position = 0.5 * np.sin(2.0 * np.pi * 0.2 * time)
    rng = np.random.default_rng(1)

    def sight(zero: float) -> Sight:
        return Sight(
            time=time,
            position=position + zero,
            velocity=np.gradient(position, time),
            torque=np.zeros_like(time),
            residual=np.sin(200.0 * position) + rng.normal(size=time.size),
            step=2e-3,
            cutoff=100.0,
            gear_ratio=1.0,
        )

    first, other = zeros_of([sight(0.0), sight(shift)], variance=1.0)
    assert first == 0.0
    assert other == pytest.approx(-shift, abs=5e-4)  # a tenth of a radian of phase
    assert other == 0.0 or shift != 0.0
