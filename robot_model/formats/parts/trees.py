"""Trees of links: checks, and merging of links that are fixed to each other."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence, Sized
from dataclasses import replace
from functools import reduce
from operator import add

from robot_model.description.types import MOST_BODIES
from robot_model.formats.parts.draft import Draft, DraftJoint, DraftLink
from robot_model.formats.parts.mass import Mass
from robot_model.formats.parts.notes import Notes, listed
from robot_model.formats.parts.poses import IDENTITY, Pose
from robot_model.input.errors import InputError
from robot_model.input.fields import inertia_fault

__all__ = ["check_count", "merged", "one_root"]

#: Largest number of links before merging: twenty for each body that a robot may have.
MOST_LINKS = 20 * MOST_BODIES

HARMLESS = (
    "no body can have the inertia of {} alone; that of the rigid link of which it is a part is possible"
)


def check_count(links: Sized, file: str) -> None:
    """Raises `InputError` where there are too many links for a robot, before any work on them."""
    if len(links) > MOST_LINKS:
        raise InputError(
            f"{file} has {len(links)} links; a robot may have {MOST_BODIES} that move, and {MOST_LINKS} "
            "in all."
        )


def one_root(links: Sequence[DraftLink], joints: Sequence[DraftJoint], file: str) -> str:
    """The root link. Raises `InputError` where the links form no tree."""
    carried = Counter(joint.child for joint in joints)
    for joint in joints:
        if carried[joint.child] > 1:
            carriers = [other.name for other in joints if other.child == joint.child]
            raise InputError(
                f"{joint.where}: link '{joint.child}' is the child of several joints, {listed(carriers)}; "
                "closed loops cannot be described: keep one of the joints."
            )
    roots = [link.name for link in links if not carried[link.name]]
    if len(roots) > 1:
        raise InputError(
            f"{file}: links {listed(roots)} all hang on nothing, but a robot has one root; connect them by "
            'joints of type="fixed", or remove what is no part of the robot.'
        )
    reached = {joint.name for root in roots for joint in _outwards(root, joints)}
    if astray := [joint.name for joint in joints if joint.name not in reached]:
        raise InputError(f"{file}: the joints {listed(astray)} form a circle that hangs on no root link.")
    return roots[0]


def _outwards(root: str, joints: Sequence[DraftJoint]) -> Iterator[DraftJoint]:
    """The joints connected to the root, each after the one that carries its parent."""
    hanging: dict[str, list[DraftJoint]] = {}
    for joint in joints:
        hanging.setdefault(joint.parent, []).append(joint)
    reached = [root]
    for link in reached:  # the list grows during the loop
        for joint in hanging.get(link, ()):
            reached.append(joint.child)
            yield joint


def merged(draft: Draft) -> Draft:
    """The robot with links merged that are fixed to each other, so that only moving joints remain.

    The mass of a group of links is unknown where that of a member is, except for pure frames, or where none
    of them has any.
    """
    anchors: dict[str, tuple[str, Pose]] = {draft.root: (draft.root, IDENTITY)}
    moving: dict[str, DraftJoint] = {}
    for joint in _outwards(draft.root, draft.joints):
        anchor, pose = anchors[joint.parent]
        placed = replace(joint, parent=anchor, pose=pose @ joint.pose)
        if joint.kind == "fixed":
            anchors[joint.child] = (anchor, placed.pose)
        else:
            anchors[joint.child] = (joint.child, IDENTITY)
            moving[joint.name] = placed
    groups: dict[str, list[tuple[DraftLink, Pose]]] = {}
    for link in draft.links:
        anchor, pose = anchors[link.name]
        groups.setdefault(anchor, []).append((link, pose))
    links = [_joined(link, groups[link.name], draft.notes) for link in draft.links if link.name in groups]
    joints = [moving[joint.name] for joint in draft.joints if joint.name in moving]
    return replace(draft, links=tuple(links), joints=tuple(joints))


def _joined(anchor: DraftLink, members: Sequence[tuple[DraftLink, Pose]], notes: Notes) -> DraftLink:
    """One link of a link and those fixed to it.

    A member with impossible moments of inertia is accepted where those of the group are possible.
    """
    plain = [_seen(link.mass, pose) for link, pose in members if link.mass is not None]
    best = [_seen(link.best, pose) for link, pose in members if link.best is not None]
    gaps = [link.gap for link, _ in members if link.gap and not (link.marker and plain)]
    mass = reduce(add, plain) if plain else None
    faulty = [link for link, _ in members if link.fault]
    if faulty and mass is not None and not inertia_fault(mass.inertia):
        notes.add(HARMLESS, *(f"'{link.name}'" for link in faulty))
        faulty = []
    return replace(
        anchor,
        mass=mass,
        gap=gaps[0] if gaps else "",
        fault=faulty[0].fault if faulty else "",
        corrected=reduce(add, best) if faulty else None,
    )


def _seen(mass: Mass, pose: Pose) -> Mass:
    return mass if pose is IDENTITY else mass.seen_from(pose)
