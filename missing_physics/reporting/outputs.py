"""All files of a diagnosis, replacing those of an earlier one."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from missing_physics.reporting.pages.html_report import write_html
from missing_physics.reporting.viewer.file import write_rerun
from missing_physics.results.result import Result
from robot_model import Recording, Robot, replacing_set, write_atomically

__all__ = ["write_outputs"]

#: Files of a diagnosis, and those of the motions that it proposes.
DIAGNOSIS, REPORT, COMPARISON = "diagnosis.json", "report.html", "comparison.rrd"
AUGMENTED = "robot.augmented.toml"
EXPERIMENT = re.compile(r"experiment_\d+\.csv")


def write_outputs(result: Result, robot: Robot, out: Path, *, recordings: Sequence[Recording] = ()) -> None:
    """Write all files of a diagnosis into `out`, atomically replacing those of an earlier one."""
    with replacing_set(out, _earlier(out)) as fresh:
        write_atomically(fresh / AUGMENTED, result.augmented_robot_toml)
        for name, text in result.experiment_motions.items():
            write_atomically(fresh / name, text)
        write_html(result, robot, fresh / REPORT)
        write_rerun(result, robot, fresh / COMPARISON, recordings=recordings)
        write_atomically(fresh / DIAGNOSIS, result.diagnosis.to_json())


def _earlier(out: Path) -> list[str]:
    """Names of the files of an earlier diagnosis; those of experiments are listed in its diagnosis.json."""
    named: list[object] = []
    with suppress(OSError, ValueError, KeyError, TypeError):
        content = json.loads((out / DIAGNOSIS).read_text("utf-8"))
        named = [experiment["motion"] for experiment in content["experiments"]]
    motions = [name for name in named if isinstance(name, str) and EXPERIMENT.fullmatch(name)]
    return [DIAGNOSIS, REPORT, COMPARISON, AUGMENTED, *motions]
