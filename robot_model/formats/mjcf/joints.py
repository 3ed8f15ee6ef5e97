"""Joints of bodies: hinges and slides."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from robot_model.formats.mjcf.settings import Settings
from robot_model.formats.parts.draft import DraftJoint
from robot_model.formats.parts.markup import Element
from robot_model.formats.parts.notes import Notes
from robot_model.formats.parts.poses import Pose, shifted

__all__ = ["FRICTION", "SPRING", "Placed", "is_free", "limit_of", "read_joint"]

FRICTION = (
    "damping and frictionloss of {} become viscous_friction and coulomb_friction that the robot already has; "
    "effects = [] in an overlay drops them"
)
SPRING = "stiffness and springref of {} become a cable_spring that the robot already has"
ARMATURE = "armature of {} becomes rotor_inertia, as felt at the joint"
CURVED = "stiffness or damping of {} is a polynomial, of which only the linear term is kept"
LEFT_OUT = "springdamper, springyield or actuatorgravcomp of {}: left out"

#: Attributes of joints that have no counterpart, unless they hold this.
NOTHING = {"springdamper": "0", "springyield": "0", "actuatorgravcomp": "false"}


def is_free(joint: Element) -> bool:
    """Whether a joint element lets its body move in all directions."""
    return joint.tag == "freejoint" or joint.attributes.get("type", "hinge").strip() == "free"


class Placed:
    """A joint read from its element, and its pose.

    Attributes:
        joint: without parent and child.
        place: its position in the body's frame [m], shape (3,).
        pose: its frame in the body's frame, such that the body is at its pose in the file when the joint is
            at its ``ref``.
    """

    def __init__(self, joint: DraftJoint, place: NDArray[np.float64]) -> None:
        self.joint, self.place = joint, place
        self.pose = shifted(place) @ joint.locked(-joint.initial).pose


def read_joint(element: Element, frame: Pose, name: str, settings: Settings, notes: Notes) -> Placed:
    """A joint whose element, with defaults, stands in `frame` of the body. Raises `InputError`."""
    kind = element.choice("type", ("hinge", "slide", "ball", "free"), "hinge")
    if kind == "ball":
        element.fault('is a ball joint, which cannot be described; write it as three joints of type="hinge"')
    axis = element.numbers("axis", 3, (0.0, 0.0, 1.0))
    if not np.linalg.norm(axis) > 0:
        element.fault("has an axis of zero length")
    unit = settings.per_angle if kind == "hinge" else 1.0
    joint = DraftJoint(
        name,
        element.where,
        "revolute" if kind == "hinge" else "prismatic",
        parent="",
        child="",
        axis=frame.rotation @ axis,
        limits=_range(element, settings, unit),
        top_force=limit_of(element, "actuatorfrc", settings),
        initial=element.number("ref", 0.0) * unit,
        damping=0.0 if "damper" in settings.disabled else _first(element, "damping", notes),
        friction=0.0 if "frictionloss" in settings.disabled else _positive(element, "frictionloss"),
        stiffness=0.0 if "spring" in settings.disabled else _first(element, "stiffness", notes),
        rest=element.number("springref", 0.0) * unit,
        armature=_positive(element, "armature"),
    )
    _note(joint, element, notes)
    place = element.numbers("pos", 3, (0.0, 0.0, 0.0))
    return Placed(joint, frame.place + frame.rotation @ place)


def _note(joint: DraftJoint, element: Element, notes: Notes) -> None:
    label = f"'{joint.name}'"
    if joint.damping or joint.friction:
        notes.add(FRICTION, label, about="effects")
    if joint.stiffness:
        notes.add(SPRING, label, about="effects")
    if joint.armature:
        notes.add(ARMATURE, label)
    if any(element.attributes.get(key, empty).split()[:1] != [empty] for key, empty in NOTHING.items()):
        notes.add(LEFT_OUT, label)


def limit_of(element: Element, stem: str, settings: Settings) -> float | None:
    """The larger bound of ``STEMrange`` where ``STEMlimited`` lets it count [N m or N]."""
    found = _bounds(element, f"{stem}range", f"{stem}limited", settings)
    return max(map(abs, found)) or None if found else None


def _range(element: Element, settings: Settings, unit: float) -> tuple[float, float] | None:
    found = _bounds(element, "range", "limited", settings)
    return (found[0] * unit, found[1] * unit) if found else None


def _bounds(element: Element, key: str, switch: str, settings: Settings) -> tuple[float, float] | None:
    """A range that counts: lower and upper in the file's units."""
    limited = element.choice(switch, ("true", "false", "auto"), "auto")
    if key not in element.attributes or limited == "false" or (limited == "auto" and not settings.autolimits):
        return None
    low, high = map(float, element.numbers(key, 2))
    if low > high:
        element.fault(f"has {key}= with {low:g} above {high:g}")
    return (low, high) if low < high else None


def _first(element: Element, key: str, notes: Notes) -> float:
    """The first coefficient of a force that may be a polynomial."""
    figures = element.several(key, 16)
    if figures[1:].any():
        notes.add(CURVED, element.label)
    if figures.size and figures[0] < 0:
        element.fault(f"has a negative {key}, {figures[0]:g}")
    return float(figures[0]) if figures.size else 0.0


def _positive(element: Element, key: str) -> float:
    value = element.number(key, 0.0)
    if value < 0:
        element.fault(f"has a negative {key}, {value:g}")
    return value
