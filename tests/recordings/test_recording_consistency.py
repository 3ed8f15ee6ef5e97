"""Channels against each other, and the map that corrects them: every corruption is named with it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from missing_physics.recordings import (
    Correction,
    Finding,
    consistency_findings,
    corrected,
    corrected_map,
    in_words,
    load_mapping,
    load_recording,
    mapping_from_toml,
    require_consistent,
    write_recording,
)
from robot_model import InputError, Recording, load_robot

Array = NDArray[np.float64]
DEGREES = 180.0 / np.pi
ATTITUDE = tuple(f"base.attitude.{axis}" for axis in "wxyz")
GYRO = tuple(f"base.angular_velocity.{axis}" for axis in "xyz")
TIME = np.arange(4000) / 200.0


def sines(*parts: tuple[float, float, float]) -> tuple[Array, Array]:
    """Sum of amplitude, frequency [Hz], phase, and its rate."""
    value = sum(a * np.sin(2 * np.pi * f * TIME + p) for a, f, p in parts)
    rate = sum(a * 2 * np.pi * f * np.cos(2 * np.pi * f * TIME + p) for a, f, p in parts)
    return np.asarray(value), np.asarray(rate)


@pytest.fixture(scope="module")
def two() -> Recording:
    """Two joints whose motions look alike, 0.5 and -0.8 of the same curve and a little more."""
    chance = np.random.default_rng(7)
    channels = {}
    for k, size in enumerate((0.5, -0.8)):
        q, v = sines((size, 0.2, 0.3), (0.02, 0.53 + 0.2 * k, 1.0 + k))
        name = f"joint{k + 1}"
        channels[f"{name}.position"] = q + 1e-5 * chance.standard_normal(q.size)
        channels[f"{name}.reference_position"] = q
        channels[f"{name}.motor_position"] = q + 1e-5 * chance.standard_normal(q.size)
        channels[f"{name}.velocity"] = v + 1e-3 * chance.standard_normal(q.size)
    return Recording(time=TIME, channels=channels, source="two.csv")


def product(a: Array, b: Array) -> Array:
    w = a[:, :1] * b[:, :1] - np.sum(a[:, 1:] * b[:, 1:], axis=1, keepdims=True)
    return np.hstack([w, a[:, :1] * b[:, 1:] + b[:, :1] * a[:, 1:] + np.cross(a[:, 1:], b[:, 1:])])


def turning(size: float, seed: int = 3) -> tuple[Array, Array]:
    """Attitude w, x, y, z and angular velocity in base axes of a base that turns by some `size` rad.

    The attitude is a product of turns about z, then y, then x, whose rates are known in closed form.
    """
    chance = np.random.default_rng(seed)
    angles, rates = zip(
        *(
            sines((size, 0.11 * (k + 1), p), (0.4 * size, 0.37, p))
            for k, p in enumerate(chance.uniform(0, 6, 3))
        )
    )
    attitude = np.tile([1.0, 0.0, 0.0, 0.0], (TIME.size, 1))
    for axis in (2, 1, 0):
        part = np.zeros((TIME.size, 4))
        part[:, 0], part[:, 1 + axis] = np.cos(angles[axis] / 2), np.sin(angles[axis] / 2)
        attitude = product(attitude, part)
    roll, pitch = angles[0], angles[1]
    dr, dp, dy = rates
    body = np.column_stack(
        [
            dr - dy * np.sin(pitch),
            dp * np.cos(roll) + dy * np.sin(roll) * np.cos(pitch),
            -dp * np.sin(roll) + dy * np.cos(roll) * np.cos(pitch),
        ]
    )
    return attitude, body


def flying(attitude: Array, rate: Array) -> Recording:
    chance = np.random.default_rng(11)
    noisy = attitude + 1e-5 * chance.standard_normal(attitude.shape)
    channels = dict(zip(ATTITUDE, noisy.T)) | dict(
        zip(GYRO, (rate + 1e-4 * chance.standard_normal(rate.shape)).T)
    )
    return Recording(time=TIME, channels=channels, source="flyer")


def errors(recording: Recording, **known: object) -> list[Finding]:
    return [f for f in consistency_findings(recording, **known) if f.severity == "error"]  # type: ignore[arg-type]


def corrections(findings: Sequence[Finding]) -> dict[str, tuple[str, float]]:
    return {m.channel: (m.origin, m.scale) for f in findings for m in f.corrections}


def crossed(recording: Recording, *quantities: str) -> Recording:
    """With these channels of the two joints exchanged."""
    swap = {"joint1": "joint2", "joint2": "joint1"}
    return recording.with_channels(
        {f"{p}.{q}": recording[f"{swap[p]}.{q}"] for p in swap for q in quantities}
    )


def test_clean_channels_agree(two: Recording) -> None:
    assert consistency_findings(two) == ()


@pytest.mark.parametrize("quantity", ["velocity", "reference_position", "motor_position"])
def test_exchanged_joints_are_named(two: Recording, quantity: str) -> None:
    seen = errors(crossed(two, quantity))
    assert {f.kind for f in seen} == {"exchanged"}
    assert corrections(seen) == {
        f"joint1.{quantity}": (f"joint2.{quantity}", 1.0),
        f"joint2.{quantity}": (f"joint1.{quantity}", 1.0),
    }
    assert consistency_findings(corrected(crossed(two, quantity), seen[0].corrections)) == ()


def test_exchanged_positions_are_distinguished_from_exchanged_partners(two: Recording) -> None:
    seen = errors(crossed(two, "position"))
    assert corrections(seen) == {
        "joint1.position": ("joint2.position", 1.0),
        "joint2.position": ("joint1.position", 1.0),
    }


@pytest.mark.parametrize(
    ("channel", "factor"),
    [
        *(("velocity", f) for f in (-1.0, DEGREES, 30 / np.pi, 1000.0)),
        *(("reference_position", f) for f in (-1.0, DEGREES, 1000.0)),
        *(("motor_position", f) for f in (-1.0, DEGREES, 160.0, -160.0, 1 / 160.0)),
    ],
)
def test_wrong_factor_is_reported_with_its_correction(two: Recording, channel: str, factor: float) -> None:
    """With the robot's gear ratio of 160 known."""
    name = f"joint1.{channel}"
    wrong = two.with_channels({name: factor * two[name]})
    seen = errors(wrong, robot=load_robot("flexible_space_robot"))
    assert set(corrections(seen)) == {name}
    assert corrections(seen)[name][1] * factor == pytest.approx(1.0, rel=1e-6)


@pytest.mark.parametrize("gain", [0.2, 0.5, 1.5, 2.9])
def test_plausible_sensor_gains_are_not_a_contradiction(two: Recording, gain: float) -> None:
    """Up to the catalogue's limits, offsets besides."""
    for name in ("joint1.motor_position", "joint1.reference_position"):
        assert not errors(two.with_channels({name: gain * two[name] + 0.3}))


def test_exchanged_position_and_reference_are_named(two: Recording) -> None:
    p, r = "joint2.position", "joint2.reference_position"
    seen = [f for f in consistency_findings(two.with_channels({p: two[r], r: two[p]})) if f.channel == r]
    assert [f.severity for f in seen] == ["warning"]
    assert corrections(seen) == {p: (r, 1.0), r: (p, 1.0)}


@pytest.mark.parametrize(("lag", "severity"), [(-0.08, "error"), (0.04, "warning"), (0.25, "error")])
def test_a_velocity_that_lags_is_reported_with_its_delay(two: Recording, lag: float, severity: str) -> None:
    """Only lags that filters make are no error."""
    late = np.interp(TIME - lag, TIME, two["joint1.velocity"])
    (seen,) = consistency_findings(two.with_channels({"joint1.velocity": late}))
    assert (seen.kind, seen.severity, seen.channel) == ("lag", severity, "joint1.velocity")
    assert seen.corrections[0].delay == pytest.approx(lag, abs=0.002)


def test_gravity_in_a_base_acceleration_is_reported(two: Recording) -> None:
    chance = np.random.default_rng(5)
    stem = "base.linear_acceleration"
    for unit, scale in ((9.81, 1.0), (1.0, 9.80665)):
        values = np.outer(np.ones(TIME.size), [0.0, 0.6 * unit, 0.8 * unit])
        values += 0.01 * unit * chance.standard_normal(values.shape)
        read = two.with_channels({f"{stem}.{axis}": values[:, k] for k, axis in enumerate("xyz")})
        (seen,) = consistency_findings(read)
        assert (seen.kind, seen.severity) == ("gravity", "warning")
        assert {m.scale for m in seen.corrections} == ({scale} if scale != 1.0 else set())
    v, a = sines((0.3, 0.2, 0.0), (0.1, 0.5, 1.0))
    in_g = two.with_channels({"base.linear_velocity.x": v, f"{stem}.x": a / 9.80665})
    (seen,) = consistency_findings(in_g)
    assert corrections([seen]) == {f"{stem}.x": (f"{stem}.x", 9.80665)}


@pytest.mark.parametrize("size", [0.02, 0.3, 1.2])
def test_native_attitude_and_gyro_agree(size: float) -> None:
    attitude, rate = turning(size)
    assert consistency_findings(flying(attitude, rate)) == ()


@given(st.floats(0.3, 2.5), st.floats(-0.05, 0.05), st.integers(0, 1000))
@settings(max_examples=10)
def test_plausible_gyro_gain_and_bias_are_not_a_contradiction(gain: float, bias: float, seed: int) -> None:
    attitude, rate = turning(0.4, seed)
    assert consistency_findings(flying(attitude, gain * rate + bias)) == ()


@pytest.mark.parametrize("size", [0.05, 0.5, 1.2])
@pytest.mark.parametrize("unit", [1.0, DEGREES, 30 / np.pi])
def test_quaternion_order_and_gyro_unit_are_corrected(size: float, unit: float) -> None:
    attitude, rate = turning(size)
    wrong = flying(np.roll(attitude, -1, axis=1), unit * rate)
    seen = errors(wrong)
    assert [f.kind for f in seen] == ["convention"]
    order = dict(zip(ATTITUDE, (ATTITUDE[3], *ATTITUDE[:3])))
    assert {c: origin for c, (origin, _) in corrections(seen).items() if c in ATTITUDE} == order
    factors = [unit * scale for c, (_, scale) in corrections(seen).items() if c in GYRO]
    assert factors == ([] if unit == 1.0 else pytest.approx([1.0] * 3))
    assert consistency_findings(corrected(wrong, seen[0].corrections)) == ()


def test_wrong_frames_of_attitude_and_gyro_are_corrected() -> None:
    attitude, rate = turning(0.8)
    inverse = attitude * np.array([1.0, -1.0, -1.0, -1.0])
    seen = errors(flying(inverse, rate))
    assert corrections(seen) == {c: (c, -1.0) for c in ATTITUDE[1:]}
    vector = np.hstack([np.zeros((TIME.size, 1)), rate])
    inertial = product(product(attitude, vector), inverse)[:, 1:]
    (seen_one,) = errors(flying(attitude, inertial))
    assert "inertial axes" in seen_one.sentence
    assert seen_one.corrections == ()
    assert corrections(errors(flying(attitude, -rate))) == {c: (c, -1.0) for c in GYRO}


def test_angles_are_not_accepted_as_a_quaternion() -> None:
    attitude, rate = turning(0.5)
    assert [f.kind for f in errors(flying(0.3 * attitude, rate))] == ["quaternion"]


def test_printed_corrections_are_valid_maps(tmp_path: Path, two: Recording) -> None:
    """Without a map a whole one is written, with one what changes in it; either makes the recording right."""
    wrong = crossed(two, "velocity").with_channels(
        {"joint1.reference_position": -two["joint1.reference_position"]}
    )
    write_recording(wrong, tmp_path / "two.csv")
    with pytest.raises(
        InputError, match=r'in the map file: \[channels\."joint1\.velocity"\] source = "joint2\.v'
    ):
        load_recording(tmp_path / "two.csv")
    found = [m for f in errors(wrong) for m in f.corrections]
    (tmp_path / "map.toml").write_text(corrected_map(wrong, found), "utf-8")
    right = load_recording(tmp_path / "two.csv", mapping=load_mapping(tmp_path / "map.toml"))
    assert set(right) == set(two)
    for name in two:
        # a CSV holds all digits
        np.testing.assert_allclose(right[name], two[name], rtol=1e-12, atol=1e-15)


def test_correction_includes_the_present_map() -> None:
    mapping = mapping_from_toml(
        'time = { source = "ms", scale = 0.001 }\n'
        '[channels."joint1.position"]\nsource = "log.q"\nindex = [0, 2, ":"]\nscale = 0.5\noffset = 0.25\n'
        '[channels."joint2.torque"]\n'
        'product = ["gain", { source = "u", row = 1, scale = 2.0 }]\nnoise = 0.1\n'
    )
    message = in_words([Correction("joint1.position", scale=-2.0), Correction("time", scale=1e-3)], mapping)
    assert message == (
        '[channels."joint1.position"] index = [0, 2, ":"], source = "log.q", scale = -1, offset = -0.5; '
        '[time] source = "ms", scale = 1e-06'
    )
    pasted = corrected_map(
        Recording(time=TIME, channels={}),
        [Correction("joint1.torque", source="joint2.torque", delay=0.01)],
        mapping,
    )
    again = mapping_from_toml(f'time = {{ source = "t" }}\n{pasted}').channels["joint1.torque"]
    before = mapping.channels["joint2.torque"]
    assert again == before.model_copy(update={"delay": 0.01})


def test_require_consistent_names_the_file(two: Recording) -> None:
    with pytest.raises(InputError, match=r"^two\.csv: joint1\.velocity"):
        require_consistent(two.with_channels({"joint1.velocity": -two["joint1.velocity"]}))
