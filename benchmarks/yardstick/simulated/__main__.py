"""Score this engine on the simulated yardstick, or on a part of it.

    python -m benchmarks.yardstick.simulated [--half looked|counted|both] [--cases N] [--engine-label TEXT]
        [--out FILE] [--against FILE] [--folder DIR] [--make-only]

Writes the scores of all cases to FILE (JSON) and a page next to it (Markdown). Cases and answers are stored
in DIR, so that an interrupted run can be continued, and so that a later engine, under its own label, is
scored on exactly the same cases; `--against` compares the two case by case. One process at a time; the halves
may be run in parallel.
"""

from __future__ import annotations

import argparse
import json
import re
import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from benchmarks.evidence import command_line
from benchmarks.yardstick.simulated.answers import Answers
from benchmarks.yardstick.simulated.cases import cases_of
from benchmarks.yardstick.simulated.page import page
from missing_physics.challenge.cases.numbers import HALVES, YARDSTICK_SEEDS, half_of
from missing_physics.challenge.processes.stage import begin
from missing_physics.challenge.scoring.paired import Comparison, compare
from missing_physics.challenge.scoring.result import CaseScore, case_score
from missing_physics.challenge.seals.store import Store, said
from missing_physics.cli.interrupts import Signals, interrupting
from robot_model import InputError, require_folder, write_atomically

__all__ = ["main", "numbers_of", "scores_of"]

FOLDER = Path("reports/yardstick/simulated")
#: A label names a folder.
LABEL = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,63}")
#: Options that the page shows in its command.
SHOWN = ("half", "cases", "engine_label", "against")
#: Exit code for input that cannot be used.
UNUSABLE = 2


def main(arguments: Sequence[str] | None = None) -> int:
    """Score, write the files; exit code as on the command line."""
    parser = _parser()
    given = parser.parse_args(arguments)
    given.out = given.out or given.folder / f"{given.engine_label}.json"
    try:
        with interrupting() as signals, said(given.folder):
            begin()
            return _interruptible(given, command_line(parser, given, SHOWN), signals)
    except InputError as error:
        print(f"yardstick: {error}", file=sys.stderr)
        return UNUSABLE


def _interruptible(given: argparse.Namespace, command: str, signals: Signals) -> int:
    try:
        _run(given, command)
    except KeyboardInterrupt:
        signals.arrived()
        print(
            f"yardstick: {signals.words}. What is finished is kept; the same command goes on.",
            file=sys.stderr,
        )
        return signals.exit_code
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.yardstick.simulated", description="An engine on the simulated yardstick."
    )
    parser.add_argument("--half", choices=(*HALVES, "both"), default="both", help="which cases")
    parser.add_argument("--cases", type=int, help="only the first so many of them")
    parser.add_argument("--engine-label", default="engine", help="under which the answers are kept")
    parser.add_argument("--out", type=Path, help="JSON file to write; DIR/LABEL.json when left out")
    parser.add_argument("--against", type=Path, help="scores of another engine to compare with")
    parser.add_argument("--make-only", action="store_true", help="make the cases and diagnose none")
    parser.add_argument("--folder", type=Path, default=FOLDER, help="where cases and answers are kept")
    return parser


def numbers_of(half: str, cases: int | None = None) -> list[int]:
    """The first case numbers of a half or of both."""
    found = [number for number in YARDSTICK_SEEDS if half in ("both", half_of(number))]
    return found[:cases]


def _run(given: argparse.Namespace, command: str) -> None:
    _check(given)
    store = Store(given.folder)
    numbers = numbers_of(given.half, given.cases)
    if given.make_only:
        made = [case for case, _ in cases_of(store, numbers, _say)]
        print(f"{sum(case.made for case in made)} of {len(made)} cases are in {store.path('cases')}")
        return
    answers = Answers(store, given.engine_label)
    answers.claim()
    before = None if given.against is None else scores_of(given.against)
    scores: list[CaseScore] = []
    unmade: dict[int, str] = {}
    for case, design in cases_of(store, numbers, _say):
        if not case.made:
            unmade[case.number] = case.message
            continue
        scores.append(answers.score(case, design))
        _say(f"{len(scores) + len(unmade)} of {len(numbers)} cases")
    compared = None if before is None else (before[0], compare(before[1], scores))
    content = {
        "engine": given.engine_label,
        "cases": [{**asdict(score), "half": half_of(score.number)} for score in scores],
        "unmade": unmade,
        "comparison": None if compared is None else _plain(*compared),
    }
    write_atomically(given.out, json.dumps(content, indent=1) + "\n")
    text = page(given.engine_label, scores, unmade, command=command, comparison=compared)
    write_atomically(given.out.with_suffix(".md"), text)
    print(f"{given.out} and {given.out.with_suffix('.md')}")


def _check(given: argparse.Namespace) -> None:
    if given.cases is not None and given.cases < 1:
        raise InputError(f"--cases is {given.cases}; it must be at least 1.")
    if not LABEL.fullmatch(given.engine_label):
        raise InputError(
            f"--engine-label '{given.engine_label}' is no name for a folder; use letters, digits, '.', '_', "
            "'-', at most 64 of them."
        )
    if given.out.suffix == ".md":
        raise InputError(f"--out {given.out} is the name of the page; give the name of a JSON file.")
    require_folder(given.out.parent)


def scores_of(path: Path) -> tuple[str, list[CaseScore]]:
    """Label and scores of an earlier run."""
    try:
        content = json.loads(path.read_text("utf-8"))
        cases = [{key: x for key, x in case.items() if key != "half"} for case in content["cases"]]
        return str(content["engine"]), [case_score(case) for case in cases]
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror or error}.") from None
    except (AttributeError, KeyError, TypeError, ValueError):
        raise InputError(f"{path} holds no scores of this yardstick; give a file of --out.") from None


def _plain(label: str, comparison: Comparison) -> dict[str, Any]:
    return {"against": label, **asdict(comparison)}


def _say(words: str) -> None:
    print(words, file=sys.stderr, flush=True)


if __name__ == "__main__":
    sys.exit(main())
