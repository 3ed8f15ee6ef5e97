"""The table of the machines, from `machines.toml`."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from pathlib import Path

from pydantic import BaseModel, ConfigDict

from robot_model import InputError, nearest

__all__ = ["Known", "Machine", "Published", "Run", "machine", "rows"]

TABLE = Path(__file__).with_name("machines.toml")


class _Entry(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class Run(_Entry):
    """One recording of a machine.

    Attributes:
        file: name in the dataset's folder.
        map: map file in the example's folder; the machine's where empty.
        window: first and last instant that are read [s]; all where None.
        record: which of several records that follow each other in the file, the first is 1.
    """

    file: str
    map: str = ""
    window: tuple[float, float] | None = None
    record: int | None = None

    @property
    def label(self) -> str:
        """The run for people, such as ``traj_0.npz, 0 to 12 s``."""
        parts = [self.file]
        if self.record is not None:
            parts.append(f"record {self.record}")
        if self.window is not None:
            parts.append(f"{self.window[0]:g} to {self.window[1]:g} s")
        return ", ".join(parts)


class Known(_Entry):
    """An effect of the real machine that its robot file lacks.

    Attributes:
        effect: id in the catalogue.
        at: joint, link or channel.
        values: published parameters, by name, in SI units.
        words: remarks.
        source: of the publication.
    """

    effect: str
    at: str
    values: Mapping[str, float] = {}
    words: str = ""
    source: str


class Published(_Entry):
    """Reading of the published files, if their layout differs from the prepared ones.

    Attributes:
        map: map file in the example's folder.
        file: their name, with ``{stem}`` for the stem of a run's file.
    """

    map: str
    file: str


class Machine(_Entry):
    """One row of the yardstick: one diagnosis of one real machine.

    Attributes:
        name: of the row.
        dataset: of `missing_physics.recordings.datasets`; also the folder under `examples/`.
        robot: TOML file of that folder, or, with an overlay, a URDF or MJCF file of the dataset.
        overlay: TOML file of that folder applied to `robot`; empty for none.
        map: map file of that folder.
        published: for files laid out as published; None where the same map reads both.
        fit, held_out: runs.
        joints: the relevant joints; all moving ones if empty.
        known: effects of the machine.
        remark: limitations, or remarks needed to read the row.
    """

    name: str
    dataset: str
    robot: str
    overlay: str = ""
    map: str
    published: Published | None = None
    fit: tuple[Run, ...]
    held_out: tuple[Run, ...]
    joints: tuple[str, ...] = ()
    known: tuple[Known, ...] = ()
    remark: str = ""


def rows() -> list[Machine]:
    """Every row, in the order of the table."""
    tables = tomllib.loads(TABLE.read_text("utf-8"))["machines"]
    return [Machine.model_validate(table) for table in tables]


def machine(name: str) -> Machine:
    """The row of that name. Raises `InputError` where there is none."""
    found = {row.name: row for row in rows()}
    if name not in found:
        raise InputError(f"the yardstick has no machine '{name}'{nearest(name, found)}.")
    return found[name]
