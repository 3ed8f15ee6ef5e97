"""An overlay adds values that a file cannot hold; it changes only what it names."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from robot_model import InputError, Robot, load_robot, read_robot, save_robot
from robot_model.formats.page import other_formats


def overlaid(robot: Path | str, folder: Path, text: str) -> Robot:
    (folder / "change.toml").write_text(text)
    return read_robot(robot, overlay=folder / "change.toml")[0]


def test_values_are_merged_into_the_tables_of_the_file(files: Path, tmp_path: Path) -> None:
    plain = read_robot(files / "pendulum.urdf")[0]
    found = overlaid(
        files / "pendulum.urdf",
        tmp_path,
        """
        gravity = [0.0, 0.0, -1.62]
        [[joints]]
        name = "pivot"
        initial_position = 0.3
        actuator = { gear_ratio = 50.0, rotor_inertia = 1e-4, torque_constant = 0.1 }
        bearing = { radial_arm = 0.02 }
        [[links]]
        name = "rod"
        mass = 2.0
        """,
    )
    joint, link = found.joint("pivot"), found.link("rod")
    assert found.gravity == (0.0, 0.0, -1.62)
    assert joint.initial_position == 0.3
    assert joint.actuator.model_dump(exclude_none=True, exclude_defaults=True) == {
        "gear_ratio": 50.0,
        "rotor_inertia": 1e-4,
        "torque_constant": 0.1,
        "torque_limit": 10.0,  # the file's effort limit stays
    }
    assert joint.bearing.radial_arm == 0.02
    assert (link.mass, link.inertia) == (2.0, plain.link("rod").inertia)
    assert found.effects == plain.effects


def test_effects_are_replaced_added_and_removed(files: Path, tmp_path: Path) -> None:
    plain = read_robot(files / "pendulum.urdf")[0]
    assert [(use.effect, use.parameters) for use in plain.effects] == [
        ("viscous_friction", {"coefficient": 0.1}),
        ("coulomb_friction", {"torque": 0.2}),
    ]
    text = """[[effects]]
    effect = "viscous_friction"
    at = "pivot"
    coefficient = 0.7
    [[effects]]
    effect = "torque_offset"
    at = "pivot"
    torque = 0.1"""
    found = overlaid(files / "pendulum.urdf", tmp_path, text)
    assert [use.effect for use in found.effects] == ["coulomb_friction", "viscous_friction", "torque_offset"]
    assert found.effects[1].parameters == {"coefficient": 0.7}
    assert overlaid(files / "pendulum.urdf", tmp_path, "effects = []").effects == ()


def test_armature_is_converted_by_the_gear_of_an_overlay(files: Path, tmp_path: Path) -> None:
    """0.01 kg m^2 at the joint are 1e-4 kg m^2 behind a gear of 10."""
    text = '[[joints]]\nname = "swing"\nactuator = { gear_ratio = 10.0 }'
    actuator = overlaid(files / "gimbal.xml", tmp_path, text).joint("swing").actuator
    assert actuator.rotor_inertia == pytest.approx(1e-4)
    text = text.replace("10.0", "10.0, rotor_inertia = 5e-5")
    assert overlaid(files / "gimbal.xml", tmp_path, text).joint("swing").actuator.rotor_inertia == 5e-5


def test_a_joint_is_held(files: Path, tmp_path: Path) -> None:
    """The rod of the left arm slides along (0, 0.5, -1): held at 0.1 it is 0.1 m out along the unit axis."""
    text = '[[joints]]\nname = "left_slide"\nkind = "fixed"\ninitial_position = 0.1'
    found = overlaid(files / "branched.urdf", tmp_path, text)
    assert "left_slide" not in [joint.name for joint in found.joints]
    plain = read_robot(files / "branched.urdf")[0]
    whole = sum(plain.link(name).mass for name in ("left_arm", "left_rod"))
    assert found.link("left_arm").mass == pytest.approx(whole)


def test_a_joint_is_passive(files: Path, tmp_path: Path) -> None:
    found = overlaid(files / "pendulum.urdf", tmp_path, '[[joints]]\nname = "pivot"\npassive = true')
    assert found.joint("pivot").actuator is None


def test_joints_of_a_toml_robot_are_passive_or_fixed(tmp_path: Path) -> None:
    passive = overlaid("two_link_arm", tmp_path, '[[joints]]\nname = "joint2"\npassive = true')
    assert [joint.actuator is None for joint in passive.joints] == [False, True]
    save_robot(passive, tmp_path / "arm.toml")
    driven = overlaid(tmp_path / "arm.toml", tmp_path, '[[joints]]\nname = "joint2"\npassive = false')
    assert driven.joint("joint2").actuator is not None
    with pytest.raises(
        InputError, match=r"joints\[joint2\]\.initial_position: a fixed joint of a TOML robot is"
    ):
        overlaid(
            "two_link_arm", tmp_path, '[[joints]]\nname = "joint2"\nkind = "fixed"\ninitial_position = 0.1'
        )


def test_the_base_is_freed_with_the_mass_of_its_link_and_fixed_again(files: Path, tmp_path: Path) -> None:
    free = overlaid(files / "branched.urdf", tmp_path, '[base]\nkind = "free"')
    assert (free.base.kind, free.base.mass) == ("free", 12.0)
    fixed = overlaid(files / "quadruped.xml", tmp_path, '[base]\nkind = "fixed"')
    assert (fixed.base.kind, fixed.base.mass) == ("fixed", 0.0)
    assert fixed.base.position == (0.0, 0.0, 0.5)


def test_missing_and_impossible_masses_are_given(files: Path, tmp_path: Path) -> None:
    text = (files / "pendulum.urdf").read_text()
    (tmp_path / "bad.urdf").write_text(text.replace('izz="0.001"', 'izz="0.05"'))
    inertia = '[[links]]\nname = "rod"\ninertia = [0.025, 0.025, 0.05]'
    assert overlaid(tmp_path / "bad.urdf", tmp_path, inertia).link("rod").inertia == (0.025, 0.025, 0.05)
    (tmp_path / "bare.urdf").write_text(re.sub("<inertial>.*</inertial>", "", text, flags=re.DOTALL))
    masses = '[[links]]\nname = "rod"\nmass = 2.0\ncenter_of_mass = [0.0, 0.0, -0.1]'
    assert overlaid(tmp_path / "bare.urdf", tmp_path, masses).link("rod").mass == 2.0


def test_the_overlay_next_to_a_file_is_used_and_reported(files: Path, tmp_path: Path) -> None:
    (tmp_path / "arm.urdf").write_text((files / "pendulum.urdf").read_text())
    (tmp_path / "arm.overlay.toml").write_text("gravity = [0.0, 0.0, 0.0]")
    robot, notes = read_robot(tmp_path / "arm.urdf")
    assert robot.gravity == (0.0, 0.0, 0.0)
    assert notes[0] == "arm.overlay.toml beside it is put over it."
    (tmp_path / "other.toml").write_text("gravity = [0.0, 0.0, -5.0]")
    robot, notes = read_robot(tmp_path / "arm.urdf", overlay=tmp_path / "other.toml")
    assert robot.gravity == (0.0, 0.0, -5.0)
    assert not any("beside" in note for note in notes)


@pytest.mark.parametrize("name", ["arm.v1.2.urdf", "arm.v1.2.urdf.xacro", "arm.v1.2"])
def test_the_overlay_next_to_a_file_is_named_without_suffixes(files: Path, tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_text((files / "pendulum.urdf").read_text().replace(' name="pendulum"', ""))
    (tmp_path / "arm.v1.2.overlay.toml").write_text("gravity = [0.0, 0.0, 0.0]")
    robot, _ = read_robot(tmp_path / name)
    assert (robot.name, robot.gravity) == ("arm_v1_2", (0.0, 0.0, 0.0))


def test_toml_and_shipped_robots_accept_an_overlay(tmp_path: Path) -> None:
    shipped = load_robot("single_axis")
    save_robot(shipped, tmp_path / "axis.toml")
    text = '[[links]]\nname = "carriage"\nmass = 50.0'
    for robot in ("single_axis", tmp_path / "axis.toml"):
        found = overlaid(robot, tmp_path, text)
        assert found.link("carriage").mass == 50.0
        assert found.effects == shipped.effects


def test_xacro_arguments(files: Path, tmp_path: Path) -> None:
    arm = files / "xacro_arm" / "urdf" / "arm.urdf.xacro"
    bare, loaded = read_robot(arm)[0], overlaid(arm, tmp_path, "[xacro]\npayload = 0.7")
    assert loaded.link("left_lower").mass == pytest.approx(bare.link("left_lower").mass + 0.7)


def test_the_overlay_of_the_page_is_valid(tmp_path: Path) -> None:
    """Put over an arm with the joints and links that it names."""
    links = ["base_link", "a", "wrist_link", "b", "c"]
    joints = ["shoulder_pan_joint", "finger_joint", "wheel_joint"]
    body = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1"/></inertial>'
    text = "".join(f'<link name="{name}">{body}</link>' for name in links)
    for name, parent, child in (("j", "base_link", "a"), *zip(joints, links[1:], links[2:])):
        text += (
            f'<joint name="{name}" type="continuous"><parent link="{parent}"/><child link="{child}"/></joint>'
        )
    (tmp_path / "arm.urdf").write_text(f'<robot name="arm">{text}</robot>')
    example, _ = re.findall("```toml\n(.*?)```", other_formats(), flags=re.DOTALL)
    found = overlaid(tmp_path / "arm.urdf", tmp_path, example)
    assert found.joint("shoulder_pan_joint").actuator.gear_ratio == 101.0
    assert [joint.name for joint in found.joints] == ["j", "shoulder_pan_joint", "wheel_joint"]


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("gravity = ", "change.toml is not valid TOML: Invalid value"),
        (
            "[joints]\nname = 'pivot'",
            "change.toml: joints: must be a list of tables; write its name in double",
        ),
        (
            "[[joints]]\nmass = 1.0",
            "change.toml: joints: an entry has no name; an overlay says by name what it is",
        ),
        ("[[joints]]\nname = 'pivt'", "change.toml: joints: 'pivt' is no joint of "),
        ("[[joints]]\nname = 'pivt'", "pendulum.urdf; did you mean 'pivot'?"),
        ("[[links]]\nname = 'rood'", "pendulum.urdf; did you mean 'rod'?"),
        (
            "[[links]]\nname = 'stand'\nmass = 1.0",
            "links: 'stand' is the robot's base; write [base] instead.",
        ),
        (
            "[[joints]]\nname = 'pivot'\n[[joints]]\nname = 'pivot'",
            "joints: 'pivot' is named twice; keep one.",
        ),
        (
            "[[joints]]\nname = 'pivot'\nactuator = { gear = 5.0 }",
            "unknown key 'joints[pivot].actuator.gear'; did you",
        ),
        ("[[joints]]\nname = 'pivot'\npassive = 'yes'", "joints[pivot].passive: must be true or false."),
        (
            "[[joints]]\nname = 'pivot'\nkind = 'fixed'\nbearing = {}",
            "joints[pivot].bearing: does not apply to a fixed joint; remove it.",
        ),
        (
            "[[joints]]\nname = 'pivot'\nkind = 'fixed'\ninitial_position = 'x'",
            "initial_position: must be a number.",
        ),
        ("gravity = [0.0, 1.0]", "gravity: has 2 entries but needs 3"),
        ("weight = 1.0", "unknown key 'weight'"),
        ("[xacro]\na = 1", "has no macros, so that it takes no arguments."),
        ("xacro = 1", "xacro: must be a table of keys; write its name in brackets, [xacro]."),
        ("base = 1", "base: must be a table of keys"),
    ],
)
def test_mistakes(files: Path, tmp_path: Path, text: str, sentence: str) -> None:
    with pytest.raises(InputError) as caught:
        overlaid(files / "pendulum.urdf", tmp_path, text)
    assert sentence in str(caught.value)
    assert "change.toml" in str(caught.value)


def test_a_link_merged_into_another_is_reported(files: Path, tmp_path: Path) -> None:
    with pytest.raises(
        InputError, match=r"'camera' is fixed to another link of .* and is part of it; the moving"
    ):
        overlaid(files / "branched.urdf", tmp_path, '[[links]]\nname = "camera"\nmass = 1.0')
    with pytest.raises(InputError, match=r"joints: 'bolt' does not move in .*; remove it\."):
        overlaid(files / "branched.urdf", tmp_path, '[[joints]]\nname = "bolt"\naxis = [0.0, 0.0, 1.0]')


def test_a_missing_overlay_is_reported(files: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"none\.toml is no file; --overlay takes the name of a TOML file\."):
        read_robot(files / "pendulum.urdf", overlay=tmp_path / "none.toml")


def test_motors_of_a_transmission_replace_the_joints_actuators(tmp_path: Path) -> None:
    found = overlaid(
        "two_link_arm",
        tmp_path,
        """
        [[transmissions]]
        name = "belt"
        joints = ["joint2"]
        matrix = [[-2.0]]
        motors = [{ name = "motor2", gear_ratio = 40.0, rotor_inertia = 2e-5 }]
        """,
    )
    assert found.joint("joint1").actuator is not None
    assert found.joint("joint2").actuator is None
    assert [drive.name for drive in found.drives] == ["joint1", "motor2"]
    text = '[[joints]]\nname = "joint2"\nactuator = {}\n' + (tmp_path / "change.toml").read_text()
    with pytest.raises(InputError, match=r"'joint2' has an actuator of its own"):
        overlaid("two_link_arm", tmp_path, text)
    with pytest.raises(InputError, match=r"transmissions: must be a list of tables"):
        overlaid("two_link_arm", tmp_path, "transmissions = 3")
    with pytest.raises(InputError, match=r"change.toml: transmissions\[belt\]\.joints"):
        overlaid(
            "two_link_arm", tmp_path, '[[transmissions]]\nname = "belt"\njoints = 3\nmatrix = 1\nmotors = 2'
        )
