"""The cases of the yardstick: made once, stored, and made again only if their draw has changed.

cases/NAME/         robot.toml, recording.csv, validation.csv: all inputs of a diagnosis
truth/NUMBER/       design.json, exact.npz and made.json: the hidden effects, the motion without sensors,
                    and the fingerprints of the case
"""

from __future__ import annotations

import json
import resource
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from missing_physics.challenge.cases.truth import Design
from missing_physics.challenge.concealing.conceal import EXACT, FILES
from missing_physics.challenge.draws.design import draw_design
from missing_physics.challenge.processes.stage import Outcome, Step, carry_out
from missing_physics.challenge.seals.seal import digest
from missing_physics.challenge.seals.store import Store
from robot_model import InputError

__all__ = ["Case", "cases_of", "measured_step"]

#: Called with a sentence for people.
Say = Callable[[str], None]


@dataclass(frozen=True)
class Case:
    """A case of the yardstick.

    Attributes:
        number: of the case.
        design: SHA-256 of its draw.
        files: SHA-256 of each file of its folder; empty if it could not be made.
        message: why it could not be made.
        seconds: processor time of making it.
    """

    number: int
    design: str
    files: dict[str, str]
    message: str
    seconds: float

    @property
    def made(self) -> bool:
        """Whether it can be diagnosed."""
        return bool(self.files)


def cases_of(store: Store, numbers: Sequence[int], say: Say) -> Iterator[tuple[Case, Design]]:
    """The cases of these numbers with their truth, each made when needed.

    Raises `InputError` on errors of the machine, such as a full disk.
    """
    for number in numbers:
        design = draw_design(number)
        text = design.model_dump_json().encode()
        case = _kept(store, number)
        if case is None or case.design != digest(text):
            say(f"making case {number}")
            case = _make(store, design, text)
        yield case, design


def _kept(store: Store, number: int) -> Case | None:
    content = store.read("truth", str(number), "made.json")
    return None if content is None else Case(**content)


def _make(store: Store, design: Design, text: bytes) -> Case:
    outcome, seconds = measured_step("conceal", {"design.json": text})
    if outcome.status == "stopped":
        raise InputError(f"case {design.number} cannot be made: {outcome.message}")
    files, truth = {}, {"design.json": text}
    if outcome.status == "done":
        files = store.keep("cases", design.name, {name: outcome.files[name] for name in FILES})
        truth[EXACT] = outcome.files[EXACT]
    case = Case(design.number, digest(text), files, outcome.message, seconds)
    truth["made.json"] = (json.dumps(asdict(case), indent=1) + "\n").encode()
    store.keep("truth", str(design.number), truth)
    return case


def measured_step(
    step: Step, files: dict[str, bytes], *, hidden: Sequence[Path] = ()
) -> tuple[Outcome, float]:
    """A step in a separate process, and its processor time [s]."""
    before = _children()
    outcome = carry_out(step, files, hidden=tuple(str(path.resolve()) for path in hidden))
    return outcome, round(_children() - before, 2)


def _children() -> float:
    """Total processor time of ended child processes [s]."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime
