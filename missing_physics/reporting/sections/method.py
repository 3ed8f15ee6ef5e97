"""How the answer was obtained: data, method, notes, versions, and the augmented robot file."""

from __future__ import annotations

import platform
from importlib.metadata import PackageNotFoundError, version

from missing_physics.reporting.elements.formatting import number
from missing_physics.reporting.sections.base import Section
from missing_physics.results.result import ChannelSeries, Result
from robot_model import Robot

__all__ = ["section"]

PACKAGES = ("missing-physics", "casadi", "numpy", "scipy", "plotly")


def section(result: Result, robot: Robot) -> Section:
    """Data and held-out part, notes, versions, and the text of the augmented robot."""
    diagnosis = result.diagnosis
    return Section(
        anchor="method",
        heading="Data, method and versions",
        values={
            "robot": diagnosis.robot,
            "description": robot.description,
            "recordings": _recordings(result),
            "notes": list(diagnosis.notes),
            "seconds": number(result.seconds) if result.seconds > 0 else "",
            "versions": [
                ("Python", platform.python_version()),
                *((name, _version(name)) for name in PACKAGES),
            ],
            "augmented_robot": diagnosis.augmented_robot,
            "toml": result.augmented_robot_toml,
        },
    )


def _recordings(result: Result) -> list[dict[str, str]]:
    diagnosis = result.diagnosis
    rows = []
    for name, role in (
        *((name, "fitted") for name in diagnosis.recordings),
        *((name, "held out entirely") for name in diagnosis.validation),
    ):
        series = next((item for item in result.series if item.recording == name), None)
        rows.append({"name": name, "role": role, **_extent(series)})
    return rows


def _extent(series: ChannelSeries | None) -> dict[str, str]:
    if series is None or series.time.size < 2:
        return {"duration": "–", "rate": "–", "held": "–"}
    duration = float(series.time[-1] - series.time[0])
    return {
        "duration": f"{number(duration)} s",
        "rate": f"{number((series.time.size - 1) / duration)} Hz",
        "held": f"{100 * float(series.held_out.mean()):.0f} %",
    }


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "not installed"
