"""The user's own file with the findings: only numbers differ, and MuJoCo agrees with our engine."""

from __future__ import annotations

import difflib
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from missing_physics.cli import UNUSABLE_INPUT, main
from missing_physics.export import content_of, edited_file
from reference_model.evaluation.model import RobotModel
from robot_model import EffectUse, InputError, Robot, read_robot, save_robot

URDF = """<?xml version="1.0" encoding="utf-8"?>
<!-- Zweigelenkarm: our arm, drawn by hand -->
<robot name="arm">
  <link name="world"/>
  <link name="upper">
    <inertial>  <!-- from CAD -->
      <origin rpy="0 0.3 0"   xyz="0.1 0 0"/>
      <mass value="2.0"/> <inertia ixx="0.02" ixy="0" ixz="0" iyy="0.03" iyz="0" izz="0.025"/>
    </inertial>
    <visual><geometry><mesh filename="package://arm/upper.stl"/></geometry></visual>
  </link>
  <link name='tool'><inertial><mass value='0.5'/><inertia ixx='1e-3' iyy='1e-3' izz='1e-3'/></inertial></link>
  <link name="lower"><inertial><origin xyz="0.15 0 0"/><mass value="1.0"/>
    <inertia ixx="0.004" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial></link>
  <joint name="shoulder" type="revolute"><parent link="world"/><child link="upper"/><axis xyz="0 -1 0"/>
    <limit lower="-3" upper="3" effort="50" velocity="4"/>
    <dynamics friction = "0.0"  damping = "0.1"/></joint>
  <joint name="elbow" type="continuous"><parent link="upper"/><child link="lower"/>
    <origin xyz="0.3 0 0"/><axis xyz="0 -1 0"/></joint>
  <joint name="flange" type="fixed"><parent link="lower"/><child link="tool"/><origin xyz="0.3 0 0"/></joint>
</robot>
"""

MJCF = """<mujoco model="arm">
  <!-- angles in degrees, as by default -->
  <compiler autolimits="true"/>
  <default><joint damping="0.1"/><default class="strong"><joint armature="0.01"/></default></default>
  <worldbody>
    <light pos="0 0 3"/>
    <body name="upper" childclass="strong">
      <inertial pos="0.1 0 0" quat="0.9238795325 0 0.3826834324 0" mass="2" diaginertia="0.02 0.03 0.025"/>
      <joint name="shoulder" axis="0 -1 0" pos="0.02 0 0" range="-170 170"/>
      <geom type="capsule" size="0.02 0.1" mass="0" contype="0" conaffinity="0"/>
      <body name="lower" pos="0.3 0 0">
        <joint name="elbow" axis="0 -1 0"/>
        <inertial pos="0.15 0 0" mass="1" diaginertia="0.004 0.01 0.01"/>
        <body name="tool" pos="0.3 0 0"><inertial pos="0 0 0" mass="0.5" diaginertia="1e-3 1e-3 1e-3"/></body>
      </body>
    </body>
  </worldbody>
  <actuator><motor name="a" joint="shoulder" gear="2"/><motor name="b" joint="elbow"/></actuator>
</mujoco>
"""

FOUND: tuple[tuple[str, str, dict[str, float]], ...] = (
    ("coulomb_friction", "shoulder", {"torque": 0.6}),
    ("viscous_friction", "elbow", {"coefficient": 0.25}),
    ("payload", "lower", {"mass": 0.3, "x": 0.25, "y": 0.02, "z": 0.01}),
    ("inertia", "upper", {"mass": 0.1, "inertia_xx": 2e-3, "inertia_yy": 2e-3, "inertia_zz": 2e-3}),
)


def with_found(path: Path, *found: tuple[str, str, dict[str, float]], kept: bool = False) -> Robot:
    robot, _ = read_robot(path)
    uses = tuple(EffectUse(effect=effect, at=at, **values) for effect, at, values in found)
    return robot.model_copy(update={"effects": (*(robot.effects if kept else ()), *uses)})


@pytest.fixture(params=["arm.urdf", "arm.xml"])
def own(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    path = tmp_path / request.param
    path.write_text(URDF if path.suffix == ".urdf" else MJCF, "utf-8")
    return path


def torques(robot: Robot) -> np.ndarray:
    """Torques required by some motion, friction included, shape (R, n)."""
    chance = np.random.default_rng(2)
    state = chance.uniform(-1.0, 1.0, (3, 20, 2))
    content = content_of(robot)
    plain = robot.model_copy(
        update={
            "effects": (),
            "gravity": tuple(content.gravity),
            "links": tuple(
                link.model_copy(
                    update={
                        "mass": content.bodies[link.name].mass,
                        "center_of_mass": tuple(content.bodies[link.name].centre),
                        "inertia": tuple(
                            content.bodies[link.name].inertia[at]
                            for at in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
                        ),
                    }
                )
                for link in robot.links
            ),
        }
    )
    needed = RobotModel(plain).inverse_dynamics(*state)
    numbers = [content.joints[name] for name in ("shoulder", "elbow")]
    damping, dry = (np.array([getattr(n, key) for n in numbers]) for key in ("damping", "frictionloss"))
    return needed + damping * state[1] + dry * np.sign(state[1])


def test_the_edited_file_reads_as_the_identified_robot(own: Path) -> None:
    robot = with_found(own, *FOUND)
    own.write_bytes(edited_file(content_of(robot), own).text)
    again, _ = read_robot(own)
    np.testing.assert_allclose(torques(again), torques(robot), rtol=1e-9, atol=1e-9)


def test_nothing_but_numbers_differs(own: Path) -> None:
    before = own.read_text("utf-8")
    edited = edited_file(content_of(with_found(own, *FOUND, kept=True)), own)
    after = edited.text.decode("utf-8")
    for kept in re.findall(r"<!--.*?-->|<mesh.*?/>|<geom.*?/>|<light.*?/>|<limit.*?/>", before):
        assert kept in after
    removed = [line[1:] for line in difflib.ndiff(before.splitlines(), after.splitlines()) if line[:1] == "-"]
    assert all(re.search("inertia|mass|dynamics|joint|origin", line) for line in removed)
    assert len(removed) < 10
    assert any("joint 'shoulder'" in words for words in edited.changed)


def test_without_findings_every_byte_is_unchanged(own: Path) -> None:
    edited = edited_file(content_of(with_found(own, kept=True)), own)
    assert edited.text == own.read_bytes()
    assert edited.changed == ()


@pytest.mark.parametrize("own", ["arm.xml"], indirect=True)
def test_mujoco_simulates_edited_and_regenerated_file_alike(own: Path) -> None:
    mujoco = pytest.importorskip("mujoco")
    from missing_physics.export import mjcf_of

    spring = ("cable_spring", "elbow", {"stiffness": 2.0, "torque_at_zero": 0.5})
    robot = with_found(own, *FOUND, spring, ("torque_gain", "shoulder", {"gain_error": 0.1}), kept=True)
    content = content_of(robot)

    def swung(text: str, gear: float) -> np.ndarray:
        model = mujoco.MjModel.from_xml_string(text)
        model.opt.timestep, model.opt.integrator = 1e-3, mujoco.mjtIntegrator.mjINT_IMPLICITFAST
        data = mujoco.MjData(model)
        data.ctrl[0] = 4.0 / gear
        for _ in range(800):
            mujoco.mj_step(model, data)
        return np.array([data.joint(name).qpos[0] for name in ("shoulder", "elbow")])

    expected = swung(mjcf_of(content), 1.0)
    assert np.abs(expected).min() > 0.01
    found = edited_file(content, own).text.decode("utf-8")
    np.testing.assert_allclose(swung(found, 2.0), expected, atol=1e-4)
    assert np.abs(swung(own.read_text("utf-8"), 2.0) - expected).max() > 0.05


@settings(max_examples=30, deadline=None)
@given(
    name=st.text(
        st.characters(exclude_categories=("C", "Z"), exclude_characters="<&\"'"), min_size=1, max_size=8
    ),
    spaces=st.text(" \t\n", min_size=1, max_size=3),
    quote=st.sampled_from("'\""),
    damping=st.floats(0.0, 9.0),
)
def test_any_layout_of_a_tag_is_edited(
    tmp_path_factory: Any, name: str, spaces: str, quote: str, damping: float
) -> None:
    tag = f"<dynamics{spaces}damping={quote}0.1{quote}{spaces}note={quote}a > b {name}{quote}{spaces}/>"
    path = tmp_path_factory.mktemp("layout") / "arm.urdf"
    path.write_text(URDF.replace('<dynamics friction = "0.0"  damping = "0.1"/>', tag), "utf-8", newline="")
    robot = with_found(path, ("viscous_friction", "shoulder", {"coefficient": damping}))
    text = edited_file(content_of(robot), path).text
    path.write_bytes(text)
    read, _ = read_robot(path)
    assert content_of(read).joints["shoulder"].damping == pytest.approx(damping, rel=1e-9)
    assert f"a > b {name}".encode() in text


def test_the_command_writes_a_copy_next_to_the_diagnosis(
    own: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "out").mkdir()
    save_robot(with_found(own, *FOUND), tmp_path / "out" / "robot.augmented.toml")
    before = own.read_bytes()
    monkeypatch.setattr("sys.argv", ["missing-physics", "export", str(tmp_path / "out"), "--into", str(own)])
    with pytest.raises(SystemExit) as left:
        main()
    assert not left.value.code
    assert "nothing changed but" in capsys.readouterr().out
    assert own.read_bytes() == before
    assert (tmp_path / "out" / own.name).read_bytes() != before


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (lambda text: text.replace('"elbow"', '"wrist"'), "has no joint 'elbow' that robot"),
        (
            lambda text: text.replace("<robot ", '<robot xmlns:xacro="x" ').replace(
                "</robot>", '<xacro:property name="a" value="1"/></robot>'
            ),
            "is written in xacro",
        ),
    ],
)
def test_another_file_is_refused(tmp_path: Path, change: Any, sentence: str) -> None:
    path = tmp_path / "arm.urdf"
    path.write_text(URDF, "utf-8")
    content = content_of(with_found(path, *FOUND))
    path.write_text(change(URDF), "utf-8")
    with pytest.raises(InputError, match=sentence):
        edited_file(content, path)


def test_missing_format_and_file_are_reported(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "arm.urdf"
    path.write_text(URDF, "utf-8")
    save_robot(with_found(path), tmp_path / "robot.augmented.toml")
    monkeypatch.setattr("sys.argv", ["missing-physics", "export", str(tmp_path)])
    with pytest.raises(SystemExit) as left:
        main()
    assert left.value.code == UNUSABLE_INPUT
    assert "give --to mjcf, urdf or json, or --into" in capsys.readouterr().err
