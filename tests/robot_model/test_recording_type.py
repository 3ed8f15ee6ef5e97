"""The `Recording` type: inputs it rejects and properties it guarantees."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from numpy.typing import NDArray

from robot_model import QUANTITIES, InputError, Recording, unit_of

times = (
    arrays.arrays(np.float64, st.integers(0, 40), elements=st.floats(-1e6, 1e6), unique=True)
    .map(np.sort)
    .map(lambda column: column[np.r_[True, np.diff(column) > 0]] if column.size else column)
)


def recording(time: NDArray[np.float64] | list[float], **names: object) -> Recording:
    return Recording(time=time, channels={"joint1.position": np.arange(len(time))}, source="log.csv", **names)  # type: ignore[arg-type]


def test_arrays_are_read_only_copies() -> None:
    time, position = np.arange(3.0), np.ones(3)
    made = Recording(time=time, channels={"joint1.position": position})
    time[0], position[0] = -5.0, 9.0
    assert made.time[0] == 0.0
    assert made["joint1.position"][0] == 1.0
    for column in (made.time, made["joint1.position"]):
        with pytest.raises(ValueError, match="read-only"):
            column[0] = 7.0


def test_mappings_are_read_only_copies() -> None:
    noise = {"joint1.position": 1e-3}
    made = recording([0.0, 1.0], noise=noise)
    noise["joint1.position"] = 5.0
    assert made.noise["joint1.position"] == 1e-3
    for mapping in (made.channels, made.noise, made.resolution):
        with pytest.raises(TypeError):
            mapping["x"] = 1.0  # type: ignore[index]


@pytest.mark.parametrize(
    ("time", "sentence"),
    [
        ([0.0, 2.0, 1.0], "time does not rise at row 2 of log.csv (2 s is followed by 1 s)."),
        ([0.0, 1.0, 1.0], "time does not rise at row 2 of log.csv (1 s is followed by 1 s)."),
        ([0.0, np.nan, 1.0], "time is not a number at row 1 of log.csv."),
        ([np.inf, 1.0], "time is not a number at row 0 of log.csv."),
    ],
)
def test_time_must_be_increasing_numbers(time: list[float], sentence: str) -> None:
    with pytest.raises(InputError) as caught:
        recording(time)
    assert str(caught.value) == sentence


def test_lengths_must_agree() -> None:
    with pytest.raises(InputError, match=r"^joint1.torque has 2 samples but time has 3\.$"):
        Recording(time=np.arange(3.0), channels={"joint1.torque": np.ones(2)})


def test_a_channel_is_one_column() -> None:
    with pytest.raises(InputError, match=r"^joint1.torque has 2 dimensions; a channel is one column"):
        Recording(time=np.arange(3.0), channels={"joint1.torque": np.ones((3, 2))})


def test_a_channel_is_numbers() -> None:
    with pytest.raises(InputError, match=r"^joint1.torque holds something that is no number"):
        Recording(time=np.arange(2.0), channels={"joint1.torque": ["a", "b"]})  # type: ignore[dict-item]


def test_missing_samples_are_allowed_in_channels() -> None:
    made = Recording(time=np.arange(2.0), channels={"joint1.torque": np.array([np.nan, 1.0])})
    assert np.isnan(made["joint1.torque"][0])


def test_a_missing_channel_suggests_the_nearest() -> None:
    with pytest.raises(InputError) as caught:
        recording([0.0, 1.0])["joint1.positon"]
    assert str(caught.value) == ("log.csv has no channel 'joint1.positon'; did you mean 'joint1.position'?")


@given(times, st.floats(-2e6, 2e6), st.floats(-2e6, 2e6))
def test_adjacent_windows_partition_a_recording(time: NDArray[np.float64], a: float, b: float) -> None:
    made = recording(time)
    first, second = min(a, b), max(a, b)
    parts = [made.window(*ends) for ends in ((-np.inf, first), (first, second), (second, np.inf))]
    assert np.array_equal(np.concatenate([part.time for part in parts]), made.time)
    joined = np.concatenate([part["joint1.position"] for part in parts])
    assert np.array_equal(joined, made["joint1.position"])
    assert np.all((parts[1].time >= first) & (parts[1].time < second))


def test_windows_keep_noise_and_resolution() -> None:
    made = recording([0.0, 1.0, 2.0], noise={"joint1.position": 1e-3}, resolution={"joint1.position": 1e-4})
    cut = made.window(0.5, 2.0)
    assert list(cut.time) == [1.0]
    assert (cut.source, dict(cut.noise), dict(cut.resolution)) == (
        "log.csv",
        {"joint1.position": 1e-3},
        {"joint1.position": 1e-4},
    )


@given(times)
def test_length_duration_and_rate(time: NDArray[np.float64]) -> None:
    made = recording(time)
    assert len(made) == time.size
    assert made.duration == (time[-1] - time[0] if time.size > 1 else 0.0)
    if time.size > 1:
        assert np.diff(time).min() <= 1 / made.sample_rate * (1 + 1e-12)  # the division rounds twice
        assert 1 / made.sample_rate <= np.diff(time).max() * (1 + 1e-12)
    else:
        assert np.isnan(made.sample_rate)


def test_channels_can_be_added_without_changing_the_first() -> None:
    made = recording([0.0, 1.0])
    more = made.with_channels({"joint1.torque": [3.0, 4.0]})
    assert list(more) == ["joint1.position", "joint1.torque"]
    assert "joint1.torque" not in made


@pytest.mark.parametrize(
    ("channel", "prismatic", "unit"),
    [
        ("joint1.torque", False, "N m"),
        ("joint1.torque", True, "N"),
        ("joint1.position", False, "rad"),
        ("joint1.velocity", True, "m/s"),
        ("joint1.current", True, "A"),
        ("base.position.x", False, "m"),
        ("base.angular_velocity.z", False, "rad/s"),
        ("joint1.colour", False, "-"),
        ("time", False, "s"),
    ],
)
def test_units(channel: str, prismatic: bool, unit: str) -> None:
    assert unit_of(channel, prismatic=prismatic) == unit


def test_every_quantity_has_a_unit() -> None:
    assert all(QUANTITIES.values())
