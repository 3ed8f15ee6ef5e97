"""Links that bend although described as rigid, recorded by Exudyn, found from encoders and torques.

    python -m benchmarks.unseen.hidden_links [--first-seed 33350] [--cases 6] [--noises 4] [--out FILE]

Link, mode, friction and motion of a case are drawn from its number, the noise of its recordings from the
numbers that follow a thousand times of it. Motions without noise are kept in `reports/hidden_links/`,
which git ignores.

The page before 21 November 2026 had six other cases, written down by hand, with noise from 10110 to
10113; they were looked at, and the interval of the period was widened after them. Seeds 10296 to 10299
served to see that the script works; 30460 to 30465, 30760 to 30765 and 31560 to 31565 made pages of 21 and 22
November 2026; those of the page now, from 33350 on, are for its last run only.
"""

from __future__ import annotations

import argparse
import zlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np

import exudyn_model
from benchmarks.evidence import EVIDENCE, head, percent, table
from missing_physics.challenge.cases.ranges import Draw, bounded
from missing_physics.diagnosis import Options, diagnose
from missing_physics.diagnosis.least_squares.explanation import explain
from missing_physics.diagnosis.preparation.setup import inertial_basis, make_segments, nominal_terms
from missing_physics.diagnosis.preparation.split import split
from missing_physics.diagnosis.terms.term import Term
from reference_model.effects.catalogue import get_effect
from robot_model import EffectUse, Recording, Robot, load_robot, write_atomically

__all__ = ["drawn", "main"]

COMMAND = "python -m benchmarks.unseen.hidden_links"
PAGE = EVIDENCE / "hidden_links.md"
KEPT = EVIDENCE.parent / "hidden_links"
#: Numbers of the page's cases, and recordings of each.
FIRST_SEED, CASES, NOISES = 33350, 6, 4
#: Recordings of a case have their own numbers.
APART = 1000
NUMBERS = ("period", "damping_ratio")
BEFORE = """\
The interval of the period was widened by 0.3 % after recordings of six other cases, with other links,
motions and noise, had shown it to be too narrow; none of them is counted here."""
INTRODUCTION = """\
The shipped `{robot}` runs a motion in Exudyn with one link bending and with the dry friction of the
table, all drawn by chance: a period of {periods[0]:g} to {periods[1]:g} s, a damping ratio of
{dampings[0]:g} to {dampings[1]:g}, the phases of its reference motion, friction in half of the cases;
then the robot without any of it is diagnosed from joint encoders and torques with the noise and
resolution of its sensors. References are withheld, so that the regression alone has to tell. Each motion
is recorded {noises} times with other noise. `reached`: the fall of the held-out error of the torques as a
part of the fall that the true parameters reach along the same recorded motion. The damping ratio's
interval is wide where nothing but the start excites the link."""


@dataclass(frozen=True)
class Truth:
    """What the recordings of a case hide; `phases` [rad] are added to those of the reference motion."""

    number: int
    phases: tuple[float, float]
    link: str
    period: float
    damping: float
    friction: tuple[float, float] = (0.0, 0.0)

    @property
    def uses(self) -> list[EffectUse]:
        found = [
            EffectUse(effect="link_flexibility", at=self.link, period=self.period, damping_ratio=self.damping)
        ]
        for joint, torque in zip(("joint1", "joint2"), self.friction):
            if torque:
                found.append(EffectUse(effect="coulomb_friction", at=joint, torque=torque))
        return found


#: Ranges of what is drawn; friction at the second joint is half as large.
PERIODS, DAMPINGS, FRICTION = (0.12, 0.25), (0.005, 0.03), (2.0, 4.0)
ROBOT, DURATION, RATE = "two_link_arm", 12.0, 250.0


@dataclass(frozen=True)
class Answer:
    """One diagnosis."""

    named: tuple[str, ...]
    verdict: str
    found: Mapping[str, tuple[float, float, float]]
    reached: float
    seconds: float


def main(arguments: Sequence[str] | None = None) -> None:
    """Record what has not been recorded, diagnose, write the page."""
    parser = argparse.ArgumentParser(prog=COMMAND, description="Links that bend, found from joints alone.")
    parser.add_argument("--first-seed", type=int, default=FIRST_SEED)
    parser.add_argument("--cases", type=int, default=CASES)
    parser.add_argument("--noises", type=int, default=NOISES, help="recordings of each case")
    parser.add_argument("--out", type=Path, default=PAGE, help="Markdown file to write")
    given = parser.parse_args(arguments)
    answers = {}
    for number in range(given.first_seed, given.first_seed + given.cases):
        truth = drawn(number)
        answers[truth] = [_answer(truth, APART * number + k) for k in range(given.noises)]
        print(truth, *answers[truth], sep="\n  ", flush=True)
    write_atomically(given.out, "\n\n".join(_page(answers, given.noises)) + "\n")
    print(given.out)


def drawn(number: int) -> Truth:
    """The case of that number, the same one every time."""
    d = Draw(np.random.default_rng([number, zlib.crc32(b"hidden_links")]))
    link = ("link1", "link2")[int(d.chance.integers(2))]
    phases = d.even(0.0, 2 * np.pi), d.even(0.0, 2 * np.pi)
    period, damping = bounded(d.decades(*PERIODS)), bounded(d.decades(*DAMPINGS))
    dry = bounded(d.even(*FRICTION)) if d.sign() > 0 else 0.0
    return Truth(number, phases, link, period, damping, (dry, dry / 2))


def _robot(truth: Truth) -> Robot:
    data: dict[str, Any] = load_robot(ROBOT).model_dump()
    data["reference"] |= {"duration": DURATION, "sample_rate": RATE}
    for motion, phase in zip(data["reference"]["joints"], truth.phases):
        motion["phases"] = [own + phase for own in motion["phases"]]
    return Robot.model_validate(data)


def _exact(truth: Truth) -> Recording:
    path = KEPT / f"{truth.number}-{zlib.crc32(repr(truth).encode()):08x}.npz"
    if not path.is_file():
        path.parent.mkdir(parents=True, exist_ok=True)
        made = exudyn_model.simulate(_robot(truth).with_effects(*truth.uses), sensors=False)
        np.savez_compressed(path, time=made.time, **{name: made[name] for name in made})
    with np.load(path) as stored:
        channels = {name: stored[name] for name in stored.files}
    return Recording(channels.pop("time"), channels, path.stem)


def _answer(truth: Truth, seed: int) -> Answer:
    robot = _robot(truth)
    noisy = exudyn_model.measured(robot.with_effects(*truth.uses), _exact(truth), seed=seed)
    channels = {name: values for name, values in noisy.channels.items() if "reference" not in name}
    recording = replace(noisy, channels=channels)
    options = Options(experiments=False, simulation=False)
    began = process_time()
    made = diagnose(robot, [recording], options=options).diagnosis
    seconds = process_time() - began
    finding = next((f for f in made.findings if f.effect == "link_flexibility"), None)
    numbers = finding.parameters if finding and finding.location == truth.link else {}
    return Answer(
        named=tuple(sorted(f"{f.effect}@{f.location}" for f in made.findings)),
        verdict=made.verdict,
        found={name: (e.value, *e.ci95) for name, e in numbers.items()},
        reached=made.fit.validation_improvement / _improvement(robot, truth, recording),
        seconds=seconds,
    )


def _improvement(robot: Robot, truth: Truth, recording: Recording) -> float:
    """What the true effects take from the held-out error, as `Fit.validation_improvement` says it."""
    segments = make_segments(robot, [recording])
    data = split(segments, 1, inertial_basis(robot, segments), seed=0)
    given = [replace(term, frozen=True) for term in nominal_terms(robot)]
    hidden = []
    for use in truth.uses:
        effect = get_effect(use.effect)
        hidden.append(Term(effect, use.at, {**effect.defaults(), **use.parameters}, frozen=True))
    levels = []
    for terms in (given, [*given, *hidden]):
        fit = explain(data.problem, data.view, terms, nuisance=False)
        left = data.held_out.residual(fit) / data.problem.noise_floor * data.validation.sliding
        levels.append(float(np.sqrt(np.sum(left[data.scored] ** 2))))
    return 1.0 - levels[1] / levels[0]


def _page(answers: Mapping[Truth, Sequence[Answer]], noises: int) -> Iterator[str]:
    yield head("Links that bend, found from joint encoders and torques", command=COMMAND)
    yield INTRODUCTION.format(robot=ROBOT, noises=noises, periods=PERIODS, dampings=DAMPINGS)
    every = [(truth, answer) for truth, own in answers.items() for answer in own]
    right = [set(a.named) == {f"{u.effect}@{u.at}" for u in t.uses} for t, a in every]
    yield f"Exactly what was hidden was named in {sum(right)} of {len(right)} recordings."
    yield BEFORE
    for name in NUMBERS:
        inside = [_inside(t, a, name) for t, a in every if name in a.found]
        what = name.replace("_", " ")
        yield f"The true {what} lies inside its 95 % interval in {sum(inside)} of {len(inside)}."
    rows = []
    for truth, own in answers.items():
        for answer in own:
            rows.append([*_hidden(truth), ", ".join(answer.named), answer.verdict, *_told(answer)])
    titles = ["case", "link", "period s", "damping ratio", "friction N m", "named", "verdict"]
    yield table([*titles, "period found", "damping found", "reached:", "CPU s:"], rows)


def _inside(truth: Truth, answer: Answer, name: str) -> bool:
    _, low, high = answer.found[name]
    return low <= {"period": truth.period, "damping_ratio": truth.damping}[name] <= high


def _hidden(truth: Truth) -> list[str]:
    friction = " and ".join(f"{torque:g}" for torque in truth.friction) if any(truth.friction) else ""
    return [str(truth.number), truth.link, f"{truth.period:g}", f"{truth.damping:g}", friction]


def _told(answer: Answer) -> list[str]:
    cells = []
    for name in NUMBERS:
        found = answer.found.get(name)
        cells.append(f"{found[0]:.4g} [{found[1]:.4g}, {found[2]:.4g}]" if found else "")
    return [*cells, percent(answer.reached), f"{answer.seconds:.0f}"]


if __name__ == "__main__":
    main()
