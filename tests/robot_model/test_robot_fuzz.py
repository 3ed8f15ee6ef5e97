"""Any text as a robot file gives a valid robot or one error message that a user can act on."""

from __future__ import annotations

import random
import tomllib
from typing import Any

import pytest
import tomli_w
from hypothesis import given
from hypothesis import strategies as st
from robot_mistakes import COUPLED

from robot_model import InputError, load_robot, robot_from_toml, robot_to_toml, shipped_robots

VALID = (*(robot_to_toml(load_robot(name)) for name in shipped_robots()), COUPLED)

pytestmark = pytest.mark.fuzz

scalars = (
    st.none()
    | st.booleans()
    | st.integers()
    | st.floats()
    | st.text(max_size=12)
    | st.dates()
    | st.sampled_from([0, -1, 1e18, 1e-300, 10**400, float("inf"), float("nan"), "base", "joint1", ""])
)
anything = st.recursive(
    scalars,
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=8), inner, max_size=3),
    max_leaves=6,
)


def robot_or_sentence(text: str) -> None:
    """Load the text; if it is rejected, the message must be a proper sentence naming the file."""
    try:
        robot = robot_from_toml(text, source="arm.toml")
    except InputError as error:
        message = str(error)
        assert message.isprintable()
        assert message.startswith("arm.toml")
        assert message.endswith((".", "?", "!"))
        assert not message.endswith(("..", "?."))
        assert len(message) < 1000
    else:
        assert robot_from_toml(robot_to_toml(robot)) == robot


@given(st.binary(max_size=200))
def test_random_bytes(tmp_path_factory: pytest.TempPathFactory, content: bytes) -> None:
    path = tmp_path_factory.getbasetemp() / "fuzz.toml"
    path.write_bytes(content)
    with pytest.raises(InputError, match=r"fuzz\.toml"):
        load_robot(path)


@given(st.text(max_size=200))
def test_random_text(text: str) -> None:
    robot_or_sentence(text)


@given(st.sampled_from(VALID), st.data())
def test_a_valid_file_with_characters_changed(text: str, data: st.DataObject) -> None:
    for _ in range(data.draw(st.integers(1, 4))):
        start = data.draw(st.integers(0, len(text)))
        stop = start + data.draw(st.integers(0, 8))
        text = text[:start] + data.draw(st.text(max_size=6)) + text[stop:]
    robot_or_sentence(text)


@given(st.sampled_from(VALID), st.data())
def test_a_truncated_file(text: str, data: st.DataObject) -> None:
    robot_or_sentence(text[: data.draw(st.integers(0, len(text)))])


@given(st.sampled_from(VALID), anything, st.randoms(use_true_random=False))
def test_a_valid_file_with_one_value_replaced(text: str, value: Any, chance: random.Random) -> None:
    content = tomllib.loads(text)
    place, key = chance.choice(_places(content))
    place[key] = value
    robot_or_sentence(_toml(content))


@given(st.sampled_from(VALID), st.text(max_size=12), anything, st.randoms(use_true_random=False))
def test_a_valid_file_with_one_key_renamed_or_added(
    text: str, name: str, value: Any, chance: random.Random
) -> None:
    content = tomllib.loads(text)
    table = chance.choice([place for place, _ in _places(content) if isinstance(place, dict)])
    if chance.random() < 0.5:
        table[name] = table.pop(chance.choice(list(table)))
    else:
        table[name] = value
    robot_or_sentence(_toml(content))


def _places(content: Any) -> list[tuple[Any, Any]]:
    """Every (container, key or index) of nested tables and lists."""
    pairs = content.items() if isinstance(content, dict) else enumerate(content)
    found = [(content, key) for key, _ in pairs]
    inner = [item for item in _values(content) if isinstance(item, dict | list)]
    return found + [place for item in inner for place in _places(item)]


def _values(content: Any) -> list[Any]:
    return list(content.values()) if isinstance(content, dict) else list(content)


def _toml(content: dict[str, Any]) -> str:
    return tomli_w.dumps(_without_none(content))


def _without_none(value: Any) -> Any:
    """TOML has no null; a key without a value is a key that is not there."""
    if isinstance(value, dict):
        return {key: _without_none(item) for key, item in value.items() if item is not None}
    if isinstance(value, list):
        return [_without_none(item) for item in value if item is not None]
    return value
