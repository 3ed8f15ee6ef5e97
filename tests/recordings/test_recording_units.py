"""Units in maps: factor and shift to SI, and one sentence for a unit of another quantity."""

from __future__ import annotations

import math
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from missing_physics.recordings import load_recording, mapping_from_toml
from robot_model import InputError

T = np.arange(100) / 100.0
RATE = "time = { rate = 100 }\n"


def entry(channel: str, unit: str, more: str = "") -> str:
    return f'[channels."{channel}"]\nsource = "x"\nunit = "{unit}"\n{more}'


@pytest.mark.parametrize(
    ("channel", "unit", "factor", "shift"),
    [
        ("joint1.position", "deg", math.pi / 180, 0.0),
        ("joint1.position", "°", math.pi / 180, 0.0),
        ("joint1.position", "rev", 2 * math.pi, 0.0),
        ("joint1.position", "mm", 1e-3, 0.0),
        ("joint1.velocity", "rpm", math.pi / 30, 0.0),
        ("joint1.velocity", "deg/s", math.pi / 180, 0.0),
        ("joint1.velocity", "rev/min", math.pi / 30, 0.0),
        ("joint1.torque", "Nm", 1.0, 0.0),
        ("joint1.torque", "mNm", 1e-3, 0.0),
        ("joint1.torque", "N*m", 1.0, 0.0),
        ("joint1.torque", "N m", 1.0, 0.0),
        ("joint1.torque", "Ncm", 1e-2, 0.0),
        ("joint1.torque", "lbf*in", 0.1129848290276167, 0.0),
        ("joint1.current", "mA", 1e-3, 0.0),
        ("joint1.temperature", "degC", 1.0, 273.15),
        ("joint1.temperature", "°C", 1.0, 273.15),
        ("base.position.x", "cm", 1e-2, 0.0),
        ("base.linear_acceleration.x", "m/s^2", 1.0, 0.0),
        ("link1.strain.1", "%", 1e-2, 0.0),
    ],
)
def test_units(tmp_path: Path, channel: str, unit: str, factor: float, shift: float) -> None:
    np.savez(tmp_path / "a.npz", x=np.sin(T))
    for scale, offset in ((1.0, 0.0), (-2.0, 3.0)):
        text = RATE + entry(channel, unit, f"scale = {scale}\noffset = {offset}")
        recording = load_recording(tmp_path / "a.npz", mapping=mapping_from_toml(text), check=False)
        expected = scale * (factor * np.sin(T) + shift) + offset
        np.testing.assert_allclose(recording[channel], expected, rtol=1e-12, atol=1e-15)


@pytest.mark.parametrize(
    ("unit", "factor"), [("ms", 1e-3), ("us", 1e-6), ("µs", 1e-6), ("ns", 1e-9), ("min", 60)]
)
def test_units_of_time(tmp_path: Path, unit: str, factor: float) -> None:
    np.savez(tmp_path / "a.npz", t=T / factor, x=np.sin(T))
    text = f'[time]\nsource = "t"\nunit = "{unit}"\n' + entry("joint1.position", "rad")
    recording = load_recording(tmp_path / "a.npz", mapping=mapping_from_toml(text), check=False)
    np.testing.assert_allclose(recording.time, T, rtol=1e-12)


def test_the_unit_of_a_derivative_is_that_of_its_variable(tmp_path: Path) -> None:
    np.savez(tmp_path / "a.npz", x=90.0 * T)
    text = RATE + entry("joint1.velocity", "deg", "derivative = true")
    recording = load_recording(tmp_path / "a.npz", mapping=mapping_from_toml(text), check=False)
    np.testing.assert_allclose(recording["joint1.velocity"], math.pi / 2, rtol=1e-9)


@pytest.mark.parametrize(
    ("channel", "unit", "message"),
    [
        ("joint1.torque", "A", "'A' is no unit of joint1.torque, which is in N m or N; joint1.current would"),
        ("joint1.position", "deg/s", "which is in rad or m; joint1.velocity would have it"),
        ("joint1.velocity", "Hz", "'Hz' is no unit of joint1.velocity, which is in rad/s or m/s"),
        ("joint1.position", "count", "'count' is no unit of joint1.position, which is in rad or m"),
        ("joint2.position", "deg", "'deg' is no unit of joint2.position, which is in m."),
        ("link1.modal_coordinate.1", "m", "which is in sqrt(kg) m"),
        ("joint1.position", "degrees_of", "'degrees_of' is no unit; write one such as deg"),
        ("joint1.position", "", "'' is no unit"),
        ("joint1.position", "m**9**9**9**9", "is no unit"),
        ("joint1.position", "a" * 41, "is no unit"),
    ],
)
def test_unit_of_another_quantity_is_rejected(channel: str, unit: str, message: str) -> None:
    with pytest.raises(InputError) as error:
        mapping_from_toml('prismatic = ["joint2"]\n' + RATE + entry(channel, unit), source="map.toml")
    assert message in str(error.value)
    assert str(error.value).startswith("map.toml: ")


def test_unit_of_another_quantity_is_rejected_for_time() -> None:
    with pytest.raises(InputError, match="time: 'deg' is no unit of time; give one such as s, ms or us"):
        mapping_from_toml('[time]\nsource = "t"\nunit = "deg"')


@given(st.one_of(st.text(max_size=12), st.text("mNkdegs*/^ 19-°%.()", max_size=16)))
def test_any_text_is_a_unit_or_refused(text: str) -> None:
    unit = "".join(letter for letter in text if letter.isprintable() and letter not in '"\\')
    with suppress(InputError):
        mapping_from_toml(RATE + entry("joint1.position", unit), source="map.toml")


def test_unit_library_is_not_loaded_without_units_in_a_map() -> None:
    code = "import sys, missing_physics.recordings; sys.exit('pint' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code]).returncode == 0
