"""A URDF changed in place: inertial figures, damping and dry friction."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from missing_physics.export.content import Content, JointNumbers
from missing_physics.export.figures import figure, figures
from missing_physics.export.own_file.masses import Placed, changed_bodies, same
from missing_physics.export.urdf import unsaid
from robot_model.editing import Marked, Source, Tag
from robot_model.formats.parts.poses import from_quaternion, from_rpy

__all__ = ["edit_urdf"]

SIX = {"ixx": (0, 0), "ixy": (0, 1), "ixz": (0, 2), "iyy": (1, 1), "iyz": (1, 2), "izz": (2, 2)}


def edit_urdf(content: Content, source: Source, marked: Marked) -> tuple[list[str], list[str]]:
    """The changes, and the findings that a URDF cannot hold."""
    changed = []
    links = {tag.attributes.get("name", "").strip(): tag for tag in marked.root.all("link")}
    for body in changed_bodies(content, source):
        _set_inertial(marked, links[body.name], body)
        changed.append(f"inertial of link '{body.name}'")
    joints = {tag.attributes.get("name", "").strip(): tag for tag in marked.root.all("joint")}
    for name, found in content.joints.items():
        drafted = source.joints[name]
        pairs = {
            "damping": (drafted.damping, found.damping),
            "friction": (drafted.friction, found.frictionloss),
        }
        new = {key: figure(value) for key, (old, value) in pairs.items() if not same(old, value)}
        if new:
            _set_dynamics(marked, joints[drafted.name], new, found)
            changed.append(f"{' and '.join(new)} of joint '{drafted.name}'")
    return changed, list(unsaid(content))


def _set_dynamics(marked: Marked, joint: Tag, new: Mapping[str, str], found: JointNumbers) -> None:
    there = joint.child("dynamics")
    if there is not None:
        marked.set(there, **new)
    else:
        marked.add(
            joint, f'<dynamics damping="{figure(found.damping)}" friction="{figure(found.frictionloss)}"/>'
        )


def _set_inertial(marked: Marked, link: Tag, body: Placed) -> None:
    inertial = link.child("inertial")
    if inertial is None:
        six = " ".join(f'{key}="{figure(body.inertia[at])}"' for key, at in SIX.items())
        marked.add(
            link,
            f'<inertial><origin xyz="{figures(body.centre)}"/><mass value="{figure(body.mass)}"/>'
            f"<inertia {six}/></inertial>",
        )
        return
    origin, mass, inertia = (inertial.child(name) for name in ("origin", "mass", "inertia"))
    turned = np.eye(3)
    if origin is not None:
        turned = _rotation(origin.attributes)
        marked.set(origin, xyz=figures(body.centre))
    elif body.centre.any():
        marked.add(inertial, f'<origin xyz="{figures(body.centre)}"/>')
    if mass is not None:
        marked.set(mass, value=figure(body.mass))
    seen = turned.T @ body.inertia @ turned
    shape = {key: figure(_clean(seen, at)) for key, at in SIX.items()}
    if inertia is not None:
        marked.set(inertia, **shape)
    else:
        marked.add(
            inertial, f"<inertia {' '.join(f'{key}={chr(34)}{v}{chr(34)}' for key, v in shape.items())}/>"
        )


def _rotation(attributes: Mapping[str, str]) -> np.ndarray:
    if "quat_xyzw" in attributes:
        x, y, z, w = map(float, attributes["quat_xyzw"].split())
        return np.asarray(from_quaternion((w, x, y, z)))
    return np.asarray(from_rpy(np.array(list(map(float, attributes.get("rpy", "0 0 0").split())))))


def _clean(matrix: np.ndarray, at: tuple[int, int]) -> float:
    """An entry, 0 where it is rounding."""
    return 0.0 if abs(matrix[at]) < 1e-14 * float(np.abs(matrix).max()) else float(matrix[at])
