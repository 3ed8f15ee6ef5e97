"""URDF: links with mass properties, connected by joints (wiki.ros.org/urdf/XML)."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Set
from dataclasses import replace

import numpy as np

from robot_model.formats.parts.draft import Draft, DraftJoint, DraftLink, DraftMotor, DraftTransmission
from robot_model.formats.parts.markup import Element, number
from robot_model.formats.parts.mass import Mass, nearest_realisable
from robot_model.formats.parts.notes import Notes
from robot_model.formats.parts.poses import IDENTITY, Pose, from_quaternion, from_rpy
from robot_model.formats.parts.trees import check_count, one_root
from robot_model.input.errors import nearest
from robot_model.input.fields import inertia_fault

__all__ = ["read_urdf"]

#: A parent with this name, if there is no such link, is the ground, as in Drake and Gazebo.
GROUND = "world"

#: Counterpart of each joint type.
KINDS: Mapping[str, str] = {
    "revolute": "revolute",
    "continuous": "revolute",
    "prismatic": "prismatic",
    "fixed": "fixed",
    "floating": "floating",
}

#: Transmissions of two actuators and two joints, by the last part of their type.
DIFFERENTIAL, LINKAGE = "DifferentialTransmission", "FourBarLinkageTransmission"
LINKED = (DIFFERENTIAL, LINKAGE)

#: What to write instead of a joint type that has several coordinates.
INSTEAD: Mapping[str, str] = {
    "planar": "two prismatic joints and a revolute one",
    "spherical": "three revolute joints",
    "ball": "three revolute joints",
    "universal": "two revolute joints",
}

DYNAMICS = (
    "damping and friction of {} become viscous_friction and coulomb_friction that the robot already has; "
    "effects = [] in an overlay drops them"
)
MIMIC = "that a joint follows another one (<mimic>) cannot be described; held at its offset: {}"
ZEROS = "effort or velocity limit of {} is zero, which is taken for unknown"
COUPLED = "transmission {}: couples several joints, which is left out"
MOTORS = (
    "transmission {}: its actuators become motors that move its joints together; limits of the joints' "
    "effort are left out"
)
SPRING = "springs that Gazebo adds to joints (springStiffness): left out"
REDUCTION = "<mechanicalReduction> of {} becomes gear_ratio"


def read_urdf(root: Element) -> Draft:
    """The robot of a ``<robot>`` element. Raises `InputError`."""
    notes = Notes()
    links = _named(root.all("link"))
    joints = _named(root.all("joint"))
    if not links:
        root.fault("has no <link>")
    check_count(links, root.file)
    coupled = tuple(_coupled(root, set(joints), notes))
    driven = {name for one in coupled for name in one.joints}
    gears = _reductions(root, set(joints) - driven, notes)
    if any(part.child("springStiffness") for part in root.all("gazebo")):
        notes.add(SPRING)
    bodies = [_link(element) for element in links.values()]
    if GROUND not in links and any(_parent(element) == GROUND for element in joints.values()):
        bodies.insert(0, DraftLink(GROUND, root.where))
    known = {body.name for body in bodies}
    made = [_joint(element, known, notes) for element in joints.values()]
    made = [
        replace(joint, gear_ratio=gears.get(joint.name, 1.0), passive=joint.name in driven) for joint in made
    ]
    draft = Draft(
        name=root.attributes.get("name", ""),
        root=one_root(bodies, made, root.file),
        links=tuple(bodies),
        joints=tuple(made),
        transmissions=coupled,
        notes=notes,
    )
    return _afloat(draft, joints)


def _named(elements: Iterable[Element]) -> dict[str, Element]:
    """The elements by their names, which must be unique."""
    found: dict[str, Element] = {}
    for element in elements:
        if (name := element.text("name")) in found:
            element.fault(f"has a name that is used in line {found[name].line} already")
        found[name] = element
    return found


def _link(element: Element) -> DraftLink:
    name, label = element.text("name"), f"{element.where}: {element.label}"
    inertial = element.child("inertial")
    if inertial is None:
        return DraftLink(name, element.where, gap=f"{label} has no <inertial>", marker=True)
    mass = inertial.needed("mass").number("value")
    if mass < 0:
        inertial.needed("mass").fault(f"of {element.label} has a negative value, {mass:g} kg")
    figures = inertial.child("inertia")
    if figures is None:
        return DraftLink(name, element.where, gap=f"{label} has a mass but no <inertia>")
    xx, yy, zz = (figures.number(key) for key in ("ixx", "iyy", "izz"))
    xy, xz, yz = (figures.number(key, 0.0) for key in ("ixy", "ixz", "iyz"))
    inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    pose = _pose(inertial)
    whole = Mass(mass, np.zeros(3), inertia).seen_from(pose)
    if not (fault := inertia_fault(inertia)):
        return DraftLink(name, element.where, whole)
    corrected = Mass(mass, np.zeros(3), nearest_realisable(inertia)).seen_from(pose)
    return DraftLink(name, element.where, whole, fault=f"{label}: {fault}", corrected=corrected)


def _pose(element: Element) -> Pose:
    """The pose of the <origin> in an element."""
    origin = element.child("origin")
    if origin is None:
        return IDENTITY
    place = origin.numbers("xyz", 3, (0.0, 0.0, 0.0))
    if "quat_xyzw" in origin.attributes:  # since version 1.1 of the format
        x, y, z, w = origin.numbers("quat_xyzw", 4)
        if not any((x, y, z, w)):
            origin.fault("has a quaternion of zeros")
        return Pose(place, from_quaternion((w, x, y, z)))
    rpy = origin.numbers("rpy", 3, (0.0, 0.0, 0.0))
    roll, pitch, yaw = map(float, rpy)
    return Pose(place, from_rpy(rpy), (roll, pitch, yaw))


def _parent(element: Element) -> str:
    return element.needed("parent").text("link")


def _joint(element: Element, links: Set[str], notes: Notes) -> DraftJoint:
    name, kind = element.text("name"), _kind(element)
    parent, child = _parent(element), element.needed("child").text("link")
    for role, link in (("parent", parent), ("child", child)):
        if link not in links:
            element.fault(f"has the {role} '{link}', which is no link of the file{nearest(link, links)}")
    joint = DraftJoint(name, element.where, kind, parent, child, _pose(element))
    if kind not in ("revolute", "prismatic"):
        return joint
    joint = _with_dynamics(_with_limits(replace(joint, axis=_axis(element)), element, notes), element, notes)
    if mimic := element.child("mimic"):
        notes.add(MIMIC, f"'{name}'")
        return joint.locked(mimic.number("offset", 0.0))
    return joint


def _kind(element: Element) -> str:
    kind = element.text("type")
    if kind in INSTEAD:
        element.fault(
            f'has type="{kind}", which cannot be described; make it {INSTEAD[kind]}, with links of mass 0 in '
            "between"
        )
    if kind not in KINDS:
        element.fault(
            f'has the unknown type="{kind}"{nearest(kind, KINDS) or "; it may be " + ", ".join(KINDS)}'
        )
    return KINDS[kind]


def _axis(element: Element) -> np.ndarray:
    """The axis, x where none is given; not yet of length one."""
    found = element.child("axis")
    axis = np.array([1.0, 0.0, 0.0]) if found is None else found.numbers("xyz", 3, (1.0, 0.0, 0.0))
    if not axis.any():
        element.fault("has an axis of zero length")
    return axis


def _with_limits(joint: DraftJoint, element: Element, notes: Notes) -> DraftJoint:
    """Limits of position, speed and force; exporters write zeros for unknown ones."""
    limit = element.child("limit")
    if limit is None:
        return joint
    lower, upper = limit.number("lower", 0.0), limit.number("upper", 0.0)
    speed, force = limit.number("velocity", 0.0), limit.number("effort", 0.0)
    bounded = element.attributes["type"].strip() != "continuous"
    if bounded and lower > upper:
        limit.fault(f"of {element.label} has lower={lower:g} above upper={upper:g}")
    if limit.attributes.keys() & {"velocity", "effort"} and (speed <= 0 or force <= 0):
        notes.add(ZEROS, f"'{joint.name}'")
    return replace(
        joint,
        limits=(lower, upper) if bounded and lower < upper else None,
        top_speed=speed if speed > 0 else None,
        top_force=force if force > 0 else None,
    )


def _with_dynamics(joint: DraftJoint, element: Element, notes: Notes) -> DraftJoint:
    found = element.child("dynamics")
    if found is None:
        return joint
    figures = {key: found.number(key, 0.0) for key in ("damping", "friction")}
    for key, value in figures.items():
        if value < 0:
            found.fault(f"of {element.label} has a negative {key}, {value:g}")
    if any(figures.values()):
        notes.add(DYNAMICS, f"'{joint.name}'", about="effects")
    return replace(joint, damping=figures["damping"], friction=figures["friction"])


def _coupled(root: Element, joints: Set[str], notes: Notes) -> Iterator[DraftTransmission]:
    """Differentials and four-bar linkages of ros_control and ros2_control, where their zeros are the joints'.

    Formulas and roles are those of the classes in its package transmission_interface: with actuators x_a
    behind their reductions n_a, m = x_a / n_a, a differential is x_1 = (m_1 + m_2) / (2 n_1),
    x_2 = (m_1 - m_2) / (2 n_2), and a linkage x_1 = m_1 / n_1, x_2 = (m_2 - m_1 / n_1) / n_2.
    """
    elements = [one for part in (root, *root.all("ros2_control")) for one in part.all("transmission")]
    taken: set[str] = set()
    for element in elements:
        kind = "".join(part.content for part in element.all("type", "plugin")).strip().split("/")[-1]
        moved, motors = (_by_role(element, what) for what in ("joint", "actuator"))
        names = [part.attributes.get("name", "") for part in moved]
        offsets = [part.content for one in moved for part in one.all("offset")]
        plain = not any(number(text) != 0.0 for text in offsets)
        if kind not in LINKED or len(moved) != 2 or len(motors) != 2 or not plain:
            continue
        own, gears = ([_ratio(part) for part in parts] for parts in (moved, motors))
        called = [part.attributes.get("name", "") for part in motors]
        if not set(names) <= joints - taken or len(set(names)) < 2 or len(set(called)) < 2 or not all(called):
            continue
        if not all((*own, *gears)):
            continue
        taken |= set(names)
        one, two = own
        forward = [[0.5 / one, 0.5 / one], [0.5 / two, -0.5 / two]]
        if kind == LINKAGE:
            forward = [[1.0 / one, 0.0], [-1.0 / (one * two), 1.0 / two]]
        turned = np.array(forward) * np.sign(gears)  # a reversed gear counts by its magnitude
        drafted = tuple(DraftMotor(name, gear_ratio=abs(gear)) for name, gear in zip(called, gears))
        notes.add(MOTORS, f"'{element.attributes.get('name', element.line)}'")
        yield DraftTransmission((names[0], names[1]), drafted, np.linalg.inv(turned))


def _by_role(element: Element, what: str) -> list[Element]:
    """Joints or actuators of a transmission, in the order of their roles where they have some."""
    parts = list(element.all(what))
    roles = {_role(part): part for part in parts}
    wanted = [f"{what}1", f"{what}2"]
    return [roles[role] for role in wanted] if set(wanted) == roles.keys() else parts


def _role(part: Element) -> str:
    return part.attributes.get("role") or "".join(child.content for child in part.all("role")).strip()


def _ratio(part: Element) -> float:
    """Reduction of a joint or an actuator; 1 where none is given, 0 where it is no number."""
    given = list(part.all("mechanicalReduction", "mechanical_reduction"))
    return (number(given[0].content) or 0.0) if given else 1.0


def _reductions(root: Element, joints: set[str], notes: Notes) -> dict[str, float]:
    """Gear ratios other than 1 of transmissions, by joint; a reversed gear counts by its magnitude.

    Transmissions belong to ros_control and other tools, each with its own format: unknown formats are
    ignored.
    """
    found = {}
    for transmission in root.all("transmission"):
        parts = [transmission, *transmission.children]
        ratios = [child for part in parts for child in part.all("mechanicalReduction")]
        named = {child.attributes.get("name", "") for child in transmission.all("joint")} & joints
        if len(named) > 1:
            notes.add(COUPLED, f"'{transmission.attributes.get('name', transmission.line)}'")
        ratio = abs(number(ratios[0].content) or 0.0) if len(ratios) == 1 and len(named) == 1 else 0.0
        if ratio not in (0.0, 1.0):
            (name,) = named
            found[name] = ratio
            notes.add(REDUCTION, f"'{name}'")
    return found


def _afloat(draft: Draft, elements: Mapping[str, Element]) -> Draft:
    """A root frame with one floating joint is replaced by the floating link, which becomes a free base."""
    floating = [joint for joint in draft.joints if joint.kind == "floating"]
    if not floating:
        return draft
    joint, root = floating[0], next(link for link in draft.links if link.name == draft.root)
    beside = [other for other in draft.joints if other.parent == draft.root]
    if joint.parent != draft.root or len(beside) > 1 or (root.mass and not root.mass.is_nothing):
        elements[joint.name].fault(
            'has type="floating", which is read only as the one joint of a root link without mass, where it '
            "makes the base free"
        )
    return replace(
        draft,
        root=joint.child,
        links=tuple(link for link in draft.links if link is not root),
        joints=tuple(other for other in draft.joints if other is not joint),
        base="free",
        base_pose=joint.pose,
    )
