"""One row of the yardstick diagnosed in a separate process, with its time and memory.

A diagnosed row is not repeated unless requested: its answer is stored as one JSON file, so that an
interrupted run can be continued.
"""

from __future__ import annotations

import json
import multiprocessing
import os
import time
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from benchmarks.evidence import commit, peak_memory
from benchmarks.yardstick.loading import load
from benchmarks.yardstick.machines import Machine, machine
from missing_physics.diagnosis import Options, diagnose
from robot_model import InputError

__all__ = ["PATIENCE", "Answer", "answer", "answers_folder"]

#: Time after which a diagnosis is aborted, which the row reports [s].
PATIENCE = 1800.0


@dataclass(frozen=True)
class Answer:
    """Result of one row.

    Attributes:
        machine: name of the row.
        commit: of the program that answered.
        diagnosis: `diagnosis.json` as a mapping; None where there is none.
        refused: the message with which the input was refused, or the failure; "" else.
        seconds: processor time [s].
        megabytes: peak memory [MB].
    """

    machine: str
    commit: str
    diagnosis: Mapping[str, Any] | None
    refused: str
    seconds: float
    megabytes: float


def answers_folder(root: Path, label: str) -> Path:
    """Folder of the answers of the program version `label`."""
    return root / "reports" / "yardstick" / label


def answer(row: Machine, folder: Path, *, again: bool = False, patience: float = PATIENCE) -> Answer:
    """Diagnose one row, or read its stored answer; aborted after `patience` [s]."""
    kept = folder / f"{row.name}.json"
    if kept.is_file() and not again:
        return Answer(**json.loads(kept.read_text("utf-8")))
    context = multiprocessing.get_context("spawn")
    receiving, sending = context.Pipe(duplex=False)
    worker = context.Process(target=_diagnose, args=(row.name, sending))
    worker.start()
    sending.close()
    found = _received(row, receiving, worker, patience)
    worker.join()
    folder.mkdir(parents=True, exist_ok=True)
    partial = kept.with_suffix(f".{os.getpid()}.partial")
    partial.write_text(json.dumps(asdict(found), indent=1), "utf-8")
    partial.replace(kept)
    return found


def _received(row: Machine, receiving: Any, worker: Any, patience: float) -> Answer:
    began = time.monotonic()
    if receiving.poll(patience):
        try:
            return Answer(machine=row.name, commit=commit(), **receiving.recv())
        except EOFError:
            worker.join()
            why = f"the process ended with exit code {worker.exitcode}"
    else:
        worker.kill()
        why = f"given up after {patience:.0f} s."
    return Answer(row.name, commit(), None, why, time.monotonic() - began, float("nan"))


def _diagnose(name: str, sending: Any) -> None:
    """In the child: load, diagnose, send the result."""
    outcome: dict[str, Any] = {"diagnosis": None, "refused": ""}
    try:
        loaded = load(machine(name))
        began = time.process_time()
        result = diagnose(loaded.robot, loaded.fit, loaded.held_out, options=Options(experiments=False))
        outcome["seconds"] = time.process_time() - began
        outcome["diagnosis"] = result.diagnosis.to_dict()
    except InputError as error:
        outcome["refused"] = str(error)
    except Exception as error:  # a fault of the program is a row of the table, too
        outcome["refused"] = f"FAULT: {type(error).__name__}: {error}"
    outcome.setdefault("seconds", time.process_time())
    outcome["megabytes"] = peak_memory()
    sending.send(outcome)
