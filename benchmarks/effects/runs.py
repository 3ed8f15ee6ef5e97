"""A case recorded, diagnosed and judged; each step is stored on disk, so that a run can be continued.

Recordings are stored separately from answers: they do not depend on the diagnosis. Existing ones are reused,
with the commit at which the engine made them.
"""

from __future__ import annotations

import hashlib
import json
import multiprocessing
import os
import sys
import traceback
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cache
from pathlib import Path
from time import monotonic
from typing import Any

import numpy as np

from benchmarks.effects.cases import Case, distance, draw_case, strength
from benchmarks.effects.changes import CHANGES
from benchmarks.evidence import EVIDENCE, ROOT, commit
from missing_physics.challenge.concealing.conceal import DESCRIPTION, Concealed
from missing_physics.challenge.scoring.information import IDENTIFIABLE
from missing_physics.challenge.scoring.score import anchor, closed_loop, judged
from missing_physics.diagnosis import Options, diagnose
from robot_model import InputError, Recording, Robot, robot_from_toml, robot_to_toml, write_atomically

__all__ = ["Key", "Row", "improvement", "rows"]

STORE = EVIDENCE.parent / "effects"
#: Sources on which a recording depends besides the engine, whose commit is stored, and those of an answer.
MADE_BY = ("effects/cases.py", "effects/ranges.py", "effects/changes.py")
ANSWERED = ("robot_model", "reference_model", "missing_physics")
#: Draws of a number until the effect is observable in both recordings; one for robots with flexible links.
ATTEMPTS = 8


@dataclass(frozen=True)
class Key:
    """Specification of a draw.

    Attributes:
        effect: id of the hidden effect.
        number: of the case.
        shipped: robots to draw from, in turn until the effect is observable.
        quantity: of a sensor's channel; "brief" for a short event.
        change: key of `CHANGES`; empty changes nothing.
    """

    effect: str
    number: int
    shipped: tuple[str, ...]
    quantity: str = "torque"
    change: str = ""

    @property
    def name(self) -> str:
        return f"{self.number}-{self.effect}"


@dataclass(frozen=True)
class Row:
    """A case judged.

    Attributes:
        key: specification of the draw.
        robot, place: of the hidden effect.
        truth: true values.
        strength, distance: of the effect in the weaker recording, and to its nearest rival; see
            `effect_cases`.
        verdict: of the answer, or "no recording" or "no answer".
        findings: of diagnosis.json.
        located: places of the mismatches beyond noise.
        place_right, name_right: as the challenge judges them.
        in_set: whether the truth is in the stated set.
        improvement: reduction of the held-out error relative to the true model's.
        seconds: of the diagnosis.
        left: sentences of `could_not_tell`.
        message: why there is no answer.
        made_at: commit at which the engine made the recordings.
    """

    key: Key
    robot: str
    place: str
    truth: Mapping[str, float]
    strength: float
    distance: float
    verdict: str
    findings: tuple[Mapping[str, Any], ...] = ()
    located: tuple[str, ...] = ()
    place_right: bool = False
    name_right: bool = False
    in_set: bool = False
    improvement: float | None = None
    seconds: float = 0.0
    left: tuple[str, ...] = ()
    message: str = ""
    made_at: str = ""

    @property
    def label(self) -> str:
        return f"{self.key.effect}@{self.place}"

    @property
    def shown(self) -> bool:
        """Whether it is observable in both recordings."""
        return self.strength >= IDENTIFIABLE

    @property
    def identifiable(self) -> bool:
        """Whether it is distinguishable from every rival."""
        return self.shown and self.distance >= IDENTIFIABLE


def rows(
    wanted: Sequence[Key], *, processes: int, only_record: bool = False, only_kept: bool = False
) -> list[Row]:
    """All cases, including those of an earlier run of the same sources; or only these (`only_kept`)."""
    if only_kept:
        return [row for key in wanted if (row := _kept(key)) is not None]
    if processes > 1:
        context = multiprocessing.get_context("spawn")
        with context.Pool(min(processes, os.cpu_count() or 1)) as pool:
            return _reported(pool.imap(_record if only_record else _row, wanted), len(wanted))
    return _reported(map(_record if only_record else _row, wanted), len(wanted))


def _reported(found: Iterator[Row], count: int) -> list[Row]:
    done = []
    for row in found:
        done.append(row)
        named = ", ".join(f"{f['effect']}@{f['location']} {f['probability']:.2g}" for f in row.findings)
        words = f"{len(done)}/{count} {row.key.number} {row.robot} {row.label}: {row.verdict}; {named or '-'}"
        print(words, row.message[-200:], f"{row.seconds:.0f} s", file=sys.stderr, flush=True)
    return done


@cache
def _print(rooms: Sequence[str], files: Sequence[str] = ()) -> str:
    """Fingerprint of sources."""
    digest = hashlib.sha256()
    paths = [p for room in rooms for p in sorted((ROOT / room).rglob("*")) if p.suffix in (".py", ".toml")]
    for path in [*paths, *(ROOT / "benchmarks" / file for file in files)]:
        if "reporting" not in path.parts and "cli" not in path.parts:
            digest.update(path.relative_to(ROOT).as_posix().encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()[:16]


def _record(key: Key) -> Row:
    """Store the recordings on disk, and return a row for them only."""
    try:
        return replace(_recorded(key)[1], verdict="recorded")
    except InputError as error:
        return Row(key, key.shipped[0], "", {}, 0.0, 0.0, "no recording", message=str(error))


def _recorded(key: Key) -> tuple[Case, Row]:
    """The first draw observable in both recordings, or the last; simulated, or read from disk."""
    folder = STORE / "recordings" / _print((), MADE_BY) / f"{key.name}-{_short(key)}"
    note = folder / "note.json"
    if note.is_file():
        kept = json.loads(note.read_text("utf-8"))
        case = _draw(key, kept.pop("attempt"))
        for k, name in enumerate(("first", "second")):
            case.__dict__[name] = _read(folder / f"{k}.npz")
        return case, _unanswered(key, case, **kept)
    for attempt in range(ATTEMPTS):
        case = _draw(key, attempt)
        shown = strength(case, case.first)
        if shown >= IDENTIFIABLE:
            shown = min(shown, strength(case, case.second))
        if shown >= IDENTIFIABLE or case.design.nominal.flexible_links:
            break
    kept = {"strength": shown, "distance": distance(case), "made_at": commit()}
    folder.mkdir(parents=True, exist_ok=True)
    for k, exact in enumerate(case.exact):
        _write(folder / f"{k}.npz", exact)
    write_atomically(note, json.dumps({"attempt": attempt, **kept}))
    return case, _unanswered(key, case, **kept)


def _unanswered(key: Key, case: Case, **kept: Any) -> Row:
    truth = dict(case.truth)
    return Row(key, case.design.shipped, case.use.at, truth, verdict="no answer", **kept)


def _draw(key: Key, attempt: int) -> Case:
    shipped = key.shipped[attempt * len(key.shipped) // ATTEMPTS]
    change: Callable[[Robot], Robot] | None = CHANGES[key.change] if key.change else None
    return draw_case(key.effect, key.number, shipped, quantity=key.quantity, change=change, attempt=attempt)


def _short(key: Key) -> str:
    return hashlib.sha256(repr(key).encode()).hexdigest()[:8]


def _write(path: Path, recording: Recording) -> None:
    np.savez_compressed(path, allow_pickle=False, time=recording.time, **recording.channels)


def _read(path: Path) -> Recording:
    with np.load(path, allow_pickle=False) as arrays:
        channels = {name: arrays[name] for name in arrays.files}
    return Recording(channels.pop("time"), channels, "Exudyn")


def _answer(key: Key) -> Path:
    program = _print(ANSWERED) + _print((), MADE_BY)[:4]
    return STORE / "answers" / program / f"{key.name}-{_short(key)}.json"


def _kept(key: Key) -> Row | None:
    """Results of an earlier run of the same sources."""
    path = _answer(key)
    return _row_of(json.loads(path.read_text("utf-8"))) if path.is_file() else None


def _row(key: Key) -> Row:
    """Recorded, diagnosed, judged; or the stored row."""
    if (kept := _kept(key)) is not None:
        return kept
    path = _answer(key)
    try:
        row = _answered(key)
    except InputError as error:
        row = Row(key, key.shipped[0], "", {}, 0.0, 0.0, "no recording", message=str(error))
    path.parent.mkdir(parents=True, exist_ok=True)
    write_atomically(path, json.dumps(asdict(row), indent=1) + "\n")
    return row


def _row_of(content: Mapping[str, Any]) -> Row:
    key = Key(**{**content["key"], "shipped": tuple(content["key"]["shipped"])})
    tuples = {name: tuple(content[name]) for name in ("findings", "located", "left")}
    return Row(**{**content, **tuples, "key": key})


def _answered(key: Key) -> Row:
    case, row = _recorded(key)
    given = case.design.nominal.model_copy(update={"description": DESCRIPTION})
    given = robot_from_toml(robot_to_toml(given))
    train, other = case.recordings
    began = monotonic()
    try:
        result = diagnose(given, [train], [other], options=Options(experiments=False))
    except Exception:  # a fault of the program is a row of the table
        return replace(row, message=traceback.format_exc()[-400:], seconds=monotonic() - began)
    seconds = monotonic() - began
    answer = result.diagnosis.to_dict()
    facts = judged(case.design, given, answer)
    stated = {f"{f['effect']}@{f['location']}" for f in answer["findings"]}
    stated |= {label for f in answer["findings"] for label in f["ambiguous_with"]}
    return replace(
        row,
        verdict=answer["verdict"],
        findings=tuple(answer["findings"]),
        located=tuple(anchor(given, m["location"]) for m in answer["mismatch"]),
        place_right=bool(facts["place"]),
        name_right=bool(facts["right_name"]),
        in_set=row.label in stated,
        improvement=improvement(case, given, robot_from_toml(result.augmented_robot_toml), other),
        seconds=seconds,
        left=tuple(answer["could_not_tell"]),
    )


def improvement(case: Case, given: Robot, augmented: Robot, recording: Recording) -> float | None:
    """The answer's reduction of the held-out closed-loop error relative to the true model's."""
    if case.warming is not None:  # no simulation of the robot file reproduces the joint temperature
        return None
    made = Concealed.of(case.design, [(exact.time, exact.channels) for exact in case.exact])
    try:
        errors = closed_loop(made, made.completed(given), made.completed(augmented), recording)
    except InputError:
        return None
    if not {"nominal", "answer", "truth"} <= errors.keys() or errors["nominal"] <= 1.05 * errors["truth"]:
        return None
    return (errors["nominal"] - errors["answer"]) / (errors["nominal"] - errors["truth"])
