"""All of a challenge: conceal, seal, diagnose, open, score; going on where an earlier run stopped."""

from __future__ import annotations

import hashlib
import json
import shutil
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

from missing_physics.challenge.blind import isolation
from missing_physics.challenge.conceal import EXACT, FILES
from missing_physics.challenge.design import draw_truth
from missing_physics.challenge.result import Report, case_score
from missing_physics.challenge.seal import digest, new_key, seal, unseal
from missing_physics.challenge.stage import KEPT, Outcome, Step, carry_out
from missing_physics.challenge.store import Store
from missing_physics.challenge.truth import SCHEMA, Design, Truth, canonical, commitment
from missing_physics.challenge.workers import Work, carried_out
from robot_model import InputError, write_atomically

__all__ = ["Settings", "program", "run", "show"]

#: What cases and answers depend on.
ROOMS = ("robot_model", "reference_model", "exudyn_model", "missing_physics")
Files = Mapping[str, bytes]


@dataclass(frozen=True)
class Settings:
    """A challenge.

    Attributes:
        seed: number of the first case.
        cases: how many.
        folder: where everything is written.
        workers: processes at a time on this machine; 0 for one per core.
        scheduler: address of a dask scheduler to use instead.
        tell: called with a phrase and the share that is done.
        say: called with sentences that a witness may want to write down.
    """

    seed: int
    cases: int
    folder: Path
    workers: int = 0
    scheduler: str = ""
    tell: Callable[[str, float], None] = field(default=lambda phrase, share: None)
    say: Callable[[str], None] = field(default=lambda sentence: None)


def run(settings: Settings) -> Report:
    """Carry the challenge out, or what an earlier run left of it.

    Raises:
        InputError: the folder holds another challenge, somebody changed a case, a key or an answer, or the
            disk refuses.
    """
    if settings.cases < 1 or settings.seed < 0:
        raise InputError("a challenge needs at least one case and a seed that is not negative.")
    settings.tell("drawing the cases", 0.0)
    truth = draw_truth(settings.seed, settings.cases)
    store = Store(settings.folder)
    with store.locked():
        # What was answered before the seal was opened stays; how it is counted may be mended.
        answered = store.read("opened.json") is not None
        identity = {"schema": SCHEMA, "truth_sha256": commitment(truth), "program": program()}
        store.claim(identity, free=("program",) if answered else ())
        store.tidy()
        return _Challenge(settings, store, truth).run()


class _Challenge:
    def __init__(self, settings: Settings, store: Store, truth: Truth) -> None:
        self.settings, self.store, self.truth = settings, store, truth
        self.designs = {design.name: design for design in truth.designs}
        self.names = sorted(self.designs)  # alphabetical: in no relation to the numbers
        self.key = new_key()  # in this process's memory only, until the answers are on disk

    def run(self) -> Report:
        self._conceal()
        if self.store.read("opened.json") is None:
            self._seal()
            self._diagnose()
            self._open()
        self._score()
        return self._report()

    def _made(self) -> Iterator[str]:
        """Names of the cases that could be made."""
        for name in self.names:
            entry = self.store.read("manifest", f"{name}.json")
            if entry is not None and entry["status"] == "done":
                yield name

    def _work(self, step: Step, waiting: list[str], files: Callable[[str], Files]) -> Iterator[Any]:
        """Outcomes of a step, with progress."""
        work = Work(
            step,
            hidden=[str(self.store.folder.resolve())],
            workers=self.settings.workers,
            scheduler=self.settings.scheduler,
        )
        phrase = {"conceal": "simulating", "diagnose": "diagnosing", "score": "scoring"}[step]
        self.settings.tell(f"{phrase} {len(waiting)} cases", 0.0)
        outcomes = carried_out(work, ((name, files(name)) for name in waiting))
        for done, (name, outcome) in enumerate(outcomes, start=1):
            yield name, outcome
            self.settings.tell(f"{phrase} {len(waiting)} cases", done / len(waiting))

    def _conceal(self) -> None:
        waiting = [name for name in self.names if self.store.read("manifest", f"{name}.json") is None]
        for name, outcome in self._work("conceal", waiting, lambda n: _design_file(self.designs[n])):
            entry: dict[str, Any] = {"status": outcome.status, "message": outcome.message, "files": {}}
            if outcome.status == "done":
                files = {file: outcome.files[file] for file in FILES}
                entry["files"] = self.store.keep("cases", name, files)
                write_atomically(self._exact(name), seal(outcome.files[EXACT], self.key))
            self.store.write(entry, "manifest", f"{name}.json")

    def _exact(self, name: str) -> Path:
        """The sealed motion without sensors: spares a second simulation if this run comes to its end."""
        return self.store.path("sealed", f"{name}.bin")

    def _manifests(self) -> str:
        """One fingerprint of all cases."""
        parts = [self.store.path("manifest", f"{name}.json").read_bytes() for name in self.names]
        return digest(b"\0".join(parts))

    def _seal(self) -> None:
        """Seal the truth under a fresh key and write its fingerprint down before anything is diagnosed."""
        known = self.store.read("seal.json") or {"cases_sha256": self._manifests(), "sealed": []}
        if known["cases_sha256"] != self._manifests():
            raise InputError(f"{self.store.path('manifest')} was changed after the cases were sealed.")
        for number, expected in enumerate(known["sealed"], start=1):
            self.store.files("sealed", ".", {f"{number}.bin": expected})
        sealed = seal(canonical(self.truth), self.key)
        number = len(known["sealed"]) + 1
        write_atomically(self.store.path("sealed", f"{number}.bin"), sealed)
        known["sealed"].append(digest(sealed))
        known["isolation"] = isolation()
        self.store.write(known, "seal.json")
        self.settings.say(f"truth  SHA-256 {commitment(self.truth)}")
        self.settings.say(f"sealed SHA-256 {known['sealed'][-1]}  ({self.store.path('sealed')}/{number}.bin)")

    def _diagnose(self) -> None:
        made = list(self._made())
        for name in made:
            self._answer(name)  # a changed answer is told before time is spent
        waiting = [name for name in made if self._answer(name) is None]
        for name, outcome in self._work("diagnose", waiting, self._case):
            self._keep_answer(name, outcome)

    def _case(self, name: str) -> dict[str, bytes]:
        return self.store.files("cases", name, self.store.read("manifest", f"{name}.json")["files"])

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
        """The files of an answer, checked; None where there is none yet."""
        facts = self.store.read("answers", name, "answer.json")
        if facts is None:
            return None
        files = self.store.files("answers", name, facts["files"])
        return {**files, "answer.json": self.store.path("answers", name, "answer.json").read_bytes()}

    def _open(self) -> None:
        """Write down what was answered, then open what was sealed and compare it with what was promised."""
        answers = {name: self._fingerprint(name) for name in self._made()}
        self.store.write({"answers": answers}, "answers.json")
        total = digest(self.store.path("answers.json").read_bytes())
        self.settings.say(f"answers SHA-256 {total}")
        fingerprints = self.store.read("seal.json")["sealed"]
        last = f"{len(fingerprints)}.bin"
        sealed = self.store.files("sealed", ".", {last: fingerprints[-1]})[last]
        opened = unseal(sealed, self.key, what=str(self.store.path("sealed", last)))
        promised = self.store.read("challenge.json")["truth_sha256"]
        if digest(opened) != promised:
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
        promised = self.store.read("answers.json")["answers"]
        self._check_opened()
        for name, expected in promised.items():
            if self._answer(name) is None or self._fingerprint(name) != expected:
                raise InputError(
                    f"{self.store.path('answers', name)} was changed after the seal was opened; begin a new "
                    "challenge with another --out."
                )
        if self.store.read("scoring.json") != {"program": program()}:
            shutil.rmtree(self.store.path("scores"), ignore_errors=True)
            self.store.write({"program": program()}, "scoring.json")
        waiting = [name for name in promised if self.store.read("scores", f"{name}.json") is None]
        refused = []
        for name, outcome in self._work("score", waiting, self._to_score):
            if outcome.status != "done":
                refused.append(f"case {self.designs[name].number} cannot be scored: {outcome.message}")
                continue
            write_atomically(self.store.path("scores", f"{name}.json"), outcome.files["score.json"])
            self._exact(name).unlink(missing_ok=True)
        if refused:
            raise RuntimeError("\n".join(refused))

    def _check_opened(self) -> None:
        """The published key must open the sealed file and give the promised truth."""
        opened = self.store.read("opened.json")
        path = self.store.path("sealed", opened["sealed"])
        try:
            key = bytes.fromhex(opened["key"])
        except ValueError:
            raise InputError(f"the key in {self.store.path('opened.json')} was changed.") from None
        if digest(unseal(path.read_bytes(), key, what=str(path))) != commitment(self.truth):
            raise InputError(f"{path} does not hold the truth that was promised.")

    def _to_score(self, name: str) -> dict[str, bytes]:
        answer = self._answer(name)
        assert answer is not None
        files = {**_design_file(self.designs[name]), **answer, **self._case(name)}
        path, key = self._exact(name), bytes.fromhex(self.store.read("opened.json")["key"])
        with suppress(InputError, OSError):  # sealed by an earlier run, whose key is gone: simulated again
            files[EXACT] = unseal(path.read_bytes(), key, what=str(path))
        return files

    def _report(self) -> Report:
        scores, unmade = [], {}
        for name in self.names:
            entry = self.store.read("manifest", f"{name}.json")
            if entry["status"] != "done":
                unmade[self.designs[name].number] = entry["message"]
            else:
                scores.append(case_score(self.store.read("scores", f"{name}.json")))
        scores.sort(key=lambda score: score.number)
        return Report(tuple(scores), unmade, self._facts())

    def _facts(self) -> dict[str, Any]:
        sealed, opened = self.store.read("seal.json"), self.store.read("opened.json")
        return {
            "first case": self.settings.seed,
            "cases": self.settings.cases,
            "isolation of the diagnosis": sealed["isolation"],
            "SHA-256 of the truth": commitment(self.truth),
            "SHA-256 of the sealed file": sealed["sealed"][-1],
            "SHA-256 of all cases": sealed["cases_sha256"],
            "SHA-256 of all answers": opened["answers_sha256"],
            "times the truth was sealed": len(sealed["sealed"]),
            "program that made cases and answers": self.store.read("challenge.json")["program"],
            "program that scored": program(),
        }


def show(folder: Path, number: int) -> Path:
    """Diagnose one case of an opened challenge again, with its report and `comparison.rrd`.

    Returns:
        The folder that holds them.

    Raises:
        InputError: the challenge is not opened yet, has no such case, or the case cannot be diagnosed.
    """
    store = Store(folder)
    opened = store.read("opened.json")
    if opened is None:
        raise InputError(f"{folder} holds no challenge that has been opened; run the challenge to its end.")
    truth = Truth.model_validate(opened["truth"])
    design = next((design for design in truth.designs if design.number == number), None)
    if design is None:
        numbers = [design.number for design in truth.designs]
        raise InputError(f"there is no case {number}; there are {min(numbers)} to {max(numbers)}.")
    entry = store.read("manifest", f"{design.name}.json")
    if entry is None or entry["status"] != "done":
        raise InputError(f"case {number} could not be made: {entry['message'] if entry else 'no manifest'}")
    files = store.files("cases", design.name, entry["files"])
    outcome = carry_out("diagnose", files, hidden=(str(folder),), keep=KEPT)
    if outcome.status != "done":
        raise InputError(f"case {number} has no answer: {outcome.message}")
    store.keep("shown", str(number), {**files, **outcome.files, **_design_file(design)})
    return store.path("shown", str(number))


def _design_file(design: Design) -> dict[str, bytes]:
    return {"design.json": design.model_dump_json().encode()}


@cache
def program() -> str:
    """Fingerprint of the sources that cases and answers depend on."""
    root = Path(__file__).resolve().parents[2]
    state = hashlib.sha256()
    for room in ROOMS:
        for path in sorted((root / room).rglob("*")):
            if path.suffix in (".py", ".toml") and "reporting" not in path.parts:
                state.update(path.relative_to(root).as_posix().encode() + b"\0" + path.read_bytes())
    return state.hexdigest()
