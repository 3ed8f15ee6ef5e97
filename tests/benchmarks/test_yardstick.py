"""The table of real machines: every row exists, loads, and has the signs and units of its robot."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import butter, filtfilt

from benchmarks.evidence import EXAMPLES
from benchmarks.yardstick import Loaded, Machine, load, machine, rows
from benchmarks.yardstick.inspect import main as print_table
from missing_physics.diagnosis import make_dynamics
from missing_physics.recordings import load_mapping, load_recording
from missing_physics.recordings.datasets import DATASETS
from reference_model.effects.catalogue import get_effect
from robot_model import InputError, Recording

ROOT = Path(__file__).parents[2]
ROWS = {row.name: row for row in rows()}
every_row = pytest.mark.parametrize("row", ROWS.values(), ids=ROWS)


@pytest.fixture(autouse=True)
def _data(monkeypatch: pytest.MonkeyPatch) -> None:
    """The folder of real recordings next to the repository, unless another is given."""
    beside = ROOT.parent / "shared" / "recordings"
    if not os.environ.get("MISSING_PHYSICS_DATA") and beside.is_dir():
        monkeypatch.setenv("MISSING_PHYSICS_DATA", str(beside))


@cache
def _loaded(name: str) -> Loaded | str:
    try:
        return load(ROWS[name])
    except InputError as error:
        if "recordings are not here" not in str(error):
            raise
        return str(error)


def loaded(name: str) -> Loaded:
    """A row, read once for all tests; skips where its recordings are not on this machine."""
    found = _loaded(name)
    if isinstance(found, str):
        pytest.skip(found)
    return found


@every_row
def test_a_row_names_existing_files(row: Machine) -> None:
    files = {file.name for file in DATASETS[row.dataset].files}
    assert {run.file for run in (*row.fit, *row.held_out)} <= files
    assert row.fit
    example = EXAMPLES / row.dataset
    own = [row.map, *(run.map for run in (*row.fit, *row.held_out) if run.map)]
    if row.published is not None:
        own.append(row.published.map)
        stems = [Path(run.file).stem for run in (*row.fit, *row.held_out)]
        assert {row.published.file.format(stem=stem) for stem in stems} <= files
    if row.overlay:
        own.append(row.overlay)
        assert row.robot in files
    else:
        own.append(row.robot)
    assert all((example / name).is_file() for name in own)
    assert (example / "README.md").is_file()


def test_every_dataset_is_in_the_yardstick() -> None:
    assert {row.dataset for row in ROWS.values()} == set(DATASETS)
    assert len(ROWS) == len(rows())


@every_row
def test_published_values_use_names_of_the_catalogue(row: Machine) -> None:
    for known in row.known:
        effect = get_effect(known.effect)
        assert set(known.values) <= {parameter.name for parameter in effect.parameters}


@every_row
def test_a_row_loads(row: Machine) -> None:
    """With the checks that a command makes: no channel of a real machine contradicts another."""
    found = loaded(row.name)
    names = {joint.name for joint in found.robot.moving_joints}
    places = names | {link.name for link in found.robot.links} | {"base"}
    assert set(row.joints) <= names
    assert {known.at.split(".")[0] for known in row.known} <= places
    assert [len(part) for part in (found.fit, found.held_out)] == [len(row.fit), len(row.held_out)]
    for run, recording in zip((*row.fit, *row.held_out), (*found.fit, *found.held_out)):
        assert {f"{name}.position" for name in names} <= set(recording)
        if run.window is not None:
            assert run.window[0] <= recording.time[0] < recording.time[-1] < run.window[1]


def test_held_out_and_fitted_runs_share_no_sample() -> None:
    for row in ROWS.values():
        for fit in row.fit:
            for held in row.held_out:
                if fit.file == held.file and fit.record == held.record:
                    assert fit.window is not None
                    assert held.window is not None
                    assert fit.window[1] <= held.window[0] or held.window[1] <= fit.window[0]


@dataclass(frozen=True)
class Along:
    """Torques and motion of the first run that is fitted, below one cut-off, shape (N, n) each."""

    joints: tuple[str, ...]
    measured: NDArray
    nominal: NDArray
    acceleration: NDArray
    velocity: NDArray
    direction: NDArray


def along(row: str) -> Along:
    found = loaded(row)
    (dynamics,) = make_dynamics(found.robot, found.fit[:1])
    motion = dynamics.motion
    kept = slice(motion.time.size // 20, -motion.time.size // 20)
    ways = (motion.torque, dynamics.torque, motion.acceleration, motion.velocity, np.sign(motion.velocity))
    names = tuple(joint.name for joint in found.robot.moving_joints)
    return Along(names, *(motion.low_pass.smooth(way)[kept] for way in ways))


@pytest.mark.parametrize(
    ("row", "joint", "least"),
    [
        ("dfki_double_pendulum_C0", "Joint1", 0.9),
        ("dfki_double_pendulum_C1", "Joint1", 0.8),
        ("dfki_double_pendulum_C1", "Joint2", 0.6),
        ("dfki_double_pendulum_A0", "Joint1", 0.6),
        ("dfki_simple_pendulum", "Joint_1", 0.95),
        ("kuka_iiwa14_joint2", "iiwa_joint_2", 0.95),
        ("kuka_iiwa14_joint4", "iiwa_joint_4", 0.95),
        ("kuka_iiwa14_joint6", "iiwa_joint_6", 0.9),
        ("kinova_gen3", "joint_2", 0.9),
        ("kinova_gen3_sensor", "joint_2", 0.9),
        ("kinova_gen3_sensor", "joint_4", 0.8),
        ("laas_acceleration", "joint1", 0.9),
        ("qube_servo_furuta", "joint1", 0.95),
        ("cycloidal_pendulum", "joint1", 0.7),
    ],
)
def test_recorded_torque_matches_the_motion(row: str, joint: str, least: float) -> None:
    """Signs, units and joints are right if recorded torque and nominal inverse dynamics correlate."""
    found = along(row)
    place = found.joints.index(joint)
    measured, nominal = found.measured[:, place], found.nominal[:, place]
    assert np.corrcoef(measured, nominal)[0, 1] > least
    # No gear ratio, no kN m and no degree is between them; a rotor that is not in the file may be.
    assert 1 / 3 < np.std(measured) / np.std(nominal) < 3 or row == "cycloidal_pendulum"


def test_every_joint_of_the_quadruped_has_friction_and_damping() -> None:
    """The PD law, column by column: targets of another kind of joint would not fit."""
    found = along("go2")
    for place, joint in enumerate(found.joints):
        ways = (found.acceleration, found.velocity, found.direction, np.ones_like(found.velocity))
        parts = np.transpose([way[:, place] for way in ways])
        extra = found.measured[:, place] - found.nominal[:, place]
        numbers, left, *_ = np.linalg.lstsq(parts, extra, rcond=None)
        # At 1 rad/s, because the chirp barely separates damping from dry friction; legs agree to a factor.
        assert 0.3 < numbers[1] + numbers[2] < 2.0, joint
        assert numbers[0] > 0.02 or "calf" not in joint, joint  # the calf's drive is geared down further
        assert left[0] < 0.1 * found.measured[:, place].var() * extra.size, joint


def test_the_free_pendulum_has_the_frequency_of_a_uniform_rod() -> None:
    """q'' = -w^2 sin q and little else, with w^2 = 3 g/(2 L): rate and unit of the angle are right."""
    recording = loaded("jensen_free_pendulum").fit[0]
    q = _smooth(recording, "joint1.position", 15.0)
    v = np.gradient(q, recording.time)
    a = np.gradient(v, recording.time)
    kept = slice(200, -200)
    parts = np.transpose([-np.sin(q), -v])[kept]
    numbers = np.linalg.lstsq(parts, a[kept], rcond=None)[0]
    assert numbers[0] == pytest.approx(3 * 9.81 / (2 * 0.124), rel=0.02)
    assert numbers[1] > 0  # it decays


@pytest.mark.parametrize("build", ["base", "conic", "split"])
def test_the_locked_gear_behaves_like_a_spring(build: str) -> None:
    """Torque over the motor's angle at large torques: some hundreds of N m/rad, as the authors plot."""
    recording = loaded(f"cycloidal_locked_{build}").fit[1]
    q, tau = (_smooth(recording, name, 2.0) for name in ("joint1.position", "joint1.torque"))
    loading = (np.abs(tau) > 12) & (np.abs(tau) < 22) & (tau * np.gradient(tau) > 0)
    for side in (tau > 0, tau < 0):
        stiffness = np.polyfit(q[loading & side], tau[loading & side], 1)[0]
        assert 100 < stiffness < 500


def test_the_damper_resists_its_motion() -> None:
    recording = loaded("arts_friction_damper").fit[0]
    q, force = (_smooth(recording, name, 10.0) for name in ("joint1.position", "joint1.torque"))
    assert np.ptp(q) == pytest.approx(2 * 0.0254, rel=0.02)  # 1 in to both sides
    assert np.corrcoef(np.sign(np.gradient(q)), force)[0, 1] > 0.5


def _smooth(recording: Recording, channel: str, cutoff: float) -> NDArray:
    low, high = butter(2, cutoff, fs=recording.sample_rate)
    return np.asarray(filtfilt(low, high, recording[channel]))


def test_the_published_layout_reads_as_the_prepared_one(tmp_path: Path) -> None:
    """A run in its authors' layout, made from the prepared one, gives the same channels."""
    for row in (ROWS["kuka_iiwa14_joint2"], ROWS["arts_friction_damper"]):
        prepared = loaded(row.name).fit[0]
        assert row.published is not None
        file = tmp_path / row.published.file.format(stem=Path(row.fit[0].file).stem)
        file.parent.mkdir(exist_ok=True)
        (_as_folder if file.suffix == ".txt" else _as_matrix)(prepared, file)
        mapping = load_mapping(EXAMPLES / row.dataset / row.published.map)
        read = load_recording(file, mapping=mapping)
        assert set(read) == set(prepared)
        for channel in read:
            np.testing.assert_allclose(read[channel], prepared[channel], rtol=1e-12, atol=1e-12)
        np.testing.assert_allclose(read.time, prepared.time, atol=1e-9)


def _as_folder(recording: Recording, file: Path) -> None:
    """One file for each quantity, cells and rows ending in tabs, without names; the torque as recorded."""
    file.write_text("".join(f"{t!r}\n" for t in recording.time.tolist()))
    for quantity, sign in (("position", 1.0), ("torque", -1.0)):
        columns = [sign * recording[f"iiwa_joint_{i}.{quantity}"] for i in range(1, 8)]
        lines = ["".join(f"{value!r}\t" for value in line) + "\n" for line in np.transpose(columns).tolist()]
        (file.parent / f"joint_{quantity}_measured.txt").write_text("".join(lines))


def _as_matrix(recording: Recording, file: Path) -> None:
    """JSON with one matrix and words about it, in inches and thousands of pounds-force."""
    inches = recording["joint1.position"] / 0.0254
    kip = recording["joint1.torque"] / 4448.2216152605
    rows = np.transpose([recording.time, inches, kip, 0 * kip, 0 * kip, 0 * kip]).tolist()
    file.write_text(json.dumps({"data": rows, "sampling freq": 1024, "time units": "s"}))


def test_missing_data_of_a_machine_are_reported(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("MISSING_PHYSICS_DATA", str(tmp_path))
    monkeypatch.setenv("MISSING_PHYSICS_CACHE", str(tmp_path))
    with pytest.raises(InputError, match="go2: its recordings are not here; run `missing-physics datasets"):
        load(machine("go2"))
    print_table(["go2"])
    assert "go2: its recordings are not here" in capsys.readouterr().out


def test_the_table_of_recordings(capsys: pytest.CaptureFixture[str]) -> None:
    loaded("jensen_free_pendulum")
    print_table(["jensen_free_pendulum", "kuka_iiwa14_joint5"])
    lines = [line for line in capsys.readouterr().out.splitlines() if line.strip()]
    assert any("fs_03.txt, 0.25 to 5 s" in line and "0 of 1" in line for line in lines)
    assert any("held out" in line and "no run" in line for line in lines)


def test_an_unknown_machine() -> None:
    with pytest.raises(InputError, match="did you mean 'kuka_kr300'"):
        machine("kuka_kr30")
