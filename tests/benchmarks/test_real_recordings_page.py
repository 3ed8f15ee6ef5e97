"""A single section of the page of real recordings, made anew in its place."""

from __future__ import annotations

from benchmarks.machines.real_recordings import SECTIONS, renewed


def test_a_section_takes_the_place_of_the_old_one_and_says_where_it_is_from() -> None:
    old = [f"## {name}\n\nold {name}\n\n### details\n\nmore" for name in SECTIONS]
    page = "\n\n".join(["# Title", "made of old", *old]) + "\n"
    changed = renewed(page, {"quanser": "## New title\n\nnew words"}, command="the command")
    assert changed.startswith("\n\n".join(["# Title", "made of old", *old[:3]]))
    tail = changed.split("## New title")[1]
    assert "Made by `the command`" in tail
    assert tail.endswith("new words\n")
    assert "old quanser" not in changed
