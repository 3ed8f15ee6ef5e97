"""An MJCF file changed in place: inertials, joints' passive forces and rotors, gains of motors, gravity."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from missing_physics.export.content import Content, JointNumbers
from missing_physics.export.figures import figure, figures
from missing_physics.export.mjcf import STICKING
from missing_physics.export.own_file.masses import Placed, changed_bodies, same
from robot_model import InputError
from robot_model.editing import Marked, Source, Tag
from robot_model.formats.mjcf.defaults import ORIENTATIONS
from robot_model.formats.parts.draft import DraftJoint

__all__ = ["edit_mjcf"]

PAIRS = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))


def edit_mjcf(content: Content, source: Source, marked: Marked) -> tuple[list[str], list[str]]:
    """The changes, and the findings that the file cannot hold."""
    changed: list[str] = []
    left: list[str] = []
    bodies = _named(marked, "body")
    for body in changed_bodies(content, source):
        if body.name == "world":
            continue  # carries nothing that moves
        if source.settings.total_mass > 0.0 or source.settings.from_geoms == "true":
            raise InputError(
                f"{marked.source}: its compiler makes masses by settotalmass or from geoms, so that "
                "<inertial> does not count; take that out, or export without --into."
            )
        _set_inertial(marked, _there(bodies, body.name, "body", marked), body)
        changed.append(f"inertial of body '{body.name}'")
    joints = _named(marked, "joint")
    for name, found in content.joints.items():
        drafted = source.joints[name]
        new = _figures(drafted, found, source.settings.per_angle)
        if new:
            tag = _there(joints, drafted.name, "joint", marked)
            changed.append(f"{', '.join(new)} of joint '{drafted.name}'")
            if "frictionloss" in new and "solreffriction" not in tag.attributes:
                new["solreffriction"] = STICKING  # softer by default, which takes torque away
            marked.set(tag, **new)
        if not same(found.gain, 1.0):
            done = _gain(marked, drafted.name, found.gain)
            (changed if done else left).append(
                f"gear of the motor of '{drafted.name}', times {figure(found.gain)}"
                if done
                else f"torque gain of {name}: {figure(found.gain)}"
            )
        if found.offset and not found.stiffness:
            left.append(f"torque offset of {name}: {figure(found.offset)}")
    if not same(np.array(source.settings.gravity), content.gravity, 1.0):
        _set_gravity(marked, content.gravity)
        changed.append("gravity")
    return changed, left


def _named(marked: Marked, kind: str) -> dict[str, Tag]:
    worlds = list(marked.root.all("worldbody"))
    return {tag.attributes.get("name", ""): tag for world in worlds for tag in world.inside(kind)}


def _there(tags: Mapping[str, Tag], name: str, kind: str, marked: Marked) -> Tag:
    if name not in tags:
        raise InputError(
            f"{marked.source}: the {kind} '{name}' has no name there, or stands in an included file; name "
            "it, or let MuJoCo write one file (mj_saveLastXML)."
        )
    return tags[name]


def _figures(drafted: DraftJoint, found: JointNumbers, per_angle: float) -> dict[str, str]:
    """Attributes that change. Those of actuators that act on the joint stay where they are."""
    unit = per_angle if drafted.kind == "revolute" else 1.0
    rest = found.offset / found.stiffness if found.stiffness else 0.0
    pairs = {
        "damping": (drafted.damping, found.damping),
        "frictionloss": (drafted.friction, found.frictionloss),
        "stiffness": (drafted.stiffness, found.stiffness),
    }
    if found.driven:
        pairs["armature"] = (drafted.armature, found.armature)
    if found.stiffness:
        pairs["springref"] = (drafted.rest / unit, rest / unit)
    return {key: figure(new) for key, (old, new) in pairs.items() if not same(old, new)}


def _set_inertial(marked: Marked, tag: Tag, body: Placed) -> None:
    six = [body.inertia[at] for at in PAIRS]
    small = 1e-12 * max(map(abs, six))
    full = any(abs(value) > small for value in six[3:])
    shape = {"fullinertia" if full else "diaginertia": figures(six if full else six[:3])}
    values: dict[str, str | None] = {"pos": figures(body.centre), "mass": figure(body.mass), **shape}
    inertial = tag.child("inertial")
    if inertial is None:
        if any(True for frame in tag.all("frame") for _ in frame.all("inertial")):
            raise InputError(
                f"{marked.source}: the <inertial> of body '{body.name}' stands in a <frame>; take it out."
            )
        marked.add(tag, f"<inertial {' '.join(f'{k}={chr(34)}{v}{chr(34)}' for k, v in values.items())}/>")
        return
    other = "diaginertia" if full else "fullinertia"
    gone = {key: None for key in (other, *ORIENTATIONS) if key in inertial.attributes}
    marked.set(inertial, **{**gone, **values})


def _gain(marked: Marked, joint: str, gain: float) -> bool:
    """Whether the only actuator of a joint is a motor whose gear can be scaled."""
    sections = list(marked.root.all("actuator"))
    found = [tag for part in sections for tag in part.children if tag.attributes.get("joint") == joint]
    plain = ("motor", "general")
    if len(found) != 1 or found[0].name not in plain or "class" in found[0].attributes:
        return False
    if found[0].name == "general" and found[0].attributes.get("biastype", "none") != "none":
        return False
    if any(child.name in plain for default in marked.root.all("default") for child in default.children):
        return False
    gears = list(map(float, found[0].attributes.get("gear", "1").split()))
    marked.set(found[0], gear=figures([gain * gears[0], *gears[1:]]))
    return True


def _set_gravity(marked: Marked, gravity: np.ndarray) -> None:
    option = marked.root.child("option")
    if option is None:
        marked.add(marked.root, f'<option gravity="{figures(gravity)}"/>')
    else:
        marked.set(option, gravity=figures(gravity))
