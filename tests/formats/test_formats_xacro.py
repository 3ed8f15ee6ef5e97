"""xacro files expand as with the package that ROS uses, without its unsafe features."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xacro

from robot_model import read_robot
from robot_model.formats.parts.markup import Element, parse_markup
from robot_model.formats.xacro import expanded


def plain(element: Element) -> tuple[Any, ...]:
    return element.tag, dict(element.attributes), [plain(child) for child in element.children]


@pytest.mark.parametrize("payload", ["0.0", "0.7"])
def test_the_expansion_equals_that_of_ros(files: Path, payload: str) -> None:
    arm = files / "xacro_arm" / "urdf" / "arm.urdf.xacro"
    wanted = xacro.process_file(str(arm), mappings={"payload": payload}).toxml(encoding="utf-8")
    assert plain(expanded(arm, {"payload": payload})) == plain(parse_markup(wanted, "arm"))


def test_the_xacro_package_is_restored(files: Path, tmp_path: Path) -> None:
    before = dict(vars(xacro))
    expanded(files / "xacro_arm" / "urdf" / "arm.urdf.xacro", {})
    assert dict(vars(xacro)) == before


def test_values_of_the_expanded_robot(files: Path) -> None:
    robot, _ = read_robot(files / "xacro_arm" / "urdf" / "arm.urdf.xacro")
    assert [joint.name for joint in robot.moving_joints] == ["left_upper_joint", "left_lower_joint"]
    assert robot.joints[0].position_limits == pytest.approx((-2 * np.pi / 3, 2 * np.pi / 3))
    assert robot.joints[0].origin == pytest.approx((0, 0, 0.6))


@pytest.mark.parametrize("place", ["own", "beside", "ROS_PACKAGE_PATH", "AMENT_PREFIX_PATH"])
def test_packages_are_found(files: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, place: str) -> None:
    macros = files / "xacro_arm" / "urdf" / "inc" / "macros.xacro"
    robot = tmp_path / "work" / "robot"
    folder = {
        "own": robot,
        "beside": robot.parent / "rods",
        "ROS_PACKAGE_PATH": tmp_path / "ros" / "rods",
        "AMENT_PREFIX_PATH": tmp_path / "ros" / "share" / "rods",
    }[place]
    for made in (robot, folder):
        made.mkdir(parents=True, exist_ok=True)
        (made / "package.xml").write_text("<package/>")
    if place.isupper():
        monkeypatch.setenv(place, str(tmp_path / "ros"))
    (folder / "macros.xacro").write_text(macros.read_text())
    package = "robot" if place == "own" else "rods"
    (robot / "arm.xacro").write_text(
        f'<robot xmlns:xacro="http://x"><xacro:include filename="$(find {package})/macros.xacro"/>'
        '<link name="rod"><xacro:rod_inertia mass="2" length="0.5"/></link></robot>'
    )
    root = expanded(robot / "arm.xacro", {})
    assert next(root.all("link")).needed("inertial").needed("mass").number("value") == 2.0
