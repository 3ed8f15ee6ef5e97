"""The user's own URDF or MJCF file with the findings: numbers changed in place, everything else kept."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from missing_physics.export.content import Content
from missing_physics.export.figures import figure
from missing_physics.export.own_file.mjcf import edit_mjcf
from missing_physics.export.own_file.urdf import edit_urdf
from robot_model import InputError
from robot_model.editing import Marked, source_of

__all__ = ["Edited", "edited_file"]


@dataclass(frozen=True)
class Edited:
    """A file with the findings.

    Attributes:
        kind: ``urdf`` or ``mjcf``.
        text: of the file.
        changed: the changes, a phrase each.
        unsaid: findings that the format cannot hold, a clause each.
    """

    kind: str
    text: bytes
    changed: tuple[str, ...]
    unsaid: tuple[str, ...]


def edited_file(content: Content, path: Path, *, overlay: Path | None = None) -> Edited:
    """The file from which a robot was read, with the present parameters of that robot.

    Args:
        content: of the robot with the findings.
        path: of the file, which is not changed.
        overlay: the one that was applied to it.

    Raises:
        InputError: no URDF or MJCF file, or not that of this robot; a part that stands in another file; a
            mass that no body could have.
    """
    source = source_of(path, overlay=overlay)
    lacking = sorted(content.joints.keys() - source.joints.keys())
    if lacking:
        raise InputError(
            f"{path} has no joint '{lacking[0]}' that robot '{content.robot.name}' has; give the file that "
            "was diagnosed, with its overlay."
        )
    marked = Marked(source.content, str(path))
    edit = edit_urdf if source.kind == "urdf" else edit_mjcf
    changed, unsaid = edit(content, source, marked)
    return Edited(source.kind, marked.text(), tuple(changed), (*unsaid, *_of_motors(content)))


def _of_motors(content: Content) -> Iterator[str]:
    """Parameters of motors of transmissions, which are in an overlay and not in the file."""
    for name, motor in content.motors.items():
        for key in ("damping", "frictionloss", "stiffness", "offset"):
            if value := getattr(motor, key):
                yield f"{key} of {name}: {figure(value)}"
