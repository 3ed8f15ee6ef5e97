"""Checks: each fault put into a clean recording is found, and the clean one passes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from missing_physics.recordings import (
    Finding,
    check,
    estimate_noise,
    estimate_resolution,
    excitation,
    load_recording,
    outlook,
    require_consistent,
    write_recording,
)
from missing_physics.recordings.channels.estimates import interpolation_residual, smallest_step
from missing_physics.recordings.inspection.units import position_per_velocity
from missing_physics.recordings.inspection.values import longest_run
from robot_model import InputError, Recording, Robot, load_robot

DEGREES = 180 / np.pi


def kinds(recording: Recording, severity: str | None = None) -> set[tuple[str, str]]:
    return {(f.kind, f.channel) for f in check(recording) if severity in (None, f.severity)}


def changed(recording: Recording, **factors: float) -> Recording:
    """With channels of joint1 multiplied."""
    new = {f"joint1.{name}": factor * recording[f"joint1.{name}"] for name, factor in factors.items()}
    return recording.with_channels(new)


def at(recording: Recording, time: np.ndarray) -> Recording:
    return Recording(time=time, channels=recording.channels, source=recording.source)


def test_a_clean_recording_passes(swing: Recording) -> None:
    assert check(swing) == ()


@pytest.mark.parametrize(
    ("factors", "kind", "channel", "words"),
    [
        ({"position": DEGREES}, "degrees", "joint1.position", r"in degrees .* scale = 0\.01745329"),
        ({"velocity": DEGREES}, "degrees", "joint1.velocity", r"degrees per second"),
        ({"velocity": 60 / (2 * np.pi)}, "rpm", "joint1.velocity", r"turns per minute"),
        ({"velocity": -1.0}, "sign", "joint1.velocity", r"opposite sign"),
        ({"position": 1000.0}, "thousand", "joint1.position", r"1000 times too large"),
        ({"velocity": 1000.0}, "thousand", "joint1.velocity", r"1000 times too large"),
    ],
)
def test_wrong_units_are_errors(
    swing: Recording, factors: dict[str, float], kind: str, channel: str, words: str
) -> None:
    wrong = changed(swing, **factors)
    assert (kind, channel) in kinds(wrong, "error")
    with pytest.raises(InputError, match=words):
        require_consistent(wrong)


@pytest.mark.parametrize(("per_second", "unit"), [(1e3, "milliseconds"), (1e6, "microseconds")])
@pytest.mark.parametrize("with_velocity", [True, False])
def test_time_in_other_units(swing: Recording, per_second: float, unit: str, with_velocity: bool) -> None:
    channels = {k: v for k, v in swing.channels.items() if with_velocity or k != "joint1.velocity"}
    wrong = Recording(time=swing.time * per_second, channels=channels)
    assert kinds(wrong, "error") == {("time_unit", "time")}
    with pytest.raises(InputError, match=unit):
        require_consistent(wrong)


def test_time_in_kiloseconds_is_reported(swing: Recording) -> None:
    wrong = Recording(time=swing.time * 1e-3, channels={"joint1.position": swing["joint1.position"]})
    assert ("time_unit", "time") in kinds(wrong, "error")


def test_load_refuses_wrong_units_unless_asked_to_accept_them(tmp_path: Path, swing: Recording) -> None:
    write_recording(changed(swing, position=DEGREES), tmp_path / "a.npz")
    with pytest.raises(InputError, match=r"a\.npz: joint1\.position is in degrees"):
        load_recording(tmp_path / "a.npz")
    assert len(load_recording(tmp_path / "a.npz", check=False)) == 1000


def test_many_turns_of_unknown_unit_are_questioned(swing: Recording) -> None:
    wrong = changed(swing, position=DEGREES, velocity=DEGREES)
    alone = Recording(wrong.time, {"joint1.position": wrong["joint1.position"]})
    assert ("degrees", "joint1.position") in kinds(alone, "warning")
    assert not kinds(alone, "error")
    turning = [f.severity for f in check(alone, robot=load_robot("two_link_arm")) if f.kind == "degrees"]
    assert turning == ["note"]  # whose joints have no limits


def test_many_turns_consistent_with_the_velocity_give_no_advice(swing: Recording) -> None:
    """Both may be in degrees all the same, which is said, unless a robot's torques would tell it."""
    turning = changed(swing, position=DEGREES, velocity=DEGREES)
    assert ("degrees", "joint1.position") not in kinds(turning, "warning")
    [message] = [f.sentence for f in check(turning) if f.kind == "degrees"]
    assert message.endswith("joint1.velocity agrees with it: both are in radians, or both in degrees.")
    assert not [f for f in check(turning, robot=load_robot("two_link_arm")) if f.kind == "degrees"]


def test_position_in_degrees_next_to_one_in_radians_is_detected(swing: Recording) -> None:
    wrong = swing.with_channels({"joint1.motor_position": DEGREES * swing["joint1.position"]})
    assert ("degrees", "joint1.motor_position") in kinds(wrong, "error")


def test_temperatures_in_celsius_and_wrapped_angles_are_reported(swing: Recording) -> None:
    wrapped = np.angle(np.exp(1j * (5 * swing.time)))
    wrong = swing.with_channels(
        {"joint1.temperature": 0 * swing.time + 25 + swing.time, "joint2.position": wrapped}
    )
    assert {("celsius", "joint1.temperature"), ("wrap", "joint2.position")} <= kinds(wrong, "error")


@given(st.floats(-2, 2).filter(lambda x: abs(x) > 0.1), st.integers(0, 2**32 - 1))
@settings(max_examples=25)
def test_position_per_velocity_finds_any_factor(factor: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    t = np.cumsum(rng.uniform(0.5, 1.5, 2000)) / 500
    noise = 0.02 * rng.standard_normal(t.size)
    ratio, alike = position_per_velocity(t, factor * np.sin(2 * t), 2 * np.cos(2 * t) + noise)
    # Noise of 0.02 against 1.4 rms, averaged over ten samples per window, attenuates by about 2e-5; the
    # trapezoid at 2 rad/s and steps up to 3 ms errs by (2 * 0.003)^2/12 = 3e-6.
    assert ratio == pytest.approx(factor, rel=2e-3)
    assert alike * np.sign(factor) > 0.99


def test_changes_across_a_gap_do_not_count() -> None:
    """The joint was moved by ten radians while nothing was recorded."""
    t = np.arange(2000) / 1000 + 3.0 * (np.arange(2000) >= 1000)
    q = np.sin(5 * t) + 10.0 * (np.arange(2000) >= 1000)
    ratio, alike = position_per_velocity(t, q, 5 * np.cos(5 * t))
    # The trapezoid at 5 rad/s and 1 ms errs by 2e-6.
    assert ratio == pytest.approx(1.0, rel=1e-5)
    assert alike == pytest.approx(1.0, rel=1e-5)


def test_gap_jitter_and_clock(swing: Recording) -> None:
    rng = np.random.default_rng(1)
    gap = swing.time + 0.5 * (np.arange(1000) > 600)
    assert ("gap", "time") in kinds(at(swing, gap), "warning")
    finding = next(f for f in check(at(swing, gap)) if f.kind == "gap")
    assert finding.numbers["longest_s"] == pytest.approx(0.504)
    assert finding.numbers["at_s"] == pytest.approx(2.4)
    jitter = swing.time + rng.uniform(-1e-3, 1e-3, 1000)
    assert ("jitter", "time") in kinds(at(swing, jitter), "warning")
    assert ("coarse_clock", "time") in kinds(at(swing, np.round(swing.time * 7 / 6, 3)), "warning")
    two_rates = np.concatenate([swing.time[:500], swing.time[499] + 0.005 * np.arange(1, 501)])
    assert ("rate_change", "time") in kinds(at(swing, two_rates), "warning")


def test_faults_of_values(swing: Recording) -> None:
    q, u = swing["joint1.position"], swing["joint1.torque"]
    rng = np.random.default_rng(2)
    noisy = u + 1e-3 * rng.standard_normal(u.size)
    stray = noisy.copy()
    stray[700] += 50.0
    missing = np.where((swing.time > 1) & (swing.time < 1.2), np.nan, noisy)
    wrong = swing.with_channels(
        {
            "joint1.torque": np.clip(noisy, -20, 20),
            "joint2.torque": stray,
            "joint3.torque": missing,
            "joint4.torque": np.full(1000, 3.0),
            "joint5.position": np.round(q / 0.1) * 0.1,
            "joint6.position": np.repeat(q[::5], 5),
        }
    )
    assert {
        ("saturation", "joint1.torque"),
        ("stray", "joint2.torque"),
        ("missing", "joint3.torque"),
        ("dead", "joint4.torque"),
        ("quantisation", "joint5.position"),
        ("held", "joint6.position"),
    } <= kinds(wrong, "warning")
    per_channel: dict[str, set[str]] = {}
    for kind, channel in kinds(wrong, "warning"):
        per_channel.setdefault(channel, set()).add(kind)
    assert per_channel["joint2.torque"] == {"stray"}
    assert per_channel["joint1.torque"] == {"saturation"}
    finding = next(f for f in check(wrong) if f.kind == "stray")
    assert finding.numbers["at_s"] == pytest.approx(swing.time[700])


def test_constant_coarse_torque_at_rest_is_not_saturation(swing: Recording) -> None:
    """A quantised torque rests on every level for a while; only a limit holds it longer."""
    coarse = np.round(swing["joint1.torque"] / 5) * 5
    assert not any(kind == "saturation" for kind, _ in kinds(swing.with_channels({"joint1.torque": coarse})))


@given(st.lists(st.booleans(), max_size=40))
def test_longest_run_equals_a_direct_count(flags: list[bool]) -> None:
    best = max((len(run) for run in "".join("1" if f else "0" for f in flags).split("0")), default=0)
    length, start = longest_run(np.array(flags, dtype=bool))
    assert length == best
    assert all(flags[start : start + length])


@pytest.mark.parametrize("jittered", [False, True])
@pytest.mark.parametrize("sigma", [1e-4, 1e-2])
def test_noise_estimate(sigma: float, jittered: bool) -> None:
    rng = np.random.default_rng(3)
    count = 20_000
    t = (np.arange(count) + (rng.uniform(-0.3, 0.3, count) if jittered else 0)) / 1000
    y = np.sin(2 * np.pi * t) + sigma * rng.standard_normal(count)
    recording = Recording(time=t, channels={"joint1.position": y})
    # The median absolute deviation of 20,000 correlated residuals scatters by about 1.5 %; taking the least
    # of three orders biases by as much.
    assert estimate_noise(recording)["joint1.position"] == pytest.approx(sigma, rel=0.06)
    assert estimate_resolution(recording) == {}


def test_interpolation_residual_of_polynomials_is_zero() -> None:
    """2 k neighbours reproduce every polynomial of degree 2 k - 1 at any instants."""
    rng = np.random.default_rng(4)
    t = np.cumsum(rng.uniform(0.5, 1.5, 50))
    for k in (1, 2, 3):
        y = np.polynomial.Polynomial(rng.standard_normal(2 * k))((t - 25) / 25)
        # Rounding of values of order 1, in sums of 2 k terms.
        assert np.abs(interpolation_residual(t, y, half_width=k)).max() < 1e-13


@given(st.floats(1e-9, 1e3), st.floats(-10, 10), st.integers(0, 2**32 - 1))
@settings(max_examples=40)
def test_resolution_estimate(step: float, shift: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    counts = np.unique(rng.integers(-300, 300, 400))
    values = step * rng.permutation(counts) + shift * step
    # The shift costs digits: 600 steps against the last bit of 610 steps.
    assert smallest_step(values) == pytest.approx(step, rel=1e-9)


def test_resolution_of_unquantised_and_constant_values() -> None:
    rng = np.random.default_rng(5)
    assert smallest_step(rng.standard_normal(5000)) == 0.0
    assert smallest_step(np.ones(100)) == 0.0


def test_stated_noise_and_resolution_take_precedence(swing: Recording) -> None:
    stated = Recording(
        time=swing.time,
        channels=swing.channels,
        noise={"joint1.torque": 0.25},
        resolution={"joint1.position": 0.125},
    )
    assert estimate_noise(stated)["joint1.torque"] == 0.25
    assert estimate_resolution(stated)["joint1.position"] == 0.125
    # A quantised channel has at least the noise of a uniform error of one step.
    assert estimate_noise(stated)["joint1.position"] == pytest.approx(0.125 / np.sqrt(12))


def test_excitation_of_a_known_motion() -> None:
    t = np.arange(4000) / 1000
    q = 0.5 * np.cos(2 * np.pi * t)
    (move,) = excitation(Recording(time=t, channels={"joint1.position": q}))
    assert move.position_range == pytest.approx(1.0, rel=1e-4)
    # Highest speed pi, mean squared acceleration (2 pi)^4/8; central differences over 16 ms lose
    # (2 pi * 0.008)^2/6 = 4e-4, the 99.9 % quantile and the open ends a little more.
    assert move.max_speed == pytest.approx(np.pi, rel=2e-3)
    assert move.rms_acceleration == pytest.approx((2 * np.pi) ** 2 * 0.5 / np.sqrt(2), rel=1e-2)
    # Four periods turn eight times, once at the very first sample, which is no reversal.
    assert move.reversals == 7
    assert move.forward == pytest.approx(move.backward, abs=0.01)
    # |sin| stays below 0.02 in (2/pi) asin(0.02) of the time; at 8 ms per sample each of the two turns of a
    # period is one sample more or less, of 125.
    assert move.at_rest == pytest.approx(2 / np.pi * np.arcsin(0.02), abs=2 / 125)
    assert move.bandwidth_hz == pytest.approx(1.0, abs=0.3)


def test_outlook_lists_what_is_missing(swing: Recording) -> None:
    can, cannot = outlook(swing)
    assert any("joint1: the force that resists the motion" in line for line in can)
    assert any("between motor and joint" in line for line in cannot)
    still = Recording(time=swing.time, channels={"joint1.position": np.full(1000, 0.25)})
    assert any("joint1: nothing" in line for line in outlook(still)[1])
    one_way = Recording(
        time=swing.time, channels={"joint1.position": swing.time, "joint1.torque": swing.time}
    )
    _, cannot = outlook(one_way)
    assert any("all motion is in one direction" in line for line in cannot)
    assert any("about one speed" in line for line in cannot)
    assert any(kind == "one_direction" for kind, _ in kinds(one_way))
    without = Recording(time=swing.time, channels={"joint1.position": swing["joint1.position"]})
    assert any("no torque, current or voltage" in line for line in outlook(without)[1])


def test_findings_put_errors_first(swing: Recording) -> None:
    wrong = changed(at(swing, swing.time + 0.5 * (np.arange(1000) > 600)), velocity=-1.0)
    order = [f.severity for f in check(wrong)]
    assert order[0] == "error"
    assert order == sorted(order, key=("error", "warning", "note").index)
    assert all(isinstance(f, Finding) and f.sentence.endswith(".") for f in check(wrong))


def limited(torque_limit: float) -> Robot:
    robot = load_robot("two_link_arm")
    first = robot.joints[0].actuator
    assert first is not None
    actuator = first.model_copy(update={"torque_limit": torque_limit})
    joints = (robot.joints[0].model_copy(update={"actuator": actuator}), *robot.joints[1:])
    return robot.model_copy(update={"joints": joints})


def test_torques_beyond_the_actuator_limit_are_reported(swing: Recording) -> None:
    largest = float(np.abs(swing["joint1.torque"]).max())
    [finding] = [f for f in check(swing, robot=limited(largest / 3)) if f.kind == "torque_limit"]
    assert finding.severity == "warning"
    assert "3 times the torque_limit" in finding.sentence
    assert not [f for f in check(swing, robot=limited(0.95 * largest)) if f.kind == "torque_limit"]
    torque = swing["joint1.torque"].copy()
    torque[500] = 100 * largest  # one stray
    strayed = swing.with_channels({"joint1.torque": torque})
    assert not [f for f in check(strayed, robot=limited(largest)) if f.kind == "torque_limit"]


def test_coarse_channels_are_reported_in_one_line() -> None:
    time = np.arange(1000) / 100.0
    names = [f"joint{k}.reference_position" for k in range(1, 13)]
    coarse = Recording(time, {name: np.round(np.sin(time + k), 1) for k, name in enumerate(names)})
    [finding] = [f for f in check(coarse) if f.kind == "quantisation"]
    assert finding.sentence.startswith(
        "12 channels come in fewer than 50 steps: joint1.reference_position (0.1,"
    )
    assert finding.sentence.endswith(" and 8 more.")


def test_resolution_steps_below_the_noise_are_not_reported() -> None:
    time = np.arange(2000) / 100.0
    noise = np.random.default_rng(3).normal(0.0, 1e-5, 2000)
    for step, told in ((1e-9, False), (1e-3, True)):
        rounded = np.round((np.sin(time) + noise) / step) * step
        found = {f.kind for f in check(Recording(time, {"joint1.position": rounded}))}
        assert ("quantisation" in found) == told


def test_trembling_joint_gets_no_advice_on_friction() -> None:
    time = np.arange(4000) / 100.0
    tremble = 1e-5 * np.sin(2 * np.pi * 3.7 * time)
    channels = {"joint1.position": np.sin(time), "joint2.position": tremble, "joint3.position": 2 * tremble}
    torques = {name.replace("position", "torque"): np.cos(time) for name in channels}
    recording = Recording(time, channels | torques)
    can, cannot = outlook(recording)
    assert not [line for line in can if "joint2" in line or "joint3" in line]
    assert any(
        line.startswith("joint2 and joint3: friction, since the joint only trembles") for line in cannot
    )
    assert ("no_motion", "joint2.position") in kinds(recording, "warning")
    alone = Recording(time, {name: y for name, y in recording.channels.items() if "joint2" in name})
    assert any(line.startswith("joint2: viscous friction") for line in outlook(alone)[0])


def test_equal_findings_of_many_joints_are_merged() -> None:
    time = np.arange(1000) / 100.0
    channels = {f"joint{k}.position": np.sin(time + k) for k in (1, 2, 3)}
    torques = {f"joint{k}.torque": np.cos(time + k) for k in (1, 2, 3)}
    can, cannot = outlook(Recording(time, channels | torques))
    assert (
        can[0]
        == "joint1, joint2 and joint3: the force that resists the motion, from the torque that drives it."
    )
    assert "joint1, joint2 and joint3: dependence on temperature, since none is recorded." in cannot
