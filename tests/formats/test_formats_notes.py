"""Content of a file that a robot cannot hold is noted once; the rest keeps its meaning."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from robot_model import Robot, load_robot, read_robot

MODEL = """<mujoco><compiler angle="radian"/>{head}<worldbody>
  <body name="arm"{body}><joint name="first" {joint}/><geom name="g" size="0.1" pos="0 0 0.2"/>
    <body name="hand" pos="0 0 0.4"><joint name="second" axis="1 0 0"/><geom size="0.1" pos="0 0 0.2"/></body>
  </body></worldbody>{tail}</mujoco>"""


def model(
    folder: Path, *, head: str = "", body: str = "", joint: str = "", tail: str = ""
) -> tuple[Robot, str]:
    """The robot of a two-joint model with something added, and its notes as one text."""
    text = MODEL.format(head=head, body=body and f" {body}", joint=joint, tail=tail)
    (folder / "arm.xml").write_text(text)
    robot, notes = read_robot(folder / "arm.xml")
    assert len(set(notes)) == len(notes)
    return robot, "\n".join(notes)


def test_complete_files_give_no_notes(tmp_path: Path) -> None:
    robot, notes = model(tmp_path)
    assert notes == ""
    assert robot.gravity == (0.0, 0.0, -9.81)
    assert all(joint.actuator is not None for joint in robot.joints)


@pytest.mark.parametrize(
    ("parts", "note"),
    [
        ({"joint": 'armature="0.1"'}, "armature of 'first' becomes rotor_inertia"),
        ({"joint": 'damping="0.1"'}, "damping and frictionloss of 'first' become viscous_friction"),
        ({"joint": 'frictionloss="0.1"'}, "damping and frictionloss of 'first' become viscous_friction"),
        (
            {"joint": 'stiffness="3" springref="0.1"'},
            "stiffness and springref of 'first' become a cable_spring",
        ),
        ({"joint": 'damping="0.1 0.2"'}, "stiffness or damping of joint 'first' is a polynomial"),
        (
            {"joint": 'springdamper="0.1 1"'},
            "springdamper, springyield or actuatorgravcomp of 'first': left out",
        ),
        (
            {"body": 'gravcomp="1"'},
            "gravcomp of body 'arm': the force that compensates its weight is left out",
        ),
        ({"head": '<option viscosity="0.1"/>'}, "the forces of a surrounding fluid are left out"),
        (
            {"tail": '<equality><connect name="loop" body1="arm" body2="hand" anchor="0 0 0"/></equality>'},
            "equality 'loop': the loop that it closes is left open",
        ),
        (
            {"tail": '<equality><joint joint1="second" joint2="first"/></equality>'},
            "follows another one by an equality cannot be described; held where it is at first: 'second'",
        ),
        (
            {"tail": '<tendon><fixed name="t" stiffness="2"/></tendon>'},
            "tendon 't': its spring, damping, friction or armature is left out",
        ),
        (
            {"tail": '<actuator><position name="p" joint="first" kp="20" kv="2"/></actuator>'},
            "position 'p' (kp = 20, kv = 2): the servo's gains are left out",
        ),
        (
            {"tail": '<actuator><motor name="m" joint="first" gear="7"/></actuator>'},
            "gear of motor 'm': torques of this",
        ),
        (
            {"tail": '<actuator><general name="m" joint="first" dyntype="filter"/></actuator>'},
            "general 'm': the dynamics between control and force (dyntype) are left out",
        ),
        (
            {"tail": '<actuator><muscle name="m" joint="first"/></actuator>'},
            "how the actuator makes its force is left",
        ),
        (
            {"tail": '<actuator><motor joint="first"/></actuator>'},
            "joint 'second': no actuator, so nothing drives it",
        ),
        (
            {"tail": '<tendon><fixed name="t"/></tendon><actuator><motor name="m" tendon="t"/></actuator>'},
            "motor 'm': does not act on a single joint and is left out",
        ),
    ],
    ids=lambda value: "" if isinstance(value, dict) else value[:30],
)
def test_notes(tmp_path: Path, parts: dict[str, str], note: str) -> None:
    assert note in model(tmp_path, **parts)[1]


def test_an_inactive_equality_is_ignored(tmp_path: Path) -> None:
    tail = '<equality><joint joint1="second" joint2="first" active="false"/></equality>'
    robot, notes = model(tmp_path, tail=tail)
    assert notes == ""
    assert len(robot.moving_joints) == 2


def test_a_follower_is_held_and_its_mass_is_carried(tmp_path: Path) -> None:
    tail = '<equality><joint joint1="second" polycoef="0.5"/></equality>'
    robot, _ = model(tmp_path, tail=tail)
    assert [joint.name for joint in robot.moving_joints] == ["first"]
    ball = 1000 * 4 / 3 * np.pi * 1e-3
    turned = np.array([0, -np.sin(0.5), np.cos(0.5)]) * 0.2  # the hand's ball, turned by 0.5 rad about x
    assert robot.link("arm").mass == pytest.approx(2 * ball)
    np.testing.assert_allclose(
        robot.link("arm").center_of_mass, (np.array([0, 0, 0.6]) + turned) / 2, atol=1e-12
    )


def test_torque_limits(tmp_path: Path) -> None:
    """The smallest of what bounds the control, the force, and the joint, at the joint."""

    def limit(actuator: str, joint: str = "") -> float | None:
        robot, _ = model(tmp_path, joint=joint, tail=f"<actuator>{actuator}</actuator>")
        return robot.joint("first").actuator.torque_limit

    assert limit('<motor joint="first" ctrlrange="-2 3" gear="-4"/>') == 12.0
    assert limit('<motor joint="first" ctrlrange="-2 3" forcerange="-1 1" gear="4"/>') == 4.0
    assert limit('<motor joint="first" ctrlrange="-2 3" ctrllimited="false"/>') is None
    assert limit('<general joint="first" ctrlrange="-1 1" gainprm="5"/>') == 5.0
    assert limit('<position joint="first" ctrlrange="-1 1" forcerange="-9 9"/>') == 9.0
    assert limit('<motor joint="first" ctrlrange="-20 20"/>', 'actuatorfrcrange="-7 7"') == 7.0
    assert limit('<motor joint="first" ctrlrange="-3 3"/><motor joint="first" ctrlrange="-2 2"/>') == 5.0


def test_limits_of_position(tmp_path: Path) -> None:
    def limits(joint: str, head: str = "") -> tuple[float, float] | None:
        return model(tmp_path, joint=joint, head=head)[0].joint("first").position_limits

    assert limits('range="-1 2"') == (-1.0, 2.0)
    assert limits('range="-1 2" limited="false"') is None
    assert limits('range="-1 2"', '<compiler autolimits="false"/>') is None
    assert limits('range="-1 2" limited="true"', '<compiler autolimits="false"/>') == (-1.0, 2.0)
    degrees = limits('range="-90 180"', '<compiler angle="degree"/>')
    assert degrees == pytest.approx((-np.pi / 2, np.pi))
    assert limits('type="slide" range="-0.1 0.2"', '<compiler angle="degree"/>') == (-0.1, 0.2)


def test_a_passive_joint_keeps_its_armature(tmp_path: Path) -> None:
    robot, notes = model(
        tmp_path, joint='armature="0.2"', tail='<actuator><motor joint="second"/></actuator>'
    )
    assert robot.joint("first").actuator.rotor_inertia == 0.2
    assert "joint 'first': no actuator but armature" in notes


def test_settings_of_included_files_apply_to_the_model(tmp_path: Path) -> None:
    """As in MuJoCo, whichever file contains them."""
    (tmp_path / "more.xml").write_text('<mujocoinclude><option gravity="0 0 -1"/></mujocoinclude>')
    assert model(tmp_path, tail='<include file="more.xml"/>')[0].gravity == (0.0, 0.0, -1.0)
    assert model(tmp_path, head='<option><flag gravity="disable"/></option>')[0].gravity == (0.0, 0.0, 0.0)


def test_flags_disable_joint_forces(tmp_path: Path) -> None:
    joint = 'damping="1" frictionloss="2" stiffness="3"'
    effects = {"damper": "viscous_friction", "frictionloss": "coulomb_friction", "spring": "cable_spring"}
    for flag, effect in effects.items():
        robot, _ = model(tmp_path, joint=joint, head=f'<option><flag {flag}="disable"/></option>')
        assert {use.effect for use in robot.effects} == set(effects.values()) - {effect}


def test_a_floating_robot_has_no_contact_note(files: Path) -> None:
    assert (
        "contacts with the ground and between bodies are left out." in read_robot(files / "quadruped.xml")[1]
    )


def test_extensions_of_other_programs_in_a_urdf(files: Path, tmp_path: Path) -> None:
    added = (
        '<transmission name="t"><joint name="pivot"/><joint name="other"/></transmission>'
        '<gazebo reference="pivot"><springStiffness>3</springStiffness></gazebo>'
        '<link name="x"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1"/></inertial></link>'
        '<joint name="other" type="continuous"><parent link="rod"/><child link="x"/></joint></robot>'
    )
    (tmp_path / "arm.urdf").write_text((files / "pendulum.urdf").read_text().replace("</robot>", added))
    text = "\n".join(read_robot(tmp_path / "arm.urdf")[1])
    assert "transmission 't': couples several joints, which is left out." in text
    assert "springs that Gazebo adds to joints" in text


def test_assumptions_for_a_urdf_are_noted(files: Path) -> None:
    _, notes = read_robot(files / "branched.urdf")
    text = "\n".join(notes)
    assert "<mechanicalReduction> of 'waist' becomes gear_ratio." in text
    assert "damping and friction of 'waist' and 'right_shoulder' become viscous_friction" in text
    assert (
        "that a joint follows another one (<mimic>) cannot be described; held at its offset: 'left_finger'."
        in text
    )
    assert "no gravity is given, so [0.0, 0.0, -9.81] m/s^2 is assumed" in text
    assert "link 'right_shoulder': a joint has the same name" in text
    assert "'left arm/shoulder' is called 'left_arm_shoulder'" in text
    assert (
        "fixed to the ground" not in text
    )  # the root link is a frame without mass, so that nothing is assumed


def test_a_urdf_whose_root_has_mass_is_assumed_to_be_fixed(files: Path, tmp_path: Path) -> None:
    body = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1"/></inertial>'
    text = (files / "pendulum.urdf").read_text().replace('"stand"/>', f'"stand">{body}</link>', 1)
    (tmp_path / "arm.urdf").write_text(text)
    assert any(
        "link 'stand' is assumed to be fixed to the ground" in n for n in read_robot(tmp_path / "arm.urdf")[1]
    )
    (tmp_path / "free.toml").write_text('gravity = [0.0, 0.0, 0.0]\n[base]\nkind = "free"')
    assert not [
        n for n in read_robot(tmp_path / "arm.urdf", overlay=tmp_path / "free.toml")[1] if "no grav" in n
    ]


def test_a_floating_joint_makes_the_base_free(files: Path, tmp_path: Path) -> None:
    joint = '<joint name="f" type="floating"><parent link="world"/><child link="body"/>'
    joint += '<origin xyz="0 0 2"/></joint>'
    body = '<link name="body"><inertial><mass value="3"/><inertia ixx="1" iyy="1" izz="1"/></inertial></link>'
    text = (files / "pendulum.urdf").read_text().replace('<link name="stand"/>', body + joint)
    (tmp_path / "craft.urdf").write_text(text.replace('parent link="stand"', 'parent link="body"'))
    base = read_robot(tmp_path / "craft.urdf")[0].base
    assert (base.kind, base.mass, base.position) == ("free", 3.0, (0.0, 0.0, 2.0))


def test_an_impossible_part_of_a_possible_link_is_accepted(files: Path, tmp_path: Path) -> None:
    part = (
        '<link name="foot"><inertial><mass value="0.1"/><inertia ixx="1e-6" iyy="0" izz="0"/></inertial>'
        "</link>"
        '<joint name="sole" type="fixed"><parent link="rod"/><child link="foot"/></joint></robot>'
    )
    (tmp_path / "leg.urdf").write_text((files / "pendulum.urdf").read_text().replace("</robot>", part))
    robot, notes = read_robot(tmp_path / "leg.urdf")
    assert robot.link("rod").mass == 1.6
    assert any("no body can have the inertia of 'foot' alone" in note for note in notes)


@pytest.mark.filterwarnings("ignore:damping and friction")
def test_load_robot_warns(files: Path) -> None:
    with pytest.warns(UserWarning, match="no gravity is given"):
        load_robot(files / "pendulum.urdf")


def test_names_of_files_are_printed_and_written_safely(files: Path, tmp_path: Path) -> None:
    text = (files / "pendulum.urdf").read_text().replace('"rod"', '"&#x202e;rod&#10;&lt;b&gt;"')
    (tmp_path / "arm.urdf").write_text(text)
    robot, notes = read_robot(tmp_path / "arm.urdf")
    assert [link.name for link in robot.links] == ["_rod__b_"]
    assert all(note.isprintable() for note in notes)


@pytest.mark.parametrize("name", ["3dof", "_hidden", "shoulder_pan_joint", "a-b"])
def test_valid_names_are_kept(files: Path, tmp_path: Path, name: str) -> None:
    (tmp_path / "arm.urdf").write_text((files / "pendulum.urdf").read_text().replace('"pivot"', f'"{name}"'))
    assert read_robot(tmp_path / "arm.urdf")[0].joints[0].name == name


def test_colliding_names_are_made_unique(files: Path, tmp_path: Path) -> None:
    part = '<joint name="x" type="continuous"><parent link="rod"/><child link="r.d"/></joint></robot>'
    part = '<link name="r.d"/>' + part
    inertial = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1"/></inertial></link>'
    text = (files / "pendulum.urdf").read_text().replace('"rod"', '"r d"').replace("</robot>", part)
    text = text.replace('<link name="r.d"/>', f'<link name="r.d">{inertial}').replace(
        'parent link="rod"', 'parent link="r d"'
    )
    (tmp_path / "arm.urdf").write_text(text)
    assert [link.name for link in read_robot(tmp_path / "arm.urdf")[0].links] == ["r_d", "r_d_2"]


@pytest.mark.parametrize("joint", ['damping="0.1"', 'frictionloss="0.1"', 'stiffness="3"'])
def test_effects_that_an_overlay_drops_are_not_reported(tmp_path: Path, joint: str) -> None:
    _, note = model(tmp_path, joint=joint)
    assert "that the robot already has" in note
    (tmp_path / "over.toml").write_text("effects = []\n")
    robot, notes = read_robot(tmp_path / "arm.xml", overlay=tmp_path / "over.toml")
    assert not robot.effects
    assert not [note for note in notes if "already has" in note]


def test_friction_of_a_urdf_that_an_overlay_drops_is_not_reported(tmp_path: Path) -> None:
    (tmp_path / "arm.urdf").write_text(
        """<robot name="arm"><link name="world"/><link name="rod"><inertial><mass value="1"/>
        <inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
        <joint name="pivot" type="continuous"><parent link="world"/><child link="rod"/>
        <dynamics damping="0.1" friction="0.2"/></joint></robot>"""
    )
    assert any("already has" in note for note in read_robot(tmp_path / "arm.urdf")[1])
    (tmp_path / "over.toml").write_text("effects = []\n")
    robot, notes = read_robot(tmp_path / "arm.urdf", overlay=tmp_path / "over.toml")
    assert not robot.effects
    assert not [note for note in notes if "already has" in note]
