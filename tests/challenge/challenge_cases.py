"""Small designs for the tests: drawn like any other, with shortened motions."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from functools import cache

from missing_physics.challenge.cases.conditions import Conditions
from missing_physics.challenge.cases.truth import Design, Truth
from missing_physics.challenge.concealing.conceal import EXACT, FILES, Concealed
from missing_physics.challenge.draws.design import draw_design
from missing_physics.challenge.processes.stage import Outcome
from missing_physics.challenge.processes.workers import Work
from missing_physics.challenge.scoring.result import CaseScore
from robot_model import EffectUse, Reference

#: Numbers for development whose robot is the single axis or the two-link arm.
AXIS, ARM = 10003, 10005
SECONDS, RATE = 2.5, 200.0


@cache
def design(number: int = AXIS, *, seconds: float = SECONDS) -> Design:
    """The case of that number with short recordings and nothing hidden."""
    return short(numbered(number), seconds=seconds)


def made(case: Design) -> Concealed:
    """The case carried out, once for all tests that ask for it: the same design makes the same numbers."""
    return _made(case.model_dump_json())


@cache
def _made(text: str) -> Concealed:
    return Concealed(Design.model_validate_json(text))


@cache
def numbered(number: int) -> Design:
    """The case of that number as it is."""
    return draw_design(number)


def plain(case: Design) -> Design:
    """A case with an exact and complete file, a continuous controller and a measured torque."""
    controller = case.nominal.controller.model_copy(update={"sample_time": 0.0})
    nominal = case.nominal.model_copy(update={"controller": controller})
    return case.model_copy(update={"nominal": nominal, "conditions": Conditions()})


def short(drawn: Design, *, seconds: float) -> Design:
    """A case with its motions cut short, under plain conditions."""
    drawn = plain(drawn)

    def cut(reference: Reference) -> Reference:
        return reference.model_copy(update={"duration": seconds, "sample_rate": RATE})

    assert drawn.nominal.reference is not None
    nominal = drawn.nominal.model_copy(update={"reference": cut(drawn.nominal.reference)})
    return drawn.model_copy(update={"nominal": nominal, "validation": cut(drawn.validation)})


def hiding(effect: str, at: str, number: int = AXIS, **values: float) -> Design:
    """The same without nominal friction and with one effect hidden."""
    use = EffectUse.model_validate({"effect": effect, "at": at, **values})
    smooth = design(number).nominal.model_copy(update={"effects": ()})
    return design(number).model_copy(update={"nominal": smooth, "hidden": (use,), "family": "plain"})


def truth(*numbers: int) -> Truth:
    return Truth(nonce="0" * 32, designs=tuple(design(number) for number in numbers))


def answer(verdict: str = "consistent", *findings: tuple[str, str, float]) -> dict[str, object]:
    """A diagnosis.json with these effects named at these places."""
    return {
        "verdict": verdict,
        "findings": [
            {"effect": e, "location": at, "probability": p, "parameters": {}, "ambiguous_with": []}
            for e, at, p in findings
        ],
        "mismatch": [],
        "fit": {"validation_improvement": 0.0},
    }


def score(**changes: object) -> CaseScore:
    """A right answer to a hidden Coulomb friction, changed as wanted."""
    values: dict[str, object] = {
        "number": 1,
        "name": "a",
        "family": "plain",
        "robot": "single_axis",
        "hidden": ("coulomb_friction@joint1",),
        "foreign": "",
        "identifiable": {"coulomb_friction@joint1": True},
        "distance": {"coulomb_friction@joint1": 1e3},
        "verdict": "explained",
        "findings": (),
        "place": True,
        "right_name": True,
        "in_set": None,
        "errors": {"nominal": 5.0, "answer": 1.4, "truth": 1.0},
        "models": {},
        "stated_improvement": 0.7,
        "seconds": 3.0,
        "attempts": 1,
    }
    return CaseScore(**{**values, **changes})  # type: ignore[arg-type]


class Steps:
    """Stands in for the processes: instant outcomes, counted, with an interrupt where one is wanted."""

    def __init__(self) -> None:
        self.done: list[tuple[str, str]] = []
        self.seen: dict[tuple[str, str], Mapping[str, bytes]] = {}
        self.interrupt_at = -1

    def __call__(
        self, work: Work, cases: Iterator[tuple[str, Mapping[str, bytes]]]
    ) -> Iterator[tuple[str, Outcome]]:
        for name, files in cases:
            if len(self.done) == self.interrupt_at:
                self.interrupt_at = -1
                raise KeyboardInterrupt
            self.done.append((work.step, name))
            self.seen[work.step, name] = files
            yield name, Outcome("done", self.files(work.step, files), "", 1, 1.0, "none")

    def files(self, step: str, given: Mapping[str, bytes]) -> dict[str, bytes]:
        if step == "conceal":
            return {name: given["design.json"][:10] + name.encode() for name in (*FILES, EXACT)}
        if step == "diagnose":
            return {"diagnosis.json": json.dumps(answer()).encode(), "robot.augmented.toml": b"name = 'a'\n"}
        drawn = Design.model_validate_json(given["design.json"])
        made = score(number=drawn.number, name=drawn.name, hidden=(), identifiable={}, distance={})
        content = {**vars(made), "family": "none", "findings": [], "place": None, "right_name": None}
        return {"score.json": json.dumps(content).encode()}


def steps_of(done: Sequence[tuple[str, str]], step: str) -> list[str]:
    return [name for kind, name in done if kind == step]
