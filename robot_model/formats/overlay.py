"""Overlays: small files with keys of a robot file that another file lacks."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from robot_model.input.errors import InputError, nearest
from robot_model.input.toml import toml_tables, toml_text

__all__ = ["Overlay", "laid_over", "read_overlay"]

#: Lists whose entries are identified by one key: an entry of the overlay changes or adds keys of that entry.
NAMED: Mapping[str, str] = {"links": "name", "joints": "name"}

#: Lists whose entries are identified by some keys: an overlay's entry replaces the same one, or is added.
ALIKE: Mapping[str, tuple[str, ...]] = {
    "sensors": ("channel",),
    "effects": ("effect", "at"),
    "transmissions": ("name",),
}


@dataclass(frozen=True)
class Overlay:
    """The tables of an overlay.

    Attributes:
        file: its origin, for people.
        tables: its keys.
    """

    file: str
    tables: Mapping[str, Any]

    def entry(self, key: str, *names: str) -> dict[str, Any]:
        """The table of a link or joint that goes by one of these names; empty where there is none."""
        return next((dict(e) for e in self.tables.get(key, ()) if e["name"] in names), {})

    def has(self, table: str, *keys: str) -> bool:
        """Whether a table, such as ``base``, holds one of these keys."""
        return any(key in self.tables.get(table, {}) for key in keys)


def read_overlay(path: Path) -> Overlay:
    """Raises `InputError`: no such file, not TOML, lists that are none."""
    if not path.is_file():
        raise InputError(f"{path} is no file; --overlay takes the name of a TOML file.")
    file = str(path)
    tables = toml_tables(toml_text(path, "overlay"), source=file, what="overlay")
    for key in (*NAMED, *ALIKE):
        _check_list(file, key, tables.get(key, []))
    for key in ("base", "xacro"):
        if not isinstance(tables.get(key, {}), dict):
            raise InputError(f"{file}: {key}: must be a table of keys; write its name in brackets, [{key}].")
    for name, value in tables.get("xacro", {}).items():
        if not isinstance(value, str | int | float):
            raise InputError(f"{file}: xacro.{name}: must be text, a number, true or false.")
    return Overlay(file, tables)


def _check_list(file: str, key: str, entries: Any) -> None:
    if not isinstance(entries, list) or not all(isinstance(entry, dict) for entry in entries):
        raise InputError(
            f"{file}: {key}: must be a list of tables; write its name in double brackets, [[{key}]]."
        )
    if key not in NAMED:
        return
    names = [entry.get("name") for entry in entries]
    if not all(isinstance(name, str) for name in names):
        raise InputError(f"{file}: {key}: an entry has no name; an overlay says by name what it is about.")
    if twice := next((name for name in names if names.count(name) > 1), None):
        raise InputError(f"{file}: {key}: '{twice}' is named twice; keep one.")


def laid_over(data: Mapping[str, Any], overlay: Overlay) -> dict[str, Any]:
    """The tables of a robot with those of an overlay applied.

    Tables of links and joints are matched by name, and their keys and inner tables merged; sensors are
    matched by channel, effects by effect and place, transmissions by name. An empty list of these removes all
    of them. Any other key replaces the existing one. Joints of the overlay's transmissions lose their own
    actuator.
    """
    result = {**data, **_uncoupled(data, overlay)}
    for key, value in overlay.tables.items():
        if key in NAMED:
            result[key] = _named(result.get(key, []), value, key, overlay.file)
        elif key in ALIKE:
            result[key] = _alike(data.get(key, []), value, ALIKE[key]) if value else []
        elif key == "base":
            result[key] = _deep(data.get(key, {}), value)
        else:
            result[key] = value
    return result


def _uncoupled(data: Mapping[str, Any], overlay: Overlay) -> dict[str, Any]:
    """The robot's joints without the actuators of those that a transmission of the overlay moves."""
    found = [one.get("joints", ()) for one in overlay.tables.get("transmissions", ())]
    coupled = [name for names in found if isinstance(names, list) for name in names]
    if not coupled or not isinstance(data.get("joints"), list):
        return {}
    joints = [dict(joint) if isinstance(joint, dict) else joint for joint in data["joints"]]
    for joint in joints:
        if isinstance(joint, dict) and joint.get("name") in coupled:
            joint.pop("actuator", None)
    return {"joints": joints}


def _named(
    entries: Iterable[Mapping[str, Any]], changes: Iterable[Mapping[str, Any]], key: str, file: str
) -> list[Any]:
    by_name = {entry["name"]: dict(entry) for entry in entries}
    for change in changes:
        name = change["name"]
        if name not in by_name:
            raise InputError(
                f"{file}: {key}: '{name}' is no {key[:-1]} of the robot{nearest(name, by_name)}."
            )
        merged = _deep(by_name[name], change)
        by_name[name] = _driven(merged, f"{file}: joints[{name}]") if key == "joints" else merged
    return list(by_name.values())


def _driven(joint: dict[str, Any], where: str) -> dict[str, Any]:
    """A joint's table without the key `passive`, which a robot expresses by the absence of an actuator."""
    passive = joint.pop("passive", None)
    if passive is not None and not isinstance(passive, bool):
        raise InputError(f"{where}.passive: must be true or false.")
    if passive:
        joint.pop("actuator", None)
    elif passive is False:
        joint.setdefault("actuator", {})
    if joint.get("kind") == "fixed" and joint.get("initial_position"):
        raise InputError(
            f"{where}.initial_position: a fixed joint of a TOML robot is held by its origin and rpy."
        )
    return joint


def _alike(
    entries: Iterable[Mapping[str, Any]], changes: Iterable[Mapping[str, Any]], keys: tuple[str, ...]
) -> list[Any]:
    def mark(entry: Mapping[str, Any]) -> tuple[Any, ...]:
        return tuple(repr(entry.get(key)) for key in keys)

    changed = [mark(change) for change in changes]
    return [*(dict(e) for e in entries if mark(e) not in changed), *(dict(c) for c in changes)]


def _deep(table: Mapping[str, Any], change: Mapping[str, Any]) -> dict[str, Any]:
    """Tables merged key by key; anything that is not a table on both sides is replaced."""
    merged = dict(table)
    for key, value in change.items():
        both = isinstance(value, dict) and isinstance(merged.get(key), dict)
        merged[key] = _deep(merged[key], value) if both else value
    return merged
