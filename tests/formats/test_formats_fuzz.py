"""Any content of a robot file of another format gives a robot, or a one-sentence actionable error."""

from __future__ import annotations

import random
import re
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot_model import InputError, read_robot, robot_from_toml, robot_to_toml

FOLDER = Path(__file__).parent / "files"
COUPLED = """<transmission name="t"><type>transmission_interface/DifferentialTransmission</type>
<actuator name="one"><role>actuator1</role><mechanicalReduction>20</mechanicalReduction></actuator>
<actuator name="two"><role>actuator2</role><mechanicalReduction>20</mechanicalReduction></actuator>
<joint name="waist"><role>joint1</role><offset>0</offset></joint>
<joint name="right_shoulder"><role>joint2</role>
<mechanicalReduction>2</mechanicalReduction></joint></transmission>"""
VALID = {
    "robot.urdf": (FOLDER / "branched.urdf").read_text(),
    "robot.xml": (FOLDER / "quadruped.xml").read_text(),
    "gimbal.xml": (FOLDER / "gimbal.xml").read_text(),
    "wrist.xml": (FOLDER / "coupled_wrist.xml").read_text(),
    "coupled.urdf": (FOLDER / "branched.urdf").read_text().replace("</robot>", f"{COUPLED}</robot>"),
    "robot.urdf.xacro": (FOLDER / "xacro_arm" / "urdf" / "inc" / "macros.xacro")
    .read_text()
    .replace(
        "</robot>",
        '<xacro:property name="f" value="${xacro.dotify(dict(mass=1, length=2, limit=1))}"/>'
        '<link name="base"/><xacro:segment name="a" parent="base" figures="${f}">'
        '<origin xyz="0 0 1"/><more/></xacro:segment></robot>',
    ),
}
OVERLAY = """gravity = [0.0, 0.0, -1.6]
base.rpy = [0.1, 0.2, 0.3]
[[joints]]
name = "waist"
actuator = { gear_ratio = 30.0, rotor_inertia = 1e-4 }
[[joints]]
name = "left_slide"
kind = "fixed"
initial_position = 0.1
[[links]]
name = "torso"
mass = 7.0
[[sensors]]
channel = "waist.position"
noise = 1e-4
[[effects]]
effect = "viscous_friction"
at = "waist"
coefficient = 0.3
"""

pytestmark = pytest.mark.fuzz

#: Content of damaged files: excessively large numbers, meaningful names, expressions.
pieces = st.sampled_from(
    [
        "",
        "0",
        "-1",
        "nan",
        "1e999",
        "1 2",
        "x",
        "${1/0}",
        "${a",
        "$(arg",
        "world",
        "base",
        "free",
        "fixed",
        "\x00",
        "<body>",
        "</link>",
        "<!--",
        "&amp;",
        "&x;",
        "<?x",
        "é",
        "\u202e",
        "true",
        "mesh",
        "1" * 400,
        "mimic",
    ]
) | st.text(max_size=6)


def robot_or_sentence(path: Path, **options: Path) -> None:
    """Read the file; the result must be complete, and a refusal a sentence that names the file."""
    try:
        robot, notes = read_robot(path, **options)
    except InputError as error:
        message = str(error)
        assert message.isprintable()
        assert message.startswith(str(path.parent))  # of the file, of one that it includes, or of the overlay
        assert message.endswith((".", "?", "!"))
        assert not message.endswith(("..", "?."))
    else:
        assert robot_from_toml(robot_to_toml(robot)) == robot
        assert all(note.isprintable() and note.endswith(".") for note in notes)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("fuzz")
    (made / "gimbal_arm.xml").write_text((FOLDER / "gimbal_arm.xml").read_text())
    return made


@pytest.mark.parametrize("name", VALID)
def test_the_files_are_valid_before_damage(folder: Path, name: str) -> None:
    (folder / name).write_text(VALID[name])
    assert read_robot(folder / name)[0].moving_joints


@given(st.binary(max_size=200))
def test_random_bytes(folder: Path, content: bytes) -> None:
    (folder / "bytes.urdf").write_bytes(content)
    with pytest.raises(InputError, match=r"bytes\.urdf"):
        read_robot(folder / "bytes.urdf")


@pytest.mark.parametrize("name", VALID)
@given(st.data())
def test_characters_changed(folder: Path, name: str, data: st.DataObject) -> None:
    text = VALID[name]
    for _ in range(data.draw(st.integers(1, 3))):
        start = data.draw(st.integers(0, len(text)))
        text = text[:start] + data.draw(pieces) + text[start + data.draw(st.integers(0, 8)) :]
    (folder / name).write_text(text, errors="replace")
    robot_or_sentence(folder / name)


@pytest.mark.parametrize("name", VALID)
@given(st.data())
def test_an_attribute_changed_renamed_or_removed(folder: Path, name: str, data: st.DataObject) -> None:
    text = VALID[name]
    found = data.draw(st.sampled_from(list(re.finditer(r'([\w:]+)="([^"]*)"', text))))
    key = data.draw(st.sampled_from([found[1], found[1], "name", "type", "pos", "xyz", "class", "mesh"]))
    value = data.draw(pieces.map(lambda piece: piece.replace('"', "'").replace("<", "")))
    new = data.draw(st.sampled_from(["", f'{key}="{value}"', f'{key}="{found[2]}"']))
    (folder / name).write_text(text[: found.start()] + new + text[found.end() :], errors="replace")
    robot_or_sentence(folder / name)


@pytest.mark.parametrize("name", VALID)
@given(st.randoms(use_true_random=False))
def test_a_line_removed_repeated_or_moved(folder: Path, name: str, chance: random.Random) -> None:
    lines = VALID[name].splitlines(keepends=True)
    line = lines.pop(chance.randrange(len(lines)))
    for _ in range(chance.randrange(3)):
        lines.insert(chance.randrange(len(lines)), line)
    (folder / name).write_text("".join(lines))
    robot_or_sentence(folder / name)


@given(st.data())
def test_an_overlay_changed(folder: Path, data: st.DataObject) -> None:
    start = data.draw(st.integers(0, len(OVERLAY)))
    new = data.draw(
        pieces | st.sampled_from(["[]", "{}", '"x"', "[[1]]", "true", "\n[links]\n", "\nxacro = 3\n"])
    )
    text = OVERLAY[:start] + new + OVERLAY[start + data.draw(st.integers(0, 12)) :]
    (folder / "branched.urdf").write_text(VALID["robot.urdf"])
    (folder / "change.toml").write_text(text, errors="replace")
    robot_or_sentence(folder / "branched.urdf", overlay=folder / "change.toml")
