"""Run a challenge: conceal, seal, diagnose, open, score; an interrupted challenge is resumed."""

from __future__ import annotations

import json
import secrets
import shutil
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from missing_physics.challenge.cases.truth import SCHEMA, Design, Truth, canonical, commitment
from missing_physics.challenge.concealing.conceal import EXACT, FILES
from missing_physics.challenge.draws.design import draw_truth
from missing_physics.challenge.processes.stage import KEPT, Outcome, Step, carry_out
from missing_physics.challenge.processes.workers import Work, carried_out
from missing_physics.challenge.scoring.result import Report, case_score
from missing_physics.challenge.seals.opening import (
    cases_fingerprint,
    check_cases,
    checked_answers,
    opened_by,
)
from missing_physics.challenge.seals.records import Answer, Answers, Made, Opened, Scoring, Sealed
from missing_physics.challenge.seals.seal import digest, new_key, seal, unseal
from missing_physics.challenge.seals.sources import differing, program, sources
from missing_physics.challenge.seals.store import Store, said
from robot_model import InputError, write_atomically

__all__ = ["Settings", "program", "run", "show"]

#: Advice if the disk or the memory is full.
CORRECT_IT = "What is finished is kept: correct that and run the same command again."
Files = Mapping[str, bytes]


@dataclass(frozen=True)
class Settings:
    """Settings of a challenge.

    Attributes:
        seed: number of the first case.
        cases: number of cases.
        folder: output folder.
        workers: number of parallel processes on this machine; 0 for one per core.
        scheduler: address of a dask scheduler to use instead.
        tell: progress callback, called with a phrase and the fraction that is done.
        say: called with the fingerprints that a witness may want to write down.
    """

    seed: int
    cases: int
    folder: Path
    workers: int = 0
    scheduler: str = ""
    tell: Callable[[str, float], None] = field(default=lambda phrase, share: None)
    say: Callable[[str], None] = field(default=lambda sentence: None)


def run(settings: Settings) -> Report:
    """Run the challenge, or what remains of an earlier run.

    Raises:
        InputError: the folder contains another challenge, a case, a key or an answer was changed, or the
            disk is full.
    """
    if settings.cases < 1 or settings.seed < 0:
        raise InputError("a challenge needs at least one case and a seed that is not negative.")
    settings.tell("drawing the cases", 0.0)
    truth = draw_truth(settings.seed, settings.cases)
    store = Store(settings.folder)
    with store.locked():
        # Answers given before the seal was opened are final; the scoring program may be corrected.
        answered = store.path("opened.json").exists()
        identity = {"schema": SCHEMA, "truth_sha256": commitment(truth), "program": program()}
        store.claim(identity, free=("program",) if answered else ())
        store.tidy()
        return _Challenge(settings, store, truth).run()


class _Challenge:
    def __init__(self, settings: Settings, store: Store, truth: Truth) -> None:
        self.settings, self.store, self.truth = settings, store, truth
        self.designs = {design.name: design for design in truth.designs}
        self.names = sorted(self.designs)  # alphabetical, hence unrelated to the case numbers
        self.sources = sources()
        #: Unique to this truth, program and run, since a scheduler may serve several.
        self.tag = digest(f"{commitment(truth)} {program()} {secrets.token_hex(16)}".encode())[:16]
        self.key = new_key()  # in this process's memory only, until the answers are on disk

    def run(self) -> Report:
        self._conceal()
        if not self.store.path("opened.json").exists():
            self._seal()
            self._diagnose()
            self._open()
        self._score()
        return self._report()

    def _made(self) -> Iterator[str]:
        """Names of the cases that could be generated."""
        for name in self.names:
            entry = self.store.record(Made, "manifest", f"{name}.json")
            if entry is not None and entry.status == "done":
                yield name

    def _work(self, step: Step, waiting: list[str], files: Callable[[str], Files]) -> Iterator[Any]:
        """Outcomes of a step; a full disk or memory, or a changed program, raises `InputError`."""
        work = Work(
            step,
            hidden=[str(self.store.folder.resolve())],
            workers=self.settings.workers,
            scheduler=self.settings.scheduler,
            tag=self.tag,
        )
        phrase = {"conceal": "simulating", "diagnose": "diagnosing", "score": "scoring"}[step]
        self.settings.tell(f"{phrase} {len(waiting)} cases", 0.0)
        outcomes = carried_out(work, ((name, files(name)) for name in waiting))
        for done, (name, outcome) in enumerate(outcomes, start=1):
            if outcome.status == "stopped":
                raise InputError(f"cannot go on: {outcome.message.rstrip('.')}. {CORRECT_IT}")
            self._check_program()
            yield name, outcome
            self.settings.tell(f"{phrase} {len(waiting)} cases", done / len(waiting))

    def _check_program(self) -> None:
        names = differing(self.sources, sources())
        if names:
            raise InputError(
                f"the program was changed while it ran ({', '.join(names)}). What was finished before is "
                "kept: undo the change and run the same command again, or begin again with another --out."
            )

    def _conceal(self) -> None:
        waiting = [name for name in self.names if self.store.record(Made, "manifest", f"{name}.json") is None]
        if waiting and self.store.path("seal.json").exists():
            raise InputError(
                f"{self.store.path('manifest', waiting[0])}.json is missing, though the cases were sealed; "
                "begin a new challenge with another --out."
            )
        for name, outcome in self._work("conceal", waiting, lambda n: _design_file(self.designs[n])):
            entry: dict[str, Any] = {"status": outcome.status, "message": outcome.message, "files": {}}
            if outcome.status == "done":
                files = {file: outcome.files[file] for file in FILES}
                entry["files"] = self.store.keep("cases", name, files)
                write_atomically(self._exact(name), seal(outcome.files[EXACT], self.key))
            self.store.write(entry, "manifest", f"{name}.json")

    def _exact(self, name: str) -> Path:
        """The sealed recordings without sensors, which save simulating the case again for the score."""
        return self.store.path("sealed", f"{name}.bin")

    def _seal(self) -> None:
        """Encrypt the truth with a new key and record its fingerprint before anything is diagnosed."""
        known = self.store.record(Sealed, "seal.json")
        if known is None:
            answers = [self.store.path("answers", name) for name in self.names]
            if any(path.exists() for path in (*answers, self.store.path("answers.json"))):
                raise InputError(
                    f"{self.store.path('seal.json')} is missing, though there are answers, so that "
                    "one cannot prove what was sealed before them; begin a new challenge with another --out."
                )
            known = Sealed(cases_sha256=cases_fingerprint(self.store, self.names))
        check_cases(self.store, self.names, known)
        for number, expected in enumerate(known.sealed, start=1):
            self.store.files("sealed", ".", {f"{number}.bin": expected})
        sealed = seal(canonical(self.truth), self.key)
        number = len(known.sealed) + 1
        write_atomically(self.store.path("sealed", f"{number}.bin"), sealed)
        known = known.model_copy(update={"sealed": (*known.sealed, digest(sealed))})
        self.store.write(known.model_dump(), "seal.json")
        self.settings.say(f"truth  SHA-256 {commitment(self.truth)}")
        self.settings.say(f"sealed SHA-256 {known.sealed[-1]}  ({self.store.path('sealed')}/{number}.bin)")

    def _diagnose(self) -> None:
        made = list(self._made())
        for name in made:
            self._answer(name)  # a changed answer is reported before time is spent
        waiting = [name for name in made if self._answer(name) is None]
        for name, outcome in self._work("diagnose", waiting, self._case):
            self._keep_answer(name, outcome)

    def _case(self, name: str) -> dict[str, bytes]:
        made = self.store.expected(Made, "manifest", f"{name}.json")
        return self.store.files("cases", name, made.files)

    def _keep_answer(self, name: str, outcome: Outcome) -> None:
        facts = {
            "status": outcome.status,
            "message": outcome.message,
            "attempts": outcome.attempts,
            "seconds": round(outcome.seconds, 2),
            "isolation": outcome.isolation,
            "files": {file: digest(content) for file, content in outcome.files.items()},
        }
        text = (json.dumps(facts, indent=1, sort_keys=True) + "\n").encode()
        self.store.keep("answers", name, {**outcome.files, "answer.json": text})

    def _answer(self, name: str) -> dict[str, bytes] | None:
        """The files of an answer, checked; None if there is none yet."""
        facts = self.store.record(Answer, "answers", name, "answer.json")
        if facts is None:
            return None
        files = self.store.files("answers", name, facts.files)
        return {**files, "answer.json": self.store.path("answers", name, "answer.json").read_bytes()}

    def _open(self) -> None:
        """Record the fingerprints of the answers, then decrypt the truth and check its fingerprint."""
        self._check_program()
        answers = {name: self._fingerprint(name) for name in self._made()}
        before = self.store.record(Answers, "answers.json")
        if before is not None and before.answers != answers:  # an earlier run reached this point
            names = sorted(n for n in {*answers, *before.answers} if answers.get(n) != before.answers.get(n))
            raise InputError(
                f"{self.store.path('answers', names[0])} does not match its fingerprint in "
                f"{self.store.path('answers.json')}; begin a new challenge with another --out."
            )
        self.store.write({"answers": answers}, "answers.json")
        total = digest(self.store.path("answers.json").read_bytes())
        self.settings.say(f"answers SHA-256 {total}")
        fingerprints = self.store.expected(Sealed, "seal.json").sealed
        last = f"{len(fingerprints)}.bin"
        sealed = self.store.files("sealed", ".", {last: fingerprints[-1]})[last]
        opened = unseal(sealed, self.key, what=str(self.store.path("sealed", last)))
        if digest(opened) != commitment(self.truth):
            raise InputError(f"{self.store.path('sealed', last)} does not hold the truth that was promised.")
        self.store.write(
            {
                "key": self.key.hex(),
                "sealed": last,
                "seed": self.settings.seed,
                "answers_sha256": total,
                "truth": json.loads(opened),
            },
            "opened.json",
        )

    def _fingerprint(self, name: str) -> str:
        answer = self._answer(name)
        assert answer is not None
        return digest(b"\0".join(answer[file] for file in sorted(answer)))

    def _score(self) -> None:
        opened = opened_by(self.store)
        check_cases(self.store, self.names, self.store.expected(Sealed, "seal.json"))
        promised = checked_answers(self.store, self._made(), opened)
        for name, expected in promised.items():
            self._case(name)
            if self._answer(name) is None or self._fingerprint(name) != expected:
                raise InputError(
                    f"{self.store.path('answers', name)} was changed after the seal was opened; begin a new "
                    "challenge with another --out."
                )
        scores = self._scored()
        refused: list[tuple[str, str]] = []
        waiting = [name for name in promised if name not in scores]
        for name, outcome in self._work("score", waiting, self._to_score):
            if outcome.status != "done":
                words = f"case {self.designs[name].number} cannot be scored: {outcome.message}"
                refused.append((outcome.status, words))
                continue
            content = outcome.files["score.json"]
            write_atomically(self.store.path("scores", f"{name}.json"), content)
            scores[name] = digest(content)
            self.store.write({"program": program(), "scores": scores}, "scoring.json")
            self._exact(name).unlink(missing_ok=True)
        if refused:
            kind = RuntimeError if any(status == "failed" for status, _ in refused) else InputError
            raise kind("\n".join(words for _, words in refused))

    def _scored(self) -> dict[str, str]:
        """Fingerprints of the scores by this program, checked; those by another version are removed."""
        scoring = self.store.record(Scoring, "scoring.json")
        if scoring is None or scoring.program != program():
            shutil.rmtree(self.store.path("scores"), ignore_errors=True)
            scoring = Scoring(program=program())
            self.store.write(scoring.model_dump(), "scoring.json")
        for name, expected in scoring.scores.items():
            self.store.files("scores", ".", {f"{name}.json": expected})
        return dict(scoring.scores)

    def _to_score(self, name: str) -> dict[str, bytes]:
        answer = self._answer(name)
        assert answer is not None
        files = {**_design_file(self.designs[name]), **answer, **self._case(name)}
        path, key = self._exact(name), bytes.fromhex(self.store.expected(Opened, "opened.json").key)
        with suppress(InputError, OSError):  # sealed by an earlier run, whose key is lost: simulated again
            files[EXACT] = unseal(path.read_bytes(), key, what=str(path))
        return files

    def _report(self) -> Report:
        scores, unmade = [], {}
        for name in self.names:
            entry = self.store.expected(Made, "manifest", f"{name}.json")
            if entry.status != "done":
                unmade[self.designs[name].number] = entry.message
                continue
            try:
                scores.append(case_score(self.store.read("scores", f"{name}.json")))
            except (AttributeError, KeyError, TypeError):
                path = self.store.path("scores", f"{name}.json")
                raise InputError(f"{path} was changed: it is no score; remove scoring.json.") from None
        scores.sort(key=lambda score: score.number)
        return Report(tuple(scores), unmade, self._facts())

    def _facts(self) -> dict[str, Any]:
        sealed, opened = self.store.expected(Sealed, "seal.json"), self.store.expected(Opened, "opened.json")
        return {
            "first case": self.settings.seed,
            "cases": self.settings.cases,
            "isolation of the diagnosis": self._isolation(),
            "SHA-256 of the truth": commitment(self.truth),
            "SHA-256 of the sealed file": sealed.sealed[-1],
            "SHA-256 of all cases": sealed.cases_sha256,
            "SHA-256 of all answers": opened.answers_sha256,
            "times the truth was sealed": len(sealed.sealed),
            "program that made cases and answers": self.store.read("challenge.json")["program"],
            "program that scored": program(),
        }

    def _isolation(self) -> str:
        """Isolation reported by the diagnosing processes, with the number of cases of each kind."""
        answers = (self.store.expected(Answer, "answers", name, "answer.json") for name in self._made())
        kinds = Counter(answer.isolation for answer in answers)
        if len(kinds) < 2:
            return next(iter(kinds), "no diagnosis ran")
        return "; ".join(f"{count} cases: {kind}" for kind, count in kinds.most_common())


def show(folder: Path, number: int) -> Path:
    """Diagnose one case of an opened challenge again, with its report and `comparison.rrd`.

    Returns:
        The folder of the results.

    Raises:
        InputError: the challenge is not opened yet, has no such case, or the case cannot be diagnosed.
    """
    store = Store(folder)
    if not store.path("opened.json").exists():
        raise InputError(f"{folder} holds no challenge that has been opened; run the challenge to its end.")
    with said(folder):
        truth = opened_by(store).truth
        check_cases(
            store, sorted(design.name for design in truth.designs), store.expected(Sealed, "seal.json")
        )
        design = next((design for design in truth.designs if design.number == number), None)
        if design is None:
            numbers = [design.number for design in truth.designs]
            raise InputError(f"there is no case {number}; there are {min(numbers)} to {max(numbers)}.")
        entry = store.expected(Made, "manifest", f"{design.name}.json")
        if entry.status != "done":
            raise InputError(f"case {number} could not be made: {entry.message}")
        files = store.files("cases", design.name, entry.files)
        outcome = carry_out("diagnose", files, hidden=(str(folder.resolve()),), keep=KEPT)
        if outcome.status != "done":
            raise InputError(f"case {number} has no answer: {outcome.message}")
        store.keep("shown", str(number), {**files, **outcome.files, **_design_file(design)})
    return store.path("shown", str(number))


def _design_file(design: Design) -> dict[str, bytes]:
    return {"design.json": design.model_dump_json().encode()}
