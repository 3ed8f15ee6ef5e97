"""Fixed tendons with an actuator each: motors of a transmission, where there are as many as joints."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from robot_model.formats.mjcf.actuators import added_by, driving
from robot_model.formats.mjcf.defaults import MAIN, Defaults
from robot_model.formats.mjcf.joints import FRICTION, SPRING
from robot_model.formats.mjcf.settings import Settings
from robot_model.formats.parts.draft import DraftJoint, DraftMotor, DraftTransmission
from robot_model.formats.parts.markup import Element
from robot_model.formats.parts.notes import Notes

__all__ = ["transmissions_of"]

COUPLED = "fixed tendons with an actuator each become motors of a transmission, behind their gears: {}"
#: Condition number above which a matrix counts as singular.
SINGULAR = 1e9


@dataclass(frozen=True)
class _Tendon:
    """A tendon with one actuator, and its length as a function of joint positions."""

    element: Element
    actuator: Element
    coefficients: dict[str, float]


def transmissions_of(
    joints: Sequence[DraftJoint], model: Element, defaults: Defaults, settings: Settings, notes: Notes
) -> tuple[DraftTransmission, ...]:
    """Transmissions of the model, by groups of tendons that share joints.

    A group is one where it has as many tendons as joints, its coefficients can be inverted, and nothing else
    drives or holds its joints; all other tendons are left to be noted.
    """
    taken = _driven_or_held(joints, model, defaults)
    found: list[DraftTransmission] = []
    for group in _groups(list(_tendons(model, defaults))):
        names = tuple(dict.fromkeys(name for one in group for name in one.coefficients))
        known = [joint for joint in joints if joint.name in names]
        if len(names) != len(group) or len(known) != len(names) or taken & set(names):
            continue
        order = tuple(joint.name for joint in known)
        matrix = np.array([[one.coefficients.get(name, 0.0) for name in order] for one in group])
        if np.linalg.cond(matrix) > SINGULAR:
            continue
        start = matrix @ [joint.initial for joint in known]
        motors = [_motor(one, float(rest), settings) for one, rest in zip(group, start)]
        if all(motors):
            found.append(DraftTransmission(order, tuple(filter(None, motors)), matrix))
    for motor in (motor for one in found for motor in one.motors):
        notes.add(COUPLED, f"'{motor.tendon}'")
        if motor.damping or motor.friction:
            notes.add(FRICTION, f"'{motor.tendon}'", about="effects")
        if motor.stiffness:
            notes.add(SPRING, f"'{motor.tendon}'", about="effects")
    return tuple(found)


def _tendons(model: Element, defaults: Defaults) -> Iterator[_Tendon]:
    """Fixed tendons with exactly one actuator."""
    pulled: dict[str, list[Element]] = {}
    for element in driving(model, defaults):
        if name := element.attributes.get("tendon"):
            pulled.setdefault(name, []).append(element)
    for section in model.all("tendon"):
        for element in section.all("fixed"):
            own = pulled.get(element.attributes.get("name", ""), [])
            if len(own) == 1:
                parts = {part.text("joint"): part.number("coef", 1.0) for part in element.all("joint")}
                given = defaults.resolved(replace(element, tag="tendon"), MAIN)
                yield _Tendon(given, own[0], parts)


def _driven_or_held(joints: Sequence[DraftJoint], model: Element, defaults: Defaults) -> set[str]:
    """Joints with an actuator, a rotor or an equality of their own."""
    direct = {
        element.attributes.get(key, "")
        for element in driving(model, defaults)
        for key in ("joint", "jointinparent")
    }
    ends = ("joint1", "joint2")
    equal = {
        element.attributes.get(key, "")
        for section in model.all("equality")
        for element in section.all("joint")
        for key in ends
    }
    return direct | equal | {joint.name for joint in joints if joint.armature}


def _groups(tendons: Sequence[_Tendon]) -> Iterator[list[_Tendon]]:
    """Tendons that share joints, directly or through others."""
    left = list(tendons)
    while left:
        group: list[_Tendon] = [left.pop(0)]
        names: set[str] = set()
        while names != (names := {name for one in group for name in one.coefficients}):
            more = [one for one in left if names & one.coefficients.keys()]
            group += more
            left = [one for one in left if one not in more]
        yield group


def _motor(tendon: _Tendon, slack: float, settings: Settings) -> DraftMotor | None:
    """The motor behind its gear; None where its spring is slack over a range."""
    element, actuator = tendon.element, tendon.actuator
    lengths = element.several("springlength", 2)
    if lengths.size == 2 and lengths[0] != lengths[1]:
        return None
    rest = float(lengths[0]) if lengths.size and lengths[0] != -1.0 else slack
    forces = {
        key: element.several(key, 16)[:1] for key in ("armature", "damping", "frictionloss", "stiffness")
    }
    own = {key: float(abs(value.sum())) for key, value in forces.items()}
    armature, damping, force = added_by(actuator, settings)
    off = settings.disabled
    return DraftMotor(
        name=actuator.attributes.get("name") or element.attributes["name"],
        tendon=element.attributes["name"],
        armature=own["armature"] + armature,
        damping=(0.0 if "damper" in off else own["damping"]) + damping,
        friction=0.0 if "frictionloss" in off else own["frictionloss"],
        stiffness=0.0 if "spring" in off else own["stiffness"],
        rest=rest,
        top_force=force,
    )
