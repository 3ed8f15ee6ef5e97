"""The user's view of the catalogue: the documentation page and the command."""

from __future__ import annotations

import json
import re
import tomllib
from pathlib import Path

import pytest
import typer
from typer.testing import CliRunner

from benchmarks.signatures.cases import CASES
from benchmarks.signatures.pictures import picture
from missing_physics.cli.commands import effects as command
from reference_model.effects.base import Effect
from reference_model.effects.catalogue import catalogue, get_effect
from reference_model.effects.page import PICTURES, PLACES, catalogue_page, picture_of
from robot_model import InputError

#: Most bytes of a picture: the page shows over thirty.
LARGEST_PICTURE = 20_000

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "effects.md"


def _app() -> typer.Typer:
    app = typer.Typer()
    app.callback()(lambda: None)  # keeps `effects` a command of its own
    command.register(app)
    return app


def test_the_committed_page_is_up_to_date() -> None:
    assert PAGE.read_text("utf-8") == catalogue_page(), "run python -m reference_model.effects.page"


def test_every_effect_has_its_section() -> None:
    assert {effect.place for effect in catalogue().values()} <= set(PLACES)
    for effect_id in catalogue():
        assert f'<a id="{effect_id}"></a>' in catalogue_page()


def test_every_effect_has_one_small_picture_and_there_are_no_others() -> None:
    pictures = {path.stem: path for path in PICTURES.iterdir()}
    assert set(pictures) == set(CASES) == set(catalogue())
    for name, path in pictures.items():
        assert path.stat().st_size < LARGEST_PICTURE, name
        assert picture_of(get_effect(name)) == path
    shown = re.findall(r"!\[.*\]\((.*)\)", catalogue_page())
    assert [(PAGE.parent / link).resolve() for link in shown] == [pictures[Path(link).stem] for link in shown]
    assert len(shown) == len(pictures)


def test_an_installed_package_has_the_pictures() -> None:
    data = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["tool"]["setuptools"]["package-data"]
    shipped = {
        path for pattern in data["reference_model"] for path in (ROOT / "reference_model").glob(pattern)
    }
    assert set(PICTURES.iterdir()) <= shipped


@pytest.mark.parametrize("effect", catalogue().values(), ids=lambda effect: effect.id)
def test_every_effect_cites_a_source(effect: Effect) -> None:
    assert re.search(r"\b(19|20)\d\d\b", effect.source)
    assert re.match(r"[A-Z]", effect.source), "a name comes first"
    assert not re.search(r"elementary|makers' notes|reported", effect.source)


def test_a_diagnosis_searches_for_every_effect() -> None:
    assert all(effect.is_searched or effect.turns_base for effect in catalogue().values())


@pytest.mark.parametrize("name", ["coulomb_friction", "sensor_gain", "backlash", "contact"])
def test_a_picture_is_drawn_and_shows_a_difference(name: str) -> None:
    text = picture(name)
    lines = [part for part in text.split("<path ") if part.startswith('d="M') and part.count("L") > 50]
    assert len(lines) == (1 if name in ("sensor_gain", "backlash") else 2)
    assert len(set(lines)) == len(lines)
    assert get_effect(name).title in text


def test_the_command_lists_all_effects() -> None:
    result = CliRunner().invoke(_app(), ["effects"], env={"COLUMNS": "160"})
    assert result.exit_code == 0
    assert all(effect_id in result.stdout for effect_id in catalogue())


@pytest.mark.parametrize("effect_id", list(catalogue()))
def test_the_command_shows_one_effect(effect_id: str) -> None:
    effect = catalogue()[effect_id]
    result = CliRunner().invoke(_app(), ["effects", effect_id], env={"COLUMNS": "400"})
    assert result.exit_code == 0
    for text in (effect.title, effect.equation, effect.signature, effect.experiment, effect.source):
        assert text in result.stdout
    for parameter in effect.parameters:
        assert parameter.name in result.stdout
        assert parameter.unit in result.stdout


def test_the_command_prints_json() -> None:
    every = json.loads(CliRunner().invoke(_app(), ["effects", "--json"]).stdout)
    assert [item["id"] for item in every] == list(catalogue())
    one = json.loads(CliRunner().invoke(_app(), ["effects", "lugre_friction", "--json"]).stdout)
    assert one == next(item for item in every if item["id"] == "lugre_friction")
    assert one["parameters"][0]["unit"] == "N m"
    assert Path(one["plot"]).read_text("utf-8").startswith("<svg")


def test_an_unknown_effect_is_refused_with_a_suggestion() -> None:
    result = CliRunner().invoke(_app(), ["effects", "coulomb"])
    assert isinstance(result.exception, InputError)
    assert "coulomb_friction" in str(result.exception)
