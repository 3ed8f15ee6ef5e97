"""Figures of an MJCF file by closed forms: shapes, classes, frames, springs, bounds."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from robot_model import InputError, Robot, read_robot

PI = np.pi


def robot_of(folder: Path, body: str, *, head: str = "", tail: str = "") -> Robot:
    """The robot whose one body holds `body`."""
    text = f'<mujoco>{head}<worldbody><body name="part">{body}</body></worldbody>{tail}</mujoco>'
    (folder / "part.xml").write_text(text)
    return read_robot(folder / "part.xml")[0]


def part(folder: Path, body: str, *, head: str = "") -> tuple[float, np.ndarray, np.ndarray]:
    """Mass, centre of mass and principal moments in the axes of the body."""
    link = robot_of(folder, f'<joint name="j"/>{body}', head=head).link("part")
    return link.mass, np.array(link.center_of_mass), np.array(link.inertia)


@pytest.mark.parametrize(
    ("shape", "volume", "moments"),
    [
        # moments per mass by the textbook, for full lengths
        ('type="sphere" size="0.5"', 4 / 3 * PI * 0.125, (0.1, 0.1, 0.1)),
        ('type="ellipsoid" size="1 2 3"', 8 * PI, (13 / 5, 10 / 5, 5 / 5)),
        ('type="box" size="1 2 3"', 48, ((16 + 36) / 12, (4 + 36) / 12, (4 + 16) / 12)),
        ('type="cylinder" size="2 1.5"', 12 * PI, ((12 + 9) / 12, (12 + 9) / 12, 2)),
    ],
)
def test_shapes(tmp_path: Path, shape: str, volume: float, moments: tuple[float, ...]) -> None:
    mass, _, inertia = part(tmp_path, f'<geom {shape} density="3"/>')
    assert mass == pytest.approx(3 * volume)
    np.testing.assert_allclose(inertia[:3], 3 * volume * np.array(moments), rtol=1e-14)
    mass, _, inertia = part(tmp_path, f'<geom {shape} mass="5"/>')
    assert mass == 5.0
    np.testing.assert_allclose(inertia[:3], 5 * np.array(moments), rtol=1e-14)


def test_a_capsule_is_a_cylinder_with_two_half_spheres(tmp_path: Path) -> None:
    """Without length it is a sphere; a long one is a rod of mass per length, m L^2 / 12."""
    *_, sphere = part(tmp_path, '<geom type="capsule" size="0.5 1e-9" mass="10"/>')
    np.testing.assert_allclose(sphere[:3], 1.0, rtol=1e-8)
    *_, rod = part(tmp_path, '<geom type="capsule" size="1e-5 6" mass="1"/>')
    np.testing.assert_allclose(rod[:3], [12, 12, 0], atol=1e-4)


def test_geoms_without_mass(tmp_path: Path) -> None:
    others = '<geom type="mesh" mesh="m" mass="0"/><geom type="mesh" mesh="m" density="0"/>'
    others += '<geom size="1" group="3"/>'
    mass, centre, _ = part(
        tmp_path,
        f'<geom size="0.1" mass="2" pos="1 2 3"/><geom type="plane" size="1 1 1"/>{others}',
        head='<compiler inertiagrouprange="0 2"/>',
    )
    assert mass == 2.0
    np.testing.assert_array_equal(centre, [1, 2, 3])


@pytest.mark.parametrize(
    ("direction", "moments"),
    [("0 0 -1", (2, 2, 1)), ("0 0 2", (2, 2, 1)), ("1 0 0", (1, 2, 2)), ("0 -3 0", (2, 1, 2))],
)
def test_directions(tmp_path: Path, direction: str, moments: tuple[float, ...]) -> None:
    """A body that is alike across its z axis, laid along a direction."""
    inertial = f'<inertial pos="0 0 0" mass="1" diaginertia="2 2 1" zaxis="{direction}"/>'
    np.testing.assert_allclose(part(tmp_path, inertial)[2][:3], moments, atol=1e-15)


def test_a_body_whose_z_axis_points_down(tmp_path: Path) -> None:
    _, centre, _ = part(tmp_path, '<body zaxis="0 0 -2"><geom size="0.1" pos="0.3 0 0.5"/></body>')
    np.testing.assert_allclose(centre, [0.3, 0, -0.5], atol=1e-15)  # the smallest turn, by MuJoCo about x


def test_an_element_overrides_its_class_and_the_class_that_of_the_body(tmp_path: Path) -> None:
    head = """<default><geom density="100"/>
      <default class="a"><geom density="200" quat="0 1 0 0" size="1 2 3" type="box"/>
        <default class="b"><geom density="300"/></default>
      </default></default>"""

    def mass(attributes: str, childclass: str = "") -> float:
        body = f'<body name="x"{childclass}><joint name="k"/><geom {attributes}/></body>'
        return robot_of(tmp_path, f'<joint name="j"/><geom size="1"/>{body}', head=head).link("x").mass

    assert mass('type="box" size=".5 .5 .5"') == pytest.approx(100)
    assert mass('class="a"') == pytest.approx(200 * 48)
    assert mass('class="b"') == pytest.approx(300 * 48)
    assert mass("", ' childclass="b"') == pytest.approx(300 * 48)
    assert mass('class="a"', ' childclass="b"') == pytest.approx(200 * 48)
    assert mass('class="b" density="7"') == pytest.approx(7 * 48)
    assert mass('class="b" euler="0 0 90"') == pytest.approx(300 * 48)  # instead of the class's quaternion


def test_a_joint_in_a_frame_is_moved_and_rotated_with_it(tmp_path: Path) -> None:
    """The frame is turned by 90 deg about z: its x axis is the body's y axis."""
    joint = '<frame pos="1 2 3" euler="0 0 90"><joint name="j" axis="1 0 0" pos="0.5 0 0"/></frame>'
    found = robot_of(tmp_path, f'{joint}<geom size="1"/>').joint("j")
    np.testing.assert_allclose(found.axis, [0, 1, 0], atol=1e-15)
    np.testing.assert_allclose(found.origin, [1, 2.5, 3], atol=1e-15)


def test_a_spring_is_slack_at_its_reference(tmp_path: Path) -> None:
    """T = -k (q - q_0) is k q_0 at q = 0, angles in degrees in the file."""
    joint = '<joint name="j" stiffness="4" springref="45"/><geom size="1"/>'
    (use,) = robot_of(tmp_path, joint).effects
    assert use.effect == "cable_spring"
    assert use.parameters == pytest.approx({"stiffness": 4, "torque_at_zero": PI})


def test_an_actuator_brings_rotor_inertia_and_damping_through_its_gear(tmp_path: Path) -> None:
    tail = '<actuator><motor joint="j" gear="3" armature="0.1" damping="0.2"/></actuator>'
    found = robot_of(tmp_path, '<joint name="j" armature="0.05"/><geom size="1"/>', tail=tail)
    assert found.joint("j").actuator.rotor_inertia == pytest.approx(0.05 + 9 * 0.1)
    assert found.effects[0].parameters["coefficient"] == pytest.approx(9 * 0.2)


def test_lower_bounds_and_the_sum_of_masses(tmp_path: Path) -> None:
    inertial = '<inertial pos="0 0 0" mass="1" diaginertia="0.5 0.4 0.2"/>'
    mass, _, inertia = part(tmp_path, inertial, head='<compiler boundmass="2" boundinertia="0.3"/>')
    assert mass == 2.0
    np.testing.assert_allclose(inertia[:3], [0.5, 0.4, 0.3])
    mass, _, inertia = part(tmp_path, inertial, head='<compiler settotalmass="3"/>')
    assert mass == pytest.approx(3.0)
    np.testing.assert_allclose(inertia[:3], [1.5, 1.2, 0.6])


def test_a_mesh_with_mass_is_not_just_a_frame(tmp_path: Path) -> None:
    """A body of unknown mass makes the total mass unknown, whatever is fixed to it."""
    fixed = '<body name="tool"><geom type="mesh" mesh="m"/></body>'
    with pytest.raises(
        InputError, match=r"body 'tool' takes its mass from a mesh .*\[\[links\]\] name = \"part\""
    ):
        robot_of(tmp_path, f'<joint name="j"/><geom size="1"/>{fixed}')


def test_actuator_damping_agrees_with_mujoco(tmp_path: Path) -> None:
    mujoco = pytest.importorskip("mujoco")
    tail = '<actuator><motor joint="j" gear="3" damping="0.2"/></actuator>'
    robot_of(tmp_path, '<joint name="j"/><geom size="1"/>', tail=tail)
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "part.xml"))
    data = mujoco.MjData(model)
    data.qvel[0] = 2.0
    mujoco.mj_forward(model, data)
    total = data.qfrc_passive[0] + data.qfrc_actuator[0]
    assert total == pytest.approx(-9 * 0.2 * 2.0)


def test_tendons_with_one_actuator_each_are_a_transmission(files: Path) -> None:
    """A tendon's rest length is that of the start; a tendon without an actuator stays out of it."""
    robot, notes = read_robot(files / "coupled_wrist.xml")
    (one,) = robot.transmissions
    assert one.joints == ("bend", "roll")
    np.testing.assert_allclose(one.motors_from_joints, [[1.0, 0.0], [0.5, -1.0]])
    assert [(m.name, m.rotor_inertia, m.torque_limit) for m in one.motors] == [
        ("motor5", pytest.approx(0.3 + 10**2 * 0.001), 20.0),
        ("t6", 0.0, None),
    ]
    effects = {(use.effect, use.at): use.parameters for use in robot.effects}
    assert effects["cable_spring", "motor5"] == pytest.approx({"stiffness": 2.0, "torque_at_zero": 2.0 * 0.1})
    assert effects["viscous_friction", "t6"] == {"coefficient": 0.2}
    assert effects["coulomb_friction", "t6"] == {"torque": 0.1}
    assert robot.joint("grip").actuator is not None
    assert any("become motors of a transmission, behind their gears: 't5' and 't6'" in note for note in notes)


def test_tendons_that_do_not_match_their_joints_are_ignored(files: Path, tmp_path: Path) -> None:
    text = (files / "coupled_wrist.xml").read_text().replace('<motor tendon="t6"/>', "")
    (tmp_path / "wrist.xml").write_text(text)
    robot, notes = read_robot(tmp_path / "wrist.xml")
    assert [motor.name for motor in robot.motors] == ["motor5"]  # which is alone on its joint then
    assert any("'t6'" in note and "left out" in note for note in notes)
    (tmp_path / "wrist.xml").write_text(text.replace('joint="bend" coef="1"', 'joint="grip" coef="1"'))
    robot, notes = read_robot(tmp_path / "wrist.xml")
    assert not robot.transmissions  # the grip has an actuator of its own
    assert any("motor5" in note and "does not act on a single joint" in note for note in notes)
