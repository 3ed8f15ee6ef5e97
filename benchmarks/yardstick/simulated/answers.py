"""Answers of one engine to the cases, and their scores: kept case by case.

    answers/LABEL/engine.json       fingerprint of the engine: one label is one engine
    answers/LABEL/NAME/             diagnosis.json, robot.augmented.toml, answer.json
    scores/LABEL/NAME.json          the score, with the fingerprints of its inputs

The diagnosis runs as a user runs it: the command line in a separate process, with the case folder only.
"""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict
from typing import Any

from benchmarks.yardstick.simulated.cases import Case, measured_step
from missing_physics.challenge.cases.truth import Design
from missing_physics.challenge.concealing.conceal import EXACT
from missing_physics.challenge.scoring.result import CaseScore, case_score
from missing_physics.challenge.scoring.score import scored
from missing_physics.challenge.seals.seal import digest
from missing_physics.challenge.seals.sources import program, sources
from missing_physics.challenge.seals.store import Store
from robot_model import InputError

__all__ = ["Answers", "engine"]

#: Sources that have no part in a diagnosis.
APART = ("missing_physics/challenge/", "exudyn_model/")


def engine() -> str:
    """Fingerprint of all sources that a diagnosis depends on, as now on disk."""
    own = {name: sha for name, sha in sources().items() if not name.startswith(APART)}
    return hashlib.sha256(json.dumps(own, sort_keys=True).encode()).hexdigest()


class Answers:
    """The answers of one engine.

    Attributes:
        store: folder of the yardstick.
        label: of the engine, a name for a folder.
    """

    def __init__(self, store: Store, label: str) -> None:
        self.store, self.label = store, label
        self._program = program()

    def claim(self) -> None:
        """Start or continue with this engine; raises `InputError` if the label belongs to another one."""
        known, own = self.store.read("answers", self.label, "engine.json"), {"sha256": engine()}
        if known is None:
            self.store.write(own, "answers", self.label, "engine.json")
        elif known != own:
            raise InputError(
                f"the answers under the label '{self.label}' were given by another version of the engine; "
                f"give another --engine-label, or remove {self.store.path('answers', self.label)}."
            )

    def score(self, case: Case, design: Design) -> CaseScore:
        """The score of a case; it is diagnosed if it has no answer yet.

        Raises:
            InputError: a file of the case was changed, or the machine refuses something.
        """
        files = self.store.files("cases", design.name, case.files)
        answer = self._answer(case, design) or self._diagnose(case, design, files)
        basis = {"program": self._program, "answer": digest(answer["answer.json"])}
        kept = self.store.read("scores", self.label, f"{design.name}.json")
        if kept is not None and kept["basis"] == basis:
            return case_score(kept["score"])
        exact = self.store.path("truth", str(case.number), EXACT).read_bytes()
        try:
            score = json.loads(scored(design, {**files, **answer, EXACT: exact})["score.json"])
        except InputError as error:
            raise InputError(
                f"case {case.number}: {error} The program that makes cases has changed since; remove "
                f"{self.store.path('truth')} to have them made again."
            ) from None
        self.store.write({"basis": basis, "score": score}, "scores", self.label, f"{design.name}.json")
        return case_score(score)

    def _answer(self, case: Case, design: Design) -> dict[str, bytes] | None:
        """The files of the answer to exactly this case; None if there is none."""
        facts = self.store.read("answers", self.label, design.name, "answer.json")
        if facts is None or facts["case"] != case.files:
            return None
        found = self.store.files(f"answers/{self.label}", design.name, facts["files"])
        path = self.store.path("answers", self.label, design.name, "answer.json")
        return {**found, "answer.json": path.read_bytes()}

    def _diagnose(self, case: Case, design: Design, files: dict[str, bytes]) -> dict[str, bytes]:
        outcome, seconds = measured_step("diagnose", files, hidden=[self.store.folder])
        if outcome.status == "stopped":
            raise InputError(f"case {case.number} cannot be diagnosed: {outcome.message}")
        facts: dict[str, Any] = {**asdict(outcome), "seconds": seconds, "case": case.files}
        facts["files"] = {name: digest(content) for name, content in outcome.files.items()}
        text = (json.dumps(facts, indent=1, sort_keys=True) + "\n").encode()
        answer = {**outcome.files, "answer.json": text}
        self.store.keep(f"answers/{self.label}", design.name, answer)
        return answer
