"""What README and `docs/real_machines.md` show of a command's output."""

from __future__ import annotations

from benchmarks.machines.readme import BEGIN, END, SHOWN, shortened, with_example

PRINTED = """EXPLAINED: Coulomb friction at joint1

Torque error on data that were not fitted (rms)
  joint1  2.0  1.0  0.5  0.1  N m

Where model and recording differ
  joint1: everywhere

What is missing
  Coulomb friction at joint1  83 %

Could not tell
  - much
"""


def test_the_verdict_the_errors_and_the_names_stay_and_dots_stand_for_the_rest() -> None:
    short = shortened(PRINTED)
    assert short.startswith("EXPLAINED")
    assert "0.5  0.1" in short
    assert "83 %" in short
    assert "everywhere" not in short
    assert "much" not in short
    assert short.endswith("[...]\n")
    whole = PRINTED.split("\n\nWhere")[0] + "\n"
    assert shortened(whole) == whole


def test_every_machine_has_its_place_on_its_page() -> None:
    for name, path in SHOWN.items():
        page = path.read_text("utf-8")
        again = with_example(page, name, "NEW\n")
        assert BEGIN.format(name=name) + "NEW\n" + END in again
        others = [BEGIN.format(name=other) for other in SHOWN if other != name and SHOWN[other] == path]
        assert all(again.count(begin) == 1 for begin in others)
