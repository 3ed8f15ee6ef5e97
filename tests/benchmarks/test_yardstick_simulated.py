"""The simulated yardstick: kept cases and answers, resumption, and what its page tells of either half."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path

import pytest

from benchmarks.yardstick.simulated import __main__ as command
from benchmarks.yardstick.simulated import answers, cases
from missing_physics.challenge.cases.conditions import Conditions
from missing_physics.challenge.cases.numbers import YARDSTICK_SEEDS, half_of
from missing_physics.challenge.cases.truth import Design
from missing_physics.challenge.concealing.conceal import concealed
from missing_physics.challenge.draws.design import draw_design
from missing_physics.challenge.processes.stage import Outcome
from missing_physics.challenge.scoring.score import scored
from robot_model import EffectUse, InputError, Reference

#: A number for development whose robot is the single axis.
AXIS = 10003
COULOMB = EffectUse.model_validate({"effect": "coulomb_friction", "at": "joint1", "torque": 8.0})


def short(number: int) -> Design:
    """The axis with recordings of a second and friction hidden, whatever the number."""
    drawn = draw_design(AXIS)
    nominal, name = drawn.nominal, f"{number:012d}"

    def cut(reference: Reference) -> Reference:
        return reference.model_copy(update={"duration": 1.0, "sample_rate": 200.0})

    controller = nominal.controller.model_copy(update={"sample_time": 0.0})
    changes = {"effects": (), "controller": controller, "reference": cut(nominal.reference)}
    return drawn.model_copy(
        update={
            "number": number,
            "name": name,
            "family": "plain",
            "nominal": nominal.model_copy(update=changes),
            "hidden": (COULOMB,),
            "validation": cut(drawn.validation),
            "conditions": Conditions(),
        }
    )


@cache
def made(design: bytes) -> dict[str, bytes]:
    """Files of a case, made once for all tests."""
    return dict(concealed(Design.model_validate_json(design)))


SCORES: dict[tuple[str, bytes], dict[str, bytes]] = {}


def counted(design: Design, files: dict[str, bytes]) -> dict[str, bytes]:
    """The score of an answer, worked out once for all tests."""
    key = design.model_dump_json(), files["diagnosis.json"]
    if key not in SCORES:
        SCORES[key] = scored(design, files)
    return SCORES[key]


def said(*names: str) -> bytes:
    findings = [
        {"effect": name, "location": "joint1", "probability": 0.9, "parameters": {}, "ambiguous_with": []}
        for name in names
    ]
    answer = {"verdict": "explained", "findings": findings, "mismatch": []}
    return json.dumps({**answer, "fit": {"validation_improvement": 0.5}}).encode()


class Steps:
    """Stands in for the processes; counts what it did, and stops where it is told to."""

    def __init__(self) -> None:
        self.done: list[str] = []
        self.names: tuple[str, ...] = ("coulomb_friction",)
        self.stop_at = -1
        self.given: list[dict[str, bytes]] = []
        self.hidden: list[Path] = []

    def __call__(
        self, step: str, files: dict[str, bytes], *, hidden: list[Path] | tuple[()] = ()
    ) -> tuple[Outcome, float]:
        if len(self.done) == self.stop_at:
            self.stop_at = -1
            raise KeyboardInterrupt
        self.done.append(step)
        if step == "conceal":
            return Outcome("done", made(files["design.json"]), "", 1, 9.0), 2.0
        self.given.append(dict(files))
        self.hidden += hidden
        answer = {"diagnosis.json": said(*self.names), "robot.augmented.toml": files["robot.toml"]}
        return Outcome("done", answer, "", 1, 9.0), 3.0


@pytest.fixture
def steps(monkeypatch: pytest.MonkeyPatch) -> Steps:
    processes = Steps()
    monkeypatch.setattr(cases, "draw_design", short)
    monkeypatch.setattr(cases, "measured_step", processes)
    monkeypatch.setattr(answers, "measured_step", processes)
    monkeypatch.setattr(answers, "scored", counted)
    monkeypatch.setattr(answers, "engine", lambda: "this one")
    return processes


def run(folder: Path, *more: str) -> int:
    return command.main(["--folder", str(folder), "--cases", "2", *more])


def results(folder: Path, label: str = "engine") -> dict:
    return json.loads((folder / f"{label}.json").read_text())


def test_every_case_has_its_score(tmp_path: Path, steps: Steps) -> None:
    assert run(tmp_path) == 0
    one, other = results(tmp_path)["cases"]
    assert (one["number"], one["half"], other["half"]) == (50000, "looked", "counted")
    assert one["log_score"] == pytest.approx(-0.105360516)  # log 0.9
    assert one["brier"] == pytest.approx(0.01)
    assert one["seconds"] == 3.0  # of a processor, not of the clock
    assert set(one["held_out"]["joint1"]) == {"noise", "nominal", "answer"}
    assert one["right_name"] is True
    assert one["conditions"]["torque"] == "measured"


def test_a_diagnosis_gets_the_case_and_is_kept_from_the_folder(tmp_path: Path, steps: Steps) -> None:
    run(tmp_path)
    assert all(set(given) == {"robot.toml", "recording.csv", "validation.csv"} for given in steps.given)
    assert set(steps.hidden) == {tmp_path}
    folders = [path.name for path in (tmp_path / "cases").iterdir()]
    assert sorted(folders) == sorted(short(number).name for number in (50000, 50001))


@pytest.mark.parametrize("at", range(4))
def test_an_interrupted_run_goes_on(tmp_path: Path, steps: Steps, at: int) -> None:
    steps.stop_at = at
    assert run(tmp_path) == 130
    assert run(tmp_path) == 0
    assert sorted(steps.done) == ["conceal", "conceal", "diagnose", "diagnose"]


def test_two_engines_are_compared_on_the_same_cases(
    tmp_path: Path, steps: Steps, monkeypatch: pytest.MonkeyPatch
) -> None:
    run(tmp_path, "--engine-label", "old")
    steps.names = ("payload",)
    monkeypatch.setattr(answers, "engine", lambda: "another")
    assert run(tmp_path, "--engine-label", "new", "--against", str(tmp_path / "old.json")) == 0
    assert steps.done.count("conceal") == 2  # the cases were there
    found = results(tmp_path, "new")["comparison"]
    assert (found["against"], found["cases"]) == ("old", 2)
    [named] = [row for row in found["differences"] if row["name"] == "name right, identifiable"]
    assert (named["better"], named["worse"]) == (0, 2)
    assert "## Beside `old`" in (tmp_path / "new.md").read_text()


def test_a_label_is_one_engine(
    tmp_path: Path,
    steps: Steps,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    run(tmp_path)
    monkeypatch.setattr(answers, "engine", lambda: "another")
    assert run(tmp_path) == 2
    assert "give another --engine-label" in capsys.readouterr().err


def test_a_case_that_is_drawn_otherwise_is_made_and_answered_again(
    tmp_path: Path, steps: Steps, monkeypatch: pytest.MonkeyPatch
) -> None:
    run(tmp_path)

    def other(number: int) -> Design:
        stronger = COULOMB.model_copy(update={"torque": 9.0})
        return short(number).model_copy(update={"hidden": (stronger,)})

    monkeypatch.setattr(cases, "draw_design", other)
    assert run(tmp_path) == 0
    assert steps.done.count("conceal") == steps.done.count("diagnose") == 4


def test_a_changed_file_of_a_case_is_named(
    tmp_path: Path, steps: Steps, capsys: pytest.CaptureFixture[str]
) -> None:
    run(tmp_path)
    [path, _] = sorted((tmp_path / "cases").glob("*/recording.csv"))
    path.write_bytes(b"time\n")
    assert run(tmp_path) == 2
    assert "recording.csv was changed" in capsys.readouterr().err


def test_cases_can_be_made_beforehand(tmp_path: Path, steps: Steps) -> None:
    assert run(tmp_path, "--make-only") == 0
    assert steps.done == ["conceal", "conceal"]
    assert not (tmp_path / "answers").exists()


def test_the_half_that_is_counted_only_shows_no_case(tmp_path: Path, steps: Steps) -> None:
    steps.names = ("payload",)  # wrong in both cases
    run(tmp_path)
    page = (tmp_path / "engine.md").read_text()
    assert "- 50000 (plain" in page
    assert "50001" not in page
    assert "| another name at the place | 1 | 1 |" in page


def test_a_case_that_cannot_be_made_is_reported(
    tmp_path: Path, steps: Steps, monkeypatch: pytest.MonkeyPatch
) -> None:
    refused = (Outcome("refused", {}, "joint1 ran away", 1, 1.0), 1.0)
    monkeypatch.setattr(cases, "measured_step", lambda *step: refused)
    assert run(tmp_path, "--half", "looked") == 0
    assert results(tmp_path)["unmade"] == {"50000": "joint1 ran away", "50002": "joint1 ran away"}
    assert run(tmp_path, "--half", "looked") == 0
    assert "50002: joint1 ran away" in (tmp_path / "engine.md").read_text()


def test_halves_and_their_first_cases() -> None:
    assert command.numbers_of("both") == list(YARDSTICK_SEEDS)
    assert {half_of(number) for number in command.numbers_of("counted")} == {"counted"}
    assert command.numbers_of("looked", 3) == [50000, 50002, 50004]


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (["--cases", "0"], "--cases is 0"),
        (["--engine-label", "../x"], "is no name for a folder"),
        (["--against", "nothing.json"], "nothing.json cannot be read"),
        (["--out", "page.md"], "give the name of a JSON file"),
    ],
)
def test_bad_words_are_refused_before_any_work(
    tmp_path: Path, steps: Steps, words: list[str], complaint: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert command.main(["--folder", str(tmp_path), *words]) == 2
    assert complaint in capsys.readouterr().err
    assert not steps.done


def test_scores_of_something_else_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "x.json"
    for content in ("{", "[]", '{"engine": "a", "cases": [{}]}', '{"engine": "a", "cases": 3}'):
        path.write_text(content)
        with pytest.raises(InputError, match="no scores of this yardstick"):
            command.scores_of(path)
