"""From a file of another format to a robot: reading, merging, naming, overlay, checks."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Set
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from robot_model.description.types import Robot
from robot_model.formats.overlay import Overlay, laid_over
from robot_model.formats.parts.describe import STANDARD_GRAVITY, described, inertia_list
from robot_model.formats.parts.draft import Draft, DraftLink
from robot_model.formats.parts.markup import Element, parse_markup
from robot_model.formats.parts.names import Names, legal, names_of
from robot_model.formats.parts.notes import listed
from robot_model.formats.parts.sources import bytes_of, stem_of
from robot_model.formats.parts.trees import merged
from robot_model.input.complaint import complaint
from robot_model.input.errors import InputError, nearest

__all__ = ["Imported", "as_overlaid", "has_macros", "import_robot", "reader_of"]

UNGRAVE = (
    f"no gravity is given, so {list(STANDARD_GRAVITY)} m/s^2 is assumed; write gravity into an overlay for a "
    "robot that is mounted in another orientation, or is in space"
)
GROUNDED = (
    'link {} is assumed to be fixed to the ground; kind = "free" under [base] in an overlay lets it float'
)


@dataclass(frozen=True)
class Imported:
    """A robot, and notes on how it was read."""

    robot: Robot
    notes: tuple[str, ...]


def import_robot(path: Path, overlay: Overlay | None = None) -> Imported:
    """The robot of a URDF or MJCF file, with an overlay put over it.

    Raises:
        InputError: the file or the overlay cannot be used.
    """
    overlay = overlay or Overlay("", {})
    draft = _read(path, overlay)
    draft = as_overlaid(draft, overlay)
    whole = draft
    draft = merged(draft)
    names = names_of(draft)
    _check_names(whole, names, overlay, str(path))
    data = laid_over({"name": _name(draft, path), **described(draft, names)}, _translated(overlay, names))
    _check_masses(draft, names, overlay)
    _put_behind_gears(draft, names, data, overlay)
    _assumed(whole, overlay)
    file = f"{path} with {overlay.file}" if overlay.file else str(path)
    try:
        robot = Robot.model_validate(data)
    except ValidationError as error:
        raise InputError(f"{file}: {complaint(error, data, Robot)}.") from None
    dropped = [key for key, value in overlay.tables.items() if value == []]
    return Imported(robot, draft.notes.sentences(dropped=dropped))


def _read(path: Path, overlay: Overlay) -> Draft:
    root = parse_markup(bytes_of(path), str(path))
    arguments = overlay.tables.get("xacro", {})
    if has_macros(root, path):
        from robot_model.formats.xacro import expanded

        root = expanded(path, arguments)
    elif arguments:
        raise InputError(f"{overlay.file}: xacro: {path} has no macros, so that it takes no arguments.")
    return reader_of(root)(root, path)


def has_macros(root: Element, path: Path) -> bool:
    """Whether a document is written in xacro."""
    if path.suffix.lower() == ".xacro":
        return True
    waiting = [root]
    for element in waiting:  # the list grows during the loop
        if element.tag.startswith("xacro:"):
            return True
        waiting += element.children
    return False


def reader_of(root: Element) -> Callable[[Element, Path], Draft]:
    """The reader of a document, by its root element."""
    if root.tag == "robot":
        from robot_model.formats.urdf import read_urdf

        return lambda element, _: read_urdf(element)
    if root.tag == "mujoco":
        from robot_model.formats.mjcf import read_mjcf

        return read_mjcf
    if root.tag == "sdf":
        raise InputError(f"{root.file} is an SDF file, which is not read; convert it to URDF or MJCF.")
    raise InputError(
        f"{root.file}: its root element is <{root.tag}>; <robot> begins a URDF and <mujoco> an MJCF file."
    )


def _name(draft: Draft, path: Path) -> str:
    return legal(draft.name) or legal(stem_of(path)) or "robot"


def as_overlaid(draft: Draft, overlay: Overlay) -> Draft:
    """The draft with an overlay's changes of its tree: held joints, passive joints, the kind of base."""
    joints = []
    for joint in draft.joints:
        change = overlay.entry("joints", joint.name, legal(joint.name))
        if change.get("kind") == "fixed" and joint.kind != "fixed":
            joint = joint.locked(_held_at(joint.name, change, joint.initial, overlay))
        joints.append(joint)
    base = overlay.tables.get("base", {}).get("kind", draft.base)
    return replace(draft, joints=tuple(joints), base="free" if base == "free" else "fixed")


def _held_at(name: str, change: Mapping[str, Any], initial: float, overlay: Overlay) -> float:
    """Position of a joint that an overlay makes a fixed one."""
    position = change.get("initial_position", initial)
    if isinstance(position, bool) or not isinstance(position, int | float) or abs(position) > 1e18:
        raise InputError(f"{overlay.file}: joints[{name}].initial_position: must be a number.")
    if extra := sorted(change.keys() - {"name", "kind", "initial_position", "passive"}):
        raise InputError(
            f"{overlay.file}: joints[{name}].{extra[0]}: does not apply to a fixed joint; remove it."
        )
    return float(position)


def _check_names(whole: Draft, names: Names, overlay: Overlay, file: str) -> None:
    """Every name in an overlay must be that of a remaining part; raises `InputError`."""
    held = {j.name for j in whole.joints} - names.joints.keys()
    for entry in overlay.tables.get("joints", ()):
        name = entry["name"]
        known = {*names.joints, *names.joints.values()}
        if name in known or (entry.get("kind") == "fixed" and name in held):
            continue
        if name in held:
            raise InputError(f"{overlay.file}: joints: '{name}' does not move in {file}; remove it.")
        raise InputError(f"{overlay.file}: joints: '{name}' is no joint of {file}{nearest(name, known)}.")
    fixed = {link.name for link in whole.links} - names.links.keys()
    for entry in overlay.tables.get("links", ()):
        name = entry["name"]
        known = {old for old in names.links if old != whole.root} | set(names.links.values()) - {"base"}
        if name in known:
            continue
        if name == whole.root or name == "base":
            raise InputError(f"{overlay.file}: links: '{name}' is the robot's base; write [base] instead.")
        if name in fixed:
            raise InputError(
                f"{overlay.file}: links: '{name}' is fixed to another link of {file} and is part of it; the "
                f"moving links are {listed(sorted(known))}."
            )
        raise InputError(f"{overlay.file}: links: '{name}' is no link of {file}{nearest(name, known)}.")


def _translated(overlay: Overlay, names: Names) -> Overlay:
    """The overlay with the robot's names instead of the file's, without the changes already applied."""
    tables = {key: value for key, value in overlay.tables.items() if key != "xacro"}
    moving = set(names.joints.values())
    for key, known in (("joints", names.joints), ("links", names.links)):
        entries = [{**e, "name": known.get(e["name"], e["name"])} for e in overlay.tables.get(key, ())]
        if key == "joints":  # held joints have been removed
            entries = [entry for entry in entries if entry["name"] in moving]
        if entries:
            tables[key] = entries
        else:
            tables.pop(key, None)
    return replace(overlay, tables=tables)


def _check_masses(draft: Draft, names: Names, overlay: Overlay) -> None:
    """Refuse missing masses and impossible inertias, unless an overlay replaces them."""
    given = {link.name: _given(link, draft, names, overlay) for link in draft.links}
    gaps = [link for link in draft.links if link.gap and "mass" not in given[link.name]]
    if gaps:
        others = f" (nor is that of {listed(f'{link.name!r}' for link in gaps[1:])})" if gaps[1:] else ""
        raise InputError(
            f"{gaps[0].gap}, so that its mass is not known{others}; add it to the file, or write mass, "
            "center_of_mass and inertia, or mass = 0.0 where it weighs nothing, into an overlay under "
            f"{_table(gaps[0], draft, names)}."
        )
    faulty = [link for link in draft.links if link.fault and "inertia" not in given[link.name]]
    if faulty:
        raise InputError(f"{faulty[0].fault}; {_remedy(faulty, draft, names)}.")


def _given(link: DraftLink, draft: Draft, names: Names, overlay: Overlay) -> Set[str]:
    """The keys of a link's mass properties that an overlay gives; those of a fixed base do not matter."""
    if link.name != draft.root:
        return overlay.entry("links", link.name, names.links[link.name]).keys()
    return overlay.tables.get("base", {}).keys() if draft.base == "free" else {"mass", "inertia"}


def _remedy(faulty: list[DraftLink], draft: Draft, names: Names) -> str:
    """The nearest possible moments of inertia of all links that have impossible ones."""
    nearest_ones = [
        f"inertia = [{', '.join(f'{x:.6g}' for x in inertia_list(link.corrected.inertia))}] under "
        f"{_table(link, draft, names)}"
        for link in faulty
        if link.corrected is not None
    ]
    return "correct the file, or write the nearest that a body can have into an overlay: " + "; ".join(
        nearest_ones
    )


def _table(link: DraftLink, draft: Draft, names: Names) -> str:
    if link.name == draft.root:
        return "[base]"
    return f'[[links]] name = "{names.links[link.name]}"'


def _put_behind_gears(draft: Draft, names: Names, data: Mapping[str, Any], overlay: Overlay) -> None:
    """Armature is a joint-side inertia; with a gear of the overlay it becomes a faster rotor."""
    tables = {table["name"]: table for table in data["joints"]}
    for joint in draft.joints:
        given = overlay.entry("joints", joint.name, names.joints[joint.name]).get("actuator", {})
        ratio = given.get("gear_ratio") if isinstance(given, dict) and "rotor_inertia" not in given else None
        actuator = tables[names.joints[joint.name]].get("actuator")
        if joint.armature and actuator is not None and isinstance(ratio, int | float) and ratio > 0:
            actuator["rotor_inertia"] = joint.armature / ratio**2


def _assumed(draft: Draft, overlay: Overlay) -> None:
    """Add notes on values that neither the file nor the overlay gives."""
    if draft.gravity is not None:
        return
    if "gravity" not in overlay.tables:
        draft.notes.add(UNGRAVE)
    root = next(link for link in draft.links if link.name == draft.root)
    if draft.base == "fixed" and root.mass is not None and not overlay.has("base", "kind"):
        draft.notes.add(GROUNDED, f"'{draft.root}'")
