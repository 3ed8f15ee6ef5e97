"""The hand-written pages agree with the program."""

from __future__ import annotations

import dataclasses
import re
import tomllib
from pathlib import Path

import pytest

from missing_physics.cli.listing import SUMMARIES, loaded
from missing_physics.recordings.maps import mapping
from missing_physics.recordings.maps.mapping import mapping_from_toml
from missing_physics.results import result
from robot_model import QUANTITIES, shipped_robots

ROOT = Path(__file__).parents[2]
RECORDING = (ROOT / "docs" / "recording.md").read_text("utf-8")
DIAGNOSIS = (ROOT / "docs" / "diagnosis.md").read_text("utf-8")
README = (ROOT / "README.md").read_text("utf-8")
EVIDENCE = (ROOT / "docs" / "evidence.md").read_text("utf-8")
PAGES = sorted([*ROOT.glob("*.md"), *(ROOT / "docs").glob("*.md"), *(ROOT / "examples").glob("*/*.md")])
#: Largest number of lines of the README, so that it is read to its end.
MOST_LINES = 120

IN_THE_FILE = (
    *(result.Diagnosis, result.Mismatch, result.Dependence, result.Finding, result.Estimate),
    *(result.Alternative, result.Fit, result.ChannelFit, result.Errors, result.Experiment),
    *(result.ParameterChange, result.Unnamed, result.Curve),
)


def toml_blocks(page: str) -> list[str]:
    return [
        re.sub(r"^ {3}", "", text, flags=re.MULTILINE)
        for text in re.findall(r"^ *```toml\n(.*?)^ *```", page, flags=re.MULTILINE | re.DOTALL)
    ]


@pytest.mark.parametrize(
    "part", [mapping.Mapping, mapping.TimeSource, mapping.ChannelSource, mapping.Pick, mapping.ServoVoltage]
)
def test_every_key_of_a_map_is_documented(part: type[mapping.Mapping]) -> None:
    assert not [key for key in part.model_fields if f"`{key}`" not in RECORDING]


def test_every_quantity_is_documented() -> None:
    assert not [name for name in QUANTITIES if f".{name}" not in RECORDING]


@pytest.mark.parametrize("text", toml_blocks(RECORDING))
def test_maps_on_the_page_are_valid(text: str) -> None:
    assert mapping_from_toml(text).time


def rows_of_evidence() -> list[list[str]]:
    """Cells of the table's rows: claim, number, page, command."""
    rows = [line.strip("|").split("|") for line in EVIDENCE.splitlines() if line.startswith("| ")]
    return [[cell.strip() for cell in row] for row in rows[1:]]


@pytest.mark.parametrize("row", rows_of_evidence(), ids=lambda row: row[0][:40])
def test_every_number_of_the_evidence_table_is_on_its_page(row: list[str]) -> None:
    _, numbers, pages, _ = row
    found = re.findall(r"\]\(([^)]+)\)", pages)
    text = " ".join((ROOT / "docs" / page).read_text("utf-8") for page in found)
    assert numbers_in(numbers) <= numbers_in(text)


def numbers_in(text: str) -> set[str]:
    """Numbers as written: 93.7, 89/95, 2e-11."""
    return {found.rstrip(".e/-") for found in re.findall(r"[0-9][0-9.e/-]*", text)}


def test_the_readme_is_short() -> None:
    assert len(README.splitlines()) <= MOST_LINES


@pytest.mark.parametrize("part", IN_THE_FILE, ids=lambda part: part.__name__)
def test_every_key_of_the_diagnosis_is_documented(part: type) -> None:
    assert not [f.name for f in dataclasses.fields(part) if f"`{f.name}`" not in DIAGNOSIS]


def test_the_readme_names_every_command_option_and_shipped_robot() -> None:
    commands = {name: loaded(name) for name in SUMMARIES}
    missing = [name for name in (*commands, *shipped_robots()) if f"`{name}" not in README]
    for command in commands.values():
        options = [opt for p in command.params for opt in p.opts if opt.startswith("--")]
        missing += [opt for opt in options if opt != "--help" and opt not in README]
    assert not missing


def anchors_of(page: str) -> set[str]:
    """Valid link anchors of a page: its headings in GitHub's form, and explicit anchors."""
    titles = re.findall(r"^#+ (.+)$", page, flags=re.MULTILINE)
    words = [re.sub(r"[^\w\- ]", "", title.replace("`", "").lower()) for title in titles]
    return {word.strip().replace(" ", "-") for word in words} | set(re.findall(r'<a id="([^"]+)"', page))


@pytest.mark.parametrize("path", PAGES, ids=lambda path: path.stem)
def test_links_have_existing_targets(path: Path) -> None:
    for target in re.findall(r"\]\(([^)]+)\)", path.read_text("utf-8")):
        if "://" in target:
            continue
        name, _, anchor = target.partition("#")
        page = (path.parent / name).resolve() if name else path
        assert page.exists(), f"{path.name}: {target}"
        assert not anchor or anchor in anchors_of(page.read_text("utf-8")), f"{path.name}: {target}"


def test_the_citation_names_the_version_of_the_package() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    citation = (ROOT / "CITATION.cff").read_text("utf-8").splitlines()
    assert f"version: {project['version']}" in citation
    assert f"license: {project['license']}" in citation


def test_version_and_date_agree_with_changelog_and_citation() -> None:
    version = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]["version"]
    changelog = (ROOT / "CHANGELOG.md").read_text("utf-8")
    newest = re.search(r"^## \[(\d.*)\] - (\d{4}-\d\d-\d\d)$", changelog, re.M)
    assert newest is not None
    assert newest[1] == version
    assert f"date-released: {newest[2]}" in (ROOT / "CITATION.cff").read_text("utf-8").splitlines()
