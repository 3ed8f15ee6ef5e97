"""Tampering with an opened challenge, or resuming without sealed files, is detected."""

from __future__ import annotations

import errno
import json
import os
import re
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from challenge_cases import Steps, design, made, steps_of, truth
from test_challenge_run import MODULE, NUMBERS, started
from test_challenge_run import steps as steps

from missing_physics.challenge import show
from missing_physics.challenge.concealing.conceal import Concealed
from missing_physics.challenge.processes.stage import Outcome
from missing_physics.challenge.processes.workers import Work
from missing_physics.challenge.scoring.score import _check_files
from missing_physics.challenge.seals.seal import digest
from missing_physics.challenge.seals.sources import differing, program, sources
from robot_model import InputError


def changed(path: Path, **values: Any) -> None:
    path.write_text(json.dumps({**json.loads(path.read_text()), **values}))


def rewritten_answer(folder: Path) -> None:
    """An answer changed together with every fingerprint but the last."""
    name = sorted(path.name for path in (folder / "answers").iterdir())[0]
    answer = folder / "answers" / name
    (answer / "diagnosis.json").write_text("{}")
    facts = json.loads((answer / "answer.json").read_text())
    changed(answer / "answer.json", files={**facts["files"], "diagnosis.json": digest(b"{}")})
    contents = [path.read_bytes() for path in sorted(answer.iterdir())]
    answers = json.loads((folder / "answers.json").read_text())["answers"]
    changed(folder / "answers.json", answers={**answers, name: digest(b"\0".join(contents))})


def without_an_answer(folder: Path) -> None:
    answers = json.loads((folder / "answers.json").read_text())["answers"]
    changed(folder / "answers.json", answers=dict(list(answers.items())[1:]))
    changed(folder / "opened.json", answers_sha256=digest((folder / "answers.json").read_bytes()))


def rewritten_case(folder: Path) -> None:
    """A case changed together with its manifest."""
    entry = sorted((folder / "manifest").iterdir())[0]
    (folder / "cases" / entry.stem / "robot.toml").write_bytes(b"other")
    files = json.loads(entry.read_text())["files"]
    changed(entry, files={**files, "robot.toml": digest(b"other")})


def other_truth(folder: Path) -> None:
    told = json.loads((folder / "opened.json").read_text())["truth"]
    told["designs"][0]["family"] = "foreign"
    changed(folder / "opened.json", truth=told)


def other_score(folder: Path) -> None:
    changed(sorted((folder / "scores").iterdir())[0], verdict="consistent")


AFTERWARDS: dict[str, tuple[Callable[[Path], None], str]] = {
    "answer": (rewritten_answer, r"answers\.json was changed"),
    "answer left out": (without_an_answer, r"answers\.json was changed: .* cases"),
    "case": (rewritten_case, "manifest was changed after the cases were sealed"),
    "truth": (other_truth, r"opened\.json was changed: its truth"),
    "score": (other_score, r"scores/\w+\.json was changed"),
    "another sealed file": (
        lambda folder: changed(folder / "opened.json", sealed="0.bin"),
        r"opened\.json was changed: .* last sealed file",
    ),
    "sealed file missing": (lambda f: (f / "sealed" / "1.bin").unlink(), r"sealed/1\.bin is missing"),
    "seal missing": (lambda folder: (folder / "seal.json").unlink(), r"seal\.json is missing"),
    "manifest missing": (
        lambda folder: sorted((folder / "manifest").iterdir())[0].unlink(),
        r"manifest/\w+\.json is missing",
    ),
    "recording": (
        lambda folder: next((folder / "cases").glob("*/recording.csv")).write_bytes(b"other"),
        r"recording\.csv was changed",
    ),
}


@pytest.mark.parametrize("kind", AFTERWARDS)
def test_change_after_opening_is_detected(tmp_path: Path, steps: Steps, kind: str) -> None:
    started(tmp_path)
    spoil, words = AFTERWARDS[kind]
    spoil(tmp_path)
    with pytest.raises(InputError, match=words):
        started(tmp_path)


@pytest.mark.parametrize("kind", ["truth", "case", "another sealed file", "seal missing"])
def test_changed_challenge_is_not_shown(tmp_path: Path, steps: Steps, kind: str) -> None:
    started(tmp_path)
    spoil, words = AFTERWARDS[kind]
    spoil(tmp_path)
    with pytest.raises(InputError, match=words):
        show(tmp_path, NUMBERS[0])


def test_missing_seal_is_not_replaced_once_there_are_answers(tmp_path: Path, steps: Steps) -> None:
    steps.interrupt_at = 6
    with pytest.raises(KeyboardInterrupt):
        started(tmp_path)
    (tmp_path / "seal.json").unlink()
    with pytest.raises(InputError, match=r"seal\.json is missing, though there are answers"):
        started(tmp_path)


def test_recorded_answer_fingerprints_are_enforced(
    tmp_path: Path, steps: Steps, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Interrupted between the answers' fingerprints and the opening; then somebody improves an answer."""

    def interrupted(*args: Any, **kwargs: Any) -> bytes:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(f"{MODULE}.unseal", interrupted)
        with pytest.raises(KeyboardInterrupt):
            started(tmp_path)
    before = (tmp_path / "answers.json").read_bytes()
    rewritten_answer(tmp_path)
    (tmp_path / "answers.json").write_bytes(before)
    with pytest.raises(InputError, match=r"answers/\w+ does not match its fingerprint in .*answers\.json"):
        started(tmp_path)


FILES = (
    "challenge.json",
    "seal.json",
    "answers.json",
    "opened.json",
    "manifest/*.json",
    "answers/*/answer.json",
)


@pytest.mark.parametrize("file", FILES)
def test_invalid_json_records_give_one_sentence(tmp_path: Path, steps: Steps, file: str) -> None:
    started(tmp_path)
    path = sorted(tmp_path.glob(file))[0]
    for content in ("{}", "[]", "3", "null", '{"files": 3}', '{"status": []', "\xff"):
        path.write_bytes(content.encode("latin-1"))
        with pytest.raises(InputError, match=re.escape(path.name)) as told:
            started(tmp_path)
        assert "\n" not in str(told.value), content


@pytest.mark.parametrize("content", ["{}", "[]", "3"])
def test_invalid_score_is_reported(tmp_path: Path, steps: Steps, content: str) -> None:
    """Even where its fingerprint was put right."""
    started(tmp_path)
    path = sorted((tmp_path / "scores").iterdir())[0]
    path.write_text(content)
    scores = json.loads((tmp_path / "scoring.json").read_text())["scores"]
    changed(tmp_path / "scoring.json", scores={**scores, path.stem: digest(content.encode())})
    with pytest.raises(InputError, match=f"{path.name} was changed: it is no score"):
        started(tmp_path)


@pytest.mark.parametrize(
    "file",
    [
        "recording.csv",
        *(pytest.param(name, marks=pytest.mark.proof) for name in ("robot.toml", "validation.csv")),
    ],
)
def test_case_inconsistent_with_the_truth_is_reported(file: str) -> None:
    case = made(design())
    files = case.files()
    _check_files(case, files)
    rounded = files["recording.csv"].decode().splitlines()
    rounded[5] = ",".join([rounded[5].split(",")[0], *(f"{float(x):.7g}" for x in rounded[5].split(",")[1:])])
    _check_files(case, {**files, "recording.csv": "\n".join(rounded).encode()})
    other = Concealed(design().model_copy(update={"number": 5})).files()  # other noise
    if file == "robot.toml":
        mass = re.sub(rb"mass = ([0-9.]+)", lambda m: b"mass = %.6f" % (1.1 * float(m[1])), files[file])
        other = {file: mass}
    assert other[file] != files[file]
    with pytest.raises(InputError, match=f"{file} is not what the truth makes"):
        _check_files(case, {**files, file: other[file]})


def test_a_recording_of_another_length_is_reported() -> None:
    case = made(design())
    files = case.files()
    short = b"\n".join(files["recording.csv"].splitlines()[:-7])
    with pytest.raises(InputError, match=r"recording\.csv is not what the truth makes"):
        _check_files(case, {**files, "recording.csv": short})
    assert np.isfinite(case.recordings[0].time).all()


class Failing(Steps):
    """A machine that is full when the n-th process runs."""

    at = -1

    def __call__(
        self, work: Work, cases: Iterator[tuple[str, Mapping[str, bytes]]]
    ) -> Iterator[tuple[str, Outcome]]:
        for name, outcome in super().__call__(work, cases):
            if len(self.done) == self.at:
                self.at = -1
                self.done.pop()
                yield name, Outcome("stopped", {}, "No space left on device", 1, 1.0)
            else:
                yield name, outcome


@pytest.mark.parametrize("at", [2, 6, 10])
def test_full_disk_stops_the_run_and_the_step_is_repeated_later(
    tmp_path: Path, steps: Steps, monkeypatch: pytest.MonkeyPatch, at: int
) -> None:
    full = Failing()
    full.at = at
    monkeypatch.setattr(f"{MODULE}.carried_out", full)
    with pytest.raises(InputError, match=r"No space left on device\. What is finished is kept"):
        started(tmp_path)
    report = started(tmp_path)
    assert len(report.scores) == len(NUMBERS)
    assert not report.unmade
    assert len(full.done) == 3 * len(NUMBERS)


@pytest.mark.parametrize("step", ["conceal", "diagnose", "score"])
def test_program_change_during_a_run_is_detected(
    tmp_path: Path, steps: Steps, monkeypatch: pytest.MonkeyPatch, step: str
) -> None:
    """What it made meanwhile is not kept; with the old program the run goes on."""

    def now() -> dict[str, str]:
        return {"a.py": "edited" if len(steps_of(steps.done, step)) == 2 else "as it is"}

    monkeypatch.setattr(f"{MODULE}.sources", now)
    with pytest.raises(InputError, match=r"the program was changed while it ran \(a\.py\)"):
        started(tmp_path)
    kept = {"conceal": "manifest", "diagnose": "answers", "score": "scores"}[step]
    assert len(list((tmp_path / kept).iterdir())) == 1
    monkeypatch.setattr(f"{MODULE}.sources", lambda: {"a.py": "as it is"})
    assert len(started(tmp_path).scores) == len(NUMBERS)


def test_program_change_before_the_opening_is_detected(
    tmp_path: Path, steps: Steps, monkeypatch: pytest.MonkeyPatch
) -> None:
    steps.interrupt_at = 2 * len(NUMBERS)
    with pytest.raises(KeyboardInterrupt):
        started(tmp_path)
    for path in (tmp_path / "opened.json", tmp_path / "scoring.json"):
        path.unlink(missing_ok=True)
    states = iter([{"a.py": "as it is"}])
    monkeypatch.setattr(f"{MODULE}.sources", lambda: next(states, {"a.py": "edited"}))
    with pytest.raises(InputError, match="the program was changed"):
        started(tmp_path)
    assert not (tmp_path / "opened.json").exists()


def test_program_fingerprint_covers_all_computing_sources() -> None:
    names = set(sources())
    assert {
        "reference_model/steppers/march.c",
        "reference_model/steppers/rosenbrock.c",
        "robot_model/library/single_axis.toml",
    } <= names
    assert len(program()) == 64
    assert differing({"a": "1", "b": "2"}, {"a": "1", "b": "3", "c": "4"}) == ["b", "c"]


def test_reported_isolation_is_that_of_the_processes(
    tmp_path: Path, steps: Steps, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Not what this machine could do: on a cluster every worker has its own."""
    assert started(tmp_path / "one").facts["isolation of the diagnosis"] == "none"

    def varied(work: Work, cases: Iterator[tuple[str, Mapping[str, bytes]]]) -> Iterator[tuple[str, Outcome]]:
        for k, (name, outcome) in enumerate(Steps()(work, cases)):
            where = "namespaces" if k else "nothing"
            yield name, Outcome("done", outcome.files, "", 1, 1.0, where)

    monkeypatch.setattr(f"{MODULE}.carried_out", varied)
    told = started(tmp_path / "two").facts["isolation of the diagnosis"]
    assert told == "3 cases: namespaces; 1 cases: nothing"


def test_rejected_scoring_input_gives_a_sentence_and_a_fault_a_traceback(
    tmp_path: Path, steps: Steps, monkeypatch: pytest.MonkeyPatch
) -> None:
    kinds: dict[Any, type[Exception]] = {"error": InputError, "failed": RuntimeError}
    for status, kind in kinds.items():

        def spoiled(work: Work, cases: Any, status: Any = status) -> Iterator[tuple[str, Outcome]]:
            for name, outcome in Steps()(work, cases):
                bad = Outcome(status, {}, "validation.csv is not what the truth makes", 1, 1.0)
                yield name, bad if work.step == "score" else outcome

        monkeypatch.setattr(f"{MODULE}.carried_out", spoiled)
        with pytest.raises(kind, match=r"cannot be scored: validation\.csv is not"):
            started(tmp_path / status)


def test_folder_is_complete_on_disk_before_it_is_renamed(
    tmp_path: Path, steps: Steps, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A disk that refuses at the last moment, when it is asked to have written."""

    def error(handle: int) -> None:
        if os.readlink(f"/proc/self/fd/{handle}").endswith("/robot.toml"):
            raise OSError(errno.EIO, "Input/output error")

    monkeypatch.setattr(os, "fsync", error)
    with pytest.raises(InputError, match="Input/output error"):
        started(tmp_path)
    assert not list(tmp_path.rglob("robot.toml"))
    assert truth(*NUMBERS).designs
