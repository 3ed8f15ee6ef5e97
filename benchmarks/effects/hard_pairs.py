"""Diagnosis of effects that look alike, each hidden in turn, in recordings of another engine.

    python -m benchmarks.effects.hard_pairs [--first-seed 33200] [--draws 1] [--pairs N,N] [--processes 1]
        [--record] [--kept] [--out FILE]

Cases are drawn, stored and judged as in `effects_study`. The number of a case follows from its place in
`PAIRS`. Seeds 30110 to 30133 made the page of 20 and 21 November 2026 and were inspected twice; the diagnosis
was improved by them. Seeds 30400 to 30425 made the next page, 30710 to 30735 the one after it, 31010 to 31035
that of the 22nd. Those of the present page, from 33200 on, are for its last run only; 10290 to 10291 were
used to test the script.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from benchmarks.effects.hard_pairs_text import page
from benchmarks.effects.runs import Key, rows
from benchmarks.evidence import EVIDENCE, command_line
from robot_model import write_atomically

__all__ = ["PAIRS", "Pair", "main"]

COMMAND = "python -m benchmarks.effects.hard_pairs"
PAGE = EVIDENCE / "hard_pairs.md"
#: Arguments that determine the content of the page.
WORDS = ("first_seed", "draws", "pairs")
#: Seeds of the page; every truth of a pair has its own.
FIRST_SEED, DRAWS = 33200, 1
ARM, AXIS, SPACE = "two_link_arm", "single_axis", "six_joint_space_arm"


@dataclass(frozen=True)
class Truth:
    """One side of a pair; `quantity` as in `effect_runs.Key`."""

    effect: str
    quantity: str = "torque"


@dataclass(frozen=True)
class Pair:
    """Effects that can be confused with each other.

    Attributes:
        title: for people.
        truths: effects hidden in turn.
        robot: that hides them.
        change: of the robot; key of `effect_changes.CHANGES`.
        alike: no recording distinguishes them, so that the verdict must be `ambiguous` with all of them.
    """

    title: str
    truths: tuple[Truth, ...]
    robot: str = ARM
    change: str = ""
    alike: bool = False


PAIRS = (
    Pair(
        "viscous friction, actuator lag, delay",
        (Truth("viscous_friction"), Truth("actuator_lag"), Truth("sensor_delay", "position")),
    ),
    Pair("Stribeck, LuGre", (Truth("stribeck_friction"), Truth("lugre_friction"))),
    Pair(
        "backlash, hysteresis, elasticity, with both encoders",
        (Truth("backlash"), Truth("gear_hysteresis"), Truth("joint_elasticity")),
        change="weightless",
    ),
    Pair(
        "link mode, elasticity of the joint, with both encoders",
        (Truth("link_flexibility"), Truth("joint_elasticity")),
        change="motor encoders",
    ),
    Pair("cable spring, gravity", (Truth("cable_spring"), Truth("gravity"))),
    Pair(
        "load-dependent, position-dependent friction",
        (Truth("load_dependent_friction"), Truth("position_dependent_friction")),
    ),
    Pair("torque gain, payload", (Truth("torque_gain"), Truth("payload"))),
    Pair(
        "torque gain, payload, weightless and without momentum",
        (Truth("torque_gain"), Truth("payload")),
        robot=AXIS,
        change="weightless, no friction",
        alike=True,
    ),
    Pair(
        "torque gain, payload, a free base without gyro and attitude",
        (Truth("torque_gain"), Truth("payload")),
        robot=SPACE,
        change="no momentum",
    ),
    Pair("ripple, eccentricity", (Truth("torque_ripple"), Truth("encoder_eccentricity", "position"))),
    Pair("clock drift, delay", (Truth("clock_drift"), Truth("sensor_delay", "torque"))),
    Pair(
        "external impulse, stiction release", (Truth("external_torque", "brief"), Truth("stribeck_friction"))
    ),
)


def keys(pair: Pair, first: int, draws: int) -> list[Key]:
    """The cases of a pair; its numbers do not depend on the others."""
    before = sum(len(other.truths) for other in PAIRS[: PAIRS.index(pair)])
    return [
        Key(
            truth.effect,
            first + draws * (before + place) + draw,
            (pair.robot,),
            quantity=truth.quantity,
            change=pair.change,
        )
        for place, truth in enumerate(pair.truths)
        for draw in range(draws)
    ]


def main(arguments: Sequence[str] | None = None) -> None:
    """Record and diagnose missing cases, then write the page."""
    parser = argparse.ArgumentParser(prog=COMMAND, description="Effects that look alike, each in turn.")
    parser.add_argument("--first-seed", type=int, default=FIRST_SEED)
    parser.add_argument("--draws", type=int, default=DRAWS, help="of each truth")
    parser.add_argument("--pairs", default="", help="numbers from 1 with commas between; all when left out")
    parser.add_argument("--processes", type=int, default=1, help="at a time")
    parser.add_argument("--record", action="store_true", help="only make the recordings")
    parser.add_argument("--out", type=Path, default=PAGE, help="Markdown file to write")
    parser.add_argument("--kept", action="store_true", help="write the page of what is done already")
    given = parser.parse_args(arguments)
    chosen = [PAIRS[int(n) - 1] for n in given.pairs.split(",")] if given.pairs else list(PAIRS)
    wanted = [keys(pair, given.first_seed, given.draws) for pair in chosen]
    every = [key for own in wanted for key in own]
    how = {"only_record": given.record, "only_kept": given.kept}
    found = {row.key: row for row in rows(every, processes=given.processes, **how)}
    if given.record:
        return
    parts = [(pair, [found[key] for key in own if key in found]) for pair, own in zip(chosen, wanted)]
    missing = [key for key in every if key not in found]
    write_atomically(given.out, page(parts, command=command_line(parser, given, WORDS), missing=missing))
    print(given.out)


if __name__ == "__main__":
    main()
