"""A robot written as TOML and read again is the same robot, to the last bit."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from robot_strategies import robots

from robot_model import Robot, load_robot, robot_from_toml, robot_to_toml, save_robot, shipped_robots

# A whole robot is a large draw; this is expected.
large_draw = settings(suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large])


@pytest.mark.fuzz
@large_draw
@given(robots())
def test_toml_text_round_trips_exactly(robot: Robot) -> None:
    text = robot_to_toml(robot)
    again = robot_from_toml(text)
    assert again == robot
    assert robot_to_toml(again) == text


@pytest.mark.fuzz
@large_draw
@given(robots())
def test_each_joint_comes_after_the_one_that_carries_it(robot: Robot) -> None:
    reached = {"base"}
    for joint in robot.tree:
        assert joint.parent in reached
        reached.add(joint.child)
    assert sorted(joint.name for joint in robot.tree) == sorted(joint.name for joint in robot.joints)
    assert reached == {"base", *(link.name for link in robot.links)}


@pytest.mark.parametrize("name", shipped_robots())
def test_shipped_robots_load_by_name_and_survive_a_file(name: str, tmp_path: Path) -> None:
    robot = load_robot(name)
    assert robot.name == name
    save_robot(robot, tmp_path / "robot.toml")
    assert load_robot(tmp_path / "robot.toml") == robot
    assert [path.name for path in tmp_path.iterdir()] == ["robot.toml"]


def test_a_file_takes_precedence_over_a_shipped_robot_of_its_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("single_axis").write_text('name = "mine"\nlinks = []\njoints = []\n')
    assert load_robot("single_axis").name == "mine"


def test_a_byte_order_mark_is_accepted(tmp_path: Path) -> None:
    (tmp_path / "r.toml").write_bytes(b'\xef\xbb\xbfname = "mine"\nlinks = []\njoints = []\n')
    assert load_robot(tmp_path / "r.toml").name == "mine"


def test_descriptions_cannot_be_changed() -> None:
    robot = load_robot("two_link_arm")
    with pytest.raises(ValueError, match="frozen"):
        robot.links[0].mass = 1.0  # type: ignore[misc]


def test_looking_up_parts() -> None:
    robot = load_robot("two_link_arm")
    assert robot.joint("joint2").child == "link2"
    assert robot.link("link2").mass == 4.0
    assert robot.sensor("joint1.torque") is not None
    assert robot.sensor("joint1.current") is None
    with pytest.raises(KeyError, match="link9"):
        robot.link("link9")
    with pytest.raises(KeyError, match="joint9"):
        robot.joint("joint9")
