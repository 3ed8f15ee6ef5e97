"""Diagnosis of every single effect of the catalogue in recordings of another engine.

    python -m benchmarks.effects.study [--first-seed 34000] [--draws 3] [--effects ID,ID] [--processes 1]
        [--record] [--kept] [--out FILE]

Recordings and answers are stored in `reports/effects/`, which git ignores, so that an interrupted run can be
continued; results of other sources are recomputed. `--record` only makes the recordings, `--kept` only
writes the page. Seeds 10200 to 10299 are for development. Seeds 30000 to 30101 made the page of 21 November
2026 and were inspected, 30600 to 30699, 30900 to 31001 and 31300 to 31416 those of the day after, 32000 to
32106 that of the 23rd. 33000 to 33106 made pages on the 24th and 25th, by several versions: on the first
33081 had a wrong name above 0.9, on the second 33048 had no name, and 33096 had no answer for 36 minutes at
first: an arm that rattles between its torque limit and a stiff controller at 1 kHz takes ten seconds for each
run along a recording, and the diagnosis needed hundreds. These were investigated and corrected; such runs
count as several since. Another run had given 33015 the verdict `consistent`, as recorded references
oscillated at their kinks, which was found and corrected on 10215 and 10216. Those of the present page, from
34000 on, are for one run only.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from benchmarks.effects.runs import Key, rows
from benchmarks.effects.text import page
from benchmarks.evidence import EVIDENCE, command_line
from reference_model.effects.catalogue import catalogue
from robot_model import write_atomically

__all__ = ["keys", "main"]

COMMAND = "python -m benchmarks.effects.study"
PAGE = EVIDENCE / "effects.md"
#: Arguments that determine the content of the page.
WORDS = ("first_seed", "draws", "effects")
#: Seeds of the page.
FIRST_SEED, DRAWS = 34000, 3

#: Robots of the draws in turn; the second of a pair is used if the effect is not identifiable on the first.
ARM, AXIS, SPACE = "two_link_arm", "single_axis", "six_joint_space_arm"
USUAL = ((ARM,), (AXIS, ARM), (ARM,))
WITH_SPACE = ((ARM,), (AXIS, ARM), (SPACE, ARM))
ONE_ARM = (
    *("joint_elasticity", "backlash", "gear_hysteresis", "temperature_dependent_friction", "gravity"),
    *("link_flexibility", "base_motion", "contact", "torque_gain", "load_dependent_friction"),
)
ROBOTS = {
    "viscous_friction": WITH_SPACE,
    "coulomb_friction": WITH_SPACE,
    "payload": ((ARM,), (AXIS, ARM), (SPACE,)),
    "torque_offset": WITH_SPACE,
    "external_torque": WITH_SPACE,
    "modal_damping": (("flexible_space_robot_planar",), ("flexible_space_robot",)),
    "centrifugal_stiffening": (("flexible_space_robot_planar",),),
    "slosh": (("flexible_space_robot",), ("flexible_space_robot_planar",)),
    "reaction_wheel": (("flexible_space_robot",), ("flexible_space_robot_planar",)),
    **dict.fromkeys(ONE_ARM, ((ARM,),)),
}
#: Effects of joints, actuators and sensors that are also left out of this robot, after all others.
BENT = "flexible_space_robot"
ON_BENT = ("coulomb_friction", "viscous_friction", "external_torque", "torque_ripple", "sensor_delay")
#: Quantities of the channels of sensor effects, in turn.
QUANTITIES = ("torque", "position", "torque")
#: Gravity would hold the flanks of a gear together.
CHANGED = {"backlash": "weightless", "gear_hysteresis": "weightless"}


def keys(effects: Sequence[str], first: int, draws: int) -> list[Key]:
    """The cases of these effects; their numbers do not depend on the other effects."""
    found, every = [], sorted(catalogue())
    for draw in range(draws):  # every effect once before any is repeated
        for place, effect in enumerate(every):
            if effect in effects:
                turns = ROBOTS.get(effect, USUAL)
                found.append(
                    Key(
                        effect,
                        first + DRAWS * place + draw,
                        turns[draw % len(turns)],
                        quantity=QUANTITIES[draw % len(QUANTITIES)],
                        change=CHANGED.get(effect, ""),
                    )
                )
    behind = first + DRAWS * len(every)
    found += [Key(effect, behind + k, (BENT,)) for k, effect in enumerate(ON_BENT) if effect in effects]
    return found


def main(arguments: Sequence[str] | None = None) -> None:
    """Record and diagnose missing cases, then write the page."""
    parser = argparse.ArgumentParser(prog=COMMAND, description="Every effect of the catalogue, alone.")
    parser.add_argument("--first-seed", type=int, default=FIRST_SEED)
    parser.add_argument("--draws", type=int, default=DRAWS, help="of each effect, three at most")
    parser.add_argument("--effects", default=",".join(sorted(catalogue())), help="ids with commas between")
    parser.add_argument("--processes", type=int, default=1, help="at a time")
    parser.add_argument("--record", action="store_true", help="only make the recordings")
    parser.add_argument("--out", type=Path, default=PAGE, help="Markdown file to write")
    parser.add_argument("--kept", action="store_true", help="write the page of what is done already")
    given = parser.parse_args(arguments)
    wanted = keys(given.effects.split(","), given.first_seed, given.draws)
    how = {"only_record": given.record, "only_kept": given.kept}
    found = rows(wanted, processes=given.processes, **how)
    if not given.record:
        found.sort(key=lambda row: row.key.number)
        missing = set(wanted) - {row.key for row in found}
        write_atomically(
            given.out, page(found, command=command_line(parser, given, WORDS), missing=list(missing))
        )
        print(given.out)


if __name__ == "__main__":
    main()
