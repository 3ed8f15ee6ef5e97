"""Actuators: the joints that they drive, and their largest force."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from robot_model.formats.mjcf.defaults import ACTUATORS, MAIN, Defaults
from robot_model.formats.mjcf.joints import limit_of
from robot_model.formats.mjcf.settings import Settings
from robot_model.formats.parts.draft import DraftJoint, DraftTransmission
from robot_model.formats.parts.markup import Element
from robot_model.formats.parts.notes import Notes

__all__ = ["added_by", "driving", "with_actuators"]

GEAR = (
    "gear of {}: torques of this robot are at the joint, that is MuJoCo's control times the gear; a gear's "
    "effect on rotor inertia and current is given by gear_ratio in an overlay"
)
SERVO = "{}: the servo's gains are left out; write a [controller] into an overlay where the real one is known"
LAG = "{}: the dynamics between control and force (dyntype) are left out"
OTHER = "{}: how the actuator makes its force is left out; it counts as a torque at its joint"
ELSEWHERE = "{}: does not act on a single joint and is left out"
DAMPED = "damping of {}: times the square of the gear, added to the viscous_friction of its joint"
PASSIVE = "{}: no actuator, so nothing drives it"
ROTOR = (
    "{}: no actuator but armature, which only an actuator can have here, so that it counts as driven; "
    "passive = true in an overlay drops the armature and makes the joint passive"
)

#: Actuators whose force is the control itself, and those that hold a position or a speed.
MOTORS, SERVOS = ("motor", "general"), ("position", "velocity", "intvelocity", "pid", "orientation")


def with_actuators(
    joints: Sequence[DraftJoint],
    model: Element,
    defaults: Defaults,
    settings: Settings,
    notes: Notes,
    transmissions: Sequence[DraftTransmission] = (),
) -> list[DraftJoint]:
    """The joints with the armature, damping and largest force of their actuators.

    Where a model has actuators at all, a joint without one is passive, unless an actuator acts on several
    joints, as through a tendon. Those of `transmissions` move them by their motors.
    """
    found = list(driving(model, defaults))
    coupled = {name for one in transmissions for name in one.joints}
    tendons = {motor.tendon for one in transmissions for motor in one.motors}
    driven: dict[str, list[Element]] = {joint.name: [] for joint in joints}
    indirect = False
    for element in found:
        target = element.attributes.get("joint") or element.attributes.get("jointinparent") or ""
        if target in driven:
            driven[target].append(element)
            _note(element, notes)
        elif element.attributes.get("tendon") in tendons:
            _note(element, notes)
        elif target:
            element.fault(f"acts on the joint '{target}', which is none of the model")
        else:
            indirect = True
            notes.add(ELSEWHERE, _label(element))
    made = [_driven(joint, driven[joint.name], settings) for joint in joints]
    made = [replace(joint, passive=True) if joint.name in coupled else joint for joint in made]
    if not found or indirect:
        return made
    return [joint if joint.name in coupled else _passive(joint, driven[joint.name], notes) for joint in made]


def _passive(joint: DraftJoint, actuators: Sequence[Element], notes: Notes) -> DraftJoint:
    """The joint, passive where it has no actuator and no rotor inertia, which only an actuator can have."""
    if joint.kind == "fixed" or actuators:
        return joint
    notes.add(ROTOR if joint.armature else PASSIVE, f"joint '{joint.name}'")
    return replace(joint, passive=not joint.armature)


def driving(model: Element, defaults: Defaults) -> Iterator[Element]:
    """All actuators, with their defaults."""
    for section in model.all("actuator"):
        for element in section.all(*ACTUATORS):
            yield defaults.resolved(element, MAIN)


def added_by(element: Element, settings: Settings) -> tuple[float, float, float | None]:
    """Rotor inertia, damping and largest force of an actuator behind its gear."""
    gear, force = _gear(element), _force(element, settings)
    square = gear**2
    most = None if force is None else gear * force
    return square * element.number("armature", 0.0), square * _damping(element), most


def _driven(joint: DraftJoint, actuators: Sequence[Element], settings: Settings) -> DraftJoint:
    """Additions of a joint's actuators to it."""
    gears = [_gear(element) for element in actuators]
    forces = [_force(element, settings) for element in actuators]
    known = [gear * force for gear, force in zip(gears, forces) if force is not None]
    bounds = [
        bound for bound in (joint.top_force, sum(known) if len(known) == len(forces) else None) if bound
    ]
    squares = [(gear**2, element) for gear, element in zip(gears, actuators)]
    return replace(
        joint,
        armature=joint.armature + sum(square * e.number("armature", 0.0) for square, e in squares),
        damping=joint.damping + sum(square * _damping(e) for square, e in squares),
        top_force=min(bounds) if bounds else None,
    )


def _gear(element: Element) -> float:
    """Magnitude of the first of up to six gears, which is that of a hinge or a slide."""
    gears = element.several("gear", 6)
    return abs(float(gears[0])) if gears.size else 1.0


def _damping(element: Element) -> float:
    """The damping of an actuator; that of a damper is its law, and depends on the control."""
    figures = element.several("damping", 16)
    return float(figures[0]) if figures.size else 0.0


def _force(element: Element, settings: Settings) -> float | None:
    """Largest force before the gear, where the file bounds it."""
    bounds = [limit_of(element, "force", settings)]
    if _is_motor(element):
        gain = element.several("gainprm", 16)
        control = limit_of(element, "ctrl", settings)
        bounds.append(None if control is None else control * (abs(float(gain[0])) if gain.size else 1.0))
    known = [bound for bound in bounds if bound]
    return min(known) if known else None


def _is_motor(element: Element) -> bool:
    """Whether the force is the control times a constant."""
    fixed = element.attributes.get("gaintype", "fixed").strip() == "fixed"
    return element.tag in MOTORS and fixed and element.attributes.get("biastype", "none").strip() == "none"


def _note(element: Element, notes: Notes) -> None:
    label = _label(element)
    if _gear(element) != 1.0:
        notes.add(GEAR, label)
    if element.attributes.get("dyntype", "none").strip() != "none" or element.number("timeconst", 0.0):
        notes.add(LAG, label)
    if element.tag in SERVOS or element.attributes.get("biastype", "none").strip() == "affine":
        notes.add(SERVO, label)
    elif not _is_motor(element):
        notes.add(OTHER, label)
    if _damping(element):
        notes.add(DAMPED, label)


def _label(element: Element) -> str:
    """``position 'elbow' (kp = 100, kv = 5)``."""
    gains = [
        f"{key} = {element.attributes[key]}"
        for key in ("kp", "kv", "ki", "dampratio")
        if key in element.attributes
    ]
    return f"{element.label}{f' ({chr(44).join(gains)})' if gains else ''}".replace(",", ", ")
