"""Consoles of README and `docs/real_machines.md` from a command's output."""

from __future__ import annotations

import pytest

from benchmarks.machines.readme import (
    BEGIN,
    BLOCK,
    END,
    FIRST,
    MORE,
    README,
    SHOWN,
    command,
    shortened,
    with_example,
)
from benchmarks.yardstick import machine

PRINTED = """AMBIGUOUS: Coulomb friction, Viscous friction and Torque offset (or
Direction-dependent friction) at joint1
Several explanations fit these data equally well; an experiment would separate
them.

Torque error on data that were not fitted (rms)
          nominal  answer
  joint1      2.0     0.5  N m
  joint2      2.1     0.6  N m
  Timing: torque is early, which was corrected.

Where model and recording differ
  joint1: everywhere

What is missing
  Coulomb friction at joint1  83 %
    torque  20 N m
  Viscous friction at joint1  > 99.9 %

Could not tell
  - much
"""
SHORT = """AMBIGUOUS: Coulomb friction, Viscous friction and Torque offset (or
Direction-dependent friction) at joint1
...
Torque error on data that were not fitted (rms)
          nominal  answer
  joint1      2.0     0.5  N m
  joint2      2.1     0.6  N m
...
What is missing
  Coulomb friction at joint1  83 %
    torque  20 N m
...
"""


def test_a_short_console_keeps_verdict_errors_and_first_finding_and_marks_omissions() -> None:
    assert shortened(PRINTED) == SHORT


def test_a_complete_console_has_no_omission_marks() -> None:
    whole = "EXPLAINED: Coulomb friction at joint1\n\nWhat is missing\n  Coulomb friction at joint1  83 %\n"
    assert shortened(whole) == whole.replace("\n\n", "\n")


@pytest.mark.parametrize("name", FIRST)
def test_readme_shows_the_command_of_the_row(name: str) -> None:
    text = command(machine(name))
    assert all(run.file in text for run in (*machine(name).fit, *machine(name).held_out))
    assert max(map(len, text.splitlines())) <= 120
    assert text in README.read_text("utf-8")


def test_every_machine_has_its_marks_on_the_pages() -> None:
    for page, name, kind in [(README, BLOCK, "console"), *((MORE, name, "text") for name in SHOWN)]:
        again = with_example(page.read_text("utf-8"), name, kind, "NEW\n")
        assert BEGIN.format(name=name, kind=kind) + "NEW\n" + END in again
    marks = [BEGIN.format(name=name, kind="text") for name in SHOWN]
    assert all(MORE.read_text("utf-8").count(begin) == 1 for begin in marks)
