"""The rerun file: valid, read back value by value, thinned without losing spikes, whole or not at all."""

from __future__ import annotations

import resource
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from reporting_cases import empty_result, hidden_friction, two_link_arm
from rerun.chunk import RrdReader

from missing_physics.reporting import write_rerun
from missing_physics.reporting.scene.skeleton import poses
from missing_physics.reporting.viewer import file as rerun_file
from missing_physics.reporting.viewer.lanes import MISMATCH, _windows
from missing_physics.results.result import Result
from robot_model import InputError

#: rerun keeps time in whole nanoseconds.
NANOSECOND = 1e-9


@pytest.fixture(scope="module")
def result() -> Result:
    return hidden_friction()


@pytest.fixture(scope="module")
def path(result: Result, tmp_path_factory: pytest.TempPathFactory) -> Path:
    target = tmp_path_factory.mktemp("rerun") / "comparison.rrd"
    write_rerun(result, two_link_arm(), target)
    return target


def read(path: Path) -> dict[str, dict[str, np.ndarray]]:
    """Entity path to the columns of its temporal chunks, time in s."""
    found: dict[str, dict[str, np.ndarray]] = {}
    for chunk in RrdReader(path).stream():
        if chunk.is_static:
            continue
        batch = chunk.to_record_batch()
        columns = {name: batch.column(name) for name in batch.schema.names if not name.startswith("rerun.")}
        values = {
            name: np.array(c.to_pylist(), dtype=object) for name, c in columns.items() if name != "sim_time"
        }
        nanoseconds = columns["sim_time"].cast("int64").to_numpy(zero_copy_only=False)
        assert chunk.entity_path not in found, "one chunk per series"
        found[chunk.entity_path] = {"time": nanoseconds * NANOSECOND, **values}
    return found


def scalars(columns: dict[str, np.ndarray]) -> np.ndarray:
    return np.array([float(np.ravel(item)[0]) for item in columns["Scalars:scalars"]])


def test_rerun_file_verifies(path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "rerun", "rrd", "verify", str(path)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr


def test_every_series_reads_back_value_by_value(path: Path, result: Result) -> None:
    found = read(path)
    for run, recording in (("run1", "run_a.csv"), ("run2", "run_b.csv")):
        for series in (s for s in result.series if s.recording == recording):
            for place, values in {
                f"/{run}/channels/{series.channel}/recorded": series.measured,
                f"/{run}/channels/{series.channel}/nominal": series.nominal,
                f"/{run}/channels/{series.channel}/augmented": series.augmented,
                f"/{run}/residuals/{series.channel}/before": series.measured - series.nominal,
                f"/{run}/residuals/{series.channel}/after": series.measured - series.augmented,
            }.items():
                assert np.array_equal(scalars(found[place]), values), place
                assert np.allclose(found[place]["time"], series.time, rtol=0, atol=NANOSECOND)


def test_lanes_show_windows_and_held_out_parts(path: Path, result: Result) -> None:
    found = read(path)
    lane = found["/run1/lanes/windows/joint2.torque"]
    states = [state[0] for state in lane["StateChange:state"]]
    assert states == ["", MISMATCH, "", MISMATCH, ""]
    windows = result.diagnosis.mismatch[0].windows
    assert np.allclose(lane["time"], [0.0, *np.ravel(windows)], rtol=0, atol=NANOSECOND)
    assert not [name for name in found if name.startswith("/run2/lanes/windows")]
    data = found["/run1/lanes/data"]
    assert [s[0] for s in data["StateChange:state"]] == ["fitted", "held out", "fitted", "held out"]
    assert np.allclose(data["time"], [0.0, 7.0, 10.0, 17.0], rtol=0, atol=NANOSECOND)
    assert [s[0] for s in found["/run2/lanes/data"]["StateChange:state"]] == ["held out"]


def test_robot_moves_as_recorded(path: Path, result: Result) -> None:
    lane = read(path)["/run1/robot/link2"]
    first, second = (s for s in result.series if s.recording == "run_a.csv")
    angles = [np.interp(lane["time"], s.time, s.position) for s in (first, second)]  # type: ignore[arg-type]
    expected = poses(two_link_arm(), dict(zip(("joint1", "joint2"), angles)))["link2"]
    shown = np.array([np.ravel(item) for item in lane["Transform3D:translation"]], dtype=float)
    # Transforms are single precision, of lengths below 1 m; times are rounded to a nanosecond.
    assert np.allclose(shown, expected.translation, atol=1e-6)


def test_rerun_file_opens_with_a_blueprint(path: Path) -> None:
    assert len(RrdReader(path).blueprints()) == 1


def test_same_result_gives_the_same_rerun_file(path: Path, result: Result, tmp_path: Path) -> None:
    again = tmp_path / "again.rrd"
    write_rerun(result, two_link_arm(), again)
    assert RrdReader(again).recordings()[0].recording_id == RrdReader(path).recordings()[0].recording_id


def test_long_series_are_thinned_keeping_spikes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rerun_file, "MOST_SAMPLES", 20_000)
    full = hidden_friction()
    spike = full.series[1].measured.copy()
    spike[1234] = 500.0
    series = (full.series[0], replace(full.series[1], measured=spike), *full.series[2:])
    target = tmp_path / "thin.rrd"
    write_rerun(replace(full, series=series), two_link_arm(), target)
    found = read(target)
    lines = [name for name, columns in found.items() if "Scalars:scalars" in columns]
    assert len(lines) == 20
    assert sum(found[name]["time"].size for name in lines) <= 20_000
    assert scalars(found["/run1/channels/joint2.torque/recorded"]).max() == 500.0
    text = next(c for c in RrdReader(target).stream() if c.entity_path == "/summary").to_record_batch()
    assert "thinned to at most 1000 samples" in text.column("TextDocument:text").to_pylist()[0][0]


def test_hundred_thousand_samples_of_six_joints_stay_below_50_megabytes(tmp_path: Path) -> None:
    result = hidden_friction(seconds=200.0)
    first = result.series[1]
    series = tuple(replace(first, channel=f"joint{n}.torque") for n in range(1, 7))
    target = tmp_path / "long.rrd"
    write_rerun(replace(result, series=series), two_link_arm(), target)
    assert target.stat().st_size < 50e6


@pytest.mark.parametrize("name", ["<script>alert(1)</script>", "a/b c\\d", "..", "joint 2.[torque]\n"])
def test_any_name_makes_a_valid_file(name: str, tmp_path: Path) -> None:
    target = tmp_path / "named.rrd"
    write_rerun(hidden_friction(seconds=2.0, name=name), two_link_arm(), target)
    lines = [columns for columns in read(target).values() if "Scalars:scalars" in columns]
    # Two recordings of one name hold the channel twice each, and none may cover another.
    assert len(lines) == 20


@pytest.mark.parametrize("verdict", ["consistent", "not_enough_data", "unexplained", "ambiguous"])
@pytest.mark.parametrize("series", [True, False])
def test_other_verdicts_are_written(verdict: str, series: bool, tmp_path: Path) -> None:
    target = tmp_path / "comparison.rrd"
    write_rerun(empty_result(verdict, series=series), two_link_arm(), target)  # type: ignore[arg-type]
    names = {chunk.entity_path for chunk in RrdReader(target).stream()}
    assert "/summary" in names
    assert ("/run1/channels/joint1.torque/recorded" in names) is series


def test_without_positions_there_is_no_robot(tmp_path: Path) -> None:
    full = hidden_friction(seconds=2.0)
    bare = tuple(replace(s, position=None, velocity=None) for s in full.series)
    target = tmp_path / "comparison.rrd"
    write_rerun(replace(full, series=bare), two_link_arm(), target)
    assert not [name for name in read(target) if "/robot/" in name]


def test_writing_is_whole_or_not_at_all(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    target = tmp_path / "comparison.rrd"
    target.write_text("old")

    def fail(*arguments: object) -> None:
        raise RuntimeError("half way")

    monkeypatch.setattr(rerun_file, "send_motion", fail)
    with pytest.raises(RuntimeError, match="half way"):
        write_rerun(hidden_friction(seconds=2.0), two_link_arm(), target)
    assert target.read_text() == "old"
    assert [item.name for item in tmp_path.iterdir()] == ["comparison.rrd"]
    monkeypatch.undo()
    with pytest.raises(InputError, match="cannot write"):
        write_rerun(hidden_friction(seconds=2.0), two_link_arm(), target / "comparison.rrd")


def test_full_disk_gives_one_sentence(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """Instead of a thread of rerun's that is waited for."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, before[1]))
    try:
        with pytest.raises(InputError, match=r"^cannot write .*comparison\.rrd: File too large\.$"):
            write_rerun(hidden_friction(seconds=2.0), two_link_arm(), tmp_path / "comparison.rrd")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert list(tmp_path.iterdir()) == []
    assert capfd.readouterr() == ("", "")


@given(
    spans=st.lists(
        st.tuples(st.integers(-5, 25), st.integers(0, 8)).map(lambda p: (float(p[0]), float(p[0] + p[1]))),
        max_size=6,
    )
)
def test_lane_of_windows_covers_them_and_nothing_else(spans: list[tuple[float, float]]) -> None:
    series = hidden_friction(seconds=2.0).series[0]
    series = replace(series, time=np.array([0.0, 20.0]))
    changes = _windows(series, tuple(spans))
    times = sorted(changes)
    for instant in np.arange(0.5, 20.0):
        state = changes[max(t for t in times if t <= instant)]
        inside = any(low <= instant <= high for low, high in spans)
        assert (state == MISMATCH) is inside
