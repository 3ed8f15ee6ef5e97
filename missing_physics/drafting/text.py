"""Drafts as TOML, with guesses, reasons and open questions as comments."""

from __future__ import annotations

import json
import textwrap
from collections.abc import Iterator, Sequence
from typing import Any

from missing_physics.drafting.channels import Entry, UnusedColumn
from missing_physics.drafting.clock import Clock
from missing_physics.drafting.drive import JointDraft

__all__ = ["map_text", "overlay_text"]

WIDTH = 110
#: Maximum number of listed unused columns.
MOST_UNUSED = 60


def map_text(source: str, clock: Clock, entries: Sequence[Entry], unused: Sequence[UnusedColumn]) -> str:
    """Text of a map; see the reader of maps for its keys."""
    lines = [*_comment(f"Drafted from {source}. Check every line; '?' marks an open question."), ""]
    sliding = list(dict.fromkeys(entry.joint.name for entry in entries if entry.joint.kind == "prismatic"))
    if sliding:
        lines += [f"prismatic = {_value(sliding)}", ""]
    lines += [*_comments(clock.reasons, clock.questions), "[time]", *_pairs(clock.table), ""]
    for entry in entries:
        table = {"source": entry.column.source, **entry.column.place, **entry.table}
        lines += _comments(entry.reasons, entry.questions)
        lines += [f"[channels.{json.dumps(entry.channel)}]", *_pairs(table), ""]
    if unused:
        lines += _comment("Not read:")
        lines += [
            line for each in unused[:MOST_UNUSED] for line in _comment(f"  '{each.column.label}': {each.why}")
        ]
        if len(unused) > MOST_UNUSED:
            lines += _comment(f"  and {len(unused) - MOST_UNUSED} more")
    return "\n".join(lines).rstrip() + "\n"


def overlay_text(source: str, joints: Sequence[JointDraft]) -> str:
    """Text of an overlay; empty if there are no joints."""
    if not joints:
        return ""
    lines = [*_comment(f"Drafted from {source}. Check every line; '?' marks an open question."), ""]
    for joint in joints:
        lines += [*_comments(joint.reasons, joint.questions), "[[joints]]", f"name = {_value(joint.name)}"]
        if joint.actuator:
            lines.append(f"actuator = {{ {', '.join(_pairs(joint.actuator))} }}")
        lines.append("")
    return "\n".join(lines).rstrip() + "\n"


def _comments(reasons: Sequence[str], questions: Sequence[str]) -> Iterator[str]:
    for reason in reasons:
        yield from _comment(reason[0].upper() + reason[1:].rstrip(".") + ".")
    for question in questions:
        yield from _comment(f"? {question[0].upper()}{question[1:]}")


def _comment(text: str) -> list[str]:
    """Lines of a comment; line breaks and other control characters in names become spaces."""
    plain = "".join(letter if letter.isprintable() else " " for letter in text)
    indent = plain[: len(plain) - len(plain.lstrip())]
    return textwrap.wrap(plain, WIDTH, initial_indent="# " + indent, subsequent_indent="#   " + indent) or [
        "#"
    ]


def _pairs(table: dict[str, Any]) -> list[str]:
    return [f"{key} = {_value(value)}" for key, value in table.items()]


def _value(value: Any) -> str:
    """TOML writes strings, numbers and lists of these like JSON, except for one character."""
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
