"""The history of the benchmarks: rows from reports, regressions by ratio, and invalid files."""

from __future__ import annotations

import json
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rerun.chunk import RrdReader

from benchmarks.history import rows as history
from benchmarks.history.__main__ import main
from benchmarks.history.page import page
from benchmarks.history.rows import ALLOWED, ENOUGH, WINDOW, Row, appended, changes, read, row_of, write
from benchmarks.history.table import ratios
from benchmarks.history.viewer import TIMELINE, entity, write_history
from benchmarks.work_precision.study import bench_part
from robot_model import InputError

NAME = "motion: flexible: Exudyn RK44"
ROW = Row("2026-01-01T00:00:00", "abc", "Linux x86_64, some", 0.5, {"exudyn": "1.13"}, {NAME: 40.0})


def rows(*ratios: float, **changed: Any) -> tuple[Row, ...]:
    return tuple(
        replace(ROW, time=f"2026-01-{k + 1:02d}T00:00:00", ratios={NAME: ratio}, **changed)
        for k, ratio in enumerate(ratios)
    )


def report(*, own: float = 1e-3, peer: float = 4e-2, time: str = "2026-02-01T00:00:00") -> dict[str, Any]:
    """A report of pytest-benchmark, limited to the parts that are read."""
    benchmarks = [
        {"group": "motion: flexible", "extra_info": {"ours": True, "seconds": own}},
        {"group": "motion: flexible", "extra_info": {"peer": "Exudyn RK44", "seconds": peer}},
        {"group": "motion: flexible", "extra_info": {"seconds": 1.0}},
        {"group": "alone", "extra_info": {"ours": True, "seconds": own}},
        {"group": None, "extra_info": {}},
    ]
    machine = {"system": "Linux", "machine": "x86_64", "cpu": {"brand_raw": "some"}, "load": 0.5}
    return {
        "benchmarks": benchmarks,
        "machine_info": machine,
        "commit_info": {"id": "abcdef0123456789"},
        "datetime": time,
    }


def test_a_report_gives_a_row_of_ratios() -> None:
    row = row_of(report(), versions={"exudyn": "1.13"}, load=0.5)
    assert row.ratios == {NAME: pytest.approx(40.0)}
    assert (row.commit, row.machine, row.time) == (
        "abcdef012345",
        "Linux x86_64, some",
        "2026-02-01T00:00:00",
    )


def test_a_row_stores_the_duration_of_the_run(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "report.json").write_text(json.dumps(report()))
    monkeypatch.setattr("time.time", lambda: 1_000_432.4)
    files = {kind: tmp_path / f"history.{kind}" for kind in ("json", "html", "rrd")}
    words = ["--history", str(files["json"]), "--html", str(files["html"]), "--rrd", str(files["rrd"])]
    main([str(tmp_path / "report.json"), "--started", "1000000", *words])
    (row,) = read(files["json"])
    assert row.seconds == pytest.approx(432.4)
    assert "the run took 432 s" in capsys.readouterr().out
    assert "it took 432 s" in files["html"].read_text()
    assert "432 s of wall time" in bench_part(files["json"])


def test_an_unknown_duration_is_not_shown(tmp_path: Path) -> None:
    path = tmp_path / "history.json"
    write(path, [ROW])
    assert bench_part(path) == bench_part(tmp_path / "none.json") == ""
    assert "it took" not in page([ROW])


def test_a_machine_twice_as_slow_gives_the_same_row() -> None:
    assert row_of(report(own=2e-3, peer=8e-2), versions={}, load=0.0) == row_of(
        report(), versions={}, load=0.0
    )


@pytest.mark.parametrize("damage", ["benchmarks", "machine_info", "commit_info", "datetime"])
def test_an_invalid_report_is_refused(damage: str) -> None:
    broken = report()
    del broken[damage]
    with pytest.raises(InputError, match="not one of pytest-benchmark"):
        row_of(broken, versions={}, load=0.0)


def test_only_a_falling_ratio_is_a_regression() -> None:
    before = (40.0,) * ENOUGH
    (fallen,) = changes(rows(*before, 0.99 * ALLOWED * 40.0))
    assert fallen.regressed
    assert fallen.before == 40.0
    for now in (1.01 * ALLOWED * 40.0, 40.0, 400.0):
        (change,) = changes(rows(*before, now))
        assert not change.regressed


def test_too_few_rows_give_no_regression() -> None:
    (change,) = changes(rows(*(40.0,) * (ENOUGH - 1), 1.0))
    assert change.before is None
    assert not change.regressed
    assert changes(()) == ()


def test_the_median_is_robust_to_one_bad_run() -> None:
    (change,) = changes(rows(40.0, 41.0, 2.0, 39.0, 40.0, 20.0))
    assert change.before == 40.0
    assert change.regressed


def test_only_recent_rows_are_compared() -> None:
    (change,) = changes(rows(*(400.0,) * 5, *(40.0,) * WINDOW, 39.0))
    assert change.before == 40.0


@pytest.mark.parametrize("changed", [{"machine": "Linux aarch64, other"}, {"versions": {"exudyn": "1.12"}}])
def test_other_machines_and_peers_are_not_compared(changed: dict[str, Any]) -> None:
    (change,) = changes((*rows(*(400.0,) * 5, **changed), replace(ROW, time="2027")))
    assert change.before is None


def test_the_version_of_an_unrelated_peer_does_not_matter() -> None:
    old = rows(*(40.0,) * ENOUGH, versions={"exudyn": "1.13", "mujoco": "3"})
    (change,) = changes((*old, replace(ROW, time="2027", versions={"exudyn": "1.13", "mujoco": "4"})))
    assert change.before == 40.0


def test_adding_the_same_run_twice_gives_one_row() -> None:
    again = replace(ROW, commit="def")
    assert appended((ROW,), again) == (again,)


numbers = st.floats(min_value=1e-6, max_value=1e6)
words = st.text(max_size=8)
made = st.builds(
    Row,
    time=words,
    commit=words,
    machine=words,
    load=numbers,
    versions=st.dictionaries(words, words, max_size=3),
    ratios=st.dictionaries(words, numbers, max_size=3),
)


@given(st.lists(made, max_size=5))
def test_a_history_round_trips_and_is_shown(
    tmp_path_factory: pytest.TempPathFactory, found: list[Row]
) -> None:
    path = tmp_path_factory.mktemp("history") / "history.json"
    write(path, found)
    assert list(read(path)) == found
    assert page(found).startswith("<!DOCTYPE html>")


def test_no_file_is_an_empty_history(tmp_path: Path) -> None:
    assert read(tmp_path / "none.json") == ()


BAD = {
    "cut short": '{"version": 1, "rows": [',
    "a list": "[]",
    "another version": '{"version": 2, "rows": []}',
    "no rows": '{"version": 1}',
    "rows of numbers": '{"version": 1, "rows": [1]}',
    "a key too many": json.dumps({"version": 1, "rows": [{**history.asdict(ROW), "more": 1}]}),
    "a key too few": json.dumps({"version": 1, "rows": [{"time": "2026"}]}),
    "a ratio of text": json.dumps({"version": 1, "rows": [{**history.asdict(ROW), "ratios": {"a": "b"}}]}),
    "no number": '{"version": 1, "rows": [' + json.dumps(history.asdict(ROW)).replace("40.0", "NaN") + "]}",
    "not text": "\x00\xff",
}


@pytest.mark.parametrize("content", BAD.values(), ids=BAD.keys())
def test_an_invalid_history_is_reported_in_one_sentence(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], content: str
) -> None:
    path, page_path = tmp_path / "history.json", tmp_path / "page.html"
    path.write_text(content, encoding="latin-1")
    (tmp_path / "report.json").write_text(json.dumps(report()))
    words = [str(tmp_path / "report.json"), "--history", str(path), "--html", str(page_path)]
    assert main(words) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.count("\n") == 1
    assert "history.json" in printed.err
    assert path.read_text(encoding="latin-1") == content  # a history is never thrown away
    assert not page_path.exists()


def test_a_missing_or_bad_report_changes_nothing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "history.json"
    write(path, [ROW])
    before = path.read_bytes()
    bad = tmp_path / "bad.json"
    bad.write_text("[]")
    for name in ("none.json", "bad.json"):
        assert (
            main([str(tmp_path / name), "--history", str(path), "--html", str(tmp_path / "page.html")]) == 2
        )
        assert capsys.readouterr().err.startswith("error: the report")
    assert path.read_bytes() == before


def test_a_write_that_fails_leaves_the_old_history(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "history.json"
    write(path, [ROW])
    before = path.read_bytes()

    def broken(self: Path, target: Path) -> Path:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "replace", broken)
    with pytest.raises(InputError, match="No space left"):
        write(path, [ROW, ROW])
    assert path.read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == ["history.json"]


def test_runs_add_rows_and_a_slower_one_is_reported(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = [
        str(tmp_path / "report.json"),
        "--history",
        str(tmp_path / "h.json"),
        "--html",
        str(tmp_path / "h.html"),
        "--rrd",
        str(tmp_path / "h.rrd"),
    ]
    for k in range(ENOUGH):
        (tmp_path / "report.json").write_text(json.dumps(report(time=f"2026-01-0{k + 1}")))
        assert main([*words, "--strict"]) == 0
    assert "slower" not in capsys.readouterr().out
    (tmp_path / "report.json").write_text(json.dumps(report(own=2e-3, time="2026-02-01")))
    assert main(words) == 0
    assert f"slower: {NAME}: 20 times as fast, was 40 (50%)" in capsys.readouterr().out
    assert main([*words, "--strict"]) == 1
    assert len(read(tmp_path / "h.json")) == ENOUGH + 1
    assert 'class="slower"' in (tmp_path / "h.html").read_text()


def test_a_report_without_peers_adds_no_row(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    alone = report()
    alone["benchmarks"] = alone["benchmarks"][3:]
    (tmp_path / "report.json").write_text(json.dumps(alone))
    path = tmp_path / "history.json"
    assert (
        main([str(tmp_path / "report.json"), "--history", str(path), "--html", str(tmp_path / "page.html")])
        == 0
    )
    assert "beside a peer" in capsys.readouterr().out
    assert not path.exists()


def test_the_printed_table_has_both_times_and_the_ratio() -> None:
    found = report(own=1e-3, peer=4e-2)
    row = row_of(found, versions={}, load=0.0)
    lines = ratios(found, changes([row])).splitlines()
    assert lines[0].split() == ["against", "ours", "[ms]", "theirs", "[ms]", "ratio", "before"]
    assert lines[1] == "motion: flexible"
    assert lines[2].split() == ["Exudyn", "RK44", "1", "40", "40", "-"]


def test_the_rerun_file_has_every_ratio_at_its_run(tmp_path: Path) -> None:
    path = tmp_path / "history.rrd"
    write_history(rows(40.0, 30.0), path)
    found = [
        batch
        for chunk in RrdReader(path).stream()
        if str(chunk.entity_path).strip("/") == entity(NAME)
        for batch in [chunk.to_record_batch()]
        if TIMELINE in batch.schema.names
    ]
    assert len(found) == 1
    assert found[0][TIMELINE].to_pylist() == [1, 2]
    column = next(name for name in found[0].schema.names if name.endswith("scalars"))
    assert found[0][column].to_pylist() == [[40.0], [30.0]]


class _Outside(HTMLParser):
    """Collects what a page would fetch, and its scripts."""

    def __init__(self) -> None:
        super().__init__()
        self.found: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.found += [tag] if tag == "script" else []
        self.found += [f"{tag} {key}" for key, _ in attrs if key in ("src", "href") or key.startswith("on")]


def test_the_page_is_self_contained_and_escapes_its_content() -> None:
    name = "<script>alert(1)</script>: Exudyn"
    text = page((*rows(1.0, 2.0), replace(ROW, time="2027", ratios={name: 3.0})))
    assert "<script>" not in text
    parser = _Outside()
    parser.feed(text)
    assert parser.found == []
