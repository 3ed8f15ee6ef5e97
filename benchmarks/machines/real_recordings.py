"""The diagnosis on recordings of real machines, as one page of evidence.

    python -m benchmarks.machines.real_recordings [--out FILE] [--only emps,kuka,servo,quanser] [--renew]

The recordings come from the folder that `MISSING_PHYSICS_DATA` names, or are downloaded by commit and
checksum. With `--only` the page holds these sections alone and goes to `reports/`, which git ignores, unless
`--out` says otherwise. With `--renew` these sections take the place of the old ones in the page, and say by
which command and at which commit they were made.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from benchmarks.evidence import EVIDENCE, head
from benchmarks.machines import emps as evidence_emps
from benchmarks.machines import kuka as evidence_kuka
from benchmarks.machines import quanser as evidence_quanser
from benchmarks.machines import servo as evidence_servo
from robot_model import InputError, nearest, write_atomically

__all__ = ["main"]

COMMAND = "python -m benchmarks.machines.real_recordings"
SECTIONS: Mapping[str, Callable[[], str]] = {
    "emps": evidence_emps.section,
    "servo": evidence_servo.section,
    "kuka": evidence_kuka.section,
    "quanser": evidence_quanser.section,
}
PAGE = EVIDENCE / "real_recordings.md"
PART = EVIDENCE.parent / "real_recordings_part.md"
INTRODUCTION = (
    "Recordings of real machines, from public sources (see `examples/*/README.md` for origin, licence and "
    "what to know of each). Values stand with their 95 % intervals; `held out` is the recording that no fit "
    "has seen. Nobody told the program what is missing in these machines. But these recordings, held-out "
    "files included, were looked at while the diagnosis was developed: constants of the method (the "
    "cut-off rule, the rows left out around reversals, the prior on inertia) were chosen with their "
    "results in view, and an effect enters only if it lowers the held-out error. So the held-out errors "
    "here are somewhat optimistic; they show what was found, and are no blind score."
)


def main(arguments: Sequence[str] | None = None) -> None:
    """Compute the sections and write the page."""
    parser = argparse.ArgumentParser(prog=COMMAND, description="The diagnosis on real recordings.")
    parser.add_argument("--out", type=Path, help="Markdown file to write")
    parser.add_argument("--only", help=f"some of {','.join(SECTIONS)}, with commas between")
    parser.add_argument("--renew", action="store_true", help="only these sections anew in the page")
    given = parser.parse_args(arguments)
    chosen = given.only.split(",") if given.only else list(SECTIONS)
    for name in chosen:
        if name not in SECTIONS:
            raise InputError(f"there is no section '{name}'{nearest(name, SECTIONS)}.")
    command = COMMAND + (f" --only {given.only}" if given.only else "")
    made = {}
    for name in chosen:
        began = time.monotonic()
        made[name] = SECTIONS[name]()
        print(f"{name}: {time.monotonic() - began:.0f} s", file=sys.stderr)
    if given.renew:
        write_atomically(PAGE, renewed(PAGE.read_text("utf-8"), made, command=f"{command} --renew"))
        print(PAGE)
        return
    parts = [head("The diagnosis on real recordings", command=command), INTRODUCTION, *made.values()]
    out = given.out or (PART if given.only else PAGE)
    write_atomically(out, "\n\n".join(parts) + "\n")
    print(out)


def renewed(page: str, made: Mapping[str, str], *, command: str) -> str:
    """`page` with the sections `made` in the places of the old ones, each with its own origin."""
    parts = page.rstrip("\n").split("\n\n## ")
    for name, section in made.items():
        title, rest = section.removeprefix("## ").split("\n\n", 1)
        origin = head(title, command=command).split("\n\n", 1)[1]
        parts[1 + list(SECTIONS).index(name)] = f"{title}\n\n{origin}\n\n{rest}"
    return "\n\n## ".join(parts) + "\n"


if __name__ == "__main__":
    try:
        main()
    except InputError as error:
        sys.exit(f"{COMMAND}: {error}")
