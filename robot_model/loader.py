"""Reading and writing robot files (TOML), with errors a person can act on."""

from __future__ import annotations

import os
import tomllib
from importlib import resources
from pathlib import Path
from typing import Any

import tomli_w
from pydantic import BaseModel, ValidationError

from robot_model.complaint import complaint
from robot_model.errors import InputError, nearest
from robot_model.files import write_atomically
from robot_model.types import Link, Robot

__all__ = ["load_robot", "robot_from_toml", "robot_to_toml", "save_robot", "shipped_robots"]

#: A robot with a million-row reference table stays below this [bytes].
LARGEST_FILE = 16 * 2**20


def shipped_robots() -> tuple[str, ...]:
    """Names of the robots that come with the package."""
    folder = resources.files("robot_model").joinpath("library")
    return tuple(sorted(item.name[:-5] for item in folder.iterdir() if item.name.endswith(".toml")))


def load_robot(robot: str | os.PathLike[str]) -> Robot:
    """The robot of a TOML file, or a shipped robot by its name.

    Raises:
        InputError: no such file or name, not TOML, an unknown key, a value out of range, a file that it
            names is missing.
    """
    path = Path(robot)
    if not _exists(path) and str(robot) in shipped_robots():
        text = resources.files("robot_model").joinpath("library", f"{robot}.toml").read_text("utf-8")
        return robot_from_toml(text, source=str(robot))
    if not _exists(path) or not path.is_file():
        raise InputError(f"{robot} {_what_it_is(path)}{_suggestion(path)}.")
    found = robot_from_toml(_text(path), source=str(robot))
    links = tuple(_beside(link, path) for link in found.links)
    return found.model_copy(update={"links": links}) if links != found.links else found


def _beside(link: Link, robot: Path) -> Link:
    """The link with the file it names looked for beside the robot's own, wherever the robot is saved to."""
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
    except (OSError, ValueError):  # a name that the system does not take names nothing
        return False


def _what_it_is(path: Path) -> str:
    if not _exists(path):
        return "is neither a file nor a shipped robot"
    return "is a folder, not a robot file" if path.is_dir() else "is no ordinary file"


def _suggestion(path: Path) -> str:
    """A file beside it of nearly that name, or a shipped robot of nearly that name."""
    beside = [other.name for other in _files_in(path.parent) if other.suffix == ".toml"]
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


def _text(path: Path) -> str:
    try:
        size = path.stat().st_size
        if size > LARGEST_FILE:
            raise InputError(
                f"{path} has {size / 2**20:.0f} MiB, which is no robot file; one may have "
                f"{LARGEST_FILE / 2**20:.0f} MiB."
            )
        return path.read_text("utf-8-sig")  # some editors begin a file with a byte order mark
    except UnicodeDecodeError as error:
        raise InputError(
            f"{path} is not a text file: byte {error.start} is not UTF-8; save it as UTF-8."
        ) from None
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror or error}.") from None


def robot_from_toml(text: str, *, source: str = "robot") -> Robot:
    """The robot described by TOML text; `source` names it in errors. Raises `InputError`."""
    try:
        data = tomllib.loads(text)
    except RecursionError:
        raise InputError(f"{source} is not a robot: its lists or tables are nested too deeply.") from None
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{source} is not valid TOML: {error}.") from None
    except ValueError:  # Python refuses to convert it
        raise InputError(f"{source} is not a robot: it holds a number of thousands of digits.") from None
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
