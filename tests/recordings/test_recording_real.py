"""Public real recordings with the shipped maps, compared with publications."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import scipy.io
from scipy.signal import butter, filtfilt

from missing_physics.recordings import (
    check,
    estimate_resolution,
    load_constants,
    load_mapping,
    load_recording,
    read_raw,
)
from robot_model import Recording

SERVO = "servo_pendulum/xl330_2026-01-15_{}.json"
SERVO_TIMES = (
    *("10h28m10", "10h28m17", "10h28m24", "10h28m32", "10h28m42", "10h28m49"),
    *("10h28m57", "10h29m04", "10h29m14", "10h29m21", "10h29m29", "10h29m37"),
)
ALL = {
    "emps/DATA_EMPS.mat": "emps/map.toml",
    "emps/DATA_EMPS_PULSES.mat": "emps/map.toml",
    "quanser_two_link/lqr_full_10deg.mat": "quanser_two_link/map.toml",
    "quanser_two_link/quarc_data_fsf_th11.mat": "quanser_two_link/map_quarc.toml",
    "kuka_kr300/traj_A.mat": "kuka_kr300/map.toml",
    "kuka_kr300/traj_B.mat": "kuka_kr300/map.toml",
    **{SERVO.format(time): "servo_pendulum/map.toml" for time in SERVO_TIMES},
}


def load(real: Path, examples: Path, file: str) -> Recording:
    return load_recording(real / file, mapping=load_mapping(examples / ALL[file]))


def slope(x: np.ndarray, y: np.ndarray) -> float:
    return float(x @ y / (x @ x))


@pytest.mark.parametrize("file", ALL)
def test_real_recordings_have_no_errors(real: Path, examples: Path, file: str) -> None:
    recording = load(real, examples, file)
    assert not [f.sentence for f in check(recording) if f.severity == "error"]
    assert len(recording) > 1000


def test_emps_gives_the_published_parameters(real: Path, examples: Path) -> None:
    """The authors' recipe on the mapped channels: filter, differentiate, decimate, least squares."""
    recording = load(real, examples, "emps/DATA_EMPS.mat")
    b, a = butter(4, 100 / 500)
    q = filtfilt(b, a, recording["joint1.position"])
    v = np.gradient(q, recording.time)
    terms = np.array([np.gradient(v, recording.time), v, np.sign(v), np.ones_like(v)])
    low, high = butter(4, 0.08)
    smooth = filtfilt(low, high, np.vstack([terms, recording["joint1.torque"]]), axis=1)[:, 200:-200:10]
    found = np.linalg.lstsq(smooth[:4].T, smooth[4], rcond=None)[0]
    # 1 %: what filters of another order and cut-off change; the published values come from the same file.
    np.testing.assert_allclose(found, [95.1089, 203.5034, 20.3935, -3.1648], rtol=0.01)
    mapping = load_mapping(examples / "emps/map.toml")
    constants = load_constants(real / "emps/DATA_EMPS.mat", mapping=mapping)
    assert constants["force_per_volt"] == pytest.approx(35.15065, rel=1e-6)


@pytest.mark.parametrize("file", ["kuka_kr300/traj_A.mat", "kuka_kr300/traj_B.mat"])
def test_kuka_signs_and_units(real: Path, examples: Path, file: str) -> None:
    recording = load(real, examples, file)
    t = recording.time
    b, a = butter(4, 10 / 125)
    for axis in range(1, 7):
        joint = f"joint{axis}"
        q, v = recording[f"{joint}.position"], recording[f"{joint}.velocity"]
        # Central differences of smooth motion at 250 Hz; the rest is encoder noise.
        assert slope(np.gradient(q, t), v) == pytest.approx(1.0, rel=5e-3)
        moving = filtfilt(b, a, v)
        tau = filtfilt(b, a, recording[f"{joint}.torque"])
        parts = np.array([np.gradient(moving, t), moving, np.sign(moving), np.ones_like(t), q])
        inertia, viscous, dry, *_ = np.linalg.lstsq(parts.T, tau, rcond=None)[0]
        assert inertia > 0
        assert viscous > 0
        assert dry > 0
        assert (f"{joint}.motor_position" in recording) == (axis <= 3)
    raw = scipy.io.loadmat(real / file)
    torque = raw["rec"]["act_torque_abs_nm"][0, 0][1] * raw["para"]["u"][0, 0][1, 0]
    np.testing.assert_array_equal(recording["joint2.torque"], torque)
    # The secondary encoders that are not mapped are dead, those that are, are not.
    assert np.ptp(raw["rec"]["act_pos_se_deg"][0, 0], axis=1)[3:].max() == 0


@pytest.mark.parametrize(
    "file", ["quanser_two_link/lqr_full_10deg.mat", "quanser_two_link/quarc_data_fsf_th11.mat"]
)
def test_quanser_signs_and_units(real: Path, examples: Path, file: str) -> None:
    recording = load(real, examples, file)
    t = recording.time
    assert t[0] == (0.0 if file.startswith("quanser_two_link/lqr") else pytest.approx(1.2))
    assert recording.sample_rate == pytest.approx(500.0, rel=1e-9)
    b, a = butter(4, 20 / 250)
    th, bent, tau = (
        filtfilt(b, a, recording[name]) for name in ("joint1.position", "flex1.position", "joint1.torque")
    )
    v = np.gradient(th, t)
    parts = np.array([np.gradient(v, t), v, bent, np.ones_like(t)])[:, 50:-50]
    inertia, viscous, *_ = np.linalg.lstsq(parts.T, tau[50:-50], rcond=None)[0]
    assert inertia > 0
    # The published value is 4.0 N m s/rad; dry friction, which the authors leave out, shares it.
    assert 2.0 < viscous < 6.0
    # The tip lags behind the joint's acceleration: it deflects against it (Ks a = -J12 (th'' + a'')).
    # With the strain's filter undone the stiffness is that of the makers' torque impulse test, 27.0 N m/rad,
    # not the 39.957 that theory promises; a quarter, since what link 2 does to link 1 is left out here.
    acceleration = parts[0] + np.gradient(np.gradient(bent, t), t)[50:-50]
    ratio = slope(bent[50:-50], acceleration)
    assert -0.17043 * ratio == pytest.approx(27.0, rel=0.25)
    # Encoders of 4096 steps behind gears of 100 and 50.
    steps = estimate_resolution(recording)
    assert steps["joint1.position"] == pytest.approx(2 * np.pi / 4096 / 100, rel=1e-6)
    assert steps["joint2.position"] == pytest.approx(2 * np.pi / 4096 / 50, rel=1e-6)


def test_servo_voltage_equals_its_controller_command(real: Path, examples: Path) -> None:
    """Duty = kp e (goal - position), clipped, with the published e; the log's PWM register must say so."""
    mapping = load_mapping(examples / "servo_pendulum/map.toml")
    for file in (f for f in ALL if f.startswith("servo")):
        recording = load_recording(real / file, mapping=mapping)
        constants = load_constants(real / file, mapping=mapping)
        gain = constants["position_gain"] * (4096 / (2 * np.pi)) / (256 * 885)
        error = recording["joint1.reference_position"] - recording["joint1.position"]
        raw = read_raw(real / file)
        register = raw["entries.load"].astype(np.uint16).astype(np.int16)
        voltage = recording["joint1.voltage"]
        on = np.isfinite(voltage)
        np.testing.assert_allclose(voltage[on], (register / 885 * raw["entries.input_volts"])[on], rtol=1e-12)
        predicted, duty = np.clip(gain * error, -1, 1)[on], register[on] / 885
        # One register is read a millisecond or so after the other, at up to 13 rad/s.
        assert np.corrcoef(predicted, duty)[0, 1] > 0.999
        assert slope(predicted, duty) == pytest.approx(1.0, rel=0.03)
        assert recording.sample_rate < 300
        assert np.ptp(np.diff(recording.time)) > 1e-4
        assert np.array_equal(on, np.isfinite(recording["joint1.reference_position"]))


def test_servo_torque_off_has_no_voltage(real: Path, examples: Path) -> None:
    recording = load(real, examples, SERVO.format("10h28m17"))
    off = np.isnan(recording["joint1.voltage"])
    assert off.sum() == 1138
    assert np.all(off[-1138:])
