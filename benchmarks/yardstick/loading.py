"""From a row of the table to a robot and its recordings, read as a user's command would read them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from benchmarks.evidence import EXAMPLES
from benchmarks.yardstick.machines import Machine, Run
from missing_physics.recordings import load_mapping, load_recording
from missing_physics.recordings.datasets import DATA_VARIABLE, fetch_dataset, find_dataset
from robot_model import InputError, Recording, Robot, read_robot

__all__ = ["Loaded", "load", "robot_of"]


@dataclass(frozen=True)
class Loaded:
    """A machine, ready for a diagnosis.

    Attributes:
        robot: nominal.
        fit, held_out: recordings, in the order of the row's runs.
        notes: on reading the robot file.
    """

    robot: Robot
    fit: tuple[Recording, ...]
    held_out: tuple[Recording, ...]
    notes: tuple[str, ...] = ()


def load(machine: Machine, *, download: bool = False) -> Loaded:
    """Robot and recordings of a row, channels checked against each other.

    Args:
        machine: the row.
        download: fetch the dataset where it is not on this machine.

    Raises:
        InputError: the dataset is missing (the message says how to get it), or a file is unusable.
    """
    folder = _folder(machine, download=download)
    robot, notes = _robot(machine, folder)
    fit, held_out = (_recordings(machine, runs, folder, robot) for runs in (machine.fit, machine.held_out))
    return Loaded(robot, fit, held_out, notes)


def robot_of(machine: Machine, *, download: bool = False) -> Robot:
    """The robot of a row without its recordings; raises as `load` does."""
    return _robot(machine, _folder(machine, download=download))[0]


def _folder(machine: Machine, *, download: bool) -> Path:
    folder = fetch_dataset(machine.dataset) if download else find_dataset(machine.dataset)
    if folder is None:
        raise InputError(
            f"{machine.name}: its recordings are not here; run `missing-physics datasets fetch "
            f"{machine.dataset}`, or set {DATA_VARIABLE} to the folder that holds {machine.dataset}/."
        )
    return folder


def _robot(machine: Machine, folder: Path) -> tuple[Robot, tuple[str, ...]]:
    example = EXAMPLES / machine.dataset
    if not machine.overlay:
        return read_robot(example / machine.robot)
    return read_robot(folder / machine.robot, overlay=example / machine.overlay)


def _recordings(machine: Machine, runs: Sequence[Run], folder: Path, robot: Robot) -> tuple[Recording, ...]:
    return tuple(_recording(machine, run, folder, robot) for run in runs)


def _recording(machine: Machine, run: Run, folder: Path, robot: Robot) -> Recording:
    file, map_file = _source(machine, run, folder)
    mapping = load_mapping(EXAMPLES / machine.dataset / map_file)
    if run.record is not None:
        mapping = mapping.model_copy(update={"record": run.record})
    recording = load_recording(file, mapping=mapping, robot=robot)
    return recording if run.window is None else recording.window(*run.window)


def _source(machine: Machine, run: Run, folder: Path) -> tuple[Path, str]:
    """The run's file and its map; those of the published layout if the folder has that."""
    if (folder / run.file).is_file():
        return folder / run.file, run.map or machine.map
    if machine.published is None:
        raise InputError(
            f"{machine.name}: {folder} has no {run.file}; examples/{machine.dataset}/README.md says how to "
            "make it of what is published."
        )
    return folder / machine.published.file.format(stem=Path(run.file).stem), machine.published.map
