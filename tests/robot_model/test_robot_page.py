"""The page of all keys is complete and up to date."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import get_args

import pytest
from pydantic import BaseModel

from robot_model import Robot, robot_from_toml
from robot_model.page import robot_page

PAGE = Path(__file__).parents[2] / "docs" / "robot.md"


def models(annotation: object) -> Iterator[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
        for field in annotation.model_fields.values():
            yield from models(field.annotation)
    for part in get_args(annotation):
        yield from models(part)


FIELDS = [
    pytest.param(model, key, id=f"{model.__name__}.{key}")
    for model in dict.fromkeys(models(Robot))
    for key in model.model_fields
]


def test_the_committed_page_is_the_generated_one() -> None:
    assert PAGE.read_text("utf-8") == robot_page(), "run: make docs"


@pytest.mark.parametrize(("model", "key"), FIELDS)
def test_every_key_is_explained(model: type[BaseModel], key: str) -> None:
    field = model.model_fields[key]
    if key == "kind" and len(get_args(field.annotation)) == 1:
        assert f'with `kind = "{field.default}"`' in robot_page()
        return
    assert field.description
    assert f"| `{key}` |" in robot_page()
    if not holds_numbers(field.annotation):
        return
    assert field.description.endswith("]"), "a number needs its unit, [-] when it has none"


def holds_numbers(annotation: object) -> bool:
    return annotation is float or any(holds_numbers(part) for part in get_args(annotation))


def test_the_example_on_the_page_is_a_robot() -> None:
    example = robot_page().split("```toml\n")[1].split("```")[0]
    assert robot_from_toml(example).name == "single_axis"


def test_every_table_has_its_section() -> None:
    headings = [line for line in robot_page().splitlines() if line.startswith(("## `", "## Top level"))]
    assert len(headings) == len(set(headings)) == len(dict.fromkeys(models(Robot)))
