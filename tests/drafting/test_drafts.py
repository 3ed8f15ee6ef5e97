"""Drafts of maps and overlays: guesses read the log correctly, and open properties become questions."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from missing_physics.cli import main
from missing_physics.drafting import Draft, draft
from missing_physics.recordings import load_recording, mapping_from_toml
from reference_model.evaluation.model import RobotModel
from robot_model import InputError, Robot, load_robot

T = np.arange(4000) / 200.0


@pytest.fixture(scope="module")
def arm() -> Robot:
    """Two links under gravity, whose drives are described by nothing."""
    robot = load_robot("two_link_arm")
    bare = tuple(joint.model_copy(update={"actuator": None}) for joint in robot.joints)
    return robot.model_copy(update={"joints": bare, "gravity": (0.0, -9.81, 0.0), "effects": ()})


@pytest.fixture(scope="module")
def motion(arm: Robot) -> dict[str, Any]:
    """Position, velocity and torque of both joints, friction included, shape (N, 2)."""
    rates, sizes = np.array([[0.31, 0.83], [0.47, 1.07]]), np.array([[0.9, 0.2], [0.7, 0.25]])
    w = 2 * np.pi * rates
    phase = T[:, None, None] * w
    q, v, a = (
        (sizes * np.sin(phase)).sum(2),
        (sizes * w * np.cos(phase)).sum(2),
        -(sizes * w**2 * np.sin(phase)).sum(2),
    )
    torque = RobotModel(arm).inverse_dynamics(q, v, a) + 0.5 * np.tanh(v / 0.01) + 0.3 * v
    return {"q": q, "v": v, "torque": torque}


def write(path: Path, columns: dict[str, Any]) -> Path:
    rows = zip(*(np.asarray(values).tolist() for values in columns.values()))
    path.write_text(",".join(columns) + "\n" + "\n".join(",".join(map(repr, row)) for row in rows))
    return path


def read(found: Draft, log: Path) -> Any:
    return load_recording(log, mapping=mapping_from_toml(found.map), check=False)


Rename = Callable[[dict[str, Any]], dict[str, Any]]
DEG = 180 / np.pi
#: Names and units of labs, and what the torque is multiplied by.
LOGS: dict[str, Rename] = {
    "degrees and milliseconds": lambda m: {
        "t_ms": 1000 * T,
        **{f"q{k + 1}_deg": DEG * m["q"][:, k] for k in (0, 1)},
        **{f"tau{k + 1}_Nm": m["torque"][:, k] for k in (0, 1)},
    },
    "joints and units, and no word for a quantity": lambda m: {
        "t_s": T,
        **{f"joint{k + 1}_deg": DEG * m["q"][:, k] for k in (0, 1)},
        **{f"joint{k + 1} [Nm]": m["torque"][:, k] for k in (0, 1)},
    },
    "no units in names": lambda m: {
        "timestamp": 1e6 * T + 1.7e15,
        **{f"actual_q_{k}": m["q"][:, k] for k in (0, 1)},
        **{f"actual_qd_{k}": m["v"][:, k] for k in (0, 1)},
        **{f"torque[{k}]": m["torque"][:, k] for k in (0, 1)},
    },
    "units in brackets": lambda m: {
        "Time [s]": T,
        **{f"Position{k + 1} [deg]": DEG * m["q"][:, k] for k in (0, 1)},
        **{f"Speed{k + 1} (rpm)": 30 / np.pi * m["v"][:, k] for k in (0, 1)},
        **{f"Torque{k + 1} [mNm]": 1000 * m["torque"][:, k] for k in (0, 1)},
    },
    "a velocity tells the unit of the position": lambda m: {
        "time": T,
        **{f"pos{k + 1}": DEG * m["q"][:, k] for k in (0, 1)},
        **{f"vel{k + 1}_rad_s": m["v"][:, k] for k in (0, 1)},
        **{f"effort{k + 1}": m["torque"][:, k] for k in (0, 1)},
    },
    "a reversed torque": lambda m: {
        "time": T,
        **{f"joint{k + 1}_angle": m["q"][:, k] for k in (0, 1)},
        **{f"joint{k + 1}_torque": -m["torque"][:, k] for k in (0, 1)},
    },
    "commands and models beside": lambda m: {
        "time": T,
        **{f"q_des{k + 1}": m["q"][:, k] + 0.01 for k in (0, 1)},
        **{f"q_meas{k + 1}": m["q"][:, k] for k in (0, 1)},
        **{f"tau_model{k + 1}": 0.8 * m["torque"][:, k] for k in (0, 1)},
        **{f"tau_meas{k + 1}": m["torque"][:, k] for k in (0, 1)},
        **{f"torque_limit{k + 1}": 50 + 0 * T for k in (0, 1)},
    },
}


@pytest.mark.parametrize("kind", LOGS)
def test_drafts_of_typical_logs_read_positions_velocities_and_torques(
    tmp_path: Path, arm: Robot, motion: dict[str, Any], kind: str
) -> None:
    log = write(tmp_path / "log.csv", LOGS[kind](motion))
    recording = read(draft(arm, log), log)
    np.testing.assert_allclose(recording.time - recording.time[0], T, atol=1e-6)
    for k, joint in enumerate(arm.moving_joints):
        np.testing.assert_allclose(recording[f"{joint.name}.position"], motion["q"][:, k], atol=1e-6)
        np.testing.assert_allclose(recording[f"{joint.name}.torque"], motion["torque"][:, k], atol=1e-4)
        if f"{joint.name}.velocity" in recording:
            np.testing.assert_allclose(recording[f"{joint.name}.velocity"], motion["v"][:, k], atol=1e-6)


def test_columns_of_an_array_are_assigned_to_joints_in_order(
    tmp_path: Path, arm: Robot, motion: dict[str, Any]
) -> None:
    log = tmp_path / "log.npz"
    np.savez(log, time=T, dof_pos=motion["q"], des_dof_pos=motion["q"] + 0.01, tau=motion["torque"].T)
    recording = read(draft(arm, log), log)
    for k, joint in enumerate(arm.moving_joints):
        np.testing.assert_array_equal(recording[f"{joint.name}.position"], motion["q"][:, k])
        np.testing.assert_array_equal(recording[f"{joint.name}.reference_position"], motion["q"][:, k] + 0.01)
        np.testing.assert_array_equal(recording[f"{joint.name}.torque"], motion["torque"][:, k])


def test_torque_constant_and_sign_are_estimated_from_currents(
    tmp_path: Path, arm: Robot, motion: dict[str, Any]
) -> None:
    noise = np.random.default_rng(0).normal(0.0, 0.02, (T.size, 2))
    current = motion["torque"] / np.array([5.0, -2.5]) + noise
    columns = {"t_ms": 1000 * T} | {f"q{k + 1}_deg": DEG * motion["q"][:, k] for k in (0, 1)}
    log = write(tmp_path / "log.csv", columns | {f"i{k + 1}_A": current[:, k] for k in (0, 1)})
    found = draft(arm, log)
    constants = [joint.actuator["torque_constant"] for joint in found.joints]
    assert constants == pytest.approx([5.0, 2.5], rel=0.03)
    assert "gear_ratio" in found.joints[0].questions[0]
    recording = read(found, log)
    for k, joint in enumerate(arm.moving_joints):
        np.testing.assert_allclose(
            recording[f"{joint.name}.current"], abs(current[:, k]) * np.sign(motion["torque"][:, k]), atol=0.2
        )
    (tmp_path / "overlay.toml").write_text(found.overlay)
    described = load_robot("two_link_arm", overlay=tmp_path / "overlay.toml")
    assert described.joints[1].actuator.torque_constant == pytest.approx(2.5, rel=0.03)


def test_sample_rate_is_inferred_from_a_velocity_with_known_unit(
    tmp_path: Path, arm: Robot, motion: dict[str, Any]
) -> None:
    columns = {f"q{k + 1}_deg": DEG * motion["q"][:, k] for k in (0, 1)}
    columns |= {f"vel{k + 1}_rad_s": motion["v"][:, k] for k in (0, 1)}
    found = draft(arm, write(tmp_path / "log.csv", columns))
    assert found.clock.table["rate"] == pytest.approx(200.0, rel=2e-3)


def test_delay_of_a_velocity_is_corrected(tmp_path: Path, arm: Robot, motion: dict[str, Any]) -> None:
    late = np.stack([np.interp(T - 0.08, T, motion["v"][:, k]) for k in (0, 1)], axis=1)
    columns = {"time": T} | {f"q{k + 1}": motion["q"][:, k] for k in (0, 1)}
    columns |= {f"dq{k + 1}": late[:, k] for k in (0, 1)}
    log = write(tmp_path / "log.csv", columns)
    recording = read(draft(arm, log), log)
    there = np.isin(np.round(T, 6), np.round(recording.time, 6))
    velocity = recording[f"{arm.moving_joints[0].name}.velocity"]
    assert np.abs(velocity - motion["v"][there, 0])[20:].max() < 0.05


def test_sign_of_a_torque_is_not_inferred_from_stored_energy(tmp_path: Path, arm: Robot) -> None:
    """A single stroke against a spring looks like a torque of opposite sign."""
    stroke = np.stack([0.3 * np.sin(T / 13.0), 0.2 * np.sin(T / 13.0)], axis=1)
    columns = {"time": T} | {f"q{k + 1}": stroke[:, k] for k in (0, 1)}
    log = write(tmp_path / "log.csv", columns | {f"tau{k + 1}": -stroke[:, k] for k in (0, 1)})
    assert "reversed: " not in draft(arm, log).map


def test_undetermined_properties_become_questions(tmp_path: Path, arm: Robot, motion: dict[str, Any]) -> None:
    slow = 1e-3 * motion["torque"][::1] * 0 + np.random.default_rng(1).normal(size=(T.size, 2))
    columns = {f"q{k + 1}": motion["q"][:, k] for k in (0, 1)} | {f"i{k + 1}": slow[:, k] for k in (0, 1)}
    found = draft(arm, write(tmp_path / "log.csv", columns))
    assert "rate" in found.clock.table
    assert found.clock.questions
    assert all(not joint.actuator and "does not determine" in joint.questions[0] for joint in found.joints)
    assert "# ? " in found.map
    assert "# ? " in found.overlay
    assert found.questions >= 3


@pytest.mark.parametrize(
    ("columns", "expected"),
    [
        ({"a": T, "b": T}, "has no column whose name contains a quantity of a joint (it has"),
        ({"time": T[:20], "q1": T[:20]}, "has no column of at least 50 numbers"),
    ],
)
def test_logs_without_joint_quantities_are_rejected(
    tmp_path: Path, arm: Robot, columns: dict[str, Any], expected: str
) -> None:
    with pytest.raises(InputError) as error:
        draft(arm, write(tmp_path / "log.csv", columns))
    assert expected in str(error.value)


words = st.sampled_from(
    ["q", "tau", "pos", "vel", "i", "t", "time", "1", "2", "_", "deg", "[A]", "\x00", '"', "\n", "é", "#"]
)


@given(
    st.lists(st.lists(words, min_size=1, max_size=5).map("".join), min_size=1, max_size=6, unique=True),
    st.integers(0, 9),
)
@settings(max_examples=40)
def test_any_column_names_give_a_valid_map_or_a_one_line_error(
    tmp_path: Path, arm: Robot, names: list[str], seed: int
) -> None:
    chance = np.random.default_rng(seed)
    data = {name.replace("/", "") or "x": np.cumsum(chance.normal(size=80)) for name in names}
    path = tmp_path / "log.json"
    import json

    path.write_text(json.dumps({name: values.tolist() for name, values in data.items()}))
    try:
        found = draft(arm, path)
    except InputError as error:
        sentence = str(error)
    else:
        assert mapping_from_toml(found.map).channels
        return
    assert "\n" not in sentence


def run(monkeypatch: pytest.MonkeyPatch, *arguments: object) -> int:
    monkeypatch.setattr("sys.argv", ["x", *map(str, arguments)])
    with pytest.raises(SystemExit) as end:
        main()
    return int(end.value.code or 0)


def test_init_writes_map_and_overlay_and_does_not_overwrite_them(
    tmp_path: Path,
    motion: dict[str, Any],
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    columns = {"time": T} | {f"q{k + 1}": motion["q"][:, k] for k in (0, 1)}
    log = write(tmp_path / "run1.csv", columns)
    assert run(monkeypatch, "init", "two_link_arm", log) == 0
    output = capsys.readouterr().out
    assert "Next: missing-physics inspect" in output
    assert {path.name for path in tmp_path.iterdir()} == {
        "run1.csv",
        "run1.map.toml",
        "two_link_arm.overlay.toml",
    }
    assert run(monkeypatch, "init", "two_link_arm", log) == 2
    assert "is there already; choose another folder (--out), or add --force" in capsys.readouterr().err
    assert run(monkeypatch, "init", "two_link_arm", log, "--force", "--quiet") == 0
    assert run(monkeypatch, "inspect", log, "--quiet") == 0


def test_columns_are_assigned_to_motors_and_joints_of_a_transmission_by_name(
    arm: Robot, motion: dict[str, Any], tmp_path: Path
) -> None:
    """Columns named after a motor or a joint belong to it."""
    wrist = {
        "name": "wrist",
        "joints": ("joint1", "joint2"),
        "matrix": ((1.0, 0.0), (-0.5, 1.0)),
        "motors": ({"name": "swing"}, {"name": "twist"}),
    }
    coupled = Robot.model_validate({**arm.model_dump(), "transmissions": [wrist]})
    path = write(
        tmp_path / "log.csv",
        {
            "t": T,
            "swing_position": motion["q"][:, 0],
            "twist_position": motion["q"][:, 1] + 0.5 * motion["q"][:, 0],
            "joint2_reference_position": motion["q"][:, 1],
        },
    )
    found = {entry.channel: entry.column.source for entry in draft(coupled, path).entries}
    assert found == {
        "swing.position": "swing_position",
        "twist.position": "twist_position",
        "joint2.reference_position": "joint2_reference_position",
    }
