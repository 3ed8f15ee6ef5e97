"""Reading and writing robot files (TOML), with actionable errors."""

from __future__ import annotations

import os
import warnings
from collections.abc import Mapping
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Any

import tomli_w
from pydantic import BaseModel, ValidationError

from robot_model.description.types import Link, Robot
from robot_model.formats.overlay import laid_over, read_overlay
from robot_model.formats.parts.sources import MARKUP, is_markup, stem_of
from robot_model.input.complaint import complaint
from robot_model.input.errors import InputError, nearest, one_sentence
from robot_model.input.toml import toml_tables, toml_text
from robot_model.system.files import write_atomically

__all__ = ["load_robot", "read_robot", "robot_from_toml", "robot_to_toml", "save_robot", "shipped_robots"]


def shipped_robots() -> tuple[str, ...]:
    """Names of the robots that come with the package."""
    folder = resources.files("robot_model").joinpath("library")
    return tuple(sorted(item.name[:-5] for item in folder.iterdir() if item.name.endswith(".toml")))


def load_robot(robot: str | os.PathLike[str], *, overlay: str | os.PathLike[str] | None = None) -> Robot:
    """The robot of a file (TOML, URDF, xacro or MJCF), or a shipped robot by its name.

    Notes on how a file of another format was read are raised as warnings; `read_robot` returns them instead.

    Args:
        robot: file or name.
        overlay: TOML file with keys of a robot file that are applied to it; default is ``NAME.overlay.toml``
            next to a URDF, xacro or MJCF file, if it exists.

    Raises:
        InputError: no such file or name, wrong format, an unknown key, a value out of range, or a missing
            file that it names.
    """
    found, notes = read_robot(robot, overlay=overlay)
    for note in notes:
        warnings.warn(note, stacklevel=2)
    return found


def read_robot(
    robot: str | os.PathLike[str], *, overlay: str | os.PathLike[str] | None = None
) -> tuple[Robot, tuple[str, ...]]:
    """Like `load_robot`, with notes on how the file was read."""
    path = Path(robot)
    if not _exists(path) and str(robot) in shipped_robots():
        text = resources.files("robot_model").joinpath("library", f"{robot}.toml").read_text("utf-8")
        if overlay is None:
            return _shipped(text, str(robot)), ()
        return _from_toml(text, str(robot), overlay), ()
    if not _exists(path) or not path.is_file():
        if "://" in str(robot):
            raise InputError(
                f"{robot} is an address, and robots are read from files; give the path of {path.name} on "
                "this machine."
            )
        raise InputError(f"{robot} {_what_it_is(path)}{_suggestion(path)}.")
    if is_markup(path):
        found, notes = _imported(path, overlay)
    else:
        found, notes = _from_toml(toml_text(path, "robot"), str(robot), overlay), ()
    links = tuple(_beside(link, path) for link in found.links)
    return (found.model_copy(update={"links": links}) if links != found.links else found), notes


@cache
def _shipped(text: str, name: str) -> Robot:
    """The robot of a file of the package, which is immutable, and is read and checked once."""
    return robot_from_toml(text, source=name)


def _imported(path: Path, overlay: str | os.PathLike[str] | None) -> tuple[Robot, tuple[str, ...]]:
    """A robot of another format, with the given overlay or the one next to it."""
    from robot_model.formats.importing import import_robot  # XML is read only where it is needed

    beside = path.with_name(f"{stem_of(path)}.overlay.toml")
    if overlay is not None or not beside.is_file():
        found = import_robot(path, None if overlay is None else read_overlay(Path(overlay)))
        return found.robot, found.notes
    found = import_robot(path, read_overlay(beside))
    return found.robot, (one_sentence(f"{beside.name} beside it is put over it"), *found.notes)


def _from_toml(text: str, source: str, overlay: str | os.PathLike[str] | None) -> Robot:
    """The robot of TOML text, which must be complete by itself, with an overlay applied."""
    robot = robot_from_toml(text, source=source)
    if overlay is None:
        return robot
    change = read_overlay(Path(overlay))
    tables = toml_tables(text, source=source, what="robot")
    return _validated(laid_over(tables, change), f"{source} with {change.file}")


def _beside(link: Link, robot: Path) -> Link:
    """The link with the absolute path of its file, which is relative to the robot file."""
    if link.modal is None:
        return link
    file = robot.parent / link.modal.file
    if not _exists(file) or not file.is_file():
        beside = [other.name for other in _files_in(file.parent) if other.suffix == ".npz"]
        raise InputError(
            f"{robot}: links[{link.name}].modal.file: '{link.modal.file}' is no file beside it"
            f"{nearest(file.name, beside)}."
        )
    return link.model_copy(update={"modal": link.modal.model_copy(update={"file": str(file.absolute())})})


def _exists(path: Path) -> bool:
    try:
        return path.exists()
    except (OSError, ValueError):  # an invalid name names no file
        return False


def _what_it_is(path: Path) -> str:
    if not _exists(path):
        return "is neither a file nor a shipped robot"
    return "is a folder, not a robot file" if path.is_dir() else "is no ordinary file"


def _suggestion(path: Path) -> str:
    """A file next to it, or a shipped robot, with a similar name."""
    beside = [other.name for other in _files_in(path.parent) if other.suffix in (".toml", *MARKUP)]
    shipped = shipped_robots()
    if near := nearest(path.name, [*beside, *shipped]):
        # Names are compared without their folders, which may be long, and shown with them.
        for name in beside:
            near = near.replace(f"'{name}'", f"'{path.parent / name}'")
        return near
    return f"; the shipped robots are {', '.join(shipped)}"


def _files_in(folder: Path) -> list[Path]:
    try:
        return list(folder.iterdir())
    except (OSError, ValueError):
        return []


def robot_from_toml(text: str, *, source: str = "robot") -> Robot:
    """The robot described by TOML text; `source` names it in errors. Raises `InputError`."""
    data = toml_tables(text, source=source, what="robot")
    return _validated(data, source)


def _validated(data: Mapping[str, Any], source: str) -> Robot:
    try:
        return Robot.model_validate(data)
    except ValidationError as error:
        raise InputError(f"{source}: {complaint(error, data, Robot)}.") from None


def robot_to_toml(robot: Robot) -> str:
    """TOML text from which `robot_from_toml` makes an equal robot."""
    return tomli_w.dumps(_plain(robot.model_dump(mode="json", exclude_defaults=True), robot))


def save_robot(robot: Robot, path: str | os.PathLike[str]) -> None:
    """Write `robot` to `path`, whole or not at all."""
    write_atomically(path, robot_to_toml(robot))


def _plain(data: Any, model: Any) -> Any:
    """Drop nulls and restore the discriminators that `exclude_defaults` leaves out."""
    if isinstance(data, dict):
        kept = {key: _plain(value, getattr(model, key, None)) for key, value in data.items()}
        kept = {key: value for key, value in kept.items() if value is not None}
        fields = type(model).model_fields if isinstance(model, BaseModel) else {}
        return {"kind": model.kind, **kept} if "kind" in fields else kept
    if isinstance(data, list):
        models = model if isinstance(model, tuple) else (None,) * len(data)
        return [_plain(item, part) for item, part in zip(data, models)]
    return data
