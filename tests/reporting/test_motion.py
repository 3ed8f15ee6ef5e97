"""Moving parts in the 3-D view of a diagnosis: joints, free base, flexible links."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from reporting_cases import empty_result
from rerun.chunk import RrdReader

from missing_physics.reporting import write_rerun
from missing_physics.reporting.elements.runs import Run
from missing_physics.reporting.scene.motion import Motion, motion
from missing_physics.results.result import ChannelSeries
from robot_model import Recording, Robot, load_robot

TIME = np.linspace(0.0, 2.0, 101)


def robot() -> Robot:
    return load_robot("flexible_space_robot")


def series(joint: str) -> ChannelSeries:
    values = np.sin(TIME) * (1 if joint == "joint1" else -2)
    return ChannelSeries(
        recording="flight.csv",
        role="train",
        channel=f"{joint}.torque",
        unit="N m",
        location=joint,
        time=TIME,
        measured=values,
        nominal=values + 0.3,
        augmented=values + 0.01,
        held_out=np.zeros(TIME.size, dtype=bool),
        noise_floor=1e-3,
        position=values,
    )


def run() -> Run:
    return Run("run1", "flight.csv", "flight.csv", "train", (series("joint1"), series("joint2")))


def recording(**changes: np.ndarray) -> Recording:
    turn = 0.2 * TIME
    channels = {
        "base.attitude.w": np.cos(turn / 2),
        "base.attitude.x": 0 * TIME,
        "base.attitude.y": 0 * TIME,
        "base.attitude.z": np.sin(turn / 2),
        **{f"link2.tip_deflection.{axis}": 0.003 * k * np.sin(TIME) for k, axis in enumerate("xyz")},
    }
    return Recording(TIME, {**channels, **changes}, "flight.csv")


def drawn(given: Recording | None) -> Motion:
    found = motion(run(), robot(), given)
    assert found is not None
    return found


def test_a_recorded_base_turns_and_a_recorded_deflection_bends_the_link() -> None:
    found = drawn(recording())
    angle = 0.2 * found.time
    x_axis = np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
    # Attitudes are interpolated between samples of 4 mrad: second order of that.
    assert np.allclose(found.recorded.poses["base"].rotation[:, :, 0], x_axis, atol=1e-6)
    # The largest, sqrt(5) x 3 mm of 6 m, is drawn as at most 12 %: 100 times.
    assert "deflections x 100" in found.title
    assert "base" not in found.title
    moved = found.recorded.deflections["link2"]
    assert np.allclose(moved[:, 1], 100 * 0.003 * np.sin(found.time), atol=1e-4)


def test_missing_channels_of_the_motion_are_reported() -> None:
    found = drawn(None)
    assert found.title == "Recorded motion; base held still; links straight: no deflection recorded"
    assert not found.recorded.deflections["link2"].any()


def test_quaternion_sign_change_is_the_same_attitude() -> None:
    time = np.linspace(0.0, 2.0, 67)  # drawn in between, too
    given = Recording(time, {name: np.interp(time, TIME, y) for name, y in recording().channels.items()}, "a")
    sign = np.where(np.arange(time.size) % 3, 1.0, -1.0)
    flipped = {name: sign * y if "attitude" in name else y for name, y in given.channels.items()}
    here, there = drawn(given), drawn(Recording(time, flipped, "b"))
    first, second = (found.recorded.poses["base"].rotation for found in (here, there))
    assert np.allclose(first, second, atol=1e-12)  # rounding


def test_rerun_file_contains_the_bent_link(tmp_path: Path) -> None:
    result = replace(empty_result("consistent", series=False), series=run().series)
    target = tmp_path / "comparison.rrd"
    write_rerun(result, robot(), target, recordings=[recording()])
    paths = {str(chunk.entity_path) for chunk in RrdReader(target).stream()}
    assert "/run1/robot/link2/bent" in paths
