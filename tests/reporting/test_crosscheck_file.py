"""The rerun file of a crosscheck: valid, read back value by value, thinned without losing extremes, small."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from crosscheck_cases import comparison, robot
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray
from rerun.chunk import RrdReader

from missing_physics.reporting.crosscheck import Comparison, compare, file, write_crosscheck
from missing_physics.reporting.crosscheck.blueprint import scene_title
from missing_physics.reporting.crosscheck.lanes import COLOURS, REST, friction_states
from missing_physics.reporting.crosscheck.paths import ENGINES, SHADES
from missing_physics.reporting.crosscheck.scene import scene
from missing_physics.reporting.elements import palette
from missing_physics.reporting.scene.deflection import bent_line
from missing_physics.reporting.scene.drawing import outline
from missing_physics.reporting.scene.eye import eye_on
from robot_model import Recording, load_robot

#: rerun keeps time in whole nanoseconds.
NANOSECOND = 1e-9
#: Places are in single precision, of some ten metres.
SINGLE = 2e-6


@pytest.fixture(scope="module")
def found() -> Comparison:
    return comparison()


@pytest.fixture(scope="module")
def path(found: Comparison, tmp_path_factory: pytest.TempPathFactory) -> Path:
    target = tmp_path_factory.mktemp("crosscheck") / "comparison.rrd"
    write_crosscheck(robot(), found, target)
    return target


def read(path: Path) -> dict[str, dict[str, list[object]]]:
    """Entity path to the columns of its temporal chunks, time in s."""
    columns: dict[str, dict[str, list[object]]] = {}
    for chunk in RrdReader(path).stream():
        if chunk.is_static:
            continue
        batch = chunk.to_record_batch()
        nanoseconds = batch.column("sim_time").cast("int64").to_numpy(zero_copy_only=False)
        names = [n for n in batch.schema.names if ":" in n and not n.startswith("rerun.")]
        own = {name: batch.column(name).to_pylist() for name in names}
        assert chunk.entity_path not in columns, "one chunk per series"
        columns[chunk.entity_path] = {"time": list(nanoseconds * NANOSECOND), **own}
    return columns


def scalars(columns: dict[str, list[object]]) -> np.ndarray:
    return np.array([float(np.ravel(item)[0]) for item in columns["Scalars:scalars"]])  # type: ignore[call-overload]


def words(path: Path) -> str:
    chunk = next(c for c in RrdReader(path).stream() if c.entity_path == "/summary")
    return str(chunk.to_record_batch().column("TextDocument:text").to_pylist()[0][0])


def test_verifies_and_opens_on_a_blueprint(path: Path) -> None:
    command = [sys.executable, "-m", "rerun", "rrd", "verify", str(path)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert len(RrdReader(path).blueprints()) == 1


def test_every_series_reads_back_value_by_value(path: Path, found: Comparison) -> None:
    columns = read(path)
    for item in found.differences:
        name = item.channel
        for place, values in {
            f"/channels/{name}/reference": found.reference[name],
            f"/channels/{name}/exudyn": found.exudyn[name],
            f"/difference/{name}": found.exudyn[name] - found.reference[name],
            f"/difference/{name}/band/above": found.bands[name],
            f"/difference/{name}/band/below": -found.bands[name],
        }.items():
            assert np.array_equal(scalars(columns[place]), values), place
            assert np.allclose(columns[place]["time"], found.reference.time, rtol=0, atol=NANOSECOND)


def test_lanes_change_at_stops_and_reversals(path: Path, found: Comparison) -> None:
    lane = read(path)["/friction/joint1/reference"]
    velocity = found.reference["joint1.velocity"]
    states = friction_states(velocity)
    changes = np.flatnonzero(np.concatenate(([True], states[1:] != states[:-1])))
    assert [state[0] for state in lane["StateChange:state"]] == list(states[changes])  # type: ignore[index]
    assert np.allclose(lane["time"], found.reference.time[changes], rtol=0, atol=NANOSECOND)
    assert len(changes) > 2
    told = friction_states(np.array([0.0, 2 * REST, -2 * REST])).tolist()
    assert told == ["sticks", "slips forwards", "slips backwards"]


def test_both_drawn_robots_follow_their_simulations(path: Path, found: Comparison) -> None:
    columns = read(path)
    drawn = scene(robot(), {"reference": found.reference, "exudyn": found.exudyn})
    for engine, recording in (("reference", found.reference), ("exudyn", found.exudyn)):
        base = columns[f"/robot/{engine}/base"]
        shown = np.array([np.ravel(item) for item in base["Transform3D:translation"]], dtype=float)  # type: ignore[call-overload]
        wanted = np.column_stack(
            [np.interp(base["time"], recording.time, recording[f"base.position.{a}"]) for a in "xyz"]
        )
        assert np.allclose(shown, wanted, atol=SINGLE)
        strips = np.array([item[0] for item in columns[f"/robot/{engine}/link2/bent"]["LineStrips3D:strips"]])  # type: ignore[index]
        assert np.allclose(
            strips, bent_line(robot().link("link2"), drawn.drawings[engine].deflections["link2"]), atol=SINGLE
        )
        tips = np.array([np.ravel(i) for i in columns[f"/robot/{engine}/link2/tip"]["Points3D:positions"]])  # type: ignore[call-overload]
        assert np.allclose(tips, strips[:, -1], atol=SINGLE)


def test_deflections_are_drawn_with_the_stated_magnification(path: Path, found: Comparison) -> None:
    drawn = scene(robot(), {"reference": found.reference, "exudyn": found.exudyn})
    # Largest deflection sqrt(1 + 4) mm of 6 m; 0.12 of 6 m is 322 times as much.
    assert drawn.factor == 200.0
    moved = np.column_stack([found.reference[f"link2.tip_deflection.{axis}"] for axis in "xyz"])
    rows = np.searchsorted(found.reference.time, drawn.time)
    assert np.allclose(drawn.drawings["reference"].deflections["link2"], 200 * moved[rows])
    assert "x 200" in scene_title(drawn)
    assert "magnified 200 times" in words(path)
    stiff = {name: 0 * y if "deflection" in name else y for name, y in found.reference.channels.items()}
    still = replace(found.reference, channels=stiff)
    assert "to scale" in scene_title(scene(robot(), {"reference": still, "exudyn": still}))


def test_camera_sees_all_drawn_geometry(found: Comparison) -> None:
    drawn = scene(robot(), {"reference": found.reference, "exudyn": found.exudyn})
    for drawing in drawn.drawings.values():
        placed = drawing.poses
        bent = bent_line(robot().link("link2"), drawing.deflections["link2"])
        frame = placed["link2"]
        line = frame.translation[:, None] + np.einsum("nij,npj->npi", frame.rotation, bent)
        for points in (line, *(pose.translation for pose in placed.values())):
            assert np.abs(drawn.eye.seen(points.reshape(-1, 3))).max() <= 1.0


def test_drawn_geometry_fills_the_view(found: Comparison) -> None:
    drawn = scene(robot(), {"reference": found.reference, "exudyn": found.exudyn})
    points = outline(robot(), tuple(drawn.drawings.values()))
    assert 0.8 < np.abs(drawn.eye.seen(points)).max() <= 0.9


@given(
    arrays(float, (12, 3), elements=st.floats(-20.0, 20.0)),
    st.floats(0.01, 10.0),
)
def test_camera_sees_all_points_at_any_position(points: NDArray[np.float64], least: float) -> None:
    assert np.abs(eye_on(points, least=least).seen(points)).max() <= 0.9


def test_long_series_are_thinned_keeping_the_largest_difference(
    tmp_path: Path, found: Comparison, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(file, "MOST_SAMPLES", 100 * 5 * len(found.differences))
    spike = found.exudyn["joint2.torque"].copy()
    spike[123] += 7.0
    wild = compare(robot(), found.reference, found.exudyn.with_channels({"joint2.torque": spike}))
    target = tmp_path / "thin.rrd"
    write_crosscheck(robot(), wild, target)
    columns = read(target)
    gap = columns["/difference/joint2.torque"]
    assert len(gap["time"]) <= 100
    assert scalars(gap).max() == pytest.approx(7.0, abs=1e-4)
    assert "thinned to at most 100 of 801 samples" in words(target)
    assert "thinned" not in words(target).replace("thinned to at most 100", "")


def test_an_hour_of_the_flexible_robot_stays_below_50_megabytes(tmp_path: Path) -> None:
    target = tmp_path / "long.rrd"
    write_crosscheck(robot(), comparison(samples=200_000), target)
    assert target.stat().st_size < 50e6


def test_a_rigid_robot_on_a_fixed_base_without_bands(tmp_path: Path) -> None:
    arm = load_robot("two_link_arm")
    time = np.linspace(0, 1, 50)
    channels = {
        f"joint{k}.{what}": np.sin(k * time) for k in (1, 2) for what in ("position", "velocity", "torque")
    }
    first, second = Recording(time, channels, "one"), Recording(time, channels, "two")
    target = tmp_path / "comparison.rrd"
    write_crosscheck(arm, compare(arm, first, second), target)
    columns = read(target)
    assert "/robot/exudyn/link2" in columns
    assert not [name for name in columns if "band" in name or "bent" in name]
    command = [sys.executable, "-m", "rerun", "rrd", "verify", str(target)]
    assert subprocess.run(command, capture_output=True, check=False).returncode == 0


def test_lanes_use_other_colours_than_the_engines() -> None:
    engines = {palette.AFTER, *(SHADES[engine][0] for engine in ENGINES)}
    assert not engines & set(COLOURS.values())
