"""Entity paths and colours of a crosscheck's rerun file."""

from __future__ import annotations

import rerun as rr

from missing_physics.reporting.elements import palette

__all__ = [
    "ENGINES",
    "TIMELINE",
    "bound_paths",
    "colour",
    "difference_path",
    "lane_path",
    "robot_path",
    "value_path",
]

TIMELINE = "sim_time"
ENGINES = ("reference", "exudyn")
#: Colours by engine; axes of one quantity share a plot and differ in shade, in the order w, x, y, z.
SHADES = {
    "reference": (palette.AFTER_ON_DARK, "#3D7FD9", "#6FD3C7", "#9C8CF0"),
    "exudyn": (palette.BEFORE, "#F0A030", "#E05C8A", "#B8472E"),
    "difference": (palette.MEASURED_ON_DARK, "#F0E442", "#7BC96F", "#CC79A7"),
}
AXES = "xyzw"


def colour(channel: str, which: str) -> tuple[int, int, int]:
    """Colour of the line of an engine's `channel`, or of its difference."""
    last = channel.rsplit(".", 1)[-1]
    shade = SHADES[which][AXES.index(last) if last in AXES else 0]
    return (int(shade[1:3], 16), int(shade[3:5], 16), int(shade[5:7], 16))


def value_path(channel: str, *engine: str) -> str:
    """Path of an engine's values of a channel, or of both together."""
    return str(rr.new_entity_path(["channels", channel, *engine]))


def difference_path(channel: str) -> str:
    return str(rr.new_entity_path(["difference", channel]))


def bound_paths(channel: str) -> tuple[str, str]:
    """Paths of the lower and the upper edge of the band."""
    first, second = (
        str(rr.new_entity_path(["difference", channel, "band", edge])) for edge in ("below", "above")
    )
    return first, second


def robot_path(engine: str, *parts: str) -> str:
    return str(rr.new_entity_path(["robot", engine, *parts]))


def lane_path(joint: str, engine: str) -> str:
    return str(rr.new_entity_path(["friction", joint, engine]))
