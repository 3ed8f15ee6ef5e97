"""Couplings of joints and bodies outside the tree, which a robot description cannot hold."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from robot_model.formats.mjcf.defaults import MAIN, Defaults
from robot_model.formats.parts.draft import DraftJoint, DraftTransmission
from robot_model.formats.parts.markup import Element
from robot_model.formats.parts.notes import Notes

__all__ = ["with_equalities"]

LOOP = "equality {}: the loop that it closes is left open, without the forces in it"
FOLLOWER = (
    "that a joint follows another one by an equality cannot be described; held where it is at first: {}"
)
OTHER = "equality {}: left out"
TENDON = "tendon {}: its spring, damping, friction or armature is left out"
SOFT = "{}: bodies that deform are left out"

#: Attributes of a tendon that cause additional forces.
FORCES = ("stiffness", "damping", "frictionloss", "armature")


def with_equalities(
    joints: Sequence[DraftJoint],
    model: Element,
    defaults: Defaults,
    notes: Notes,
    transmissions: Sequence[DraftTransmission] = (),
) -> list[DraftJoint]:
    """The joints, with followers of an equality held; other omitted content is noted."""
    held: dict[str, float] = {}
    pulled = {motor.tendon for one in transmissions for motor in one.motors}
    for element in _inside(model, "equality"):
        resolved = defaults.resolved(element, MAIN)
        if resolved.attributes.get("active", "true").strip() == "false":
            continue
        label = (
            f"'{element.attributes['name']}'" if "name" in element.attributes else f"in line {element.line}"
        )
        if element.tag in ("connect", "weld"):
            notes.add(LOOP, label)
        elif element.tag == "joint":
            name = element.text("joint1")
            held[name] = float(resolved.several("polycoef", 5)[:1].sum())
        else:
            notes.add(OTHER, label)
    for element in _inside(model, "tendon"):
        if element.attributes.get("name") in pulled:
            continue
        resolved = defaults.resolved(element, MAIN) if element.tag != "spatial" else element
        if any(resolved.several(key, 16).any() for key in FORCES):
            notes.add(TENDON, f"'{element.attributes.get('name', element.line)}'")
    for element in _inside(model, "deformable"):
        notes.add(SOFT, element.label)
    return [_held(joint, held, notes) for joint in joints]


def _held(joint: DraftJoint, held: dict[str, float], notes: Notes) -> DraftJoint:
    if joint.name not in held:
        return joint
    notes.add(FOLLOWER, f"'{joint.name}'")
    return joint.locked(joint.initial + held[joint.name])


def _inside(model: Element, section: str) -> Iterator[Element]:
    for element in model.all(section):
        yield from element.children
