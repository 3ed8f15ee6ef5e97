"""The pages that people write by hand keep up with the program."""

from __future__ import annotations

import dataclasses
import re
import tomllib
from pathlib import Path

import pytest

from missing_physics.cli.commands import SUMMARIES, loaded
from missing_physics.recordings.maps import mapping
from missing_physics.recordings.maps.mapping import mapping_from_toml
from missing_physics.results import result
from robot_model import QUANTITIES, robot_from_toml, shipped_robots

ROOT = Path(__file__).parents[2]
RECORDING = (ROOT / "docs" / "recording.md").read_text("utf-8")
DIAGNOSIS = (ROOT / "docs" / "diagnosis.md").read_text("utf-8")
README = (ROOT / "README.md").read_text("utf-8")

IN_THE_FILE = (
    *(result.Diagnosis, result.Mismatch, result.Dependence, result.Finding, result.Estimate),
    *(result.Alternative, result.Fit, result.ChannelFit, result.Errors, result.Experiment),
    *(result.ParameterChange, result.Stage, result.Unnamed, result.Curve),
)


def toml_blocks(page: str) -> list[str]:
    return [
        re.sub(r"^ {3}", "", text, flags=re.MULTILINE)
        for text in re.findall(r"^ *```toml\n(.*?)^ *```", page, flags=re.MULTILINE | re.DOTALL)
    ]


@pytest.mark.parametrize("part", [mapping.Mapping, mapping.TimeSource, mapping.ChannelSource, mapping.Pick])
def test_every_key_of_a_map_is_on_its_page(part: type[mapping.Mapping]) -> None:
    assert not [key for key in part.model_fields if f"`{key}`" not in RECORDING]


def test_every_quantity_is_on_the_page_of_recordings() -> None:
    assert not [name for name in QUANTITIES if f".{name}" not in RECORDING]


@pytest.mark.parametrize("text", toml_blocks(RECORDING))
def test_maps_on_the_page_are_valid(text: str) -> None:
    assert mapping_from_toml(text).time


def test_robot_and_map_of_the_readme_are_valid() -> None:
    robot, map_file = toml_blocks(README)
    assert robot_from_toml(robot).moving_joints
    assert mapping_from_toml(map_file).channels


@pytest.mark.parametrize("part", IN_THE_FILE, ids=lambda part: part.__name__)
def test_every_key_of_the_diagnosis_is_on_its_page(part: type) -> None:
    assert not [f.name for f in dataclasses.fields(part) if f"`{f.name}`" not in DIAGNOSIS]


def test_the_readme_names_every_command_option_and_shipped_robot() -> None:
    commands = {name: loaded(name) for name in SUMMARIES}
    missing = [name for name in (*commands, *shipped_robots()) if f"`{name}" not in README]
    for command in commands.values():
        options = [opt for p in command.params for opt in p.opts if opt.startswith("--")]
        missing += [opt for opt in options if opt != "--help" and opt not in README]
    assert not missing


@pytest.mark.parametrize("page", [README, RECORDING, DIAGNOSIS], ids=["README", "recording", "diagnosis"])
def test_links_lead_somewhere(page: str) -> None:
    base = ROOT if page is README else ROOT / "docs"
    targets = [t.split("#")[0] for t in re.findall(r"\]\(([^)]+)\)", page) if "://" not in t]
    made = ROOT / "reports" / "evidence"  # written by `make evidence`
    assert not [t for t in targets if t and not (base / t).exists() and (base / t).parent != made]


def test_the_citation_names_the_version_of_the_package() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    citation = (ROOT / "CITATION.cff").read_text("utf-8").splitlines()
    assert f"version: {project['version']}" in citation
    assert f"license: {project['license']}" in citation
