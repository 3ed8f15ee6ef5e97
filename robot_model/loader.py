"""Reading and writing robot files (TOML), with errors a person can act on."""

from __future__ import annotations

import os
import tomllib
from importlib import resources
from pathlib import Path
from typing import Any

import tomli_w
from pydantic import BaseModel, ValidationError

from robot_model.errors import InputError, nearest
from robot_model.files import write_atomically
from robot_model.types import Robot

__all__ = ["load_robot", "robot_from_toml", "robot_to_toml", "save_robot", "shipped_robots"]


def shipped_robots() -> tuple[str, ...]:
    """Names of the robots that come with the package."""
    folder = resources.files("robot_model").joinpath("library")
    return tuple(sorted(item.name[:-5] for item in folder.iterdir() if item.name.endswith(".toml")))


def load_robot(robot: str | os.PathLike[str]) -> Robot:
    """The robot of a TOML file, or a shipped robot by its name.

    Raises:
        InputError: no such file or name, not TOML, an unknown key, a value out of range.
    """
    path = Path(robot)
    if not path.exists() and str(robot) in shipped_robots():
        text = resources.files("robot_model").joinpath("library", f"{robot}.toml").read_text("utf-8")
        return robot_from_toml(text, source=str(robot))
    if not path.is_file():
        kind = "is a folder, not a robot file" if path.is_dir() else "is neither a file nor a shipped robot"
        raise InputError(f"{robot} {kind}{nearest(str(robot), shipped_robots())}.")
    try:
        text = path.read_text("utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{robot} cannot be read as text ({error}).") from None
    return robot_from_toml(text, source=str(robot))


def robot_from_toml(text: str, *, source: str = "robot") -> Robot:
    """The robot described by TOML text; `source` names it in errors. Raises `InputError`."""
    try:
        data = tomllib.loads(text)
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        raise InputError(f"{source} is not valid TOML: {error}.") from None
    try:
        return Robot.model_validate(data)
    except ValidationError as error:
        raise InputError(f"{source}: {_sentence(error, data)}.") from None


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


def _sentence(error: ValidationError, data: dict[str, Any]) -> str:
    """The first validation error as ``key: what is wrong``, with the named item and the nearest key."""
    first = error.errors(include_url=False)[0]
    where = _path(first["loc"], data)
    value = first.get("input")
    if first["type"] == "extra_forbidden":
        known = _siblings(first["loc"])
        return f"unknown key '{where}'{nearest(str(first['loc'][-1]), known)}"
    if first["type"] == "missing":
        return f"key '{where}' is missing"
    message = first["msg"].removeprefix("Value error, ")
    shown = f" (it is {value!r})" if isinstance(value, str | int | float | bool) else ""
    message = message[0].lower() + message[1:]
    return f"{where}: {message}{shown}" if where else f"{message}{shown}"


def _path(location: tuple[int | str, ...], data: Any) -> str:
    """``links[link1].mass`` rather than ``links.0.mass``; union tags are left out."""
    words: list[str] = []
    here = data
    for step in location:
        if isinstance(step, int):
            here = here[step] if isinstance(here, list) and step < len(here) else None
            label = next((here[k] for k in ("name", "channel", "joint", "effect") if k in here), step) if isinstance(here, dict) else step
            words[-1] += f"[{label}]"
        elif isinstance(here, dict) and step not in here and here.get("kind") == step:
            continue
        else:
            words.append(str(step))
            here = here.get(step) if isinstance(here, dict) else None
    return ".".join(words)


def _siblings(location: tuple[int | str, ...]) -> set[str]:
    """All keys of the description that may stand where the unknown one stands."""
    found: set[str] = set()

    def models(annotation: Any) -> list[type[BaseModel]]:
        if isinstance(annotation, type) and issubclass(annotation, BaseModel):
            return [annotation]
        parts = getattr(annotation, "__args__", ())
        return [model for part in parts for model in models(part)]

    here: list[type[BaseModel]] = [Robot]
    for step in location[:-1]:
        if isinstance(step, int):
            continue
        fields = [model.model_fields[step] for model in here if step in model.model_fields]
        if not fields:
            tagged = [m for m in here if "kind" in m.model_fields and m.model_fields["kind"].default == step]
            here = tagged or here
            continue
        here = [model for field in fields for model in models(field.annotation)]
    for model in here:
        found |= set(model.model_fields)
    return found
