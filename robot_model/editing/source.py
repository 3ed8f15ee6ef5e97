"""Locations of an imported robot's parameters in its file, for programs that edit it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from robot_model.formats.importing import as_overlaid, has_macros, reader_of
from robot_model.formats.mjcf.included import with_includes
from robot_model.formats.mjcf.settings import Settings, read_settings
from robot_model.formats.overlay import read_overlay
from robot_model.formats.parts.draft import Draft, DraftJoint, DraftLink
from robot_model.formats.parts.markup import Element, parse_markup
from robot_model.formats.parts.names import names_of
from robot_model.formats.parts.notes import Notes
from robot_model.formats.parts.sources import bytes_of
from robot_model.formats.parts.trees import merged
from robot_model.input.errors import InputError

__all__ = ["Source", "source_of"]


@dataclass(frozen=True)
class Source:
    """A URDF or MJCF file, and the correspondence of its parts to those of a robot.

    Attributes:
        kind: of the file.
        content: of the file.
        draft: its parts, before an overlay fixes links to one another.
        joints: moving joints of the robot by their names there.
        links: by their names in the robot, the link of the file that moves, as in the file.
        groups: the same with all links fixed to it.
        settings: of an MJCF file.
    """

    kind: Literal["urdf", "mjcf"]
    content: bytes
    draft: Draft
    joints: Mapping[str, DraftJoint]
    links: Mapping[str, DraftLink]
    groups: Mapping[str, DraftLink]
    settings: Settings


def source_of(path: Path, *, overlay: Path | None = None) -> Source:
    """The parts of a URDF or MJCF file by the names of the robot that `read_robot` makes of it.

    Args:
        path: of the file; xacro is none, since macros have no numbers of their own.
        overlay: as for `read_robot`.

    Raises:
        InputError: the file or the overlay cannot be used.
    """
    content = bytes_of(path)
    root = parse_markup(content, str(path))
    if has_macros(root, path):
        raise InputError(
            f"{path} is written in xacro, whose numbers are made by macros; expand it to a URDF."
        )
    beside = path.with_name(f"{path.stem}.overlay.toml")
    change = overlay or (beside if beside.is_file() else None)
    draft = reader_of(root)(root, path)
    if change is not None:
        draft = as_overlaid(draft, read_overlay(change))
    whole = merged(draft)
    names = names_of(whole)
    own = {link.name: link for link in draft.links}
    return Source(
        "urdf" if root.tag == "robot" else "mjcf",
        content,
        draft,
        {names.joints[joint.name]: joint for joint in whole.joints},
        {names.links[link.name]: own[link.name] for link in whole.links},
        {names.links[link.name]: link for link in whole.links},
        _settings(root, path),
    )


def _settings(root: Element, path: Path) -> Settings:
    return Settings() if root.tag == "robot" else read_settings(with_includes(root, path), Notes())
