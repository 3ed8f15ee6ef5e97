"""The content of crosscheck.json; its keys are explained in docs/crosscheck.md."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from missing_physics.reporting.crosscheck.comparison import WINDOW, Comparison, Difference
from missing_physics.reporting.crosscheck.file import samples_per_series
from missing_physics.reporting.crosscheck.words import verdict_lines
from robot_model import Robot

__all__ = ["SCHEMA", "report"]

SCHEMA = 3


def report(robot: Robot, comparison: Comparison, engines: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    """The content of crosscheck.json; `engines` has the settings of each run."""
    ours, theirs, worst = comparison.reference, comparison.exudyn, comparison.worst
    return {
        "schema": SCHEMA,
        "robot": robot.name,
        "summary": " ".join(verdict_lines(comparison)),
        "duration": ours.duration,
        "samples": len(ours),
        "samples_drawn": min(len(ours), samples_per_series(comparison)),
        "engines": {name: dict(settings) for name, settings in engines.items()},
        "worst": worst.channel if worst else None,
        "outside": [item.channel for item in comparison.outside] if comparison.bands else None,
        "band_window": WINDOW * ours.duration if comparison.bands else None,
        "channels": {item.channel: _channel(item) for item in comparison.differences},
        "only_reference": [name for name in ours if name not in theirs],
        "only_exudyn": [name for name in theirs if name not in ours],
    }


def _channel(item: Difference) -> dict[str, Any]:
    return {
        "unit": item.unit,
        "max": item.largest,
        "rms": item.rms,
        "time_of_max": item.time,
        "range": item.extent,
        "max_relative": item.relative_largest,
        "rms_relative": item.relative_rms,
        "bound": item.bound,
        "excess": item.excess,
        "inside": item.inside,
        "explained": item.explained,
    }
