"""Differences and bands: numbers by hand, second order, and a difference of modelling that stands out."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from crosscheck_cases import ERROR, comparison, recordings, robot

from missing_physics.reporting.crosscheck import compare, report, table, verdict_lines
from missing_physics.reporting.crosscheck.words import groups, share_text
from robot_model import InputError, Recording, load_robot


def test_difference_statistics_are_correct() -> None:
    time = np.array([0.0, 1.0, 2.0, 3.0])
    arm = load_robot("single_axis")
    first = Recording(
        time, {"joint1.position": np.array([0.0, 2.0, 4.0, 0.0]), "joint1.torque": np.ones(4)}, "first"
    )
    second = Recording(
        time, {"joint1.position": np.array([0.0, 2.0, 4.2, 0.1]), "joint1.torque": np.ones(4) + 0.5}, "second"
    )
    found = compare(arm, first, second)
    a, b = found.differences
    assert (a.largest, a.time, a.extent, a.unit) == (pytest.approx(0.2), 2.0, 4.0, "m")  # the joint slides
    assert a.rms == pytest.approx(np.sqrt((0.04 + 0.01) / 4))
    assert a.relative_largest == pytest.approx(0.05)
    assert a.bound is a.inside is a.explained is None
    assert b.largest == 0.5
    assert b.relative_largest is None  # a constant has no range
    assert found.worst is a
    with pytest.raises(InputError, match="different instants"):
        compare(arm, first, Recording(time + 1, dict(first.channels), "late"))


def test_the_band_of_a_second_order_engine_is_three_times_its_error() -> None:
    found = comparison()
    size = ERROR * 1.5  # largest of sin + 0.5
    for item in found.differences:
        assert item.largest == pytest.approx(size, rel=1e-3)
        assert item.bound == pytest.approx(3 * size, rel=0.01)
        assert item.explained
    # Nowhere narrower than three times the error there.
    error = ERROR * np.abs(np.sin(3 * found.reference.time) + 0.5)
    assert np.all(found.bands["joint1.position"] >= 2.9 * error)
    assert found.outside == ()
    assert "All 19 channels stay inside" in verdict_lines(found)[-1]


def test_modelling_difference_exceeds_the_band() -> None:
    first, second, coarse = recordings()
    wrong = second.with_channels({"joint2.torque": second["joint2.torque"] + 1e-3})
    wrong_too = coarse.with_channels({"joint2.torque": coarse["joint2.torque"] + 1e-3})
    found = compare(robot(), first, wrong, [(wrong, wrong_too)])
    assert [item.channel for item in found.outside] == ["joint2.torque"]
    item = found.outside[0]
    assert item.inside == 0.0
    assert item.excess is not None
    assert item.excess > 100
    assert "1 of 19 channels leaves" in verdict_lines(found)[-1]
    assert "joint2.torque" in verdict_lines(found)[-1]


def test_bands_of_several_engines_add_up() -> None:
    first, second, coarse = recordings()
    one = compare(robot(), first, second, [(second, coarse)])
    two = compare(robot(), first, second, [(second, coarse), (second, coarse)])
    assert np.allclose(two.bands["robot.energy"], 2 * one.bands["robot.energy"], rtol=1e-3)


def test_cancelling_momenta_are_scaled_by_their_parts() -> None:
    first, second, coarse = recordings()
    still = {"robot.linear_momentum.x": np.zeros(len(first))}
    noise = {"robot.linear_momentum.x": np.full(len(first), 1e-8)}  # of a tonne at some m/s, 1e-10 of 2e3
    runs = first.with_channels(still), second.with_channels(noise)
    found = compare(
        robot(),
        *runs,
        [(runs[1], coarse.with_channels({"robot.linear_momentum.x": np.full(len(coarse), 1e-8)}))],
    )
    item = next(item for item in found.differences if "momentum" in item.channel)
    assert item.explained
    assert item.relative_largest is None


def test_table_has_every_channel_in_groups_and_the_verdict_at_its_end() -> None:
    found = comparison()
    text = table(robot(), found)
    for item in found.differences:
        assert f" {item.channel} " in text
    titles = list(groups(robot(), found.differences))
    assert titles == [
        "motion of the joints",
        "drives and friction",
        "bearing loads",
        "flexible links",
        "base",
        "whole robot",
    ]
    assert [text.index(title) for title in titles] == sorted(text.index(title) for title in titles)
    assert sum(line.startswith(">") for line in text.splitlines()) == len(titles) - 1  # one has one channel
    assert text.splitlines()[-2].startswith("Worst: ")
    assert "largest/range: " in text
    plain = table(robot(), compare(robot(), *recordings()[:2]))
    assert "step error" not in plain


@pytest.mark.parametrize(
    ("share", "text"), [(0.33, "33 %"), (0.0021, "0.21 %"), (3.9e-4, "390 ppm"), (2e-8, "2.0e-08")]
)
def test_fractions_are_formatted_readably(share: float, text: str) -> None:
    assert share_text(share) == text


def test_worst_channel_is_that_with_the_largest_excess_over_its_band() -> None:
    found = comparison()
    by_share = max(found.differences, key=lambda item: item.relative_largest or 0.0)
    other = next(item for item in found.differences if item is not by_share and item.extent > 0)
    differences = tuple(
        replace(item, excess=7.0, inside=0.5) if item is other else item for item in found.differences
    )
    bad = replace(found, differences=differences)
    assert bad.worst is not None
    assert bad.worst.channel == other.channel
    assert verdict_lines(bad)[0].startswith(f"Worst: {other.channel} leaves its band by a factor of 7")
    without = compare(robot(), *recordings()[:2]).worst
    assert without is not None
    assert without.channel == by_share.channel


def test_crosscheck_report_contains_the_table() -> None:
    found = comparison()
    told = report(robot(), found, {"reference": {"rtol": 1e-10}})
    assert told["worst"] == found.worst.channel  # type: ignore[union-attr]
    assert told["outside"] == []
    assert told["summary"].startswith("Worst: ")
    row = told["channels"]["joint1.position"]
    item = found.differences[[i.channel for i in found.differences].index("joint1.position")]
    assert (row["max"], row["bound"], row["inside"]) == (item.largest, item.bound, item.inside)
    bare = report(robot(), compare(robot(), *recordings()[:2]), {})
    assert bare["outside"] is None
    assert bare["channels"]["joint1.position"]["bound"] is None


def test_crosscheck_page_documents_every_key() -> None:
    page = (Path(__file__).parents[2] / "docs" / "crosscheck.md").read_text("utf-8")
    told = report(robot(), comparison(), {"reference": {}, "exudyn": {}})
    row = told["channels"]["joint1.position"]
    missing = [key for key in told if f"`{key}" not in page]
    missing += [key for key in row if f".{key}`" not in page]
    assert not missing
