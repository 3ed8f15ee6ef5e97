"""`Correction`: a change of a map file so that a channel is what its name states."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from missing_physics.recordings.maps.mapping import ChannelSource, Mapping, TimeSource
from robot_model import Recording

__all__ = ["Correction", "corrected", "corrected_map", "in_words"]


@dataclass(frozen=True)
class Correction:
    """One change of one channel: it should be ``scale`` times the values read as ``source``.

    Attributes:
        channel: native name, or ``time``.
        source: native name under which the right values were read; the channel itself if empty.
        scale: factor on the read values, in addition to the map's present scale.
        delay: of the channel [s].
    """

    channel: str
    source: str = ""
    scale: float = 1.0
    delay: float = 0.0

    @property
    def origin(self) -> str:
        """The channel whose values are taken."""
        return self.source or self.channel


def in_words(corrections: Sequence[Correction], mapping: Mapping | None = None) -> str:
    """The corrections as in a map file, in one line."""
    return "; ".join(
        f"{head} {', '.join(_pair(key, value) for key, value in table.items())}"
        for head, table in _changed(corrections, mapping)
    )


def corrected_map(
    recording: Recording, corrections: Sequence[Correction], mapping: Mapping | None = None
) -> str:
    """TOML to paste: with a map, the tables that change in it; without one, a complete map for the file.

    Args:
        recording: as read.
        corrections: the changes.
        mapping: the mapping with which it was read.
    """
    tables = dict(_changed(corrections, mapping))
    if mapping is None or not mapping.channels:
        whole = {"[time]": {"source": "time"}, **{_head(name): {"source": name} for name in recording}}
        if mapping is not None:
            del whole["[time]"]
        tables = {head: {**table, **tables.get(head, {})} for head, table in whole.items()}
    return "\n".join(
        "\n".join([head, *(_pair(key, value) for key, value in table.items()), ""])
        for head, table in tables.items()
    )


def corrected(recording: Recording, corrections: Iterable[Correction]) -> Recording:
    """The recording corrected in scale and source (delays, which change instants, are not applied)."""
    changed = {m.channel: m.scale * recording[m.origin] for m in corrections if m.channel != "time"}
    return recording.with_channels(changed)


def _changed(
    corrections: Sequence[Correction], mapping: Mapping | None
) -> Iterator[tuple[str, dict[str, Any]]]:
    for correction in corrections:
        yield (
            _head(correction.channel),
            _time(correction, mapping) if correction.channel == "time" else _table(correction, mapping),
        )


def _head(channel: str) -> str:
    return "[time]" if channel == "time" else f'[channels."{channel}"]'


def _time(correction: Correction, mapping: Mapping | None) -> dict[str, Any]:
    origin = mapping.time if mapping else TimeSource(source="time")
    if origin.source is None:
        assert origin.rate is not None
        return {"rate": origin.rate / correction.scale}
    return {**_written(origin), "scale": origin.scale * correction.scale}


def _table(correction: Correction, mapping: Mapping | None) -> dict[str, Any]:
    known = mapping.channels.get(correction.origin) if mapping else None
    origin = known or ChannelSource(source=correction.origin)
    table = _written(origin)
    if correction.scale != 1.0:
        table["scale"] = origin.scale * correction.scale
        if origin.offset:
            table["offset"] = origin.offset * correction.scale
        if origin.clip is not None:
            table["clip"] = sorted(correction.scale * limit for limit in origin.clip)
    if correction.delay:
        table["delay"] = origin.delay + correction.delay
    return table


def _written(model: ChannelSource | TimeSource) -> dict[str, Any]:
    return model.model_dump(mode="json", exclude_defaults=True)


def _pair(key: str, value: Any) -> str:
    return f"{key} = {_toml(value)}"


def _toml(value: Any) -> str:
    if isinstance(value, dict):
        return "{ " + ", ".join(_pair(key, item) for key, item in value.items()) + " }"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(_toml(item) for item in value) + "]"
    if isinstance(value, float):
        return f"{value:.10g}"
    return json.dumps(value, ensure_ascii=False)
