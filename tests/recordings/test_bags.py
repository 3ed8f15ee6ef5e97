"""ROS bags: joint states without a map; unreadable bags give one sentence."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
from bags_written import JOINT_STATE, LATE, START, T, states, texts, write_bag

from missing_physics.cli import main
from missing_physics.recordings import load_recording, mapping_from_toml, read_raw
from missing_physics.recordings.readers import Budget, bags
from robot_model import InputError

KINDS = ("a.bag", "a.mcap", "a.db3", "folder")


@pytest.mark.parametrize("name", KINDS)
def test_joint_states_need_no_map(tmp_path: Path, name: str) -> None:
    path = write_bag(tmp_path / name, states() + texts())
    recording = load_recording(path, check=False)
    assert set(recording) == {f"joint{k}.{q}" for k in (1, 2) for q in ("position", "velocity", "torque")}
    np.testing.assert_allclose(recording.time, T, atol=1e-12)
    np.testing.assert_array_equal(recording["joint2.position"], 2 * np.sin(T))
    np.testing.assert_array_equal(recording["joint1.velocity"], np.cos(T))
    np.testing.assert_array_equal(recording["joint2.torque"], -2 * np.sin(T))


@pytest.mark.parametrize(("name", "packed"), [("a.bag", "chunk"), ("a.mcap", "storage")])
def test_compressed_files(tmp_path: Path, name: str, packed: str) -> None:
    recording = load_recording(write_bag(tmp_path / name, states(), packed=packed), check=False)
    np.testing.assert_array_equal(recording["joint2.position"], 2 * np.sin(T))


@pytest.mark.parametrize("packed", ["file", "message", "storage"])
def test_compressed_folders(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, packed: str) -> None:
    """A whole file is unpacked into a temporary folder, of which nothing is left."""
    path = write_bag(tmp_path / "folder", states(), packed=packed)
    temporary = tmp_path / "temporary"
    temporary.mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(temporary))
    recording = load_recording(path, check=False)
    np.testing.assert_array_equal(recording["joint2.position"], 2 * np.sin(T))
    assert not list(temporary.iterdir())


@pytest.mark.skipif(sys.platform == "win32", reason="no such limits there")
def test_folder_with_an_excessive_unpacked_size_is_rejected(tmp_path: Path) -> None:
    zstd = pytest.importorskip("backports.zstd" if sys.version_info < (3, 14) else "compression.zstd")
    path = write_bag(tmp_path / "folder", states(), packed="file")
    [file] = [file for file in path.iterdir() if file.name != "metadata.yaml"]
    file.write_bytes(zstd.compress(bytes(400 << 20)))
    with pytest.raises(InputError, match="File too large"):
        load_recording(path)


def test_joints_are_identified_by_name_in_each_message(tmp_path: Path) -> None:
    turned = np.outer(np.sin(T[1::2]), [2.0, 1.0])
    both = states(time=T[::2]) + states(joints=("joint2", "joint1"), time=T[1::2], position=turned)
    recording = load_recording(write_bag(tmp_path / "a.bag", both), check=False)
    for joint, amplitude in (("joint1", 1.0), ("joint2", 2.0)):
        np.testing.assert_array_equal(recording[f"{joint}.position"], amplitude * np.sin(T))


def test_empty_or_nan_fields_are_not_channels(tmp_path: Path) -> None:
    sent = states(velocity=np.zeros((80, 0)), effort=np.full((80, 2), np.nan))
    recording = load_recording(write_bag(tmp_path / "a.mcap", sent), check=False)
    assert set(recording) == {"joint1.position", "joint2.position"}


def test_map_without_channels_selects_the_receive_time(tmp_path: Path) -> None:
    path = write_bag(tmp_path / "a.mcap", states(stamps=np.zeros(80)))
    with pytest.raises(
        InputError, match=r"one and the same time in their headers; .*source = \"receive_time\""
    ):
        load_recording(path)
    mapping = mapping_from_toml('[time]\nsource = "receive_time"')
    recording = load_recording(path, mapping=mapping, check=False)
    np.testing.assert_allclose(recording.time, T, atol=1e-12)
    assert "joint2.torque" in recording


def test_map_reads_topics_with_different_clocks(tmp_path: Path) -> None:
    slow = T[5:75:2] + 0.001
    sent = states() + states("/hand", ("finger",), time=slow)
    path = write_bag(tmp_path / "a.bag", sent)
    message = r"joint states of 2 kinds, /joint_states \(joint1, joint2\); /hand \(finger\); say in a map"
    with pytest.raises(InputError, match=message):
        load_recording(path)
    mapping = mapping_from_toml(
        '[time]\nsource = "/joint_states.joint1.time"\n'
        '[channels."joint1.position"]\nsource = "/joint_states.joint1.position"\n'
        '[channels."finger.position"]\nsource = "/hand.finger.position"\n'
        'time = { source = "/hand.finger.time" }\n'
    )
    recording = load_recording(path, mapping=mapping, check=False)
    np.testing.assert_allclose(recording["finger.position"], np.sin(recording.time), atol=1e-4)


def test_time_stamps_are_those_of_the_headers(tmp_path: Path) -> None:
    """The recorder had them late, by a delay that grows."""
    raw = read_raw(write_bag(tmp_path / "a.mcap", states(stamps=START - LATE + (0.98e9 * T).astype(int))))
    np.testing.assert_allclose(raw["time"], 0.98 * T, atol=1e-8)
    np.testing.assert_allclose(raw["receive_time"], T, atol=1e-8)


def twice(node: str) -> list[tuple[object, ...]]:
    return [*states(), *states(time=T + 0.004, node=node)]


def apart(time: np.ndarray) -> list[tuple[object, ...]]:
    """Two nodes of which the bag knows nothing, whose arms are in other places."""
    other = 0.4 + np.outer(np.cos(time), [1.0, 0.5])
    return [*states(), *states(time=time, position=other)]


@pytest.mark.parametrize(
    ("name", "sent", "also", "message"),
    [
        (
            "a.bag",
            twice("/other"),
            (),
            r"same joints from 2 nodes on /joint_states \(/driver, /other\); record",
        ),
        (
            "a.mcap",
            states() + states(joints=("joint2", "joint3")),
            (),
            "joint joint2 in messages of two kinds",
        ),
        (
            "a.db3",
            apart(T + 0.004),
            (),
            "positions on /joint_states that jump to and fro between two",
        ),
        ("a.mcap", apart(T[::2] + 0.004), (), "as where two nodes publish the same joints; record one"),
        ("a.mcap", states() + states(), (), "stamps on /joint_states that repeat or go back in 80 of 160"),
        ("a.db3", texts(), (), r"no messages of type sensor_msgs/JointState \(it has /chatter \(std_msgs"),
        ("a.bag", texts(), [("/joint_states", JOINT_STATE)], "the topic is empty"),
        ("a.mcap", texts(), [("/joint_states", JOINT_STATE)], "the topic is empty"),
        ("a.mcap", states(joints=()), (), "its messages name no joints"),
        ("a.mcap", states(joints=("a", "a")), (), "names a joint twice in a message of /joint_states"),
        ("a.mcap", states(position=np.zeros((80, 3))), (), "3 values of position for 2 joints in message 1"),
    ],
)
def test_unreadable_bags_give_one_sentence(
    tmp_path: Path,
    name: str,
    sent: list[tuple[object, ...]],
    also: list[tuple[str, str]],
    message: str,
) -> None:
    path = write_bag(tmp_path / name, sent, also=also)
    with pytest.raises(InputError, match=message) as error:
        load_recording(path)
    assert str(error.value).startswith(str(path))
    assert "\n" not in str(error.value)


def test_command_reports_unreadable_bags_on_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    path = write_bag(tmp_path / "a.db3", texts())
    monkeypatch.setattr("sys.argv", ["x", "inspect", str(path)])
    with pytest.raises(SystemExit) as end:
        main()
    assert end.value.code == 2
    assert capsys.readouterr().err.count("\n") == 1


def test_folder_without_metadata_is_rejected(tmp_path: Path) -> None:
    path = write_bag(tmp_path / "folder", states())
    (path / "metadata.yaml").unlink()
    with pytest.raises(InputError, match="is a folder, not a recording"):
        load_recording(path)


def test_unsupported_contents_of_mcap_are_rejected(tmp_path: Path) -> None:
    path = write_bag(tmp_path / "a.mcap", states())
    path.write_bytes(path.read_bytes().replace(b"ros2", b"ros1", 1))
    with pytest.raises(InputError, match="messages of the profile 'ros1', of which no joint states"):
        load_recording(path)


def test_without_the_library_a_hint_says_how_to_install_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = write_bag(tmp_path / "a.bag", states())
    monkeypatch.setattr(bags, "find_spec", lambda name: None)
    with pytest.raises(
        InputError, match=r"rosbags is missing; install it with pip install 'missing-physics\[bags\]'"
    ):
        load_recording(path)


@pytest.mark.parametrize("name", KINDS[:3])
def test_bags_beyond_the_size_limit_are_rejected(tmp_path: Path, name: str) -> None:
    path = write_bag(tmp_path / name, states())
    size = 80 * (2 + 3 * 2) * 8
    assert read_raw(path, budget=Budget(5 * size)).variables
    with pytest.raises(InputError, match=r"joint states that take more than .*--size-limit"):
        read_raw(path, budget=Budget(0.9 * size))


def test_chunks_with_an_excessive_unpacked_size_count_as_damaged(tmp_path: Path) -> None:
    """lz4 makes 255 bytes of one: a bag of some megabytes could fill any memory."""
    lz4 = pytest.importorskip("lz4.frame")
    path = write_bag(tmp_path / "a.mcap", states())
    content = path.read_bytes()
    packed = lz4.compress(bytes(1 << 30))
    chunk = (0).to_bytes(8, "little") * 2 + (1 << 30).to_bytes(8, "little") + bytes(4)
    chunk += len(b"lz4").to_bytes(4, "little") + b"lz4" + len(packed).to_bytes(8, "little") + packed
    head = 8 + 9 + int.from_bytes(content[9:17], "little")
    footer = b"\x02\x14" + bytes(7) + bytes(20) + b"\x89MCAP0\r\n"
    path.write_bytes(content[:head] + b"\x06" + len(chunk).to_bytes(8, "little") + chunk + footer)
    with pytest.raises(InputError, match="truncated or damaged"):
        read_raw(path, budget=Budget(1e6))


@pytest.mark.skipif(sys.platform == "win32", reason="no such names there")
@pytest.mark.parametrize("name", ["a?.db3", "a#b.db3", "a%20.db3"])
def test_file_names_with_special_characters_of_sqlite_are_rejected(tmp_path: Path, name: str) -> None:
    path = write_bag(tmp_path / "a.db3", states()).rename(tmp_path / name)
    with pytest.raises(InputError, match=r"has one of \? # % in its path; rename"):
        load_recording(path)
