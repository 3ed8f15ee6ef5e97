"""What a free base tells of joints that cannot be seen: proofs in recordings made by Exudyn.

    python -m benchmarks.unseen.remote [--first-seed 33300] [--draws 6] [--out FILE]

Two questions. Is friction at a joint found where nothing but the base's gyro and the commanded torques
were recorded? And does a gyro tell a wrong mass from a wrong torque scale, which in weightlessness look
alike? Each draw has its own robot, motion, sensors and size of what is hidden. Seeds 10292 to 10299
served to see that the script works, 31240 to 31251 made the page of 22 November 2026; those of the page
now, from 33300 on, are for its last run only.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from time import process_time

import exudyn_model
from benchmarks.evidence import EVIDENCE, head, table
from benchmarks.unseen.remote_cases import GYRO, FrictionCase, TwinCase, friction_case, label_of, twin_case
from missing_physics.diagnosis import Diagnosis, Options, diagnose
from missing_physics.wording.numbers import within_text
from robot_model import EffectUse, Recording, Robot, write_atomically

__all__ = ["Answer", "main", "page", "stated"]

COMMAND = "python -m benchmarks.unseen.remote"
PAGE = EVIDENCE / "remote.md"
FIRST_SEED, DRAWS = 33300, 6
INTRODUCTION = """\
A base floats freely with an arm of rigid links on it. Masses, friction, motion, sensors and the size of
what is hidden are drawn anew for each case; Exudyn moves the robot, and the diagnosis gets the robot file
without what is hidden and one recording, of which one stretch in four is held out from every fit. *Said*
is everything that it names, with its probability and what it calls as possible."""
FRICTION = """\
Recorded are the gyro of the base and the commanded torques of the joints, nothing else: no encoder, no
attitude, no reference. How the joints move follows from how the base turns
(`missing_physics/diagnosis/dynamics/joints_from_base.py`)."""
TWINS = """\
One joint whose axis passes through the base's centre of mass, no gravity, no friction: the joint's torque
is one constant inertia times its acceleration, so that a payload that the file does not know of and a
wrong torque scale are the same at the joint. From encoder and torque alone the verdict must be
`ambiguous` with both in the list; with the base's gyro besides, the hidden one must be named and its twin
must not be possible any more. That the torque's sensor rather than the actuator has the wrong scale, no
motion tells: it stays in the list. Of a payload, one joint's motion does not tell mass and place each: a
place that is not told stays where the search began, the diagnosis says so, and the mass that is stated
belongs to that place."""


@dataclass(frozen=True)
class Answer:
    """One diagnosis.

    Attributes:
        verdict: of the diagnosis.
        said: findings in words.
        stated: labels of findings and of what is called as possible.
        numbers: value and interval of each parameter, by label and name.
        seconds: of processor time.
    """

    verdict: str
    said: str
    stated: frozenset[str]
    numbers: dict[tuple[str, str], tuple[float, float, float]]
    seconds: float


def main(arguments: Sequence[str] | None = None) -> None:
    """Record, diagnose, write the page."""
    parser = argparse.ArgumentParser(prog=COMMAND, description="What a free base tells of unseen joints.")
    parser.add_argument("--first-seed", type=int, default=FIRST_SEED)
    parser.add_argument("--draws", type=int, default=DRAWS, help="of each question")
    parser.add_argument("--out", type=Path, default=PAGE, help="Markdown file to write")
    given = parser.parse_args(arguments)
    found, twins = [], []
    for number in range(given.first_seed, given.first_seed + given.draws):
        case = friction_case(number)
        made = exudyn_model.simulate(case.robot.with_effects(case.hidden), seed=number)
        torques = [f"{joint.name}.torque" for joint in case.robot.joints]
        found.append((case, answered(case.robot, only(made, *GYRO, *torques))))
        print(number, label_of(case.hidden), found[-1][1].said, flush=True)
    for number in range(given.first_seed + given.draws, given.first_seed + 2 * given.draws):
        twin = twin_case(number)
        made = exudyn_model.simulate(twin.robot.with_effects(twin.hidden), seed=number)
        blind = only(made, "joint1.position", "joint1.torque")
        seeing = only(made, "joint1.position", "joint1.torque", *GYRO)
        twins.append((twin, answered(twin.robot, blind), answered(twin.robot, seeing)))
        print(number, label_of(twin.hidden), *(a.said for a in twins[-1][1:]), sep=" | ", flush=True)
    write_atomically(given.out, page(found, twins))
    print(given.out)


def only(made: Recording, *channels: str) -> Recording:
    """The recording with nothing but these channels."""
    return replace(made, channels={name: made[name] for name in channels})


def answered(robot: Robot, recording: Recording) -> Answer:
    """What the diagnosis says."""
    began = process_time()
    found = diagnose(robot, [recording], options=Options(experiments=False)).diagnosis
    seconds = process_time() - began
    numbers = {
        (f"{f.effect}@{f.location}", name): (e.value, *e.ci95)
        for f in found.findings
        for name, e in f.parameters.items()
    }
    return Answer(found.verdict, _said(found), stated(found), numbers, seconds)


def stated(found: Diagnosis) -> frozenset[str]:
    """Labels of everything that is named or called as possible."""
    own = {f"{f.effect}@{f.location}" for f in found.findings}
    return frozenset(own | {label for f in found.findings for label in f.ambiguous_with})


def _said(found: Diagnosis) -> str:
    words = []
    for f in found.findings:
        rivals = f" (or {', '.join(f.ambiguous_with)})" if f.ambiguous_with else ""
        words.append(f"{f.effect}@{f.location} {f.probability:.3g}{rivals}")
    return "; ".join(words) or "nothing"


def page(
    found: Sequence[tuple[FrictionCase, Answer]], twins: Sequence[tuple[TwinCase, Answer, Answer]]
) -> str:
    """The whole page, in Markdown."""
    parts = [head("What a free base tells of joints that nobody sees", command=COMMAND), INTRODUCTION]
    return "\n\n".join([*parts, *_friction(found), *_twins(twins)]) + "\n"


def _friction(found: Sequence[tuple[FrictionCase, Answer]]) -> Iterator[str]:
    yield "## Friction at a joint, from the base's gyro and the commanded torques"
    yield FRICTION
    right = [answer.stated == {label_of(case.hidden)} for case, answer in found]
    yield f"Exactly what was hidden was named in {sum(right)} of {len(right)} recordings."
    inside = [hit for case, answer in found for hit in _hits(case.hidden, answer)]
    yield f"True parameters lie inside their 95 % intervals in {sum(inside)} of {len(inside)}."
    rows = [
        [
            str(case.number),
            str(len(case.robot.joints)),
            _truth(case.hidden),
            answer.verdict,
            "yes" if good else "no",
            answer.said,
            _estimates(case.hidden, answer),
            f"{answer.seconds:.0f}",
        ]
        for (case, answer), good in zip(found, right)
    ]
    yield table(["case", "joints:", "truth", "verdict", "right", "said", "estimates", "CPU s:"], rows)


def _twins(twins: Sequence[tuple[TwinCase, Answer, Answer]]) -> Iterator[str]:
    yield "## A payload and a torque scale, in weightlessness"
    yield TWINS
    blind = [_ambiguous(case, answer) for case, answer, _ in twins]
    seeing = [_told_apart(case, answer) for case, _, answer in twins]
    yield (
        f"Without the gyro the answer is right in {sum(blind)} of {len(blind)} cases, "
        f"with it in {sum(seeing)} of {len(seeing)}."
    )
    rows = [
        [
            str(case.number),
            _truth(case.hidden),
            gyro,
            answer.verdict,
            "yes" if good else "no",
            answer.said,
            _estimates(case.hidden, answer),
            f"{answer.seconds:.0f}",
        ]
        for (case, one, other), first, second in zip(twins, blind, seeing)
        for gyro, answer, good in (("no", one, first), ("yes", other, second))
    ]
    yield table(["case", "truth", "gyro", "verdict", "right", "said", "estimates", "CPU s:"], rows)


def _ambiguous(case: TwinCase, answer: Answer) -> bool:
    """Without momentum: both are listed, and neither is preferred."""
    return answer.verdict == "ambiguous" and {label_of(case.hidden), case.twin} <= answer.stated


def _told_apart(case: TwinCase, answer: Answer) -> bool:
    """With momentum: what is hidden, and of a scale its sensor's, which no motion tells from it."""
    return answer.stated == {label_of(case.hidden), *case.alike}


def _hits(hidden: EffectUse, answer: Answer) -> list[bool]:
    return [
        low <= hidden.parameters[name] <= high
        for (label, name), (_, low, high) in answer.numbers.items()
        if label == label_of(hidden) and name in hidden.parameters
    ]


def _truth(hidden: EffectUse) -> str:
    return f"{label_of(hidden)}: " + ", ".join(f"{k} {v:.4g}" for k, v in hidden.parameters.items() if v)


def _estimates(hidden: EffectUse, answer: Answer) -> str:
    words = [
        f"{name} {within_text(value, (low, high))}"
        for (label, name), (value, low, high) in answer.numbers.items()
        if label == label_of(hidden)
    ]
    return "; ".join(words) or "-"


if __name__ == "__main__":
    main()
