"""Recordings with too many samples are decimated behind a filter, with a message."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from missing_physics.api import diagnosing, inspect
from missing_physics.api.thinning import thinned
from missing_physics.cli import UNUSABLE_INPUT, main
from missing_physics.diagnosis import most_samples
from missing_physics.recordings import decimated, load_recording, sensor_of, write_recording
from missing_physics.standard.band import band_motion
from robot_model import InputError, Recording, Sensor, load_robot


def made(count: int = 40_000, rate: float = 1000.0, **channels: np.ndarray) -> Recording:
    time = np.arange(count) / rate
    position = np.sin(2 * np.pi * 0.7 * time)
    return Recording(time, {"joint1.position": position, "joint1.torque": 5.0 * position, **channels})


@pytest.mark.parametrize("factor", [2, 7, 40])
def test_decimation_keeps_the_passband_and_removes_the_stopband(factor: int) -> None:
    half = 500.0 / factor
    time = np.arange(40_000) / 1000.0
    low, high = (np.sin(2 * np.pi * part * half * time) for part in (0.7, 1.15))
    found = decimated(made(**{"a.torque": low, "b.torque": high}), factor)
    inner = slice(20, -20)
    np.testing.assert_allclose(found.time, time[::factor], atol=1e-9)
    wanted = np.sin(2 * np.pi * 0.7 * half * found.time)
    np.testing.assert_allclose(found["a.torque"][inner], wanted[inner], atol=3e-4)
    assert np.abs(found["b.torque"][inner]).max() < 3e-4


def test_stated_white_noise_is_reduced_by_the_decimation_filter() -> None:
    noise = np.random.default_rng(1).standard_normal(200_000)
    recording = Recording(np.arange(noise.size) / 1e3, {"joint1.torque": noise}, noise={"joint1.torque": 1.0})
    found = decimated(recording, 25)
    assert found.noise["joint1.torque"] == pytest.approx(found["joint1.torque"].std(), rel=0.03)


def test_noise_of_the_robot_file_is_reduced_by_the_decimation_filter() -> None:
    """As a diagnosis takes it: the filter leaves less, and no steps; a slow channel keeps its own."""
    chance = np.random.default_rng(2)
    long = made(200_000)
    white = {name: 0.3 * chance.standard_normal(len(long)) for name in long}
    noisy = long.with_channels({name: long[name] + white[name] for name in long})
    slow = np.full(len(long), np.nan)
    slow[::250] = 300.0
    noisy = noisy.with_channels({"joint1.temperature": slow})
    sensors = (
        Sensor(channel="joint1.position", noise=0.3),
        Sensor(channel="joint1.torque", noise=0.18, resolution=0.24 * np.sqrt(12.0)),
        Sensor(channel="joint1.temperature", noise=2.0),
    )
    robot = load_robot("single_axis").model_copy(update={"sensors": sensors})
    (found,) = thinned(robot, [noisy], rate=40.0, tell=lambda _: None)
    left = {
        name: (found[name] - thinned(robot, [long], rate=40.0, tell=lambda _: None)[0][name]).std()
        for name in long
    }
    motion = band_motion(robot, found, 2.0)
    assert motion.torque_noise == pytest.approx([left["joint1.torque"]], rel=0.03)
    assert found.noise["joint1.position"] == pytest.approx(left["joint1.position"], rel=0.03)
    assert found.noise["joint1.temperature"] == 2.0
    assert sensor_of(robot, found, "joint1.torque").resolution == 0.0


def test_noise_of_the_recording_takes_precedence_over_the_robot_file() -> None:
    recording = replace(made(), noise={"joint1.torque": 0.5})
    sensor = Sensor(channel="joint1.torque", noise=0.1)
    robot = load_robot("single_axis").model_copy(update={"sensors": (sensor,)})
    assert band_motion(robot, recording, 2.0).torque_noise == pytest.approx([0.5])
    assert band_motion(robot, made(), 2.0).torque_noise == pytest.approx([0.1])


def test_decimation_keeps_gaps_and_separate_clocks() -> None:
    recording = made()
    slow = np.full(len(recording), np.nan)
    slow[::250] = 300.0 + recording.time[::250]
    kept = (recording.time < 15.0) | (recording.time > 20.0)
    whole = recording.with_channels({"joint1.temperature": slow})
    cut = Recording(recording.time[kept], {name: values[kept] for name, values in whole.channels.items()})
    found = decimated(cut, 20)
    assert np.diff(found.time).max() == pytest.approx(5.0, abs=0.05)
    np.testing.assert_allclose(found["joint1.position"], np.sin(2 * np.pi * 0.7 * found.time), atol=2e-3)
    there = np.isfinite(found["joint1.temperature"])
    assert 0.05 < there.mean() < 0.15
    np.testing.assert_allclose(found["joint1.temperature"][there], 300.0 + found.time[there], atol=1e-6)


@settings(max_examples=25, deadline=None)
@given(
    count=st.integers(50, 3000),
    factor=st.integers(1, 40),
    jitter=st.floats(0.0, 0.4),
    missing=st.floats(0.0, 0.9),
    seed=st.integers(0, 99),
)
def test_any_recording_is_decimated_or_rejected_with_one_sentence(
    count: int, factor: int, jitter: float, missing: float, seed: int
) -> None:
    chance = np.random.default_rng(seed)
    time = (np.arange(count) + jitter * chance.uniform(-1, 1, count)) / 100.0
    values = np.where(chance.uniform(size=count) < missing, np.nan, np.sin(time))
    recording = Recording(time, {"joint1.position": np.sin(time), "joint1.torque": values}, source="log")
    if factor > 1 and count <= 4 * factor:
        with pytest.raises(InputError, match="log is cut by gaps into parts of less than"):
            decimated(recording, factor)
        return
    found = decimated(recording, factor)
    assert len(found) <= count
    assert np.isfinite(found["joint1.position"]).all()
    assert np.nanmax(np.abs(found["joint1.torque"]), initial=0.0) < 2.0


def test_too_many_samples_are_thinned_and_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("missing_physics.motion.recorded.MOST_SAMPLES", 50_000)
    robot, told = load_robot("single_axis"), []
    most = most_samples(robot)
    long = made(most + 10_000)
    (found,) = thinned(robot, [long], tell=told.append)
    assert len(found) <= most
    assert f"{len(long)} samples at 1000 Hz become {len(found)} at 500 Hz, since a diagnosis" in told[0]
    assert thinned(robot, [made()], tell=told.append)[0].same_values(made())
    (slower,) = thinned(robot, [made()], rate=100.0, tell=told.append)
    assert slower.sample_rate == pytest.approx(100.0)
    with pytest.raises(InputError, match="60000 samples at 1000 Hz, and at most 50000 are taken"):
        thinned(robot, [long], rate=1000.0, tell=told.append)
    with pytest.raises(InputError, match="must be positive"):
        thinned(robot, [made()], rate=0.0, tell=told.append)


def test_diagnosis_and_inspection_limit_the_number_of_samples(monkeypatch: pytest.MonkeyPatch) -> None:
    robot, lengths = load_robot("two_link_arm"), []

    def run(_: object, fitted: list[Recording], scored: list[Recording], **__: object) -> None:
        lengths.extend(map(len, (*fitted, *scored)))
        raise InputError("enough.")

    monkeypatch.setattr(diagnosing, "run_diagnosis", run)
    two = made(4000)
    two = two.with_channels({f"joint2.{name}": two[f"joint1.{name}"] for name in ("position", "torque")})
    with pytest.warns(UserWarning, match="become 400 at 100 Hz"), pytest.raises(InputError, match="enough"):
        diagnosing.diagnose(robot, two, two, rate=100.0, as_recorded=True)
    assert lengths == [400, 400]
    monkeypatch.setattr("missing_physics.motion.recorded.MOST_SAMPLES", 4000)
    notes = [finding for finding in inspect(two, robot).problems if finding.kind == "too_many"]
    assert "4000 samples at 1000 Hz become 1000 at 250 Hz" in notes[0].sentence


def test_parts_in_brackets(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    write_recording(made(2000), tmp_path / "log.csv")
    part = load_recording(f"{tmp_path / 'log.csv'}[0.5:1.5]", check=False)
    assert (part.time[0], len(part)) == (pytest.approx(0.5), 1000)
    assert load_recording(f"{tmp_path / 'log.csv'}[1.9:]", check=False).time[0] == pytest.approx(1.9)
    monkeypatch.setattr("sys.argv", ["x", "inspect", f"{tmp_path / 'log.csv'}[2:1]"])
    with pytest.raises(SystemExit) as left:
        main()
    assert left.value.code == UNUSABLE_INPUT
    assert "two instants in seconds are expected" in capsys.readouterr().err
