"""Each mistake in a URDF, xacro or MJCF file is reported in one sentence with file, line and element."""

from __future__ import annotations

from pathlib import Path

import pytest

from robot_model import InputError, read_robot

ROD = '<link name="rod">'
INERTIA = '<inertia ixx="0.02" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.001"/>'
BOMB = '<!DOCTYPE robot [<!ENTITY a "ha"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;">]>'
TO_X = '<parent link="rod"/><child link="x"/></joint>'
OUTSIDE = '<!DOCTYPE robot [<!ENTITY a SYSTEM "/etc/passwd">]>'

#: Text of pendulum.urdf, what is written instead, and how the sentence goes on after the file's name.
URDF = {
    "broken XML": ("</robot>", "", ", line 18: is not valid XML: no element found."),
    "tags that cross": ("</link>", "</joint>", ", line 9: is not valid XML: mismatched tag."),
    "not XML": ("<robot", "solid robot", ", line 1: is not valid XML: syntax error."),
    "entity bomb": (
        "<robot",
        f"{BOMB}<robot",
        " declares entities or refers to another file, which is refused",
    ),
    "external entity": ("<robot", f"{OUTSIDE}<robot", " declares entities or refers to another file"),
    "another root": ("<robot", "<sdf", ", line 17: is not valid XML"),
    "no links": (
        '<link name="stand"/>',
        "",
        ": joint 'pivot' has the parent 'stand', which is no link of the",
    ),
    "link without a name": (ROD, "<link>", ", line 3: <link> has no name=."),
    "two links of a name": (
        ROD,
        '<link name="stand">',
        ", line 3: link 'stand' has a name that is used in line 2",
    ),
    "unknown parent": (
        'parent link="stand"',
        'parent link="stant"',
        "'stant', which is no link of the file; did you",
    ),
    "unknown joint type": (
        '"revolute"',
        '"revolut"',
        "has the unknown type=\"revolut\"; did you mean 'revolute'?",
    ),
    "planar joint": (
        '"revolute"',
        '"planar"',
        'has type="planar", which cannot be described; make it two prismatic',
    ),
    "ball joint": (
        '"revolute"',
        '"ball"',
        'has type="ball", which cannot be described; make it three revolute',
    ),
    "floating with a limb beside": (
        "</robot>",
        f'<link name="x"/><joint name="f" type="floating">{TO_X}</robot>',
        "joint 'f' has type=\"floating\", which is read only as the one joint of a root link without mass",
    ),
    "zero axis": ('xyz="0 1 0"', 'xyz="0 0 0"', ", line 10: joint 'pivot' has an axis of zero length."),
    "two numbers": ('xyz="0 1 0"', 'xyz="0 1"', ", line 13: <axis> has 2 numbers in xyz=, which takes 3."),
    "comma": (
        'xyz="0 1 0"',
        'xyz="0 1 0,5"',
        ', line 13: <axis> has xyz="0,5", which is not a finite number.',
    ),
    "not a number": (
        'value="1.5"',
        'value="nan"',
        ', line 6: <mass> has value="nan", which is not a finite number.',
    ),
    "digits with underscores": (
        'value="1.5"',
        'value="1_5"',
        '<mass> has value="1_5", which is not a finite number',
    ),
    "negative mass": ('value="1.5"', 'value="-1.5"', "<mass> of link 'rod' has a negative value, -1.5 kg."),
    "negative damping": (
        'damping="0.1"',
        'damping="-1"',
        "<dynamics> of joint 'pivot' has a negative damping, -1.",
    ),
    "limits swapped": ('lower="-3"', 'lower="4"', "<limit> of joint 'pivot' has lower=4 above upper=3."),
    "no mass": ('<mass value="1.5"/>', "", ", line 4: <inertial> has no <mass>."),
    "no inertia": (INERTIA, "", "link 'rod' has a mass but no <inertia>, so that its mass is not known"),
    "incomplete inertia": ('iyy="0.02" ', "", ", line 7: <inertia> has no iyy=."),
    "impossible inertia": (
        'izz="0.001"',
        'izz="0.05"',
        "line 3: link 'rod': inertia breaks the triangle inequality: the two smaller principal moments "
        "0.02 + 0.02 are less than the largest, 0.05 kg m^2; correct the file, or write the nearest that a "
        "body can have into an overlay: inertia = [0.025, 0.025, 0.05, 0, 0, 0] under [[links]] name = "
        '"rod".',
    ),
    "negative inertia": (
        'izz="0.001"',
        'izz="-0.01"',
        "inertia has a negative principal moment (-0.01 kg m^2)",
    ),
    "no inertial": (
        "</robot>",
        f'<link name="x"/><joint name="j" type="continuous">{TO_X}</robot>',
        "line 17: link 'x' has no <inertial>, so that its mass is not known; add it to the file, or write "
        "mass, center_of_mass and inertia, or mass = 0.0 where it weighs nothing, into an overlay under "
        '[[links]] name = "x".',
    ),
    "two roots": (
        "</robot>",
        '<link name="x"/></robot>',
        ": links stand and x all hang on nothing, but a robot has one",
    ),
    "two parents": (
        "</robot>",
        '<joint name="j" type="fixed"><parent link="stand"/><child link="rod"/></joint></robot>',
        "link 'rod' is the child of several joints, pivot and j; closed loops cannot be described: keep one",
    ),
    "circle": (
        "</robot>",
        '<link name="x"/><link name="y"/><joint name="j" type="fixed"><parent link="x"/><child link="y"/>'
        '</joint><joint name="k" type="fixed"><parent link="y"/><child link="x"/></joint></robot>',
        ": the joints j and k form a circle that hangs on no root link.",
    ),
    "two axes": (
        "<axis",
        '<axis xyz="1 0 0"/><axis',
        "<axis> is the second of its kind in joint 'pivot'; one may be",
    ),
    "too deep": (
        "</robot>",
        "<a>" * 400 + "</a>" * 400 + "</robot>",
        "is nested too deeply for a robot file.",
    ),
}

MJCF = {
    "unknown class": (
        'class="light"/>',
        'class="lihgt"/>',
        "has the class 'lihgt', which is no default class; did you",
    ),
    "ball": (
        'name="wrist"',
        'name="wrist" type="ball"',
        "joint 'wrist' is a ball joint, which cannot be described",
    ),
    "unknown joint type": (
        'name="wrist"',
        'name="wrist" type="hing"',
        "has type=\"hing\"; did you mean 'hinge'?",
    ),
    "free inside": (
        'name="wrist"',
        'name="wrist" type="free"',
        "lets its body float, which only a body in the world",
    ),
    "zero axis": ('axis="1 0 0"', 'axis="0 0 0"', "joint 'wrist' has an axis of zero length."),
    "two orientations": (
        'pos="0 0 0.2"',
        'euler="1 2 3" quat="1 0 0 0"',
        "has an orientation in quat= and in euler=",
    ),
    "zero quaternion": ('pos="0 0 0.2"', 'quat="0 0 0 0"', ", line 9: body 'tip' has quat= of zero length."),
    "no size": (' size="0.02 0.2"', "", "is a capsule, which needs 2 positive numbers in size=."),
    "mass from a mesh": (
        'type="capsule" size="0.02 0.2"',
        'type="mesh" mesh="rod"',
        "line 6: body 'rod' takes its mass from a mesh (line 8), and meshes are not read, so that its",
    ),
    "shell": ('size="0.02 0.2"', 'size="0.02 0.2" shellinertia="true"', "takes its mass from a shell"),
    "no mass at all": (
        '<geom type="capsule" size="0.02 0.2" class="light"/>',
        "",
        "body 'rod' has no <inertial>, nor geoms that weigh anything, so that its mass is not known",
    ),
    "no diaginertia": (
        ' diaginertia="0.002 0.002 0.001"',
        "",
        "an <inertial> without diaginertia and fullinertia",
    ),
    "impossible inertia": (
        "0.002 0.002 0.001",
        "0.002 0.002 0.01",
        "body 'tip': inertia breaks the triangle inequality",
    ),
    "actuator of no joint": (
        'joint="pivot"',
        'joint="pivt"',
        "acts on the joint 'pivt', which is none of the model",
    ),
    "two joints of a name": (
        'name="wrist"',
        'name="pivot"',
        "joint 'pivot' has a name that another one has already.",
    ),
    "two bodies of a name": (
        'name="tip"',
        'name="rod"',
        "body 'rod' has a name that another one has already.",
    ),
    "two free bodies": (
        "</worldbody>",
        '<body name="a"><freejoint/></body><body name="b"><freejoint/></body></worldbody>',
        "body 'b' floats, but a robot has one free base, and 'a' and 'b' would be several; keep one.",
    ),
    "a free body beside": (
        "</worldbody>",
        '<body name="ball"><freejoint/><geom size="1"/></body></worldbody>',
        "body 'rod' moves beside body 'ball', which floats; a robot is one tree: keep one.",
    ),
    "replicate": (
        "</worldbody>",
        '<replicate count="3"/></worldbody>',
        "<replicate> is not read; let MuJoCo write",
    ),
    "range swapped": ('axis="1 0 0"', 'axis="1 0 0" range="2 1"', "has range= with 2 above 1."),
    "negative armature": ('axis="1 0 0"', 'axis="1 0 0" armature="-1"', "has a negative armature, -1."),
    "negative stiffness": ('axis="1 0 0"', 'axis="1 0 0" stiffness="-1"', "has a negative stiffness, -1."),
    "include outside": (
        "</worldbody>",
        '<include file="../x.xml"/></worldbody>',
        "outside the folder of the model",
    ),
    "include missing": (
        "</worldbody>",
        '<include file="x.xml"/></worldbody>',
        "names 'x.xml', which is no file in",
    ),
    "include of itself": (
        "</worldbody>",
        '<include file="robot.xml"/></worldbody>',
        "which is included already",
    ),
    "global coordinates": ("<default>", '<compiler coordinate="global"/><default>', "local coordinates"),
    "euler sequence": (
        "<default>",
        '<compiler eulerseq="xyw"/><default>',
        'has eulerseq="xyw"; it takes three',
    ),
    "angle": (
        "<default>",
        '<compiler angle="degrees"/><default>',
        "has angle=\"degrees\"; did you mean 'degree'?",
    ),
}

XACRO = {
    "unknown macro": ("</robot>", "<xacro:leg/></robot>", "xacro: unknown macro name: xacro:leg."),
    "unknown variable": (
        'value="1.5"',
        'value="${weight}"',
        "'weight' is not defined for expression 'weight'",
    ),
    "no argument": (
        'value="1.5"',
        'value="$(arg m)"',
        "the argument 'm' has no value; give it under [xacro] in an",
    ),
    "environment": (
        'value="1.5"',
        'value="$(env HOME)"',
        "$(env HOME) is not read; xacro arguments can be given",
    ),
    "unknown package": (
        'value="1.5"',
        'value="$(find nowhere)"',
        "the package 'nowhere' of $(find nowhere) is neither",
    ),
    "file outside": (
        ROD,
        f'<xacro:include filename="/etc/hosts"/>{ROD}',
        "'/etc/hosts' is outside the robot's package",
    ),
    "file missing": (ROD, f'<xacro:include filename="no.xacro"/>{ROD}', "no.xacro' is no file"),
    "yaml outside": (
        'value="1.5"',
        "value=\"${xacro.load_yaml('/etc/hosts')}\"",
        "is outside the robot's package",
    ),
    "attributes of classes": ('value="1.5"', 'value="${().__class__}"', "access to __attributes"),
    "functions of Python": ('value="1.5"', "value=\"${open('/etc/hosts')}\"", "Function 'open' not defined"),
    "import": ('value="1.5"', "value=\"${__import__('os').getcwd()}\"", "Function '__import__' not defined"),
    "formats": ('value="1.5"', "value=\"${'%999999999d' % 1}\"", "% takes numbers"),
    "powers": ('value="1.5"', 'value="${9**9**9}"', "a power that is beyond all numbers"),
    "long lists": ('value="1.5"', 'value="${len(range(10**9))}"', "range() of more than 10000 numbers"),
    "macros that call each other": (
        ROD,
        '<xacro:macro name="a"><xacro:b/></xacro:macro><xacro:macro name="b"><xacro:a/></xacro:macro>'
        f"<xacro:a/>{ROD}",
        ": its macros call each other without end.",
    ),
    "text bomb": (
        ROD,
        '<xacro:property name="p0" value="${\'ha\' * 100}"/>'
        + "".join(f'<xacro:property name="p{k + 1}" value="${{p{k}}}${{p{k}}}"/>' for k in range(40))
        + f'<a b="${{p40}}"/>{ROD}',
        "a text of more than 100000 characters",
    ),
    "macro bomb": (
        ROD,
        '<xacro:macro name="m0"><a/></xacro:macro>'
        + "".join(f'<xacro:macro name="m{k + 1}">{f"<xacro:m{k}/>" * 10}</xacro:macro>' for k in range(8))
        + f"<xacro:m8/>{ROD}",
        "it expands to more than 2000 elements",
    ),
    "block bomb": (
        ROD,
        '<xacro:macro name="twice" params="**block"><xacro:insert_block name="block"/>'
        '<xacro:insert_block name="block"/></xacro:macro>'
        + "<xacro:twice><block>" * 30
        + "<a/>"
        + "</block></xacro:twice>" * 30
        + ROD,
        "it expands to more than 2000 elements",
    ),
}


def refusal(path: Path, valid: str, old: str, new: str) -> str:
    """The message for the valid text with `old` replaced by `new`."""
    assert old in valid
    path.write_text(valid.replace(old, new, 1))
    with pytest.raises(InputError) as caught:
        read_robot(path)
    message = str(caught.value)
    assert message.startswith(str(path))
    assert message.isprintable()
    assert message.endswith((".", "?"))
    return message


@pytest.mark.parametrize("kind", URDF)
def test_urdf(files: Path, tmp_path: Path, kind: str) -> None:
    old, new, sentence = URDF[kind]
    assert sentence in refusal(tmp_path / "robot.urdf", (files / "pendulum.urdf").read_text(), old, new)


@pytest.mark.parametrize("kind", MJCF)
def test_mjcf(files: Path, tmp_path: Path, kind: str) -> None:
    old, new, sentence = MJCF[kind]
    assert sentence in refusal(tmp_path / "robot.xml", (files / "pendulum.xml").read_text(), old, new)


@pytest.mark.parametrize("kind", XACRO)
def test_xacro(files: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kind: str) -> None:
    monkeypatch.setattr("robot_model.formats.xacro.expansion.MOST_ELEMENTS", 2000)  # sooner reached
    old, new, sentence = XACRO[kind]
    namespace = '<robot xmlns:xacro="http://www.ros.org/wiki/xacro"'
    valid = (files / "pendulum.urdf").read_text().replace("<robot", namespace)
    assert sentence in refusal(tmp_path / "robot.urdf.xacro", valid, old, new)


def test_the_files_that_the_mistakes_are_made_in_are_valid(files: Path) -> None:
    assert [j.name for j in read_robot(files / "pendulum.urdf")[0].moving_joints] == ["pivot"]
    assert [j.name for j in read_robot(files / "pendulum.xml")[0].moving_joints] == ["pivot", "wrist"]


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("<sdf version='1.9'/>", " is an SDF file, which is not read; convert it to URDF or MJCF."),
        ("<html/>", ": its root element is <html>; <robot> begins a URDF and <mujoco> an MJCF file."),
        ("<robot/>", ", line 1: <robot> has no <link>."),
        ("<mujoco/>", ", line 1: <mujoco> has no <body>."),
        ("", ", line 1: is not valid XML: no element found."),
        ("<robot name='\x01'/>", ", line 1: is not valid XML: not well-formed (invalid token)."),
        ("<?xml version='1.0' encoding='klingon'?><robot/>", " is not valid XML: unknown encoding: klingon."),
    ],
)
def test_files_with_other_content(tmp_path: Path, text: str, sentence: str) -> None:
    (tmp_path / "robot.urdf").write_text(text)
    with pytest.raises(InputError) as caught:
        read_robot(tmp_path / "robot.urdf")
    assert str(caught.value) == f"{tmp_path / 'robot.urdf'}{sentence}"


@pytest.mark.parametrize(
    ("name", "text", "sentence"),
    [
        (
            "a.urdf",
            f"<robot>{'<a/>' * 100_001}</robot>",
            "is one of more than 100000 elements, far too many for a",
        ),
        (
            "a.urdf",
            "<robot>" + "".join(f"<link name='l{k}'/>" for k in range(6000)) + "</robot>",
            "a.urdf has 6000 links; a robot may have 256 that move, and 5120 in all.",
        ),
        (
            "a.xml",
            f"<mujoco><worldbody>{'<body/>' * 6000}</worldbody></mujoco>",
            "a.xml has 5121 links; a robot may",
        ),
    ],
    ids=["elements", "links", "bodies"],
)
def test_oversized_content(tmp_path: Path, name: str, text: str, sentence: str) -> None:
    (tmp_path / name).write_text(text)
    with pytest.raises(InputError) as caught:
        read_robot(tmp_path / name)
    assert sentence in str(caught.value)


def test_a_huge_file_is_refused_unread(tmp_path: Path) -> None:
    with (tmp_path / "robot.urdf").open("wb") as file:
        file.truncate(3 * 2**30)  # sparse: takes no room
    with pytest.raises(InputError, match=r"has 3072 MiB, which is no robot file; one may have 16 MiB\."):
        read_robot(tmp_path / "robot.urdf")


def test_a_file_without_a_suffix_is_recognised_by_its_content(files: Path, tmp_path: Path) -> None:
    (tmp_path / "robot").write_bytes(b"\xef\xbb\xbf\n" + (files / "pendulum.urdf").read_bytes())
    (tmp_path / "text").write_text('name = "arm"')
    assert read_robot(tmp_path / "robot")[0].name == "pendulum"
    with pytest.raises(InputError, match="key 'links' is missing"):
        read_robot(tmp_path / "text")


def test_a_misspelt_name_suggests_the_file_next_to_it(files: Path) -> None:
    with pytest.raises(InputError, match=r"did you mean '.*pendulum\.urdf'\?"):
        read_robot(files / "pendulm.urdf")
