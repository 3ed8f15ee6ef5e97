"""The course of a challenge: order, resumption, and detection of tampering."""

from __future__ import annotations

import errno
import json
from contextlib import suppress
from pathlib import Path

import pytest
from challenge_cases import ARM, AXIS, Steps, steps_of, truth

from missing_physics.challenge import Settings, run, show
from missing_physics.challenge.cases.truth import commitment
from missing_physics.challenge.scoring.result import Report
from missing_physics.challenge.seals.seal import digest, unseal
from robot_model import InputError

NUMBERS = (10001, 10002, AXIS, ARM)
MODULE = "missing_physics.challenge.course"


@pytest.fixture
def steps(monkeypatch: pytest.MonkeyPatch) -> Steps:
    """Instant processes, and a truth that is drawn at once."""
    made, known = Steps(), truth(*NUMBERS)
    monkeypatch.setattr(f"{MODULE}.carried_out", made)
    monkeypatch.setattr(f"{MODULE}.draw_truth", lambda first, cases: known)
    monkeypatch.setattr(f"{MODULE}.program", lambda: "this one")
    monkeypatch.setattr(f"{MODULE}.sources", lambda: {"a.py": "as it is"})
    return made


def marked(value: int, quick: bool) -> object:
    """A parameter of which only some values are quick tests, and all a proof."""
    return pytest.param(value, marks=() if quick else pytest.mark.proof)


def started(folder: Path, **more: object) -> Report:
    return run(Settings(seed=10000, cases=4, folder=folder, **more))  # type: ignore[arg-type]


def test_truth_is_sealed_before_the_diagnosis_and_opened_after_it(tmp_path: Path, steps: Steps) -> None:
    message: list[tuple[str, int]] = []
    known = truth(*NUMBERS)
    report = started(
        tmp_path, say=lambda words: message.append((words, len(steps_of(steps.done, "diagnose"))))
    )
    assert [score.number for score in report.scores] == sorted(NUMBERS)
    sealed = (tmp_path / "sealed" / "1.bin").read_bytes()
    assert message[0] == (f"truth  SHA-256 {commitment(known)}", 0)
    assert digest(sealed) in message[1][0]
    assert message[1][1] == 0
    assert message[2][0].startswith("answers SHA-256")
    assert message[2][1] == len(NUMBERS)
    opened = json.loads((tmp_path / "opened.json").read_text())
    assert digest(unseal(sealed, bytes.fromhex(opened["key"]), what="it")) == commitment(known)
    assert opened["truth"]["designs"][0]["number"] == NUMBERS[0]


def test_diagnosis_receives_only_the_files_of_its_case(tmp_path: Path, steps: Steps) -> None:
    started(tmp_path)
    for (step, _), files in steps.seen.items():
        if step == "diagnose":
            assert set(files) == {"robot.toml", "recording.csv", "validation.csv"}


def test_cases_are_worked_on_in_the_order_of_their_random_names(tmp_path: Path, steps: Steps) -> None:
    started(tmp_path)
    names = steps_of(steps.done, "diagnose")
    assert names == sorted(names)


@pytest.mark.parametrize("at", [marked(at, at in (0, 3, 4, 7, 8, 11)) for at in range(12)])
def test_interrupted_challenge_is_resumed(tmp_path: Path, steps: Steps, at: int) -> None:
    """Interrupted before each of the twelve processes in turn; none is carried out twice."""
    steps.interrupt_at = at
    with pytest.raises(KeyboardInterrupt):
        started(tmp_path)
    report = started(tmp_path)
    assert len(report.scores) == len(NUMBERS)
    assert len(steps.done) == len(set(steps.done)) == 3 * len(NUMBERS)
    sealings = 2 if 4 <= at < 8 else 1
    assert report.facts["times the truth was sealed"] == sealings
    assert not list(tmp_path.rglob(".writing-*"))


def test_finished_challenge_is_only_summarised_again(tmp_path: Path, steps: Steps) -> None:
    first = started(tmp_path)
    done = len(steps.done)
    assert started(tmp_path) == first
    assert len(steps.done) == done


@pytest.mark.parametrize("file", ["robot.toml", "recording.csv", "validation.csv"])
def test_changed_case_is_detected(tmp_path: Path, steps: Steps, file: str) -> None:
    steps.interrupt_at = 5
    with pytest.raises(KeyboardInterrupt):
        started(tmp_path)
    name = sorted(path.name for path in (tmp_path / "cases").iterdir())[2]
    (tmp_path / "cases" / name / file).write_bytes(b"other")
    with pytest.raises(InputError, match=rf"{name}/{file} was changed"):
        started(tmp_path)


def test_missing_case_is_detected(tmp_path: Path, steps: Steps) -> None:
    steps.interrupt_at = 5
    with pytest.raises(KeyboardInterrupt):
        started(tmp_path)
    victim = sorted((tmp_path / "cases").iterdir())[2] / "robot.toml"
    victim.unlink()
    with pytest.raises(InputError, match=r"robot\.toml is missing"):
        started(tmp_path)


@pytest.mark.parametrize("when", [6, 9], ids=["before opening", "after opening"])
def test_changed_answer_is_detected(tmp_path: Path, steps: Steps, when: int) -> None:
    steps.interrupt_at = when
    with pytest.raises(KeyboardInterrupt):
        started(tmp_path)
    name = steps_of(steps.done, "diagnose")[-1]
    (tmp_path / "answers" / name / "diagnosis.json").write_text("{}")
    with pytest.raises(InputError, match=rf"{name}/diagnosis\.json was changed"):
        started(tmp_path)


def test_answer_changed_together_with_its_fingerprint_is_detected(tmp_path: Path, steps: Steps) -> None:
    steps.interrupt_at = 8
    with pytest.raises(KeyboardInterrupt):
        started(tmp_path)
    folder = next((tmp_path / "answers").iterdir())
    (folder / "diagnosis.json").write_text("{}")
    facts = json.loads((folder / "answer.json").read_text())
    facts["files"]["diagnosis.json"] = digest(b"{}")
    (folder / "answer.json").write_text(json.dumps(facts))
    with pytest.raises(InputError, match="changed after the seal was opened"):
        started(tmp_path)


def test_changed_seal_is_detected(tmp_path: Path, steps: Steps) -> None:
    steps.interrupt_at = 5
    with pytest.raises(KeyboardInterrupt):
        started(tmp_path)
    (tmp_path / "sealed" / "1.bin").write_bytes(b"other")
    with pytest.raises(InputError, match=r"1\.bin was changed"):
        started(tmp_path)


def test_changed_manifest_is_detected(tmp_path: Path, steps: Steps) -> None:
    steps.interrupt_at = 5
    with pytest.raises(KeyboardInterrupt):
        started(tmp_path)
    entry = next((tmp_path / "manifest").iterdir())
    entry.write_text(entry.read_text().replace("done", "refused"))
    with pytest.raises(InputError, match="manifest was changed"):
        started(tmp_path)


@pytest.mark.parametrize("key", ["00" * 32, "no key"])
def test_changed_key_is_detected(tmp_path: Path, steps: Steps, key: str) -> None:
    started(tmp_path)
    path = tmp_path / "opened.json"
    opened = json.loads(path.read_text())
    path.write_text(json.dumps({**opened, "key": key}))
    with pytest.raises(InputError, match="key"):
        started(tmp_path)


def test_two_challenges_do_not_mix(tmp_path: Path, steps: Steps, monkeypatch: pytest.MonkeyPatch) -> None:
    started(tmp_path)
    other = truth(*NUMBERS[:3])
    monkeypatch.setattr(f"{MODULE}.draw_truth", lambda first, cases: other)
    with pytest.raises(InputError, match="holds another challenge"):
        started(tmp_path)


def test_another_program_version_does_not_resume(
    tmp_path: Path, steps: Steps, monkeypatch: pytest.MonkeyPatch
) -> None:
    steps.interrupt_at = 3 * len(NUMBERS) - 5  # one answer is owed
    with pytest.raises(KeyboardInterrupt):
        started(tmp_path)
    monkeypatch.setattr(f"{MODULE}.program", lambda: "another")
    with pytest.raises(InputError, match="its program differs"):
        started(tmp_path)


def test_answers_can_be_scored_again(tmp_path: Path, steps: Steps, monkeypatch: pytest.MonkeyPatch) -> None:
    """When all answers are on disk a fault of the scoring may be corrected: all is scored again, and told."""
    steps.interrupt_at = 3 * len(NUMBERS) - 2  # two are scored
    with pytest.raises(KeyboardInterrupt):
        started(tmp_path)
    monkeypatch.setattr(f"{MODULE}.program", lambda: "another")
    report = started(tmp_path)
    assert len(steps_of(steps.done, "diagnose")) == len(NUMBERS)
    assert len(steps_of(steps.done, "score")) == 2 + len(NUMBERS)
    assert report.facts["program that made cases and answers"] == "this one"
    assert report.facts["program that scored"] == "another"


def test_folder_with_cases_but_no_challenge_is_rejected(tmp_path: Path, steps: Steps) -> None:
    (tmp_path / "cases").mkdir()
    with pytest.raises(InputError, match=r"no challenge\.json"):
        started(tmp_path)


def test_only_one_process_uses_a_folder(tmp_path: Path, steps: Steps) -> None:
    def second(words: str) -> None:
        with pytest.raises(InputError, match="another challenge is at work"):
            started(tmp_path)

    started(tmp_path, say=second)


@pytest.mark.parametrize("when", [marked(when, when % 12 == 1) for when in range(61)])
def test_full_disk_keeps_finished_work(tmp_path: Path, steps: Steps, when: int) -> None:
    """The n-th write to the disk fails; then there is room again."""
    writes = iter(range(10**6))
    real = Path.write_bytes

    def full(path: Path, content: bytes) -> int:
        if next(writes) == when:
            raise OSError(errno.ENOSPC, "No space left on device")
        return real(path, content)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Path, "write_bytes", full)
        with suppress(InputError):  # late writes are never reached
            started(tmp_path)
    assert len(started(tmp_path).scores) == len(NUMBERS)


def test_a_full_disk_is_reported(tmp_path: Path, steps: Steps, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(path: Path, content: bytes) -> int:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(InputError, match=r"No space left on device"):
        started(tmp_path)


def test_show_requires_an_opened_challenge(tmp_path: Path, steps: Steps) -> None:
    with pytest.raises(InputError, match="no challenge that has been opened"):
        show(tmp_path, AXIS)
    started(tmp_path)
    with pytest.raises(InputError, match="there is no case 5"):
        show(tmp_path, 5)


@pytest.mark.parametrize("changes", [{"cases": 0}, {"seed": -1}])
def test_invalid_settings_are_rejected(tmp_path: Path, changes: dict[str, int]) -> None:
    with pytest.raises(InputError):
        run(Settings(**{"seed": 1, "cases": 1, "folder": tmp_path, **changes}))  # type: ignore[arg-type]
