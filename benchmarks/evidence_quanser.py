"""Quanser two-link arm: what an inspection says of recordings that this version cannot diagnose yet."""

from __future__ import annotations

from pathlib import Path

from benchmarks.evidence import EXAMPLES, number, table, told
from missing_physics.recordings import check, excitation, load_mapping, load_recording, outlook
from missing_physics.recordings.datasets import fetch_dataset

__all__ = ["section"]

#: Recording and its map.
FILES = {"lqr_full_10deg.mat": "map.toml", "quarc_data_fsf_th11.mat": "map_quarc.toml"}


def section() -> str:
    """The section, in Markdown."""
    folder = fetch_dataset("quanser_two_link")
    parts = [
        "## Quanser two-link arm: inspected, not diagnosed",
        "Its links are leaf springs, and a robot file of this version describes rigid bodies only, so there "
        "is no honest nominal robot for it yet. What `missing-physics inspect` says:",
    ]
    for file, name in FILES.items():
        parts += _file(folder / file, EXAMPLES / "quanser_two_link" / name)
    return "\n\n".join(parts)


def _file(path: Path, map_file: Path) -> list[str]:
    recording = load_recording(path, mapping=load_mapping(map_file))
    can, cannot = outlook(recording)
    rows = [
        [
            move.place,
            number(move.position_range),
            number(move.max_speed),
            str(move.reversals),
            f"{100 * move.at_rest:.0f} %",
        ]
        for move in excitation(recording)
    ]
    problems = [finding.sentence for finding in check(recording) if finding.severity != "note"]
    return [
        f"### `{path.name}`",
        f"{len(recording)} samples over {recording.duration:.4g} s.",
        table(["motion of", "range:", "top speed:", "reversals:", "at rest:"], rows),
        "Problems:\n\n" + told(problems),
        "It can tell:\n\n" + told(can),
        "It cannot tell:\n\n" + told(cannot),
    ]
