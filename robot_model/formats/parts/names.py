"""Valid names of links and joints for channels, effects and files."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass

from robot_model.formats.parts.draft import Draft

__all__ = ["Names", "legal", "names_of"]

#: Largest length of a name.
LONGEST = 64

SHARED = (
    "{}: a joint has the same name, and channels are named after both, so that the link is called by it with "
    "_link at the end"
)
CHANGED = "renamed, since names hold only letters, digits, - and _: {}"


@dataclass(frozen=True)
class Names:
    """Names in the file to names in the robot, of joints, links and motors; the root link is ``base``."""

    joints: Mapping[str, str]
    links: Mapping[str, str]
    motors: Mapping[str, str]


def legal(word: str) -> str:
    """The word with invalid characters replaced by ``_``; empty where nothing remains."""
    return re.sub(r"[^A-Za-z0-9_-]", "_", word).lstrip("-")[:LONGEST]


def names_of(draft: Draft) -> Names:
    """Names for all joints and links of a robot; changes are noted.

    Joints come first: recordings name their channels by them.
    """
    taken = {"base"}
    joints = {joint.name: _free(joint.name, "joint", taken) for joint in draft.joints}
    links = {draft.root: "base"}
    theirs = set(joints.values())
    for link in draft.links:
        if link.name != draft.root:
            shared = link.name in theirs or link.name == "base"
            wanted = f"{link.name}_link" if shared else link.name
            links[link.name] = _free(wanted, "link", taken)
            if shared:
                draft.notes.add(SHARED, f"link '{link.name}'")
    motors = {
        motor.name: _free(f"{motor.name}_motor" if legal(motor.name) in taken else motor.name, "motor", taken)
        for one in draft.transmissions
        for motor in one.motors
    }
    for found in (joints, links):
        for old, new in found.items():
            if new != old and new not in ("base", f"{old}_link"):
                draft.notes.add(CHANGED, f"'{old}' is called '{new}'")
    return Names(joints, links, motors)


def _free(word: str, otherwise: str, taken: set[str]) -> str:
    """A new unique name like `word`, marked as taken."""
    name = stem = legal(word) or otherwise
    count = 1
    while name in taken:
        count += 1
        name = f"{stem[: LONGEST - 1 - len(str(count))]}_{count}"
    taken.add(name)
    return name
